"""What data must hold for a parameter to be claimed."""

SEEN = 1.5
"""Speeds beyond this many v_s, where 9/10 of the Stribeck term is gone, must be there to call it one: else alpha_0 is not seen alone."""
