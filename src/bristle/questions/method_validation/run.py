"""Comparison of the grid search with other resolutions and full nonlinear fits, on SIMULATED points."""

from collections.abc import Callable, Mapping
from time import perf_counter

import numpy as np

from bristle.arrays import Array
from bristle.data.experiment.schema import FitOptions
from bristle.errors import InputError
from bristle.estimation import covariance, levels
from bristle.estimation.profile_likelihood import profile_threshold
from bristle.identification.static.batch import COARSE, Batch
from bristle.identification.static.fit import estimate_static
from bristle.identification.static.grid import PLAIN_GRID, Projected, plain_grid, solve
from bristle.identification.static.problem import log_grid
from bristle.identification.static.profiles import profiled
from bristle.identification.static.solution import is_closed
from bristle.identification.static.uncertainty import resample
from bristle.progress import Progress, teller
from bristle.questions.method_validation import results
from bristle.questions.method_validation import solvers as methods
from bristle.questions.method_validation.cases import CaseSet
from bristle.questions.method_validation.solvers import Local, ValidationCase
from bristle.simulation.bench import steady_points

SEED, REPETITIONS, STARTS = 0, 1000, 100
LOCAL_SETS = 50  # most data sets of the local solvers, which take up to a hundred times as long as a grid
INTERVAL_SETS, BOOTSTRAP_SETS, DRAWS = 200, 100, 399  # most data sets of intervals; of the bootstrap, and its draws
RESOLUTIONS = (8, 16, 32, 64, 125, 250, PLAIN_GRID, 1000, 2000)  # values of the plain grids
PLAIN_GRIDS = {values: f"plain grid of {values}" for values in RESOLUTIONS}  # their names
REFINED, POLISHED = "refined grid", "IPOPT from the grid"
_DRAWN = 300  # values of v_s over which the cost is drawn, and as many again below the threshold
_MOST = 100_000  # data sets, or starts


def check_request(repetitions: int, starts: int, noise: float | None) -> None:
    """Raise InputError where repetitions, starts or noise are out of range."""
    for name, value, least, usual in (("repetitions", repetitions, 20, REPETITIONS), ("starts", starts, 1, STARTS)):
        if not least <= value <= _MOST:
            raise InputError(f"{name}: got {value}; expected {least} to {_MOST}, usual are {usual}")
    if noise is not None and not 0 < noise <= 100:  # in which nothing is left to be seen
        raise InputError(f"noise: got {noise:g}; expected a positive share of alpha_0, as 0.02, and at most 100")


def validate(
    case_set: CaseSet,
    *,
    repetitions: int = REPETITIONS,
    starts: int = STARTS,
    seed: int = SEED,
    progress: Progress | None = None,
) -> results.Validation:
    """Validate every case: grids over all data sets, local solvers over `LOCAL_SETS`; seed of case k: (seed, k)."""
    found, tell = [], teller(progress, len(case_set.cases))
    for k, case in enumerate(case_set.cases):
        tell(f"validating {case.label}")
        found.append(validate_case(case, repetitions, starts, np.random.default_rng([seed, k])))
    return results.Validation(case_set=case_set, cases=tuple(found), repetitions=repetitions, starts=starts, seed=seed)


def validate_case(case: ValidationCase, repetitions: int, starts: int, rng: np.random.Generator) -> results.CaseResult:
    """Results of one case; arguments as in `validate`."""
    torques = np.ascontiguousarray(steady_points(case.truth, case.velocity, case.noise, rng, repetitions).T)
    few = torques[:, : min(LOCAL_SETS, repetitions)]
    local = few.shape[1]
    initial = methods.random_starts(case, local + starts, rng)
    solvers = methods.local_methods(case)

    # Theta (p, s) and seconds per data set of each method: grids on all data sets, local solvers on a few.
    answers = {REFINED: _timed(lambda: methods.refined(case, torques), repetitions)}
    grid = answers[REFINED][0]
    problem, ends = case.problem(torques[:, 0]), case.v_s_range
    answers["refined grid, batch"] = _timed(lambda: Batch(problem, torques, ends, COARSE).theta, repetitions)
    timed = torques[:, :20].T
    for values, name in PLAIN_GRIDS.items():  # all data sets at once, in the time that the paper's takes set by set
        began = perf_counter()
        for torque in timed:
            plain_grid(case.problem(torque), case.v_s_range, values)
        seconds = (perf_counter() - began) / len(timed)
        answers[name] = methods.plain(case, torques, values), seconds
    answers[POLISHED] = _each(solvers["IPOPT"], few, grid[:, :local].T)
    answers |= {f"{name}, random start": _each(fit, few, initial[:local]) for name, fit in solvers.items()}

    # Costs of each method, and the lowest cost of each data set.
    costs = {name: methods.costs(case, torques[:, : x.shape[1]], x) for name, (x, _) in answers.items()}
    lowest = np.full(repetitions, np.inf)
    for cost in costs.values():
        lowest[: cost.size] = np.fmin(lowest[: cost.size], cost)
    refused = profile_threshold(1.0, case.velocity.size, len(case.names))
    by_method = {
        name: results.MethodResult(
            name=name, repetitions=costs[name].size, bias=np.median(theta, axis=1) - case.theta, spread=spread(theta),
            failed=_share_above(costs[name], lowest, refused),
            other_minimum=None if name in PLAIN_GRIDS.values() else _share_above(costs[name], lowest, 1 + results.SAME_COST),
            seconds=seconds,
        )
        for name, (theta, seconds) in answers.items()
    }  # fmt: skip  # a list of values

    random_starts = _from_starts(case, torques[:, 0], grid[:, 0], initial[local:], solvers)
    deficits = 1 - costs["IPOPT, random start"] / methods.costs(case, few, grid[:, :local])
    steps, spreads = np.abs(answers[POLISHED][0] - grid[:, :local]).max(axis=1), by_method[REFINED].spread
    v_s = [estimate_static(case.problem(t), FitOptions(), "revolute", case.v_s_range).get("v_s") for t in few.T]
    declined = float(np.mean([x is None or x.interval is None or not is_closed(x.interval) for x in v_s]))
    return results.CaseResult(
        case=case, methods=by_method, starts=random_starts, declined=declined,
        resolution=_resolution(grid, {n: answers[name][0] for n, name in PLAIN_GRIDS.items()}),
        cost_curve=_cost_curve(case, torques[:, 0], random_starts),
        coverage=interval_coverage(case, torques, identifiable=declined <= levels.MOST_DECLINED),
        polish_shift=max(float(step / s) if s > 0 else np.inf for step, s in zip(steps, spreads, strict=True)),
        cost_deficit=float(max(deficits.max(), 1 - random_starts.cost["IPOPT"].min() / random_starts.best_cost)),
    )  # fmt: skip  # a list of values


