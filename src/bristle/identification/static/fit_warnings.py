"""What a user must be told about a static fit, each thing singly, so that none hides behind another."""

from collections.abc import Mapping, Sequence

import numpy as np

from bristle.arrays import Array
from bristle.diagnostics import Diagnostic, Kind
from bristle.estimation import covariance
from bristle.estimation.autocorrelation import lag_one
from bristle.identification.results import Estimate, Profile
from bristle.identification.static.grid import Solution
from bristle.identification.static.problem import Regression
from bristle.model.parameters import Direction, ParameterName


def fit_warnings(
    problem: Regression,
    solution: Solution,
    jacobian: Array,
    intervals: Mapping[Direction, tuple[float, float]],
    profiles: Mapping[Direction, Profile],
    v_s_range: tuple[float, float],
    variance_inflation: float,
) -> tuple[Diagnostic, ...]:
    """Each warning about a fit as a whole.

    Args:
        problem: as it was fitted.
        solution: its solution.
        jacobian: at the solution, of the free parameters, (n, p).
        intervals: of v_s, per peak.
        profiles: per peak.
        v_s_range: that was searched, rad/s.
        variance_inflation: inflation of the variance by correlated residuals.
    """
    warnings = [Kind.BOUND(name=problem.text(name)) for name in solution.at_bound]
    for direction, profile in profiles.items():
        warnings += _profile_warnings(direction, profile, intervals[direction], v_s_range)
        speed = np.abs(
            problem.velocity[problem.velocity * (-1 if direction == "-" else 1) > 0]
            if direction != "both"
            else problem.velocity
        )
        below = np.count_nonzero(speed < profile.best)
        if below < 3:
            warnings.append(Kind.FEW_BELOW_V_S(below=below, points=speed.size, direction=direction))
    condition = covariance.condition(jacobian)
    if condition > 1e3:
        warnings.append(Kind.ILL_CONDITIONED(condition=condition))
    if variance_inflation > 2:
        residuals = problem.residuals(solution.theta)
        warnings.append(Kind.CORRELATED(lag_one=lag_one(residuals), widened=np.sqrt(variance_inflation)))
    return tuple(warnings)


def _profile_warnings(
    direction: str, profile: Profile, interval: tuple[float, float], v_s_range: tuple[float, float]
) -> list[Diagnostic]:
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


def huber_warnings(
    problem: Regression,
    parameters: Mapping[ParameterName, Estimate],
    robust: Mapping[ParameterName, float],
    errors: Mapping[ParameterName, float],
    weight: Array,
    names: Sequence[str],
) -> list[Diagnostic]:
    """Where least squares and Huber part by more than two combined standard errors, and the points responsible.

    Args:
        problem: as it was fitted.
        parameters: of least squares.
        robust: of the Huber refit.
        errors: its standard errors.
        weight: each point's Huber weight, (n,).
        names: what a user calls each point, (n,), or empty.
    """
    moved = []
    for name, estimate in parameters.items():
        if estimate.standard_error and estimate.value is not None:
            distance = abs(robust[name] - estimate.value) / np.hypot(estimate.standard_error, errors[name])
            if distance > 2:
                moved.append((problem.text(name), float(distance)))
    if not moved:
        return []
    responsible = [names[k] for k in np.argsort(weight)[:5] if weight[k] < 0.7] if names else []
    by = Kind.RESPONSIBLE(points=tuple(responsible)) if responsible else ""
    return [Kind.HUBER_DIFFERS(moved=tuple(moved), points=by)]


def is_closed(interval: tuple[float, float]) -> bool:
    """Whether an interval of v_s is limited on both sides."""
    return interval[0] > 0 and bool(np.isfinite(interval[1]))
