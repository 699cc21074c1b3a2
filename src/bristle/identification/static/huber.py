"""The static problem under Huber's loss, which an outlier moves less."""

import numpy as np

from bristle.arrays import Array
from bristle.identification.static.grid import Solution, solve
from bristle.identification.static.problem import Regression

TUNING = 1.345
"""Residuals beyond this many scales count linearly: 95 % efficiency on Gaussian noise (Huber, 1981)."""
_REFITS = 30
_SETTLED = 1e-4


def huber(problem: Regression, v_s_range: tuple[float, float], grid: int) -> tuple[Solution, Array]:
    """The static problem under Huber's loss, by iteratively reweighted least squares.

    Its scale from the median absolute residual. Returns the solution and each equation's weight in (0, 1], shape (n,);
    a weight well below one marks an outlier.
    """
    weight = np.ones(problem.torque.size)
    solution = solve(problem, v_s_range, grid)
    freedom = max(problem.torque.size - solution.theta.size, 1) / problem.torque.size
    for _ in range(_REFITS):
        residuals = np.abs(problem.residuals(solution.theta))
        limit = TUNING * 1.4826 * float(np.median(residuals)) / np.sqrt(freedom)
        ratio = np.divide(limit, residuals, out=np.ones_like(residuals), where=residuals > 0)
        new = np.minimum(1.0, ratio) if limit else weight
        if np.abs(new - weight).max() < _SETTLED:
            break
        weight = new
        solution = solve(problem.weighted(weight), v_s_range, grid)
    return solution, weight
