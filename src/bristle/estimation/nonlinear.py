"""Nonlinear least squares between bounds, by Gauss-Newton steps in a trust region.

Blocks of equations may have a private unknown each, the last ones. Steps project them out, as in variable projection
(Golub and Pereyra, 1973), so that the cost grows linearly with blocks.
"""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.errors import InputError

Name = TypeVar("Name", bound=Hashable)
Evaluate = Callable[[Array], tuple[Array, Array]]
"""Scaled unknowns, (p,) -> residuals, (n,), and Jacobian, (n, p); not finite where impossible.

Private unknowns share one column, its last: of each equation the derivative by that of its block.
"""
_DAMPING = 1e-4
_MOST_DAMPING = 1e8
_EASED, _CAREFUL, _BOLDER = 0.1, 0.5, 0.85  # factors on the damping after a good step, on it after a bad one, and back
_HARDLY_SEEN = 1e-8  # of the longest column: damping treats shorter ones as so long
_SETTLED = 1e-6  # of the residuals' variance: smaller gains end the steps, at 1e-3 standard errors
_FLAT = 1e-6  # of the variance: a smaller last gain counts as converged when steps run out
_SLOW, _CREEPS = 1e-2, 3  # of the variance: so many steps in a row that gain less each end the steps, too
_HOPELESS = 4  # steps of too little gain in a row, after which a descent is given up
_STILL_ABOVE = 1.2  # of the lowest cost known, that it stays above
_PROMISED = 3.0  # times the step's gain, as all that is left to gain


