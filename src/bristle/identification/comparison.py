"""Comparison of friction models, or laws, fitted to the same equations: BIC, weights exp(-BIC / 2), left-out errors."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array, Interval, Number
from bristle.estimation.information import bic, power_of
from bristle.findings import Finding
from bristle.model.parameters import ParameterName

SYMMETRIC, APART = "symmetric", "per direction"
ONE = "one direction"  # models are then named without it
GAIN = 10.0  # of BIC: very strong evidence (Kass and Raftery 1995), required of another law or of two directions
_BLOCKS = 5
Data = Literal["points", "moving runs"]
Known = Mapping[ParameterName, tuple[float, float, float]]
"""Value, standard error and degrees of freedom of each parameter at no bound."""
LeftOut = float | None
"""100 * norm(error) / norm(measured), percent, of left-out data, predicted from the rest; None for too few."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One model."""

    name: str
    """The model, or the law as `fit.law` takes it."""
    parameters: int
    """Fitted parameters, the noise variance not counted."""
    rms: Number
    """Root mean square residual, N*m."""
    relative_error: Number | None = None
    """100 * norm(residual) / norm(measured), percent."""
    bic: Number
    """BIC above the lowest of all."""
    left_out: Number | None
    """Relative error on held-out runs, points or blocks of speed, percent."""
    weight: Number = float("nan")
    """Share of exp(-BIC / 2) among all."""
    in_force: bool = False
    """Whether the fits use this law."""
    candidate: bool = True
    """Whether it may be chosen: it has the terms that the fit supports; a law: `fit.law: auto` may take it."""
    chosen: bool = False
    """Whether it is the one to use."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Averaged:
    """A parameter averaged over laws by their weights."""

    value: Number
    standard_error: Number
    interval: Interval
    """95 %."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Models side by side."""

    data: Data
    n: int
    """Equations."""
    effective: Number = float("nan")
    """Number of independent equations."""
    rows: tuple[Row, ...]
    sentence: Finding
    """Which to use, and why."""
    left_out: tuple[Finding, ...] = ()
    """What is not compared, and why."""
    averaged: Mapping[ParameterName, Averaged] = field(default_factory=dict)
    """Parameters with the same meaning in every law; empty where one law has nearly all the weight, and for models."""

    @property
    def chosen(self) -> Row:
        """The row to use. Raises StopIteration where there is none."""
        return next(row for row in self.rows if row.chosen)

    def under(self, law: str) -> "Comparison":
        """The same comparison where the fits use this law."""
        return replace(self, rows=tuple(replace(row, in_force=row.name == law) for row in self.rows))

    def row(self, name: str) -> Row | None:
        """The row of a name, or None."""
        return next((row for row in self.rows if row.name == name), None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Fitted:
    """A model as fitted to every solve."""

    name: str
    solves: Sequence[tuple[Array, int, float, float]]
    """Of each solve: residuals (n,), parameters, independent equations, power of the measured torque."""
    itself: float = 0.0  # Subtracted from BIC where the law makes torque of the measured torque
    left_out: LeftOut = None
    candidate: bool = True  # As in `Row`
    predicts: Callable[[], LeftOut] = lambda: None  # The left-out error, evaluated only where it is needed
    known: Known = field(default_factory=dict)

    @property
    def size(self) -> int:
        """Equations of all solves."""
        return sum(residuals.size for residuals, *_ in self.solves)


def blocks_of_speed(velocity: Array) -> list[NDArray[np.bool_]]:
    """Masks, (n,), of five blocks of equations by speed, slowest first."""
    part = np.empty(velocity.size, dtype=int)
    part[np.argsort(np.abs(velocity), kind="stable")] = np.arange(velocity.size) * _BLOCKS // velocity.size
    return [part == k for k in range(_BLOCKS)]


def rows_of(fitted: Sequence[Fitted], in_force: str = "") -> tuple[Row, ...]:
    """The models as rows with weights (Burnham and Anderson, 2002), none chosen; `in_force` is the fits' law."""
    marks, rows = np.array([sum(bic(*x) for x in one.solves) - one.itself for one in fitted]), list[Row]()
    above = marks - marks.min()
    weights = np.exp(-above / 2) / np.exp(-above / 2).sum()
    for x, lies, weight in zip(fitted, above.tolist(), weights.tolist(), strict=True):
        squares, power = sum(power_of(r) for r, *_ in x.solves), sum(explained for *_, explained in x.solves)
        row = Row(
            name=x.name, parameters=sum(count for _, count, *_ in x.solves), rms=float(np.sqrt(squares / x.size)),
            relative_error=100 * float(np.sqrt(squares / power)) if power else None, bic=lies, left_out=x.left_out,
            weight=weight, in_force=x.name == in_force, candidate=x.candidate,
        )  # fmt: skip  # a list of values
        rows.append(row)
    return tuple(rows)
