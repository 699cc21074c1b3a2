"""Exact profiles of unknowns that are linear once a few others, eta, are given.

With the unknown theta_j held at c and the rest solved,

    J(eta, c) = J(eta) + (c - theta_j(eta))**2 / C_jj(eta),    C = (A'A)**-1 of the columns A at eta,

so an interval ends at the highest and the lowest point of theta_j(eta) -+ sqrt(C_jj(eta) (K - J(eta))) over eta. Where
the free extreme breaks a bound of zero, the best face whose extreme breaks none takes its place.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.estimation.profile_likelihood import BETTER

_SLACK = 1e-9  # standard errors below zero that count as at the bound


class Conditional(NamedTuple):
    """M unknowns at K values of eta."""

    theta: Array  # (K, M), zero where a face drops them
    spread: Array  # C, (K, M, M)
    cost: Array  # J, (K,)


Face = Callable[[Array], Conditional]  # solves the problem, or a face of it, at values of eta, (K, P)


class Looks(NamedTuple):
    """Numbers of values per eta: in the first look, in later ones near the best, and on a drawn profile."""

    first: int
    near: int
    again: int
    drawn: int


@dataclass(slots=True, kw_only=True)
class ConditionalProfiles:
    """The profiles of conditionally linear unknowns."""

    free: Face  # The problem without bounds
    best: Array  # eta of the solution, (P,)
    cost: float = 0.0  # J of the solution
    threshold: float  # K, the largest cost within an interval
    box: Array  # Range of eta within the threshold, (P, 2)
    looks: Looks
    bounded: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(1, dtype=bool))  # Non-negative unknowns, (M,)
    faces: Callable[[int], Iterable[Face]] | None = None  # Faces on which an unknown is free
    searched: tuple[float, float] = (-np.inf, np.inf)  # Limits of eta
    tolerance: float = 0.0  # Closer costs are equal
    better: Array | None = None  # eta, (P,), with a lower cost than the solution's, met by `intervals`, or None

    def intervals(self) -> Array:
        """Where each unknown's profile stays below the threshold, (M, 2)."""
        nodes = self._grid(self.box, self.looks.first)
        at = self.free(nodes)
        lowest = int(at.cost.argmin())
        lower = at.cost[lowest] < self.cost - BETTER * (self.threshold - self.cost) - self.tolerance
        if lower and not (at.theta[lowest, self.bounded] < 0).any():
            self.better = nodes[lowest]
        unknowns = range(at.theta.shape[1])
        return np.array([[self._end(j, sign, nodes, at) for sign in (-1.0, 1.0)] for j in unknowns]).reshape(-1, 2)

    def heights(self, j: int, values: Array, beyond: float) -> Array:
        """(cost - least) / (threshold - least) of unknown j at values, (k,), with eta beyond its box by this share."""
        box = np.clip(self.box + beyond * np.diff(self.box) * [-1, 1], *self.searched)
        nodes = self._grid(box, self.looks.drawn)
        cost, inside = self._held(self.free, nodes, j, values)
        if self.faces and not inside.all():
            cost = np.min([self._held(face, nodes, j, values)[0] for face in self.faces(j)], axis=0)
        return np.asarray(np.maximum(cost - self.cost, 0.0) / max(self.threshold - self.cost, 1e-300))

    def _grid(self, box: Array, values: int) -> Array:
        """Points over a box, the best one among them, (K, P)."""
        inner = box[:, 0] + np.diff(box)[:, 0] * _products(np.linspace(0, 1, values), self.best.size)
        return np.vstack([inner, self.best])

    def _end(self, j: int, sign: float, nodes: Array, at: Conditional) -> float:
        """The highest (sign 1) or lowest (-1) value of unknown j below the threshold."""
        reach, eta = self._highest(lambda x: self._reach(self.free(x), j, sign), nodes, self._reach(at, j, sign))
        if self.faces and not self._inside(self.free(eta[None]), j, sign).all():
            faces = list(self.faces(j))

            def kept(nodes: Array) -> Array:
                """Best reach over the faces at each node, (K,); -inf where all break a bound."""
                best = np.full(len(nodes), -np.inf)
                for one in (face(nodes) for face in faces):
                    best = np.maximum(best, np.where(self._inside(one, j, sign), self._reach(one, j, sign), -np.inf))
                return best

            reach, _ = self._highest(kept, nodes, kept(nodes))
        return max(sign * reach, 0.0) if self.bounded[j] else sign * reach

    def _highest(self, reach: Callable[[Array], Array], nodes: Array, found: Array) -> tuple[float, Array]:
        """The highest reach over eta, and its place, (P,), refined from the first look."""
        offsets = _products(np.linspace(-1, 1, self.looks.near), self.best.size)
        step = np.diff(self.box)[:, 0] / (self.looks.first - 1)
        for _ in range(self.looks.again):
            nodes = np.clip(nodes[found.argmax()] + step * offsets, *self.box.T)
            found, step = reach(nodes), step * 2 / (self.looks.near - 1)
        return float(found.max()), nodes[found.argmax()]

    def _inside(self, at: Conditional, j: int, sign: float) -> NDArray[np.bool_]:
        """Whether no other unknown breaks a bound at the extreme of unknown j, (K,)."""
        variance, theta = at.spread[:, j, j], at.theta[:, j]
        far = np.sqrt(variance * np.maximum(self.threshold - at.cost, 0.0))
        end = np.maximum(theta + sign * far, 0.0) if self.bounded[j] else theta + sign * far
        moved = (end - theta) / np.where(variance > 0, variance, np.inf)
        slack = _SLACK * np.sqrt(np.einsum("kmm->km", at.spread) * self.threshold)
        inside = (at.theta + moved[:, None] * at.spread[..., j] >= -slack) | ~self.bounded
        inside[:, j] = end <= theta + far + slack[:, j]
        return np.asarray(inside.all(axis=1))

    def _reach(self, at: Conditional, j: int, sign: float) -> Array:
        """The extreme of unknown j, times sign, at each node, (K,); -inf where it costs too much."""
        left = self.threshold - at.cost
        far = sign * at.theta[:, j] + np.sqrt(at.spread[:, j, j] * np.maximum(left, 0.0))
        return np.where(left >= -self.tolerance, far, -np.inf)

    def _held(self, face: Face, nodes: Array, j: int, values: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Least cost of a face at values of unknown j, (D,), inf where bounds break; and where none breaks."""
        theta, spread, least = face(nodes)
        variance = spread[:, j, j]  # zero where no equation shows the unknown: any value costs the same
        off = np.divide(
            values[:, None] - theta[:, j], variance, out=np.zeros((values.size, variance.size)), where=variance > 0
        )
        with np.errstate(over="ignore"):  # so far off costs more than any threshold
            cost = least + off**2 * variance
        point = theta + off[:, :, None] * spread[:, j]
        fine = (point >= -_SLACK * np.abs(point).max()) | ~self.bounded
        inside = fine[..., np.arange(theta.shape[1]) != j].all(axis=-1)
        return np.where(inside, cost, np.inf).min(axis=1), inside[np.arange(values.size), cost.argmin(axis=1)]


def _products(axis: Array, count: int) -> Array:
    """Combinations of values on equal axes, one per row."""
    return np.array(list(product(axis.tolist(), repeat=count)), dtype=np.float64).reshape(axis.size**count, count)
