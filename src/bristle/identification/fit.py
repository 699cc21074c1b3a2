"""From a static problem to a `StaticFit`: the grid's answer with intervals, doubts, and what stands beside it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from bristle.data.options import FitOptions
from bristle.data.statistics import inflation, residual_doubts
from bristle.identification import uncertainty
from bristle.identification.crosscheck import crosscheck
from bristle.identification.doubts import fit_doubts, huber_doubts, in_direction, is_closed
from bristle.identification.estimate import Crosscheck, Estimate, HoldOut, Outcome, Profile, StaticFit
from bristle.identification.regression import Regression
from bristle.identification.robust import huber
from bristle.identification.static import Projected, Solution, default_range, plain_grid, solve
from bristle.model.arrays import Array
from bristle.model.parameters import Kind, unit

SUPPORTED = 0.05
"""The Stribeck term is kept where noise alone would look as much like one less often than this."""
_NEAR = 40
"""Values of v_s around the minimum at which the profile is drawn."""
_FRICTION = ("alpha_0", "alpha_1", "alpha_2", "v_s")


@dataclass(frozen=True, slots=True, kw_only=True)
class Where:
    """What is known of each equation beside its velocity and torque; each array is (n,), or empty where unknown."""

    names: tuple[str, ...] = ()
    """How a user finds the point again; empty for moving data."""
    stick_slip: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=bool))
    time: Array = field(default_factory=lambda: np.zeros(0))
    position: Array = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Core:
    """A solved and judged problem."""

    problem: Regression
    solution: Solution
    parameters: Mapping[str, Estimate]
    names: tuple[str, ...]
    covariance: Array
    freedom: float
    outcome: Outcome
    doubts: tuple[str, ...]
    profiles: Mapping[str, Profile]
    dropped: Mapping[str, str]
    """Directions without a Stribeck term, with the reason."""


def fit_static(
    problem: Regression,
    options: FitOptions,
    kind: Kind,
    where: Where,
    held: Sequence[tuple[str, Regression]] = (),
    timings: dict[str, float] | None = None,
) -> tuple[dict[str, StaticFit], dict[str, Crosscheck]]:
    """Fit one static problem and everything that the report shows beside the fit.

    Args:
        problem: the equations; a peak in every direction.
        options: the experiment's `fit`.
        kind: revolute or prismatic, for units.
        where: what is known of each equation.
        held: hold-out runs by name, posed as the problem is.
        timings: where the seconds of the grid and of the full fit are written, by name.

    Returns:
        Fits and cross-checks, keyed by direction; a problem of two directions that share regressors also has the fit `shared`.
    """
    v_s_range = options.v_s_range or default_range(problem.velocity)
    too_few = _too_few(problem)
    if too_few:
        return {d: _nothing(d, problem, kind, too_few) for d in problem.directions}, {}
    core = _core(problem, options, kind, v_s_range)
    beside = _beside(problem, core, options, kind, v_s_range, where)
    errors = tuple(
        HoldOut(file=file, relative_error=replace(p, peaks=core.problem.peaks).relative_error(core.solution.theta))
        for file, p in held
    )
    fits = {d: _static_fit(core, d, where, beside, errors) for d in _parts(problem)}
    label = _parts(problem)[-1]
    started = perf_counter()
    check = solve(problem, v_s_range, options.grid) if core.dropped else core.solution
    if not core.dropped:
        solve(core.problem, v_s_range, options.grid)
    grid_done = perf_counter()
    checked = crosscheck(
        problem if core.dropped else core.problem, check.theta, check.cost, _errors(core, problem), v_s_range
    )
    if timings is not None:
        timings |= {f"grid {label}": grid_done - started, f"full fit {label}": perf_counter() - grid_done}
    return fits, {label: checked}


def estimate_static(problem: Regression, options: FitOptions, kind: Kind) -> Mapping[str, Estimate]:
    """The parameters alone, with their intervals, and nothing that stands beside them: what a study of many data sets repeats."""
    return _core(problem, options, kind, options.v_s_range or default_range(problem.velocity)).parameters


def _parts(problem: Regression) -> tuple[str, ...]:
    return problem.directions if len(problem.directions) == 1 else (*problem.directions, "shared")


def _too_few(problem: Regression) -> str:
    n, m = problem.linear.shape
    if n <= m:
        return f"{n} points for {m} linear parameters: at least {m + 1} are needed; measure more speeds."
    scaled = problem.linear / np.maximum(np.linalg.norm(problem.linear, axis=0), 1e-300)
    if np.linalg.cond(scaled) > 1e8:
        return "The points cannot tell the linear parameters apart (one speed only, or a regressor that never changes); measure at more speeds."
    return ""


def _nothing(direction: str, problem: Regression, kind: Kind, why: str) -> StaticFit:
    names = (*_FRICTION, *problem.linear_names[2 * len(problem.directions) :])
    parameters = {name: Estimate(value=None, unit=unit(name, kind), doubts=(why,)) for name in names}
    return StaticFit(
        direction=direction,
        parameters=parameters,
        rms=None,
        relative_error=None,
        n=problem.torque.size,
        outcome=Outcome.TOO_FEW,
        doubts=(why,),
        velocity=problem.velocity if problem.smooth is None else np.zeros(0),
        torque=problem.torque if problem.smooth is None else np.zeros(0),
    )


def _core(problem: Regression, options: FitOptions, kind: Kind, v_s_range: tuple[float, float]) -> _Core:
    """Solve, drop the Stribeck terms that the data do not support, and put an interval and its doubts on each parameter."""
    dropped: dict[str, str] = {}
    if problem.torque.size <= len(problem.names):
        reason = f"{problem.torque.size} points are too few for a Stribeck term; at least {len(problem.names) + 1} are needed."
        dropped = dict.fromkeys(problem.peaks, reason)
    else:
        dropped = _unsupported(problem, solve(problem, v_s_range, options.grid))
    problem = replace(problem, peaks=tuple(d for d in problem.peaks if d not in dropped))
    if options.loss == "huber":
        problem = problem.weighted(huber(problem, v_s_range, options.grid)[1])
    solution = solve(problem, v_s_range, options.grid)
    stretch = inflation(solution.residuals) if problem.smooth is not None else 1.0
    free = np.array([name not in solution.at_bound for name in problem.names])
    jacobian = solution.jacobian
    covariance, freedom = uncertainty.covariance(jacobian[:, free], solution.cost, stretch)
    full, _ = uncertainty.covariance(jacobian, solution.cost, stretch)
    errors = np.sqrt(np.diag(full))[free.size - len(problem.peaks) :]
    profiles, intervals = _profiles(problem, solution, options, v_s_range, stretch, errors)
    parameters = _estimates(problem, solution, covariance, full, free, freedom, intervals, kind)
    doubts = fit_doubts(problem, solution, jacobian[:, free], intervals, profiles, v_s_range, stretch)
    outcome = _outcome(problem, solution, dropped, v_s_range)
    return _Core(
        problem=problem,
        solution=solution,
        parameters=parameters,
        names=tuple(np.array(problem.names)[free]),
        covariance=covariance,
        freedom=freedom,
        outcome=outcome,
        doubts=(*dropped.values(), *doubts),
        profiles=profiles,
        dropped=dropped,
    )


def _unsupported(problem: Regression, solution: Solution) -> dict[str, str]:
    """Directions whose Stribeck term is noise, or a bend over all speeds instead of a peak, each with the sentence that says so."""
    stretch = inflation(solution.residuals) if problem.smooth is not None else 1.0
    projected = Projected(problem)
    noise = 1e-20 * float(problem.torque @ problem.torque)
    dropped = {}
    for k, direction in enumerate(problem.peaks):
        off, length = projected.off(solution.grid, k)
        gain = max(solution.base_costs[k] - solution.cost, 0.0)
        ratio = gain / max(solution.cost, noise) / stretch
        p = uncertainty.stribeck_p_value(off, length, projected.q, ratio) if gain > noise else 1.0
        why = ""
        if p > SUPPORTED:
            why = f"noise alone would look as much like a peak in {100 * p:.0f} % of cases"
        elif _only_rises(problem, solution, direction, stretch):
            why = "the fitted curve rises at every speed, so it is a bend over the whole range and not a drop at low speed"
        if why:
            dropped[direction] = (
                f"Stribeck not identifiable{in_direction(direction)}: {why}; Coulomb and viscous friction alone are fitted."
            )
    return dropped


def _only_rises(problem: Regression, solution: Solution, direction: str, stretch: float) -> bool:
    """Whether the fitted curve has no falling part, beyond two standard errors.

    The steepest fall of alpha_1 exp(-(v / v_s)**2) is sqrt(2 / e) alpha_1 / v_s, at v = v_s / sqrt(2); viscous friction must not outweigh it.
    """
    tag = "" if len(problem.directions) == 1 else direction
    at = [problem.names.index(name + tag) for name in ("alpha_1", "alpha_2", "v_s")]
    alpha_1, alpha_2, v_s = solution.theta[at]
    steepest = np.sqrt(2 / np.e)
    gradient = np.zeros(solution.theta.size)
    gradient[at] = steepest / v_s, -1.0, -steepest * alpha_1 / v_s**2
    covariance, _ = uncertainty.covariance(solution.jacobian, solution.cost, stretch)
    return bool(steepest * alpha_1 / v_s - alpha_2 + 2 * np.sqrt(gradient @ covariance @ gradient) < 0)


def _profiles(
    problem: Regression,
    solution: Solution,
    options: FitOptions,
    v_s_range: tuple[float, float],
    stretch: float,
    errors: Array,
) -> tuple[dict[str, Profile], dict[str, tuple[float, float]]]:
    """The profile over v_s of each peak, and v_s's interval from it; `errors` are the standard errors of v_s, (peaks,)."""
    profiles, intervals = {}, {}
    projected = Projected(problem)
    threshold = uncertainty.profile_threshold(solution.cost, problem.torque.size, len(problem.names), stretch)
    for k, direction in enumerate(problem.peaks):
        best = float(solution.theta[k - len(problem.peaks)])
        other = float(
            solution.theta[-1 - k]
        )  # of two peaks, the other's v_s: searched finely near its best, and on the grid
        near = other * np.exp(np.linspace(-5, 5, 41) * min(errors[-1 - k] / other, 0.3))
        others = np.append(near, solution.grid)

        def costs(v_s: Array, k: int = k, others: Array = others) -> Array:
            return projected.profile(v_s, k, others)

        intervals[direction] = uncertainty.profile_interval(costs, solution.grid, solution.profiles[k], best, threshold)
        plain_v_s = (
            np.linspace(*v_s_range, options.plain_grid)
            if len(problem.peaks) == 1 and problem.smooth is None
            else solution.grid
        )
        around = _around(solution.grid, solution.profiles[k], best, solution.cost, threshold)
        profiles[direction] = Profile(
            v_s=solution.grid,
            cost=solution.profiles[k],
            near_v_s=around,
            near_cost=costs(around),
            plain_v_s=plain_v_s,
            plain_cost=costs(plain_v_s) if plain_v_s is not solution.grid else solution.profiles[k],
            best=best,
            best_cost=solution.cost,
            threshold=threshold,
        )
    return profiles, intervals


