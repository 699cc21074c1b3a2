"""Nonlinear least squares in blocks: rows that share some unknowns, and have others to themselves, as windows have their starts.

Variable projection: for any shared unknowns each block settles its own ones by itself, with a damping of its own; what
is left is a small problem in the shared ones, whose Jacobian is the whole one's with each block's own columns projected
out. One stubborn block then holds up no other.
"""

from typing import Any

import numpy as np

from bristle.arrays import Array
from bristle.estimation.levenberg_marquardt import Minimum, minimise
from bristle.estimation.problem import LeastSquares, projected

_DAMPING, _MOST_DAMPING = 1e-2, 1e6
_INNER = 8
"""Evaluations in which blocks settle, where the shared unknowns moved a little ..."""
_FIRST = 40
"""... and the first time."""
_SETTLED = 1e-7
"""A block has settled when a step lowers its cost by less than this share."""


def descend(problem: LeastSquares[Any], start: Array, most: int) -> Minimum:
    """As `minimise`, for residuals in blocks; rows after the last block depend on shared unknowns alone."""
    shared, lower, upper = problem.shared, problem.unknowns.lower, problem.unknowns.upper
    best, residuals, jacobian = _settle(problem, np.clip(start, lower, upper), _FIRST)
    if not shared.size:
        return Minimum(best, float(residuals @ residuals), residuals, jacobian, 1, converged=True)
    lowest = np.inf

    def outer(p: Array) -> tuple[Array, Array]:
        """Residuals, (n,), and their projected Jacobian at shared unknowns, with each block settled; remembers the best."""
        nonlocal best, lowest
        x = best.copy()
        x[shared] = p
        x, rows, slopes = _settle(problem, x, _INNER)
        cost = float(rows @ rows)
        if not np.isfinite(cost):
            return rows, slopes[:, : shared.size]
        if cost < lowest:
            best, lowest = x, cost
        return rows, projected(slopes, shared, problem.blocks)

    found = minimise(outer, best[shared], lower[shared], upper[shared], most)
    residuals, jacobian = problem.evaluate(best)
    return Minimum(best, float(residuals @ residuals), residuals, jacobian, found.steps, found.converged)


def _settle(problem: LeastSquares[Any], x: Array, most: int) -> tuple[Array, Array, Array]:
    """Each block's own unknowns at given shared ones: all unknowns, residuals, Jacobian."""
    blocks, lower, upper = problem.blocks, problem.unknowns.lower, problem.unknowns.upper
    residuals, jacobian = problem.evaluate(x)
    if not np.isfinite(residuals @ residuals):
        return x, residuals, jacobian
    damping, busy = np.full(len(blocks), _DAMPING), np.ones(len(blocks), dtype=bool)
    for _ in range(most):
        trial = x.copy()
        for k in np.flatnonzero(busy).tolist():
            rows, columns = blocks[k]
            own = jacobian[rows][:, columns]
            size = np.maximum(np.sqrt(np.einsum("np,np->p", own, own)), 1e-300)
            unit = own / size
            inner = unit.T @ unit + damping[k] * np.eye(len(columns))
            step = np.linalg.lstsq(inner, unit.T @ residuals[rows], rcond=1e-15)[0] / size
            trial[columns] = np.clip(x[columns] - step, lower[columns], upper[columns])
        new_residuals, new_jacobian = problem.evaluate(trial)
        if not np.isfinite(new_residuals @ new_residuals):
            damping *= 10
            continue
        for k in np.flatnonzero(busy).tolist():
            rows, columns = blocks[k]
            old, new = (float(r[rows] @ r[rows]) for r in (residuals, new_residuals))
            if new <= old:
                x[columns], residuals[rows], jacobian[rows] = trial[columns], new_residuals[rows], new_jacobian[rows]
            busy[k] = not (old - new <= _SETTLED * old if new <= old else damping[k] > _MOST_DAMPING)
            damping[k] *= 0.1 if new <= old else 10.0
        if not busy.any():
            break
    return x, residuals, jacobian
