"""The fit of moving data from several starts: one from the other stages, others at random, and those that an end suggests."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from bristle.errors import InputError
from bristle.estimation.multistart import SAME, MultistartSolution, solve_from_starts
from bristle.identification.dynamic.left_out_peak import asked_peak
from bristle.identification.dynamic.problem import DynamicProblem, Unknown, Values
from bristle.identification.dynamic.unknowns import polished, solved, with_deflections, without_deflections
from bristle.model.parameters import SIGNED, ParameterName, of_friction
from bristle.progress import Progress

_APART = {"sigma_0": 10.0, "sigma_1": 10.0, "v_s": 6.0}
"""How far random starts lie from the first one, as a factor either way; 3 for the other parameters."""
_WINDOWS = 2  # of a simulated position, for the jackknife over them
_WORTH = 0.1
"""A Stribeck term that noise alone would ask for less often than this is worth a start."""


def solve_dynamic(
    problem: DynamicProblem,
    start: Values,
    starts: int,
    seed: int,
    others: Sequence[Values] = (),
    progress: Progress | None = None,
) -> MultistartSolution[Unknown]:
    """The lowest minimum from several starts, and the covariance there.

    Where no more than half of several starts reached it, each direction's set there is tried for both: starts that are
    drawn for both at once may each find one of them. Where a direction has no Stribeck term there and the residuals ask
    for one, it is given the one that they ask for: without it its v_s, and so its alpha_1, has no slope to follow.

    Raises InputError where there is one window alone, whose error no other one tells.
    """
    if problem.quantity == "position" and len(problem.motions) < _WINDOWS:
        raise InputError(
            f"{problem.motions[0].file}: fit.horizon: the moving runs make one window; expected at least {_WINDOWS}, which "
            "tell the errors by how they differ: set fit.horizon to at most half of a run, or measure longer"
        )
    rng = np.random.default_rng(seed)
    moved = [{name: value * _factor(name.name, rng) for name, value in start.items()} for _ in range(starts - 1)]
    first, random = with_deflections(problem, start), [with_deflections(problem, whole) for whole in moved]
    solve, finish = partial(solved, problem), partial(polished, problem)
    best = solve_from_starts(solve, (first, *others), random, finish, progress)
    if starts == 1:
        return best
    near = _peaked(problem, best) + (_mirrored(problem, best.values) if best.reached <= best.starts / 2 else [])
    while near:
        again = solve_from_starts(solve, (), near, finish, known=(best.posed, best.minimum))
        if again.minimum.cost > best.minimum.cost * (1 - SAME):
            break
        best = again._replace(starts=best.starts + len(near))
        near = _peaked(problem, best) + _mirrored(problem, best.values)
    return best


def _mirrored(problem: DynamicProblem, values: Values) -> list[dict[Unknown, float]]:
    """Values with the friction of one direction in both, for each direction where there are two."""
    known = without_deflections(values)
    sets = [{n.name: x for n, x in known.items() if n.direction == d} for d in SIGNED if d in problem.directions]
    if len(sets) < len(SIGNED):
        return []
    both = [{n: one.get(n.name, x) if n.direction in SIGNED else x for n, x in known.items()} for one in sets]
    return [with_deflections(problem, start) for start in both]


def _peaked(problem: DynamicProblem, best: MultistartSolution[Unknown]) -> list[dict[Unknown, float]]:
    """Values with the Stribeck terms that the residuals ask for, none where they ask for none."""
    added = dict[ParameterName, float]()
    for direction in problem.directions:
        alpha_1, v_s = (problem.key(name, direction) for name in ("alpha_1", "v_s"))
        without = best.values.get(alpha_1) == 0 and v_s in best.values
        if without and (asked := asked_peak(problem, best, direction, _WORTH)):
            added |= {alpha_1: asked.alpha_1, v_s: asked.v_s}
    return [with_deflections(problem, {**without_deflections(best.values), **added})] if added else []


def _factor(name: str, rng: np.random.Generator) -> float:
    reach = np.log(_APART.get(name, 3.0))
    return float(np.exp(rng.uniform(-reach, reach))) if of_friction(name) else 1.0
