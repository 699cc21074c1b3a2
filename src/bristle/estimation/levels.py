"""Levels of the tests that decide, and of the intervals that are stated: each once, with its reason."""

CONFIDENCE = 0.95
"""Of every interval."""
SIGNIFICANCE = 0.01
"""Of a test that takes a term in, leaves a point out or says that runs differ; shared among what it tries (Bonferroni)."""
RARE = 1e-3
"""Of a test that every experiment undergoes unasked, and that changes or warns of what the user set up."""
NO_SIGN = 0.5
"""Noise alone shows as much in half of all cases."""
NAMED = 0.05
"""Of sessions or joints that are compared (Holm): one comparison in twenty names a change where there is none."""
