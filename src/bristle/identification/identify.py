"""From an experiment file to everything found out about its joint: reading, segments, static fits, cross-check."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from bristle.arrays import Array
from bristle.data.constant_velocity.segments import Segment, find_segments, nothing_left, unit_mistake
from bristle.data.experiment.load import Experiment, Run, load_experiment, read_runs
from bristle.data.record import Record
from bristle.diagnostics import Diagnostic, Kind
from bristle.errors import InputError
from bristle.identification.dynamic.priors import fit_with_priors
from bristle.identification.model_selection import compare_on_motion, compare_on_points
from bristle.identification.moving_runs import (
    DIRECTIONS,
    gravity,
    refuse_mixed_rates,
    refuse_opposing,
    refuse_opposing_runs,
)
from bristle.identification.moving_runs import regressors as asked_regressors
from bristle.identification.presliding.fit import identify_presliding, with_damping
from bristle.identification.presliding.stiffness import KnownValue
from bristle.identification.results import (
    Consistency,
    Crosscheck,
    Estimate,
    Input,
    Joint,
    ModelComparison,
    Presliding,
    StaticFit,
    TrackingFit,
)
from bristle.identification.static import problem
from bristle.identification.static.fit import PointInfo, fit_static
from bristle.identification.static.moving_data import fit_moving
from bristle.identification.static.problem import Regression
from bristle.model.parameters import INERTIA, Direction, ParameterName


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """What an experiment measured: its runs, and the segments of those at constant velocity."""

    experiment: Experiment
    runs: tuple[Run, ...]
    segments: tuple[tuple[Segment, ...], ...]
    """Per run; empty for moving data."""

    def points(self, *, hold_out: bool) -> tuple[Segment, ...]:
        """Accepted velocity-torque points of the runs that are, or are not, held out."""
        pairs = zip(self.runs, self.segments, strict=True)
        return tuple(s for run, found in pairs if run.hold_out == hold_out for s in found if s.accepted)

    def moving(self, *, hold_out: bool) -> tuple[Record, ...]:
        """Records of the moving runs that are, or are not, held out."""
        return tuple(run.record for run in self.runs if run.kind == "tracking" and run.hold_out == hold_out)

    @property
    def slow(self) -> tuple[Record, ...]:
        """Records of the presliding runs that are fitted."""
        return tuple(run.record for run in self.runs if run.kind == "presliding" and not run.hold_out)


def measure(experiment: Experiment | Path | str) -> Measured:
    """Read an experiment's runs and cut the constant-velocity ones into segments.

    Raises InputError where a file cannot be read as declared, in one sentence.
    """
    experiment = experiment if isinstance(experiment, Experiment) else load_experiment(experiment)
    runs = read_runs(experiment)
    _refuse_repeated(experiment, runs)
    return Measured(experiment=experiment, runs=runs, segments=tuple(_segments(experiment, run) for run in runs))


def identify_joint(
    measured: Measured,
    timings: dict[str, float] | None = None,
    *,
    crosscheck: bool = False,
    uncertainty: bool = False,
    progress: Callable[[str, int, int], None] | None = None,
) -> Joint:
    """Everything that an experiment tells of its joint, with intervals and warnings, cross-checked.

    Points at constant velocity give the static parameters where there are any, else the moving runs do, with their regressors; slow runs give the
    presliding ones; moving runs give all, alone and with the other stages as priors. Seconds spent are written into `timings` by name; they are no
    part of the result. With `crosscheck` the fit of the moving runs is solved by CasADi and IPOPT as well, which takes long; with `uncertainty` its
    parameters get their intervals by profile and bootstrap too, as static and presliding ones always do, and `progress` is told how far that is.

    Raises InputError where no run can be fitted, saying which threshold ate what.
    """
    experiment = measured.experiment
    training, held = measured.moving(hold_out=False), measured.moving(hold_out=True)
    if training:
        refuse_mixed_rates([*training, *held])
        refuse_opposing_runs(experiment, training)
    elif experiment.fit.predict == "position":
        raise InputError(
            f"{experiment.path.name}: fit.predict: position needs a tracking run to fit; add one under runs, or leave predict out"
        )
    points, slow = measured.points(hold_out=False), measured.slow
    static, checks, left_out = _static(measured, points, timings)
    alone, both, agree, presliding = None, None, tuple[Consistency, ...](), None
    if slow and not training:
        presliding = _presliding(experiment, slow, static)
    if training:
        started = perf_counter()
        load = partial(_presliding, experiment, slow) if slow else None
        alone, both, agree, presliding = fit_with_priors(
            experiment,
            training,
            held,
            static,
            load,
            static_is_apart=bool(points),
            crosscheck=crosscheck,
            uncertainty=uncertainty,
            progress=progress,
        )
        if timings is not None:
            timings["moving runs"] = perf_counter() - started
        J = (both or alone).parameters.get(INERTIA)
        if presliding is not None and experiment.inertia is None and J is not None and J.value:
            known = KnownValue(J.value, J.standard_error or 0.0, "the moving runs")
            presliding = with_damping(presliding, known, experiment.joint.kind)
    return Joint(
        name=experiment.joint.name,
        kind=experiment.joint.kind,
        inputs=tuple(_input(run.record) for run in measured.runs),
        segments=tuple(s for found in measured.segments for s in found),
        static=static,
        crosscheck=checks,
        presliding=presliding,
        tracking=alone,
        joint_fit=both,
        consistency=agree,
        models=_models(measured, points, static, alone, timings),
        warnings=(*_joint_warnings(measured, static, bool(points)), *left_out),
        truth=experiment.truth,
        simulated=experiment.simulated,
        assumptions=experiment.assumptions,
        settings=_settings(experiment, moving=bool(training)),
    )


def _static(
    measured: Measured, points: Sequence[Segment], timings: dict[str, float] | None
) -> tuple[dict[str, StaticFit], dict[str, Crosscheck], tuple[Diagnostic, ...]]:
    """Static fits and their cross-checks from the points, or else from the moving runs; and warnings about what was left out."""
    training, kinds = measured.moving(hold_out=False), {run.kind for run in measured.runs}
    if points:
        return *_fit_points(measured, points, timings), ()
    if training:
        by_velocity = measured.experiment.fit.predict == "torque"
        held = measured.moving(hold_out=True)
        return fit_moving(measured.experiment, training, held, timings) if by_velocity else ({}, {}, ())
    if not measured.slow or kinds & {"ramp", "points"}:
        raise InputError(_nothing_to_fit(measured))
    return {}, {}, ()


def _models(
    measured: Measured,
    points: Sequence[Segment],
    static: Mapping[str, StaticFit],
    alone: TrackingFit | None,
    timings: dict[str, float] | None,
) -> tuple[ModelComparison, ...]:
    """Friction models side by side, on the points and on the moving runs."""
    experiment, started, found = measured.experiment, perf_counter(), list[ModelComparison | None]()
    if points:
        held = measured.points(hold_out=True)

        def pose(directions: tuple[str, ...], asked: Sequence[str]) -> tuple[Regression, Sequence[Regression]]:
            """The regression of the points, and of those held out."""
            asked = tuple(r for r in asked if r != "inertia")
            return _points_problem(points, directions, asked), [
                _points_problem(own, directions, asked) for own in (held,) if own
            ]

        found.append(compare_on_points(experiment, np.array([s.velocity for s in points]), pose, static))
    if alone is not None:
        records, tests = measured.moving(hold_out=False), measured.moving(hold_out=True)
        found.append(compare_on_motion(experiment, records, tests, {} if points else static, alone))
    if timings is not None:
        timings["models"] = perf_counter() - started
    return tuple(x for x in found if x is not None)


def _nothing_to_fit(measured: Measured) -> str:
    """Why no run can be fitted, one sentence."""
    experiment = measured.experiment
    pairs = zip(measured.runs, measured.segments, strict=True)
    training = [(run, found) for run, found in pairs if run.kind in {"ramp", "points"} and not run.hold_out]
    if not training:
        return f"{experiment.path.name}: no run to fit (hold-out runs are never fitted); add one under runs"
    candidates = tuple(s for _, found in training for s in found)
    return nothing_left(candidates, tuple(run.record for run, _ in training), experiment.segments)


def _refuse_repeated(experiment: Experiment, runs: Sequence[Run]) -> None:
    """A run given twice would count twice, and a hold-out that was fitted is none."""
    for k, run in enumerate(runs):
        for other in runs[:k]:
            a, b = run.record, other.record
            same = a.sha256 == b.sha256 and run.kind == other.kind and a.time.size == b.time.size
            if same and all(_equal(getattr(a, name), getattr(b, name)) for name in ("time", "torque", "velocity")):
                what = "is held out and fitted as well" if run.hold_out != other.hold_out else "is given twice"
                raise InputError(
                    f"{experiment.path.name}: runs: {a.file} {what} (as {b.file}, the same bytes); name each run once"
                )


def _equal(a: Array | None, b: Array | None) -> bool:
    return (a is None) == (b is None) and (a is None or b is None or np.array_equal(a, b))


def _segments(experiment: Experiment, run: Run) -> tuple[Segment, ...]:
    if run.kind == "ramp":
        return find_segments(run.record, experiment.segments, experiment.encoder_resolution)
    return _given_points(run.record) if run.kind == "points" else ()


_STILL = 1e-12
"""Of the fastest point: a slower one is at rest, and its velocity rounding."""


def _given_points(record: Record) -> tuple[Segment, ...]:
    velocity, torque = record.velocity, record.torque
    if velocity is None or torque is None:
        raise InputError(f"{record.file}: points need the signals velocity and torque; name both under signals")
    moving = np.abs(velocity) > _STILL * np.abs(velocity).max(initial=0.0)
    return tuple(
        Segment(
            file=record.file,
            start=k,
            stop=k + 1,
            velocity=float(v),
            torque=float(t),
            standard_error=None,
            accepted=bool(moves),
            reasons=() if moves else (Kind.POINT_AT_REST(),),
            labels=record.labels,
            position=None if record.position is None else float(record.position[k]),
        )
        for k, (v, t, moves) in enumerate(zip(velocity, torque, moving, strict=True))
    )


def _fit_points(
    measured: Measured, points: Sequence[Segment], timings: dict[str, float] | None
) -> tuple[dict[str, StaticFit], dict[str, Crosscheck]]:
    experiment = measured.experiment
    regressors = tuple(experiment.fit.regressors or ())
    if measured.moving(hold_out=False):  # which can tell the inertia, as points cannot
        regressors = tuple(r for r in regressors if r != "inertia")
    if "inertia" in regressors:
        raise InputError(
            f"{experiment.path.name}: fit.regressors: inertia needs acceleration, which constant-velocity points do not have; "
            "leave it out, or give the runs as experiment: tracking"
        )
    held = measured.points(hold_out=True)
    if experiment.fit.directions == "symmetric":
        groups: list[tuple[tuple[str, ...], tuple[Segment, ...]]] = [(("both",), tuple(points))]
    else:
        groups = [((d,), tuple(s for s in points if s.velocity * sign > 0)) for d, sign in DIRECTIONS.items()]
        groups = [(d, own) for d, own in groups if own]
        if regressors and len(groups) == 2:  # what both directions share comes from one solve
            groups = [(tuple(DIRECTIONS), tuple(points))]
    static: dict[str, StaticFit] = {}
    checks: dict[str, Crosscheck] = {}
    for d, sign in DIRECTIONS.items() if not regressors else ():
        v, T = (np.array([getattr(s, x) for s in points if s.velocity * sign > 0]) for x in ("velocity", "torque"))
        refuse_opposing(experiment, v, T, f"at the {v.size} points of direction {d}")
    for directions, own in groups:
        signs = [DIRECTIONS[d] for d in directions if d in DIRECTIONS] or list(DIRECTIONS.values())
        by_file = {s.file: [h for h in held if h.file == s.file and np.sign(h.velocity) in signs] for s in held}
        tests = [(file, _points_problem(s, directions, regressors)) for file, s in by_file.items() if s]
        fits, checked = fit_static(
            _points_problem(own, directions, regressors),
            experiment.fit,
            experiment.joint.kind,
            _where(own),
            tests,
            timings,
        )
        static |= fits
        checks |= checked
    return static, checks


def _points_problem(points: Sequence[Segment], directions: tuple[str, ...], regressors: Sequence[str]) -> Regression:
    extra: dict[str, Array] = {}
    if "offset" in regressors:
        extra["offset"] = np.ones(len(points))
    if "gravity" in regressors:
        if any(s.position is None for s in points):
            raise InputError(
                "fit.regressors: gravity needs the position of every point; add position under signals, or leave gravity out"
            )
        extra |= gravity(np.array([s.position for s in points], dtype=float))
    velocity, torque = np.array([s.velocity for s in points]), np.array([s.torque for s in points])
    return problem.from_points(velocity, torque, directions, extra)


def _where(points: Sequence[Segment]) -> PointInfo:
    def known(values: list[float | None]) -> Array:
        """The values, or none of them where any is missing."""
        return np.zeros(0) if any(x is None for x in values) else np.array(values, dtype=float)

    alone = len({s.file for s in points})  # a run of one point has no course over time
    return PointInfo(
        segments=tuple(points),
        time=known([s.time for s in points]) if alone < len(points) else np.zeros(0),
        position=known([s.position for s in points]),
    )


def _presliding(
    experiment: Experiment, slow: Sequence[Record], fit: Mapping[str, StaticFit] | TrackingFit
) -> Presliding:
    """sigma_0 and sigma_1 from the slow runs, with g0 from the static fits, or from a fit of moving runs."""
    levels = {d: level for d in DIRECTIONS if (level := _level(fit, d)) is not None}
    J = experiment.inertia
    known = None if J is None else KnownValue(J.value, J.standard_error or 0.0, "the experiment file")
    return identify_presliding(
        slow, levels, known, experiment.fit, experiment.encoder_resolution, experiment.joint.kind
    )


def _level(found: Mapping[str, StaticFit] | TrackingFit, direction: str) -> KnownValue | None:
    """g0 = alpha_0 + alpha_1 of a direction, with the error that their covariance gives; alpha_0 alone where no Stribeck term was seen."""
    moving = isinstance(found, TrackingFit)
    fit = found if isinstance(found, TrackingFit) else found.get(direction) or found.get("both")
    if fit is None:
        return None
    estimates: Mapping[Any, Estimate] = fit.parameters
    wanted = [
        key
        for name in ("alpha_0", "alpha_1")
        for key in (name, ParameterName(name, Direction(direction)), ParameterName(name, Direction.BOTH))
    ]
    terms = [key for key in wanted if key in estimates and estimates[key].value]
    if not terms or terms[0] not in wanted[:3]:
        return None
    value = sum(estimates[key].value or 0.0 for key in terms)
    share = np.array([float(name in terms) for name in fit.names])
    error = float(np.sqrt(share @ fit.covariance @ share)) if share.size else 0.0
    source = "the moving runs" if moving else "the static fit"
    return KnownValue(
        value,
        error,
        source if len(terms) == 2 else f"alpha_0 of {source}, which {'show' if moving else 'shows'} no peak",
    )


def _input(record: Record) -> Input:
    return Input(
        file=record.file,
        sha256=record.sha256,
        rows=record.rows,
        dropped=record.dropped,
        notes=record.notes,
        labels=record.labels,
    )


def _joint_warnings(measured: Measured, static: dict[str, StaticFit], from_points: bool) -> tuple[Diagnostic, ...]:
    experiment, warnings = measured.experiment, []
    if experiment.fit.directions == "separate" and len(set(static) & set(DIRECTIONS)) == 1:
        other = next(d for d in DIRECTIONS if d not in static)
        tried = sum(s.velocity * DIRECTIONS[other] > 0 for found in measured.segments for s in found)
        why = Kind.NONE_KEPT(tried=tried) if tried else Kind.NOT_MEASURED()
        warnings.append(Kind.DIRECTION_UNKNOWN(direction=other, why=why))
    warnings += _segment_warnings(measured)
    if not from_points and experiment.fit.directions == "separate":
        warnings.append(Kind.OFFSET_LEFT_OUT())
    unused = [run.record.file for run in measured.runs if run.kind == "presliding" and run.hold_out]
    if unused:
        warnings.append(Kind.HELD_OUT_UNUSED(files=tuple(unused)))
    if experiment.truth and not experiment.simulated:
        warnings.append(Kind.TRUTH_UNDECLARED())
    return tuple(warnings)


def _segment_warnings(measured: Measured) -> list[Diagnostic]:
    """Warnings about kept segments, counted: each is listed with its segment."""
    kept = measured.points(hold_out=False)
    warnings = []
    differ = sum(any(d.kind is Kind.POSITION_DIFFERS for d in s.warnings) for s in kept)
    if differ:
        looks = Counter(filter(None, (unit_mistake(run.record) for run in measured.runs))).most_common(1)
        hint = Kind.LOOKS_LIKE(what=looks[0][0]) if looks else ""
        warnings.append(Kind.POSITIONS_DISAGREE(differ=differ, kept=len(kept), looks=hint))
    others = sum(any(d.kind not in {Kind.POSITION_DIFFERS, Kind.STICK_SLIP} for d in s.warnings) for s in kept)
    if others:
        warnings.append(Kind.TORQUES_DOUBTED(doubted=others, kept=len(kept)))
    return warnings


def _settings(experiment: Experiment, *, moving: bool) -> dict[str, str]:
    fit = experiment.fit
    settings = {
        "directions": fit.directions,
        "loss": fit.loss,
        "grid": f"{fit.grid} values of v_s, even in log(v_s), refined to the continuous minimum",
        "plain grid": f"{fit.plain_grid} evenly spaced values of v_s",
        "v_s range": "a third of the slowest speed to the fastest"
        if fit.v_s_range is None
        else f"{fit.v_s_range[0]:g} to {fit.v_s_range[1]:g}",
    }
    if moving:
        settings |= {
            "position filter": f"4th-order Butterworth, zero phase, {fit.position_cutoff:g} Hz",
            "decimation": f"one sample in {fit.decimation}, both sides through 0.8 of the new Nyquist frequency, zero phase",
            "regressors": ", ".join(asked_regressors(experiment)) or "none",
        }
        if fit.predict == "position":
            settings |= {
                "moving runs": f"the motor simulated in windows of {fit.horizon:g} s, and its position averaged over {fit.decimation} samples; "
                "position filter and decimation serve the start alone"
            }
        if experiment.inertia is not None:
            known = experiment.inertia
            settings["inertia"] = (
                f"{known.value:g} (fixed)"
                if not known.standard_error
                else f"{known.value:g} +/- {known.standard_error:g} (prior)"
            )
    return settings
