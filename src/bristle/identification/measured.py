"""Runs of an experiment, read and cut into segments at constant velocity."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bristle.data.bandwidth import decimation
from bristle.data.constant_velocity.segments import Segment, find_segments, nothing_left
from bristle.data.differentiation import Choice, estimate_motion, without_short_segments
from bristle.data.experiment.load import Experiment, Run, in_own_unit, load_experiment, read_runs
from bristle.data.record import Record
from bristle.data.sampling import averaged, with_motion
from bristle.data.signal_checks import merged
from bristle.errors import InputError, short, short_list
from bristle.estimation import levels
from bristle.findings import NOTE, Finding, unit_of
from bristle.identification.fits import Estimate
from bristle.identification.moving_runs import load_columns, longest_decimation, needed, terms_of, transient
from bristle.identification.static.points import PointSearch, point_regressors, search_points, without_strays

if TYPE_CHECKING:
    import pandas as pd

_SAMPLES = 64  # least samples of an equation, beyond which means of them are taken
_STILL = 1e-12  # of the fastest point: slower ones are at rest


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """The runs of an experiment, and their segments at constant velocity."""

    experiment: Experiment
    runs: tuple[Run, ...]
    segments: tuple[tuple[Segment, ...], ...]
    """Per run; empty for moving data."""
    searches: tuple[PointSearch, ...] = ()
    """Strays of each solve."""
    findings: tuple[Finding, ...] = ()
    """Findings from all joints of a robot together."""
    torque_constant: Estimate | None = None
    """Estimated from a robot's links; None where it was not free."""
    link_inertia: float | None = None
    """Mean inertia of a robot's links at the joint, kg*m**2, or None."""

    def points(self, *, hold_out: bool) -> tuple[Segment, ...]:
        """Accepted points of the runs that are, or are not, held out."""
        pairs = zip(self.runs, self.segments, strict=True)
        return tuple(s for run, candidates in pairs if run.hold_out == hold_out for s in candidates if s.accepted)

    def moving(self, *, hold_out: bool) -> tuple[Record, ...]:
        """Records of the moving runs that are, or are not, held out."""
        return tuple(run.record for run in self.runs if run.kind == "tracking" and run.hold_out == hold_out)

    def to_frame(self) -> "pd.DataFrame":
        """A row per candidate segment, SI; `start` is its first sample, `stop` one past the last."""
        import pandas as pd

        rows = [
            (
                s.file, s.velocity, s.torque, s.standard_error, s.accepted, "; ".join(map(str, s.reasons)),
                "; ".join(map(str, s.warnings)), s.start, s.stop,
            )
            for found in self.segments
            for s in found
        ]  # fmt: skip  # a row
        columns = ["file", "velocity", "torque", "standard_error", "accepted", "reasons", "warnings", "start", "stop"]
        return pd.DataFrame(rows, columns=columns)

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """Findings of all records, equal ones of several files merged."""
        return (*self.findings, *merged(d for run in self.runs for d in run.record.warnings))

    @property
    def positions(self) -> tuple[float, float] | None:
        """Lowest and highest position of all runs, rad; None without positions."""
        logged = [run.record.position for run in self.runs if run.record.position is not None]
        return (min(float(q.min()) for q in logged), max(float(q.max()) for q in logged)) if logged else None

    @property
    def travel(self) -> float | None:
        """From lowest to highest position, declared under `plan` or measured, rad, or None."""
        span = self.experiment.plan.position or self.positions
        return None if span is None else span[1] - span[0]

    @property
    def slow(self) -> tuple[Record, ...]:
        """Records of the presliding runs to fit."""
        return tuple(run.record for run in self.runs if run.kind == "presliding" and not run.hold_out)


