"""A least-squares problem solved from several starts: the lowest minimum, how many reached it, and what is known there."""

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
SAME, _OF_VARIANCE = 1e-6, 1e-2
"""Two minima are the same where their costs differ by less than this share of them, or of a residual's variance: a tenth
of a standard error, while a descent ends within a hundredth."""
_NOTHING = 1e-20  # a cost below this is none


class MultistartSolution(NamedTuple, Generic[Name]):
    """The lowest minimum, with what is known of it; from `scaled_errors` on as in `Covariance`."""

    posed: LeastSquares[Name]
    """The problem of which it is the minimum."""
    minimum: Minimum
    names: tuple[Name, ...]
    values: Mapping[Name, float]
    starts: int
    reached: int
    """How many starts ended at the same cost."""
    scaled_errors: Array
    covariance: Array
    freedom: float
    widening: float
    freedoms: Array


def solve_from_starts(
    solve: Callable[[Start, int, float], tuple[LeastSquares[Name], Minimum]],
    starts: Sequence[Start],
    finish: Callable[[LeastSquares[Name], Minimum], tuple[LeastSquares[Name], Minimum]],
    progress: Progress | None = None,
    known: tuple[LeastSquares[Name], Minimum] | None = None,
) -> MultistartSolution[Name]:
    """The lowest minimum from several starts, and the covariance there.

    `solve` poses the problem about a start and descends from there in so many steps at most; it may give up above the lowest
    cost known, its last argument. A start where nothing depends on anything is passed over once an end is known, as one
    `known` and finished before. `finish` is what is still done at the lowest end. Raises InputError as `solve` does.
    """
    ends, count = [known] if known else [], len(starts) + (known is not None)
    tell = teller(progress, len(starts))
    for start in starts:
        tell("fitting the moving runs")
        with suppress(*[InputError] * bool(ends)):
            ends.append(solve(start, _STEPS, min([end.cost for _, end in ends], default=np.inf)))
    lowest = min(ends, key=lambda end: end[1].cost)
    posed, minimum = lowest if lowest is known else finish(*lowest)
    same = minimum.cost * (1 + max(SAME, _OF_VARIANCE / minimum.residuals.size)) + _NOTHING
    reached = max(sum(end.cost <= same for _, end in ends), 1)
    names, values = posed.unknowns.names, posed.unknowns.values(minimum.x)
    return MultistartSolution(posed, minimum, names, values, count, reached, *covariance_at(posed, minimum))
