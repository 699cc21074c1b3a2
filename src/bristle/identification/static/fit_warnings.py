"""What is said of a solved static problem as a whole: bounds, open profiles, second minima, conditioning, correlation."""

from collections.abc import Mapping

import numpy as np

from bristle.arrays import Array
from bristle.estimation import covariance as uncertainty
from bristle.estimation.autocorrelation import lag_one
from bristle.findings import Finding
from bristle.identification.fits import Profile
from bristle.identification.messages import Kind
from bristle.identification.static.grid import Solution
from bristle.identification.static.problem import Regression
from bristle.model.parameters import Direction


def fit_warnings(
    problem: Regression,
    solution: Solution,
    jacobian: Array,
    intervals: Mapping[Direction, tuple[float, float]],
    profiles: Mapping[Direction, Profile],
    v_s_range: tuple[float, float],
    variance_inflation: float,
) -> tuple[Finding, ...]:
    """Each warning about a fit as a whole; `jacobian` is of the free parameters, (n, p), `intervals` are of v_s."""
    warnings = [Kind.BOUND(name=problem.text(name)) for name in solution.at_bound]
    for direction, profile in profiles.items():
        warnings += _profile_warnings(direction, profile, intervals[direction], v_s_range)
        speeds = np.abs(problem.velocity) if direction == "both" else speeds_of(problem, direction)
        below = np.count_nonzero(speeds < profile.best)
        if below < 3:
            warnings.append(Kind.FEW_BELOW_V_S(below=below, points=speeds.size, direction=direction))
    condition = uncertainty.condition(jacobian)
    if condition > 1e3:
        warnings.append(Kind.ILL_CONDITIONED(condition=condition))
    if variance_inflation > 2:
        residuals = problem.residuals(solution.theta)
        warnings.append(Kind.CORRELATED(lag_one=lag_one(residuals), widened=np.sqrt(variance_inflation)))
    return tuple(warnings)


def _profile_warnings(
    direction: str, profile: Profile, interval: tuple[float, float], v_s_range: tuple[float, float]
) -> list[Finding]:
    warnings = []
    if interval[0] == 0 and np.isinf(interval[1]):
        warnings.append(Kind.FLAT_PROFILE(direction=direction))
    elif not is_closed(interval):
        side = "below" if interval[0] == 0 else "above"
        warnings.append(Kind.ONE_SIDED_PROFILE(direction=direction, side=side))
    if not v_s_range[0] * 1.001 < profile.best < v_s_range[1] / 1.001:
        warnings.append(Kind.AT_EDGE(direction=direction, low=v_s_range[0], high=v_s_range[1]))
    inner = np.r_[False, (profile.cost[1:-1] < profile.cost[:-2]) & (profile.cost[1:-1] < profile.cost[2:]), False]
    inner &= np.abs(np.log(profile.v_s / profile.best)) > 2 * np.log(profile.v_s[1] / profile.v_s[0])
    seconds = profile.v_s[inner & (profile.cost <= profile.threshold)]
    warnings += [Kind.SECOND_MINIMUM(direction=direction, v_s=s) for s in seconds]
    return warnings


def is_closed(interval: tuple[float, float]) -> bool:
    """Whether an interval of v_s is limited on both sides."""
    return interval[0] > 0 and bool(np.isfinite(interval[1]))


def speeds_of(problem: Regression, direction: str) -> Array:
    """The speeds of a direction that are not zero, rad/s."""
    moving = {"+": problem.velocity > 0, "-": problem.velocity < 0}.get(direction, problem.velocity != 0)
    speeds: Array = np.abs(problem.velocity[moving])
    return speeds
