"""The LuGre fit of moving runs, with intervals and warnings."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from bristle.arrays import Array
from bristle.errors import InputError
from bristle.estimation import levels
from bristle.estimation.autocorrelation import correlated, unexplained
from bristle.estimation.covariance import condition, student
from bristle.estimation.multistart import MultistartSolution
from bristle.estimation.score_test import moved_by
from bristle.findings import CAUTION, CRITICAL, NOTE, Finding
from bristle.identification.dynamic.claims import (
    asked_peak,
    bristle_doubts,
    jacobian_and_residuals,
    peak_doubts,
    warned,
    without_weak,
)
from bristle.identification.dynamic.descent import (
    LOGARITHMIC,
    equations_left,
    solve_dynamic,
    with_deflections,
    without_deflections,
)
from bristle.identification.dynamic.problem import (
    DynamicProblem,
    Unknown,
    Values,
    friction_and_load,
    residuals,
    sets_of,
)
from bristle.identification.dynamic.residual_analysis import ResidualAnalysis, analyse_residuals, held_out_differs
from bristle.identification.fits import Estimate, HoldOut, TrackingFit
from bristle.identification.shared_findings import (
    AT_BOUND,
    TAKES_UP_PEAK,
    curve_held,
    not_passive,
    not_shown,
    offset_or_friction,
)
from bristle.model.law import is_passive
from bristle.model.laws.parts import FASTEST
from bristle.model.parameters import INERTIA, Kind, ParameterName, bends_down, least_of, of_friction, unit
from bristle.progress import Progress

_EDGE = 0.01  # in log(v_s): distance from the end of its range
_BENDS = (
    "Not identifiable from this motion: v_s lies near the fastest speed, so that the Stribeck term bends the whole curve "
    "instead of dropping at low speed."
)


class DynamicSolution(NamedTuple):
    """The fit, its problem, all free values and the minimum."""

    fit: TrackingFit
    problem: DynamicProblem
    values: Values
    solution: MultistartSolution[Unknown]
    dropped: Mapping[ParameterName, Finding]  # Reasons of dropped Stribeck terms


def fit_tracking(
    problem: DynamicProblem,
    start: Values,
    kind: Kind,
    held: Sequence[tuple[str, DynamicProblem]] = (),
    others: Sequence[Values] = (),
    progress: Progress | None = None,
    *,
    search: bool = True,
    dropped: Mapping[ParameterName, Finding] | None = None,
) -> DynamicSolution:
    """All parameters of moving runs from starts, more with `search`. Raises InputError where a start shows nothing.

    Stribeck terms that another fit has `dropped` are fixed in the problem.
    """
    problem, solution, more, shown = _settled(problem, start, others, progress, search=search)
    dropped = {**(dropped or {}), **more}
    held = [(file, replace(p, fixed=problem.fixed)) for file, p in held]
    # each from a deflection that carries the first torque
    began = [with_deflections(p, without_deflections(solution.values)) for _, p in held]
    ended = [(file, p, x, residuals(p, x)[0]) for (file, p), x in zip(held, began, strict=True)]
    left = analyse_residuals(problem, solution, kind)
    estimates = estimates_of(problem, solution, kind, dropped, shown, left)
    unseen = {name: e for name, e in estimates.items() if e.value is None}
    order = (*problem.friction_names, *problem.extra_names)
    free = tuple(n for n in solution.names if n in estimates)
    rows = equations_left(problem, solution)
    friction, load = friction_and_load(problem, solution.values)
    outcome = Finding("converged", NOTE, "The fit converged.")
    if not solution.minimum.converged:
        outcome = Finding("not-converged", CRITICAL, "The fit did not converge; it gives no estimates.")
    elif bound := tuple(n for n, e in estimates.items() if any(d.code == "at-bound" for d in e.warnings)):
        message = f"The fit converged, with {', '.join(map(str, bound))} at a bound."
        outcome = Finding("converged-at-bound", CAUTION, message, {"names": bound})
    warnings = (
        *unexplained(rows, problem.extent),
        *search_findings(problem, solution, estimates, rows),
        *left.findings,
        *filter(None, (held_out_differs(*x) for x in ended)),
        *offset_or_friction(solution.names, solution.values, solution.covariance, solution.freedom),
        *hardly_seen_findings(solution, unseen),
        *physics(problem, solution.values, estimates),
        *not_shown(unseen),
    )
    result = TrackingFit(
        law=problem.law, parameters={n: estimates[n] for n in order if n in estimates},
        rms=float(np.sqrt(np.mean(rows**2))), relative_error=problem.percent(rows), n=rows.size, outcome=outcome,
        starts=solution.starts, reached=solution.reached,
        condition=condition(solution.minimum.jacobian[:, seen_parameters(solution)]), warnings=warnings,
        hold_out=tuple(HoldOut(file=file, relative_error=p.percent(rest)) for file, p, _, rest in ended),
        names=free, covariance=solution.covariance[: len(free), : len(free)],
        fixed={**problem.fixed, **{name: solution.values[name] for name in unseen if name in solution.values}},
        time=problem.time, velocity=problem.velocity, measured=problem.measured, residuals=rows,
        friction=friction + rows, load=load, starts_of_runs=problem.starts, late=left.late,
    )  # fmt: skip  # a list of values
    return DynamicSolution(result, problem, solution.values, solution, dropped)


def _settled(
    problem: DynamicProblem, start: Values, others: Sequence[Values], progress: Progress | None, *, search: bool
) -> tuple[DynamicProblem, MultistartSolution[Unknown], dict[ParameterName, Finding], dict[ParameterName, str]]:
    """The problem with its run weights, its solution, reasons of dropped Stribeck terms, and doubts on kept ones."""
    if problem.size < levels.EQUATIONS_EACH * len(problem.names):  # too few to estimate anything
        search, others = False, ()
    dropped, shown = dict[ParameterName, Finding](), dict[ParameterName, str]()
    if not problem.is_rough:  # all of it over means of samples, then the whole problem once
        rough, found, dropped, shown = _settled(problem.rough(), start, others, progress, search=search)
        problem = replace(problem, fixed=rough.fixed).with_weights(rough.weight)
        solution = solve_dynamic(problem, {}, [found.values], search=False)._replace(
            starts=found.starts, reached=found.reached
        )
        return problem, solution, dropped, shown
    solution = solve_dynamic(problem, start, others, progress, search=search)
    if ((weight := _weights(problem, solution)) != 1).any():
        problem = problem.with_weights(weight)
        solution = solve_dynamic(problem, without_deflections(solution.values), progress=progress, search=search)
    while more := _not_shown(problem, solution, shown):
        held = {name: value for name, (value, _) in more.items()}
        without = replace(problem, fixed={**problem.fixed, **held})
        near = {name: value for name, value in without_deflections(solution.values).items() if name not in held}
        for name in (n for n, at in held.items() if n.name == "alpha_1" and not at):
            level, peak = name._replace(name="alpha_0"), solution.values[name]
            if level in near and peak > near[level]:  # a peak that took up Coulomb friction
                near[level] += peak
        kinds = {why.code for _, why in more.values()}
        again = "unseen-bend" in kinds
        try:
            found = solve_dynamic(
                without, near, [with_deflections(without, near)] * again, progress, search=search and again
            )
            if not found.minimum.converged and not again:  # from other bristles
                found = solve_dynamic(without, near, [found.values], progress, search=search)
        except InputError:  # no start without it
            break
        # an F test of the costs, since the law bends within the errors; a bend must explain most of the cost
        ratio = found.minimum.cost / max(solution.minimum.cost, 1e-300)
        p = fdtrc(len(more), solution.freedom, solution.freedom / len(more) * max(ratio - 1, 0.0))
        if "unseen-wide" not in kinds and p < levels.SIGNIFICANCE and (not again or ratio > levels.BENT):
            shown |= {name: why.code for name, (_, why) in more.items()}
            continue
        rest = found if again else found._replace(starts=solution.starts, reached=solution.reached)
        problem, solution = without, rest
        dropped |= {name: why for name, (_, why) in more.items()}
    return problem, solution, dropped, shown


def _weights(problem: DynamicProblem, solution: MultistartSolution[Unknown]) -> Array:
    """Factor on each equation, (n,), of runs that scatter differently, and of counts that bend a bristle at reversals and rests."""
    _, run = np.unique(problem.file, return_inverse=True)
    squares, turns, weight = equations_left(problem, solution) ** 2, problem.turns, np.ones(run.size)

    def scatter(of: NDArray[np.bool_]) -> Array:
        """Of some equations, by run; 0 where it has none of them."""
        return np.asarray(np.sqrt(np.bincount(run, squares * of) / np.maximum(np.bincount(run, of), 1)))

    every, slides = scatter(turns | ~turns), scatter(~turns)
    if every.max() > levels.FACTOR * every.min():
        weight *= (float(np.sqrt(np.mean(every**2))) / np.maximum(every, 1e-6 * every.max()))[run]
    # a bristle that is bent by a count more or less, unless it passes g0 within one, as far as residuals show it
    sets = sets_of(problem, solution.values).values()
    bent = max((p.sigma_0 for p in sets if p.sigma_0 * problem.count < p.alpha_0 + p.alpha_1), default=0.0)
    seen = np.minimum(scatter(turns), np.hypot(slides, bent * problem.count / np.sqrt(12)))
    counted = turns & ((seen > levels.FACTOR * slides) & (slides > 0))[run]
    if min(counted.sum(), (~turns).sum()) >= levels.ENOUGH:
        weight[counted] *= (slides / np.maximum(seen, 1e-300))[run][counted]
    return weight


def _not_shown(
    problem: DynamicProblem, solution: MultistartSolution[Unknown], shown: Mapping[ParameterName, str]
) -> dict[ParameterName, tuple[float, Finding]]:
    """Stribeck parameters that the motion does not show, but those `shown`: the value to hold, and the reason."""
    if problem.stribeck == "stribeck":
        return {}
    errors, doubts = solution.errors, peak_doubts(problem, solution)
    upper = dict(zip(problem.names, solution.posed.unknowns.upper.tolist(), strict=True))
    bend = Finding("unseen-bend", NOTE, _BENDS)
    bends, unsure, none = (dict[ParameterName, tuple[float, Finding]]() for _ in range(3))
    for direction in problem.directions:
        alpha_0, alpha_1, v_s = (ParameterName(name, direction) for name in ("alpha_0", "alpha_1", "v_s"))
        values = solution.values
        if not {alpha_1, v_s} <= values.keys() or problem.with_prior & {v_s, alpha_1} or alpha_1 in shown:
            continue
        if errors.get(alpha_0, 0.0) > levels.WIDE or np.log(values[v_s]) > upper[v_s] - _EDGE:
            bends |= {alpha_1: (0.0, bend), v_s: (values[v_s], bend)}
        elif alpha_1 in doubts and doubts[alpha_1].code == "unseen-no-peak":
            none |= {alpha_1: (0.0, doubts[alpha_1]), v_s: (values[v_s], doubts[alpha_1])}
        elif values[alpha_1] > values.get(alpha_0, np.inf) and errors[alpha_1] > levels.WIDE * values[alpha_1]:
            unsure[alpha_1] = values[alpha_0], wide(errors[alpha_1] / values[alpha_1])
    return bends or unsure or none


def estimates_of(
    problem: DynamicProblem,
    solution: MultistartSolution[Unknown],
    kind: Kind,
    dropped: Mapping[ParameterName, Finding],
    shown: Mapping[ParameterName, str],
    left: ResidualAnalysis,
) -> dict[ParameterName, Estimate]:
    """Each parameter's estimate; without a value where the motion does not show it, or the fit failed."""
    estimates = _estimates(solution._replace(scaled_errors=left.errors), kind)
    for name, why in dropped.items():
        estimates[name] = Estimate(value=None, unit=unit(name.name, kind), interval=(0.0, np.inf), warnings=(why,))
    if not solution.minimum.converged or problem.percent(equations_left(problem, solution)) > levels.USELESS:
        message = "Not estimated: the fit did not converge, or leaves more than was measured."
        estimates = warned(estimates, dict.fromkeys(estimates, Finding("unseen-unconverged", NOTE, message)))
    equations, unknowns = solution.minimum.residuals.size, solution.minimum.x.size
    if equations < (least := levels.EQUATIONS_EACH * unknowns):
        message = (
            f"Not estimated: the motion leaves {equations} equations for {unknowns} unknowns, and at least {least} are "
            "needed; log longer or faster."
        )
        few = Finding("unseen-too-few", NOTE, message, {"equations": equations, "unknowns": unknowns, "least": least})
        estimates = warned(estimates, dict.fromkeys(estimates, few))
    doubts = peak_doubts(problem, solution)
    estimates = warned(estimates, {name: why for name, why in doubts.items() if name not in shown})
    estimates = warned(estimates, bristle_doubts(problem, solution, estimates))
    kept = {name: Finding("unseen-shape", NOTE, _BENDS) for name, code in shown.items() if code == "unseen-bend"}
    estimates = warned(estimates, kept)
    beside = {n._replace(name=name) for n in kept for name in ("alpha_0", "alpha_2")} & estimates.keys()
    errors = dict(zip(solution.names, solution.scaled_errors.tolist(), strict=True))
    # parameters that take up an omitted term by more than an error
    for direction in problem.directions:
        without = problem.fixed.get(ParameterName("alpha_1", direction)) == 0
        moved = asked.moved if without and (asked := asked_peak(problem, solution, direction, levels.RARE)) else {}
        mine = (ParameterName(name, direction) for name in ("alpha_0", "alpha_2"))
        beside |= {name for name in mine if abs(moved.get(name, 0.0)) > errors.get(name, np.inf)}
    estimates = warned(estimates, dict.fromkeys(beside, TAKES_UP_PEAK))
    J = estimates.get(INERTIA)
    if J is not None and J.value is not None and J.interval is not None and J.value < 0:
        # rms change of friction without it, to first order
        (known, _, _), seen = jacobian_and_residuals(problem, solution), solution.scaled_errors < np.inf
        names = [name for name, is_seen in zip(solution.names, seen, strict=True) if is_seen]
        at, of = names.index(INERTIA), [isinstance(n, ParameterName) and of_friction(n.name) for n in names]
        made = known[:, at] * solution.minimum.x[: seen.size][seen][at]
        known[:, at] = 0.0
        changed = known[:, of] @ moved_by(known, made)[of] / problem.weight
        share, high = float(np.sqrt(np.mean(changed**2))) / left.friction, J.interval[1]
        if high >= 0 or share < levels.MATTERS:
            message = (
                f"Not identifiable from this motion: it comes out at {J.value:.2g} {J.unit}, and none is below zero; without it friction "
                f"would change by {100 * share:.1g} %."
            )
            bounded = {**estimates, INERTIA: replace(J, interval=(0.0, high) if high > 0 else None)}
            estimates = warned(bounded, {INERTIA: Finding("unseen-inertia", NOTE, message, {"share": share})})
    return without_weak(problem, estimates)


