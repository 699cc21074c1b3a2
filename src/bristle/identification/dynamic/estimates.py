"""What a fit of moving data says of each parameter, and of itself: estimates with intervals, what the motion does not see, physics."""

from collections.abc import Iterator, Mapping, Sequence
from math import sqrt

import numpy as np

from bristle.arrays import Array
from bristle.estimation.autocorrelation import correlated
from bristle.estimation.covariance import student
from bristle.estimation.multistart import MultistartSolution
from bristle.estimation.score_test import MATTERS, moved_by
from bristle.findings import CAUTION, CRITICAL, NOTE, Finding, in_direction
from bristle.identification.dynamic.claims import WIDE, asked_peak, bristle_doubts, peak_doubts, warned, without_weak
from bristle.identification.dynamic.descent import FEWEST, LOGARITHMIC, equations_left
from bristle.identification.dynamic.problem import DynamicProblem, Unknown, Values, sets_of
from bristle.identification.dynamic.what_is_left import Left, known_and_left
from bristle.identification.fits import Estimate
from bristle.identification.shared_findings import AT_BOUND, TAKES_UP_PEAK, curve_held, not_passive
from bristle.model.law import is_passive
from bristle.model.laws.parts import FASTEST
from bristle.model.parameters import INERTIA, Kind, ParameterName, bends_down, least_of, of_friction, unit

_NOTHING = 100.0  # percent: what no model at all would leave
_UNSEEN = 1e-2  # a direction whose singular value is this share of the largest is not seen


