"""Static parameters by a grid over v_s with linear least squares inside, (10)-(13): variable projection.

For each v_s the other parameters are solved exactly, so the cost as a function of v_s is its profile. All grid values are solved in a few array
operations: with the linear columns projected out (Q from QR), one Stribeck column s leaves alpha_1 = s'r / s's and lowers the cost by
(s'r)**2 / s's. The minimum is then refined to the continuous one.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear, minimize

from bristle.identification.regression import Regression, from_points
from bristle.model.arrays import Array

GRID = 48
"""Values of v_s in the refined grid."""
PLAIN_GRID = 500
"""Values of v_s in the paper's plain grid."""
_NEWTON = 4
_NEIGHBOURS = np.arange(-2, 4)
_TO_POLYNOMIAL = np.linalg.inv(np.vander(_NEIGHBOURS.astype(float), increasing=True))
"""From six neighbouring values to the coefficients of their polynomial in t, which counts grid steps."""
_WINDOWS = 8
_CHEBYSHEV = np.polynomial.chebyshev.chebpts1(7)
_FINE = np.linspace(-1.0, 1.0, 257)
_CHEBYSHEV_TO_FINE = np.polynomial.chebyshev.chebvander(_FINE, 6) @ np.linalg.inv(
    np.polynomial.chebyshev.chebvander(_CHEBYSHEV, 6)
)
_FLAT = 1e-12
"""A Stribeck column this close to the others, relative, tells nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Solution:
    """A solved static problem."""

    theta: Array
    """The parameters at the continuous minimum, in the order of the problem's `names`."""
    cost: float
    """J_s (10) there."""
    base_costs: tuple[float, ...]
    """Per peak, the cost without it."""
    grid: Array
    """v_s, rad/s, (k,)."""
    profiles: tuple[Array, ...]
    """Per peak, the cost on the grid, minimised over all other parameters, (k,)."""
    at_bound: tuple[str, ...]
    """Parameters held at a physical bound."""


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
    v_s: list[float] = []
    profiles: tuple[Array, ...] = ()
    bases: tuple[float, ...] = ()
    if len(problem.peaks) == 1:
        profiles = (projected.costs(values),)
        bases = (projected.base_cost,)
        v_s = [_refine(projected, values, profiles[0])]
    elif problem.peaks:
        surface, bases = projected.surface(values, values)
        profiles = (surface.min(axis=1), surface.min(axis=0))
        first, second = np.unravel_index(surface.argmin(), surface.shape)
        v_s = _descend(problem, [values[first], values[second]], v_s_range)
    theta, cost, at_bound = solve_at(problem, v_s)
    return Solution(theta=theta, cost=cost, base_costs=bases, grid=values, profiles=profiles, at_bound=at_bound)


def plain_grid(
    problem: Regression, v_s_range: tuple[float, float], count: int = PLAIN_GRID
) -> tuple[Array, Array, Array]:
    """The paper's method as it stands, (13): the best of `count` evenly spaced values of v_s, for a problem of one direction.

    Returns the grid (count,), J_s on it (count,), and theta at its best value.
    """
    values = np.linspace(*v_s_range, count)
    costs = Projected(problem).costs(values)
    return values, costs, solve_at(problem, [float(values[costs.argmin()])])[0]


def solve_at(problem: Regression, v_s: list[float]) -> tuple[Array, float, tuple[str, ...]]:
    """Linear least squares (13) at given v_s, one per peak, bounded where the free solution breaks a bound.

    Returns theta, the cost, and the names of the parameters at a bound.
    """
    design = problem.design(v_s)
    solution = np.linalg.lstsq(design, problem.torque, rcond=None)[0]
    held: tuple[str, ...] = ()
    if solution.min() <= 0:  # an extra regressor may well be negative; a friction parameter may not
        lower = np.append(problem.lower, np.zeros(len(v_s)))
        if (solution < lower).any():
            solution = _bounded(design, problem.torque, lower)
        held = tuple(name for name, x, low in zip(problem.names, solution, lower, strict=False) if x <= low)
    residuals = problem.torque - design @ solution
    return np.append(solution, v_s), float(residuals @ residuals), held


