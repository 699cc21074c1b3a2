"""Results as figures, tables, one HTML page, and JSON."""
