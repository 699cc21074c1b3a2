"""The exact profile of every parameter of a static fit.

Where its cost, minimised over all other parameters, stays below a threshold. At given v_s the problem is linear, so
that the profiles of the others follow no path: see `estimation.conditional_profile`; eta is log(v_s).
"""

from collections.abc import Iterator
from functools import partial
from typing import NamedTuple

import numpy as np

from bristle.arrays import Array
from bristle.estimation.conditional_profile import Conditional, ConditionalProfiles, Face, Looks
from bristle.estimation.profile_likelihood import interval_on_grid, profile_threshold
from bristle.identification.static.grid import Projected, Solution, subsets
from bristle.identification.static.problem import Regression, reduced
from bristle.model.parameters import ParameterName

_LOOKS = (
    Looks(first=1, near=2, again=0, drawn=1),
    Looks(first=65, near=9, again=4, drawn=161),
    Looks(first=25, near=7, again=5, drawn=33),
)
"""Over how many v_s extremes are looked for, by the number of peaks."""
_DRAWN = 61
"""Values of a parameter at which its profile is drawn."""
_BEYOND = 0.5
"""How far beyond its interval, in widths of it."""
_AROUND = (0.5, 2.0, 101)
"""Of two peaks, where the other v_s is searched, over its best: from, to, values."""
_ROUNDING = 1e-13
"""Of what the linear columns leave of the torque: costs this near are the same."""


class StaticProfiles(NamedTuple):
    """The profiles of a solved problem."""

    intervals: dict[ParameterName, tuple[float, float]]
    """The 95 % interval of each parameter by its profile, by name."""
    threshold: float
    """What a parameter inside its interval costs at most."""
    problem: Regression
    """As it was profiled, in few equations."""
    linear: ConditionalProfiles
    """Of the linear parameters, alpha_1 among them."""

    @property
    def better(self) -> Array | None:
        """Values of v_s, (peaks,), at which the profiles met a cost lower than the solution's; None: they met none."""
        return None if self.linear.better is None else np.exp(self.linear.better)

    def curve(self, name: ParameterName, value: float, low: float, high: float) -> Array:
        """A linear parameter's profile about its estimate, (2, k).

        From half a width below its interval to half a width above.
        """
        j, wide = self.problem.names.index(name), high - low
        least = 0.0 if self.linear.bounded[j] else -np.inf
        ends = max(low - _BEYOND * wide, least), high + _BEYOND * wide
        values = np.unique([np.linspace(value, end, _DRAWN // 2) for end in ends])  # a skewed one is steep to one side
        return np.stack([values, self.linear.heights(j, values, _BEYOND)])


def profiled(problem: Regression, solution: Solution, variance_inflation: float = 1.0) -> StaticProfiles:
    """The profiles of a problem's solution.

    `variance_inflation` is by how much correlated residuals inflate the variance. v_s is open, 0 or inf, where its
    profile stays below the threshold to the end of the range; alpha_1 goes with it, and has no upper end then.
    """
    threshold = profile_threshold(solution.cost, problem.torque.size, len(problem.names), variance_inflation)
    few = reduced(problem, (float(solution.grid[0]), float(solution.grid[-1]))) if problem.peaks else problem
    peaks = len(problem.peaks)
    names, best = few.names[: len(few.names) - peaks], solution.theta[solution.theta.size - peaks :]
    v_s = _of_v_s(few, solution, best, threshold)
    box = np.array([np.clip(ends, solution.grid[0], solution.grid[-1]) for ends in v_s.values()]).reshape(peaks, 2)
    bounded = np.isfinite(few.least[: len(names)])
    free = Projected(few)

    def faces(j: int) -> Iterator[Face]:
        """Every face on which parameter j is free."""
        may_vanish = [name for k, name in enumerate(names) if bounded[k] and k != j]
        return (_over_log(Projected(few, dropped)) for dropped in subsets(may_vanish))

    linear = ConditionalProfiles(
        free=_over_log(free),
        faces=faces,
        bounded=bounded,
        best=np.log(best)[None],
        cost=np.array([solution.cost]),
        threshold=np.array([threshold]),
        box=np.log(box)[None],
        searched=(float(np.log(solution.grid[0])), float(np.log(solution.grid[-1]))),
        looks=_LOOKS[peaks],
        tolerance=_ROUNDING * free.rest_cost,
    )
    intervals = dict(zip(names, map(tuple, linear.intervals()[0].tolist()), strict=True))
    for name, (low, high) in v_s.items():
        if low == 0 or not np.isfinite(high):
            alpha_1 = name._replace(name="alpha_1")
            intervals[alpha_1] = intervals[alpha_1][0], np.inf
    return StaticProfiles(intervals | v_s, threshold, few, linear)


def _over_log(projected: Projected) -> Face:
    return lambda log_v_s: Conditional(*(each[None] for each in projected.conditional(np.exp(log_v_s[0]))))


def others(solution: Solution, peaks: int, peak: int) -> Array:
    """Over which values of the other v_s the profile of a peak's own is minimised, where there are two.

    Near its best, and the grid, (k,).
    """
    other = float(solution.theta[solution.theta.size - 1 - peak])
    return solution.grid if peaks < 2 else np.append(other * np.geomspace(*_AROUND), solution.grid)


def _of_v_s(
    problem: Regression, solution: Solution, best: Array, threshold: float
) -> dict[ParameterName, tuple[float, float]]:
    """The interval of v_s of each peak; of two, the other's v_s is searched on the grid and near its best."""
    projected, peaks = Projected(problem), len(problem.peaks)
    intervals = {}
    for k, name in enumerate(problem.names[len(problem.names) - peaks :]):
        costs = partial(projected.profile, peak=k, others=others(solution, peaks, k))
        intervals[name] = interval_on_grid(costs, solution.grid, costs(solution.grid), float(best[k]), threshold)
    return intervals
