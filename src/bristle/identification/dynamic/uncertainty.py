"""Intervals of moving fits by covariance, profile and bootstrap, moved by the encoder bias; and errors of constants."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from bristle.arrays import Array
from bristle.estimation import interval_comparison, levels
from bristle.estimation.bootstrap import SHOWN, bootstrap_at
from bristle.estimation.covariance import seen
from bristle.estimation.profile_likelihood import Profiled, profiles
from bristle.estimation.score_test import moved_by
from bristle.findings import CRITICAL, NOTE, Finding
from bristle.identification.dynamic.claims import jacobian_and_residuals
from bristle.identification.dynamic.fit import DynamicSolution
from bristle.identification.dynamic.problem import Unknown, Values
from bristle.identification.fits import Estimate, TrackingFit, Uncertainty
from bristle.model.parameters import ParameterName
from bristle.progress import Progress

_RESTARTS = 3

Refit = Callable[[Values], DynamicSolution]  # fits again from all unknowns


def profile_until_stable(
    solved: DynamicSolution, refit: Refit, progress: Progress | None = None
) -> tuple[DynamicSolution, Mapping[Unknown, Profiled]]:
    """The profile of each parameter, and the fit, repeated where a profile found a lower cost."""
    warnings: tuple[Finding, ...] = ()
    for refits in range(_RESTARTS + 1):
        found, better = profiles(solved.solution, progress, stop_at_better=refits < _RESTARTS)
        if better is None:
            break
        end = solved.solution.posed.unknowns.values(better)
        message = "A profile found a lower cost than the fit; the fit was repeated from there."
        solved, warnings = refit({**solved.problem.fixed, **end}), (Finding("refitted", NOTE, message),)
    if refits == _RESTARTS:
        message = f"Profiles still find lower costs after {_RESTARTS} new fits: do not use this fit."
        warnings = (*warnings, Finding("still-lower", CRITICAL, message, {"fits": _RESTARTS}))
    return solved._replace(fit=replace(solved.fit, warnings=(*solved.fit.warnings, *warnings))), found


def with_three_ways(solved: DynamicSolution, fit: TrackingFit, profiles: Mapping[Unknown, Profiled]) -> TrackingFit:
    """The fit, encoder bias subtracted, with intervals three ways."""
    (drawn, blocks), three, parameters = bootstrap_at(solved.solution), {}, dict(fit.parameters)
    not_fitted = Finding("not-fitted", NOTE, "It was not fitted: there is nothing to profile or to resample.")
    for name, e in fit.parameters.items():
        unseen = e.value is None and e.interval is None
        if name in profiles and not unseen:
            three[name] = _three(solved, name, e, profiles[name], drawn.get(name), blocks)
        else:
            told = e.warnings if unseen else (*e.warnings, not_fitted)
            three[name] = Uncertainty(covariance=None, profile=None, bootstrap=None, warnings=told)
        if e.value is not None:
            new = (warning for warning in three[name].warnings if warning not in e.warnings)
            parameters[name] = replace(e, warnings=(*e.warnings, *new))
    return replace(fit, parameters=parameters, uncertainty=three)


def _three(
    solved: DynamicSolution,
    name: ParameterName,
    e: Estimate,
    profile: Profiled,
    drawn: tuple[Array, Array] | None,
    blocks: int,
) -> Uncertainty:
    """One parameter's intervals; `drawn` are ends and draws of the bootstrap."""
    # the bias of counts is subtracted, distances spread with the error; open ends stay
    value, error = solved.values[name], solved.fit.parameters[name].standard_error
    limits = float(solved.solution.posed.unknowns.least[solved.problem.names.index(name)]), np.inf
    new, wider = value if e.value is None else e.value, e.standard_error / error if e.standard_error and error else 1.0

    def moved(x: Array) -> Array:
        inside = np.where(np.isfinite(x), x, value)
        return np.where(np.isin(x, limits), x, np.clip(new + (inside - value) * wider, *limits))

    low, high = moved(np.array(profile.interval)).tolist()
    ends = None if drawn is None or blocks < levels.FEW else moved(drawn[0]).tolist()
    bootstrap = None if ends is None else (ends[0], ends[1])
    few, warnings = f"{blocks} blocks of independent residuals" if blocks < levels.ENOUGH else None, profile.warnings
    if e.value is not None:
        ways = (e.interval, (low, high), bootstrap)
        warnings = (*warnings, *interval_comparison.warnings(e.value, *ways, at_bound=value == 0, few=few))
    return Uncertainty(
        covariance=e.interval if profile.curve.size else None, profile=(low, high), bootstrap=bootstrap,
        curve=np.stack([moved(profile.curve[0]), profile.curve[1]]),
        draws=np.zeros(0) if drawn is None else moved(drawn[1][:SHOWN]), warnings=warnings,
    )  # fmt: skip  # a list of values


def parts_of_runs(solved: DynamicSolution) -> tuple[list[Unknown], dict[str, tuple[Array, Array]]]:
    """Unknowns with an influence, and each run's model Jacobian (logarithms as such), (n, p), and residuals, (n,)."""
    J, left, private = jacobian_and_residuals(solved.problem, solved.solution)
    free, unknowns = np.flatnonzero(np.isfinite(solved.solution.scaled_errors)), solved.solution.posed.unknowns
    J, left = -J / np.where(unknowns.logarithmic, 1.0, unknowns.scale)[free], private.off(left)
    name, first = np.unique(solved.problem.file, return_index=True)  # motions of a run follow one another
    order = np.argsort(first)
    edges = first[order][1:]
    parts = dict(zip(name[order].tolist(), zip(np.split(J, edges), np.split(left, edges), strict=True), strict=True))
    return [solved.solution.names[k] for k in free], parts


def shifts_of(solved: DynamicSolution) -> dict[str, Mapping[ParameterName, float]]:
    """Change of each free parameter, -(J'J)**-1 J' dr, per standard error of each constant, by constant."""
    problem, posed, minimum = solved.problem, solved.solution.posed, solved.solution.minimum
    held = [*(m.shifts for m in problem.motions), *(prior.shifts for prior in problem.priors)]
    constants = dict.fromkeys(constant for by in held for constant in by)
    x, unknowns = minimum.x, posed.unknowns
    if not constants or not posed.shared:  # nothing is uncertain, or every parameter is given
        return {constant: {} for constant in constants}
    inside = (x > unknowns.lower) & (x < unknowns.upper)
    chosen = np.flatnonzero(seen(minimum.jacobian) & inside[: posed.shared])
    J, slopes = minimum.jacobian[:, chosen], unknowns.slopes(x)[chosen]
    shifts = dict[str, Mapping[ParameterName, float]]()
    for constant in constants:
        change = np.concatenate([m.weighted(m.shifts.get(constant, np.zeros(m.time.size))) for m in problem.motions])
        of_priors = ((x.root, x.shifts.get(constant, np.zeros(x.value.size))) for x in problem.priors)
        rows = [change, *(-problem.sigma * (root @ shift) for root, shift in of_priors)]
        moves = (-moved_by(J, np.concatenate(rows)) * slopes).tolist()
        names = (unknowns.names[k] for k in chosen.tolist())
        shifts[constant] = {n: by for n, by in zip(names, moves, strict=True) if isinstance(n, ParameterName)}
    return shifts
