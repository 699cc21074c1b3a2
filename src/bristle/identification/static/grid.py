"""Static fits by variable projection, (10)-(13): a grid over v_s with linear least squares inside, then refined."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import chain, combinations
from math import ceil, exp, log
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.errors import InputError
from bristle.estimation.conditional_profile import Conditional
from bristle.estimation.linear import bounded_least_squares, least_squares, orthonormal
from bristle.estimation.nonlinear import minimise
from bristle.identification.static.problem import Regression, log_grid, unknowns_of
from bristle.model.parameters import ParameterName

T = TypeVar("T")
_NONE = np.zeros(0, dtype=np.intp)
_FLAT = 1e-10  # relative distance of a Stribeck column from the others below which it tells nothing
GRID = 32  # values of v_s in the refined grid
PLAIN_GRID = 500  # values of v_s in the paper's plain grid
_TO_QUARTIC = np.linalg.inv(np.vander(np.arange(-2.0, 3.0)))  # from five equally spaced values to coefficients
_BLOCK = 500  # values of v_s at a time, for many sets
_AT_ONCE = 4_000_000  # elements of columns over v_s at a time, for one set
_STEPS = 20
_SETTLED = 1e-12  # of the residuals' variance: smaller gains end the steps
_UNTOUCHED = 1e-200  # squared length below which a peak touches no point


@dataclass(frozen=True, slots=True)
class Solution:
    """A static problem solved at given v_s, or at its continuous minimum."""

    theta: Array  # In the order of the problem's `names`
    cost: float  # J_s (10)
    at_bound: tuple[ParameterName, ...]
    residuals: Array  # Measured minus modelled torque, (n,)
    jacobian: Array  # Exact derivative of the modelled torque by theta, (n, p)
    base_costs: tuple[float, ...] = ()  # Cost without each peak
    grid: Array = field(default_factory=lambda: np.zeros(0))  # v_s, rad/s, (k,)
    profiles: tuple[Array, ...] = ()  # Cost on the grid per peak, minimised over all other parameters, (k,)


class Projected:
    """A problem with its linear columns projected out; `dropped` linear parameters are zero."""

    def __init__(self, problem: Regression, dropped: Sequence[ParameterName] = ()) -> None:
        m, self.problem, self.size = len(problem.linear_names), problem, len(problem.linear_names) + len(problem.peaks)
        self.kept = [k for k in range(self.size) if not dropped or problem.names[k] not in dropped]
        columns, self.peaks = [k for k in self.kept if k < m], [k - m for k in self.kept if k >= m]
        linear, self.lower = problem.linear[:, columns] if dropped else problem.linear, problem.lower[columns]
        self.q, self.r_inverse = orthonormal(linear)
        self.torque_in_q = self.q.T @ problem.torque
        self.rest = problem.torque - self.q @ self.torque_in_q
        self.q_and_rest = np.concatenate([self.q.T, self.rest[None]])
        self.rest_cost = float(self.rest @ self.rest)

    @property
    def base_cost(self) -> float:
        """J_s with no peak, and alpha_0, alpha_2 >= 0."""
        if not (self.back(self.torque_in_q) < self.lower).any():
            return self.rest_cost
        problem = self.problem
        broken = problem.torque - problem.linear @ bounded_least_squares(problem.linear, problem.torque, self.lower)
        return float(broken @ broken)

    def without(self, columns: Array) -> tuple[Array, Array]:
        """Coefficients of columns, (n, k), in Q, (m, k), and the rest of them, (n, k)."""
        inside = self.q.T @ columns
        return inside, columns - self.q @ inside

    def off(self, v_s: Array, direction: int = 0) -> tuple[Array, Array]:
        """Stribeck columns off the linear ones, (n, k), and their squared lengths, (k,), inf where one vanishes."""
        shapes = self.problem.shapes(v_s, direction)
        inside, _, length = self._split(shapes)
        return shapes - self.q @ inside, length

    def costs(self, v_s: Array) -> Array:
        """J_s at each v_s (k,), with alpha_0, alpha_1, alpha_2 >= 0; one peak."""
        blocks = min(ceil(v_s.size * self.rest.size / _AT_ONCE), v_s.size)
        if blocks > 1:
            return np.concatenate([self.costs(part) for part in np.array_split(v_s, blocks)])
        shapes = self.problem.shapes(v_s)
        alpha_1, along, broken = self._peak(shapes)
        costs = np.maximum(self.rest_cost - alpha_1 * along, 0.0)
        if not broken.size:
            return costs
        # least cost over the faces that keep all bounds
        bounded = [name for name, low in zip(self.problem.linear_names, self.lower, strict=True) if np.isfinite(low)]
        costs[broken], shapes = np.inf, shapes[:, broken]
        for dropped in subsets(bounded)[1:]:
            face = Projected(self.problem, dropped)
            alpha_1, along, lost = face._peak(shapes)
            of_face = np.maximum(face.rest_cost - alpha_1 * along, 0.0)
            of_face[lost] = np.inf
            costs[broken] = np.minimum(costs[broken], of_face)
        return costs

    def at(self, v_s: float) -> Solution:
        """The solution at one v_s; one peak."""
        shape, slope = self.problem.slopes(np.array([v_s]))
        inside, left = self.without(shape)
        off = left[:, 0]
        length = float(off @ off)
        if length > _FLAT * float(shape[:, 0] @ shape[:, 0]):
            alpha_1 = float(self.rest @ off) / length
            linear = self.back(self.torque_in_q - inside[:, 0] * alpha_1)
            if alpha_1 > 0 and (linear > self.lower).all():
                residuals = self.rest - off * alpha_1
                jacobian = np.concatenate([self.problem.linear, shape, slope * alpha_1], axis=1)
                return Solution(
                    np.array([*linear, alpha_1, v_s]), float(residuals @ residuals), (), residuals, jacobian
                )
        return solve_at(self.problem, [v_s])

    def _split(self, shapes: Array) -> tuple[Array, Array, Array]:
        """Coefficients in Q (m, k), s'r with r the torque off Q, and squared lengths off Q, inf for none, (k,)."""
        products = self.q_and_rest @ shapes
        inside, along = products[:-1], products[-1]
        total = np.einsum("nk,nk->k", shapes, shapes)
        length = total - np.einsum("mk,mk->k", inside, inside)
        length[length <= _FLAT * total] = np.inf
        return inside, along, length

    def _peak(self, shapes: Array) -> tuple[Array, Array, NDArray[np.intp]]:
        """For one Stribeck column at a time: alpha_1 >= 0, s'r, (k,) each, and which v_s break another bound."""
        inside, along, length = self._split(shapes)
        alpha_1 = np.maximum(along / length, 0.0)
        below = self.back(self.torque_in_q[:, None] - inside * alpha_1) < self.lower[:, None]
        broken: NDArray[np.intp] = np.flatnonzero(below.any(axis=0)) if below.any() else _NONE
        return alpha_1, along, broken

    def profile(self, v_s: Array, peak: int, others: Array) -> Array:
        """J_s at each v_s, (k,), of one peak, minimised over all else; `others` are values of the other v_s."""
        if len(self.problem.peaks) == 1:
            return self.costs(v_s)
        surface, _ = self.surface(v_s, others) if peak == 0 else self.surface(others, v_s)
        return np.asarray(surface.min(axis=1 - peak))

    def surface(self, first_v_s: Array, second_v_s: Array) -> tuple[Array, tuple[float, float]]:
        """J_s over v_s of two peaks, (k, l), with alpha_1 >= 0, and the least cost without each peak."""
        (off_0, length_0), (off_1, length_1) = self.off(first_v_s, 0), self.off(second_v_s, 1)
        along_0, along_1 = (self.rest @ off_0)[:, None], (self.rest @ off_1)[None, :]
        length_0, length_1 = length_0[:, None], length_1[None, :]
        across = off_0.T @ off_1
        with np.errstate(invalid="ignore", divide="ignore"):  # for coinciding peaks, not used below
            determinant = length_0 * length_1 - across**2
            first = (along_0 * length_1 - along_1 * across) / determinant
            second = (along_1 * length_0 - along_0 * across) / determinant
            both = first * along_0 + second * along_1
        alone_0 = np.maximum(along_0, 0.0) ** 2 / length_0
        alone_1 = np.maximum(along_1, 0.0) ** 2 / length_1
        inside = np.isfinite(determinant) & (determinant > 0) & (first > 0) & (second > 0)
        gain = np.where(inside, both, np.maximum(alone_0, alone_1))
        without = (self.rest_cost - float(alone_1.max()), self.rest_cost - float(alone_0.max()))
        return np.maximum(self.rest_cost - gain, 0.0), without

    def conditional(self, v_s: Array) -> Conditional:
        """Linear parameters without bounds at v_s, (K, peaks); alpha_1 is zero where a peak touches no point."""
        K, P, p = v_s.shape[0], len(self.peaks), self.size
        off, inside = np.empty((K, P, self.rest.size)), np.empty((K, P, self.q.shape[1]))
        for row, k in enumerate(self.peaks):
            in_q, left = self.without(self.problem.shapes(v_s[:, k], k))
            off[:, row], inside[:, row] = left.T, in_q.T
        off[np.einsum("kpr,kpr->kp", off, off) < _UNTOUCHED] = 0.0
        gram = np.linalg.pinv(off @ off.transpose(0, 2, 1), hermitian=True)
        along = off @ self.rest
        alpha_1 = np.einsum("kpr,kr->kp", gram, along)
        lost = inside @ self.r_inverse.T
        linear = self.back(self.torque_in_q) - np.einsum("kpm,kp->km", lost, alpha_1)
        across = -gram @ lost
        of_linear = self.r_inverse @ self.r_inverse.T - lost.transpose(0, 2, 1) @ across
        theta, spread = np.zeros((K, p)), np.zeros((K, p, p))
        theta[:, self.kept] = np.concatenate([linear, alpha_1], axis=1)
        spread[np.ix_(range(K), self.kept, self.kept)] = np.block(
            [[of_linear, across.transpose(0, 2, 1)], [across, gram]]
        )
        cost = self.rest_cost - np.einsum("kp,kp->k", along, alpha_1)
        return Conditional(theta, spread, np.maximum(cost, 0.0))

    def back(self, in_q: Array) -> Array:
        """Linear parameters from their coefficients in Q, (m,) or (m, k)."""
        return self.r_inverse @ in_q