class Projected:
    """A problem with its linear columns projected out."""

    def __init__(self, problem: Regression) -> None:
        """Factor the linear columns once."""
        self.problem = problem
        self.q, r = np.linalg.qr(problem.linear)
        self.r_inverse = np.linalg.inv(r)
        self.torque_in_q = self.q.T @ problem.torque
        self.rest = problem.torque - self.q @ self.torque_in_q
        self.rest_cost = float(self.rest @ self.rest)
        self.lower = problem.lower
        self.base_cost = self.rest_cost
        if (self.back(self.torque_in_q) < self.lower).any():
            self.base_cost = _bounded_cost(problem.linear, problem.torque, self.lower)

    def columns(self, v_s: Array, direction: int = 0) -> tuple[Array, Array, Array]:
        """Stribeck columns off the linear ones (n, k), their coefficients in Q (m, k), and their squared lengths (k,), inf where they vanish."""
        shapes = self.problem.shapes(v_s, direction)
        inside = self.q.T @ shapes
        off = shapes - self.q @ inside
        length = np.einsum("nk,nk->k", off, off)
        length[length <= _FLAT * (length + np.einsum("mk,mk->k", inside, inside))] = np.inf
        return off, inside, length

    def costs(self, v_s: Array) -> Array:
        """J_s at each v_s (k,), with alpha_0, alpha_1, alpha_2 >= 0; one peak."""
        off, inside, length = self.columns(v_s)
        alpha_1 = np.maximum((self.rest @ off) / length, 0.0)
        linear = self.back(self.torque_in_q[:, None] - inside * alpha_1)
        costs = np.maximum(self.rest_cost - alpha_1**2 * np.where(np.isinf(length), 0.0, length), 0.0)
        broken = (linear < self.lower[:, None]).any(axis=0)
        if broken.any():
            lower = np.append(self.lower, 0.0)
            for k in np.flatnonzero(broken):
                costs[k] = _bounded_cost(self.problem.design([v_s[k]]), self.problem.torque, lower)
        return costs

    def profile(self, v_s: Array, peak: int, others: Array) -> Array:
        """J_s at each v_s (k,) of one peak, minimised over all else, the other peak's v_s over `others`."""
        if len(self.problem.peaks) == 1:
            return self.costs(v_s)
        surface, _ = self.surface(v_s, others) if peak == 0 else self.surface(others, v_s)
        lowest: Array = surface.min(axis=1 - peak)
        return lowest

    def surface(self, first_v_s: Array, second_v_s: Array) -> tuple[Array, tuple[float, float]]:
        """J_s over v_s of two peaks, (k, l), with alpha_1 >= 0, and the least cost without each peak."""
        (off_0, _, length_0), (off_1, _, length_1) = self.columns(first_v_s, 0), self.columns(second_v_s, 1)
        along_0, along_1 = (self.rest @ off_0)[:, None], (self.rest @ off_1)[None, :]
        length_0, length_1 = length_0[:, None], length_1[None, :]
        across = off_0.T @ off_1
        with np.errstate(invalid="ignore", divide="ignore"):
            determinant = length_0 * length_1 - across**2
            first = (along_0 * length_1 - along_1 * across) / determinant
            second = (along_1 * length_0 - along_0 * across) / determinant
        alone_0 = np.maximum(along_0, 0.0) ** 2 / length_0
        alone_1 = np.maximum(along_1, 0.0) ** 2 / length_1
        inside = np.isfinite(determinant) & (determinant > 0) & (first > 0) & (second > 0)
        gain = np.where(inside, first * along_0 + second * along_1, np.maximum(alone_0, alone_1))
        without = (self.rest_cost - float(alone_1.max()), self.rest_cost - float(alone_0.max()))
        return np.maximum(self.rest_cost - gain, 0.0), without

    def back(self, in_q: Array) -> Array:
        """Linear parameters from their coefficients in Q, (m,) or (m, k)."""
        return self.r_inverse @ in_q


def solve_batch(
    velocity: Array, torques: Array, v_s_range: tuple[float, float], grid: int = GRID
) -> tuple[Array, Array]:
    """Many data sets that share their velocities, in a few matrix products (one direction, no extra regressors).

    The grid's projections serve all sets at once. Each set's minimum is then refined between grid values: what the profile is made of,
    s'r and s's, is interpolated over log(v_s) by polynomials through six neighbours.

    Args:
        velocity: rad/s, shape (n,), one sign or symmetric.
        torques: N*m, shape (n, sets).
        v_s_range: as in `solve`.
        grid: as in `solve`, >= 8.

    Returns:
        theta, shape (4, sets), in the order alpha_0, alpha_2, alpha_1, v_s; and the cost, shape (sets,). Sets whose minimum lies at the end
        of the range, or whose free solution breaks a bound, are solved one by one, as `solve` does.
    """
    projected = Projected(from_points(velocity, torques[:, 0], ("both",)))
    values = log_grid(v_s_range, grid)
    off, inside, length = projected.columns(values)
    products = np.hstack([projected.q, off]).T @ torques
    in_q, along = products[: projected.q.shape[1]], products[projected.q.shape[1] :]
    coarse = (np.maximum(along, 0.0) ** 2 / length[:, None]).argmax(axis=0)
    near = np.clip(coarse, 2, grid - 4) + _NEIGHBOURS[:, None]
    local_along = _TO_POLYNOMIAL @ np.take_along_axis(along, near, axis=0)
    local_length = _TO_POLYNOMIAL @ length[near]
    t = _steepest_gain(local_along, local_length)
    a, x = _horner(local_along, t), _horner(local_length, t)
    alpha_1 = a / x
    reached = np.stack([_horner(_TO_POLYNOMIAL @ row[near], t) for row in inside])
    linear = projected.back(in_q - reached * alpha_1)
    cost = np.einsum("ns,ns->s", torques, torques) - np.einsum("ms,ms->s", in_q, in_q) - a * alpha_1
    v_s = values[near[2]] * (values[1] / values[0]) ** t
    theta = np.vstack([linear, alpha_1, v_s])
    alone = (theta[:3] <= 0).any(axis=0) | (coarse < 2) | (coarse > grid - 4) | ~((t > -1.5) & (t < 2.5))
    for k in np.flatnonzero(alone):
        one = solve(from_points(velocity, torques[:, k], ("both",)), v_s_range, grid)
        theta[:, k], cost[k] = one.theta, one.cost
    return theta, cost


