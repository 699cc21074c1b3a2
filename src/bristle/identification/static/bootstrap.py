"""Bootstrap of a static fit: points drawn anew at the same velocities and fitted again by the whole grid; what is dear to fit, by one step.

v_s is stepped by its logarithm: an interval need be neither symmetric nor normal.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.estimation.bootstrap import FEW, REFITS, Resampled, block_bootstrap, linear_refit, residual_bootstrap
from bristle.identification.static.batch import Batch
from bristle.identification.static.grid import Solution
from bristle.identification.static.problem import Regression

SEED = 0


class StaticDraws(NamedTuple):
    """What draws do to p parameters, in their units."""

    low: Array
    """Lower ends of the 95 % intervals, (p,); -inf, or 0 for what is positive, where too many draws do not show the parameter."""
    high: Array
    """(p,)."""
    draws: Array
    """(p, b)."""
    wild: bool
    """Whether signs and sizes of residuals are drawn, not their places."""


def resample(
    problem: Regression, solution: Solution, v_s_range: tuple[float, float], draws: int = REFITS, seed: int = SEED
) -> StaticDraws:
    """Intervals of every parameter, in the order of the problem's `names`, for points of which each stands alone, with at most one peak.

    Args:
        problem: the points.
        solution: its solution.
        v_s_range: as it was solved with.
        draws: resampled sets, >= 40.
        seed: of the generator.
    """
    best, logarithmic = solution.theta[:, None], _logarithmic(problem)[:, None]

    def refit(residuals: Array, uneven: bool) -> tuple[Array, Array]:
        """How far the whole grid's estimates lie off, and their standard errors; inf where nothing is seen of a parameter."""
        torques = (problem.torque - solution.residuals)[:, None] + residuals
        if not problem.peaks:
            theta, errors = linear_refit(problem.linear, torques, uneven)
            return theta - best, errors
        found = Batch(problem, torques, v_s_range)
        with np.errstate(divide="ignore", invalid="ignore"):
            steps = np.where(logarithmic, np.log(found.theta / best), found.theta - best)
        size = np.where(logarithmic, np.column_stack([best, found.theta[:, 1:]]), 1.0)
        return steps, found.errors(robust=uneven) / size

    drawn, errors = residual_bootstrap(
        solution.jacobian, solution.residuals, problem.velocity, refit, draws=draws, seed=seed
    )
    return _in_units(problem, solution, drawn, errors)


def resample_steps(
    problem: Regression, solution: Solution, covariance: Array, seed: int = SEED
) -> tuple[tuple[str, ...], StaticDraws] | None:
    """The same by one step of Gauss and Newton, for moving data, priors or two peaks; None where too few blocks are left to draw.

    Args:
        problem: the equations.
        solution: its solution.
        covariance: of the parameters at no bound, which alone are stepped.
        seed: of the generator.

    Returns:
        Their names, and what draws do to them.
    """
    keep = [k for k, name in enumerate(problem.names) if name not in solution.at_bound]
    size = np.where(_logarithmic(problem), solution.theta, 1.0)[keep]
    J, measured = solution.jacobian[:, keep] * size, problem.torque.size - problem.priors
    if problem.smooth is None:
        drawn, errors = residual_bootstrap(J, solution.residuals, problem.velocity, seed=seed)
    else:
        sigma = float(np.sqrt(solution.cost / max(problem.torque.size - len(keep), 1)))
        priors, errors = -J[measured:], np.sqrt(np.diag(covariance)) / size
        drawn = block_bootstrap(-J[:measured], solution.residuals[:measured], priors=priors, sigma=sigma, seed=seed)
        if drawn.blocks < FEW:
            return None
    names = tuple(problem.names[k] for k in keep)
    return names, _in_units(problem, solution, drawn, errors, keep)


def _logarithmic(problem: Regression) -> NDArray[np.bool_]:
    return np.array([name.startswith("v_s") for name in problem.names])


def _in_units(
    problem: Regression, solution: Solution, drawn: Resampled, errors: Array, keep: Sequence[int] | None = None
) -> StaticDraws:
    """Intervals and draws of some parameters; no friction parameter below zero."""
    which = list(range(len(problem.names))) if keep is None else list(keep)
    best, names = solution.theta[which, None], [problem.names[k] for k in which]
    floor = np.array([[0.0 if name.startswith(("alpha", "v_s")) else -np.inf] for name in names])
    ends = np.array([drawn.interval(k, error) for k, error in enumerate(errors.tolist())])

    def moved(steps: Array) -> Array:
        """The estimates moved by steps, (p, k)."""
        with np.errstate(over="ignore", invalid="ignore"):
            off = np.where(_logarithmic(problem)[which, None], best * np.exp(steps), best + steps)
        floored: Array = np.maximum(off, floor)
        return floored

    low, high = moved(ends).T
    return StaticDraws(low, high, moved(drawn.steps.T), drawn.wild)
