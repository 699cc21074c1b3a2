"""Strays: points without which the refitted cost is lower by more than chance (F test), one after another.

At a given v_s the cost falls by r' (I - H)**-1 r, with hat matrix H (Cook and Weisberg, Residuals and Influence in
Regression, 1982); pairs are tried where no single point is significant.
"""

from collections.abc import Iterator, Sequence
from functools import reduce
from itertools import combinations, product
from math import comb
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from bristle.arrays import Array
from bristle.estimation import levels
from bristle.identification.static.grid import Projected, Solution, default_range, solve
from bristle.identification.static.problem import Regression, log_grid

_GRIDS = {1: 96, 2: 24}  # values of v_s by number of peaks
SINGLY = 1000  # points up to which strays are left out one by one
_PAIRED = 200  # most points that form pairs, by their single falls of the cost
_REFITTED = 5  # sets that are refitted, of the largest falls on the grid
_VANISHED = 1e-9  # share off the fit's columns below which a point is always fitted


class StraySearch(NamedTuple):
    """The strays of a problem."""

    rows: tuple[int, ...]  # The one that lowers the cost most first
    misfit: bool  # Whether there are more than allowed


def find_strays(problem: Regression) -> StraySearch:
    """The strays of a problem of points."""
    n, most, out = problem.torque.size, most_strays(problem), list[int]()
    while True:
        kept = np.delete(np.arange(n), out)
        more = _significant(problem.rows(all_but(n, out)))
        if not more:
            return StraySearch(tuple(out), False)
        out += kept[more].tolist()
        if len(out) > most:
            return StraySearch(tuple(out), True)


def most_strays(problem: Regression) -> int:
    """Largest number of strays of a problem."""
    n = problem.torque.size
    return max(n // levels.ONE_STRAY_IN, 2 if n >= 2 * len(problem.names) + 2 else 0)


def _significant(problem: Regression) -> list[int]:
    """The most significant point, else pair, or nothing."""
    n, parameters = problem.torque.size, len(problem.names)
    if n < parameters + 2:
        return []
    solution = refit(problem)
    base, v_s = solution.cost, problem.split(solution.theta)[1][:, None]
    if n <= SINGLY and problem.peaks:
        v_s = np.tile(log_grid(default_range(problem.velocity), _GRIDS[v_s.size]), (v_s.size, 1))
    noise = 1e-20 * float(problem.torque @ problem.torque) or 1e-300
    nodes, order = list(_nodes(problem, v_s)), np.arange(n)
    for size in (1, 2)[: n - parameters - 1]:
        sets = np.array(list(combinations(np.sort(order[:_PAIRED]) if size == 2 else order, size)))
        costs = reduce(np.minimum, (node.cost - node.falls(sets) for node in nodes))
        best = np.argsort(costs)
        sets, falls, order = sets[best], min(node.cost for node in nodes) - costs[best], sets[best, 0]
        chosen, exact = sets[0].tolist(), float(falls[0])
        if n <= SINGLY:
            few = sets[:_REFITTED].tolist()
            refitted = [refit(problem.rows(all_but(n, rows))).cost for rows in few]
            chosen, exact = few[int(np.argmin(refitted))], base - min(refitted)
        together = n > SINGLY and size == 1
        fall = np.append(exact, falls[falls > levels.TOGETHER * falls[0]] if together else [])
        F = fall / size * (n - parameters - size) / np.maximum(base - fall, noise)
        rare = fdtrc(size, n - parameters - size, F) * comb(n, size) < levels.SIGNIFICANCE
        if rare[0] and exact > noise * size:
            return list(sets[: fall.size - 1, 0][rare[1:]].tolist() if together else chosen)
    return []


def refit(problem: Regression) -> Solution:
    """The solution over the default range of v_s."""
    return solve(problem, default_range(problem.velocity))


def all_but(n: int, rows: Sequence[int]) -> NDArray[np.bool_]:
    """A mask of n equations without some, (n,)."""
    keep = np.ones(n, dtype=bool)
    keep[list(rows)] = False
    return keep


class _Node(NamedTuple):
    """The problem at one v_s per peak."""

    cost: float
    residuals: Array  # (n,)
    basis: Array  # Orthonormal columns of the fit, (n, p)

    def falls(self, sets: NDArray[np.intp]) -> Array:
        """Falls of the cost without each set of one or two points, (k, size); 0 where the others do not fix the fit."""
        rows, (r, *more) = self.basis[sets], self.residuals[sets].T
        own, *other = 1 - np.einsum("ksp,ksp->sk", rows, rows)
        apart = own > _VANISHED
        pivot = np.where(apart, own, 1.0)
        falls = r**2 / pivot
        for r_2, own_2 in zip(more, other, strict=True):
            across = -np.einsum("kp,kp->k", rows[:, 0], rows[:, 1])
            rest = own_2 - across**2 / pivot
            apart &= rest > _VANISHED * np.maximum(own_2, _VANISHED)
            falls += (r_2 - across * r / pivot) ** 2 / np.where(apart, rest, 1.0)
        return np.where(apart, falls, 0.0)


def _nodes(problem: Regression, v_s: Array) -> Iterator[_Node]:
    """The problem at each v_s, (peaks, k), without negative Stribeck terms."""
    projected = Projected(problem)
    columns = [off / np.sqrt(length) for off, length in (projected.off(x, k) for k, x in enumerate(v_s))]
    for chosen in product(range(v_s.shape[1]), repeat=len(columns)):
        own = np.array([unit[:, j] for unit, j in zip(columns, chosen, strict=True)]).reshape(-1, projected.rest.size).T
        along, basis = np.linalg.lstsq(own, projected.rest, rcond=None)[0], np.linalg.qr(own)[0]
        if not (along > 0).all():
            basis = own[:, (along > 0) & (own.T @ projected.rest > 0)][:, :1]
        residuals = projected.rest - basis @ (basis.T @ projected.rest)
        yield _Node(float(residuals @ residuals), residuals, np.concatenate([projected.q, basis], axis=1))
