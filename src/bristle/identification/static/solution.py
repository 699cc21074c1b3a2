"""A static problem solved: supported Stribeck terms, intervals, warnings."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import compress
from math import sqrt

import numpy as np

from bristle.arrays import Array
from bristle.data.experiment.schema import FitOptions
from bristle.estimation import covariance as uncertainty
from bristle.estimation import levels
from bristle.estimation.autocorrelation import correlated, inflation
from bristle.estimation.linear import best_column_p_value
from bristle.estimation.score_test import moved_by
from bristle.findings import CAUTION, NOTE, Finding, in_direction, unit_of
from bristle.identification.fits import Estimate, Profile
from bristle.identification.shared_findings import AT_BOUND, TAKES_UP_PEAK, curve_held
from bristle.identification.static.grid import Projected, Solution, default_range, descended, solve
from bristle.identification.static.problem import Regression
from bristle.identification.static.profiles import (
    StaticProfiles,
    drawn_profiles,
    over_shapes,
    own_columns,
    profiled,
    with_best_shape,
)
from bristle.identification.systematic import all_shifted
from bristle.model.laws.parts import FASTEST
from bristle.model.parameters import Direction, Kind, ParameterName, unit

_OPEN = Finding("interval-open", CAUTION, "No finite interval: the data allow it to the end of what is searched.")
_THERE = {"bend", "v-s-down-to-zero", "v-s-up-to-any", "none-below-v-s"}
"""Reasons to drop a term that is not noise."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StaticSolution:
    """A solved problem."""

    problem: Regression
    solution: Solution
    parameters: Mapping[ParameterName, Estimate]  # With statistical errors
    shifts: Mapping[str, Mapping[ParameterName, float]]  # Change of each parameter per standard error of each constant
    names: tuple[ParameterName, ...]
    covariance: Array
    freedom: float
    outcome: Finding
    warnings: tuple[Finding, ...]
    profiles: Mapping[Direction, Profile]
    dropped: Mapping[Direction, Finding]  # Directions without a Stribeck term, with the reason
    profiled: StaticProfiles
    student: Mapping[ParameterName, tuple[float, float]]  # 95 % intervals by Student's t
    beside: Mapping[ParameterName, Estimate]  # Shape parameters of the peak, and the fastest speed of laws with terms

    @property
    def estimates(self) -> dict[ParameterName, Estimate]:
        """The parameters with their systematic error, and intervals of both."""
        return {**all_shifted(self.parameters, self.shifts), **self.beside}


def other_fit(one: StaticSolution, other: StaticSolution) -> tuple[dict[str, float | None], float]:
    """The values of a fit of other points, and by how much its torque differs over the points of `one`, N*m, rms."""
    posed = replace(one.problem, peaks=other.problem.peaks)
    moved = posed.residuals(other.solution.theta) - one.problem.residuals(one.solution.theta)
    values = {one.problem.text(name): e.value for name, e in other.parameters.items()}
    return values, float(np.sqrt(np.mean(moved**2)))