def _around(grid: Array, cost: Array, best: float, best_cost: float, threshold: float) -> Array:
    """Values of v_s, even in log(v_s), from where the profile falls below ten times the threshold's height to where it rises above."""
    low = np.flatnonzero(cost <= best_cost + 10 * (threshold - best_cost))
    near = np.append(low, np.searchsorted(grid, best))
    first, last = max(int(near.min()) - 1, 0), min(int(near.max()) + 1, grid.size - 1)
    values: Array = np.geomspace(min(grid[first], best), max(grid[last], best), _NEAR)
    return np.sort(np.append(values, best))


def _estimates(
    problem: Regression,
    solution: Solution,
    covariance: Array,
    full: Array,
    free: Array,
    freedom: float,
    v_s_intervals: dict[str, tuple[float, float]],
    kind: Kind,
) -> dict[str, Estimate]:
    errors = np.full(len(problem.names), np.nan)
    errors[free] = np.sqrt(np.diag(covariance))
    reach = uncertainty.student(freedom)
    out = {}
    for name, value, error, loose in zip(problem.names, solution.theta, errors, np.sqrt(np.diag(full)), strict=True):
        plain_name = name.rstrip("+-")
        direction = name[len(plain_name) :] or problem.directions[0]
        low, high = value - reach * error, value + reach * error
        doubts: tuple[str, ...] = ()
        if name in solution.at_bound:
            low, high = 0.0, reach * float(loose)
            doubts = ("At its physical bound of zero: the interval is one-sided.",)
        elif plain_name == "v_s":
            low, high = v_s_intervals[direction]
        elif plain_name.startswith("alpha"):
            low = max(low, 0.0)
        if plain_name == "alpha_1" and not is_closed(v_s_intervals[direction]):
            high, doubts = np.inf, (*doubts, "No finite interval: v_s has none, and alpha_1 rises with it.")
        if plain_name == "v_s" and not is_closed((low, high)):
            doubts = (
                *doubts,
                "No finite interval: the data allow v_s "
                + ("down to zero." if low == 0 else "without an upper limit."),
            )
        standard_error = None if name in solution.at_bound or not np.isfinite(error) else float(error)
        out[name] = Estimate(
            value=float(value),
            unit=unit(plain_name, kind),
            standard_error=standard_error,
            interval=(float(low), float(high)),
            doubts=doubts,
        )
    return out


