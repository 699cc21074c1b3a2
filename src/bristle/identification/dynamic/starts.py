"""The fit of moving data from several starts: one from the other stages, softnesses of the bristle, and those that an end suggests."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np

from bristle.errors import InputError
from bristle.estimation.multistart import SAME, MultistartSolution, solve_from_starts
from bristle.identification.dynamic.claims import asked_peak
from bristle.identification.dynamic.problem import DynamicProblem, Unknown, Values
from bristle.identification.dynamic.unknowns import (
    fit,
    polished,
    solved,
    thinned,
    with_deflections,
    without_deflections,
)
from bristle.identification.moving_runs import DIRECTIONS
from bristle.model.parameters import SIGNED, Direction, ParameterName, in_direction
from bristle.progress import Progress

_RUNGS, _STEPS = 8, 6  # deflections of the bristle that are tried, and steps of a descent at each
_LOST = 10.0  # times the lowest cost, from which no descent begins
_OFFSET = ParameterName("offset", Direction.SHARED)
_WINDOWS = 2  # of a simulated position, for the jackknife over them
_WORTH = 0.1  # a Stribeck term that noise alone would ask for less often than this is worth a start


def solve_dynamic(
    problem: DynamicProblem,
    start: Values,
    others: Sequence[Values] = (),
    progress: Progress | None = None,
    *,
    search: bool = True,
) -> MultistartSolution[Unknown]:
    """The lowest minimum from `others` and from a start, and the covariance there.

    With `search` from softnesses of the bristle as well. Of two directions that each have their friction, one set for both is
    searched for first, about an offset: it has half the unknowns, and where it ends is a start for the two. Where a direction
    has no Stribeck term in the end, or one within its error, and the residuals ask for one, it is given the one that they ask
    for: without it its v_s, and so its alpha_1, has no slope to follow.

    Raises InputError where there is one window alone, whose error no other one tells.
    """
    if problem.quantity == "position" and len(problem.motions) < _WINDOWS:
        raise InputError(
            f"{problem.motions[0].file}: fit.predict: the moving runs make one window; expected at least {_WINDOWS}, which "
            "tell the errors by how they differ: measure longer"
        )
    begins = [*others, with_deflections(problem, start)]
    if search and problem.quantity == "torque" and len(problem.directions) == len(SIGNED):
        one = _of_both(problem)
        found = solve_dynamic(one, carried(one, {**problem.fixed, **start}), progress=progress)
        both = carried(problem, {**one.fixed, **without_deflections(found.values)})
        begins.append(with_deflections(problem, {name: x for name, x in both.items() if name not in problem.fixed}))
    elif search and problem.quantity == "torque":
        begins += _by_softness(problem, start)
    solve, finish = partial(solved, problem), partial(polished, problem)
    best = solve_from_starts(solve, begins, finish, progress)
    while search:
        added = dict[Unknown, float]()  # the Stribeck terms that the residuals ask for
        errors = dict(zip(best.names, (best.scaled_errors * best.posed.unknowns.scale).tolist(), strict=True))
        for direction in problem.directions:
            alpha_1, v_s = (ParameterName(name, direction) for name in ("alpha_1", "v_s"))
            none = {alpha_1, v_s} <= best.values.keys() and best.values[alpha_1] <= errors[alpha_1]
            if none and (asked := asked_peak(problem, best, direction, _WORTH)):
                added |= {alpha_1: asked.alpha_1, v_s: asked.v_s}
        if not added:
            break
        peaked = with_deflections(problem, {**without_deflections(best.values), **added})
        again = solve_from_starts(solve, [peaked], finish, known=(best.posed, best.minimum))
        if again.minimum.cost > best.minimum.cost * (1 - SAME):
            break
        best = again._replace(starts=best.starts + 1)
    return best


def _by_softness(problem: DynamicProblem, start: Values) -> list[Values]:
    """Starts at the deflections of the bristle that leave less than those beside them do, from a count to a third of the travel.

    Each is held while all else descends a little, from where the stiffer one before ended: over sigma_0 the cost has many
    minima, and a descent finds the next.
    """
    few = thinned(problem)
    sigma_0 = [n for n in few.friction_names if n.name == "sigma_0" and n not in few.fixed and n not in few.with_prior]
    if not sigma_0:
        return []
    softest = few.travel / 3
    way = float(np.median(np.concatenate([np.abs(m.velocity[1:]) * m.step for m in problem.motions])))
    at, ends, costs = dict(start), list[Values](), [np.inf]
    for reach in np.geomspace(max(few.count, way / 3, 1e-6 * softest), softest, _RUNGS).tolist():
        known = {**few.fixed, **at}
        held = {n: 0.0 for n in at if n.name == "sigma_1"}
        held |= {n: (known[n._replace(name="alpha_0")] + known[n._replace(name="alpha_1")]) / reach for n in sigma_0}
        rung = replace(few, fixed={**few.fixed, **held})
        with suppress(InputError):
            found, minimum = fit(rung, with_deflections(rung, {n: x for n, x in at.items() if n not in held}), _STEPS)
            if minimum.cost < _LOST * min(costs):
                at |= without_deflections(found)
            ends.append(with_deflections(problem, at | without_deflections(found) | held))
            costs.append(minimum.cost)
    costs.append(np.inf)
    return [end for k, end in enumerate(ends, 1) if costs[k] == min(costs[k - 1 : k + 2])]


def _of_both(problem: DynamicProblem) -> DynamicProblem:
    """The problem with one set of friction for both directions, about an offset, of which nothing but itself is told."""
    motions, names = problem.motions, problem.extra_names
    if _OFFSET not in names:
        motions = tuple(replace(m, extra=np.column_stack([m.extra, np.ones(m.time.size)])) for m in motions)
        names = (*names, _OFFSET)
    one = replace(problem, motions=motions, extra_names=names, directions=(Direction.BOTH,), priors=(), fixed={})
    both = {
        n
        for n in problem.fixed
        if n.direction not in SIGNED or {n._replace(direction=d) for d in SIGNED} <= problem.fixed.keys()
    }
    known = carried(one, {n: problem.fixed[n] for n in both})
    return replace(one, fixed={n: x for n, x in known.items() if n.name in {m.name for m in both}})


def carried(problem: DynamicProblem, known: Mapping[ParameterName, float]) -> dict[ParameterName, float]:
    """Values of one problem by the names of another: one set for both directions, or the mean of two; 0 for what is not known.

    The mean is geometric where both are positive.
    An offset and half the difference of the two Coulomb terms are the same thing, and become one another.
    """

    def value(name: str, direction: Direction) -> float:
        """Its own, or of both directions, or between those of each."""
        own = in_direction(known, name, direction)
        each = [x for d in SIGNED if (x := known.get(ParameterName(name, d))) is not None]
        if own is not None or not each:
            return own or 0.0
        return float(np.prod(each)) ** (1 / len(each)) if min(each) > 0 else float(np.mean(each))

    out = {name: value(*name) for name in (*problem.friction_names, *problem.extra_names)}
    Coulomb = [ParameterName("alpha_0", d) for d in SIGNED]
    if _OFFSET in problem.extra_names and Coulomb[0] in known and _OFFSET not in known:
        out[_OFFSET] = (known[Coulomb[0]] - known[Coulomb[1]]) / 2
    for name, sign in zip(Coulomb, DIRECTIONS.values(), strict=True):
        both = known.get(name._replace(direction=Direction.BOTH))
        if name in out and name not in known and both is not None:
            out[name] = max(out[name] + sign * known.get(_OFFSET, 0.0), 1e-3 * both)
    return out
