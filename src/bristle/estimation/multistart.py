"""A least-squares problem solved from several starts.

The lowest minimum, how many starts reached it, and what is known there.
"""

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from typing import Generic, NamedTuple, TypeVar

from bristle.arrays import Array
from bristle.errors import InputError
from bristle.estimation.covariance import covariance_at
from bristle.estimation.nonlinear import LeastSquares, Minimum, Name

Start = TypeVar("Start")
_STEPS, _TRIES = 60, 30
"""Of a descent from a start, and from a random one."""
_SAME = 1e-6
"""Relative difference in cost below which two minima are the same."""
_NOTHING = 1e-20
"""A cost below this is none."""


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


def solve_from_starts(
    solve: Callable[[Start, int], tuple[LeastSquares[Name], Minimum]],
    starts: Iterable[Start],
    random: Iterable[Start],
    finish: Callable[[LeastSquares[Name], Minimum], tuple[LeastSquares[Name], Minimum]],
) -> MultistartSolution[Name]:
    """The lowest minimum from several starts, and the covariance there.

    Args:
        solve: poses the problem about a start, and solves it from there in so many steps at most.
        starts: at least one.
        random: further starts; one where nothing depends on anything is passed over.
        finish: what is still done at the lowest end.

    Raises InputError as `solve` does.
    """
    ends = [solve(start, _STEPS) for start in starts]
    count = len(ends)
    for start in random:
        count += 1
        with suppress(InputError):
            ends.append(solve(start, _TRIES))
    posed, minimum = finish(*min(ends, key=lambda end: end[1].cost))
    reached = max(sum(end.cost <= minimum.cost * (1 + _SAME) + _NOTHING for _, end in ends), 1)
    names, values = posed.unknowns.names, posed.unknowns.values(minimum.x)
    return MultistartSolution(posed, minimum, names, values, count, reached, *covariance_at(posed, minimum))
