"""Least squares and statistics that know nothing of friction."""
