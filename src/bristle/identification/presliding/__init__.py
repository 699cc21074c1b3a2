"""sigma_0 and sigma_1 from slow loading, (14) and (15)."""
