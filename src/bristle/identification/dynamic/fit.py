"""The fit of moving data.

Starts, intervals that know of correlated residuals, what the data do not see, hold-out runs.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.special import fdtrc

from bristle.errors import InputError
from bristle.estimation.autocorrelation import unexplained
from bristle.estimation.covariance import condition
from bristle.estimation.levels import SIGNIFICANCE
from bristle.estimation.multistart import MultistartSolution
from bristle.findings import CAUTION, CRITICAL, NOTE, Finding
from bristle.identification.dynamic.claims import WIDE, loads_alike, peak_doubts
from bristle.identification.dynamic.descent import (
    FEWEST,
    equations_left,
    fit,
    solve_dynamic,
    with_deflections,
    without_deflections,
)
from bristle.identification.dynamic.estimates import (
    estimates_of,
    hardly_seen_findings,
    physics,
    search_findings,
    seen_parameters,
    wide,
)
from bristle.identification.dynamic.problem import DynamicProblem, Unknown, Values, friction_and_load, residuals
from bristle.identification.dynamic.what_is_left import what_is_left
from bristle.identification.fits import HoldOut, TrackingFit
from bristle.identification.shared_findings import not_shown, offset_or_friction
from bristle.model.parameters import Kind, ParameterName
from bristle.progress import Progress

_EDGE = 0.01  # in log(v_s): this near to the end of its range is at it
_TRIES = 30  # steps that the start of a held-out window is given
_BENT = 4.0  # times as large, beyond which the squares that are left without a term show one that bends the whole curve
_UNEVEN = 1.5  # runs whose residuals differ by less than this factor count alike


class DynamicSolution(NamedTuple):
    """A fit, the problem as it was solved, with what is not shown fixed, every free value, and the minimum."""

    fit: TrackingFit
    problem: DynamicProblem
    values: Values
    solution: MultistartSolution[Unknown]


def fit_tracking(
    problem: DynamicProblem,
    start: Values,
    kind: Kind,
    held: Sequence[tuple[str, DynamicProblem]] = (),
    others: Sequence[Values] = (),
    progress: Progress | None = None,
    *,
    search: bool = True,
) -> DynamicSolution:
    """All parameters of moving data with intervals and warnings.

    `start` has LuGre parameters and extra regressors by name; `others` are starts before it, whole, as other fits ended, and with
    `search` more are looked for, of which `progress` is told. `held` are hold-out runs by name, posed as the problem is; `kind` is the
    joint's, for units.

    Raises InputError where a start shows no dependence on any parameter.
    """
    problem, solution, dropped, shown = _settled(problem, start, others, progress, search=search)
    held = [(file, replace(p, fixed=problem.fixed)) for file, p in held]
    left = what_is_left(problem, solution, kind)
    estimates = estimates_of(problem, solution, kind, dropped, shown, left)
    unseen = {name: e for name, e in estimates.items() if e.value is None}
    order = (*problem.friction_names, *problem.extra_names)
    free = tuple(n for n in solution.names if n in estimates)
    rows = equations_left(problem, solution)
    friction, load = friction_and_load(problem, solution.values)
    torque = problem.quantity == "torque"  # of a simulated position, which drifts, nothing is said
    outcome = Finding("converged", NOTE, "The fit converged.")
    if not solution.minimum.converged:
        outcome = Finding("not-converged", CRITICAL, "The fit did not converge; it gives no estimates.")
    elif bound := tuple(n for n, e in estimates.items() if any(d.code == "at-bound" for d in e.warnings)):
        message = f"The fit converged, with {', '.join(map(str, bound))} at a bound."
        outcome = Finding("converged-at-bound", CAUTION, message, {"names": bound})
    warnings = (
        *(unexplained(rows, problem.extent) if torque else ()),
        *search_findings(problem, solution, estimates, rows),
        *left.findings,
        *(offset_or_friction(solution.names, solution.values, solution.covariance, solution.freedom) if torque else ()),
        *loads_alike(problem, solution),
        *hardly_seen_findings(solution, unseen),
        *physics(problem, solution.values, unseen),
        *not_shown(unseen),
    )
    if any(w.code == "unseen-bend" for e in unseen.values() for w in e.warnings):
        message = (
            "No Stribeck peak is seen at these speeds. Were v_s above them, alpha_0 would contain alpha_1; the friction at these speeds "
            "stays what it is."
        )
        warnings = (*warnings, Finding("only-sum-seen-of-fit", NOTE, message))
    result = TrackingFit(
        law=problem.law,
        parameters={n: estimates[n] for n in order if n in estimates},
        rms=float(np.sqrt(np.mean(rows**2))),
        relative_error=problem.percent(rows),
        n=rows.size,
        outcome=outcome,
        starts=solution.starts,
        reached=solution.reached,
        condition=condition(solution.minimum.jacobian[:, seen_parameters(solution)]),
        warnings=warnings,
        hold_out=tuple(HoldOut(file=file, relative_error=relative_error(p, solution.values)) for file, p in held),
        names=free,
        covariance=solution.covariance[: len(free), : len(free)],
        fixed={**problem.fixed, **{name: solution.values[name] for name in unseen if name in solution.values}},
        time=problem.time,
        velocity=problem.velocity,
        measured=problem.measured,
        quantity=problem.quantity,
        residuals=rows,
        friction=friction + rows if friction.size else friction,
        load=load,
        starts_of_runs=problem.starts,
        late=left.late,
        windows=len(problem.motions) if problem.quantity == "position" else 0,
    )
    return DynamicSolution(result, problem, solution.values, solution)


def _settled(
    problem: DynamicProblem, start: Values, others: Sequence[Values], progress: Progress | None, *, search: bool
) -> tuple[DynamicProblem, MultistartSolution[Unknown], dict[ParameterName, Finding], dict[ParameterName, str]]:
    """The problem with the weights that its runs ask for, its solution, why Stribeck terms are not in it, and what spoke against those shown."""
    if problem.size < FEWEST * len(problem.names):  # of which nothing is estimated
        search, others = False, ()
    solution = solve_dynamic(problem, start, others, progress, search=search)
    # weights that even out runs whose residuals scatter differently, by more than half
    _, run = np.unique([m.file for m in problem.motions], return_inverse=True)
    by_run = np.repeat(run, [m.size for m in problem.motions])
    scatter = np.sqrt(np.bincount(by_run, equations_left(problem, solution) ** 2) / np.bincount(by_run))
    if scatter.max() > _UNEVEN * scatter.min():
        weights = (float(np.sqrt(np.mean(scatter**2))) / np.maximum(scatter, 1e-6 * scatter.max())).tolist()
        motions = tuple(replace(m, weight=weights[k]) for m, k in zip(problem.motions, run, strict=True))
        problem = replace(problem, motions=motions)
        solution = solve_dynamic(problem, without_deflections(solution.values), progress=progress, search=search)
    dropped, shown = dict[ParameterName, Finding](), dict[ParameterName, str]()
    while more := _not_shown(problem, solution, shown):
        held = {name: value for name, (value, _) in more.items()}
        without = replace(problem, fixed={**problem.fixed, **held})
        near = {name: value for name, value in without_deflections(solution.values).items() if name not in held}
        for name in (n for n, at in held.items() if n.name == "alpha_1" and not at):
            level, peak = name._replace(name="alpha_0"), solution.values[name]
            if level in near and peak > near[level]:  # Coulomb friction that became a peak is Coulomb friction again
                near[level] += peak
        kinds = {why.code for _, why in more.values()}
        again = "unseen-bend" in kinds
        try:
            found = solve_dynamic(without, near, progress=progress, search=search and again)
        except InputError:  # nothing to start from without it
            break
        if not found.minimum.converged:
            break
        # the covariance tells less than the costs, where the law bends within the errors; a bend must explain most of what is left
        ratio = found.minimum.cost / max(solution.minimum.cost, 1e-300)
        p = fdtrc(len(more), solution.freedom, solution.freedom / len(more) * max(ratio - 1, 0.0))
        if "unseen-wide" not in kinds and p < SIGNIFICANCE and (not again or ratio > _BENT):
            shown |= {name: why.code for name, (_, why) in more.items()}
            continue
        rest = found if again else found._replace(starts=solution.starts, reached=solution.reached)
        problem, solution = without, rest
        dropped |= {name: why for name, (_, why) in more.items()}
    return problem, solution, dropped, shown


def _not_shown(
    problem: DynamicProblem, solution: MultistartSolution[Unknown], shown: Mapping[ParameterName, str]
) -> dict[ParameterName, tuple[float, Finding]]:
    """What the motion does not show of Stribeck terms but those `shown`, alpha_1 and v_s: what it is held at, and why.

    A term of no significance is none, and one that leaves alpha_0 unknown, or has v_s at the upper end of its range, is Coulomb
    friction. One that is there, and whose size is not known, is no larger than Coulomb friction.
    """
    if problem.stribeck == "stribeck":
        return {}
    unknowns, doubts = solution.posed.unknowns, peak_doubts(problem, solution)
    upper = dict(zip(problem.names, unknowns.upper.tolist(), strict=True))
    errors = dict(zip(solution.names, (solution.scaled_errors * unknowns.scale).tolist(), strict=True))
    message = (
        "Not identifiable from this motion: v_s lies near the fastest speed, so the term would bend the whole curve "
        "instead of dropping at low speed."
    )
    bend = Finding("unseen-bend", NOTE, message)
    bends, unsure, none = (dict[ParameterName, tuple[float, Finding]]() for _ in range(3))
    for direction in problem.directions:
        alpha_0, alpha_1, v_s = (ParameterName(name, direction) for name in ("alpha_0", "alpha_1", "v_s"))
        values = solution.values
        if not {alpha_1, v_s} <= values.keys() or problem.with_prior & {v_s, alpha_1} or alpha_1 in shown:
            continue
        if errors.get(alpha_0, 0.0) > WIDE or np.log(values[v_s]) > upper[v_s] - _EDGE:
            bends |= {alpha_1: (0.0, bend), v_s: (values[v_s], bend)}
        elif alpha_1 in doubts and doubts[alpha_1].code == "unseen-no-peak":
            none |= {alpha_1: (0.0, doubts[alpha_1]), v_s: (values[v_s], doubts[alpha_1])}
        elif values[alpha_1] > values.get(alpha_0, np.inf) and errors[alpha_1] > WIDE * values[alpha_1]:
            unsure[alpha_1] = values[alpha_0], wide(errors[alpha_1] / values[alpha_1])
    return bends or unsure or none


def relative_error(problem: DynamicProblem, values: Values) -> float:
    """100 * norm(measured - predicted) / norm(measured), percent, for runs that may not have been fitted.

    Where the torque is predicted each motion starts in steady state. A simulated position is nothing without its start:
    that of each window, and nothing else, is then fitted to it.
    """
    known = without_deflections(values)
    whole = with_deflections(problem, known)
    if problem.quantity == "position":
        of_starts = replace(problem, fixed={**problem.fixed, **known}, priors=())
        whole |= fit(of_starts, {name: whole[name] for name in of_starts.names}, _TRIES)[0]
    rows, _ = residuals(problem, whole)
    return problem.percent(rows)
