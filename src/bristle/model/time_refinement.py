"""Nodes of the bristle state along a sampled velocity: samples, zero crossings, and more at low speed."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array

Index = NDArray[np.intp]

_FINE = 0.05  # between neighbouring nodes at low speed, v changes by at most this many v_s ...
_NEAR = 4.0  # ... where low speed is below this many v_s; faster, exp(-(v / v_s)**2) is nothing ...
_MOST = 64  # ... and a step is cut into at most about this many; all by a coarsening


@dataclass(frozen=True, slots=True)
class Nodes:
    """N nodes, of which n are samples."""

    v: Array  # Velocity at the nodes, rad/s, (N,)
    h: float | Array  # Time between nodes, s: scalar or (N - 1,)
    samples: slice | Index  # Indices of the n samples
    level: Array | None = None  # Added to alpha_0, N*m, with derivatives, (1 + k, N), or None
    begins: Index = field(default_factory=lambda: np.zeros(0, dtype=np.intp))  # Nodes at which another motion begins

    @property
    def steps(self) -> tuple[Array, Array, float | Array]:
        """v0, v1 and h of every step."""
        return self.v[:-1], self.v[1:], self.h

    @property
    def rise(self) -> Array:
        """Mean `level` over each step, (1 + k, N - 1); zero without."""
        return np.zeros((1, 1)) if self.level is None else (self.level[:, :-1] + self.level[:, 1:]) / 2

    @property
    def heading(self) -> Array:
        """v0 + v1 of every step, (N - 1,): its sign is the direction."""
        return self.v[:-1] + self.v[1:]

    def inside(self, steps: Index, fractions: Array) -> tuple[Array, Array | None]:
        """Velocity, (k,), and level, (1 + k', k), at fractions of some steps."""
        level = self.level
        v = self.v[steps] + (self.v[steps + 1] - self.v[steps]) * fractions
        return v, None if level is None else level[:, steps] + (level[:, steps + 1] - level[:, steps]) * fractions


def with_extra_nodes(samples: Nodes, v_s: float, coarsening: float = 1.0) -> Nodes:
    """Samples, zero crossings of v, and nodes at low speed, `coarsening` times farther apart."""
    v0, v1, _ = samples.steps
    product, change = v0 * v1, np.abs(v1 - v0)
    product[samples.begins - 1] = change[samples.begins - 1] = 0.0
    crossing = np.flatnonzero(product < 0)
    fine = _FINE * coarsening * v_s
    wide = np.flatnonzero(change > fine)
    slowest = np.where(product[wide] < 0, 0.0, np.minimum(np.abs(v0[wide]), np.abs(v1[wide])))
    wide = wide[slowest < _NEAR * v_s]
    if crossing.size + wide.size == 0:
        return samples
    count = np.ceil(np.minimum(change[wide] / fine, _MOST / coarsening)).astype(np.intp)
    more = count - 1
    number = 1 + np.arange(more.sum()) - np.repeat(np.cumsum(more) - more, more)
    zero = v0[crossing] / (v0[crossing] - v1[crossing])
    steps = np.concatenate([np.repeat(wide, more), crossing])
    return inserted(samples, steps, np.concatenate([number / np.repeat(count, more), zero]))[0]


def inserted(nodes: Nodes, steps: Index, fractions: Array) -> tuple[Nodes, Index]:
    """Nodes with one more inside each of `steps` (k,), at a fraction (k,); and the indices of the old ones, (N,)."""
    order = np.lexsort((fractions, steps))
    steps, fractions = steps[order], fractions[order]
    new = steps + 1 + np.arange(steps.size)
    is_old = np.ones(nodes.v.size + steps.size, dtype=bool)
    is_old[new] = False
    old = np.flatnonzero(is_old)
    v, portion = np.empty(is_old.size), np.ones(is_old.size - 1)
    v[old], (v[new], between) = nodes.v, nodes.inside(steps, fractions)
    portion[new] -= fractions  # from each new node to the end of the step it is in,
    portion[new - 1] -= portion[new]  # less what follows the next one
    level = None
    if nodes.level is not None:
        level = np.empty((len(nodes.level), is_old.size))
        level[:, old], level[:, new] = nodes.level, between
    h: float | Array = nodes.h
    if isinstance(nodes.h, np.ndarray):
        h = np.empty(portion.size)
        h[old[:-1]], h[new] = nodes.h, nodes.h[steps]
    return Nodes(v, h * portion, old[nodes.samples], level, old[nodes.begins]), old
