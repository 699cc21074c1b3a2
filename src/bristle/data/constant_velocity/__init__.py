"""Segments of constant velocity in a log: found, described, accepted or rejected."""
