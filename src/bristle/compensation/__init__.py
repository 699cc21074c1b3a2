"""Compensation of an identified joint: the paper's experiments 3.3 to 5 in closed loop, what goes beyond them, and replays of measured motion."""
