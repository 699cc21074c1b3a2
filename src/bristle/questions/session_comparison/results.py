"""The values of a comparison of two sessions: what each says, and what differs."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf, isfinite
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bristle.arrays import Array, result
from bristle.findings import Finding
from bristle.identification.fits import Estimate
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import Law
from bristle.model.parameters import Kind, ParameterName, of_curve

if TYPE_CHECKING:
    import pandas as pd


@result
class SessionFit:
    """What one fit of a session says."""

    source: str
    """`joint`, `tracking`, `static +`, `presliding -`, ..."""
    parameters: Mapping[ParameterName, Estimate]
    names: tuple[ParameterName, ...] = ()
    """Those of the covariance."""
    covariance: Array = field(default_factory=lambda: np.zeros((0, 0)))
    freedom: float = inf
    """Degrees of freedom."""
    distrusted: Finding | None = None
    """Why it is not to be trusted, if so: then it is used last."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionJoint:
    """One joint in one session."""

    kind: Kind
    fits: tuple[SessionFit, ...]
    """The one to use first stands first."""
    law: Law = GAUSSIAN
    """Of its friction."""
    simulated: bool = False
    torque_scale: Finding | None = None
    """As of a `Joint`."""
    inputs: tuple[str, ...] = ()
    """Checksums of its files."""


Session = Mapping[str, SessionJoint]
"""Joints by name."""


class FitPair(NamedTuple):
    """The fits of two sessions that are of one kind."""

    first: SessionFit
    second: SessionFit

    @property
    def distrusted(self) -> Finding | None:
        """Why the first of them is not to be trusted, else why the second is not; None where both are."""
        return self.first.distrusted or self.second.distrusted


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """One parameter of one joint in both sessions."""

    joint: str
    parameter: ParameterName
    unit: str
    source: str
    """Of both values; empty where they cannot be compared."""
    first: Estimate | None
    second: Estimate | None
    difference: float | None = None
    """Second less first, in `unit`."""
    error: float | None = None
    """Standard error of the difference, in `unit`."""
    z: float | None = None
    """Their ratio, of logarithms where the parameter is known by a factor."""
    p: float | None = None
    """How often chance alone would make it as large."""
    adjusted: float | None = None
    """Holm's, for all comparisons made."""
    changed: bool | None = None
    """Whether it did beyond the joint uncertainty; None where that cannot be told."""
    verdict: Finding
    """What became of it, or why that cannot be told."""

    @property
    def percent(self) -> float | None:
        """The difference in percent of the first session's value; None where there is none, or that value is zero."""
        if self.difference is None or self.first is None or not self.first.value:
            return None
        return 100 * self.difference / abs(self.first.value)


@dataclass(frozen=True, slots=True, kw_only=True)
class SetChange:
    """All parameters of one fit, compared at once."""

    joint: str
    source: str
    names: tuple[ParameterName, ...]
    statistic: float
    """d' (C_a + C_b)**-1 d over their number."""
    freedom: float
    p: float
    adjusted: float
    """Holm's, for all fits compared."""
    changed: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """What differs between two sessions. `bristle.report_of` gives its text, page and tables."""

    changes: tuple[Change, ...]
    sets: tuple[SetChange, ...]
    kinds: Mapping[str, Kind]
    """Of the joints compared."""
    sentence: Finding
    """The overall verdict."""
    hints: tuple[Finding, ...]
    """What such changes may come from: guesses."""
    warnings: tuple[Finding, ...]
    """What limits the comparison."""
    simulated: bool

    def to_frame(self) -> "pd.DataFrame":
        """One row per joint and parameter: both values, their difference with its joint uncertainty, and the verdict.

        nan where they cannot be compared.
        """
        import pandas as pd

        numbers = (
            "first_value", "first_error", "second_value", "second_error", "difference", "error", "z", "p", "adjusted_p",
        )  # fmt: skip  # a list of words
        rows = [
            (
                c.joint, c.parameter.name, c.parameter.direction, c.unit, c.source,
                *(x for e in (c.first, c.second) for x in ((e.value, e.standard_error) if e else (None, None))),
                c.difference, c.error, c.z, c.p, c.adjusted, c.changed, str(c.verdict),
            )
            for c in self.changes
        ]  # fmt: skip  # one row, one line
        columns = ["joint", "parameter", "direction", "unit", "source", *numbers, "changed", "verdict"]
        return pd.DataFrame(rows, columns=columns).astype({**dict.fromkeys(numbers, float), "changed": object})


def alike(name: str, first: Law, second: Law) -> bool:
    """Whether a parameter means the same in two laws: one of friction in sliding in one law alone.

    The tail of one peak, or a term, is the level alpha_0 or the viscous friction of another law: on one curve alpha_0
    may differ by tens of percent, and no cause is behind it.
    """
    return first == second or not of_curve(name)


def usable(e: Estimate) -> bool:
    """Whether it has a value, an error, and an interval closed on both sides."""
    numbers = (e.value, e.standard_error, *(e.interval or (None,)))
    return all(x is not None and isfinite(x) for x in numbers) and (e.standard_error or 0.0) > 0


def pairs(first: SessionJoint, second: SessionJoint) -> list[FitPair]:
    """Fits of one kind in both sessions, those to be trusted first, then in the order of use."""
    others = {fit.source: fit for fit in second.fits}
    found = [FitPair(fit, others[fit.source]) for fit in first.fits if fit.source in others]
    return sorted(found, key=lambda pair: bool(pair.distrusted))