def solve_static(
    problem: Regression, options: FitOptions, kind: Kind, v_s_range: tuple[float, float] | None = None
) -> StaticSolution:
    """Solve, drop the Stribeck terms that the data do not support, and give each parameter an interval and warnings."""
    v_s_range = v_s_range or default_range(problem.velocity)
    problem = with_best_shape(problem, v_s_range)
    problem, solution, likelihood, dropped = _settled(problem, options, v_s_range)
    variance_inflation = _inflation(problem, solution)
    free = np.array([name not in solution.at_bound for name in problem.names])
    jacobian = solution.jacobian
    profile, of_shape = over_shapes(problem, likelihood, v_s_range)
    more = own_columns(problem, solution)
    J = np.concatenate([jacobian[:, free], more], axis=1)
    with_more, freedom = uncertainty.covariance(J, solution.cost, variance_inflation)
    alone = free.sum() + more.shape[1] * (len(problem.directions) == 1)  # of two directions the shape is of neither
    covariance = with_more[:alone, :alone]
    full, _ = uncertainty.covariance(np.concatenate([jacobian, more], axis=1), solution.cost, variance_inflation)
    profiles = drawn_profiles(problem, solution, likelihood.threshold)
    beside = _beside(problem, of_shape, np.sqrt(np.diag(with_more)[free.sum() :]), solution, kind)
    doubted = {
        d for d, reason in dropped.items() if {reason.code, getattr(reason.numbers.get("why"), "code", None)} & _THERE
    }
    reach = uncertainty.student(freedom) * np.sqrt(np.diag(full)[: free.size])
    ends = np.maximum(solution.theta - reach, problem.least), solution.theta + reach
    student = {name: (low, high) for name, low, high in zip(problem.names, *(x.tolist() for x in ends), strict=True)}
    # interval by the profile, of moving data by Student's t; standard error by the exact Jacobian
    intervals = {**student, **profile}
    errors, parameters = np.full(len(problem.names), np.nan), dict[ParameterName, Estimate]()
    errors[free] = np.sqrt(np.diag(covariance)[: free.sum()])
    for name, value, error in zip(problem.names, solution.theta.tolist(), errors.tolist(), strict=True):
        (low, high), told = intervals[name], [AT_BOUND] if name in solution.at_bound else []
        if name.name in {"alpha_1", "v_s"} and not is_closed(intervals[name._replace(name="v_s")]):
            told.append(_OPEN)
            high = high if name.name == "v_s" else np.inf  # alpha_1 grows with v_s
        elif name.name in {"alpha_0", "alpha_2"} and name.direction in doubted:
            told.append(TAKES_UP_PEAK)  # a peak that is there but not bounded
        parameters[name] = Estimate(
            value=value, unit=unit(name.name, kind), standard_error=error if np.isfinite(error) else None,
            interval=(min(low, value), max(high, value)),  # of an exact fit rounding makes the profile
            warnings=tuple(told),
        )  # fmt: skip  # a list of values
    names = list(compress(problem.names, free))
    moved = {constant: moved_by(jacobian[:, free], change) for constant, change in problem.shifts.items()}
    warnings = list(dropped.values())
    if variance_inflation > levels.INFLATED:
        warnings.append(correlated(solution.residuals, sqrt(variance_inflation)))
    outcome = Finding("static-converged", NOTE, "Converged.")
    if dropped and not problem.peaks:
        message = "Stribeck term not identifiable from these data: Coulomb and viscous friction alone are fitted."
        outcome = Finding("static-no-stribeck", NOTE, message)
        if options.model == "coulomb-viscous":
            message = "Coulomb and viscous friction alone are fitted, as fit.law asks."
            outcome = Finding("static-as-asked", NOTE, message)
    return StaticSolution(
        problem=problem, solution=solution, parameters=parameters,
        shifts={constant: dict(zip(names, by.tolist(), strict=True)) for constant, by in moved.items()},
        names=(*names, *list(beside)[: alone - free.sum()]), covariance=covariance, freedom=freedom, outcome=outcome,
        warnings=tuple(warnings), profiles=profiles, dropped=dropped, profiled=likelihood,
        student=student, beside=beside,
    )  # fmt: skip  # a list of values


def _beside(
    problem: Regression, of_shape: Mapping[str, tuple[float, float]], errors: Array, solution: Solution, kind: Kind
) -> dict[ParameterName, Estimate]:
    """Parameters of the law beside the problem's, by direction."""
    beside = dict[ParameterName, Estimate]()
    for d in problem.directions:
        own = zip(of_shape.items(), problem.shape, errors.tolist(), strict=False) if d in problem.peaks else ()
        for (name, interval), value, error in own:
            told = () if is_closed(interval) else (_OPEN,)
            shown = Estimate(value=value, unit=unit(name, kind), standard_error=error, interval=interval, warnings=told)
            beside[ParameterName(name, d)] = shown
        if problem.law.terms:
            fastest, values = float(problem.speeds(d).max()), problem.named(solution.theta)
            held = min(values[ParameterName(name, d)] for name in problem.law.coefficients) < 0
            measured = Finding("fastest-measured", NOTE, "Not estimated: the fastest speed that was measured.")
            said = (measured, *((curve_held(fastest),) if held else ()))
            beside[ParameterName(FASTEST, d)] = Estimate(value=fastest, unit=unit(FASTEST, kind), warnings=said)
    return beside


