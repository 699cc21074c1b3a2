"""Levels of tests and intervals."""

CONFIDENCE = 0.95
"""Of every interval."""
SIGNIFICANCE = 0.01
"""Of a test that adds a term, leaves a point out or separates runs; Bonferroni over what it tries."""
RARE = 1e-3
"""Of a test that every experiment undergoes and that warns of the user's set-up."""
NO_SIGN = 0.5
"""Noise alone shows as much in half of all cases."""
NAMED = 0.05
"""Of compared sessions or joints (Holm): one false change in twenty comparisons."""