def measure(experiment: Experiment | Path | str) -> Measured:
    """Read an experiment's runs and cut out constant velocities, or a motion if too few. Raises InputError."""
    experiment = experiment if isinstance(experiment, Experiment) else load_experiment(experiment)
    runs = read_runs(experiment)
    refuse_repeated(experiment, runs)
    drive, coasting = experiment.signals_of(experiment.runs[0]).drive(), experiment.coasting
    unknown = coasting.known is None if coasting else experiment.motor_constants is None
    if unknown and drive != "torque":
        experiment = in_own_unit(experiment, experiment.fit.regressors)
    measured = measured_of(experiment, runs)
    held, logged = len(measured.points(hold_out=False)), all(run.record.position is not None for run in runs)
    if held >= levels.HELD_SPEEDS or not logged or {run.kind for run in runs if not run.hold_out} != {"ramp"}:
        return measured

    # too few constant velocities for points: taken as a motion
    moving = [x.model_copy(update={"experiment": "tracking"}) if x.experiment == "ramp" else x for x in experiment.runs]
    experiment = experiment.model_copy(update={"runs": tuple(moving)})
    message = f"Constant velocities held: {held}, too few for points; taken as a motion, of which all samples are used."
    note = Finding("few-held", NOTE, message, {"held": held})
    runs = changed(read_runs(experiment), lambda record: replace(record, notes=(*record.notes, note)))
    return measured_of(experiment, runs)


def judged(whole: Measured) -> Measured:
    """The same with strays left out."""
    searches = search_points(whole.experiment, whole.points(hold_out=False))
    left_out = {s.place: s for s in without_strays(whole.experiment, searches)}
    segments = tuple(tuple(left_out.get(s.place, s) for s in candidates) for candidates in whole.segments)
    return replace(whole, segments=segments, searches=searches)


def measured_of(experiment: Experiment, runs: tuple[Run, ...]) -> Measured:
    """Runs cut into segments; moving ones get one decimation and low pass. Raises as `measure` does."""
    moving = [run.record for run in runs if run.kind == "tracking"]
    slowest = max((r for r in moving if r.time.size > 1), key=lambda r: r.step, default=None)

    def beside_slowest(record: Record) -> Record:  # with a note if it was sampled faster
        if slowest is None or not (ratio := slowest.step / record.step) > levels.ONE_RATE or record.oversampled != 1:
            return record
        message = f"Sampled {ratio:.3g} times as fast as {slowest.file}: it is decimated by so much more, for equations as far apart."
        note = Finding("sampled-faster", NOTE, message, {"ratio": ratio, "slowest": slowest.file})
        return replace(record, oversampled=ratio, notes=(*record.notes, note))

    runs = changed(runs, beside_slowest)
    fitted = [run.record for run in runs if run.kind == "tracking" and not run.hold_out]
    if fitted and experiment.fit.position_cutoff is None:
        widest = max(r.cutoff for r in fitted)
        runs = tuple(changed((run,), lambda r: refiltered(r, widest))[0] if run.hold_out else run for run in runs)
    every, moving = experiment.fit.decimation or 1, [run.record for run in runs if run.kind == "tracking"]
    if experiment.fit.decimation is None and moving:
        longest = min(max(_stretches(r)) / r.oversampled for r in moving)
        every = longest_decimation(decimation(fitted or moving), int(longest))

    runs = changed(runs, lambda r: decimable(r, every) or r)
    if experiment.fit.decimation is None:
        # of runs that are sampled far faster than their equations need, means of samples
        at_once = _at_once(every)
        runs, every = changed(runs, lambda r: _averaged(r, _at_once(r.decimation(every)), at_once)), every // at_once
    experiment = _with_fit_options(experiment, decimation=every)
    return judged(Measured(experiment=experiment, runs=runs, segments=_cut_segments(experiment, runs)))


def decimable(record: Record, every: int) -> Record | None:
    """A moving run without stretches between gaps that are too short for the decimation filter; None where all are."""
    shortest = transient(record.decimation(every)) + 1
    if np.diff([*record.starts, record.time.size]).max() < shortest:
        return None
    return record if record.velocity is None else without_short_segments(record, shortest, "decimated")