def _settled(
    problem: Regression, options: FitOptions, v_s_range: tuple[float, float]
) -> tuple[Regression, Solution, StaticProfiles, dict[Direction, Finding]]:
    """The final problem with solution and profiles, and the directions that lose their Stribeck term, with reasons."""
    asked, points, least = options.model == "coulomb-viscous", problem.torque.size, len(problem.names) + 1
    dropped, solution, judged = dict[Direction, Finding](), None, options.model == "auto"
    if asked or points < least:
        message = f"{points} points are too few for a Stribeck term; at least {least} are needed."
        few = Finding("too-few-for-peak", NOTE, message, {"points": points, "least": least})
        not_asked = Finding("no-stribeck-asked", NOTE, "Not fitted: fit.law is coulomb-viscous.")
        dropped = dict.fromkeys(problem.peaks, not_asked if asked else few)
    else:
        solution = solve(problem, v_s_range)
        dropped = _without_peak(problem, partial(_unsupported, problem, solution)) if judged else {}
    while True:
        kept = replace(problem, peaks=tuple(d for d in problem.peaks if d not in dropped))
        if solution is None or dropped:
            solution = solve(kept, v_s_range)
        likelihood = profiled(kept, solution, _inflation(kept, solution))
        if likelihood.linear is not None and (better := likelihood.linear.better) is not None:
            found = descended(kept, np.exp(better).tolist(), v_s_range)
            solution = replace(found, base_costs=solution.base_costs, grid=solution.grid, profiles=solution.profiles)
            likelihood = profiled(kept, solution, _inflation(kept, solution))
        unbounded = _without_peak(kept, partial(_unbounded, kept, solution, likelihood)) if judged else {}
        if not unbounded:
            return kept, solution, likelihood, dropped
        dropped |= unbounded


def _without_peak(problem: Regression, why_not: Callable[[int, Direction], Finding | None]) -> dict[Direction, Finding]:
    """The directions without a Stribeck term, with the reasons that `why_not` gives."""
    found = dict[Direction, Finding]()
    for k, direction in enumerate(problem.peaks):
        why = why_not(k, direction)
        if why is not None:
            message = f"Stribeck term not identifiable{in_direction(direction)}: {why.message}; Coulomb and viscous friction alone are fitted."
            found[direction] = Finding("no-stribeck", NOTE, message, {"direction": direction, "why": why})
    return found


def _unbounded(
    problem: Regression, solution: Solution, likelihood: StaticProfiles, k: int, direction: Direction
) -> Finding | None:
    """Why v_s of a peak is not bounded within its range, or None."""
    low, high = likelihood.intervals[ParameterName("v_s", direction)]
    slowest, v_s = float(problem.speeds(direction).min()), float(problem.split(solution.theta)[1][k])
    if low == 0:
        return Finding("v-s-down-to-zero", NOTE, "these speeds set no lower limit on v_s (slower ones would)")
    if np.isinf(high):
        message = "these speeds set no upper limit on v_s (faster ones, or more of them, would)"
        return Finding("v-s-up-to-any", NOTE, message)
    message = (
        f"no speed lies below its v_s of {v_s:.3g}{unit_of('velocity')} (the slowest is {slowest:.3g}{unit_of('velocity')}; "
        "slower ones would decide)"
    )
    return Finding("none-below-v-s", NOTE, message, {"slowest": slowest, "v_s": v_s}) if slowest >= v_s else None


def _unsupported(problem: Regression, solution: Solution, k: int, direction: Direction) -> Finding | None:
    """Why the Stribeck term of a peak is noise or no peak, or None."""
    projected, noise = Projected(problem), 1e-20 * float(problem.torque @ problem.torque)
    off, length = projected.off(solution.grid, k)
    gain = max(solution.base_costs[k] - solution.cost, 0.0)
    unexplained = max(solution.cost, noise) or 1.0  # a torque of zero throughout has neither
    ratio = gain / unexplained / _inflation(problem, solution)
    p = best_column_p_value(off, length, projected.q, ratio) if gain > noise else 1.0
    speeds, v_s, seen = problem.speeds(direction), float(problem.split(solution.theta)[1][k]), problem.law.peak.reach
    fastest, of = float(speeds.max()), unit_of("velocity")
    if p > levels.SIGNIFICANCE:
        message = f"noise alone would look as much like a Stribeck peak in {100 * p:.0f} % of cases"
        return Finding("no-peak", NOTE, message, {"percent": 100 * p})
    if v_s * seen > fastest:
        message = (
            f"its v_s of {v_s:.3g}{of} would lie near the fastest speed, {fastest:.3g}{of}, so the term would bend the whole "
            f"curve instead of dropping at low speed (speeds beyond {seen:g} v_s would decide)"
        )
        return Finding("bend", NOTE, message, {"v_s": v_s, "fastest": fastest, "seen": seen})
    return None


def _inflation(problem: Regression, solution: Solution) -> float:
    """Variance inflation by correlated residuals; 1 for points."""
    return inflation(solution.residuals) if problem.smooth is not None else 1.0


def is_closed(interval: tuple[float, float]) -> bool:
    """Whether an interval of v_s is limited on both sides."""
    return interval[0] > 0 and bool(np.isfinite(interval[1]))
