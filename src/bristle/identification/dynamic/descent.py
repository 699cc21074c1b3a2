"""Starts and descent of moving fits; alpha_0, v_s and sigma_0 as logarithms, others over a typical size."""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np

from bristle.arrays import Array
from bristle.errors import InputError
from bristle.estimation import levels
from bristle.estimation.multistart import SAME, MultistartSolution, solve_from_starts
from bristle.estimation.nonlinear import Evaluate, LeastSquares, Minimum, Unknowns, minimise
from bristle.identification.dynamic.claims import asked_peak
from bristle.identification.dynamic.problem import (
    DynamicProblem,
    InitialState,
    Unknown,
    Values,
    parameters,
    residuals,
    sets_of,
)
from bristle.identification.moving_runs import DIRECTIONS
from bristle.model.parameters import INERTIA, SIGNED, Direction, Lugre, ParameterName, in_direction, least_of, of_load
from bristle.progress import Progress

LOGARITHMIC = ("alpha_0", "v_s", "sigma_0")  # descended as logarithms
_MORE = 200  # additional steps for the lowest end
_RISES = 0.1  # typical rise of friction per load
_MOST = 10.0  # of the largest torque: limit of alpha_1
_RUNGS, _DESCENT = 8, 6  # deflections tried, and steps at each
_LOST = 10.0  # of the lowest cost: no descent begins above
_OFFSET = ParameterName("offset", Direction.SHARED)


def fit(
    problem: DynamicProblem, start: Values, most: int = 60, enough: float = 0.0
) -> tuple[dict[Unknown, float], Minimum]:
    """Values by name at the minimum near a start, and the minimum; `enough` and InputError as of `minimise`."""
    posed, minimum = solved(problem, start, most, enough=enough)
    return posed.unknowns.values(minimum.x), minimum


def solved(
    problem: DynamicProblem, start: Values, most: int, lowest: float = np.inf, enough: float = 0.0
) -> tuple[LeastSquares[Unknown], Minimum]:
    """The least-squares problem about a start, and its minimum; `lowest` and `enough` as in `minimise`."""
    posed = least_squares(problem, start)
    begin, lower, upper = posed.unknowns.scaled(start), posed.unknowns.lower, posed.unknowns.upper
    return posed, minimise(posed.evaluate, begin, lower, upper, most, lowest=lowest, enough=enough, blocks=posed.blocks)


def polished(
    problem: DynamicProblem, posed: LeastSquares[Unknown], minimum: Minimum
) -> tuple[LeastSquares[Unknown], Minimum]:
    """A minimum that ran out of steps, continued with scales and bounds of its own; that of a rough problem is near enough."""
    if minimum.converged or problem.is_rough or minimum.residuals.size < levels.EQUATIONS_EACH * minimum.x.size:
        return posed, minimum
    near, better = solved(problem, posed.unknowns.values(minimum.x), _MORE)
    if better.cost > minimum.cost:
        return posed, minimum
    return near, better._replace(steps=minimum.steps + better.steps)


def least_squares(problem: DynamicProblem, at: Values) -> LeastSquares[Unknown]:
    """The problem over scaled unknowns about some values, within what a motion can show; priors are the last rows."""
    torque, speed = max(float(np.abs(m.torque).max()) for m in problem.motions), problem.fastest
    travel = problem.travel or speed
    known: Values = {**problem.fixed, **at}
    alpha_0, sigma_0 = ([x for n, x in known.items() if n.name == name] for name in ("alpha_0", "sigma_0"))
    damping, reach = torque / speed, problem.law.peak.reach
    # a peak needs a speed below v_s, as on points
    slowest = max(1e-4 * speed, min(float(np.abs(m.velocity).min()) for m in problem.motions))
    columns = np.array([np.abs(m.extra).max(axis=0) for m in problem.motions]).max(axis=0)
    table = {  # typical size, and bounds of the scaled unknown
        "alpha_0": (1.0, *np.log([1e-6 * torque, 1e3 * torque])),
        "alpha_1": (torque, 0.0, _MOST),
        "alpha_2": (damping, 0.0, np.inf),
        "v_s": (1.0, *np.log([min(slowest, speed / reach), speed / reach])),
        "sigma_0": (1.0, *np.log([1e-1 * torque / travel, 1e9 * torque / travel])),
        "sigma_1": (damping, 0.0, np.inf),
        **dict.fromkeys(problem.law.coefficients, (torque / speed**2, -np.inf, np.inf)),
        "z0": (max(alpha_0) / min(sigma_0), -2.0, 2.0),
    }
    for (name, _), top in zip(problem.extra_names, columns, strict=True):
        table[name] = (torque / (top or 1.0), -np.inf, np.inf)
        if of_load(name):
            table[name] = (_RISES / (torque if name == "gear_load_squared" else 1.0), 0.0, np.inf)
    bare = [name.name for name in problem.names]
    scale, lower, upper = np.array([table[name] for name in bare]).T
    least = np.array([-np.inf if name == INERTIA.name else least_of(name) for name in bare])
    logarithmic = np.isin(bare, LOGARITHMIC)
    unknowns = Unknowns(
        names=problem.names, logarithmic=logarithmic, scale=scale, lower=lower, upper=upper, least=least
    )
    return LeastSquares(
        unknowns=unknowns, evaluate=_evaluation(problem, unknowns), starts=problem.starts, private=True,
        priors=sum(len(prior.names) for prior in problem.priors), sigma=problem.sigma,
    )  # fmt: skip  # a list of values


