"""Comparison of two sessions: which parameters changed."""
