"""Which parameters of a fit of moving runs take up a Stribeck term that was left out of it."""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from bristle.estimation.levels import RARE
from bristle.estimation.multistart import MultistartSolution
from bristle.estimation.score_test import moved_by, scores
from bristle.identification.dynamic.problem import DynamicProblem, Unknown, residuals
from bristle.model.parameters import Direction, ParameterName

_SPEEDS = 8  # values of v_s at which the term is looked for, from this share of the fastest speed on
_SLOWEST = 1e-2


class AskedPeak(NamedTuple):
    """A Stribeck term that the residuals of a minimum without it ask for, to first order in alpha_1."""

    alpha_1: float
    """N*m, or the joint's unit of torque."""
    v_s: float
    """rad/s, or the joint's unit of velocity."""
    moved: Mapping[Unknown, float]
    """By how much each unknown, scaled, would move with it."""


def beside_a_peak(problem: DynamicProblem, solution: MultistartSolution[Unknown]) -> list[ParameterName]:
    """alpha_0 and alpha_2 of a direction without a Stribeck term that the residuals ask for, moved by it by more than a standard error."""
    errors = dict(zip(solution.names, solution.scaled_errors.tolist(), strict=True))
    names = list[ParameterName]()
    for direction in problem.directions:
        without = problem.fixed.get(ParameterName("alpha_1", direction)) == 0
        asked = asked_peak(problem, solution, direction) if without else None
        moved = {} if asked is None else asked.moved
        mine = (ParameterName(name, direction) for name in ("alpha_0", "alpha_2"))
        names += [name for name in mine if abs(moved.get(name, 0.0)) > errors.get(name, np.inf)]
    return names


def asked_peak(
    problem: DynamicProblem, solution: MultistartSolution[Unknown], direction: Direction, chance: float = RARE
) -> AskedPeak | None:
    """The Stribeck term of a direction that the residuals of a minimum without it ask for; None where they ask for none.

    At the v_s that they like best; a t test of alpha_1 to first order, Bonferroni over the values of v_s, which finds a
    term where there is none with this chance at most. Of a predicted torque alone.
    """
    if problem.quantity != "torque":
        return None
    alpha_1, v_s = (ParameterName(name, direction) for name in ("alpha_1", "v_s"))
    seen = [k for k, n in enumerate(solution.names) if solution.scaled_errors[k] < np.inf and n not in (alpha_1, v_s)]
    known, rest = solution.minimum.jacobian[:, seen], solution.minimum.residuals
    # the derivative of the residuals by an alpha_1 at zero, at some values of v_s
    fixed = {name: value for name, value in problem.fixed.items() if name != alpha_1}
    values = {name: value for name, value in solution.values.items() if name != v_s} | {alpha_1: 0.0}
    weight = problem.weight
    speeds = np.geomspace(_SLOWEST, 1 / problem.law.peak.reach, _SPEEDS) * problem.fastest
    columns = np.zeros((rest.size, _SPEEDS))
    for k, speed in enumerate(speeds.tolist()):
        posed = replace(problem, fixed={**fixed, v_s: speed}, priors=())
        columns[: weight.size, k] = weight * residuals(posed, values)[1][:, posed.names.index(alpha_1)]
    found = scores(known, rest, list(-columns.T[:, :, None]))
    best = int(np.argmax([x.sizes[0] / max(x.errors[0], 1e-300) for x in found]))
    size = float(found[best].sizes[0])
    if not (size > 0 and _SPEEDS * found[best].p / 2 < chance):
        return None
    moved = moved_by(known, -size * columns[:, best])
    return AskedPeak(
        size, float(speeds[best]), dict(zip([solution.names[k] for k in seen], moved.tolist(), strict=True))
    )
