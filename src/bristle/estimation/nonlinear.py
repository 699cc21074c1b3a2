"""Nonlinear least squares: residuals and their exact Jacobian over scaled unknowns, and the descent between bounds.

Steps are Gauss and Newton's in a trust region (Levenberg and Marquardt), from J'J and J'r alone. Squaring the condition
of J makes a step less exact, not the minimum, where J'r vanishes.

Equations come in blocks, each of which may have unknowns of its own, as a window has its start; behind them stand the
rows of priors. What is known of the shared unknowns is in the Jacobian with each block's own columns projected out.
"""

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.errors import InputError

Name = TypeVar("Name", bound=Hashable)
Evaluate = Callable[[Array], tuple[Array, Array]]
"""Scaled unknowns, (p,) -> residuals, (n,), and their Jacobian, (n, p); not finite where the unknowns are impossible.
"""
_DAMPING = 1e-4
_MOST_DAMPING = 1e8
_HARDLY_SEEN = 1e-8  # of the longest column: damping takes shorter ones for this long, to keep what is hardly seen near
_SETTLED = 1e-6  # of the residuals' variance: steps end when the next would gain less, 1e-3 standard errors
_FLAT = 1e-6  # out of steps, the cost has settled if the last lowered it by less: what still moves is not seen
_SLOW, _CREEPS = 1e-2, 3
"""Steps end as well where so many in a row lower it by less than this share of the variance each, a tenth of a standard error: along a
narrow bend they would go on for hundreds."""
_HOPELESS = 4  # steps in a row that gain too little, after which a descent is given up:
_STILL_ABOVE = 1.2  # it stays above this many times the lowest end known, ...
_PROMISED = 3.0  # ... were all that is left to gain this many times what the step gained


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
    starts: tuple[int, ...] = (0,)
    """First equation of each segment between gaps; no correlation reaches over one."""
    priors: int = 0
    """How many of the last rows are priors, which scatter by `sigma` ..."""
    sigma: float = 1.0
    """... as the residuals do."""

    @property
    def shared(self) -> NDArray[np.intp]:
        """The unknowns that no block has to itself, ascending."""
        of_blocks = [k for block in self.blocks for k in block.columns]
        return np.setdiff1d(np.arange(len(self.unknowns.names)), of_blocks)


def projected(jacobian: Array, shared: NDArray[np.intp], blocks: tuple[Block, ...]) -> Array:
    """Some shared unknowns' columns, (n, len(shared)), with what each block's own can do taken off."""
    left = jacobian[:, shared]
    for rows, columns in blocks:
        basis = np.linalg.qr(jacobian[rows][:, columns])[0]
        left[rows] -= basis @ (basis.T @ left[rows])
    return left


class Minimum(NamedTuple):
    """Where a descent ended."""

    x: Array
    cost: float
    residuals: Array
    jacobian: Array
    """Of the residuals with respect to x, (n, p)."""
    steps: int
    """Steps that lowered the cost."""
    converged: bool


def minimise(
    evaluate: Evaluate,
    start: Array,
    lower: Array,
    upper: Array,
    most: int = 100,
    settled: float = _SETTLED,
    lowest: float = np.inf,
    enough: float = 0.0,
) -> Minimum:
    """The nearest minimum of the sum of squared residuals, lower <= x <= upper, in `most` steps; a start beyond is moved to the bounds.

    What lowers the cost by less than the share `settled` of the residuals' variance, or than `enough`, is no step any more. A
    descent that clearly goes to an end worse than the `lowest` known is given up, unconverged.

    Raises InputError where the start gives no finite cost, or the gradient there is zero: nothing then depends on x.
    """
    x = np.clip(start, lower, upper)
    residuals, jacobian = evaluate(x)
    cost = float(residuals @ residuals) if np.isfinite(np.vdot(jacobian, jacobian)) else np.inf
    if not np.isfinite(cost) or not (jacobian.T @ residuals).any():
        what = "the gradient is zero" if np.isfinite(cost) else "the cost is not finite"
        raise InputError(
            f"at the start of the fit {what}; the motion shows none of the parameters, or the start is wrong"
        )
    damping, taken, scale, converged, hopeless, slow = _DAMPING, 0, np.zeros(x.size), False, 0, 0
    gram, slope = jacobian.T @ jacobian, jacobian.T @ residuals
    for _ in range(most):
        scale = np.maximum(scale, np.sqrt(gram.diagonal()))
        size = np.where(scale > 0, np.maximum(scale, _HARDLY_SEEN * scale.max()), 0.0)
        free = (scale > 0) & ~((x <= lower) & (slope > 0)) & ~((x >= upper) & (slope < 0))
        # the damped step, none where not free, and by how much it lowers the linearised cost
        inner, right = gram[np.ix_(free, free)] / np.outer(size[free], size[free]), slope[free] / size[free]
        scaled = -np.linalg.lstsq(inner + damping * np.eye(right.size), right, rcond=1e-15)[0]
        expected = float(-2 * scaled @ right - scaled @ inner @ scaled)
        if expected <= max(settled * cost / residuals.size, enough):
            converged = True
            break
        trial = x.copy()
        trial[free] += scaled / size[free]
        trial = np.clip(trial, lower, upper)
        new_residuals, new_jacobian = evaluate(trial)
        new_cost = float(new_residuals @ new_residuals) if np.isfinite(np.vdot(new_jacobian, new_jacobian)) else np.inf
        gained = (cost - new_cost) / expected if np.isfinite(new_cost) else -1.0
        if gained > 1e-4:
            converged = cost - new_cost <= _FLAT * cost
            little = new_cost - _PROMISED * (cost - new_cost) > _STILL_ABOVE * lowest
            hopeless = hopeless + 1 if little else 0
            slow = slow + 1 if cost - new_cost <= max(_SLOW * cost / residuals.size, enough) else 0
            x, residuals, jacobian, cost = trial, new_residuals, new_jacobian, new_cost
            gram, slope = jacobian.T @ jacobian, jacobian.T @ residuals
            taken += 1
            if hopeless >= _HOPELESS or slow >= _CREEPS:
                converged = slow >= _CREEPS
                break
        damping = damping * (0.1 if gained > 0.75 else 1.0 if gained > 0.25 else 10.0)
        if damping > _MOST_DAMPING:
            converged = abs(cost - new_cost) <= 1e-9 * cost
            break
    return Minimum(x, cost, residuals, jacobian, taken, converged)
