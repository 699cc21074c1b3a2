"""Which Stribeck terms are left out of a fit of moving runs, and which parameters take one up that was."""

from dataclasses import replace

import numpy as np
from scipy.special import stdtr

from bristle.arrays import Array
from bristle.diagnostics import Kind
from bristle.estimation.autocorrelation import inflation
from bristle.estimation.linear import inverse_gram
from bristle.estimation.multistart import MultistartSolution
from bristle.identification.dynamic.claims import WIDE, peak_doubts
from bristle.identification.dynamic.problem import DynamicProblem, Unknown, residuals
from bristle.model.parameters import STRIBECK_REACH, Direction, ParameterName

_SPEEDS = 8
"""Values of v_s at which the term is looked for, from this share of the fastest speed on."""
_SLOWEST = 1e-2
_CHANCE = 1e-3
"""A term is found where there is none at most this often."""


def absent_peaks(problem: DynamicProblem, solution: MultistartSolution[Unknown]) -> dict[ParameterName, float]:
    """Stribeck terms of which there is no sign, and that hide the bristle of their direction: what they are fixed at.

    A term that is none is at any v_s, and one far below all speeds is like a bristle.
    """
    if problem.stribeck == "stribeck":
        return {}
    errors = dict(zip(solution.names, solution.scaled_errors.tolist(), strict=True))
    absent: dict[ParameterName, float] = {}
    for alpha_1, why in peak_doubts(problem, solution).items():
        v_s, sigma_0 = (alpha_1._replace(name=name) for name in ("v_s", "sigma_0"))
        if why.kind is Kind.UNSEEN_NO_PEAK and errors.get(sigma_0, 0.0) > WIDE and v_s in solution.values:
            absent |= {alpha_1: 0.0, v_s: solution.values[v_s]}
    return absent


def takes_up_peak(problem: DynamicProblem, solution: MultistartSolution[Unknown]) -> list[ParameterName]:
    """alpha_0 and alpha_2 of a direction without a Stribeck term that the residuals ask for, moved by it by more than a standard error.

    To first order in alpha_1, at the v_s that the residuals like best; a t test, Bonferroni over these.
    """
    names = list[ParameterName]()
    without = [d for d in problem.directions if problem.fixed.get(problem.key("alpha_1", d)) == 0]
    if problem.quantity != "torque" or not without:
        return names
    seen = np.flatnonzero(solution.scaled_errors < np.inf)
    known, rest = solution.minimum.jacobian[:, seen], solution.minimum.residuals
    inverse = inverse_gram(known)
    for direction in without:
        columns = _peaks(problem, solution, direction)
        taken = inverse @ (known.T @ columns)
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
