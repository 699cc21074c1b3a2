"""A least-squares problem: residuals and their exact Jacobian as functions of scaled unknowns, and what is known of both.

Equations come in blocks, each of which may have unknowns of its own, as a window has its start; behind them stand the
rows of priors.
"""

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array

Name = TypeVar("Name", bound=Hashable)
Evaluate = Callable[[Array], tuple[Array, Array]]
"""Scaled unknowns, (p,) -> residuals, (n,), and their Jacobian, (n, p); not finite where the unknowns are impossible."""


class Block(NamedTuple):
    """Rows of the residuals, and the unknowns that no other rows depend on."""

    rows: slice
    columns: list[int]


@dataclass(frozen=True, slots=True, kw_only=True)
class Unknowns(Generic[Name]):
    """The free unknowns of a problem; a solver sees each as its logarithm, or over a typical size."""

    names: tuple[Name, ...]
    logarithmic: NDArray[np.bool_]
    """Which stand as their logarithm, (p,)."""
    scale: Array
    """A typical size of each, (p,), > 0; 1 where it stands as its logarithm."""
    lower: Array
    """Bounds of the scaled unknowns, (p,), -inf where there is none."""
    upper: Array
    """The same from above."""
    least: Array
    """What each may be at all, in its unit: 0 or -inf, (p,). A side of an interval that data leave open ends there."""

    def scaled(self, values: Mapping[Name, float]) -> Array:
        """The unknowns as a solver sees them, (p,)."""
        natural = np.array([values[name] for name in self.names], dtype=np.float64)
        logarithms = np.log(natural, out=np.zeros(natural.size), where=self.logarithmic)
        return np.where(self.logarithmic, logarithms, natural / self.scale)

    def natural(self, x: Array) -> Array:
        """The unknowns in their units from scaled ones, (p,)."""
        return np.where(self.logarithmic, np.exp(np.where(self.logarithmic, x, 0.0)), x * self.scale)

    def natural_of(self, which: int, x: Array) -> Array:
        """One unknown in its unit at scaled values of it, (k,)."""
        return np.exp(x) if self.logarithmic[which] else x * self.scale[which]

    def slopes(self, x: Array) -> Array:
        """Derivative of each unknown by its scaled one, (p,)."""
        return np.where(self.logarithmic, self.natural(x), self.scale)

    def values(self, x: Array) -> dict[Name, float]:
        """The inverse of `scaled`."""
        return dict(zip(self.names, self.natural(x).tolist(), strict=True))


@dataclass(frozen=True, slots=True, kw_only=True)
class LeastSquares(Generic[Name]):
    """The problem of the least sum of squared residuals between the bounds of its unknowns."""

    unknowns: Unknowns[Name]
    evaluate: Evaluate
    blocks: tuple[Block, ...] = ()
    """Groups of equations that have unknowns of their own, in the order of the rows."""
    independent: bool = False
    """Whether blocks err independently of one another, however correlated their own residuals are."""
    stretches: tuple[int, ...] = (0,)
    """First equation of each stretch; no correlation reaches over one."""
    priors: int = 0
    """How many of the last rows are priors, which scatter by `sigma` ..."""
    sigma: float = 1.0
    """... as the residuals do."""

    @property
    def shared(self) -> NDArray[np.intp]:
        """The unknowns that no block has to itself, ascending."""
        own = [k for block in self.blocks for k in block.columns]
        return np.setdiff1d(np.arange(len(self.unknowns.names)), own)


def projected(jacobian: Array, shared: NDArray[np.intp], blocks: tuple[Block, ...]) -> Array:
    """Some shared unknowns' columns, (n, len(shared)), with what each block's own can do taken off."""
    left = jacobian[:, shared]
    for rows, columns in blocks:
        basis = np.linalg.qr(jacobian[rows][:, columns])[0]
        left[rows] -= basis @ (basis.T @ left[rows])
    return left