def spread(values: Array) -> Array:
    """Half the width of the middle 68.3 % along the last axis: the standard deviation of Gaussian values."""
    low, high = np.quantile(values, [0.15865525393145707, 0.8413447460685429], axis=-1)
    return np.asarray((high - low) / 2)


def _share_above(cost: Array, lowest: Array, factor: float) -> float:
    """Share of the data sets whose cost is above `factor` times the lowest."""
    return float((~(cost <= lowest[: cost.size] * factor)).mean())


def _timed(call: Callable[[], Array], sets: int) -> tuple[Array, float]:
    """What the call returns, and its seconds per data set."""
    began = perf_counter()
    theta = call()
    return theta, (perf_counter() - began) / sets


def _each(fit: Local, torques: Array, initial: Array) -> tuple[Array, float]:
    """Estimates of a local solver, (p, s), of data sets (n, s) from starts (s, p), and its seconds per data set."""
    pairs = list(zip(torques.T, initial, strict=True))
    return _timed(lambda: np.stack([fit(torque, start) for torque, start in pairs], axis=1), len(pairs))


def _resolution(grid: Array, plain: Mapping[int, Array]) -> results.GridResolution:
    return results.GridResolution(
        counts=tuple(plain),
        error=np.array([np.sqrt(np.mean((theta[-1] - grid[-1]) ** 2)) for theta in plain.values()]),
        floor=float(spread(grid[-1])),
    )


def _from_starts(
    case: ValidationCase, torque: Array, best: Array, initial: Array, solvers: Mapping[str, Local]
) -> results.RandomStarts:
    """One data set from every start (s, p), by every local solver, and by IPOPT with v_s free."""
    torques = np.repeat(torque[:, None], len(initial), axis=1)
    fits = {**solvers, results.FREE: methods.ipopt(case, free=True)}
    final = {name: _each(fit, torques, initial)[0] for name, fit in fits.items()}
    cost = {name: methods.costs(case, torques, theta) for name, theta in final.items()}
    best_cost = float(methods.costs(case, torque[:, None], best[:, None])[0])
    return results.RandomStarts(initial_v_s=initial[:, -1], final=final, cost=cost, best=best, best_cost=best_cost)


def _cost_curve(case: ValidationCase, torque: Array, starts: results.RandomStarts) -> results.CostCurve:
    projected, coarse = Projected(case.problem(torque)), log_grid(case.v_s_range, _DRAWN)
    threshold = profile_threshold(starts.best_cost, torque.size, len(case.names))
    allowed = np.append(coarse[projected.costs(coarse) <= threshold], starts.best[-1])
    step = coarse[1] / coarse[0]
    near = np.geomspace(allowed.min() / step, min(allowed.max() * step, case.v_s_range[1]), _DRAWN)
    values = np.unique(np.concatenate([coarse, near[near > coarse[0]]]))
    plain = {n: float(methods.plain(case, torque[:, None], n)[-1, 0]) for n in PLAIN_GRIDS}
    return results.CostCurve(v_s=values, cost=projected.costs(values), threshold=threshold, plain=plain)


def interval_coverage(case: ValidationCase, torques: Array, *, identifiable: bool) -> tuple[results.Coverage, ...]:
    """Coverage of bristle's own intervals; the bootstrap only where v_s is identifiable."""
    few = np.ascontiguousarray(torques[:, :INTERVAL_SETS])
    fits = Batch(case.problem(few[:, 0]), few, case.v_s_range)
    reach = covariance.student(max(len(few) - len(case.names), 1)) * fits.errors()
    solved = [(p, solve(p, case.v_s_range)) for p in map(case.problem, few.T)]
    low, high = np.array([list(profiled(p, solution).intervals.values()) for p, solution in solved]).T
    ends = {"covariance": (fits.theta - reach, fits.theta + reach), "profile": (low, high)}
    if identifiable:
        drawn = [resample(p, solution, case.v_s_range, DRAWS) for p, solution in solved[:BOOTSTRAP_SETS]]
        ends["bootstrap-t"] = np.stack([x.low for x in drawn], axis=1), np.stack([x.high for x in drawn], axis=1)
    truth, found = case.theta[:, None], list[results.Coverage]()
    for kind, (low, high) in ends.items():
        share = ((low <= truth) & (truth <= high)).mean(axis=1)
        found.append(results.Coverage(kind=kind, repetitions=low.shape[1], share=share))
    return tuple(found)
