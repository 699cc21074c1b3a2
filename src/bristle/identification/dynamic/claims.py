"""What moving data can claim.

The Stribeck term where it is significant; sigma_0 and sigma_1 where presliding is resolved, without which they are
numbers, and not the bristle's. And which parameters take up a Stribeck term that was left out.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import groupby, pairwise
from typing import NamedTuple

import numpy as np
from scipy.special import fdtrc

from bristle.arrays import Array
from bristle.estimation import levels
from bristle.estimation.multistart import MultistartSolution
from bristle.estimation.nonlinear import Private
from bristle.estimation.score_test import moved_by, scores
from bristle.findings import NOTE, Finding, unit_of
from bristle.identification.dynamic.problem import DynamicProblem, Unknown, Values, residuals
from bristle.identification.fits import Estimate
from bristle.identification.shared_findings import NOT_IDENTIFIABLE, UNRESOLVED
from bristle.model.parameters import Direction, ParameterName, peak_parameters

_SPEEDS = 8  # values of v_s at which a left-out term is looked for, ...
_SLOWEST = 1e-2  # ... from this share of the fastest speed on
BRISTLE = ("sigma_0", "sigma_1")
_COMPANION = {"v_s": "alpha_1", "sigma_1": "sigma_0"}  # what means nothing without another parameter, and without which


def peak_doubts(problem: DynamicProblem, solution: MultistartSolution[Unknown]) -> dict[ParameterName, Finding]:
    """Why an alpha_1 is not identifiable, by name: an F test of its term at 1 %, to first order; one with a prior stands.

    Without the term v_s means nothing, so that the cost at alpha_1 = 0 is that along alpha_1 with v_s held.
    """
    order = {name: k for k, name in enumerate(solution.names)}
    doubts: dict[ParameterName, Finding] = {}
    for direction in problem.directions:
        alpha_1, v_s = (ParameterName(name, direction) for name in ("alpha_1", "v_s"))
        if alpha_1 not in order or v_s not in order or alpha_1 in problem.with_prior:
            continue
        a, b = order[alpha_1], order[v_s]
        C = solution.covariance
        held = float(C[a, a] - (C[a, b] ** 2 / C[b, b] if C[b, b] > 0 else 0.0))
        p = float(fdtrc(2, solution.freedom, solution.values[alpha_1] ** 2 / (2 * held))) if held > 0 else 1.0
        if not p < levels.SIGNIFICANCE:
            message = (
                "Not identifiable from this motion: noise alone would look as much like a Stribeck peak in "
                f"{100 * p:.0f} % of cases."
            )
            no_sign = Finding("unseen-no-peak", NOTE, message, {"percent": 100 * p})
            doubts[alpha_1] = Finding("unseen-peak", NOTE, message, no_sign.numbers) if p < levels.NO_SIGN else no_sign
    return doubts


def bristle_doubts(
    problem: DynamicProblem, solution: MultistartSolution[Unknown], estimates: Mapping[ParameterName, Estimate]
) -> dict[ParameterName, Finding]:
    """Why a sigma_0 or sigma_1 is not identifiable, by name; one that has a prior of its own stands.

    The deflection g0 / sigma_0 has to be larger than an encoder count, for every sigma_0 of its interval and with no
    alpha_1 that is none itself, and to be passed in five samples after a reversal, as a median over those after which
    it is passed at all; the two halves of the record have to agree on both parameters at 1 %, to first order.
    """
    differ = _halves_differ(problem, solution)
    doubts: dict[ParameterName, Finding] = {}
    for direction in problem.directions:
        reason = _unresolved(problem, solution, direction, estimates)
        for name in (ParameterName(name, direction) for name in BRISTLE):
            why = reason or differ.get(name)
            if why is not None and name in estimates and name not in problem.with_prior:
                doubts[name] = why
    return doubts


def _unresolved(
    problem: DynamicProblem,
    solution: MultistartSolution[Unknown],
    direction: Direction,
    estimates: Mapping[ParameterName, Estimate],
) -> Finding | None:
    known: Values = {**problem.fixed, **solution.values}
    alpha_0, alpha_1, sigma_0 = (ParameterName(name, direction) for name in ("alpha_0", "alpha_1", "sigma_0"))
    peak = estimates.get(alpha_1)
    g0 = known[alpha_0] + (0.0 if peak is not None and _is_weak(peak) else known[alpha_1])
    bristle = estimates.get(sigma_0)
    ends = None if bristle is None or _is_weak(bristle) else bristle.interval
    stiffest = known[sigma_0] if ends is None else ends[1]
    least, reach, of = g0 / stiffest, g0 / known[sigma_0], unit_of("position")
    if least < problem.count:
        message = (
            f"Not identifiable from this motion: the bristle would bend by {reach:.2g}{of}, and may bend by as little as "
            f"{least:.2g}{of}, which is less than an encoder count of {problem.count:.2g}{of}; a finer encoder would show it."
        )
        numbers = {"reach": reach, "least": least, "count": problem.count}
        return Finding("unseen-below-count", NOTE, message, numbers)
    passed = [samples for side, samples in _passes(problem, reach) if direction in {Direction.BOTH, side}]
    if not passed:
        message = (
            f"Not identifiable from this motion: no reversal is followed by the travel of {reach:.2g}{of} by which the "
            "bristle would bend; move back and forth."
        )
        return Finding("unseen-no-reversal", NOTE, message, {"reach": reach})
    samples = float(np.median(passed))
    message = (
        f"Not identifiable from this motion: reversals pass the bristle's deflection in {samples:.2g} samples, and "
        f"{levels.RESOLVED} are needed; log faster, or reverse more slowly."
    )
    too_fast = Finding("unseen-fast", NOTE, message, {"samples": samples, "least": levels.RESOLVED})
    return too_fast if samples < levels.RESOLVED else None


def warned(
    estimates: Mapping[ParameterName, Estimate], doubts: Mapping[ParameterName, Finding]
) -> dict[ParameterName, Estimate]:
    """The estimates with one more warning each where there is a doubt."""
    more = {name: replace(estimates[name], warnings=(*estimates[name].warnings, why)) for name, why in doubts.items()}
    return {**estimates, **more}


def without_weak(problem: DynamicProblem, estimates: Mapping[ParameterName, Estimate]) -> dict[ParameterName, Estimate]:
    """The estimates, of which those that the motion does not show have no value, nor what means nothing without them.

    A peak that is asked for by hand stays, if the fit converged on equations enough.
    """
    asked = {*peak_parameters(problem.law)} if problem.stribeck == "stribeck" else set[str]()
    weak = {name for name, e in estimates.items() if _is_weak(e)}
    message = (
        "Not identifiable from this motion: it means nothing without another parameter, which is not identifiable."
    )
    out, companion = dict(estimates), Finding("unseen-companion", NOTE, message)
    for name, e in estimates.items():
        alone = name._replace(name=_COMPANION.get(name.name, "")) in weak
        nothing = any(warning.code in {"unseen-unconverged", "unseen-too-few"} for warning in e.warnings)
        if nothing or (name.name not in asked and (alone or name in weak)):
            # the reason, and the interval where that is not doubted itself
            own = e.warnings if name in weak else ()
            told = companion in own or not {"unseen-bend", "unseen-shape"}.isdisjoint(w.code for w in own)
            reasons = (*own, companion) if alone and not told else own
            interval = e.interval if UNRESOLVED.isdisjoint(w.code for w in reasons) else None
            out[name] = replace(e, value=None, standard_error=None, interval=interval, warnings=reasons)
    return out


def _is_weak(e: Estimate) -> bool:
    return any(warning.code in NOT_IDENTIFIABLE for warning in e.warnings)


def _passes(problem: DynamicProblem, reach: float) -> Iterator[tuple[Direction, int]]:
    """After each reversal the new direction, and in how many samples of known torque the joint has moved by `reach` from there, if it does."""
    for m in problem.motions:
        velocity, known = m.velocity, np.ones(m.time.size) if m.smooth is None else abs(m.smooth).sum(axis=0) > 0
        way = np.concatenate([[0.0], np.cumsum((velocity[1:] + velocity[:-1]) / 2 * m.step)])
        turns = np.flatnonzero(np.diff(np.sign(velocity))) + 1
        for first, last in pairwise([*turns, velocity.size]):
            far = np.abs(way[first:last] - way[first]) >= reach
            if far.any():
                yield (
                    Direction("+" if velocity[first:last].mean() > 0 else "-"),
                    int(np.count_nonzero(known[first : first + np.argmax(far)])),
                )


def _halves_differ(problem: DynamicProblem, solution: MultistartSolution[Unknown]) -> dict[ParameterName, Finding]:
    """The bristle's parameters in which the halves of all runs differ, all else free in each (of whole runs: `repeats`)."""
    seen = np.flatnonzero(solution.scaled_errors < np.inf).tolist()
    J, left, private = jacobian_and_residuals(problem, solution)
    J = J / np.maximum(np.abs(J).max(axis=0), 1e-300)  # the same in any unit
    looked_at = {name: k for k, at in enumerate(seen) if (name := solution.names[at]).name in BRISTLE}
    sizes = [sum(m.size for m in run) for _, run in groupby(problem.motions, key=lambda m: m.file)]
    second = np.concatenate([np.sign(size // 2 - np.arange(size) - 0.5) for size in sizes])
    differs = private.off(J * second[:, None])
    doubts = dict[ParameterName, Finding]()
    for name, k in looked_at.items():
        known = np.hstack([J, np.delete(differs, k, axis=1)])
        (found,) = scores(known, left, [differs[:, [k]]], solution.widening**2)
        if isinstance(name, ParameterName) and found.p * len(looked_at) < levels.SIGNIFICANCE:
            apart = float(abs(found.sizes[0]) / found.errors[0])
            message = (
                f"Not identifiable from this motion: the halves of the record differ by {apart:.1f} standard errors; slow loading "
                "from rest (experiment: presliding) would show it."
            )
            doubts[name] = Finding("unseen-halves", NOTE, message, {"apart": apart})
    return doubts


def jacobian_and_residuals(
    problem: DynamicProblem, solution: MultistartSolution[Unknown]
) -> tuple[Array, Array, Private]:
    """Derivatives of the equations by the parameters with an influence, (n, p), residuals, (n,), and deflections'."""
    n, minimum = problem.size, solution.minimum
    private = minimum.private._replace(column=minimum.private.column[:n])
    return minimum.jacobian[:n, solution.scaled_errors < np.inf], minimum.residuals[:n], private


class AskedPeak(NamedTuple):
    """A Stribeck term that the residuals of a minimum without it ask for, to first order in alpha_1."""

    alpha_1: float
    """N*m, or the joint's unit of torque."""
    v_s: float
    """rad/s, or the joint's unit of velocity."""
    moved: Mapping[Unknown, float]
    """By how much each unknown, scaled, would move with it."""


def asked_peak(
    problem: DynamicProblem, solution: MultistartSolution[Unknown], direction: Direction, chance: float
) -> AskedPeak | None:
    """The Stribeck term of a direction that the residuals of a minimum without it ask for; None where they ask for none.

    At the v_s that they like best; a t test of alpha_1 to first order, Bonferroni over the values of v_s, which finds a
    term where there is none with this chance at most.
    """
    alpha_1, v_s = (ParameterName(name, direction) for name in ("alpha_1", "v_s"))
    seen = [k for k, n in enumerate(solution.names) if solution.scaled_errors[k] < np.inf and n not in (alpha_1, v_s)]
    known, rest = solution.minimum.jacobian[:, seen], solution.minimum.residuals
    # the derivative of the residuals by an alpha_1 at zero, at some values of v_s
    fixed = {name: value for name, value in problem.fixed.items() if name != alpha_1}
    values, weight = {n: x for n, x in solution.values.items() if n != v_s} | {alpha_1: 0.0}, problem.weight
    speeds = np.geomspace(_SLOWEST, 1 / problem.law.peak.reach, _SPEEDS) * problem.fastest
    columns, problem = np.zeros((rest.size, _SPEEDS)), problem.rough()
    for k, speed in enumerate(speeds.tolist()):
        posed = replace(problem, fixed={**fixed, v_s: speed}, priors=())
        columns[: weight.size, k] = weight * residuals(posed, values)[1][:, posed.names.index(alpha_1)]
    columns = solution.minimum.private.off(columns)
    found = scores(known, rest, list(-columns.T[:, :, None]))
    best = int(np.argmax([x.sizes[0] / max(x.errors[0], 1e-300) for x in found]))
    size = float(found[best].sizes[0])
    if not (size > 0 and _SPEEDS * found[best].p / 2 < chance):
        return None
    moved = moved_by(known, -size * columns[:, best])
    by_name = dict(zip([solution.names[k] for k in seen], moved.tolist(), strict=True))
    return AskedPeak(size, float(speeds[best]), by_name)
