"""Variable projection: the static problem with everything but v_s solved exactly, for one or many v_s at once.

With the linear columns projected out (Q from QR), one Stribeck column s leaves alpha_1 = s'r / s's and lowers the cost
by (s'r)**2 / s's. Every grid over v_s, of one set of torques or of many, and every profile rests on it.
"""

from collections.abc import Sequence
from itertools import chain, combinations
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.estimation.conditional_profile import Conditional
from bristle.estimation.linear import bounded_least_squares, least_squares, orthonormal
from bristle.identification.static.problem import Regression
from bristle.model.parameters import ParameterName

T = TypeVar("T")
_NONE = np.zeros(0, dtype=np.intp)
_FLAT = 1e-10
"""A Stribeck column this close to the others, relative, tells nothing."""


class Inner(NamedTuple):
    """The problem solved at given v_s."""

    theta: Array
    """The parameters, in the order of the problem's `names`."""
    cost: float
    """J_s (10)."""
    at_bound: tuple[ParameterName, ...]
    """Parameters held at a physical bound."""
    residuals: Array
    """Measured minus modelled torque, (n,)."""
    jacobian: Array
    """Exact derivative of the modelled torque with respect to theta, (n, len(theta))."""


class Projected:
    """A problem with its linear columns projected out, for one set of torques or for many.

    Args:
        problem: n equations.
        dropped: names of linear parameters, alpha_1 of a peak among them, that are left out: a face of the problem, on which they are zero.
    """

    def __init__(self, problem: Regression, dropped: Sequence[ParameterName] = ()) -> None:
        """Factor the linear columns once."""
        m, self.problem, self.size = len(problem.linear_names), problem, len(problem.linear_names) + len(problem.peaks)
        self.kept = [k for k in range(self.size) if not dropped or problem.names[k] not in dropped]
        columns, self.peaks = [k for k in self.kept if k < m], [k - m for k in self.kept if k >= m]
        linear, self.lower = problem.linear, problem.lower
        if dropped:
            linear, self.lower = linear[:, columns], self.lower[columns]
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

    def off(self, v_s: Array, direction: int = 0) -> tuple[Array, Array]:
        """Stribeck columns less their part in the linear ones (n, k), and their squared lengths (k,), inf where they vanish."""
        shapes = self.problem.shapes(v_s, direction)
        inside, _, length = self._split(shapes)
        return shapes - self.q @ inside, length

    def costs(self, v_s: Array) -> Array:
        """J_s at each v_s (k,), with alpha_0, alpha_1, alpha_2 >= 0; one peak."""
        shapes = self.problem.shapes(v_s)
        alpha_1, along, broken = self._peak(shapes)
        costs = np.maximum(self.rest_cost - alpha_1 * along, 0.0)
        if broken.size:
            costs[broken] = self._bounded(shapes[:, broken])
        return costs

    def _bounded(self, shapes: Array) -> Array:
        """J_s with each of some Stribeck columns (n, k), every bound kept: the least of what breaks none, with any friction columns dropped, (k,)."""
        bounded = [name for name, low in zip(self.problem.linear_names, self.lower, strict=True) if np.isfinite(low)]
        least = np.full(shapes.shape[1], np.inf)
        for dropped in subsets(bounded)[1:]:
            face = Projected(self.problem, dropped)
            alpha_1, along, broken = face._peak(shapes)
            costs = np.maximum(face.rest_cost - alpha_1 * along, 0.0)
            costs[broken] = np.inf
            least = np.minimum(least, costs)
        return least

    def at(self, v_s: float) -> Inner:
        """The problem at one v_s, from what is projected already; one peak."""
        shape, slope = self.problem.slopes(np.array([v_s]))
        inside = self.q.T @ shape
        off = (shape - self.q @ inside)[:, 0]
        length = float(off @ off)
        if length > _FLAT * float(shape[:, 0] @ shape[:, 0]):
            alpha_1 = float(self.rest @ off) / length
            linear = self.back(self.torque_in_q - inside[:, 0] * alpha_1)
            if alpha_1 > 0 and (linear > self.lower).all():
                residuals = self.rest - off * alpha_1
                jacobian = np.concatenate([self.problem.linear, shape, slope * alpha_1], axis=1)
                return Inner(np.array([*linear, alpha_1, v_s]), float(residuals @ residuals), (), residuals, jacobian)
        return solve_at(self.problem, [v_s])

    def _split(self, shapes: Array) -> tuple[Array, Array, Array]:
        """Coefficients in Q (m, k), s'r with r the torque off Q (k,), and the squared lengths of what is off Q (k,), inf where nothing is."""
        products = self.q_and_rest @ shapes
        inside, along = products[:-1], products[-1]
        total = np.einsum("nk,nk->k", shapes, shapes)
        length = total - np.einsum("mk,mk->k", inside, inside)
        length[length <= _FLAT * total] = np.inf
        return inside, along, length

    def _peak(self, shapes: Array) -> tuple[Array, Array, NDArray[np.intp]]:
        """For one Stribeck column at a time: alpha_1 >= 0, s'r without it (k,), and which v_s break another bound."""
        inside, along, length = self._split(shapes)
        alpha_1 = np.maximum(along / length, 0.0)
        below = self.back(self.torque_in_q[:, None] - inside * alpha_1) < self.lower[:, None]
        broken: NDArray[np.intp] = np.flatnonzero(below.any(axis=0)) if below.any() else _NONE
        return alpha_1, along, broken

    def profile(self, v_s: Array, peak: int, others: Array) -> Array:
        """J_s at each v_s (k,) of one peak, minimised over all else, the other peak's v_s over `others`."""
        if len(self.problem.peaks) == 1:
            return self.costs(v_s)
        surface, _ = self.surface(v_s, others) if peak == 0 else self.surface(others, v_s)
        lowest: Array = surface.min(axis=1 - peak)
        return lowest

    def surface(self, first_v_s: Array, second_v_s: Array) -> tuple[Array, tuple[float, float]]:
        """J_s over v_s of two peaks, (k, l), with alpha_1 >= 0, and the least cost without each peak."""
        (off_0, length_0), (off_1, length_1) = self.off(first_v_s, 0), self.off(second_v_s, 1)
        along_0, along_1 = (self.rest @ off_0)[:, None], (self.rest @ off_1)[None, :]
        length_0, length_1 = length_0[:, None], length_1[None, :]
        across = off_0.T @ off_1
        with np.errstate(invalid="ignore", divide="ignore"):  # where two peaks are one, and what follows is not taken
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
        """The linear parameters, bounds apart, at values of v_s, (K, peaks of the problem); alpha_1 is zero where a peak touches no point."""
        K, P, p = v_s.shape[0], len(self.peaks), self.size
        off, inside = np.empty((K, P, self.rest.size)), np.empty((K, P, self.q.shape[1]))
        for row, k in enumerate(self.peaks):
            shapes = self.problem.shapes(v_s[:, k], k)
            in_q = self.q.T @ shapes
            off[:, row], inside[:, row] = (shapes - self.q @ in_q).T, in_q.T
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


def solve_at(problem: Regression, v_s: Sequence[float]) -> Inner:
    """Linear least squares (13) at given v_s, one per peak, bounded where the free solution breaks a bound."""
    design, slopes = problem.columns(v_s)
    solution = least_squares(design, problem.torque)
    held: tuple[ParameterName, ...] = ()
    if solution.min() <= 0:  # an extra regressor may well be negative; a friction parameter may not
        lower = np.append(problem.lower, np.zeros(len(v_s)))
        if (solution < lower).any():
            solution = bounded_least_squares(design, problem.torque, lower)
        held = tuple(name for name, x, low in zip(problem.names, solution, lower, strict=False) if x <= low)
    residuals = problem.torque - design @ solution
    peaks = len(v_s)
    jacobian = np.concatenate([design, slopes * solution[solution.size - peaks :]], axis=1)
    return Inner(np.array([*solution, *v_s]), float(residuals @ residuals), held, residuals, jacobian)


def subsets(items: Sequence[T]) -> list[tuple[T, ...]]:
    """Every subset, the empty one first: the faces of what some bounds leave, by which of them hold."""
    return list(chain.from_iterable(combinations(items, size) for size in range(len(items) + 1)))