def _estimates(solution: MultistartSolution[Unknown], kind: Kind) -> dict[ParameterName, Estimate]:
    """Each parameter but the deflections at the start, in SI units."""
    k = len(solution.names)
    out, columns = {}, np.array([solution.minimum.x[:k], solution.scaled_errors, solution.posed.unknowns.scale[:k]])
    reaches = [student(x) for x in solution.freedoms.tolist()]
    for name, (x, error, size), reach in zip(solution.names, columns.T.tolist(), reaches, strict=True):
        if not isinstance(name, ParameterName):
            continue
        bare, value = name.name, solution.values[name]
        warnings: list[Finding] = []
        if bare in LOGARITHMIC:
            with np.errstate(over="ignore"):
                low, high = (float(np.exp(x + s * reach * error)) for s in (-1, 1))
            se, relative = value * error, error
        else:
            se = size * error
            low, high = value - reach * se, value + reach * se
            relative = se / abs(value) if value else np.inf
            least = least_of(bare)
            if value >= least:
                low = max(low, least)
            if value == least and of_friction(bare):
                warnings.append(AT_BOUND)
        if relative > levels.WIDE and of_friction(bare) and np.isfinite(least_of(bare)):
            warnings.append(wide(relative))
        out[name] = Estimate(
            value=value, unit=unit(bare, kind), standard_error=se if np.isfinite(se) else None, interval=(low, high),
            warnings=tuple(warnings),
        )  # fmt: skip  # a list of values
    return out


