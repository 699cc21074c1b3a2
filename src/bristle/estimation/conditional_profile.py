"""The exact profile of unknowns in which a problem is linear once a few others, eta, are given.

With the unknown theta_j held at c and the rest solved,

    J(eta, c) = J(eta) + (c - theta_j(eta))**2 / C_jj(eta),    C = (A'A)**-1 of the columns A at eta,

so the values of c that cost no more than K are the union over eta of theta_j(eta) -+ sqrt(C_jj(eta) (K - J(eta))): an interval ends at the highest
and the lowest point of a curve over eta (a surface, where there are two), and no path over c is followed. Some unknowns are not negative. At given
eta the constrained extreme lies inside a face, where some of them are zero, and is that face's free one: where the free extreme of all breaks a
bound, the curve is, at each eta, that of the best face whose extreme breaks none.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.estimation.profile_likelihood import BETTER

_SLACK = 1e-9
"""An unknown this far below its bound of zero, in standard errors, is at it."""


class Conditional(NamedTuple):
    """M unknowns at K values of the others that make them linear."""

    theta: Array
    """(K, M), zero for what a face drops."""
    spread: Array
    """C, (K, M, M)."""
    cost: Array
    """J, (K,)."""


Face = Callable[[Array], Conditional]
"""Solves the problem, or one face of it, at values of eta, (K, P)."""


class Looks(NamedTuple):
    """Over how many values of each eta extremes are looked for: at first, near the best ones, again and again; and a drawn profile is minimised."""

    first: int
    near: int
    again: int
    drawn: int


@dataclass(slots=True, kw_only=True)
class ConditionalProfiles:
    """The profiles of a problem's conditionally linear unknowns."""

    free: Face
    """The problem with no unknown at its bound."""
    best: Array
    """eta of the solution, (P,)."""
    threshold: float
    """K: what an unknown inside its interval costs at most."""
    box: Array
    """Between which eta the threshold may be kept, (P, 2)."""
    looks: Looks
    cost: float = 0.0
    """J of the solution."""
    bounded: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(1, dtype=bool))
    """Which unknowns are not negative, (M,)."""
    faces: Callable[[int], Iterable[Face]] = lambda _: ()
    """Every face on which an unknown is free."""
    searched: tuple[float, float] = (-np.inf, np.inf)
    """The lowest and highest eta that count."""
    tolerance: float = 0.0
    """Costs this near are the same."""
    better: Array | None = None
    """eta, (P,), at which `intervals` met a cost lower than the solution's; None: it met none."""

    def intervals(self) -> Array:
        """Where each unknown's profile stays below the threshold, (M, 2)."""
        high, low = self._extremes(1.0), self._extremes(-1.0)
        return np.stack([low, high], axis=1)

    def heights(self, j: int, values: Array, beyond: float) -> Array:
        """(cost - least) / (threshold - least) of unknown j at values of it, (k,); eta goes beyond its box by that share of it."""
        wider = np.clip(self.box + beyond * np.diff(self.box, axis=1) * [-1, 1], *self.searched)
        nodes = self._grid(wider, self.looks.drawn)
        cost, inside = self._held(self.free, nodes, j, values)
        if not inside.all():
            cost = np.min([self._held(face, nodes, j, values)[0] for face in self.faces(j)], axis=0)
        heights: Array = np.maximum(cost - self.cost, 0.0) / max(self.threshold - self.cost, 1e-300)
        return heights

    def _extremes(self, sign: float) -> Array:
        """The highest (sign 1) or lowest (-1) value of each unknown below the threshold, (M,)."""
        found, inside = self._zoom(sign)
        for j in np.flatnonzero(~inside).tolist():
            found[j] = self._bounded(j, sign)
        return np.where(self.bounded, np.maximum(sign * found, 0.0), sign * found)

    def _grid(self, box: Array, values: int) -> Array:
        """Points over a box, the best one among them, (K, P)."""
        return np.vstack([_products([np.linspace(low, high, values) for low, high in box]), self.best])

    def _steps(self) -> tuple[Array, Array]:
        """The nodes of the second look about the best, in steps, (K, P), and a step, (P,)."""
        offsets = _products([np.linspace(-1, 1, self.looks.near)] * self.best.size)
        return offsets, np.diff(self.box, axis=1)[:, 0] / (self.looks.first - 1)

    def _zoom(self, sign: float) -> tuple[Array, NDArray[np.bool_]]:
        """What is sign times each unknown's extreme with no bound at all, (M,); and whether no other unknown breaks its bound there, (M,)."""
        nodes = self._grid(self.box, self.looks.first)
        at = self.free(nodes)
        lowest, size = int(at.cost.argmin()), at.theta.shape[1]
        least = self.cost - BETTER * (self.threshold - self.cost) - self.tolerance
        if at.cost[lowest] < least and not (at.theta[lowest][self.bounded] < 0).any():
            self.better = nodes[lowest]
        each = np.arange(size)
        k = self._reach(at, sign).argmax(axis=0)
        offsets, step = self._steps()
        for _ in range(self.looks.again):
            around = nodes[k][:, None] + step * offsets
            nodes = np.clip(around, *self.box.T).reshape(-1, self.best.size)
            at = self.free(nodes)
            own = self._reach(at, sign).reshape(size, -1, size)[each, :, each]
            k = each * own.shape[1] + own.argmax(axis=1)
            step = step * 2 / (self.looks.near - 1)
        inside = [bool(self._inside(at, j, sign)[node]) for j, node in enumerate(k.tolist())]
        return self._reach(at, sign)[k, each], np.array(inside)

    def _bounded(self, j: int, sign: float) -> float:
        """What is sign times the extreme of unknown j with every bound kept."""
        faces, nodes = list(self.faces(j)), self._grid(self.box, self.looks.first)
        offsets, step = self._steps()
        reach = self._kept(faces, nodes, j, sign)
        for _ in range(self.looks.again):
            nodes = np.clip(nodes[reach.argmax()] + step * offsets, *self.box.T)
            reach = self._kept(faces, nodes, j, sign)
            step = step * 2 / (self.looks.near - 1)
        return float(reach.max())

    def _kept(self, faces: Sequence[Face], nodes: Array, j: int, sign: float) -> Array:
        """The best of the faces' reaches of unknown j at each of K nodes that break no bound, (K,); -inf where there is none."""
        best = np.full(nodes.shape[0], -np.inf)
        for face in faces:
            at = face(nodes)
            best = np.maximum(best, np.where(self._inside(at, j, sign), self._reach(at, sign)[:, j], -np.inf))
        return best

    def _inside(self, at: Conditional, j: int, sign: float) -> NDArray[np.bool_]:
        """Whether no unknown breaks its bound at the extreme of unknown j, raised to its own bound if need be, at each node, (K,)."""
        own, theta = at.spread[:, j, j], at.theta[:, j]
        far = np.sqrt(own * np.maximum(self.threshold - at.cost, 0.0))
        end = np.maximum(theta + sign * far, 0.0) if self.bounded[j] else theta + sign * far
        moved = (end - theta) / np.where(own > 0, own, np.inf)
        slack = _SLACK * np.sqrt(np.einsum("kmm->km", at.spread) * self.threshold)
        inside = (at.theta + moved[:, None] * at.spread[:, j] >= -slack) | ~self.bounded
        inside[:, j] = end <= theta + far + slack[:, j]
        every: NDArray[np.bool_] = inside.all(axis=1)
        return every

    def _reach(self, at: Conditional, sign: float) -> Array:
        """What is sign times the extreme of each unknown at each node, (K, M); -inf where it costs too much."""
        left = self.threshold - at.cost[:, None]
        far = sign * at.theta + np.sqrt(np.einsum("kjj->kj", at.spread) * np.maximum(left, 0.0))
        return np.where(left >= -self.tolerance, far, -np.inf)

    def _held(self, face: Face, nodes: Array, j: int, values: Array) -> tuple[Array, NDArray[np.bool_]]:
        """The least cost on a face with unknown j held at values (D,), inf where others break a bound; and where the free least one breaks none."""
        at = face(nodes)
        own = at.spread[:, j, j]  # zero where no equation shows the unknown: any value costs the same
        off = np.divide(values[:, None] - at.theta[:, j], own, out=np.zeros((values.size, own.size)), where=own > 0)
        cost = at.cost + off**2 * own
        point = at.theta + off[:, :, None] * at.spread[:, j]
        fine = ((point >= -_SLACK * np.abs(point).max()) | ~self.bounded)[..., np.arange(at.theta.shape[1]) != j]
        inside = fine.all(axis=-1)
        return np.where(inside, cost, np.inf).min(axis=1), inside[np.arange(values.size), cost.argmin(axis=1)]


def _products(axes: Sequence[Array]) -> Array:
    """Every combination of values of the axes, a row each; one empty row for no axis."""
    rows = list(product(*(axis.tolist() for axis in axes)))
    return np.array(rows, dtype=float).reshape(len(rows), len(axes))