def solve_at(problem: Regression, v_s: Sequence[float]) -> Solution:
    """Linear least squares (13) at given v_s, one per peak, bounded where needed."""
    design, slopes = problem.columns(v_s)
    solution = least_squares(design, problem.torque)
    held: tuple[ParameterName, ...] = ()
    if solution.min() <= 0:  # an extra regressor may well be negative; a friction parameter may not
        lower = problem.least[: solution.size]
        if (solution < lower).any():
            solution = bounded_least_squares(design, problem.torque, lower)
        held = tuple(name for name, x, low in zip(problem.names, solution, lower, strict=False) if x <= low)
    residuals = problem.torque - design @ solution
    peaks = len(v_s)
    jacobian = np.concatenate([design, slopes * solution[solution.size - peaks :]], axis=1)
    return Solution(np.array([*solution, *v_s]), float(residuals @ residuals), held, residuals, jacobian)


def subsets(items: Sequence[T]) -> list[tuple[T, ...]]:
    """Every subset, the empty one first."""
    return list(chain.from_iterable(combinations(items, size) for size in range(len(items) + 1)))


def default_range(velocity: Array) -> tuple[float, float]:
    """The search range of v_s, rad/s: from a third of the slowest speed, where no point is touched, to the fastest."""
    speed = np.abs(velocity[velocity != 0])
    high = float(speed.max())
    low = max(float(speed.min()), 1e-3 * high) / 3
    return low, high