def wide(share: float) -> Finding:
    """That a standard error is this share of its value."""
    told = f"{100 * share:.0f} % of" if share < 10 else "more than ten times"
    message = f"Not identifiable from this motion: its standard error is {told} its value."
    return Finding("unseen-wide", NOTE, message, {"share": share})


def search_findings(
    problem: DynamicProblem,
    solution: MultistartSolution[Unknown],
    estimates: Mapping[ParameterName, Estimate],
    rows: Array,
) -> Iterator[Finding]:
    """What the search and its estimates say of themselves."""
    J = estimates.get(INERTIA)
    if J is not None and J.value is not None and J.interval is not None and J.interval[1] < 0:
        message = (
            f"The inertia comes out at {J.value:.3g} +/- {J.standard_error:.2g} {J.unit}, and none is below zero: the torque is "
            "filtered or late, or another signal is not what it is taken for. Do not use the numbers of this fit."
        )
        yield Finding("inertia-below-zero", CRITICAL, message, {"value": J.value, "error": J.standard_error})
    for own in problem.law.peak.own:  # beside v_s
        held = [ParameterName(own.name, d) for d in problem.directions]
        names = tuple(dict.fromkeys(str(n) for n in held if problem.fixed.get(n) == own.middle))
        if names:
            message = (
                f"{', '.join(names)}: {own.middle:.3g} is assumed, the middle of what is searched, since motion hardly "
                "shows it; add points at constant velocity, or give it under fit.fixed."
            )
            yield Finding("shape-held", CAUTION, message, {"names": names, "value": own.middle})
    if solution.widening > sqrt(2):
        yield correlated(rows, solution.widening)