def _steepest_gain(along: Array, length: Array) -> Array:
    """Where along(t)**2 / length(t) is largest, by Newton on 2 along' length - along length' = 0 from t = 0; coefficients (6, sets)."""
    along_1, length_1 = _derivative(along), _derivative(length)
    along_2, length_2 = _derivative(along_1), _derivative(length_1)
    t = np.zeros(along.shape[1])
    for _ in range(_NEWTON):
        a, a1, a2 = _horner(along, t), _horner(along_1, t), _horner(along_2, t)
        x, x1, x2 = _horner(length, t), _horner(length_1, t), _horner(length_2, t)
        bend = 2 * a2 * x + a1 * x1 - a * x2
        step = np.divide(a * x1 - 2 * a1 * x, bend, out=np.full_like(t, np.inf), where=bend < 0)
        t = t + np.clip(step, -0.7, 0.7)
    return t


def _horner(coefficients: Array, t: Array) -> Array:
    value: Array = coefficients[-1]
    for c in coefficients[-2::-1]:
        value = value * t + c
    return value


def _derivative(coefficients: Array) -> Array:
    result: Array = coefficients[1:] * np.arange(1.0, coefficients.shape[0])[:, None]
    return result


def _vertex(left: float, middle: float, right: float) -> float:
    """Where the parabola through three equally spaced values is lowest, in steps from the middle one, within one step."""
    bend = left - 2 * middle + right
    return max(-1.0, min(1.0, (left - right) / (2 * bend))) if bend > 0 else 0.0


def _refine(projected: Projected, values: Array, costs: Array) -> float:
    """The continuous minimum of the profile near its lowest grid value.

    The profile is smooth in u = log(v_s): a polynomial through its values at Chebyshev points of a window as wide as the grid's step has an
    error near rounding. Where its minimum lies at the window's edge, the window moves there.
    """
    best = int(costs.argmin())
    u, step = float(np.log(values[best])), float(np.log(values[1] / values[0]))
    if 0 < best < values.size - 1:
        u += step * _vertex(float(costs[best - 1]), float(costs[best]), float(costs[best + 1]))
    low, high = float(np.log(values[0])), float(np.log(values[-1]))
    for _ in range(_WINDOWS):
        u = min(max(u, low + step / 2), high - step / 2)
        fine = _CHEBYSHEV_TO_FINE @ projected.costs(np.exp(u + step / 2 * _CHEBYSHEV))
        at = int(fine.argmin())
        if 0 < at < _FINE.size - 1:
            at_vertex = _FINE[at] + (_FINE[1] - _FINE[0]) * _vertex(
                float(fine[at - 1]), float(fine[at]), float(fine[at + 1])
            )
            return float(np.exp(u + step / 2 * at_vertex))
        edge = u + step / 2 * _FINE[at]
        if edge <= low or edge >= high:
            break
        u = edge
    return float(np.exp(min(max(u + step / 2 * _FINE[at], low), high)))


def _descend(problem: Regression, v_s: list[float], v_s_range: tuple[float, float]) -> list[float]:
    """The continuous minimum over v_s of both directions; the slope by the envelope theorem, dJ/dv_s = -2 alpha_1 s'r."""

    def cost_and_slope(u: Array) -> tuple[float, Array]:
        theta, cost, _ = solve_at(problem, list(np.exp(u)))
        inner = problem.jacobian(theta)[:, -2:].T @ problem.residuals(theta)
        return cost / scale, -2 * inner * np.exp(u) / scale

    scale = solve_at(problem, v_s)[1] or 1.0
    found = minimize(
        cost_and_slope,
        np.log(v_s),
        jac=True,
        method="L-BFGS-B",
        bounds=[tuple(np.log(v_s_range))] * 2,
        options={"ftol": 1e-14, "gtol": 1e-9},
    )
    return [float(x) for x in np.exp(found.x)]


def _bounded(design: Array, torque: Array, lower: Array) -> Array:
    scale = np.linalg.norm(design, axis=0)
    scale[scale == 0] = 1.0
    solution: Array = lsq_linear(design / scale, torque, bounds=(lower, np.inf), method="bvls", tol=1e-14).x / scale
    return solution


def _bounded_cost(design: Array, torque: Array, lower: Array) -> float:
    residuals = torque - design @ _bounded(design, torque, lower)
    return float(residuals @ residuals)
