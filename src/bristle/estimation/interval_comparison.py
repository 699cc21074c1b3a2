"""Comparison of three intervals of one parameter."""

from collections.abc import Sequence

import numpy as np

from bristle.estimation.levels import FACTOR, FEW
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
        message = f"No bootstrap: {few} are too few to resample; at least {FEW} are needed."
        none = (Finding("no-bootstrap", NOTE, message, {"few": few, "least": FEW}),)
    known = {"covariance": covariance, "profile": profile, "bootstrap": bootstrap}
    ends = tuple((name, *interval) for name, interval in known.items() if interval is not None)
    reaches = {name: (value - low, high - value) for name, low, high in ends}
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
    return (*none, they_differ(sides, ends, why))


def they_differ(sides: Sequence[str], ends: Sequence[tuple[str, float, float]], reason: Finding) -> Finding:
    """The finding on intervals, each a method and its ends, that differ on some `sides` of the estimate."""
    told = ", ".join(f"{name} {low:.4g} to {high:.4g}" for name, low, high in ends)
    message = (
        f"The 95 % bounds {' and '.join(sides)} the estimate differ by more than 1.5x between the methods ({told}): "
        f"{reason.message}."
    )
    numbers = {"sides": tuple(sides), "ends": tuple(ends), "reason": reason}
    return Finding("intervals-differ", NOTE, message, numbers)


def _part(reaches: Sequence[float], value: float) -> bool:
    """Whether reaches differ by more than FACTOR, rounding apart."""
    return len(reaches) > 1 and max(reaches) > FACTOR * max(min(reaches), 0.0) + _ROUNDING * abs(value)
