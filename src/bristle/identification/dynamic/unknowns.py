"""The descent over the scaled unknowns of moving data, from one start.

alpha_0, v_s and sigma_0 stand as logarithms, the others over a typical size.
"""

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace

import numpy as np

from bristle.arrays import Array
from bristle.errors import InputError
from bristle.estimation.multistart import MultistartSolution
from bristle.estimation.nonlinear import Evaluate, LeastSquares, Minimum, Unknowns, descend, minimise
from bristle.identification.dynamic.problem import (
    DynamicProblem,
    InitialState,
    Unknown,
    Values,
    modelled,
    parameters,
    residuals,
)
from bristle.model.parameters import INERTIA, Lugre, ParameterName, least_of, of_load
from bristle.model.rollout import rollout

FEWEST = 2  # equations for each unknown, at the least: fewer estimate nothing
LOGARITHMIC = ("alpha_0", "v_s", "sigma_0")  # what the descent sees as its logarithm
_LARGE = 50_000  # samples from which a descent begins on a few of them
_EVERY = 8  # those few are every 8th, ...
_ROUGH = 10.0  # ... with nodes this many times farther apart, ...
_NEAR = 0.1  # ... and end within about a third of their own standard errors
_POLISH = 25  # steps, each with some evaluations in which windows settle
_MORE = 200  # steps more of a predicted torque, where the lowest of its ends ran out of them
_RISES = 0.1  # of a load, that friction rises by: a typical size
_MOST = 10.0  # of the largest torque: alpha_1 at most


def fit(
    problem: DynamicProblem, start: Values, most: int = 60, enough: float = 0.0
) -> tuple[dict[Unknown, float], Minimum]:
    """The parameters of least squares near a start, by name, and the minimum over the scaled unknowns; `enough` and InputError as of `minimise`."""
    posed, minimum = solved(problem, start, most, enough=enough)
    return posed.unknowns.values(minimum.x), minimum