def _evaluation(problem: DynamicProblem, unknowns: Unknowns[Unknown]) -> Evaluate:
    """Residuals with priors, and their Jacobian, as functions of the scaled unknowns."""
    k = len(problem.names) - len(problem.motions)
    weight = problem.weight if any((m.weight != 1).any() for m in problem.motions) else None

    def evaluate(x: Array) -> tuple[Array, Array]:
        """Residuals, (n,), and Jacobian, (n, k + 1); one infinite residual on overflow."""
        with np.errstate(over="ignore", invalid="ignore"):
            natural = unknowns.natural(x)
            if not np.isfinite(natural).all() or (natural[unknowns.logarithmic] <= 0).any():
                return np.full(1, np.inf), np.zeros((1, k + 1))
            chain = unknowns.slopes(x)
            rows, slopes = residuals(problem, unknowns.values(x), chain)
            if not np.isfinite(slopes.sum()):
                return np.full(1, np.inf), np.zeros((1, k + 1))
        if weight is not None:
            rows, slopes = rows * weight, slopes * weight[:, None]
        for prior in problem.priors:
            columns = [problem.names.index(name) for name in prior.names]
            slope = np.zeros((len(columns), k + 1))
            slope[:, columns] = problem.sigma * prior.root * chain[columns]
            rows = np.append(rows, problem.sigma * (prior.root @ (natural[columns] - prior.value)))
            slopes = np.vstack([slopes, slope])
        return rows, slopes

    return evaluate


def logarithms(names: Iterable[ParameterName]) -> set[ParameterName]:
    """Names that the descent treats as logarithms."""
    return {name for name in names if name.name in LOGARITHMIC}


def equations_left(problem: DynamicProblem, solution: MultistartSolution[Unknown]) -> Array:
    """Unweighted residuals of all equations, N*m, (n,)."""
    weight = problem.weight
    return solution.minimum.residuals[: weight.size] / weight


