"""The grid method on trial: against itself at other resolutions and against full nonlinear fits, on SIMULATED points, where the truth is known.

The points are those that a user measured, their torque simulated from the fitted model with the fit's own noise; or a declared sweep: every set of
Table 1, at two noise levels and three designs. Every method gets the same data sets; local solvers begin anywhere within the grid's bounds.
"""

from collections.abc import Callable, Iterable, Mapping
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.errors import InputError
from bristle.estimation.profile_likelihood import profile_threshold
from bristle.identification.static.batch import solve_batch
from bristle.identification.static.grid import PLAIN_GRID, log_grid, plain_grid
from bristle.identification.static.projection import Projected
from bristle.progress import Progress
from bristle.questions.method_validation import solvers as methods
from bristle.questions.method_validation.cases import Subject
from bristle.questions.method_validation.intervals import coverage, covered, declined
from bristle.questions.method_validation.results import (
    BLIND,
    ENOUGH,
    FREE,
    SAME,
    Landscape,
    Method,
    Resolution,
    Starts,
    Trial,
    Tried,
)
from bristle.questions.method_validation.solvers import NAMES, Case, Local
from bristle.simulation.bench import steady_points

SEED, REPETITIONS, STARTS = 0, 1000, 100
LOCAL = 50
"""Data sets at most that the local solvers see, which take up to a hundred times as long as a grid."""
RESOLUTIONS = (8, 16, 32, 64, 125, 250, PLAIN_GRID, 1000, 2000)
"""Values of the plain grids."""
REFINED, POLISHED = "refined grid", "IPOPT from the grid"
_TIMED = 20
"""Data sets on which the time of each plain grid is taken."""
_DRAWN = 300
"""Values of v_s over which the cost is drawn, and as many again where the data allow it."""
_MIDDLE = (0.15865525393145707, 0.8413447460685429)
"""Quantiles a standard deviation off the middle of a Gaussian."""


_LOUDEST = 100.0
"""Noise of a point over alpha_0, in which nothing is left to be seen."""


def check(repetitions: int, starts: int, noise: float | None) -> None:
    """Whether a trial can be run so: raises InputError for fewer than 20 repetitions, no start, or a noise level that is not positive."""
    for name, value, least, usual in (("repetitions", repetitions, 20, REPETITIONS), ("starts", starts, 1, STARTS)):
        if value < least:
            raise InputError(f"{name}: got {value}; a trial needs at least {least}, usual are {usual}")
    if noise is not None and not 0 < noise <= _LOUDEST:
        raise InputError(
            f"noise: got {noise:g}; expected a positive share of alpha_0, as 0.02, and at most {_LOUDEST:g}"
        )


def run_trial(
    subject: Subject,
    *,
    repetitions: int = REPETITIONS,
    starts: int = STARTS,
    seed: int = SEED,
    progress: Progress | None = None,
) -> Trial:
    """Try every case: grids over `repetitions` data sets, local solvers over the first `LOCAL` of them, each from one random start.

    The first data set is fitted from `starts` random starts besides. Case k draws its noise and its starts from the seed (seed, k).
    """
    tried = []
    for k, case in enumerate(subject.cases):
        if progress:
            progress(f"trying {case.label}", k, len(subject.cases))
        rng = np.random.default_rng([seed, k])
        tried.append(try_case(case, repetitions, starts, rng))
    return Trial(subject=subject, cases=tuple(tried), repetitions=repetitions, starts=starts, seed=seed)


def try_case(case: Case, repetitions: int, starts: int, rng: np.random.Generator) -> Tried:
    """One case, tried, with noise and starts from one generator; arguments as in `run_trial`."""
    torques = np.ascontiguousarray(steady_points(case.truth, case.velocity, case.noise, rng, repetitions).T)
    local = min(LOCAL, repetitions)
    begun = methods.random_starts(case, local + starts, rng)
    solvers = methods.local_methods(case)
    grid, seconds = _timed(lambda: methods.refined(case, torques), repetitions)
    few = torques[:, :local]
    answers = {REFINED: (grid, seconds)}
    answers["refined grid, batch"] = _timed(lambda: solve_batch(case.velocity, torques, case.v_s_range)[0], repetitions)
    answers |= {f"plain grid of {n}": _plain(case, torques, n) for n in RESOLUTIONS}
    answers[POLISHED] = _each(solvers["IPOPT"], few, grid[:, :local].T)
    answers |= {f"{name}, random start": _each(fit, few, begun[:local]) for name, fit in solvers.items()}
    lowest = _lowest(case, torques, [theta for theta, _ in answers.values()])
    found = {name: _judged(case, name, torques, *answer, lowest) for name, answer in answers.items()}
    many = _from_starts(case, torques[:, 0], grid[:, 0], begun[local:], solvers)
    of_grid = methods.costs(case, few, grid[:, :local])
    lead = 1 - methods.costs(case, few, answers["IPOPT, random start"][0]) / of_grid
    share = declined(case, few)
    return Tried(
        case=case,
        methods=found,
        resolution=_resolution(case, grid, {n: answers[f"plain grid of {n}"][0] for n in RESOLUTIONS}),
        starts=many,
        landscape=_landscape(case, torques[:, 0], many),
        coverage=coverage(case, torques, blind=share > BLIND),
        declined=share,
        moved=_moved(answers[POLISHED][0] - grid[:, :local], found[REFINED].spread),
        beaten=float(max(lead.max(), 1 - many.cost["IPOPT"].min() / many.best_cost)),
        beyond=_beyond(case, many),
    )


