"""Three intervals of one parameter side by side: where they part, and why."""

import numpy as np

from bristle.diagnostics import Kind
from bristle.findings import Finding

FACTOR = 1.5
"""Reaches to one side of an estimate that differ by more than this factor part."""
_ROUNDING = 1e-9
Interval = tuple[float, float] | None


def warnings(
    value: float,
    covariance: Interval,
    profile: Interval,
    bootstrap: Interval,
    *,
    at_bound: bool = False,
    few: Finding | None = None,
) -> tuple[Finding, ...]:
    """A diagnostic, with the reason, where the three intervals differ by more than `FACTOR`; else none.

    What is compared is how far each reaches to one side of the estimate.

    Args:
        value: the estimate.
        covariance: as in `Uncertainty`.
        profile: as in `Uncertainty`.
        bootstrap: as in `Uncertainty`.
        at_bound: whether the estimate lies at its physical bound, where a covariance means little.
        few: what there are few of; None where there are enough.
    """
    known = {"covariance": covariance, "profile": profile, "bootstrap": bootstrap}
    reaches = {
        name: (value - interval[0], interval[1] - value) for name, interval in known.items() if interval is not None
    }
    sides = [
        side for k, side in enumerate(("below", "above")) if _part([reach[k] for reach in reaches.values()], value)
    ]
    if at_bound or not sides:
        return ()
    ends = tuple((name, *interval) for name, interval in known.items() if interval is not None)
    return (Kind.INTERVALS_DIFFER(sides=tuple(sides), ends=ends, reason=_reason(reaches, few)),)


def _part(reaches: list[float], value: float) -> bool:
    """Whether the longest reach is more than FACTOR times the shortest; none where all are rounding."""
    return len(reaches) > 1 and max(reaches) > FACTOR * max(min(reaches), 0.0) + _ROUNDING * abs(value)


def _reason(reaches: dict[str, tuple[float, float]], few: Finding | None) -> Finding:
    below, above = reaches.get("profile", (1.0, 1.0))
    if not np.isfinite([below, above]).all():
        return Kind.COST_STAYS_LOW()
    if _part([below, above], 0.0):
        return Kind.PROFILE_SKEWED()
    if few:
        return Kind.FEW_TO_RESAMPLE(few=few)
    return Kind.UNEVEN_RESIDUALS()