class Private(NamedTuple):
    """Derivatives of the equations by the private unknown of their block."""

    column: Array  # (n,), or (0,) without private unknowns
    starts: Sequence[int] = ()  # First equation of each block

    def off(self, columns: Array) -> Array:
        """Columns, (n, k) or (n,), less what private unknowns explain."""
        if not self.column.size:
            return columns
        return np.asarray((columns.T - self.column * self.spread(self.shares(columns))).T)

    def shares(self, columns: Array) -> Array:
        """Multiples of the private derivatives that explain columns, (n, k) or (n,), best: (k, m) or (m,)."""
        along, squares = (np.add.reduceat(x * self.column, self.starts, axis=-1) for x in (columns.T, self.column))
        return np.asarray(along / np.where(squares > 0, squares, np.inf))

    def spread(self, values: Array) -> Array:
        """Values of blocks, (..., m), at each equation, (..., n)."""
        return np.repeat(values, np.diff(np.append(self.starts, self.column.size)), axis=-1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Unknowns(Generic[Name]):
    """The free unknowns, scaled: a logarithm, or over a typical size."""

    names: tuple[Name, ...]
    logarithmic: NDArray[np.bool_]  # (p,)
    scale: Array  # Typical sizes, (p,), > 0; 1 for logarithms
    lower: Array  # Scaled bounds, (p,)
    upper: Array  # (p,)
    least: Array  # Smallest possible values in units, 0 or -inf, (p,)

    def scaled(self, values: Mapping[Name, float]) -> Array:
        """Scaled unknowns, (p,)."""
        natural = np.array([values[name] for name in self.names], dtype=np.float64)
        logarithms = np.log(natural, out=np.zeros(natural.size), where=self.logarithmic)
        return np.where(self.logarithmic, logarithms, natural / self.scale)

    def natural(self, x: Array) -> Array:
        """Unknowns in their units, (p,)."""
        return np.where(self.logarithmic, np.exp(np.where(self.logarithmic, x, 0.0)), x * self.scale)

    def natural_of(self, which: int, x: Array) -> Array:
        """One unknown in its unit at scaled values, (k,)."""
        return np.exp(x) if self.logarithmic[which] else x * self.scale[which]

    def slopes(self, x: Array) -> Array:
        """Derivative of each unknown by its scaled one, (p,)."""
        return np.where(self.logarithmic, self.natural(x), self.scale)

    def values(self, x: Array) -> dict[Name, float]:
        """The inverse of `scaled`."""
        return dict(zip(self.names, self.natural(x).tolist(), strict=True))


@dataclass(frozen=True, slots=True, kw_only=True)
class LeastSquares(Generic[Name]):
    """Least squares between bounds."""

    unknowns: Unknowns[Name]
    evaluate: Evaluate
    starts: tuple[int, ...] = (0,)  # First equation of each segment between gaps
    private: bool = False  # Whether the last unknowns are private to a segment each
    priors: int = 0  # Number of the last rows that are priors, which scatter by `sigma`
    sigma: float = 1.0

    @property
    def blocks(self) -> tuple[int, ...]:
        """First equation of each segment with a private unknown."""
        return self.starts if self.private else ()

    @property
    def shared(self) -> int:
        """Number of unknowns that are private to no segment, the first ones, k."""
        return len(self.unknowns.names) - len(self.blocks)


class Minimum(NamedTuple):
    """The end of a descent."""

    x: Array  # (p,)
    cost: float
    residuals: Array  # (n,)
    jacobian: Array  # Of the residuals by the shared unknowns, the first of x, with private ones projected out, (n, k)
    steps: int  # Steps that lowered the cost
    converged: bool
    private: Private = Private(np.zeros(0))


def minimise(
    evaluate: Evaluate,
    start: Array,
    lower: Array,
    upper: Array,
    most: int = 100,
    settled: float = _SETTLED,
    lowest: float = np.inf,
    enough: float = 0.0,
    blocks: Sequence[int] = (),
) -> Minimum:
    """The nearest minimum of the sum of squares with lower <= x <= upper, in at most `most` steps.

    Ends at steps below the share `settled` of the residuals' variance, or below `enough`; gives up, unconverged, where
    the end is clearly above `lowest`; `blocks` begin at these equations, if they have private unknowns. Raises InputError
    where the start has no finite cost, or nothing depends on x.
    """
    x, k = np.clip(start, lower, upper), start.size - len(blocks)
    residuals, jacobian = evaluate(x)
    cost = float(residuals @ residuals) if np.isfinite(np.vdot(jacobian, jacobian)) else np.inf
    if not np.isfinite(cost) or not (jacobian.T @ residuals).any():
        what = "the gradient is zero" if np.isfinite(cost) else "the cost is not finite"
        raise InputError(
            f"at the start of the fit {what}; the motion shows none of the parameters, or the start is wrong"
        )
    damping, eased, taken, scale, converged, hopeless, slow = _DAMPING, _EASED, 0, np.zeros(k), False, 0, 0
    private, seen, left = _projected(x, residuals, jacobian, lower, upper, blocks)
    gram, slope = seen.T @ seen, seen.T @ left
    for _ in range(most):
        scale = np.maximum(scale, np.sqrt(gram.diagonal()))
        size = np.where(scale > 0, np.maximum(scale, _HARDLY_SEEN * scale.max()), 0.0)
        free = (scale > 0) & ~_held(x[:k], slope, lower[:k], upper[:k])
        # the damped step, none where not free, and by how much it lowers the linearised cost
        inner, right = gram[np.ix_(free, free)] / np.outer(size[free], size[free]), slope[free] / size[free]
        scaled = -np.linalg.lstsq(inner + damping * np.eye(right.size), right, rcond=1e-15)[0]
        expected = float(-2 * scaled @ right - scaled @ inner @ scaled) + (cost - float(left @ left))
        if expected <= max(settled * cost / residuals.size, enough):
            converged = True
            break
        trial = x.copy()
        trial[:k][free] += scaled / size[free]
        trial = np.clip(trial, lower, upper)
        if blocks:  # private unknowns follow at once
            trial[k:] -= private.shares(residuals + jacobian[:, :k] @ (trial[:k] - x[:k]))
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
            private, seen, left = _projected(x, residuals, jacobian, lower, upper, blocks)
            gram, slope = seen.T @ seen, seen.T @ left
            taken += 1
            if hopeless >= _HOPELESS or slow >= _CREEPS:
                converged = slow >= _CREEPS
                break
        damping = damping * (eased if gained > 0.75 else 1.0 if gained > 0.25 else 10.0)
        eased = max(_BOLDER * eased, _EASED) if gained > 0.25 else _CAREFUL
        if damping > _MOST_DAMPING:
            converged = abs(cost - new_cost) <= 1e-9 * cost
            break
    return Minimum(x, cost, residuals, seen, taken, converged, private)


def _projected(
    x: Array, residuals: Array, jacobian: Array, lower: Array, upper: Array, blocks: Sequence[int]
) -> tuple[Private, Array, Array]:
    """Private derivatives, but of those held at a bound, and the others' and the residuals with them projected out."""
    if not blocks:
        return Private(np.zeros(0)), jacobian, residuals
    k = x.size - len(blocks)
    private = Private(jacobian[:, k], blocks)
    held = _held(x[k:], private.shares(residuals), lower[k:], upper[k:])
    private = private._replace(column=private.column * private.spread(np.where(held, 0.0, 1.0)))
    return private, private.off(jacobian[:, :k]), private.off(residuals)


def _held(x: Array, slope: Array, lower: Array, upper: Array) -> NDArray[np.bool_]:
    """Whether unknowns are at a bound, and descent is beyond."""
    return np.asarray(((x <= lower) & (slope > 0)) | ((x >= upper) & (slope < 0)))