def _outcome(
    problem: Regression, solution: Solution, dropped: Mapping[str, str], v_s_range: tuple[float, float]
) -> Outcome:
    if dropped and not problem.peaks:
        return Outcome.NO_STRIBECK
    _, v_s = problem.split(solution.theta)
    if any(s <= v_s_range[0] * 1.001 or s >= v_s_range[1] / 1.001 for s in v_s):
        return Outcome.AT_EDGE
    return Outcome.AT_BOUND if solution.at_bound else Outcome.CONVERGED


@dataclass(frozen=True, slots=True, kw_only=True)
class _Beside:
    """What stands beside a fit."""

    plain: Mapping[str, float]
    robust: Mapping[str, float]
    without: Mapping[str, Estimate]
    doubts: tuple[str, ...]


def _beside(
    problem: Regression, core: _Core, options: FitOptions, kind: Kind, v_s_range: tuple[float, float], where: Where
) -> _Beside:
    plain: dict[str, float] = {}
    if len(core.problem.peaks) == 1 and problem.smooth is None:
        plain = dict(
            zip(core.problem.names, map(float, plain_grid(core.problem, v_s_range, options.plain_grid)[2]), strict=True)
        )
    unweighted = replace(problem, peaks=core.problem.peaks)
    refit, weight = huber(unweighted, v_s_range, options.grid)
    robust = dict(zip(core.problem.names, map(float, refit.theta), strict=True))
    spread = np.sqrt(np.diag(uncertainty.covariance(refit.jacobian, refit.cost)[0]))
    errors = dict(zip(core.problem.names, map(float, spread), strict=True))
    doubts = [*huber_doubts(core.parameters, robust, errors, weight, where.names), *core.doubts]
    without: Mapping[str, Estimate] = {}
    if where.stick_slip.any():
        rest = problem.rows(np.logical_not(where.stick_slip))
        doubts.append(
            f"{int(where.stick_slip.sum())} of {where.stick_slip.size} points stick and slip; the fit without them is shown beside."
        )
        if _too_few(rest):
            doubts.append(f"Without the points that stick and slip nothing can be fitted. {_too_few(rest)}")
        else:
            alone = _core(rest, options, kind, v_s_range)
            without = alone.parameters
            doubts += [f"Without the points that stick and slip: {doubt}" for doubt in alone.doubts]
    measured = slice(problem.torque.size - problem.priors)
    residuals, velocity = core.problem.residuals(core.solution.theta)[measured], _equation_velocity(problem)[measured]
    doubts += residual_doubts(residuals, velocity, where.time, where.position)
    return _Beside(plain=plain, robust=robust, without=without, doubts=tuple(doubts))


