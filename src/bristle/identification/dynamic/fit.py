"""The fit of moving data.

Starts, intervals that know of correlated residuals, what the data do not see, hold-out runs.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import sqrt
from typing import NamedTuple

import numpy as np
from scipy.special import fdtrc

from bristle.arrays import Array
from bristle.errors import InputError
from bristle.estimation.autocorrelation import correlated, unexplained
from bristle.estimation.covariance import condition, student
from bristle.estimation.levels import SIGNIFICANCE
from bristle.estimation.multistart import MultistartSolution
from bristle.estimation.score_test import MATTERS, moved_by
from bristle.findings import CAUTION, CRITICAL, NOTE, Finding, in_direction, unit_of
from bristle.identification.dynamic.claims import (
    WIDE,
    bristle_doubts,
    loads_alike,
    peak_doubts,
    warned,
    without_weak,
)
from bristle.identification.dynamic.left_out_peak import beside_a_peak
from bristle.identification.dynamic.problem import (
    DynamicProblem,
    Unknown,
    Values,
    friction_and_load,
    parameters,
    residuals,
)
from bristle.identification.dynamic.starts import solve_dynamic
from bristle.identification.dynamic.unknowns import (
    FEWEST,
    LOGARITHMIC,
    equations_left,
    fit,
    with_deflections,
    without_deflections,
)
from bristle.identification.dynamic.what_is_left import Left, known_and_left, what_is_left
from bristle.identification.fits import Estimate, HoldOut, TrackingFit
from bristle.identification.offset import offset_or_friction
from bristle.identification.shared_findings import at_bound, curve_held, not_shown, takes_up_peak
from bristle.model.law import is_passive
from bristle.model.laws.parts import FASTEST
from bristle.model.parameters import INERTIA, Kind, Lugre, ParameterName, bends_down, least_of, of_friction, unit
from bristle.progress import Progress

SEED = 0
STARTS = 6
"""One from the other stages, the others at random about it."""
_EDGE = 0.01
"""In log(v_s): this near to the end of its range is at it."""
_TRIES = 30
"""Steps that the start of a held-out window is given."""
_BENT = 4.0
"""Times as large, beyond which the squares that are left without a term show one that bends the whole curve."""
_UNEVEN = 1.5
"""Runs whose residuals differ by less than this factor count alike."""
_NOTHING = 100.0
"""Percent: what no model at all would leave."""
_UNSEEN = 1e-2
"""A direction whose singular value is this share of the largest is not seen."""


class DynamicSolution(NamedTuple):
    """A fit with the problem that it solved in the end, every free value, and the minimum.

    What the motion does not show is fixed in that problem.
    """

    fit: TrackingFit
    problem: DynamicProblem
    values: Values
    solution: MultistartSolution[Unknown]


def fit_tracking(
    problem: DynamicProblem,
    start: Values,
    kind: Kind,
    held: Sequence[tuple[str, DynamicProblem]] = (),
    starts: int = STARTS,
    seed: int = SEED,
    others: Sequence[Values] = (),
    progress: Progress | None = None,
) -> DynamicSolution:
    """All parameters of moving data with intervals and warnings.

    Args:
        problem: the training runs.
        start: LuGre parameters and extra regressors by name, from the other stages or guessed.
        kind: of the joint, for units.
        held: hold-out runs by name, posed as the problem is.
        starts: how many, >= 1; the first is `start`, then come `others`.
        seed: of those at random.
        others: starts, whole, as another fit ended.
        progress: told of each start.

    Raises InputError where a start shows no dependence on any parameter.
    """
    problem, solution, dropped, shown = _settled(problem, start, starts, seed, others, progress)
    held = [(file, replace(p, fixed=problem.fixed)) for file, p in held]
    left = what_is_left(problem, solution, kind)
    estimates = _all_estimates(problem, solution, kind, dropped, shown, left)
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
        *_of_fit(problem, solution, estimates, rows),
        *left.findings,
        *(offset_or_friction(solution.names, solution.values, solution.covariance, solution.freedom) if torque else ()),
        *loads_alike(problem, solution),
        *_unseen(solution, unseen),
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
        relative_error=_percent(rows, problem),
        n=rows.size,
        outcome=outcome,
        starts=solution.starts,
        reached=solution.reached,
        condition=condition(solution.minimum.jacobian[:, _seen(solution)]),
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
        windows=len(problem.motions) if problem.quantity == "position" else 0,
    )
    return DynamicSolution(result, problem, solution.values, solution)


def _settled(
    problem: DynamicProblem,
    start: Values,
    starts: int,
    seed: int,
    others: Sequence[Values],
    progress: Progress | None,
) -> tuple[DynamicProblem, MultistartSolution[Unknown], dict[ParameterName, Finding], dict[ParameterName, str]]:
    """The problem as it is solved in the end, its solution, why Stribeck terms that are none are not in it, and which are shown to be there.

    It has the weights that its runs ask for, and not those terms. Of what is shown the code of what spoke against it.
    """
    if sum(m.size for m in problem.motions) < FEWEST * len(problem.names):  # of which nothing is estimated
        starts, others = 1, ()
    solution = solve_dynamic(problem, start, starts, seed, others, progress)
    problem, changed = _weighted(problem, solution)
    if changed:
        solution = solve_dynamic(problem, without_deflections(solution.values), starts, seed, progress=progress)
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
            found = solve_dynamic(without, near, starts if again else 1, seed, progress=progress)
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


def _all_estimates(
    problem: DynamicProblem,
    solution: MultistartSolution[Unknown],
    kind: Kind,
    dropped: Mapping[ParameterName, Finding],
    shown: Mapping[ParameterName, str],
    left: Left,
) -> dict[ParameterName, Estimate]:
    """Each parameter but the deflections at the start; what the motion does not show has no value.

    None has where the fit did not converge, or leaves more than there was.
    """
    estimates = _estimates(solution._replace(scaled_errors=left.errors), kind)
    anything = (0.0, float("inf"))
    estimates |= {
        name: Estimate(value=None, unit=unit(name.name, kind), interval=anything, warnings=(why,))
        for name, why in dropped.items()
    }
    if not solution.minimum.converged or _percent(equations_left(problem, solution), problem) > _NOTHING:
        message = "Not estimated: the fit did not converge, or leaves more than was measured."
        estimates = warned(estimates, dict.fromkeys(estimates, Finding("unseen-unconverged", NOTE, message)))
    equations, unknowns = solution.minimum.residuals.size, len(solution.names)
    if equations < (least := FEWEST * unknowns):
        message = (
            f"Not estimated: the motion leaves {equations} equations for {unknowns} unknowns, and at least {least} are "
            "needed; log longer or faster."
        )
        few = Finding("unseen-too-few", NOTE, message, {"equations": equations, "unknowns": unknowns, "least": least})
        estimates = warned(estimates, dict.fromkeys(estimates, few))
    doubts = {name: why for name, why in peak_doubts(problem, solution).items() if name not in shown}
    estimates = warned(estimates, doubts)
    estimates = warned(estimates, bristle_doubts(problem, solution, estimates))
    message = (
        "Not identifiable from this motion: v_s lies near the fastest speed, so that the Stribeck term bends the whole curve, which is known at "
        "these speeds alone."
    )
    kept = {name: Finding("unseen-shape", NOTE, message) for name, code in shown.items() if code == "unseen-bend"}
    estimates = warned(estimates, kept)
    beside = {n._replace(name=name) for n in kept for name in ("alpha_0", "alpha_2")} & estimates.keys()
    bent = [name for name, why in dropped.items() if why.code == "unseen-bend"]
    only_sum = Finding("only-sum-seen", NOTE, "Were v_s above these speeds, this would contain alpha_1.")
    for name in (n._replace(name="alpha_0") for n in bent if n.name == "alpha_1"):
        if name in estimates:
            estimates[name] = replace(estimates[name], warnings=(*estimates[name].warnings, only_sum))
    estimates = warned(estimates, dict.fromkeys((*beside, *beside_a_peak(problem, solution)), takes_up_peak()))
    J = estimates.get(INERTIA)
    if (
        J is not None
        and J.interval is not None
        and J.interval[1] < 0
        and (share := _of_inertia(problem, solution) / left.friction) < MATTERS
    ):
        message = (
            f"Not identifiable from this motion: it comes out at {J.value:.2g} {J.unit}, and none is below zero; without it friction would change "
            f"by {100 * share:.1g} %."
        )
        estimates = warned(estimates, {INERTIA: Finding("unseen-inertia", NOTE, message, {"share": share})})
    return without_weak(problem, estimates)


def _of_inertia(problem: DynamicProblem, solution: MultistartSolution[Unknown]) -> float:
    """By how much the friction of a solution would change without its inertia, rms, N*m, to first order."""
    known, _ = known_and_left(problem, solution)
    seen = solution.scaled_errors < np.inf
    names = [name for name, is_seen in zip(solution.names, seen, strict=True) if is_seen]
    at, of = names.index(INERTIA), [isinstance(n, ParameterName) and of_friction(n.name) for n in names]
    made = known[:, at] * solution.minimum.x[seen][at]
    known[:, at] = 0.0
    changed = known[:, of] @ moved_by(known, made)[of]
    return float(np.sqrt(np.mean((changed / problem.weight) ** 2)))


def _weighted(problem: DynamicProblem, solution: MultistartSolution[Unknown]) -> tuple[DynamicProblem, bool]:
    """Weights that even out runs whose residuals scatter differently, by more than half; and whether there are any."""
    rows = equations_left(problem, solution)
    _, run = np.unique([m.file for m in problem.motions], return_inverse=True)
    by_run = np.repeat(run, [m.size for m in problem.motions])
    scatter = np.sqrt(np.bincount(by_run, rows**2) / np.bincount(by_run))
    if scatter.max() <= _UNEVEN * scatter.min():
        return problem, False
    weights = float(np.sqrt(np.mean(scatter**2))) / np.maximum(scatter, 1e-6 * scatter.max())
    motions = tuple(replace(m, weight=float(weights[k])) for m, k in zip(problem.motions, run, strict=True))
    return replace(problem, motions=motions), True


def _not_shown(
    problem: DynamicProblem, solution: MultistartSolution[Unknown], shown: Mapping[ParameterName, str]
) -> dict[ParameterName, tuple[float, Finding]]:
    """What the motion does not show of Stribeck terms but those `shown`, alpha_1 and v_s: what it is held at, and why.

    A term of no significance is none, and one that leaves alpha_0 unknown, or has v_s at the upper end of its range, is Coulomb
    friction. One that is there, and whose size is not known, is no larger than Coulomb friction.
    """
    if problem.stribeck == "stribeck":
        return {}
    upper = dict(zip(problem.names, solution.posed.unknowns.upper.tolist(), strict=True))
    size = solution.scaled_errors * solution.posed.unknowns.scale
    errors = dict(zip(solution.names, size.tolist(), strict=True))
    doubts = peak_doubts(problem, solution)
    message = (
        "Not identifiable from this motion: v_s lies near the fastest speed, so the term would bend the whole curve "
        "instead of dropping at low speed."
    )
    bend = Finding("unseen-bend", NOTE, message)
    bends, wide, none = (dict[ParameterName, tuple[float, Finding]]() for _ in range(3))
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
            wide[alpha_1] = values[alpha_0], _wide(errors[alpha_1] / values[alpha_1])
    return bends or wide or none


def _wide(share: float) -> Finding:
    """That a standard error is this share of its value."""
    message = f"Not identifiable from this motion: its standard error is {100 * share:.0f} % of its value."
    return Finding("unseen-wide", NOTE, message, {"share": share})


def _percent(rows: Array, problem: DynamicProblem) -> float:
    """100 * norm(rows) / extent of the problem, percent; nan where its squares are too small to be numbers."""
    extent = problem.extent
    return float(100 * np.linalg.norm(rows) / extent) if extent > 0 else float("nan")


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
    return _percent(rows, problem)


def _estimates(solution: MultistartSolution[Unknown], kind: Kind) -> dict[ParameterName, Estimate]:
    """Each parameter but the deflections at the start, in SI units."""
    scale = solution.posed.unknowns.scale
    out = {}
    reaches = [student(x) for x in solution.freedoms.tolist()]
    for name, x, error, size, reach in zip(
        solution.names, solution.minimum.x, solution.scaled_errors.tolist(), scale.tolist(), reaches, strict=True
    ):
        if not isinstance(name, ParameterName):
            continue
        bare, value = name.name, solution.values[name]
        warnings: list[Finding] = []
        if bare in LOGARITHMIC:
            with np.errstate(over="ignore"):
                low, high = (float(np.exp(x + s * reach * error)) for s in (-1, 1))
            se = value * error
            relative = error
        else:
            se = size * error
            low, high = value - reach * se, value + reach * se
            relative = se / abs(value) if value else np.inf
            least = least_of(bare)
            if value >= least:
                low = max(low, least)
            if value == least and of_friction(bare):
                warnings.append(at_bound())
        if relative > WIDE and of_friction(bare) and np.isfinite(least_of(bare)):
            message = "Not identifiable from this motion: its standard error is more than ten times its value."
            warnings.append(_wide(relative) if relative < 10 else Finding("unseen-far", NOTE, message))
        out[name] = Estimate(
            value=value,
            unit=unit(bare, kind),
            standard_error=se if np.isfinite(se) else None,
            interval=(low, high),
            warnings=tuple(warnings),
        )
    return out


def _of_fit(
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
        numbers = {"value": J.value, "error": J.standard_error, "unit": J.unit}
        yield Finding("inertia-below-zero", CRITICAL, message, numbers)
    for own in problem.law.peak.own:  # beside v_s
        held = [ParameterName(own.name, d) for d in problem.directions]
        names = tuple(dict.fromkeys(str(n) for n in held if problem.fixed.get(n) == own.middle))
        if names:
            message = (
                f"{', '.join(names)}: {own.middle:.3g} is assumed, the middle of what is searched, since motion hardly "
                "shows it; add points at constant velocity, or give it under fit.fixed."
            )
            yield Finding("shape-held", CAUTION, message, {"names": names, "value": own.middle})
    if not solution.minimum.converged:
        message = "The fit reached its limit of iterations before it converged."
        yield Finding("out-of-steps", CRITICAL, message)
    if solution.widening > sqrt(2):
        yield correlated(rows, solution.widening)
        if solution.reached < solution.starts / 2:  # where noise alone is left no other minimum is lower
            reached, starts = solution.reached, solution.starts
            message = f"Only {reached} of {starts} starts reached the lowest cost; the others ended in a worse fit."
            yield Finding("few-starts", CAUTION, message, {"reached": reached, "starts": starts})


def _seen(solution: MultistartSolution[Unknown]) -> list[int]:
    """Columns of the parameters, starts of the motions apart, of which anything is seen."""
    return [
        k for k, n in enumerate(solution.names) if isinstance(n, ParameterName) and solution.scaled_errors[k] < np.inf
    ]


def _unseen(solution: MultistartSolution[Unknown], unseen: Mapping[ParameterName, Estimate]) -> list[Finding]:
    """The directions in parameter space that the data hardly see."""
    keep = _seen(solution)
    jacobian = solution.minimum.jacobian[:, keep]
    jacobian = jacobian / np.linalg.norm(jacobian, axis=0)
    _, values, directions = np.linalg.svd(jacobian, full_matrices=False)
    warnings = []
    for value, direction in zip(values, directions, strict=True):
        if value < _UNSEEN * values[0]:
            members = [
                (solution.names[keep[k]], w) for k, w in enumerate(direction) if abs(w) > 0.3 * np.abs(direction).max()
            ]
            if any(name in unseen or not of_friction(name.name) for name, _ in members):
                warnings.append(hardly_seen(members))
    for k, name in enumerate(solution.names):
        if solution.scaled_errors[k] == np.inf and isinstance(name, ParameterName):
            message = f"{name} is not identifiable: the torque does not depend on it in this motion."
            warnings.append(Finding("nothing-seen", NOTE, message, {"name": name}))
    return warnings


def hardly_seen(members: Sequence[tuple[object, float]]) -> Finding:
    """What data say of a direction of parameters that they hardly see.

    Its members are names with their shares of it.
    """
    if len(members) == 1:
        name = members[0][0]
        return Finding("hardly-seen", CAUTION, f"{name} is hardly identifiable from these data.", {"name": name})
    up = tuple(n for n, w in members if w * members[0][1] > 0)
    down = tuple(n for n, w in members if w * members[0][1] < 0)
    every, raised, lowered = (" and ".join(map(str, names)) for names in ((*up, *down), up, down))
    if not down:
        message = (
            f"{every} are identifiable only relative to one another: raising them together hardly changes the torque."
        )
        return Finding("only-against", CAUTION, message, {"up": up})
    message = (
        f"{every} are identifiable only as a sum: raising {raised} and lowering {lowered} hardly changes the torque."
    )
    return Finding("only-as-sum", CAUTION, message, {"all": (*up, *down), "up": up, "down": down})


OF_PHYSICS = frozenset({"not-passive", "curve-held", "odd-damping"})
"""Verdicts of `physics`."""


def physics(problem: DynamicProblem, values: Values, unseen: Mapping[ParameterName, Estimate]) -> list[Finding]:
    """Verdicts that need no data: passivity, and damping in presliding.

    None that rests on what the motion does not show.
    """
    warnings = []
    p = parameters(problem, values)
    sets = dict(zip(problem.directions, [p] if isinstance(p, Lugre) else p, strict=True))
    J = values.get(INERTIA, problem.fixed.get(INERTIA))
    for d, lugre in sets.items():
        if not is_passive(lugre) and not {ParameterName(n, d) for n in ("alpha_1", "sigma_1")} & unseen.keys():
            least = lugre.sigma_1 * lugre.alpha_1 / lugre.alpha_0
            of = unit_of("alpha_2")
            message = (
                f"The model can feed energy back{in_direction(d)}: alpha_2 = {lugre.alpha_2:.3g}{of} is below sigma_1 "
                f"alpha_1 / alpha_0 = {least:.3g}{of}. The fit stands; test a compensator that uses it with care."
            )
            numbers = {"direction": d, "alpha_2": lugre.alpha_2, "least": least}
            warnings.append(Finding("not-passive", CAUTION, message, numbers))
        if bends_down(lugre):
            fastest = getattr(lugre, FASTEST)
            warnings.append(curve_held(fastest))
        if J and J > 0 and not {ParameterName(n, d) for n in ("sigma_0", "sigma_1")} & unseen.keys():
            ratio = (lugre.sigma_1 + lugre.alpha_2) / (2 * sqrt(J * lugre.sigma_0))
            if not 0.02 < ratio < 5:
                message = f"The damping ratio in presliding{in_direction(d)} would be {ratio:.2g}; 0.1 to 1 is usual."
                warnings.append(Finding("odd-damping", CAUTION, message, {"direction": d, "ratio": ratio}))
    return warnings
