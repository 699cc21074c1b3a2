"""Huber's loss as least squares of other torques, in which what is far off the law is pulled in.

With p parameters, n residuals r of Huber's fit, psi(r) = r within the limit and the limit itself beyond, and m the share
within, the torques

    T* = modelled + c psi(r) / m,    c = 1 + p (1 - m) / (n m)

have Huber's estimate as their least squares and his covariance, c**2 (sum psi**2 / (n - p)) / m**2 (J'J)**-1, as its
covariance (Huber, Robust Statistics, 1981, sections 7.6 and 7.8). So they stand for the measured torques in everything
that follows: tests, intervals, cross-check and choice of a model need not know of the loss.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bristle.identification.static.grid import Solution, descended, solve
from bristle.identification.static.problem import Regression

TUNING = 1.345
"""Residuals beyond this many scales count linearly: 95 % efficiency on Gaussian noise (Huber, 1981)."""
_REFITS, _OF_MOTION = 50, 5
"""Refits of points, and of moving runs, whose own fit is that of all parameters."""
_SETTLED = 1e-6
"""Of the limit: torques that are pulled in no further than that."""


class HuberFit(NamedTuple):
    """A problem under Huber's loss."""

    problem: Regression
    """With T* for its torque."""
    solution: Solution
    """Its least squares: Huber's fit."""
    far: NDArray[np.bool_]
    """Equations beyond the limit, (n,)."""

    @property
    def spent(self) -> float:
        """Degrees of freedom over those of the equations within the limit, >= 1: what is beyond says nothing of the law's shape."""
        n, p = self.far.size, self.solution.theta.size
        return max(n - p, 1) / max(n - p - int(self.far.sum()), 1)


def huber(problem: Regression, v_s_range: tuple[float, float], grid: int) -> HuberFit:
    """The static problem under Huber's loss, its scale from the median absolute residual; priors are as certain as they say.

    Each step solves for the T* of the last one, which is nearly Newton's.
    """
    pulled, n = problem, problem.torque.size
    measured = np.arange(n) < n - problem.priors
    solution = solve(problem, v_s_range, grid)
    p = solution.theta.size
    for _ in range(_REFITS if problem.smooth is None else _OF_MOTION):
        residuals = problem.residuals(solution.theta)
        size = np.abs(residuals)
        limit = TUNING * 1.4826 * float(np.median(size[measured])) / np.sqrt(max(n - p, 1) / n)
        far = (size > limit) & measured
        if not limit:
            break
        inside = 1 - float(far[measured].mean())
        stretch = (1 + p * (1 - inside) / (n * inside)) / inside
        kept = np.where(measured, stretch * np.clip(residuals, -limit, limit), residuals)
        before, pulled = pulled, replace(problem, torque=problem.torque - residuals + kept)
        near = problem.split(solution.theta)[1].tolist()
        two = len(near) > 1  # whose grid takes long, and whose minimum moves little from step to step
        solution = descended(pulled, solution, near, v_s_range) if two else solve(pulled, v_s_range, grid)
        if np.abs(pulled.torque - before.torque).max() < _SETTLED * limit:
            break
    return HuberFit(pulled, solution, far)
