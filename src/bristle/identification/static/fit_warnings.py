"""What is said of a solved static problem as a whole: bounds, open profiles, second minima, conditioning, correlation."""

from collections.abc import Mapping
from math import sqrt

import numpy as np

from bristle.arrays import Array
from bristle.estimation import covariance as uncertainty
from bristle.estimation.autocorrelation import correlated
from bristle.findings import CAUTION, CRITICAL, Finding, in_direction, unit_of
from bristle.identification.fits import Profile
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
    warnings = []
    for name in map(problem.text, solution.at_bound):
        message = f"{name} lies at its physical bound of zero; an unconstrained fit would make it negative."
        warnings.append(Finding("bound", CAUTION, message, {"name": name}))
    low, high = v_s_range
    for direction, profile in profiles.items():
        interval, where = intervals[direction], in_direction(direction)
        if interval[0] == 0 and np.isinf(interval[1]):
            message = f"v_s is not identifiable from these speeds{where}: its profile is flat."
            warnings.append(Finding("flat-profile", CRITICAL, message, {"direction": direction}))
        elif not is_closed(interval):
            side = "below" if interval[0] == 0 else "above"
            message = f"The interval of v_s is one-sided{where}: the data do not bound v_s from {side}."
            warnings.append(Finding("one-sided-profile", CAUTION, message, {"direction": direction, "side": side}))
        if not low * 1.001 < profile.best < high / 1.001:
            message = (
                f"The best v_s lies at the edge of the range searched{where}, {low:.3g}{unit_of('velocity')} to "
                f"{high:.3g}{unit_of('velocity')}."
            )
            warnings.append(Finding("at-edge", CRITICAL, message, {"direction": direction, "low": low, "high": high}))
        inner = np.r_[False, (profile.cost[1:-1] < profile.cost[:-2]) & (profile.cost[1:-1] < profile.cost[2:]), False]
        inner &= np.abs(np.log(profile.v_s / profile.best)) > 2 * np.log(profile.v_s[1] / profile.v_s[0])
        for v_s in profile.v_s[inner & (profile.cost <= profile.threshold)].tolist():
            message = f"The cost has a second minimum{where} at v_s = {v_s:.3g}, below the 95 % threshold."
            warnings.append(Finding("second-minimum", CAUTION, message, {"direction": direction, "v_s": v_s}))
        speeds = np.abs(problem.velocity) if direction == "both" else speeds_of(problem, direction)
        below, points = int(np.count_nonzero(speeds < profile.best)), speeds.size
        if below < 3:
            message = (
                f"Only {below} of {points} points lie below v_s{in_direction(direction)}; measure slower speeds to identify the "
                "Stribeck term."
            )
            numbers = {"below": below, "points": points, "direction": direction}
            warnings.append(Finding("few-below-v-s", CAUTION, message, numbers))
    condition = uncertainty.condition(jacobian)
    if condition > 1e3:
        message = (
            f"Ill conditioned: the scaled Jacobian's condition number is {condition:.2g}; some parameters are "
            "strongly correlated."
        )
        warnings.append(Finding("ill-conditioned", CAUTION, message, {"condition": condition}))
    if variance_inflation > 2:
        residuals = problem.residuals(solution.theta)
        warnings.append(correlated(residuals, sqrt(variance_inflation)))
    return tuple(warnings)


def is_closed(interval: tuple[float, float]) -> bool:
    """Whether an interval of v_s is limited on both sides."""
    return interval[0] > 0 and bool(np.isfinite(interval[1]))


def speeds_of(problem: Regression, direction: str) -> Array:
    """The speeds of a direction that are not zero, rad/s."""
    moving = {"+": problem.velocity > 0, "-": problem.velocity < 0}.get(direction, problem.velocity != 0)
    speeds: Array = np.abs(problem.velocity[moving])
    return speeds
