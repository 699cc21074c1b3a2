"""Static parameters by a grid over v_s with linear least squares inside, (10)-(13): variable projection.

For each v_s the other parameters are solved exactly, so the cost as a function of v_s is its profile. All grid values are solved in a few array
operations; the minimum is then refined to the continuous one.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from math import exp, log

import numpy as np

from bristle.arrays import Array
from bristle.errors import InputError
from bristle.estimation.levenberg_marquardt import minimise
from bristle.identification.static.problem import Regression
from bristle.identification.static.projection import Inner, Projected, solve_at
from bristle.identification.static.unknowns import least_squares
from bristle.model.parameters import ParameterName

GRID = 32
"""Values of v_s in the refined grid."""
PLAIN_GRID = 500
"""Values of v_s in the paper's plain grid."""
_TO_QUARTIC = np.linalg.inv(np.vander(np.arange(-2.0, 3.0)))
"""From five equally spaced values to the coefficients of the polynomial through them, highest power first."""
_BLOCK = 500
"""Values of v_s worked on at a time, of many sets."""
_STEPS = 20
_SETTLED = 1e-12
"""A further step is not worth it if it lowers the cost by less than this part of the residuals' variance."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Solution:
    """A solved static problem: at its continuous minimum what `Inner` says, and the grid."""

    theta: Array
    cost: float
    residuals: Array
    jacobian: Array
    at_bound: tuple[ParameterName, ...]
    base_costs: tuple[float, ...]
    """Per peak, the cost without it."""
    grid: Array
    """v_s, rad/s, (k,)."""
    profiles: tuple[Array, ...]
    """Per peak, the cost on the grid, minimised over all other parameters, (k,)."""


def default_range(velocity: Array) -> tuple[float, float]:
    """Where v_s is searched: from a third of the slowest speed to the fastest, rad/s.

    Below, the Stribeck term touches no point (exp(-9)); above, it is a bend over all of them and not a peak. Moving data pass through every
    speed down to noise: nothing slower than a thousandth of the fastest counts.
    """
    speed = np.abs(velocity[velocity != 0])
    high = float(speed.max())
    low = max(float(speed.min()), 1e-3 * high) / 3
    return low, high


def log_grid(v_s_range: tuple[float, float], grid: int) -> Array:
    """Values of v_s spaced evenly in log(v_s), both ends included, (grid,)."""
    low, high = v_s_range
    values: Array = low * np.exp(np.arange(grid) * (np.log(high / low) / (grid - 1)))
    return values


def solve(problem: Regression, v_s_range: tuple[float, float], grid: int = GRID) -> Solution:
    """The grid over v_s, refined to its continuous minimum, with alpha_0, alpha_1, alpha_2 >= 0.

    Args:
        problem: n equations; more equations than linear parameters.
        v_s_range: lowest and highest v_s, rad/s, 0 < low < high.
        grid: values in it, >= 3, spaced evenly in log(v_s).
    """
    values = log_grid(v_s_range, grid)
    projected = Projected(problem)
    profiles: tuple[Array, ...] = ()
    bases: tuple[float, ...] = ()
    if not problem.peaks:
        inner = solve_at(problem, [])
    elif len(problem.peaks) == 1:
        profiles = (projected.costs(values),)
        bases = (projected.base_cost,)
        inner = _refine(projected, values, profiles[0])
    else:
        surface, bases = projected.surface(values, values)
        profiles = (surface.min(axis=1), surface.min(axis=0))
        first, second = np.unravel_index(surface.argmin(), surface.shape)
        inner = solve_at(problem, _descend(problem, [values[first], values[second]], v_s_range))
    return Solution(**inner._asdict(), base_costs=bases, grid=values, profiles=profiles)


def descended(
    problem: Regression, solution: Solution, v_s: Sequence[float], v_s_range: tuple[float, float]
) -> Solution:
    """The solution with the minimum nearest to other v_s, one per peak, in place of its own; what was solved on the grid stays."""
    inner = solve_at(problem, _descend(problem, list(v_s), v_s_range))
    return replace(solution, **inner._asdict())


def plain_grid(
    problem: Regression, v_s_range: tuple[float, float], count: int = PLAIN_GRID
) -> tuple[Array, Array, Array]:
    """The paper's method as it stands, (13): the best of `count` evenly spaced values of v_s, for a problem of one direction.

    Returns the grid (count,), J_s on it (count,), and theta at its best value.
    """
    values = np.linspace(*v_s_range, count)
    costs = Projected(problem).costs(values)
    return values, costs, solve_at(problem, [float(values[costs.argmin()])]).theta


def plain_grids(problem: Regression, torques: Array, v_s_range: tuple[float, float], count: int = PLAIN_GRID) -> Array:
    """`plain_grid`'s theta (p, sets) for torques (n, sets) at the problem's velocities: (13) at each value, for all sets in one matrix product.

    A set whose free solution at the best value breaks a bound is solved by itself.
    """
    projected, values = Projected(problem), np.linspace(*v_s_range, count)
    gain, best = np.full(torques.shape[1], -1.0), np.zeros(torques.shape[1], dtype=np.intp)
    for first in range(0, count, _BLOCK):
        off, length = projected.off(values[first : first + _BLOCK])
        gains = np.maximum(off.T @ torques, 0.0) ** 2 / length[:, None]
        lowest = gains.argmax(axis=0)
        higher = np.take_along_axis(gains, lowest[None], axis=0)[0]
        best = np.where(higher > gain, first + lowest, best)
        gain = np.maximum(gain, higher)
    v_s = values[best]
    off, length = projected.off(v_s)
    alpha_1 = np.maximum(np.einsum("ns,ns->s", off, torques), 0.0) / length
    inside = projected.q.T @ problem.shapes(v_s)
    linear = projected.back(projected.q.T @ torques - inside * alpha_1)
    theta = np.vstack([linear, alpha_1, v_s])
    for k in np.flatnonzero((linear <= projected.lower[:, None]).any(axis=0)).tolist():
        own = replace(problem, torque=torques[:, k].copy(), memory={})
        theta[:, k] = plain_grid(own, v_s_range, count)[2]
    return theta


def _refine(projected: Projected, values: Array, costs: Array) -> Inner:
    """The problem at the continuous minimum of the profile between the neighbours of its lowest grid value.

    The start is the minimum of the quartic through five grid values; from there the exact slope is followed by the secant method, to where
    rounding ends. By the envelope theorem -dJ_s/du / 2 = v_s alpha_1 s_v_s'r, with r the residuals at the inner minimum and u = log(v_s);
    with `bend` = J_s'' / 2, a step lowers the cost by slope**2 / bend.
    """
    best, last = int(costs.argmin()), values.size - 1
    first, step = float(values[0]), log(values[-1] / values[0]) / last
    low, high = step * max(best - 1, 0), step * min(best + 1, last)
    centre = min(max(best, 2), last - 2)
    t, bend = _lowest((_TO_QUARTIC @ costs[centre - 2 : centre + 3]).tolist(), best - centre)
    u, bend = min(max(step * (centre + t), low), high), bend / step**2
    at = lowest = projected.at(first * exp(u))
    for _ in range(_STEPS):
        fall = at.theta[-1] * float(at.jacobian[:, -1] @ at.residuals)
        low, high = (u, high) if fall > 0 else (low, u)
        if low >= high or 0 <= fall**2 <= bend * _SETTLED * at.cost / at.residuals.size:
            break
        before, u = u, min(max(u + fall / bend, low), high) if bend > 0 else (low + high) / 2
        if u == before:
            break
        at = projected.at(first * exp(u))
        lowest = min(lowest, at, key=lambda inner: inner.cost)
        bend = (fall - at.theta[-1] * float(at.jacobian[:, -1] @ at.residuals)) / (u - before)
    return lowest


def _lowest(quartic: list[float], t: float) -> tuple[float, float]:
    """Where a quartic near t is lowest, by Newton's method, and half its second derivative there."""
    a, b, c, d, _ = quartic
    bend = c
    for _ in range(4):
        bend = (6 * a * t + 3 * b) * t + c
        if bend <= 0:
            break
        t -= max(-1.0, min(1.0, (((4 * a * t + 3 * b) * t + 2 * c) * t + d) / (2 * bend)))
    return t, bend


def _descend(problem: Regression, v_s: list[float], v_s_range: tuple[float, float]) -> list[float]:
    """The v_s of every direction at the continuous minimum near some of them."""
    posed = least_squares(problem, v_s_range)
    start = posed.unknowns.scaled(dict(zip(problem.names, solve_at(problem, v_s).theta.tolist(), strict=True)))
    with suppress(InputError):  # where nothing depends on v_s, they stay
        lower, upper = posed.unknowns.lower, posed.unknowns.upper
        start = minimise(posed.evaluate, start, lower, upper, settled=_SETTLED).x
    return [float(x) for x in posed.unknowns.natural(start)[len(problem.names) - len(v_s) :]]
