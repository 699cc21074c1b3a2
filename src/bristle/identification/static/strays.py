"""Strays: points without which the refitted cost is lower by more than chance (F test), one after another.

At a given v_s the cost falls by r**2 / (1 - h), with leverage h (Cook and Weisberg, Residuals and Influence in
Regression, 1982); pairs and threes are tried where no single point is significant.
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
from bristle.estimation.levels import RARE, SIGNIFICANCE
from bristle.identification.static.grid import Projected, Solution, default_range, solve
from bristle.identification.static.problem import Regression, log_grid

SHARE = 8
"""At most one stray in so many points, or two of few."""
_GRIDS = {1: 96, 2: 24}  # values of v_s by number of peaks
_LEVELS = {1: SIGNIFICANCE, 2: SIGNIFICANCE, 3: RARE}  # by size of a set: there are many threes
SINGLY = 1000  # points up to which strays are left out one by one
_ALIKE = 0.25  # of the largest fall of the cost: of many points, others above it are left out together
_TRIED = {1: None, 2: 200, 3: 24}  # most points that form sets of a size, by their single falls of the cost
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
    return max(n // SHARE, 2 if n >= 2 * len(problem.names) + 2 else 0)


def _significant(problem: Regression) -> list[int]:
    """The most significant point, else pair or three, or nothing."""
    n, parameters = problem.torque.size, len(problem.names)
    if n < parameters + 2:
        return []
    solution = refit(problem)
    base, v_s = solution.cost, problem.split(solution.theta)[1][:, None]
    if n <= SINGLY and problem.peaks:
        v_s = np.tile(log_grid(default_range(problem.velocity), _GRIDS[v_s.size]), (v_s.size, 1))
    noise = 1e-20 * float(problem.torque @ problem.torque) or 1e-300
    for sets, falls in _candidates(problem, v_s):
        size, chosen, exact = sets.shape[1], sets[0].tolist(), float(falls[0])
        if n <= SINGLY:
            few = sets[:_REFITTED].tolist()
            costs = [refit(problem.rows(all_but(n, rows))).cost for rows in few]
            chosen, exact = few[int(np.argmin(costs))], base - min(costs)
        together = n > SINGLY and size == 1
        fall = np.append(exact, falls[falls > _ALIKE * falls[0]] if together else [])
        F = fall / size * (n - parameters - size) / np.maximum(base - fall, noise)
        rare = fdtrc(size, n - parameters - size, F) * comb(n, size) < _LEVELS[size]
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


def _candidates(problem: Regression, v_s: Array) -> Iterator[tuple[NDArray[np.intp], Array]]:
    """Sets of points, (k, size), and their falls of the cost over v_s, (k,), largest first: singles, pairs, threes."""
    n = problem.torque.size
    nodes = list(_nodes(problem, v_s))
    order = np.arange(n)
    for size, most in _TRIED.items():
        if n - len(problem.names) - size < 1:
            return
        among = np.sort(order[:most])
        at = np.array(list(combinations(range(among.size), size)))
        costs, sets = reduce(np.minimum, (node.cost - node.falls(among, at) for node in nodes)), among[at]
        best = np.argsort(costs)
        order = sets[best, 0] if size == 1 else order
        yield sets[best], min(node.cost for node in nodes) - costs[best]


class _Node(NamedTuple):
    """The problem at one v_s per peak."""

    cost: float
    residuals: Array  # (n,)
    basis: Array  # Orthonormal columns of the fit, (n, p)

    def falls(self, among: NDArray[np.intp], at: NDArray[np.intp]) -> Array:
        """Falls of the cost without each set of points, (k,), r' (I - H)**-1 r; `at`, (k, size), indexes `among`."""
        size, r, rows = at.shape[1], list(self.residuals[among][at.T]), self.basis[among]
        if size == 1:  # of any number of points
            left = {(0, 0): 1 - np.einsum("np,np->n", rows, rows)}
        else:
            hat = rows @ rows.T
            left = {(i, j): float(i == j) - hat[at[:, i], at[:, j]] for i in range(size) for j in range(i + 1)}
        own = [left[i, i] for i in range(size)]
        falls, apart = np.zeros(len(at)), np.ones(len(at), dtype=bool)
        for j in range(size):
            apart &= left[j, j] > _VANISHED * np.maximum(own[j], _VANISHED)
            pivot = np.where(apart, left[j, j], 1.0)
            falls += r[j] ** 2 / pivot
            for i in range(j + 1, size):
                ratio = left[i, j] / pivot
                r[i] = r[i] - ratio * r[j]
                left |= {(i, k): left[i, k] - ratio * left[k, j] for k in range(j + 1, i + 1)}
        return np.where(apart, falls, 0.0)


def _nodes(problem: Regression, v_s: Array) -> Iterator[_Node]:
    """The problem at each v_s, (peaks, k), without negative Stribeck terms."""
    projected = Projected(problem)
    peaks = len(problem.peaks)
    if not peaks:
        yield _Node(projected.rest_cost, projected.rest, projected.q)
        return
    columns = []
    for k in range(peaks):
        off, length = projected.off(v_s[k], k)
        columns.append(off / np.sqrt(length))
    for chosen in product(range(v_s.shape[1]), repeat=peaks):
        own = np.stack([unit[:, j] for unit, j in zip(columns, chosen, strict=True)], axis=1)
        basis = np.linalg.qr(own)[0] if peaks > 1 else own
        along = np.linalg.lstsq(own, projected.rest, rcond=None)[0] if peaks > 1 else own.T @ projected.rest
        basis = basis if (along > 0).all() else own[:, (along > 0) & (own.T @ projected.rest > 0)][:, :1]
        residuals = projected.rest - basis @ (basis.T @ projected.rest)
        yield _Node(float(residuals @ residuals), residuals, np.concatenate([projected.q, basis], axis=1))