def _equation_velocity(problem: Regression) -> Array:
    return problem.velocity if problem.smooth is None else problem.smooth @ problem.velocity


def _static_fit(core: _Core, part: str, where: Where, beside: _Beside, errors: tuple[HoldOut, ...]) -> StaticFit:
    """The part of a fit that belongs to one direction, to both, or to what two directions share."""
    problem, theta = core.problem, core.solution.theta
    two = len(problem.directions) == 2
    velocity = _equation_velocity(problem)
    residuals = problem.residuals(theta)
    rows = (
        np.ones(residuals.size, dtype=bool)
        if not two or part == "shared"
        else (velocity > 0 if part == "+" else velocity < 0)
    )
    rows[rows.size - problem.priors :] = False
    own = [name for name in problem.names if not two or (part in name if part != "shared" else name[-1] not in "+-")]
    parameters = {name.rstrip("+-"): core.parameters[name] for name in own}
    if part != "shared" and part in core.dropped:
        missing = {
            n: Estimate(value=None, unit=_unit_like(core, n, two, part), doubts=(core.dropped[part],))
            for n in ("alpha_1", "v_s")
        }
        parameters |= missing
    order = [n for n in _FRICTION if n in parameters] + [n for n in parameters if n not in _FRICTION]
    keep = [k for k, name in enumerate(core.names) if name in own]
    torque = problem.friction(theta) if part != "shared" else problem.torque
    measured = problem.torque if problem.known is None else problem.torque + problem.known
    return StaticFit(
        direction=part,
        parameters={name: parameters[name] for name in order},
        rms=float(np.sqrt(np.mean(residuals[rows] ** 2))),
        relative_error=float(100 * np.linalg.norm(residuals[rows]) / np.linalg.norm(measured[rows])),
        n=int(rows.sum()),
        outcome=core.outcome,
        doubts=beside.doubts,
        hold_out=errors,
        names=tuple(core.names[k].rstrip("+-") for k in keep),
        covariance=core.covariance[np.ix_(keep, keep)],
        dof=int(core.freedom),
        profile=core.profiles.get(part),
        plain={name.rstrip("+-"): x for name, x in beside.plain.items() if name in own},
        robust={name.rstrip("+-"): x for name, x in beside.robust.items() if name in own},
        without_stick_slip={name.rstrip("+-"): e for name, e in beside.without.items()},
        velocity=velocity[rows],
        torque=torque[rows],
        residuals=residuals[rows],
        time=where.time[rows[: where.time.size]],
        position=where.position[rows[: where.position.size]],
    )


def _unit_like(core: _Core, name: str, two: bool, part: str) -> str:
    torque = core.parameters["alpha_0" + (part if two else "")].unit
    return unit(name, "revolute" if torque == unit("alpha_0") else "prismatic")


def _errors(core: _Core, problem: Regression) -> Array:
    return np.array(
        [(e.standard_error or np.nan) if (e := core.parameters.get(name)) else np.nan for name in problem.names]
    )
