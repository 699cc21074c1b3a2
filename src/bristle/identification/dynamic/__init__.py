"""All parameters from moving runs."""
