"""What the shape of a peak takes beside v_s, as the free exponent does: searched around the grid, which holds it.

The cost at its best v_s and linear parameters, as a function of such a parameter, is its profile: the interval comes of
it, as that of v_s does. Those of the others are the union over what the profile allows.
"""

from collections.abc import Callable, Mapping

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from bristle.arrays import Array
from bristle.identification.static.grid import Solution, solve
from bristle.identification.static.problem import Regression
from bristle.identification.static.profiles import StaticProfiles, profiled
from bristle.model.parameters import ParameterName

_FIRST = 7  # values even in their logarithm at which each parameter is tried first ...
_STEPS = 14  # ... and at most so many more, between the neighbours of the best
_SETTLED = 1e-4  # of its logarithm: a parameter that moves less is found
_WITHIN = 5  # values between the ends of its interval at which the intervals of the others are worked out


def with_best_shape(problem: Regression, v_s_range: tuple[float, float]) -> Regression:
    """The problem with the shape at which its cost is least; itself where its peak has nothing beside v_s."""
    if not problem.law.peak.own or not problem.peaks:
        return problem

    def cost(shape: tuple[float, ...]) -> float:
        """The least there is with this shape."""
        return solve(problem.with_shape(shape), v_s_range).cost

    best, _ = _searched(cost, tuple(own.searched for own in problem.law.peak.own))
    return problem.with_shape(best)


def _searched(
    cost: Callable[[tuple[float, ...]], float], ranges: tuple[tuple[float, float], ...]
) -> tuple[tuple[float, ...], float]:
    """Where a cost is least within ranges, one after another: for each value of the first, the best of the rest."""
    if not ranges:
        return (), cost(())
    (low, high), *rest = ranges

    def inner(u: float) -> tuple[tuple[float, ...], float]:
        """The best of the rest at a logarithm of the first."""
        own = float(np.exp(u))
        shape, least = _searched(lambda others: cost((own, *others)), tuple(rest))
        return (own, *shape), least

    values = np.linspace(np.log(low), np.log(high), _FIRST)
    first = [inner(u) for u in values.tolist()]
    k = int(np.argmin([least for _, least in first]))
    around = float(values[max(k - 1, 0)]), float(values[min(k + 1, values.size - 1)])
    found = minimize_scalar(
        lambda u: inner(float(u))[1], bounds=around, method="bounded", options={"xatol": _SETTLED, "maxiter": _STEPS}
    )
    return min(first[k], inner(float(found.x)), key=lambda x: x[1])


def own_columns(problem: Regression, solution: Solution) -> Array:
    """The derivative of the modelled torque with respect to each of the shape's parameters, (n, k)."""
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
    """The intervals of the problem's parameters, over every shape of the peak that the data allow; and those of the shape's."""
    if not problem.shape or not problem.peaks:
        return likelihood.intervals, {}
    of_shape, every = _shape_intervals(problem, v_s_range, likelihood.threshold), [likelihood.intervals]
    for k, own in enumerate(problem.law.peak.own):  # along each parameter of the shape, the others at their best
        low, high = (float(np.clip(end, *own.searched)) for end in of_shape[own.name])
        for value in np.geomspace(low, high, _WITHIN).tolist():
            one = problem.with_shape(_with(problem.shape, k, value))
            solution = solve(one, v_s_range)
            if solution.cost <= likelihood.threshold:
                every.append(profiled(one, solution, threshold=likelihood.threshold).intervals)
    return {name: (min(x[name][0] for x in every), max(x[name][1] for x in every)) for name in every[0]}, of_shape


def _shape_intervals(
    problem: Regression, v_s_range: tuple[float, float], threshold: float
) -> Mapping[str, tuple[float, float]]:
    """The 95 % interval of each of the shape's parameters, by name: where the cost stays below the threshold.

    An end is 0 or infinite where it does so to the end of what is searched.
    """
    intervals = {}
    for k, own in enumerate(problem.law.peak.own):
        at = problem.shape[k]
        low, high = own.searched

        def above(u: float, k: int = k) -> float:
            """By how much the cost passes the threshold at a logarithm, the other parameters at their best."""
            return solve(problem.with_shape(_with(problem.shape, k, float(np.exp(u)))), v_s_range).cost - threshold

        ends = []
        for end, beyond in ((low, 0.0), (high, np.inf)):
            inside = above(float(np.log(end))) <= 0
            ends.append(beyond if inside else float(np.exp(brentq(above, np.log(end), np.log(at), xtol=1e-3))))
        intervals[own.name] = (ends[0], ends[1])
    return intervals


def _with(shape: tuple[float, ...], k: int, value: float) -> tuple[float, ...]:
    """The shape with another value of one of its parameters."""
    return (*shape[:k], value, *shape[k + 1 :])
