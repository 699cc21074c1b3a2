"""Comparison of three intervals of one parameter."""

from collections.abc import Sequence

import numpy as np

from bristle.estimation import levels
from bristle.findings import CAUTION, NOTE, Finding

_ROUNDING = 1e-9
Interval = tuple[float, float] | None


def warnings(
    value: float,
    covariance: Interval,
    profile: Interval,
    bootstrap: Interval,
    *,
    at_bound: bool = False,
    few: str | None = None,
) -> tuple[Finding, ...]:
    """Notes and cautions where the reaches of the three intervals differ by more than `FACTOR`, with the reason.

    `at_bound`: whether the estimate lies at its physical bound; `few`: what is too few to resample, or None.
    """
    if at_bound:
        message = "At its physical bound of zero: the intervals are one-sided."
        return (Finding("intervals-at-bound", CAUTION, message),)
    none = tuple[Finding, ...]()
    if bootstrap is None and few:
        message = f"No bootstrap: {few} are too few to resample; at least {levels.FEW} are needed."
        none = (Finding("no-bootstrap", NOTE, message, {"few": few, "least": levels.FEW}),)
    known = {"covariance": covariance, "profile": profile, "bootstrap": bootstrap}
    reaches = {name: (value - x[0], x[1] - value) for name, x in known.items() if x is not None}
    both = zip(("below", "above"), zip(*reaches.values(), strict=True), strict=False)
    sides = [side for side, reach in both if _part(reach, value)]
    if not sides:
        return none
    nearest = reaches.get("profile", (1.0, 1.0))
    if not np.isfinite(nearest).all():
        message = "the cost stays low to the end of the range, so the data do not bound the parameter on that side"
        why = Finding("cost-stays-low", CAUTION, message)
    elif _part(nearest, 0.0):
        why = Finding("profile-skewed", CAUTION, "the profile is skewed, as no covariance is; use the profile")
    elif few:
        why = Finding("few-to-resample", CAUTION, f"{few} are few to resample; use the profile")
    else:
        message = "the residuals are less even or independent than covariance and profile assume; use the widest"
        why = Finding("uneven-residuals", CAUTION, message)
    message = f"The 95 % bounds {' and '.join(sides)} the estimate differ by more than 1.5x between the methods: {why.message}."
    return (*none, Finding("intervals-differ", NOTE, message, {"sides": tuple(sides), "reason": why}))


def _part(reaches: Sequence[float], value: float) -> bool:
    """Whether reaches differ by more than factor, rounding apart."""
    return len(reaches) > 1 and max(reaches) > levels.FACTOR * max(min(reaches), 0.0) + _ROUNDING * abs(value)
