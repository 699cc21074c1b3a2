"""Intervals of a static fit by covariance, profile and bootstrap; v_s as its logarithm."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from bristle.arrays import Array
from bristle.estimation import bootstrap, interval_comparison, levels
from bristle.identification.fits import Uncertainty
from bristle.identification.static.batch import Batch
from bristle.identification.static.grid import Projected, Solution
from bristle.identification.static.problem import Regression
from bristle.identification.static.profiles import others, own_columns
from bristle.identification.static.solution import StaticSolution
from bristle.model.parameters import ParameterName

SEED = 0  # of the bootstrap
MANY = 2_000  # points from which one step replaces a refit, because errors are small
_DRAWN, _BEYOND = 61, 0.6  # values of v_s on a drawn profile, and its range beyond the interval, in widths


def three_ways(solved: StaticSolution, v_s_range: tuple[float, float]) -> dict[ParameterName, Uncertainty]:
    """Intervals of every parameter, by name."""
    n, names = solved.problem.torque.size, solved.problem.names
    drawn = resample(solved.problem, solved.solution, v_s_range)
    few = f"{n} points for {len(names)} parameters" if n - len(names) < levels.FEW else None
    out = {}
    for name, value, low, high, draws in zip(names, solved.solution.theta.tolist(), *drawn, strict=True):
        at_bound, resampled = name in solved.solution.at_bound, None if np.isnan(low) else (float(low), float(high))
        covariance, profile = solved.student[name], solved.profiled.intervals[name]
        warnings = interval_comparison.warnings(value, covariance, profile, resampled, at_bound=at_bound, few=few)
        out[name] = Uncertainty(
            covariance=(0.0, covariance[1]) if at_bound else covariance, profile=profile, bootstrap=resampled,
            curve=_curve(solved, name, value), draws=draws[np.isfinite(draws)][:bootstrap.SHOWN], warnings=warnings,
        )  # fmt: skip  # a list of values
    return out


def _curve(solved: StaticSolution, name: ParameterName, value: float) -> Array:
    """The profile of a parameter, as in `Uncertainty`."""
    problem, (low, high) = solved.profiled.problem, solved.profiled.intervals[name]
    reach = solved.student[name][1] - value
    open_ = not np.isfinite(high)
    high = value + 3 * reach if open_ else high
    if not np.isfinite([low, high]).all():  # unbounded on a side
        return np.zeros((2, 0))
    if name.name != "v_s":
        curve = solved.profiled.curve(name, value, low, high)
        # open alpha_1 is drawn within the range searched
        return curve[:, (curve[0] <= value) | (curve[1] <= 1)] if open_ else curve
    grid = solved.solution.grid
    low = low if low > 0 else max(float(grid[0]), value - 3 * reach)
    values = np.geomspace(max(low * (low / value) ** _BEYOND, grid[0]), high * (high / value) ** _BEYOND, _DRAWN)
    values = np.unique(np.append(values, value))
    peak = [n for n in problem.names if n.name == "v_s"].index(name)
    cost = Projected(problem).profile(values, peak, others(solved.solution, len(problem.peaks), peak))
    room = max(solved.profiled.threshold - solved.solution.cost, 1e-300)
    return np.stack([values, np.maximum(cost - solved.solution.cost, 0.0) / room])


class StaticDraws(NamedTuple):
    """Bootstrap of p parameters, in their units."""

    low: Array  # Lower ends, (p,); -inf, or 0 if positive, where draws do not show the parameter; nan: no interval
    high: Array
    draws: Array  # (p, b)


def resample(
    problem: Regression,
    solution: Solution,
    v_s_range: tuple[float, float],
    draws: int = bootstrap.REFITS,
    seed: int = SEED,
) -> StaticDraws:
    """Bootstrap intervals of points in the order of `names`: few are refitted, others go a Gauss-Newton step."""
    keep, alone = np.ones(len(problem.names), dtype=bool), len(problem.peaks) < 2 and not problem.shape
    center, as_logarithm = solution.theta[:, None], problem.logarithmic[:, None]
    if not (alone and problem.torque.size <= MANY):
        keep = np.array([name not in solution.at_bound for name in problem.names])
    if not keep.any():
        nothing = np.full(keep.size, np.nan)
        return StaticDraws(nothing, nothing, np.full((keep.size, draws), np.nan))

    def refit(residuals: Array, uneven: bool) -> tuple[Array, Array]:
        """Distances of the estimates, and their errors."""
        torques = (problem.torque - solution.residuals)[:, None] + residuals
        if not problem.peaks:
            theta, errors = bootstrap.linear_refit(problem.linear, torques, uneven)
            return theta - center, errors
        batch = Batch(problem, torques, v_s_range)
        with np.errstate(divide="ignore", invalid="ignore"):
            steps = np.where(as_logarithm, np.log(batch.theta / center), batch.theta - center)
        size = np.where(as_logarithm, np.column_stack([center, batch.theta[:, 1:]]), 1.0)
        return steps, batch.errors(robust=uneven) / size

    if alone and problem.torque.size <= MANY:
        J, left = solution.jacobian, solution.residuals
        drawn, errors = bootstrap.residual_bootstrap(J, left, problem.velocity, refit, draws, seed)
    else:
        J = (solution.jacobian * np.where(problem.logarithmic, solution.theta, 1.0))[:, keep]
        J = np.concatenate([J, own_columns(problem, solution)], axis=1)
        drawn, errors = bootstrap.residual_bootstrap(J, solution.residuals, problem.velocity, seed=seed)
        errors = errors[: keep.sum()]  # shape parameters come after them
    ends = np.array([drawn.interval(k, error) for k, error in enumerate(errors.tolist())]).reshape(-1, 2)
    best, logarithmic, floor = (each[keep, None] for each in (solution.theta, problem.logarithmic, problem.least))

    def moved(steps: Array) -> Array:
        """All parameters moved by steps, (p, k); nan if not stepped."""
        out = np.full((keep.size, steps.shape[1]), np.nan)
        with np.errstate(over="ignore", invalid="ignore"):
            off = np.where(logarithmic, best * np.exp(steps), best + steps)
        out[keep] = np.maximum(off, floor)
        return out

    low, high = moved(ends).T
    return StaticDraws(low, high, moved(drawn.steps.T[: best.size]))


def parts_of_runs(
    core: StaticSolution, runs: Sequence[tuple[str, Regression]]
) -> tuple[list[ParameterName], dict[str, tuple[Array, Array]]]:
    """Parameters at no bound or prior, and each run's Jacobian by these (of log(v_s)), (n, p), and residuals, (n,)."""
    posed = {file: replace(one, peaks=core.problem.peaks) for file, one in runs}
    names, theta = core.problem.names, core.solution.theta
    free = [k for k, name in enumerate(names) if name not in core.solution.at_bound]
    slope = np.where(core.problem.logarithmic, theta, 1.0)
    parts = {file: ((one.jacobian(theta) * slope)[:, free], one.residuals(theta)) for file, one in posed.items()}
    return [names[k] for k in free], parts
