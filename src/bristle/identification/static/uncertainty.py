"""The 95 % intervals of a static fit three ways: covariance, profile, bootstrap; and where they part."""

import numpy as np

from bristle.arrays import Array
from bristle.diagnostics import Kind
from bristle.estimation import interval_comparison
from bristle.estimation.bootstrap import FEW, SHOWN
from bristle.identification.results import Uncertainty
from bristle.identification.static import bootstrap
from bristle.identification.static.profiles import others
from bristle.identification.static.projection import Projected
from bristle.identification.static.stribeck_test import StaticSolution
from bristle.model.parameters import ParameterName

_FEW = 8
"""Points beyond the parameters, below which they are few."""
_DRAWN, _BEYOND = 61, 0.6
"""Values of v_s at which its profile is drawn, and how far beyond its interval, in shares of its logarithmic width."""


def three_ways(
    solved: StaticSolution, v_s_range: tuple[float, float], seed: int = bootstrap.SEED
) -> dict[ParameterName, Uncertainty]:
    """The intervals of every parameter of a solved and judged problem, by the problem's names.

    Args:
        solved: the problem with its solution, covariance and profiles.
        v_s_range: as it was solved with.
        seed: of the bootstrap.
    """
    n, names = solved.problem.torque.size, solved.problem.names
    spare = n - len(names)
    few = Kind.POINTS_FOR_PARAMETERS(points=n, parameters=len(names)) if spare < _FEW else None
    out, drawn = (
        {},
        bootstrap.resample(solved.problem, solved.solution, v_s_range, seed=seed, covariance=solved.covariance),
    )
    for name, value, low, high, draws in zip(names, solved.solution.theta.tolist(), *drawn[:3], strict=True):
        at_bound, resampled = name in solved.solution.at_bound, None if np.isnan(low) else (float(low), float(high))
        covariance, profile = solved.student[name], solved.profiled.intervals[name]
        warnings = interval_comparison.warnings(value, covariance, profile, resampled, at_bound=at_bound, few=few)
        if at_bound:
            warnings = (Kind.INTERVALS_AT_BOUND(),)
        elif resampled is None:
            warnings = (*warnings, Kind.NO_BLOCKS(least=FEW))
        out[name] = Uncertainty(
            covariance=(0.0, covariance[1]) if at_bound else covariance,
            profile=profile,
            bootstrap=resampled,
            curve=_curve(solved, name, value),
            draws=draws[np.isfinite(draws)][:SHOWN],
            warnings=warnings,
        )
    return out


def _curve(solved: StaticSolution, name: ParameterName, value: float) -> Array:
    """The profile of a parameter, as in `Uncertainty`."""
    problem, (low, high) = solved.profiled.problem, solved.profiled.intervals[name]
    reach = solved.student[name][1] - value
    open_ = not np.isfinite(high)
    high = value + 3 * reach if open_ else high
    if not np.isfinite([low, high]).all():  # nothing bounds it on a side that could be drawn
        return np.zeros((2, 0))
    if name.name != "v_s":
        curve = solved.profiled.curve(name, value, low, high)
        # open alpha_1 goes on as v_s does, but it is drawn within the range searched
        return curve[:, (curve[0] <= value) | (curve[1] <= 1)] if open_ else curve
    grid = solved.solution.grid
    low = low if low > 0 else max(float(grid[0]), value - 3 * reach)
    values = np.geomspace(max(low * (low / value) ** _BEYOND, grid[0]), high * (high / value) ** _BEYOND, _DRAWN)
    values = np.unique(np.append(values, value))
    peak = [n for n in problem.names if n.name == "v_s"].index(name)
    cost = Projected(problem).profile(values, peak, others(solved.solution, len(problem.peaks), peak))
    room = max(solved.profiled.threshold - solved.solution.cost, 1e-300)
    return np.stack([values, np.maximum(cost - solved.solution.cost, 0.0) / room])
