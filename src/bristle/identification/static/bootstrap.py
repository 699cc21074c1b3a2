"""Bootstrap of a static fit: points drawn anew at the same velocities and fitted again by the whole grid; what is dear to fit, by one step.

v_s is stepped by its logarithm: an interval need be neither symmetric nor normal.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.estimation.bootstrap import FEW, REFITS, Resampled, block_bootstrap, linear_refit, residual_bootstrap
from bristle.identification.static.batch import Batch
from bristle.identification.static.grid import Solution
from bristle.identification.static.problem import Regression
from bristle.model.parameters import Stribeck

SEED = 0


class StaticDraws(NamedTuple):
    """What draws do to p parameters, in their units."""

    low: Array
    """Lower ends of the 95 % intervals, (p,); -inf, or 0 for what is positive, where too many draws do not show the parameter; nan: there is none."""
    high: Array
    """(p,)."""
    draws: Array
    """(p, b)."""
    wild: bool
    """Whether signs and sizes of residuals are drawn, not their places."""


def resample(
    problem: Regression,
    solution: Solution,
    v_s_range: tuple[float, float],
    draws: int = REFITS,
    seed: int = SEED,
    covariance: Array | None = None,
) -> StaticDraws:
    """Intervals of every parameter in the order of the problem's `names`.

    Points of which each stands alone, with at most one peak, are fitted again; parameters of others go one step of
    Gauss and Newton, those at a bound none, and none does where moving data leave too few blocks to draw.

    Args:
        problem: the equations.
        solution: its solution.
        v_s_range: as it was solved with.
        draws: resampled sets, >= 40; of moving data there are always as many.
        seed: of the generator.
        covariance: of the parameters at no bound; of moving data alone.
    """
    keep = np.ones(len(problem.names), dtype=bool)
    if problem.smooth is None and len(problem.peaks) < 2:
        drawn, errors = _refitted(problem, solution, v_s_range, draws, seed)
    else:
        keep = np.array([name not in solution.at_bound for name in problem.names])
        drawn, errors = _stepped(problem, solution, keep, seed, covariance)
    if problem.smooth is not None and drawn.blocks < FEW:
        keep[:], errors = False, errors[:0]
    ends = np.array([drawn.interval(k, error) for k, error in enumerate(errors.tolist())]).reshape(-1, 2)
    best, logarithmic = solution.theta[keep, None], _logarithmic(problem)[keep, None]
    floor = np.array([0.0 if name.name in Stribeck._fields else -np.inf for name in problem.names])[keep, None]

    def moved(steps: Array) -> Array:
        """All parameters moved by steps, (p, k); nan for what is not stepped."""
        out = np.full((keep.size, steps.shape[1]), np.nan)
        with np.errstate(over="ignore", invalid="ignore"):
            off = np.where(logarithmic, best * np.exp(steps), best + steps)
        out[keep] = np.maximum(off, floor)
        return out

    low, high = moved(ends).T
    return StaticDraws(low, high, moved(drawn.steps.T[: best.size]), drawn.wild)


def _logarithmic(problem: Regression) -> NDArray[np.bool_]:
    return np.array([name.name == "v_s" for name in problem.names])


def _refitted(
    problem: Regression, solution: Solution, v_s_range: tuple[float, float], draws: int, seed: int
) -> tuple[Resampled, Array]:
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

    return residual_bootstrap(solution.jacobian, solution.residuals, problem.velocity, refit, draws, seed)


def _stepped(
    problem: Regression, solution: Solution, keep: NDArray[np.bool_], seed: int, covariance: Array | None
) -> tuple[Resampled, Array]:
    size = np.where(_logarithmic(problem), solution.theta, 1.0)[keep]
    J, left, measured = solution.jacobian[:, keep] * size, solution.residuals, problem.torque.size - problem.priors
    if problem.smooth is None or covariance is None:
        return residual_bootstrap(J, left, problem.velocity, seed=seed)
    sigma = float(np.sqrt(solution.cost / max(left.size - size.size, 1)))
    drawn = block_bootstrap(-J[:measured], left[:measured], priors=-J[measured:], sigma=sigma, seed=seed)
    return drawn, np.sqrt(np.diag(covariance)) / size
