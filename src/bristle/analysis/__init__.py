"""How far to trust, and what to do next: sensitivity, the grid method on trial, planned experiments, models and sessions side by side."""
