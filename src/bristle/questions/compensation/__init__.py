"""The effect of friction compensation on an identified joint: sections 3.3 to 5 of the paper, and beyond."""
