"""Static parameters, (9) to (12)."""