def spread(values: Array) -> Array:
    """Half the width of the middle 68.3 % along the last axis: the standard deviation of Gaussian values."""
    low, high = np.quantile(values, _MIDDLE, axis=-1)
    half: Array = (high - low) / 2
    return half


def _moved(steps: Array, of_grid: Array) -> float:
    """The largest step, (4, s), in spreads (4,) of its parameter."""
    farthest = np.abs(steps).max(axis=1)
    return float(max(f / s if s > 0 else np.inf for f, s in zip(farthest, of_grid, strict=True)))


def _timed(call: Callable[[], Array], sets: int) -> tuple[Array, float]:
    """What it returns, and its seconds per data set."""
    began = perf_counter()
    theta = call()
    return theta, (perf_counter() - began) / sets


def _each(fit: Local, torques: Array, begun: Array) -> tuple[Array, float]:
    """A local solver over data sets (n, s), each from its own start, (s, 4)."""
    return _timed(
        lambda: np.stack([fit(t, x) for t, x in zip(torques.T, begun, strict=True)], axis=1), torques.shape[1]
    )


def _plain(case: Case, torques: Array, count: int) -> tuple[Array, float]:
    """A plain grid over all data sets, in the time that the paper's takes set by set."""
    few = torques[:, :_TIMED].T
    _, seconds = _timed(
        lambda: np.stack([plain_grid(case.problem(t), case.v_s_range, count)[2] for t in few]), len(few)
    )
    return methods.plain(case, torques, count), seconds


def _lowest(case: Case, torques: Array, thetas: Iterable[Array]) -> Array:
    """The lowest cost of each data set that any method found, (sets,); a method may have seen the first sets only."""
    lowest = np.full(torques.shape[1], np.inf)
    for theta in thetas:
        seen = theta.shape[1]
        lowest[:seen] = np.fmin(lowest[:seen], methods.costs(case, torques[:, :seen], theta))
    return lowest


def _judged(case: Case, name: str, torques: Array, theta: Array, seconds: float, lowest: Array) -> Method:
    seen = theta.shape[1]
    cost = methods.costs(case, torques[:, :seen], theta)
    n, p = case.velocity.size, len(NAMES)
    outside = ~(cost <= lowest[:seen] * profile_threshold(1.0, n, p))
    return Method(
        name=name,
        repetitions=seen,
        bias=np.median(theta, axis=1) - case.theta,
        spread=spread(theta),
        coverage=covered(case, theta, cost).mean(axis=1),
        failed=float(outside.mean()),
        elsewhere=None if name.startswith("plain") else float((~(cost <= lowest[:seen] * (1 + SAME))).mean()),
        seconds=seconds,
    )


def _resolution(case: Case, grid: Array, plain: Mapping[int, Array]) -> Resolution:
    floor = float(spread(grid[3]))
    low, high = case.v_s_range
    return Resolution(
        counts=tuple(plain),
        error=np.array([np.sqrt(np.mean((theta[3] - grid[3]) ** 2)) for theta in plain.values()]),
        floor=floor,
        predicted=1 + int(np.ceil((high - low) / (np.sqrt(12) * ENOUGH * floor))) if floor > 0 else 0,
    )


def _from_starts(case: Case, torque: Array, best: Array, begun: Array, solvers: Mapping[str, Local]) -> Starts:
    """One data set from every start (s, 4), by every local solver, and by IPOPT with v_s free."""
    torques = np.repeat(torque[:, None], len(begun), axis=1)
    ended = {
        name: _each(fit, torques, begun)[0] for name, fit in {**solvers, FREE: methods.ipopt(case, free=True)}.items()
    }
    return Starts(
        torque=torque,
        begun=begun[:, 3],
        ended=ended,
        cost={name: methods.costs(case, torques, theta) for name, theta in ended.items()},
        best=best,
        best_cost=float(methods.costs(case, torque[:, None], best[:, None])[0]),
    )


def _beyond(case: Case, many: Starts) -> NDArray[np.bool_]:
    v_s, (low, high) = many.ended[FREE][3], case.v_s_range
    lower: NDArray[np.bool_] = (many.cost[FREE] < many.best_cost * (1 - SAME)) & ((v_s < low) | (v_s > high))
    return lower


def _landscape(case: Case, torque: Array, many: Starts) -> Landscape:
    projected, coarse = Projected(case.problem(torque)), log_grid(case.v_s_range, _DRAWN)
    threshold = profile_threshold(many.best_cost, torque.size, len(NAMES))
    allowed = np.append(coarse[projected.costs(coarse) <= threshold], many.best[3])
    step = coarse[1] / coarse[0]
    near = np.geomspace(allowed.min() / step, min(allowed.max() * step, case.v_s_range[1]), _DRAWN)
    values = np.unique(np.concatenate([coarse, near[near > coarse[0]]]))
    return Landscape(
        v_s=values,
        cost=projected.costs(values),
        threshold=threshold,
        plain={n: float(methods.plain(case, torque[:, None], n)[3, 0]) for n in RESOLUTIONS},
    )
