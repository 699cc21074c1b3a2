"""Least squares from several starts."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from bristle.arrays import Array
from bristle.errors import InputError
from bristle.estimation.covariance import covariance_at
from bristle.estimation.nonlinear import LeastSquares, Minimum, Name
from bristle.progress import Progress, teller

Start = TypeVar("Start")
_STEPS = 60  # of a descent from a start
SAME, _OF_VARIANCE = 1e-6, 1e-2  # of a cost, of a residual's variance: closer costs are the same minimum
_NOTHING = 1e-20  # smaller costs are zero


class MultistartSolution(NamedTuple, Generic[Name]):
    """The lowest minimum and the covariance of its shared unknowns, as in `Covariance`."""

    posed: LeastSquares[Name]
    minimum: Minimum
    names: tuple[Name, ...]  # Of the shared unknowns, (k,)
    values: Mapping[Name, float]  # Of all
    starts: int
    reached: int  # Starts that ended at that cost
    scaled_errors: Array
    covariance: Array
    freedom: float
    widening: float
    freedoms: Array

    @property
    def errors(self) -> dict[Name, float]:
        """Standard error of each shared unknown in its unit, of a logarithm as it is."""
        scale = self.posed.unknowns.scale[: len(self.names)]
        return dict(zip(self.names, (self.scaled_errors * scale).tolist(), strict=True))


def solve_from_starts(
    solve: Callable[[Start, int, float], tuple[LeastSquares[Name], Minimum]],
    starts: Sequence[Start],
    finish: Callable[[LeastSquares[Name], Minimum], tuple[LeastSquares[Name], Minimum]],
    progress: Progress | None = None,
    known: tuple[LeastSquares[Name], Minimum] | None = None,
    cost: Callable[[LeastSquares[Name], Minimum], float] = lambda _, end: end.cost,
) -> MultistartSolution[Name]:
    """The lowest minimum from several starts, and its covariance.

    `solve` descends from a start in at most so many steps, and may give up above the lowest cost known; a start without
    influence is passed over once an end is `known`. `finish` completes the lowest end. Raises InputError as `solve`
    does. Ends are ranked by a `cost`.
    """
    ends, count = [known] if known else [], len(starts) + (known is not None)
    tell = teller(progress, len(starts))
    for start in starts:
        tell("fitting the moving runs")
        with suppress(*[InputError] * bool(ends)):
            ends.append(solve(start, _STEPS, min([end.cost for _, end in ends], default=np.inf)))
    lowest = min(ends, key=lambda end: cost(*end))
    posed, minimum = lowest if lowest is known else finish(*lowest)
    same = minimum.cost * (1 + max(SAME, _OF_VARIANCE / minimum.residuals.size)) + _NOTHING
    reached = max(sum(end.cost <= same for _, end in ends), 1)
    names, values = posed.unknowns.names[: posed.shared], posed.unknowns.values(minimum.x)
    return MultistartSolution(posed, minimum, names, values, count, reached, *covariance_at(posed, minimum))
