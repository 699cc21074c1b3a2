"""Exact profiles of the parameters of a static fit (`estimation.conditional_profile`, eta = log(v_s))."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq, minimize

from bristle.arrays import Array
from bristle.estimation.conditional_profile import ConditionalProfiles, Face, Looks
from bristle.estimation.profile_likelihood import interval_on_grid, profile_threshold
from bristle.identification.fits import Profile
from bristle.identification.static.grid import Projected, Solution, solve, subsets
from bristle.identification.static.problem import Regression
from bristle.model.parameters import Direction, ParameterName

_LOOKS = (
    Looks(first=1, near=2, again=0, drawn=1),
    Looks(first=65, near=9, again=4, drawn=161),
    Looks(first=25, near=7, again=5, drawn=33),
)
"""Over how many v_s extremes are looked for, by the number of peaks."""
_DRAWN = 61  # values on a drawn profile
_NEAR = 40  # values of v_s around the minimum on a drawn profile
_BEYOND = 0.5  # drawn range beyond the interval, in widths
_AROUND = (0.5, 2.0, 101)  # range of the other v_s of two peaks, over its best: from, to, values
_ROUNDING = 1e-13  # of the torque off the linear columns: closer costs are equal
_FIRST = 7  # logarithmic values of a shape parameter tried first
_SETTLED, _SAME = 1e-4, 1e-9  # tolerances of its logarithm, and of the cost
_WITHIN = 5  # values within its interval at which the others' intervals are evaluated


class StaticProfiles(NamedTuple):
    """Profiles of a solved problem."""

    intervals: dict[ParameterName, tuple[float, float]]  # 95 % intervals, by name
    threshold: float  # The largest cost within an interval
    problem: Regression
    linear: ConditionalProfiles | None  # Of the linear parameters, alpha_1 included; None of moving data

    def curve(self, name: ParameterName, value: float, low: float, high: float) -> Array:
        """A linear parameter's profile, (2, k), to half a width beyond its interval; empty of moving data."""
        if self.linear is None:
            return np.zeros((2, 0))
        j, wide = self.problem.names.index(name), high - low
        least = 0.0 if self.linear.bounded[j] else -np.inf
        ends = max(low - _BEYOND * wide, least), high + _BEYOND * wide
        values = np.unique([np.linspace(value, end, _DRAWN // 2) for end in ends])  # steep on one side if skewed
        return np.stack([values, self.linear.heights(j, values, _BEYOND)])


def profiled(
    problem: Regression, solution: Solution, variance_inflation: float = 1.0, threshold: float | None = None
) -> StaticProfiles:
    """The profiles of a solution, of moving data those of v_s alone; v_s is open, 0 or inf, where its profile stays below."""
    if threshold is None:
        parameters = len(problem.names) + len(problem.shape)
        threshold = profile_threshold(solution.cost, problem.torque.size, parameters, variance_inflation)
    peaks = len(problem.peaks)
    names, best = problem.names[: len(problem.names) - peaks], solution.theta[solution.theta.size - peaks :]
    projected, v_s = Projected(problem), dict[ParameterName, tuple[float, float]]()
    for k, name in enumerate(problem.names[len(names) :]):
        # of two, the other's v_s is searched on the grid and near its best
        costs = partial(projected.profile, peak=k, others=others(solution, peaks, k))
        v_s[name] = interval_on_grid(costs, solution.grid, costs(solution.grid), float(best[k]), threshold)
    if problem.smooth is not None:
        return StaticProfiles(v_s, threshold, problem, None)
    box = np.array([np.clip(ends, solution.grid[0], solution.grid[-1]) for ends in v_s.values()]).reshape(peaks, 2)
    bounded = np.isfinite(problem.least[: len(names)])

    def over_log(projected: Projected) -> Face:
        return lambda log_v_s: projected.conditional(np.exp(log_v_s))

    def faces(j: int) -> Iterator[Face]:
        """Every face on which parameter j is free."""
        may_vanish = [name for k, name in enumerate(names) if bounded[k] and k != j]
        return (over_log(Projected(problem, dropped)) for dropped in subsets(may_vanish))

    linear = ConditionalProfiles(
        free=over_log(projected), faces=faces, bounded=bounded, best=np.log(best), cost=solution.cost,
        threshold=threshold, box=np.log(box),
        searched=(float(np.log(solution.grid[0])), float(np.log(solution.grid[-1]))), looks=_LOOKS[peaks],
        tolerance=_ROUNDING * projected.rest_cost,
    )  # fmt: skip  # a list of values
    intervals = dict(zip(names, map(tuple, linear.intervals().tolist()), strict=True))
    for name, (low, high) in v_s.items():
        if low == 0 or not np.isfinite(high):
            alpha_1 = name._replace(name="alpha_1")
            intervals[alpha_1] = intervals[alpha_1][0], np.inf
    return StaticProfiles(intervals | v_s, threshold, problem, linear)


def drawn_profiles(problem: Regression, solution: Solution, threshold: float) -> dict[Direction, Profile]:
    """The profile over v_s of each peak, for figures."""
    profiles = {}
    projected = Projected(problem)
    for k, direction in enumerate(problem.peaks):
        best = float(solution.theta[k - len(problem.peaks)])
        costs = partial(projected.profile, peak=k, others=others(solution, len(problem.peaks), k))
        # even in log(v_s), below ten times the threshold
        grid, low = solution.grid, solution.profiles[k] <= solution.cost + 10 * (threshold - solution.cost)
        near = np.append(np.flatnonzero(low), np.searchsorted(grid, best))
        first, last = max(int(near.min()) - 1, 0), min(int(near.max()) + 1, grid.size - 1)
        around = np.sort(np.append(np.geomspace(min(grid[first], best), max(grid[last], best), _NEAR), best))
        profiles[direction] = Profile(
            v_s=solution.grid, cost=solution.profiles[k], near_v_s=around, near_cost=costs(around),
            best=best, best_cost=solution.cost, threshold=threshold,
        )  # fmt: skip  # a list of values
    return profiles


def others(solution: Solution, peaks: int, peak: int) -> Array:
    """Values of the other of two v_s: near its best, and the grid, (k,)."""
    other = float(solution.theta[solution.theta.size - 1 - peak])
    return solution.grid if peaks < 2 else np.append(other * np.geomspace(*_AROUND), solution.grid)


def with_best_shape(problem: Regression, v_s_range: tuple[float, float]) -> Regression:
    """The problem with the best shape of its peak: of some values, refined over their logarithms."""
    if not problem.law.peak.own or not problem.peaks:
        return problem

    def shaped(u: Array) -> Regression:
        return replace(problem, shape=tuple(np.exp(u).tolist()))

    def cost(u: Array) -> float:
        return solve(shaped(u), v_s_range).cost

    box = np.log([own.searched for own in problem.law.peak.own])
    first = np.array(
        min(product(*(np.linspace(low, high, _FIRST) for low, high in box)), key=lambda u: cost(np.array(u)))
    )
    near = np.clip(first[:, None] + np.ptp(box, axis=1)[:, None] / (_FIRST - 1) * [-1, 1], box[:, :1], box[:, 1:])
    return shaped(minimize(cost, first, method="Powell", bounds=near, options={"xtol": _SETTLED, "ftol": _SAME}).x)


def own_columns(problem: Regression, solution: Solution) -> Array:
    """Derivatives of the modelled torque by the shape parameters, (n, k)."""
    columns = np.zeros((problem.torque.size, len(problem.shape) if problem.peaks else 0))
    if not columns.size:
        return columns
    linear, v_s = problem.split(solution.theta)
    alpha_1 = linear[problem.linear.shape[1] :]
    for peak, (height, at) in enumerate(zip(alpha_1.tolist(), v_s.tolist(), strict=True)):
        columns += height * np.concatenate(problem.own_slopes(at, peak), axis=1)
    return columns


def over_shapes(
    problem: Regression, likelihood: StaticProfiles, v_s_range: tuple[float, float]
) -> tuple[Mapping[ParameterName, tuple[float, float]], Mapping[str, tuple[float, float]]]:
    """Intervals over every allowed shape, and those of the shape parameters, 0 or inf where they do not end."""
    of_shape, every, threshold = dict[str, tuple[float, float]](), [likelihood.intervals], likelihood.threshold

    def solved(k: int, value: float) -> tuple[Regression, Solution]:
        """With another value of one shape parameter."""
        one = replace(problem, shape=(*problem.shape[:k], value, *problem.shape[k + 1 :]))
        return one, solve(one, v_s_range)

    def above(k: int, u: float) -> float:
        """Cost less threshold at its logarithm."""
        return solved(k, float(np.exp(u)))[1].cost - threshold

    for k, own in enumerate(problem.law.peak.own if problem.shape and problem.peaks else ()):
        ends, best = [], np.log(problem.shape[k])
        for end, beyond in zip(np.log(own.searched).tolist(), (0.0, np.inf), strict=True):
            inside = above(k, end) <= 0
            ends.append(beyond if inside else float(np.exp(brentq(partial(above, k), end, best, xtol=1e-3))))
        of_shape[own.name] = ends[0], ends[1]
        low, high = np.clip(ends, *own.searched).tolist()
        for value in np.geomspace(low, high, _WITHIN).tolist():
            one, solution = solved(k, value)
            if solution.cost <= threshold:
                every.append(profiled(one, solution, threshold=threshold).intervals)
    return {name: (min(x[name][0] for x in every), max(x[name][1] for x in every)) for name in every[0]}, of_shape
