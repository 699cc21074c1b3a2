"""What a user must be told about a fit: each doubt one sentence, so that none hides behind another."""

from collections.abc import Mapping, Sequence

import numpy as np

from bristle.arrays import Array
from bristle.estimation import covariance
from bristle.estimation.autocorrelation import lag_one
from bristle.identification.results import Estimate, Profile
from bristle.identification.static.grid import Solution
from bristle.identification.static.problem import Regression


def fit_doubts(
    problem: Regression,
    solution: Solution,
    jacobian: Array,
    intervals: Mapping[str, tuple[float, float]],
    profiles: Mapping[str, Profile],
    v_s_range: tuple[float, float],
    stretch: float,
) -> tuple[str, ...]:
    """Each doubt about a fit as a whole.

    Args:
        problem: as it was fitted.
        solution: its solution.
        jacobian: at the solution, of the free parameters, (n, p).
        intervals: of v_s, per peak.
        profiles: per peak.
        v_s_range: that was searched, rad/s.
        stretch: inflation of the variance by correlated residuals.
    """
    doubts = [
        f"{name} lies at its physical bound of zero; the free fit would make it negative." for name in solution.at_bound
    ]
    for direction, profile in profiles.items():
        doubts += _profile_doubts(direction, profile, intervals[direction], v_s_range)
        speed = np.abs(
            problem.velocity[problem.velocity * (-1 if direction == "-" else 1) > 0]
            if direction != "both"
            else problem.velocity
        )
        below = np.count_nonzero(speed < profile.best)
        if below < 3:
            doubts.append(
                f"Only {below} of {speed.size} points lie below v_s{in_direction(direction)}; measure slower to see the Stribeck region."
            )
    condition = covariance.condition(jacobian)
    if condition > 1e3:
        doubts.append(
            f"Ill conditioned: the scaled Jacobian's condition number is {condition:.2g}; some parameters move only together."
        )
    if stretch > 2:
        residuals = problem.residuals(solution.theta)
        doubts.append(
            f"Residuals are correlated (lag one {lag_one(residuals):.2f}): standard errors are widened by {np.sqrt(stretch):.1f} for it."
        )
    return tuple(doubts)


def _profile_doubts(
    direction: str, profile: Profile, interval: tuple[float, float], v_s_range: tuple[float, float]
) -> list[str]:
    where, doubts = in_direction(direction), []
    if interval[0] == 0 and np.isinf(interval[1]):
        doubts.append(f"v_s cannot be told from these speeds{where}: the profile is flat.")
    elif not is_closed(interval):
        side = "below" if interval[0] == 0 else "above"
        doubts.append(f"The profile of v_s is one-sided{where}: nothing limits v_s {side}.")
    if not v_s_range[0] * 1.001 < profile.best < v_s_range[1] / 1.001:
        doubts.append(
            f"The best v_s lies at the edge of the range searched{where}, {v_s_range[0]:.3g} to {v_s_range[1]:.3g}."
        )
    inner = np.r_[False, (profile.cost[1:-1] < profile.cost[:-2]) & (profile.cost[1:-1] < profile.cost[2:]), False]
    inner &= np.abs(np.log(profile.v_s / profile.best)) > 2 * np.log(profile.v_s[1] / profile.v_s[0])
    seconds = profile.v_s[inner & (profile.cost <= profile.threshold)]
    doubts += [f"A second minimum{where} at v_s = {s:.3g} is within the 95 % threshold." for s in seconds]
    return doubts


def huber_doubts(
    parameters: Mapping[str, Estimate],
    robust: Mapping[str, float],
    errors: Mapping[str, float],
    weight: Array,
    names: Sequence[str],
) -> list[str]:
    """Where least squares and Huber part by more than two combined standard errors, and the points responsible.

    Args:
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
                moved.append(f"{name} ({distance:.1f})")
    if not moved:
        return []
    responsible = [names[k] for k in np.argsort(weight)[:5] if weight[k] < 0.7] if names else []
    by = f" Points responsible: {'; '.join(responsible)}." if responsible else ""
    return [
        f"Least squares and the Huber refit differ by more than two combined standard errors in {', '.join(moved)}.{by}"
    ]


def in_direction(direction: str) -> str:
    """What names a direction inside a sentence; nothing where both directions are one."""
    return "" if direction == "both" else f" in direction {direction}"


def is_closed(interval: tuple[float, float]) -> bool:
    """Whether an interval of v_s is limited on both sides."""
    return interval[0] > 0 and bool(np.isfinite(interval[1]))
