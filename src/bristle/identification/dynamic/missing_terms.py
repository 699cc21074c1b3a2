"""What the residuals of moving runs would like to have been otherwise.

A torque logged earlier or later, another inertia than the one given, a Stribeck term that was left out.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.special import stdtr

from bristle.arrays import Array
from bristle.diagnostics import Diagnostic, Kind
from bristle.estimation.autocorrelation import inflation
from bristle.estimation.linear import inverse_gram
from bristle.estimation.multistart import MultistartSolution
from bristle.identification.dynamic.problem import DynamicProblem, Unknown, modelled, residuals
from bristle.model.parameters import INERTIA, STRIBECK_REACH, Direction, ParameterName, unit
from bristle.model.parameters import Kind as JointKind

_SURE = 4.0
"""Standard errors from zero, beyond which it is said."""
_SHARE = 0.05
"""Of the cost, that must go with it: less is not worth a sentence."""
_SPEEDS = 8
"""Values of v_s at which a term that was left out is looked for, from this share of the fastest speed on."""
_SLOWEST = 1e-2
_CHANCE = 1e-3
"""A term is found where there is none at most this often."""


def missing_terms(problem: DynamicProblem, solution: MultistartSolution[Unknown], kind: JointKind) -> list[Diagnostic]:
    """What is doubted: a shift in time between torque and motion, and about an inertia that was given and not fitted.

    One more column beside the Jacobian's: what part of the residuals it would explain that no parameter can, to first
    order.
    """
    if problem.quantity != "torque":
        return []
    warnings, motions = [], problem.motions
    torque = modelled(problem, solution.values)
    wanted = {"delay": [-np.gradient(T, m.time) for T, m in zip(torque, motions, strict=True)]}
    if INERTIA not in problem.names:
        wanted["inertia"] = [np.gradient(m.velocity, m.time) for m in motions]
    missing = {name: more for name, more in _wanted(problem, solution, wanted).items() if more.counts}
    if more := missing.get("delay"):
        samples = abs(more.value) / float(np.median(np.concatenate([m.step for m in motions])))
        when = "earlier" if more.value > 0 else "later"
        warnings.append(
            Kind.TORQUE_DELAYED(seconds=abs(more.value), samples=samples, when=when, share=more.share, delay=more.value)
        )
    if more := missing.get("inertia"):
        warnings.append(Kind.INERTIA_DOUBTED(more=more.value, error=more.error, unit=unit("inertia", kind)))
    return warnings


class _More(NamedTuple):
    """How much of a column the residuals ask for, its standard error, and the share of the cost that goes with it."""

    value: float
    error: float
    share: float

    @property
    def counts(self) -> bool:
        """Whether it is worth a sentence."""
        return abs(self.value) > _SURE * self.error and self.share > _SHARE


def _wanted(
    problem: DynamicProblem, solution: MultistartSolution[Unknown], wanted: Mapping[str, Sequence[Array]]
) -> dict[str, _More]:
    """Each column, given per motion as (N,), beside all the others and the Jacobian's."""
    jacobian, rest = solution.minimum.jacobian, solution.minimum.residuals
    known = jacobian[:, solution.scaled_errors < np.inf]
    columns = np.zeros((rest.size, len(wanted)))
    for k, by_motion in enumerate(wanted.values()):
        rows = [m.weight * m.smoothed(c) for m, c in zip(problem.motions, by_motion, strict=True)]
        columns[: sum(r.size for r in rows), k] = np.concatenate(rows)
    beside = columns - known @ (inverse_gram(known) @ (known.T @ columns))
    weights = beside @ inverse_gram(beside)
    out = {}
    for name, weight in zip(wanted, weights.T, strict=True):
        score = weight * rest
        value, square = float(score.sum()), float(weight @ weight)
        error = float(np.sqrt(score @ score * inflation(score)))
        out[name] = _More(value, error, value**2 / square / solution.minimum.cost if square else 0.0)
    return out


def takes_up_peak(problem: DynamicProblem, solution: MultistartSolution[Unknown]) -> list[ParameterName]:
    """alpha_0 and alpha_2 of a direction without a Stribeck term that the residuals ask for, moved by it by more than a standard error.

    To first order in alpha_1, at the v_s that the residuals like best; a t test, Bonferroni over these.
    """
    names = list[ParameterName]()
    if problem.quantity != "torque":
        return names
    seen = np.flatnonzero(solution.scaled_errors < np.inf)
    known, rest = solution.minimum.jacobian[:, seen], solution.minimum.residuals
    for direction in problem.directions:
        if problem.fixed.get(problem.key("alpha_1", direction)) != 0:
            continue
        columns = _peaks(problem, solution, direction)
        taken = inverse_gram(known) @ (known.T @ columns)
        beside = columns - known @ taken
        scores = -beside / np.maximum(np.einsum("nk,nk->k", beside, beside), 1e-300) * rest[:, None]
        size = scores.sum(axis=0)
        errors = np.sqrt([float(s @ s) * inflation(s) for s in scores.T])
        best = int(np.argmax(size / np.maximum(errors, 1e-300)))
        if size[best] > 0 and _SPEEDS * stdtr(solution.freedom, -size[best] / errors[best]) < _CHANCE:
            moved = np.abs(taken[:, best] * size[best]) > solution.scaled_errors[seen]
            asked = {problem.key(name, direction) for name in ("alpha_0", "alpha_2")}
            names += [n for k, one in zip(seen, moved, strict=True) if one and (n := solution.names[int(k)]) in asked]
    return names


def _peaks(problem: DynamicProblem, solution: MultistartSolution[Unknown], direction: Direction) -> Array:
    """The derivative of the residuals by an alpha_1 of a direction at zero, 1, for each v_s, (n, k)."""
    alpha_1, v_s = (problem.key(name, direction) for name in ("alpha_1", "v_s"))
    fastest = max(float(np.abs(m.velocity).max()) for m in problem.motions)
    fixed = {name: value for name, value in problem.fixed.items() if name != alpha_1}
    weight = np.repeat([m.weight for m in problem.motions], [m.size for m in problem.motions])
    columns = np.zeros((solution.minimum.residuals.size, _SPEEDS))
    for k, speed in enumerate(np.geomspace(_SLOWEST, 1 / STRIBECK_REACH, _SPEEDS) * fastest):
        posed = replace(problem, fixed={**fixed, v_s: float(speed)}, priors=())
        _, slopes = residuals(posed, {**solution.values, alpha_1: 0.0})
        columns[: weight.size, k] = weight * slopes[:, posed.names.index(alpha_1)]
    return columns
