"""Static fits of points or of moving runs, with intervals and warnings."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.data.constant_velocity.segments import Segment
from bristle.data.experiment.load import Experiment
from bristle.data.experiment.schema import FitOptions
from bristle.data.record import Record
from bristle.errors import InputError
from bristle.estimation import levels
from bristle.estimation.autocorrelation import unexplained
from bristle.estimation.covariance import condition
from bristle.estimation.score_test import Fitted, explained
from bristle.findings import CAUTION, CRITICAL, NOTE, Finding, in_direction, unit_of
from bristle.identification.candidates import candidates
from bristle.identification.fits import Crosscheck, Estimate, HoldOut, StaticFit, TrackingFit, Uncertainty
from bristle.identification.measured import Measured
from bristle.identification.moving_runs import (
    DIRECTIONS,
    directions,
    inertia,
    refuse_noise,
    refuse_opposing,
    regressors,
)
from bristle.identification.repeats import clustered, widened
from bristle.identification.static.crosscheck import crosscheck
from bristle.identification.static.grid import default_range, plain_grid
from bristle.identification.static.points import PointSearch, groups, point_regressors, points_problem
from bristle.identification.static.problem import Regression, from_records
from bristle.identification.static.solution import StaticSolution, other_fit, solve_static
from bristle.identification.static.strays import most_strays
from bristle.identification.static.uncertainty import parts_of_runs, three_ways
from bristle.identification.systematic import with_systematic
from bristle.model.parameters import Direction, Kind, ParameterName, of_curve, peak_parameters, static_fields_of, unit

_LISTED = 3  # most points named in a warning
_LOGARITHMIC = ("v_s",)  # widened as logarithms


@dataclass(frozen=True, slots=True, kw_only=True)
class PointInfo:
    """Origin of each equation."""

    segments: tuple[Segment, ...] = ()  # Of each point, (n,); empty for moving data
    time: Array = field(default_factory=lambda: np.zeros(0))  # s from the start of its run, (n,); empty where unknown
    position: Array = field(default_factory=lambda: np.zeros(0))  # rad, (n,); empty where unknown
    search: PointSearch | None = None  # Strays; None for moving data


def fit_static(
    problem: Regression,
    options: FitOptions,
    kind: Kind,
    where: PointInfo,
    held: Sequence[tuple[str, Regression]] = (),
    runs: Sequence[tuple[str, Regression]] = (),
) -> tuple[dict[str, StaticFit], dict[str, Crosscheck]]:
    """Fits of one problem, and cross-checks of points, by direction or `shared`; `held` to predict, `runs` to fit apart."""
    v_s_range = default_range(problem.velocity)
    # a direction measured at one speed alone has no viscous friction of its own
    lost = set[ParameterName]()
    for d in problem.directions if problem.smooth is None else ():
        speeds = problem.speeds(d)
        if speeds.size and speeds.max() < levels.ONE_SPEED * speeds.min():
            lost.add(ParameterName("alpha_2", d))
    if lost:
        problem = problem.without(lost)
        held, runs = ([(file, x.without(lost)) for file, x in each] for each in (held, runs))
    too_few = _too_few(problem)
    if too_few:
        return {d: _nothing(d, problem, kind, where, too_few) for d in problem.directions}, {}
    core = solve_static(problem, options, kind, v_s_range)
    # other estimates of the same parameters, and warnings
    plain: dict[ParameterName, float] = {}
    if len(core.problem.peaks) == 1 and problem.smooth is None:
        plain = core.problem.named(plain_grid(core.problem, v_s_range)[2])
    search = where.search
    of_strays = report_strays(core, search, options, kind) if search else ()
    strays = [search.points[k] for k in search.strays] if search and not search.misfit else []
    three = three_ways(core, v_s_range) if problem.smooth is None else {}
    sticks = np.array([s.stick_slip for s in where.segments], dtype=bool)
    of_sticking = _without_sticking(problem, core, options, kind, sticks)
    residuals = core.solution.residuals
    in_order = residuals[np.argsort(problem.equation_velocity)] if where.segments else residuals
    left = unexplained(in_order, float(np.linalg.norm(problem.measured)))
    warnings = (*left, *of_strays, *core.warnings, *of_sticking, *terms_left_out(core, kind, where))
    posed = ((file, replace(p, peaks=core.problem.peaks)) for file, p in held)
    errors = tuple(HoldOut(file=file, relative_error=p.relative_error(core.solution.theta)) for file, p in posed)
    checks, parts = dict[str, Crosscheck](), _parts(problem)
    if problem.smooth is None:
        errors_of_grid = {name: e.standard_error for name, e in core.parameters.items()}
        checks[parts[-1]] = check = crosscheck(core.problem, core.solution, errors_of_grid, v_s_range)
        warnings = warnings if check.agrees else (*warnings, check.verdict)
    logarithmic = {name for name in core.names if name.name in _LOGARITHMIC}
    scatter = clustered(
        *parts_of_runs(core, runs), core.parameters, core.freedom, logarithmic, independent=problem.smooth is None
    )
    one, finished = len(core.problem.directions) == 1, dict[str, StaticFit]()
    for d in parts:
        fit = replace(
            _static_fit(core, kind, d, where, three), warnings=warnings, hold_out=errors,
            plain_grid={name.name: x for name, x in plain.items() if one or name.direction is d},
            strays=tuple(x for x in strays if DIRECTIONS.get(d, 0.0) * x.velocity >= 0),
        )  # fmt: skip  # a list of values
        # widened by the scatter of runs, then by systematic errors
        own = {name.name: x for name, x in scatter.items() if one or name.direction is d}
        shifts = {c: {n.name: x for n, x in by.items() if one or n.direction is d} for c, by in core.shifts.items()}
        finished[d] = with_systematic(widened(fit, own, _LOGARITHMIC), shifts)
    return finished, checks


def estimate_static(
    problem: Regression, options: FitOptions, kind: Kind, v_s_range: tuple[float, float] | None = None
) -> Mapping[str, Estimate]:
    """Estimates of one direction alone, for studies of many data sets."""
    core = solve_static(problem, options, kind, v_s_range)
    return {name.name: e for name, e in core.estimates.items()}


def _parts(problem: Regression) -> tuple[Direction, ...]:
    return problem.directions if len(problem.directions) == 1 else (*problem.directions, Direction.SHARED)


def _too_few(problem: Regression) -> Finding | None:
    n, m = problem.linear.shape
    if n <= m:
        message = f"{n} points for {m} linear parameters: at least {m + 1} are needed; measure more speeds."
        return Finding("too-few-points", CRITICAL, message, {"points": n, "parameters": m, "least": m + 1})
    if condition(problem.linear) > levels.DEPENDENT:
        message = (
            "The points do not separate the linear parameters (one speed only, or a regressor that never "
            "changes); measure more speeds."
        )
        return Finding("indistinct", CRITICAL, message)
    return None


def _nothing(direction: str, problem: Regression, kind: Kind, where: PointInfo, why: Finding) -> StaticFit:
    extra = (name.name for name in problem.linear_names if not of_curve(name.name))
    names = (*static_fields_of(problem.law), *extra)
    parameters = {name: Estimate(value=None, unit=unit(name, kind), warnings=(why,)) for name in names}
    return StaticFit(
        direction=direction, law=problem.law, parameters=parameters, rms=None, relative_error=None,
        n=problem.torque.size,
        outcome=Finding("static-too-few", CRITICAL, "Too few points for the parameters; nothing is estimated."),
        warnings=(why,), velocity=problem.velocity if problem.smooth is None else np.zeros(0),
        torque=problem.torque if problem.smooth is None else np.zeros(0), segments=where.segments,
    )  # fmt: skip  # a list of values


def _without_sticking(
    problem: Regression, core: StaticSolution, options: FitOptions, kind: Kind, sticks: NDArray[np.bool_]
) -> list[Finding]:
    """A finding on the fit without sticking points, (n,)."""
    if not sticks.any():
        return []
    rest = problem.rows(np.logical_not(sticks))
    numbers: dict[str, Any] = {"sticking": int(sticks.sum()), "points": sticks.size}
    message = f"{numbers['sticking']} of {sticks.size} points stick and slip."
    if _too_few(rest):
        return [Finding("stick-slip-points", CAUTION, f"{message} Without them no fit is possible.", numbers)]
    values, apart = other_fit(core, solve_static(rest, options, kind))
    message += f" Without them the fitted torque changes by {apart:.2g}{unit_of('torque')} (rms)."
    return [Finding("stick-slip-points", CAUTION, message, {**numbers, **values}, {"torque": apart})]


def report_strays(core: StaticSolution, search: PointSearch, options: FitOptions, kind: Kind) -> tuple[Finding, ...]:
    """A finding on the strays of a solve, with the fit without them, or with them if they are left out."""
    count, side = len(search.points), search.sides[0] if len(search.sides) == 1 else ""
    points = [search.points[k] for k in search.strays[:_LISTED]]
    named = ", ".join(f"{' '.join(s.subject)} at {s.velocity:.3g}{unit_of('velocity')}" for s in points)
    named += f" and {len(search.strays) - _LISTED} more" if len(search.strays) > _LISTED else ""
    if search.misfit:
        most = most_strays(search.problem)
        message = (
            f"The law does not fit{in_direction(side)}: more than {most} of {count} points would have to be left out, {named} first. Look at "
            "the residuals for what is missing; `exclude` under fit leaves out points that you know to be faulty."
        )
        left = float(np.sqrt(np.mean(core.problem.residuals(core.solution.theta) ** 2)))
        numbers = {"direction": side, "most": most, "count": count}
        return (Finding("misfit", CAUTION, message, numbers, {"torque": left}),)
    dropped = options.drops_strays and bool(search.left_out)
    if not search.strays or not (dropped or search.matter):
        return ()
    rows = search.sliding if dropped else search.kept
    values, apart = other_fit(core, solve_static(search.problem.rows(rows), options, kind))
    numbers = {"count": len(search.strays), **values}
    message = f"{len(search.strays)} of {count} points are off the law of the others"
    told = f"the fitted torque changes by {apart:.2g}{unit_of('torque')} (rms)"
    if dropped:
        message += f" and left out: {named}. With them {told}. To keep them, write `set_up: as-written` under fit."
        return (Finding("strays", CAUTION, message, numbers),)
    why = "neighbours, the ends of the range, or more than a tenth of the points show what the law lacks"
    why = why if options.drops_strays else "to leave them out, leave `set_up: as-written` out"
    message += f" and stay in: {named}; {why}. Without them {told}."
    return (Finding("strays", CAUTION, message, numbers, {"torque": apart}),)


def terms_left_out(core: StaticSolution, kind: Kind, where: PointInfo) -> list[Finding]:
    """Terms that the fit lacks, to first order; points in the order of velocity."""
    problem, theta = core.problem, core.solution.theta
    velocity = problem.equation_velocity
    order = np.argsort(velocity, kind="stable") if where.segments else np.arange(velocity.size)
    names = problem.names
    errors = [((e := core.parameters.get(name)) and e.standard_error) or np.inf for name in names]
    friction = np.array([of_curve(name.name) for name in names], dtype=bool)
    fit = Fitted(
        problem.jacobian(theta)[order], core.solution.residuals[order],
        np.array(errors, dtype=np.float64), friction, float(np.sqrt(np.mean(problem.friction(theta) ** 2))),
        widened=False,
    )  # fmt: skip  # a list of values
    time, position = (x[order] if x.size == order.size else x for x in (where.time, where.position))
    fitted = [*(name.name for name in names), *problem.given]
    rows = candidates(velocity[order], time, position, fitted, kind, len(problem.directions))
    return explained(fit, rows).findings


def _static_fit(
    core: StaticSolution,
    kind: Kind,
    part: Direction,
    where: PointInfo,
    three: Mapping[ParameterName, Uncertainty],
) -> StaticFit:
    """The fit of one direction, of both, or of the shared parameters; `three` are intervals three ways."""
    problem, theta = core.problem, core.solution.theta
    two, velocity, residuals = len(problem.directions) == 2, problem.equation_velocity, problem.residuals(theta)
    rows = np.ones(residuals.size, dtype=bool)
    if two and part != "shared":
        rows = velocity > 0 if part == "+" else velocity < 0
    names = [name for name in problem.names if not two or name.direction is part]
    parameters = {name.name: core.parameters[name] for name in names}
    own = {name.name: three[name] for name in names if name in three}
    for bare, x in own.items():  # warnings of the three intervals, unless at a bound
        if not any(warning.code == "at-bound" for warning in parameters[bare].warnings):
            parameters[bare] = replace(parameters[bare], warnings=(*parameters[bare].warnings, *x.warnings))
    if part != "shared" and part in core.dropped:
        lost = (core.dropped[part],)
        names_lost = peak_parameters(problem.law)
        parameters |= {n: Estimate(value=None, unit=unit(n, kind), warnings=lost) for n in names_lost}
    parameters |= {name.name: e for name, e in core.beside.items() if name.direction is part}
    whole = parameters.get("alpha_0")  # None for shared parameters
    if "alpha_2" not in parameters and whole is not None and whole.value is not None and whole.interval is not None:
        # at one speed alone alpha_0 holds all friction and alpha_2 none, with intervals of all splits
        speed, high = float(np.mean(problem.speeds(part))), whole.interval[1]
        message = (
            f"Friction is known at one speed alone, {speed:.3g}{unit_of('velocity')}: alpha_0 + alpha_2 v = {whole.value:.4g} +/- "
            f"{whole.standard_error or 0.0:.2g}{unit_of('torque')}. How it splits is not known, and alpha_2 is taken as 0; measure at other speeds."
        )
        said = (Finding("one-speed-only", CAUTION, message, {"speed": speed, "friction": whole.value}),)
        parameters["alpha_0"] = replace(whole, interval=(0.0, high), warnings=(*whole.warnings, *said))
        nothing = Estimate(value=0.0, unit=unit("alpha_2", kind), interval=(0.0, high / speed), warnings=said)
        parameters["alpha_2"] = nothing
    order = sorted(parameters, key=lambda name: (*static_fields_of(problem.law), name).index(name))
    keep = [k for k, name in enumerate(core.names) if name in names or name in core.beside]
    torque = problem.friction(theta) if part != "shared" else problem.torque
    norm = float(np.linalg.norm(problem.measured[rows]))
    return StaticFit(
        direction=part, law=problem.law, parameters={name: parameters[name] for name in order},
        rms=float(np.sqrt(np.mean(residuals[rows] ** 2))) if rows.any() else None,
        relative_error=float(100 * np.linalg.norm(residuals[rows]) / norm) if norm else None, n=int(rows.sum()),
        outcome=core.outcome, names=tuple(core.names[k].name for k in keep),
        covariance=core.covariance[np.ix_(keep, keep)], degrees_of_freedom=int(core.freedom),
        profile=core.profiles.get(part), uncertainty=own,
        velocity=velocity[rows], torque=torque[rows], residuals=residuals[rows],
        segments=tuple(s for s, row in zip(where.segments, rows.tolist(), strict=False) if row),
        time=where.time[rows[: where.time.size]], position=where.position[rows[: where.position.size]],
    )  # fmt: skip  # a list of values


def refuse_opposing_points(experiment: Experiment, points: Sequence[Segment], asked: Sequence[str]) -> None:
    """Raise InputError if the torque of points is noise or opposes velocity (about an offset if `asked`)."""
    v, T = (np.array([getattr(s, name) for s in points]) for name in ("velocity", "torque"))
    for d, sign in DIRECTIONS.items() if not asked else ():
        own = v * sign > 0
        refuse_opposing(experiment, v[own], T[own], f"at the {np.count_nonzero(own)} points of direction {d}")
    if asked and "gravity" not in asked and v.size and v.min() < 0 < v.max():
        refuse_noise(experiment, v, T, f"at the {v.size} points")
        middle = (T[v > 0].mean() + T[v < 0].mean()) / 2
        refuse_opposing(experiment, v, T - middle, f"at the {v.size} points, an offset apart")


def fit_points(measured: Measured, points: Sequence[Segment]) -> tuple[dict[str, StaticFit], dict[str, Crosscheck]]:
    """Static fits and cross-checks of points. Raises InputError for missing signals or opposing torque."""
    experiment, asked = measured.experiment, point_regressors(measured.experiment)
    if "inertia" in (experiment.fit.regressors or ()) and not measured.moving(hold_out=False):
        raise InputError(
            f"{experiment.path.name}: fit.regressors: inertia needs acceleration, which constant-velocity points do not have; "
            "leave it out, or give the runs as experiment: tracking"
        )
    held, law = measured.points(hold_out=True), experiment.fit.friction
    static: dict[str, StaticFit] = {}
    checks: dict[str, Crosscheck] = {}
    refuse_opposing_points(experiment, points, asked)
    searches = {search.sides: search for search in measured.searches}
    for sides, group in groups(experiment, points):
        signs = [DIRECTIONS[d] for d in sides if d in DIRECTIONS] or list(DIRECTIONS.values())
        both = by_file(s for s in held if np.sign(s.velocity) in signs), by_file(group)
        tests, apart = ([(file, points_problem(s, sides, asked, law)) for file, s in of.items()] for of in both)
        runs = [(file, one) for file, one in apart if one.torque.size > len(one.names)]
        # times are of no use where every run is one point
        known = [[s.time for s in group] if len(apart) < len(group) else [None], [s.position for s in group]]
        time, position = (np.zeros(0) if None in x else np.array(x, dtype=float) for x in known)
        where = PointInfo(segments=group, time=time, position=position, search=searches.get(sides))
        problem = points_problem(group, sides, asked, law)
        fits, checked = fit_static(problem, experiment.fit, experiment.joint.kind, where, tests, runs)
        static |= fits
        checks |= checked
    return static, checks


def by_file(points: Iterable[Segment]) -> dict[str, list[Segment]]:
    """The points of each run, in order."""
    found = defaultdict[str, list[Segment]](list)
    for s in points:
        found[s.file].append(s)
    return found


def fit_moving(experiment: Experiment, records: Sequence[Record], held: Sequence[Record]) -> dict[str, StaticFit]:
    """Static fits of moving runs, by the grid. Raises InputError where a signal is missing."""
    moving, asked, (fixed, _) = directions(experiment, records), regressors(experiment), inertia(experiment)
    options = moving, asked, experiment.fit.every, fixed, experiment.fit.friction
    training, (time, position), _ = from_records(records, *options)
    tests, runs = ([(r.file, from_records([r], *options, training.weights)[0]) for r in x] for x in (held, records))
    runs = [(file, one) for file, one in runs if len(runs) > 1 and one.torque.size > len(one.names)]
    where = PointInfo(time=time, position=position)
    return fit_static(training, experiment.fit, experiment.joint.kind, where, tests, runs)[0]


def reconcile_static(static: Mapping[str, StaticFit], moving: TrackingFit | None) -> dict[str, StaticFit]:
    """The static fits of moving runs, superseded where LuGre fits the same runs: presliding biases a static law."""
    if moving is None:
        return dict(static)
    own = [e for name, e in moving.parameters.items() if name.name == "alpha_0"]
    failed = any(why.code in ("unseen-unconverged", "unseen-too-few") for e in own for why in e.warnings)
    worse = [x.relative_error or 0.0 for x in static.values()]
    poor = not worse or moving.relative_error * levels.MUCH_WORSE > min(worse)
    if failed or (poor and all(e.value is None for e in own)):
        return dict(static)
    found = dict(static)
    for d, fit in static.items():
        if fit.relative_error is not None:
            message = (
                f"Without presliding, of which its errors know nothing: the relative error is {fit.relative_error:.2g} %, and "
                f"{moving.relative_error:.2g} % with it. Use the fit of all parameters of the moving runs, not these numbers."
            )
            numbers = {"error": fit.relative_error, "other": moving.relative_error}
            found[d] = replace(fit, outcome=Finding("static-superseded", NOTE, message, numbers), warnings=())
    return found