def solved(
    problem: DynamicProblem, start: Values, most: int, lowest: float = np.inf, enough: float = 0.0
) -> tuple[LeastSquares[Unknown], Minimum]:
    """The least-squares problem about a start, and its minimum near there; `lowest` and `enough` as in `minimise`."""
    posed = least_squares(problem, start)
    unknowns = posed.unknowns
    begin, bounds = unknowns.scaled(start), (unknowns.lower, unknowns.upper)
    few, between = thinned(problem), thinned(problem, _EVERY // 2)
    if few is not problem:
        # a quick descent over a few of many samples, if samples between those like its end better than the start
        with suppress(InputError):
            rough = unknowns.values(minimise(_evaluation(few, unknowns), begin, *bounds, most, _NEAR).x)
            left = [np.sum((between.measured - np.concatenate(modelled(between, x))) ** 2) for x in (rough, start)]
            begin = unknowns.scaled(rough) if left[0] <= left[1] else begin
    return posed, minimise(posed.evaluate, begin, *bounds, most, lowest=lowest, enough=enough)


def thinned(problem: DynamicProblem, first: int = 0) -> DynamicProblem:
    """A predicted torque at every 8th of many samples, from that one on, unsmoothed; else the problem as it is."""
    if problem.quantity != "torque" or sum(m.time.size for m in problem.motions) < _LARGE:
        return problem
    names, at = ("time", "velocity", "torque", "extra", "measured"), slice(first, None, _EVERY)
    few = ({name: getattr(m, name)[at] for name in names} | {"load": m.load and m.load.at(at)} for m in problem.motions)
    pairs = zip(problem.motions, few, strict=True)
    return replace(problem, motions=tuple(replace(m, smooth=None, coarsening=_ROUGH, **own) for m, own in pairs))


def polished(
    problem: DynamicProblem, posed: LeastSquares[Unknown], minimum: Minimum
) -> tuple[LeastSquares[Unknown], Minimum]:
    """A minimum that ran out of steps, brought to its end, of simulated positions by windows that settle by themselves, where that is lower."""
    if minimum.converged or minimum.residuals.size < FEWEST * minimum.x.size:
        return posed, minimum
    values = posed.unknowns.values(minimum.x)
    near = least_squares(problem, values)
    start, lower, upper = near.unknowns.scaled(values), near.unknowns.lower, near.unknowns.upper
    by_torque = problem.quantity == "torque"
    better = minimise(near.evaluate, start, lower, upper, _MORE) if by_torque else descend(near, start, _POLISH)
    if better.cost > minimum.cost:
        return posed, minimum
    return near, better._replace(steps=minimum.steps + better.steps)


def unknowns_of(problem: DynamicProblem, at: Values) -> Unknowns[Unknown]:
    """The free parameters and what each motion begins with: typical sizes from the data, of z0 from the values `at`.

    And bounds. What stands as a logarithm lies in the range that a motion can show. None shows a v_s below 1e-4 of its
    fastest speed, nor one so near to it that the term is a bend over all speeds; nor a bristle that bends by more than
    ten times the travel or less than a billionth of it; nor an alpha_1 far above every torque, which would have held
    the joint. z0 lies within twice the typical deflection.
    """
    torque, speed = max(float(np.abs(m.torque).max()) for m in problem.motions), problem.fastest
    travel = problem.travel or speed
    known: Values = {**problem.fixed, **at}
    alpha_0, sigma_0 = ([x for n, x in known.items() if n.name == name] for name in ("alpha_0", "sigma_0"))
    damping, position = torque / speed, max(float(np.ptp(m.measured)) for m in problem.motions) or 1.0
    columns = np.array([np.abs(m.extra).max(axis=0) for m in problem.motions]).max(axis=0)
    table = {  # typical size, and bounds of the scaled unknown
        "alpha_0": (1.0, *np.log([1e-6 * torque, 1e3 * torque])),
        "alpha_1": (torque, 0.0, _MOST),
        "alpha_2": (damping, 0.0, np.inf),
        "v_s": (1.0, *np.log([1e-4 * speed, speed / problem.law.peak.reach])),
        "sigma_0": (1.0, *np.log([1e-1 * torque / travel, 1e9 * torque / travel])),
        "sigma_1": (damping, 0.0, np.inf),
        **dict.fromkeys(problem.law.coefficients, (torque / speed**2, -np.inf, np.inf)),
        "z0": (max(alpha_0) / min(sigma_0), -2.0, 2.0),
        "v0": (speed, -np.inf, np.inf),
        "y0": (position, -np.inf, np.inf),
    }
    table |= {
        n.name: (torque / (top or 1.0), -np.inf, np.inf) for n, top in zip(problem.extra_names, columns, strict=True)
    }
    table |= {
        n.name: (_RISES / (torque if n.name == "gear_load_squared" else 1.0), 0.0, np.inf)
        for n in problem.extra_names
        if of_load(n.name)
    }
    bare = [name.name for name in problem.names]
    scale, lower, upper = np.array([table[name] for name in bare]).T
    return Unknowns(
        names=problem.names,
        logarithmic=np.isin(bare, LOGARITHMIC),
        scale=scale,
        lower=lower,
        upper=upper,
        least=np.array([-np.inf if name == INERTIA.name else least_of(name) for name in bare]),
    )


def least_squares(problem: DynamicProblem, at: Values) -> LeastSquares[Unknown]:
    """The problem over its scaled unknowns about some values; the rows of priors come last."""
    unknowns = unknowns_of(problem, at)
    return LeastSquares(
        unknowns=unknowns,
        evaluate=_evaluation(problem, unknowns),
        blocks=problem.blocks,
        independent=problem.quantity == "position",
        starts=problem.starts,
        priors=sum(len(prior.names) for prior in problem.priors),
        sigma=problem.sigma,
    )


def _evaluation(problem: DynamicProblem, unknowns: Unknowns[Unknown]) -> Evaluate:
    """The residuals, priors included, and their Jacobian as functions of the scaled unknowns."""
    weight = problem.weight if any(m.weight != 1 for m in problem.motions) else None

    def evaluate(x: Array) -> tuple[Array, Array]:
        """Residuals, (n,), and Jacobian, (n, p), at scaled unknowns, (p,); a single infinite residual where they overflow."""
        with np.errstate(over="ignore", invalid="ignore"):
            natural = unknowns.natural(x)
            if not np.isfinite(natural).all() or (natural[unknowns.logarithmic] <= 0).any():
                return np.full(1, np.inf), np.zeros((1, x.size))
            chain = unknowns.slopes(x)
            rows, slopes = residuals(problem, unknowns.values(x), chain)
            if not np.isfinite(slopes.sum()):
                return np.full(1, np.inf), np.zeros((1, x.size))
        if weight is not None:
            rows, slopes = rows * weight, slopes * weight[:, None]
        for prior in problem.priors:
            columns = [problem.names.index(name) for name in prior.names]
            slope = np.zeros((len(columns), x.size))
            slope[:, columns] = problem.sigma * prior.root * chain[columns]
            rows = np.append(rows, problem.sigma * (prior.root @ (natural[columns] - prior.value)))
            slopes = np.vstack([slopes, slope])
        return rows, slopes

    return evaluate


def logarithms(names: Iterable[ParameterName]) -> set[ParameterName]:
    """Those that the descent sees as their logarithm."""
    return {name for name in names if name.name in LOGARITHMIC}


def equations_left(problem: DynamicProblem, solution: MultistartSolution[Unknown]) -> Array:
    """Measured less modelled of every equation at the minimum, without its run's weight, N*m or rad, (n,)."""
    weight = problem.weight
    rows: Array = solution.minimum.residuals[: weight.size] / weight
    return rows


def with_deflections(problem: DynamicProblem, start: Values) -> dict[Unknown, float]:
    """A start with what each motion begins with.

    The deflection that carries its first torque, within the steady one, and the first position. Where a motion goes on
    from the one before, the deflection is that to which the estimated velocity has brought it.
    """
    p = parameters(problem, start)
    out, end = dict(start), 0.0
    for k, m in enumerate(problem.motions):
        acting = p if isinstance(p, Lugre) else p[int(m.torque[0] < 0)]
        most = acting.alpha_0 / acting.sigma_0
        z0 = float(np.clip(m.torque[: max(m.torque.size // 100, 1)].mean() / acting.sigma_0, -most, most))
        if m.continues_previous:
            z0 = end
        end = float(rollout(m.velocity, m.step, p, z0).z[-1]) if problem.quantity == "position" else z0
        first = {"y0": float(m.measured[0]), "v0": float(m.velocity[0]), "z0": z0}
        out |= {InitialState(name, k): first[name] for name in problem.initial_states}
    return out


def without_deflections(values: Values) -> dict[ParameterName, float]:
    """The values without the deflections at the start of each segment."""
    return {name: value for name, value in values.items() if isinstance(name, ParameterName)}