def solve(problem: Regression, v_s_range: tuple[float, float], grid: int = GRID) -> Solution:
    """The solution by a grid of v_s even in log(v_s), refined to its minimum, with alpha_0, alpha_1, alpha_2 >= 0."""
    values, projected = log_grid(v_s_range, grid), Projected(problem)
    if not problem.peaks:
        return replace(solve_at(problem, []), grid=values)
    if len(problem.peaks) == 1:
        costs = projected.costs(values)
        inner = _refine(projected, values, costs)
        return replace(inner, base_costs=(projected.base_cost,), grid=values, profiles=(costs,))
    surface, bases = projected.surface(values, values)
    first, second = np.unravel_index(surface.argmin(), surface.shape)
    inner = descended(problem, [values[first], values[second]], v_s_range)
    return replace(inner, base_costs=bases, grid=values, profiles=(surface.min(axis=1), surface.min(axis=0)))


def descended(problem: Regression, v_s: Sequence[float], v_s_range: tuple[float, float]) -> Solution:
    """The minimum over all parameters nearest to some v_s, one per peak."""
    unknowns = unknowns_of(problem, v_s_range)

    def linearised(x: Array) -> tuple[Array, Array]:
        """Residuals, (n,), and Jacobian, (n, p), at scaled parameters."""
        theta = unknowns.natural(x)
        return problem.residuals(theta), -problem.jacobian(theta) * unknowns.slopes(x)

    start = unknowns.scaled(problem.named(solve_at(problem, v_s).theta))
    with suppress(InputError):  # without influence v_s stays
        start = minimise(linearised, start, unknowns.lower, unknowns.upper, settled=_SETTLED).x
    return solve_at(problem, unknowns.natural(start)[len(problem.names) - len(v_s) :].tolist())


def plain_grid(
    problem: Regression, v_s_range: tuple[float, float], count: int = PLAIN_GRID
) -> tuple[Array, Array, Array]:
    """The paper's method (13) for one direction: evenly spaced v_s, J_s there, (count,) each, and theta at the best."""
    values = np.linspace(*v_s_range, count)
    costs = Projected(problem).costs(values)
    return values, costs, solve_at(problem, [float(values[costs.argmin()])]).theta


def plain_grids(problem: Regression, torques: Array, v_s_range: tuple[float, float], count: int = PLAIN_GRID) -> Array:
    """`plain_grid`'s theta, (p, sets), for torques (n, sets), all at once; sets at a bound are solved alone."""
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
        theta[:, k] = plain_grid(problem.with_torque(torques[:, k]), v_s_range, count)[2]
    return theta


def _refine(projected: Projected, values: Array, costs: Array) -> Solution:
    """The solution at the continuous minimum of the profile, between the neighbours of its lowest grid value.

    From the minimum of the quartic through five values the secant method follows the slope. By the envelope theorem
    -dJ_s/du / 2 = v_s alpha_1 s_v_s'r with u = log(v_s); with `bend` = J_s'' / 2 a step lowers the cost by slope**2 /
    bend.
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
    """Minimum of a quartic near t by Newton's method, and half its second derivative there."""
    a, b, c, d, _ = quartic
    bend = c
    for _ in range(4):
        bend = (6 * a * t + 3 * b) * t + c
        if bend <= 0:
            break
        t -= max(-1.0, min(1.0, (((4 * a * t + 3 * b) * t + 2 * c) * t + d) / (2 * bend)))
    return t, bend
