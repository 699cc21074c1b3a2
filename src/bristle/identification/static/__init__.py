"""Static parameters, (9) to (12): the grid over v_s with linear least squares, and how far to trust it."""
