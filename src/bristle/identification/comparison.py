"""Comparison of friction models, or laws, fitted to the same equations: BIC and errors on left-out data."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array, Number
from bristle.estimation.information import bic, power_of
from bristle.findings import Finding

SYMMETRIC, APART = "symmetric", "per direction"
_BLOCKS = 5
Data = Literal["points", "moving runs"]
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
    left_out: Number | None = None
    """Of a law: relative error on left-out blocks of speed, percent."""
    candidate: bool = True
    """Whether it may be chosen: it has the terms that the fit supports; a law: `fit.law: auto` may take it."""
    chosen: bool = False
    """Whether it is the one to use."""


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

    @property
    def chosen(self) -> Row:
        """The row to use. Raises StopIteration where there is none."""
        return next(row for row in self.rows if row.chosen)

    def row(self, name: str) -> Row | None:
        """The row of a name, or None."""
        return next((row for row in self.rows if row.name == name), None)


class Fitted(NamedTuple):
    """A model as fitted to every solve."""

    name: str
    solves: Sequence[tuple[Array, int, float, float]]
    """Of each solve: residuals (n,), parameters, independent equations, power of the measured torque."""
    candidate: bool = True
    """As in `Row`."""
    predicts: Callable[[], LeftOut] = lambda: None
    """The left-out error, evaluated only where it is needed."""
    itself: float = 0.0
    """Subtracted from BIC where the law makes torque of the measured torque."""

    @property
    def size(self) -> int:
        """Equations of all solves."""
        return sum(residuals.size for residuals, *_ in self.solves)

    @property
    def effective(self) -> float:
        """Number of independent equations of all solves."""
        return float(sum(independent for *_, independent, _ in self.solves))


def blocks_of_speed(velocity: Array) -> list[NDArray[np.bool_]]:
    """Masks, (n,), of five blocks of equations by speed, slowest first."""
    part = np.empty(velocity.size, dtype=int)
    part[np.argsort(np.abs(velocity), kind="stable")] = np.arange(velocity.size) * _BLOCKS // velocity.size
    return [part == k for k in range(_BLOCKS)]


def rows_of(fitted: Sequence[Fitted]) -> list[Row]:
    """The models as rows without left-out errors, none chosen."""
    marks, rows = [sum(bic(*solve) for solve in x.solves) - x.itself for x in fitted], list[Row]()
    for x, mark in zip(fitted, marks, strict=True):
        squares, power = sum(power_of(r) for r, *_ in x.solves), sum(measured for *_, measured in x.solves)
        row = Row(
            name=x.name, parameters=sum(count for _, count, *_ in x.solves), rms=float(np.sqrt(squares / x.size)),
            relative_error=100 * float(np.sqrt(squares / power)) if power else None, bic=float(mark - min(marks)),
            candidate=x.candidate,
        )  # fmt: skip  # a list of values
        rows.append(row)
    return rows
