"""Validation of the grid method at the design of a joint."""
