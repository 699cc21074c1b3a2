"""The exact profile of unknowns in which a problem is linear once a few others, eta, are given.

With the unknown theta_j held at c and the rest solved,

    J(eta, c) = J(eta) + (c - theta_j(eta))**2 / C_jj(eta),    C = (A'A)**-1 of the columns A at eta,

so the values of c that cost no more than K are the union over eta of theta_j(eta) -+ sqrt(C_jj(eta) (K - J(eta))): an
interval ends at the highest and the lowest point of a curve over eta (a surface, where there are two), and no path over
c is followed. Some unknowns are not negative. At given eta the constrained extreme lies inside a face, where some of
them are zero, and is that face's free one: where the free extreme of all breaks a bound, the curve is, at each eta,
that of the best face whose extreme breaks none.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.estimation.profile_likelihood import BETTER

_SLACK = 1e-9  # an unknown this far below its bound of zero, in standard errors, is at it


class Conditional(NamedTuple):
    """M unknowns of S sets at K values of the others that make them linear."""

    theta: Array
    """(S, K, M), zero for what a face drops."""
    spread: Array
    """C, (S, K, M, M)."""
    cost: Array
    """J, (S, K)."""


Face = Callable[[Array], Conditional]
"""Solves the problem, or one face of it, at values of eta, (S, K, P)."""


class Looks(NamedTuple):
    """Over how many values of each eta extremes are looked for, and over how many a drawn profile is minimised.

    The first look is over all, the next ones near the best, again and again.
    """

    first: int
    near: int
    again: int
    drawn: int


@dataclass(slots=True, kw_only=True)
class ConditionalProfiles:
    """The profiles of conditionally linear unknowns of S sets; a single set is drawn, and kept to its bounds."""

    free: Face
    """The problem with no unknown at its bound."""
    best: Array
    """eta of the solution, (S, P)."""
    threshold: Array
    """K: what an unknown inside its interval costs at most, (S,)."""
    box: Array
    """Between which eta the threshold may be kept, (S, P, 2)."""
    looks: Looks
    cost: Array = field(default_factory=lambda: np.zeros(1))
    """J of the solution, (S,)."""
    bounded: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(1, dtype=bool))
    """Which unknowns are not negative, (M,)."""
    faces: Callable[[int], Iterable[Face]] | None = None
    """Every face of a single set on which an unknown is free."""
    searched: tuple[float, float] = (-np.inf, np.inf)
    """The lowest and highest eta that count."""
    tolerance: float = 0.0
    """Costs this near are the same."""
    better: Array | None = None
    """eta, (P,), at which `intervals` of a single set met a cost lower than the solution's; None: it met none."""
    broken: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=bool))
    """Sets of which `intervals` knows no faces, and an extreme breaks a bound, (S,)."""

    def intervals(self) -> Array:
        """Where each unknown's profile stays below the threshold, (S, M, 2)."""
        nodes = self._grid(self.box, self.looks.first)
        at = self.free(nodes)
        lowest, room = int(at.cost[0].argmin()), BETTER * float(self.threshold[0] - self.cost[0])
        lower = at.cost[0, lowest] < self.cost[0] - room - self.tolerance
        if lower and not (at.theta[0, lowest, self.bounded] < 0).any():
            self.better = nodes[0, lowest]
        self.broken = np.zeros(self.cost.size, dtype=bool)
        return np.stack([self._extremes(sign, nodes, at) for sign in (-1.0, 1.0)], axis=-1)

    def heights(self, j: int, values: Array, beyond: float) -> Array:
        """(cost - least) / (threshold - least) of unknown j at values of it, (k,); eta goes so far beyond its box."""
        width = np.diff(self.box, axis=-1)
        nodes = self._grid(np.clip(self.box + beyond * width * [-1, 1], *self.searched), self.looks.drawn)
        cost, inside = self._held(self.free, nodes, j, values)
        if self.faces and not inside.all():
            cost = np.min([self._held(face, nodes, j, values)[0] for face in self.faces(j)], axis=0)
        return np.asarray(np.maximum(cost - self.cost[0], 0.0) / max(float(self.threshold[0] - self.cost[0]), 1e-300))

    def _grid(self, box: Array, values: int) -> Array:
        """Points over a box, the best one among them, (S, K, P)."""
        low, width = box[..., 0], np.diff(box, axis=-1)[..., 0]
        inner = low[:, None] + width[:, None] * _products(np.linspace(0, 1, values), self.best.shape[1])
        return np.concatenate([inner, self.best[:, None]], axis=1)

    def _extremes(self, sign: float, nodes: Array, at: Conditional) -> Array:
        """The highest (sign 1) or lowest (-1) value of each unknown below the threshold, (S, M)."""
        (S, _, M), P, near = at.theta.shape, self.best.shape[1], self.looks.near
        offsets, step = self._steps()
        k = self._reach(at, sign).argmax(axis=1)
        for _ in range(self.looks.again):
            around = np.take_along_axis(nodes, k[..., None], axis=1)[:, :, None] + step[:, None, None] * offsets
            nodes = np.clip(around, *np.moveaxis(self.box, -1, 0)[:, :, None, None]).reshape(S, -1, P)
            at = self.free(nodes)
            reach = np.einsum("smnm->smn", self._reach(at, sign).reshape(S, M, -1, M))
            k = reach.argmax(axis=2) + reach.shape[2] * np.arange(M)
            step = step * 2 / (near - 1)
        extreme = np.take_along_axis(self._reach(at, sign), k[:, None], axis=1)[:, 0]
        for j in range(M):
            inside = np.take_along_axis(self._inside(at, j, sign), k[:, [j]], axis=1)[:, 0]
            if self.faces and not inside.all():
                extreme[0, j] = self._bounded(list(self.faces(j)), j, sign)
            else:
                self.broken |= ~inside
        return np.where(self.bounded, np.maximum(sign * extreme, 0.0), sign * extreme)

    def _steps(self) -> tuple[Array, Array]:
        """The nodes of the second look about the best, in steps, (K, P), and a step, (S, P)."""
        offsets = _products(np.linspace(-1, 1, self.looks.near), self.best.shape[1])
        return offsets, np.diff(self.box, axis=-1)[..., 0] / (self.looks.first - 1)

    def _bounded(self, faces: Sequence[Face], j: int, sign: float) -> float:
        """What is sign times the extreme of unknown j of a single set with every bound kept."""
        nodes, (offsets, step) = self._grid(self.box, self.looks.first), self._steps()
        reach = self._kept(faces, nodes, j, sign)
        for _ in range(self.looks.again):
            nodes = np.clip(nodes[:, reach.argmax()] + step * offsets, *self.box[0].T)[None]
            reach = self._kept(faces, nodes, j, sign)
            step = step * 2 / (self.looks.near - 1)
        return float(reach.max())

    def _kept(self, faces: Sequence[Face], nodes: Array, j: int, sign: float) -> Array:
        """The best reach of unknown j over the faces, at each node, (1, K); -inf where all break a bound."""
        best = np.full(nodes.shape[:2], -np.inf)
        for face in faces:
            at = face(nodes)
            best = np.maximum(best, np.where(self._inside(at, j, sign), self._reach(at, sign)[..., j], -np.inf))
        return best

    def _inside(self, at: Conditional, j: int, sign: float) -> NDArray[np.bool_]:
        """Whether at the extreme of unknown j, raised to its own bound if need be, no other breaks one, (S, K)."""
        variance, theta, most = at.spread[..., j, j], at.theta[..., j], self.threshold[:, None]
        far = np.sqrt(variance * np.maximum(most - at.cost, 0.0))
        end = np.maximum(theta + sign * far, 0.0) if self.bounded[j] else theta + sign * far
        moved = (end - theta) / np.where(variance > 0, variance, np.inf)
        slack = _SLACK * np.sqrt(np.einsum("skmm->skm", at.spread) * most[..., None])
        inside = (at.theta + moved[..., None] * at.spread[..., j] >= -slack) | ~self.bounded
        inside[..., j] = end <= theta + far + slack[..., j]
        return np.asarray(inside.all(axis=-1))

    def _reach(self, at: Conditional, sign: float) -> Array:
        """What is sign times the extreme of each unknown at each node, (S, K, M); -inf where it costs too much."""
        left = (self.threshold[:, None] - at.cost)[..., None]
        far = sign * at.theta + np.sqrt(np.einsum("skjj->skj", at.spread) * np.maximum(left, 0.0))
        return np.where(left >= -self.tolerance, far, -np.inf)

    def _held(self, face: Face, nodes: Array, j: int, values: Array) -> tuple[Array, NDArray[np.bool_]]:
        """The least cost of a face at values of unknown j (D,), inf where bounds break; and where none breaks."""
        theta, spread, least = (each[0] for each in face(nodes))
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
    """Every combination of values of so many equal axes, a row each; one empty row for no axis."""
    return np.array(list(product(axis.tolist(), repeat=count)), dtype=np.float64).reshape(axis.size**count, count)
