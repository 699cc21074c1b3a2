"""From a static problem to a `StaticFit`: the grid's answer with intervals, warnings, and what stands beside it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.data.constant_velocity.segments import Segment
from bristle.data.experiment.schema import FitOptions
from bristle.estimation.autocorrelation import unexplained
from bristle.estimation.covariance import condition
from bristle.estimation.score_test import Candidate, Fitted, Score, explained
from bristle.findings import CAUTION, CRITICAL, NOTE, Finding, unit_of
from bristle.identification.candidates import candidates
from bristle.identification.fits import Crosscheck, Estimate, HoldOut, StaticFit, Uncertainty
from bristle.identification.moving_runs import DIRECTIONS
from bristle.identification.repeats import clustered, widened
from bristle.identification.static.crosscheck import crosscheck
from bristle.identification.static.grid import default_range, plain_grid
from bristle.identification.static.points import PointSearch
from bristle.identification.static.problem import Regression
from bristle.identification.static.solution import StaticSolution, apart, solve_static
from bristle.identification.static.stray_report import report_strays
from bristle.identification.static.uncertainty import parts_of_runs, three_ways
from bristle.identification.systematic import with_systematic
from bristle.model.parameters import Direction, Kind, ParameterName, of_curve, peak_parameters, static_fields_of, unit

_ONE_SPEED = 1.25  # times the slowest speed: where the fastest is less, they are one
_MANY, _MIXED = 10, 0.5
"""Points of a direction whose torque may go with their rows, and the rank correlation of speed and row up to which that is no matter of speed."""
_LOGARITHMIC = ("v_s",)  # what is compared, and widened, as its logarithm


@dataclass(frozen=True, slots=True, kw_only=True)
class PointInfo:
    """What is known of each equation beside its velocity and torque."""

    segments: tuple[Segment, ...] = ()
    """The segment behind each point, (n,); empty for moving data."""
    time: Array = field(default_factory=lambda: np.zeros(0))
    """s from the start of its run, (n,); empty where unknown."""
    position: Array = field(default_factory=lambda: np.zeros(0))
    """rad, (n,); empty where unknown."""
    search: PointSearch | None = None
    """Which points do not belong to the law; None for moving data."""


def fit_static(
    problem: Regression,
    options: FitOptions,
    kind: Kind,
    where: PointInfo,
    held: Sequence[tuple[str, Regression]] = (),
    runs: Sequence[tuple[str, Regression]] = (),
) -> tuple[dict[str, StaticFit], dict[str, Crosscheck]]:
    """Fit one static problem, with a peak in every direction, and everything that the report shows beside the fit.

    Hold-out runs, and runs that can be fitted apart, by name, are posed as the problem is, without its priors. Returns fits
    and cross-checks, keyed by direction; a problem of two directions that share regressors also has the fit `shared`.
    """
    v_s_range = default_range(problem.velocity)
    # of a direction that was measured at one speed alone viscous friction is told from Coulomb's by others
    lost = set[ParameterName]()
    for d in problem.directions if problem.smooth is None else ():
        speeds = problem.speeds(d)
        if speeds.size and speeds.max() < _ONE_SPEED * speeds.min():
            lost.add(ParameterName("alpha_2", d))
    if lost:
        problem = problem.without(lost)
        held, runs = ([(file, x.without(lost)) for file, x in each] for each in (held, runs))
    too_few = _too_few(problem)
    if too_few:
        return {d: _nothing(d, problem, kind, where, too_few) for d in problem.directions}, {}
    core = solve_static(problem, options, kind, v_s_range)
    # the same parameters by other ways, and what is said of the whole
    plain: dict[ParameterName, float] = {}
    if len(core.problem.peaks) == 1 and problem.smooth is None:
        plain = core.problem.named(plain_grid(core.problem, v_s_range)[2])
    strays, other_points, of_strays = report_strays(core, where.search, options, kind)
    three = three_ways(core, v_s_range)
    sticks = np.array([s.stick_slip for s in where.segments], dtype=bool)
    without, of_sticking = _without_sticking(problem, core, options, kind, sticks)
    measured = slice(problem.torque.size - problem.priors)
    residuals = core.solution.residuals[measured]
    in_order = residuals[np.argsort(problem.equation_velocity[measured])] if where.segments else residuals
    left = unexplained(in_order, float(np.linalg.norm(problem.measured[measured])))
    warnings = (*left, *of_strays, *core.warnings, *of_sticking, *terms_left_out(core, kind, where))
    posed = ((file, replace(p, peaks=core.problem.peaks)) for file, p in held)
    errors = tuple(HoldOut(file=file, relative_error=p.relative_error(core.solution.theta)) for file, p in posed)
    errors_of_grid = {name: e.standard_error for name, e in core.parameters.items()}
    checked = crosscheck(core.problem, core.solution, errors_of_grid, v_s_range)
    warnings = warnings if checked.agrees else (*warnings, checked.verdict)
    logarithmic, alone = {name for name in core.names if name.name in _LOGARITHMIC}, problem.smooth is None
    scatter = clustered(*parts_of_runs(core, runs), core.parameters, core.freedom, logarithmic, independent=alone)
    one, finished = len(core.problem.directions) == 1, dict[str, StaticFit]()
    for d in _parts(problem):
        fit = replace(
            _static_fit(core, kind, d, where, without, three),
            warnings=warnings,
            hold_out=errors,
            plain_grid={name.name: x for name, x in plain.items() if one or name.direction is d},
            strays=tuple(x for x in strays if DIRECTIONS.get(d, 0.0) * x.velocity >= 0),
            other_points=other_points.get(d),
        )
        # as wide as the runs scatter, and then with the systematic errors
        own = {name.name: x for name, x in scatter.items() if one or name.direction is d}
        shifts = {c: {n.name: x for n, x in by.items() if one or n.direction is d} for c, by in core.shifts.items()}
        finished[d] = with_systematic(widened(fit, own, _LOGARITHMIC), shifts)
    return finished, {_parts(problem)[-1]: checked}


def estimate_static(
    problem: Regression, options: FitOptions, kind: Kind, v_s_range: tuple[float, float] | None = None
) -> Mapping[str, Estimate]:
    """The parameters of one direction alone with their intervals: what a study of many data sets repeats."""
    core = solve_static(problem, options, kind, v_s_range)
    return {name.name: e for name, e in core.estimates.items()}


def _parts(problem: Regression) -> tuple[Direction, ...]:
    return problem.directions if len(problem.directions) == 1 else (*problem.directions, Direction.SHARED)


def _too_few(problem: Regression) -> Finding | None:
    n, m = problem.linear.shape
    if n <= m:
        message = f"{n} points for {m} linear parameters: at least {m + 1} are needed; measure more speeds."
        return Finding("too-few-points", CRITICAL, message, {"points": n, "parameters": m, "least": m + 1})
    if condition(problem.linear) > 1e8:
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
) -> tuple[Mapping[ParameterName, Estimate], list[Finding]]:
    """The parameters fitted without the points that stick and slip, a mask, (n,), and what is said of that; nothing where none do."""
    if not sticks.any():
        return {}, []
    rest = problem.rows(np.logical_not(sticks))
    sticking, points = int(sticks.sum()), sticks.size
    message = f"{sticking} of {points} points stick and slip; the fit without them is shown for comparison."
    said = Finding("stick-slip-points", CAUTION, message, {"sticking": sticking, "points": points})
    if nothing := _too_few(rest):
        message = f"Without the points that stick and slip no fit is possible. {nothing.message}"
        return {}, [said, Finding("nothing-without", CAUTION, message, {"inner": nothing})]
    alone = solve_static(rest, options, kind)
    warnings = [replace(said, effect={"torque": apart(core, alone)})]
    for inner in alone.warnings:
        message = f"Without the points that stick and slip: {inner.message}"
        warnings.append(Finding("without-stick-slip", NOTE, message, {"inner": inner}))
    return alone.estimates, warnings


def terms_left_out(core: StaticSolution, kind: Kind, where: PointInfo) -> list[Finding]:
    """Terms that the fit lacks, to first order; points in the order of velocity, in which a misfit correlates them."""
    problem, theta = core.problem, core.solution.theta
    measured = slice(problem.torque.size - problem.priors)
    velocity = problem.equation_velocity[measured]
    order = np.argsort(velocity, kind="stable") if where.segments else np.arange(velocity.size)
    names = problem.names
    errors = [((e := core.parameters.get(name)) and e.standard_error) or np.inf for name in names]
    friction = np.array([of_curve(name.name) for name in names], dtype=bool)
    fit = Fitted(
        problem.jacobian(theta)[measured][order],
        core.solution.residuals[measured][order],
        np.array(errors, dtype=np.float64),
        friction,
        float(np.sqrt(np.mean(problem.friction(theta)[measured] ** 2))),
        widened=False,
    )
    time, position = (x[order] if x.size == order.size else x for x in (where.time, where.position))
    rows = candidates(velocity[order], time, position, [*(name.name for name in names), *problem.given], kind)
    points = [where.segments[k] for k in order] if where.segments else []
    modelled = (problem.torque - core.solution.residuals)[measured][order]
    return explained(fit, [*rows, *_by_rows(points, modelled)]).findings


def _by_rows(points: Sequence[Segment], torque: Array) -> list[Candidate]:
    """That the torque, modelled, N*m, (n,), of given points goes with their rows, where their speeds go up and down in these."""
    given = bool(points) and all(s.stop == s.start + 1 for s in points) and len({s.file for s in points}) == 1
    v, row = (np.array([getattr(s, name) for s in points], dtype=np.float64) for name in ("velocity", "start"))
    for side in (v > 0, v < 0):
        if side.sum() >= _MANY:
            ranks = np.argsort(np.argsort(np.abs(v[side]))), np.argsort(np.argsort(row[side]))
            given &= abs(float(np.corrcoef(*ranks)[0, 1])) <= _MIXED
        else:
            given &= not side.any()
    if not given:
        return []

    def tell(found: Score, _: int) -> Finding:
        share = float(found.sizes[0])
        across = share * float(np.median(np.abs(torque)))
        message = (
            f"Beside what speed explains, the torque of the points goes with their rows in {points[0].file}: {across:+.3g}{unit_of('torque')} from "
            f"first to last, {100 * abs(share):.0f} % of it. If they stand there as they were measured, it drifts: warm up, or measure each "
            "speed going up and coming down."
        )
        numbers = {"file": points[0].file, "across": across, "share": abs(share)}
        return Finding("drift-of-rows", CAUTION, message, numbers, {"torque": abs(across)})

    return [Candidate(tell, ((torque * (row - row.mean()) / np.ptp(row))[:, None],), is_friction=True)]


def _static_fit(
    core: StaticSolution,
    kind: Kind,
    part: Direction,
    where: PointInfo,
    without: Mapping[ParameterName, Estimate],
    three: Mapping[ParameterName, Uncertainty],
) -> StaticFit:
    """The part of a fit that belongs to one direction, to both, or to what two directions share.

    `without` are the parameters without points that stick and slip, `three` their intervals three ways.
    """
    problem, theta = core.problem, core.solution.theta
    two, velocity, residuals = len(problem.directions) == 2, problem.equation_velocity, problem.residuals(theta)
    rows = np.ones(residuals.size, dtype=bool)
    if two and part != "shared":
        rows = velocity > 0 if part == "+" else velocity < 0
    rows[rows.size - problem.priors :] = False
    names = [name for name in problem.names if not two or name.direction is part]
    parameters = {name.name: core.parameters[name] for name in names}
    for name in names:  # what its three intervals say, unless it is at its bound
        one = parameters[name.name]
        if not any(warning.code == "at-bound" for warning in one.warnings):
            parameters[name.name] = replace(one, warnings=(*one.warnings, *three[name].warnings))
    if part != "shared" and part in core.dropped:
        lost = (core.dropped[part],)
        names_lost = peak_parameters(problem.law)
        parameters |= {n: Estimate(value=None, unit=unit(n, kind), warnings=lost) for n in names_lost}
    parameters |= {name.name: e for name, e in core.beside.items() if name.direction is part}
    whole = parameters.get("alpha_0")  # of what is shared there is none
    if "alpha_2" not in parameters and whole is not None and whole.value is not None and whole.interval is not None:
        # of one speed alone alpha_0 stands for all friction there, alpha_2 for none, with what is possible as their intervals
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
    outcome, peak = core.outcome, ParameterName("alpha_1", part)
    if peak in core.parameters and without and peak not in without:
        message = "The Stribeck term depends on points that stick and slip; without them it is not identifiable."
        outcome = Finding("static-stick-slip", CAUTION, message)
    return StaticFit(
        direction=part, law=problem.law, parameters={name: parameters[name] for name in order},
        rms=float(np.sqrt(np.mean(residuals[rows] ** 2))) if rows.any() else None,
        relative_error=float(100 * np.linalg.norm(residuals[rows]) / norm) if norm else None, n=int(rows.sum()),
        outcome=outcome, names=tuple(core.names[k].name for k in keep),
        covariance=core.covariance[np.ix_(keep, keep)], degrees_of_freedom=int(core.freedom),
        profile=core.profiles.get(part), uncertainty={name.name: three[name] for name in names},
        without_stick_slip={n.name: e for n, e in without.items() if not two or n.direction is part},
        velocity=velocity[rows], torque=torque[rows], residuals=residuals[rows],
        segments=tuple(s for s, row in zip(where.segments, rows.tolist(), strict=False) if row),
        time=where.time[rows[: where.time.size]], position=where.position[rows[: where.position.size]],
    )  # fmt: skip  # a list of values