def _at_once(every: int) -> int:
    """Samples of each mean, an odd number, where so many make an equation."""
    return max((every // _SAMPLES - 1) // 2 * 2 + 1, 1)


def _averaged(record: Record, count: int, slowest: int) -> Record:
    """The record with means of some samples, and those of the slowest."""
    if count == 1:
        return record
    note = Finding(
        "samples-averaged", NOTE, f"Of every {count} samples the mean is taken, which the low pass hardly alters."
    )
    return replace(
        averaged(record, count), oversampled=record.oversampled * slowest / count, notes=(*record.notes, note)
    )


def _stretches(record: Record) -> list[int]:
    """Samples of each stretch between gaps and unknown torques; without any, of all there is."""
    edges = np.union1d([*record.starts, record.time.size], np.flatnonzero(np.diff(record.lost)) + 1)
    known = ~record.lost[edges[:-1]]
    return list(np.diff(edges)[known if known.any() else ...])


def changed(runs: Sequence[Run], change: Callable[[Record], Record]) -> tuple[Run, ...]:
    """The runs with other records of the moving ones."""
    return tuple(replace(run, record=change(run.record)) if run.kind == "tracking" else run for run in runs)


def refiltered(record: Record, cutoff: float | Choice, *, logged: bool = True) -> Record:
    """A moving run with its motion estimated again through another low pass, Hz, from its velocity if `logged`."""
    kept = tuple(n for n in record.notes if n.code not in {"motion-from-position", "acceleration-from-velocity"})
    whole = record.fine or record
    velocity = whole.velocity if logged and not whole.velocity_estimated else None
    position = None if whole.integrated else whole.position
    moved = estimate_motion(replace(whole, position=position, velocity=velocity, acceleration=None, notes=kept), cutoff)
    return with_motion(record, replace(moved, position=whole.position))


def with_options(measured: Measured, **options: object) -> Measured:
    """The same with other options under `fit`."""
    experiment = _with_fit_options(measured.experiment, **options)
    return judged(replace(measured, experiment=experiment, segments=_cut_segments(experiment, measured.runs)))


def _with_fit_options(experiment: Experiment, **options: object) -> Experiment:
    """The experiment with other options under `fit`, `model_fields_set` unchanged."""
    fit = experiment.fit.model_copy(update=options)
    fit.model_fields_set.intersection_update(experiment.fit.model_fields_set)
    return experiment.model_copy(update={"fit": fit})


def nothing_to_fit(measured: Measured) -> str:
    """Why no run can be fitted."""
    experiment = measured.experiment
    pairs = zip(measured.runs, measured.segments, strict=True)
    training = [(run.record, found) for run, found in pairs if run.kind in {"ramp", "points"} and not run.hold_out]
    if not training:
        return f"{experiment.path.name}: no run to fit (hold-out runs are never fitted); add one under runs"
    records, candidates = zip(*training, strict=True)
    return nothing_left(tuple(s for found in candidates for s in found), records)


def refuse_repeated(experiment: Experiment, runs: Sequence[Run]) -> None:
    """Raise InputError where a run is given twice, or both fitted and held out."""
    for k, run in enumerate(runs):
        for other in runs[:k]:
            a, b = run.record, other.record
            same = a.sha256 == b.sha256 and run.kind == other.kind
            if same and _overlap(a, b):
                what = "is held out and fitted as well" if run.hold_out != other.hold_out else "is given twice"
                raise InputError(
                    f"{experiment.path.name}: runs: {a.file} {what} (as {b.file}, the same bytes, with rows in common); name each run once, "
                    "and parts of a file that do not overlap"
                )


def _overlap(a: Record, b: Record) -> bool:
    """Whether two records of one file share rows of the same torque."""
    rows = (a.time, b.time) if a.lines is None or b.lines is None else (a.lines, b.lines)
    _, of_a, of_b = np.intersect1d(*rows, return_indices=True)
    x, y = (r.torque if r.voltage is None else r.voltage for r in (a, b))
    return bool(of_a.size) and x is not None and y is not None and np.array_equal(x[of_a], y[of_b])


def _cut_segments(experiment: Experiment, runs: Sequence[Run]) -> tuple[tuple[Segment, ...], ...]:
    """Candidate segments of each run, `fit.exclude` applied. Raises InputError where it names none."""
    segments: list[list[Segment]] = []
    for run in runs:
        found: tuple[Segment, ...] = ()
        if run.kind == "ramp":
            found = find_segments(run.record, experiment.segments, experiment.encoder_resolution)
            found = with_loads(run.record, found, ("gravity", "spring", *point_regressors(experiment)))
        elif run.kind == "points":
            found = _given_points(run.record, experiment.segments.minimum_velocity)
        segments.append(list(found))
    for number, excluded in enumerate(experiment.fit.exclude, 1):
        first, last = excluded.rows
        named = [
            (candidates, k)
            for candidates in segments
            for k, s in enumerate(candidates)
            if s.file == excluded.file and s.rows[0] <= last and first <= s.rows[1]
        ]
        if not named:
            files = short_list([run.record.file for run in runs])
            raise InputError(
                f"{experiment.path.name}: fit.exclude: entry {number} names no point or segment (lines or rows {first} to {last} of "
                f"{short(excluded.file)}); expected rows as `bristle inspect` prints them, of one of: {files}"
            )
        reason = Finding("excluded", NOTE, "Excluded: fit.exclude names it.")
        for candidates, k in named:
            candidates[k] = replace(candidates[k], accepted=False, reasons=(reason,))
    return tuple(map(tuple, segments))


def with_loads(record: Record, segments: tuple[Segment, ...], asked: Sequence[str]) -> tuple[Segment, ...]:
    """The segments with means of position-dependent regressors over each hold."""
    q = record.position
    if q is None:
        return segments
    placed = [name for name in asked if "position" in terms_of(name).needs]
    columns = load_columns(placed, lambda name: needed(record, name), q.size)
    return tuple(
        replace(s, loads={name: float(x[s.start : s.stop].mean()) for name, x in columns.items()}) for s in segments
    )


def _given_points(record: Record, slowest: float | None) -> tuple[Segment, ...]:
    velocity, torque = record.velocity, record.torque
    if velocity is None or torque is None:
        raise InputError(f"{record.file}: points need the signals velocity and torque; name both under signals")
    moving = np.abs(velocity) > _STILL * np.abs(velocity).max(initial=0.0)

    reasons: list[tuple[Finding, ...]] = []
    for k, speed in enumerate(np.abs(velocity).tolist()):
        if not moving[k]:
            message = "At rest: friction at zero velocity is not a function of velocity; remove such rows."
            reasons.append((Finding("point-at-rest", NOTE, message),))
        elif speed < (slowest or 0.0):
            message = f"Slower than segments.minimum_velocity: {speed:.3g}{unit_of('velocity')}, and {slowest:.3g}{unit_of('velocity')} is required."
            reasons.append((Finding("point-too-slow", NOTE, message, {"speed": speed, "least": slowest}),))
        else:
            message = "Its torque is at the largest of the file: clipped."
            reasons.append((Finding("saturated", NOTE, message),) if record.lost[k] else ())
    return tuple(
        Segment(
            file=record.file, start=k, stop=k + 1, line=None if record.lines is None else int(record.lines[k]),
            velocity=float(v), torque=float(t), standard_error=None, accepted=not reasons[k], reasons=reasons[k],
            labels=record.labels, position=None if record.position is None else float(record.position[k]),
            torque_shifts={name: float(shift[k]) for name, shift in record.torque_shifts.items()},
        )
        for k, (v, t) in enumerate(zip(velocity, torque, strict=True))
    )  # fmt: skip  # a list of values