def estimates_of(
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
    for name, why in dropped.items():
        estimates[name] = Estimate(value=None, unit=unit(name.name, kind), interval=(0.0, np.inf), warnings=(why,))
    if not solution.minimum.converged or problem.percent(equations_left(problem, solution)) > _NOTHING:
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
    doubts = peak_doubts(problem, solution)
    estimates = warned(estimates, {name: why for name, why in doubts.items() if name not in shown})
    estimates = warned(estimates, bristle_doubts(problem, solution, estimates))
    message = (
        "Not identifiable from this motion: v_s lies near the fastest speed, so that the Stribeck term bends the whole curve, which is known at "
        "these speeds alone."
    )
    kept = {name: Finding("unseen-shape", NOTE, message) for name, code in shown.items() if code == "unseen-bend"}
    estimates = warned(estimates, kept)
    beside = {n._replace(name=name) for n in kept for name in ("alpha_0", "alpha_2")} & estimates.keys()
    bent = {
        n._replace(name="alpha_0") for n, why in dropped.items() if why.code == "unseen-bend" and n.name == "alpha_1"
    }
    only_sum = Finding("only-sum-seen", NOTE, "Were v_s above these speeds, this would contain alpha_1.")
    estimates = warned(estimates, dict.fromkeys(bent & estimates.keys(), only_sum))
    errors = dict(zip(solution.names, solution.scaled_errors.tolist(), strict=True))
    for (
        direction
    ) in problem.directions:  # without a term that the residuals ask for, and that moves them by more than an error
        without = problem.fixed.get(ParameterName("alpha_1", direction)) == 0
        moved = asked.moved if without and (asked := asked_peak(problem, solution, direction)) else {}
        mine = (ParameterName(name, direction) for name in ("alpha_0", "alpha_2"))
        beside |= {name for name in mine if abs(moved.get(name, 0.0)) > errors.get(name, np.inf)}
    estimates = warned(estimates, dict.fromkeys(beside, TAKES_UP_PEAK))
    J = estimates.get(INERTIA)
    if J is not None and J.interval is not None and J.interval[1] < 0:
        # by how much friction would change without it, rms, to first order
        (known, _), seen = known_and_left(problem, solution), solution.scaled_errors < np.inf
        names = [name for name, is_seen in zip(solution.names, seen, strict=True) if is_seen]
        at, of = names.index(INERTIA), [isinstance(n, ParameterName) and of_friction(n.name) for n in names]
        made = known[:, at] * solution.minimum.x[seen][at]
        known[:, at] = 0.0
        changed = known[:, of] @ moved_by(known, made)[of] / problem.weight
        if (share := float(np.sqrt(np.mean(changed**2))) / left.friction) < MATTERS:
            message = (
                f"Not identifiable from this motion: it comes out at {J.value:.2g} {J.unit}, and none is below zero; without it friction "
                f"would change by {100 * share:.1g} %."
            )
            estimates = warned(estimates, {INERTIA: Finding("unseen-inertia", NOTE, message, {"share": share})})
    return without_weak(problem, estimates)


def _estimates(solution: MultistartSolution[Unknown], kind: Kind) -> dict[ParameterName, Estimate]:
    """Each parameter but the deflections at the start, in SI units."""
    out, columns = {}, np.array([solution.minimum.x, solution.scaled_errors, solution.posed.unknowns.scale])
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
        if relative > WIDE and of_friction(bare) and np.isfinite(least_of(bare)):
            message = "Not identifiable from this motion: its standard error is more than ten times its value."
            warnings.append(wide(relative) if relative < 10 else Finding("unseen-far", NOTE, message))
        out[name] = Estimate(
            value=value, unit=unit(bare, kind), standard_error=se if np.isfinite(se) else None, interval=(low, high),
            warnings=tuple(warnings),
        )  # fmt: skip  # a list of values
    return out


def wide(share: float) -> Finding:
    """That a standard error is this share of its value."""
    message = f"Not identifiable from this motion: its standard error is {100 * share:.0f} % of its value."
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
        yield Finding("out-of-steps", CRITICAL, "The fit reached its limit of iterations before it converged.")
    if solution.widening > sqrt(2):
        yield correlated(rows, solution.widening)


def seen_parameters(solution: MultistartSolution[Unknown]) -> list[int]:
    """Columns of the parameters, starts of the motions apart, of which anything is seen."""
    seen = np.flatnonzero(solution.scaled_errors < np.inf).tolist()
    return [k for k in seen if isinstance(solution.names[k], ParameterName)]


def hardly_seen_findings(
    solution: MultistartSolution[Unknown], unseen: Mapping[ParameterName, Estimate]
) -> list[Finding]:
    """The directions in parameter space that the data hardly see."""
    keep, warnings = seen_parameters(solution), []
    jacobian = solution.minimum.jacobian[:, keep]
    _, values, directions = np.linalg.svd(jacobian / np.linalg.norm(jacobian, axis=0), full_matrices=False)
    for value, direction in zip(values, directions, strict=True):
        if value < _UNSEEN * values[0]:
            large = np.flatnonzero(np.abs(direction) > 0.3 * np.abs(direction).max())
            members = [(solution.names[keep[k]], direction[k]) for k in large]
            if any(name in unseen or not of_friction(name.name) for name, _ in members):
                warnings.append(hardly_seen(members))
    return warnings


def hardly_seen(members: Sequence[tuple[object, float]]) -> Finding:
    """What data say of a direction that they hardly see; its members are names with their shares of it."""
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


OF_PHYSICS = frozenset({"not-passive", "curve-held", "odd-damping"})  # verdicts of `physics`


def physics(problem: DynamicProblem, values: Values, unseen: Mapping[ParameterName, Estimate]) -> list[Finding]:
    """Passivity and damping in presliding, which need no data; none of what the motion does not show."""
    warnings, J = [], values.get(INERTIA, problem.fixed.get(INERTIA))
    for d, lugre in sets_of(problem, values).items():
        if not is_passive(lugre) and not {ParameterName(n, d) for n in ("alpha_1", "sigma_1")} & unseen.keys():
            warnings.append(not_passive(lugre, d))
        if bends_down(lugre):
            warnings.append(curve_held(getattr(lugre, FASTEST)))
        if J and J > 0 and not {ParameterName(n, d) for n in ("sigma_0", "sigma_1")} & unseen.keys():
            ratio = (lugre.sigma_1 + lugre.alpha_2) / (2 * sqrt(J * lugre.sigma_0))
            if not 0.02 < ratio < 5:
                message = f"The damping ratio in presliding{in_direction(d)} would be {ratio:.2g}; 0.1 to 1 is usual."
                warnings.append(Finding("odd-damping", CAUTION, message, {"direction": d, "ratio": ratio}))
    return warnings