def with_deflections(problem: DynamicProblem, start: Values) -> dict[Unknown, float]:
    """A start with initial states: the deflection that carries the first torque."""
    p, out = parameters(problem, start), dict[Unknown, float](start)
    for k, m in enumerate(problem.motions):
        acting = p if isinstance(p, Lugre) else p[int(m.torque[0] < 0)]
        most = acting.alpha_0 / acting.sigma_0
        z0 = m.torque[: max(m.torque.size // 100, 1)].mean() / acting.sigma_0
        out[InitialState("z0", k)] = float(np.clip(z0, -most, most))
    return out


def without_deflections(values: Values) -> dict[ParameterName, float]:
    """Without initial states."""
    return {name: value for name, value in values.items() if isinstance(name, ParameterName)}


def solve_dynamic(
    problem: DynamicProblem,
    start: Values,
    others: Sequence[Values] = (),
    progress: Progress | None = None,
    *,
    search: bool = True,
) -> MultistartSolution[Unknown]:
    """The lowest minimum from `others`, a start, unless it is empty, and those of a `search`."""
    first = with_deflections(problem, start) if start else None
    begins = [*others, *([] if first is None or first in others else [first])]
    if search and len(problem.directions) == len(SIGNED):
        one = _with_one_friction(problem)
        found = solve_dynamic(one, carried(one, {**problem.fixed, **start}), progress=progress)
        both = carried(problem, {**one.fixed, **without_deflections(found.values)})
        both = {name: x for name, x in both.items() if name not in problem.fixed}
        stiff = {**start, **_bristle_of(problem, {**problem.fixed, **start}, _reaches(problem)[0] / 10)}
        begins = [*others, *(with_deflections(problem, x) for x in (stiff, both))]
    elif search:
        begins += _by_softness(problem, start)
    solve, finish, stroke = partial(solved, problem), partial(polished, problem), problem.stroke

    def cost(posed: LeastSquares[Unknown], end: Minimum) -> float:
        """Of an end; a bristle that most motions never pass is a spring, and must explain most of the cost to be friction."""
        sets = sets_of(problem, posed.unknowns.values(end.x)).values()
        return end.cost * (levels.BENT if any(levels.SLID * p.alpha_0 > stroke * p.sigma_0 for p in sets) else 1.0)

    best = solve_from_starts(solve, begins, finish, progress, cost=cost)
    while search:
        added = dict[Unknown, float]()  # Stribeck terms asked for by the residuals
        errors = best.errors
        for direction in problem.directions:
            alpha_1, v_s = (ParameterName(name, direction) for name in ("alpha_1", "v_s"))
            none = {alpha_1, v_s} <= best.values.keys() and best.values[alpha_1] <= errors[alpha_1]
            if none and (asked := asked_peak(problem, best, direction, levels.START_WORTH)):
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
    """Starts at deflections from a count to a third of the travel that beat their neighbours, by short descents."""
    given = {*problem.fixed, *problem.with_prior}
    sigma_0 = [n for n in problem.friction_names if n.name == "sigma_0" and n not in given]
    if not sigma_0:
        return []
    at, ends, costs = dict(start), list[Values](), [np.inf]
    for reach in _reaches(problem):
        held = _bristle_of(problem, {**problem.fixed, **at}, reach)
        rung = replace(problem, fixed={**problem.fixed, **held})
        with suppress(InputError):
            found, minimum = fit(rung, with_deflections(rung, {n: x for n, x in at.items() if n not in held}), _DESCENT)
            if minimum.cost < _LOST * min(costs):
                at |= without_deflections(found)
            ends.append(with_deflections(problem, at | without_deflections(found) | held))
            costs.append(minimum.cost)
    costs.append(np.inf)
    return [end for k, end in enumerate(ends, 1) if costs[k] == min(costs[k - 1 : k + 2])]


def _reaches(problem: DynamicProblem) -> list[float]:
    """Deflections from a count, or a third of a typical step, to a third of the travel, ascending, rad."""
    softest = problem.travel / 3
    way = float(np.median(np.concatenate([np.abs(m.velocity[1:]) * m.step.min() for m in problem.motions])))
    return list(np.geomspace(max(problem.count, way / 3, 1e-6 * softest), softest, _RUNGS).tolist())


def _bristle_of(problem: DynamicProblem, known: Values, reach: float) -> dict[ParameterName, float]:
    """The free parameters of a bristle that is bent by g0 so far, rad, without damping."""
    free = [n for n in problem.friction_names if n not in {*problem.fixed, *problem.with_prior}]
    g0 = {n: known[n._replace(name="alpha_0")] + known[n._replace(name="alpha_1")] for n in free}
    return {n: 0.0 if n.name == "sigma_1" else g0[n] / reach for n in free if n.name in ("sigma_0", "sigma_1")}


def _with_one_friction(problem: DynamicProblem) -> DynamicProblem:
    """The problem with one friction for both directions about an offset."""
    motions, names = problem.motions, problem.extra_names
    if _OFFSET not in names:
        motions = tuple(replace(m, extra=np.column_stack([m.extra, np.ones(m.time.size)])) for m in motions)
        names = (*names, _OFFSET)
    one = replace(problem, motions=motions, extra_names=names, directions=(Direction.BOTH,), priors=(), fixed={})
    both = {
        n: x
        for n, x in problem.fixed.items()
        if n.direction not in SIGNED or {n._replace(direction=d) for d in SIGNED} <= problem.fixed.keys()
    }
    held = {n.name for n in both}
    return replace(one, fixed={n: x for n, x in carried(one, both).items() if n.name in held})


def carried(problem: DynamicProblem, known: Mapping[ParameterName, float]) -> dict[ParameterName, float]:
    """Values by the names of another problem: `both` or the mean of two; an offset is half their difference."""

    def value(name: str, direction: Direction) -> float:
        """Its own, of both directions, or the mean of both."""
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
