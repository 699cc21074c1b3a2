"""Levels of tests and intervals, and sizes from which something is said."""

CONFIDENCE = 0.95  # of every interval
SIGNIFICANCE = 0.01  # of a test that adds a term, leaves a point out or separates runs; Bonferroni over what it tries
RARE = 1e-3  # of a test that every experiment undergoes and that warns of the user's set-up
NO_SIGN = 0.5  # noise alone shows as much in half of all cases
NAMED = 0.05  # of compared sessions or joints (Holm): one false change in twenty comparisons
FALSE_DISCOVERIES = 0.05  # share among the joints of a fleet that are said to have changed: one in twenty

POOR = 0.15  # of the measured torque: a larger pattern in what a fit leaves, and its parameters mean nothing
PATTERN = 3.3  # over sqrt(n): share of white noise outside its differences, exceeded once in 2000 times
EXPLAINS = 0.05  # of the residuals' squares: a term that explains less is not reported
MATTERS = 0.01  # of rms friction, or of a level: a smaller effect is a note
FEW, ENOUGH = 8, 20  # blocks: fewer give no bootstrap interval; below the second they explain one that differs
FACTOR = 1.5  # ratio of reaches from which intervals differ
FASTER = 30.0  # largest speed of a reference over the fastest measured: the law is extrapolated so far at most
