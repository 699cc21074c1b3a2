"""What compensation of an identified joint is worth: the paper's sections 3.3 to 5, and beyond."""