def seen_parameters(solution: MultistartSolution[Unknown]) -> list[int]:
    """Columns of parameters with an influence."""
    seen = np.flatnonzero(solution.scaled_errors < np.inf).tolist()
    return [k for k in seen if isinstance(solution.names[k], ParameterName)]


def hardly_seen_findings(
    solution: MultistartSolution[Unknown], unseen: Mapping[ParameterName, Estimate]
) -> list[Finding]:
    """Directions in parameter space that the data hardly see."""
    keep, warnings = seen_parameters(solution), []
    jacobian = solution.minimum.jacobian[:, keep]
    _, values, directions = np.linalg.svd(jacobian / np.linalg.norm(jacobian, axis=0), full_matrices=False)
    for value, direction in zip(values, directions, strict=True):
        if value < levels.HARDLY_SEEN * values[0]:
            large = np.flatnonzero(np.abs(direction) > levels.MEMBERS * np.abs(direction).max())
            members = [(solution.names[keep[k]], direction[k]) for k in large]
            if any(name in unseen or not of_friction(name.name) for name, _ in members):
                warnings.append(hardly_seen(members))
    return warnings


def hardly_seen(members: Sequence[tuple[object, float]]) -> Finding:
    """The finding on a hardly seen direction, from names and their shares."""
    if len(members) == 1:
        name = members[0][0]
        return Finding("hardly-seen", CAUTION, f"{name} is hardly identifiable from these data.", {"name": name})
    up = tuple(n for n, w in members if w * members[0][1] > 0)
    down = tuple(n for n, w in members if w * members[0][1] < 0)
    every, raised, lowered = (" and ".join(map(str, names)) for names in ((*up, *down), up, down))
    change = f"raising {raised} and lowering {lowered}" if down else "raising them together"
    message = f"{every} are identifiable only in combination: {change} hardly changes the torque."
    return Finding("only-as-sum", CAUTION, message, {"all": (*up, *down), "up": up, "down": down})


OF_PHYSICS = frozenset({"not-passive", "perhaps-not-passive", "curve-held"})  # verdicts of `physics`


def physics(problem: DynamicProblem, values: Values, estimates: Mapping[ParameterName, Estimate]) -> list[Finding]:
    """Findings on passivity and on a curve that bends down."""
    warnings = []
    for d, lugre in sets_of(problem, values).items():
        known = {n: e for n in ("alpha_1", "sigma_1") if (e := estimates.get(ParameterName(n, d))) is not None}
        if not is_passive(lugre) and all(e.value is not None for e in known.values()):
            least = {n: e.interval[0] for n, e in known.items() if e.interval is not None}
            warnings.append(not_passive(lugre, d, surely=not is_passive(lugre._replace(**least))))
        if bends_down(lugre):
            warnings.append(curve_held(getattr(lugre, FASTEST)))
    return warnings
