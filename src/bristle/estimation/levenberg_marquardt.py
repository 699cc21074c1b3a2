"""Nonlinear least squares with an exact Jacobian: Gauss-Newton steps in a trust region (Levenberg and Marquardt), between bounds.

A step needs of the Jacobian only J'J and J'r, as many rows as unknowns: forming them is cheap beside the Jacobian
itself. Squaring its condition makes a step less exact, not the minimum, where J'r vanishes.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.errors import InputError

_DAMPING = 1e-4
_MOST = 1e8
_SETTLED = 1e-6
"""Steps end when the next one would lower the cost by less than this share of the residuals' variance: 1e-3 standard errors."""
_FLAT = 1e-6
"""Out of steps, the cost has settled if the last one lowered it by less than this share: what still moves is not seen."""


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
    evaluate: Callable[[Array], tuple[Array, Array]],
    start: Array,
    lower: Array,
    upper: Array,
    most: int = 100,
    settled: float = _SETTLED,
) -> Minimum:
    """The nearest minimum of the sum of squared residuals, lower <= x <= upper.

    Args:
        evaluate: x (p,) -> residuals (n,) and their Jacobian (n, p); not finite where x is impossible.
        start: (p,); moved to the bounds where it lies beyond.
        lower: bounds, (p,), -inf where there is none.
        upper: bounds, (p,), inf where there is none.
        most: steps tried.
        settled: what lowers the cost by less than this share of the residuals' variance is no step any more.

    Raises InputError where the start gives no finite cost, or the gradient there is zero: nothing then depends on x.
    """
    x = np.clip(start, lower, upper)
    residuals, jacobian = evaluate(x)
    cost = float(residuals @ residuals)
    if not np.isfinite(cost) or not (jacobian.T @ residuals).any():
        what = "the gradient is zero" if np.isfinite(cost) else "the cost is not finite"
        raise InputError(
            f"at the start of the fit {what}; the motion shows none of the parameters, or the start is wrong"
        )
    damping, taken, scale, converged = _DAMPING, 0, np.zeros(x.size), False
    gram, slope = jacobian.T @ jacobian, jacobian.T @ residuals
    for _ in range(most):
        scale = np.maximum(scale, np.sqrt(gram.diagonal()))
        free = (scale > 0) & ~((x <= lower) & (slope > 0)) & ~((x >= upper) & (slope < 0))
        step, expected = _step(gram, slope, scale, free, damping)
        if expected <= settled * cost / residuals.size:
            converged = True
            break
        trial = np.clip(x + step, lower, upper)
        new_residuals, new_jacobian = evaluate(trial)
        new_cost = float(new_residuals @ new_residuals)
        gained = (cost - new_cost) / expected if np.isfinite(new_cost) else -1.0
        if gained > 1e-4:
            converged = cost - new_cost <= _FLAT * cost
            x, residuals, jacobian, cost = trial, new_residuals, new_jacobian, new_cost
            gram, slope = jacobian.T @ jacobian, jacobian.T @ residuals
            taken += 1
        damping = damping * (0.1 if gained > 0.75 else 1.0 if gained > 0.25 else 10.0)
        if damping > _MOST:
            converged = abs(cost - new_cost) <= 1e-9 * cost
            break
    return Minimum(x, cost, residuals, jacobian, taken, converged)


def _step(gram: Array, slope: Array, scale: Array, free: NDArray[np.bool_], damping: float) -> tuple[Array, float]:
    """The damped Gauss-Newton step (p,), zero where an unknown is not free, and by how much it lowers the linearised cost."""
    size = scale[free]
    inner, right = gram[np.ix_(free, free)] / np.outer(size, size), slope[free] / size
    taken = -np.linalg.lstsq(inner + damping * np.eye(size.size), right, rcond=1e-15)[0]
    step = np.zeros(scale.size)
    step[free] = taken / size
    return step, float(-2 * taken @ right - taken @ inner @ taken)
