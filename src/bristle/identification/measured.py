"""What an experiment measured: its runs, read and cut into segments where the velocity is constant."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.data.bandwidth import decimation
from bristle.data.constant_velocity.segments import Segment, find_segments, nothing_left
from bristle.data.differentiation import estimate_motion, usable, without_short_segments
from bristle.data.experiment.load import Experiment, Run, in_amperes, load_experiment, read_runs
from bristle.data.record import Record
from bristle.data.signal_checks import merged
from bristle.data.torque_checks import at_limits
from bristle.errors import InputError, short, short_list
from bristle.findings import NOTE, Finding, unit_of
from bristle.identification.fits import Estimate
from bristle.identification.moving_runs import ONE_RATE, load_columns, longest_decimation, needed, terms_of, transient
from bristle.identification.static.points import PointSearch, point_regressors, search_points, without_strays

if TYPE_CHECKING:
    import pandas as pd

_STILL = 1e-12
"""Of the fastest point: a slower one is at rest, and its velocity rounding."""


_ROUNDING = 1e-12
"""Of a position: what unwrapping makes of it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """What an experiment measured: its runs, and the segments of those at constant velocity."""

    experiment: Experiment
    runs: tuple[Run, ...]
    segments: tuple[tuple[Segment, ...], ...]
    """Per run; empty for moving data."""
    searches: tuple[PointSearch, ...] = ()
    """Which points of each solve do not belong to its law."""
    findings: tuple[Finding, ...] = ()
    """What the joints of a robot together tell of this one."""
    torque_constant: Estimate | None = None
    """As the links of a robot tell it; None where it was not free."""
    link_inertia: float | None = None
    """What a joint of a robot has to accelerate of the links, on average over its runs, kg*m**2; None where no links are known."""

    def points(self, *, hold_out: bool) -> tuple[Segment, ...]:
        """Accepted velocity-torque points of the runs that are, or are not, held out."""
        pairs = zip(self.runs, self.segments, strict=True)
        return tuple(s for run, candidates in pairs if run.hold_out == hold_out for s in candidates if s.accepted)

    def moving(self, *, hold_out: bool) -> tuple[Record, ...]:
        """Records of the moving runs that are, or are not, held out."""
        return tuple(run.record for run in self.runs if run.kind == "tracking" and run.hold_out == hold_out)

    def to_frame(self) -> "pd.DataFrame":
        """One row per candidate at constant velocity: its mean velocity and torque in SI, whether it is kept, and why not.

        `start` and `stop` are its first sample and one past the last, from 0; the standard error is nan where none is known.
        """
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
        """Where signals contradict one another or themselves, files alike together."""
        return (*self.findings, *merged(d for run in self.runs for d in run.record.warnings))

    @property
    def positions(self) -> tuple[float, float] | None:
        """The lowest and the highest position of all runs, rad; None where no run has positions."""
        logged = [run.record.position for run in self.runs if run.record.position is not None]
        return (min(float(q.min()) for q in logged), max(float(q.max()) for q in logged)) if logged else None

    @property
    def travel(self) -> float | None:
        """From the lowest to the highest position, as declared under `plan` or as measured, rad; None where neither is known."""
        span = self.experiment.plan.position or self.positions
        return None if span is None else span[1] - span[0]

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
    refuse_repeated(experiment, runs)
    of_current = experiment.motor_constants is None and experiment.signals_of(experiment.runs[0]).drive() == "current"
    return measured_of(in_amperes(experiment, experiment.fit.regressors) if of_current else experiment, runs)


def measured_of(experiment: Experiment, runs: tuple[Run, ...]) -> Measured:
    """Runs that were read, the constant-velocity ones cut into segments. Raises InputError as `measure`."""
    experiment, runs = _filtered(experiment, runs)
    whole = Measured(experiment=experiment, runs=runs, segments=_included(experiment, runs))
    searches = search_points(experiment, whole.points(hold_out=False))
    left_out = {s.place: s for s in without_strays(experiment, searches)}
    segments = tuple(tuple(left_out.get(s.place, s) for s in candidates) for candidates in whole.segments)
    return replace(whole, segments=segments, searches=searches)


def _filtered(experiment: Experiment, runs: tuple[Run, ...]) -> tuple[Experiment, tuple[Run, ...]]:
    """With the decimation that the fitted moving runs need, and others through their low pass, where none is asked for."""
    runs = _beside_the_slowest(runs)
    moving = [run.record for run in runs if run.kind == "tracking"]
    fitted = [run.record for run in runs if run.kind == "tracking" and not run.hold_out]
    if fitted and experiment.fit.position_cutoff is None:
        widest = max(r.cutoff for r in fitted)
        runs = tuple(
            replace(run, record=_through(run.record, widest)) if run.kind == "tracking" and run.hold_out else run
            for run in runs
        )
    every = experiment.fit.decimation or 1
    if experiment.fit.decimation is None and moving:
        longest = min(int(np.diff([*r.starts, r.time.size]).max() / r.oversampled) for r in moving)
        every = longest_decimation(decimation(fitted or moving), longest)
    runs = tuple(replace(x, record=_decimable(x.record, every)) if x.kind == "tracking" else x for x in runs)
    return _asking(experiment, decimation=every), runs


def _decimable(record: Record, decimation: int) -> Record:
    """A moving run without what lies between two gaps that its decimation filter does not fit into, unless that is all."""
    shortest = transient(record.decimation(decimation)) + 1
    fits = np.diff([*record.starts, record.time.size]).max() >= shortest
    return without_short_segments(record, shortest, "decimated") if fits and record.velocity is not None else record


def _through(record: Record, cutoff: float) -> Record:
    """A moving run with its motion estimated anew, through the low pass of others."""
    kept = tuple(n for n in record.notes if n.code not in {"motion-from-position", "acceleration-from-velocity"})
    velocity = None if record.velocity_estimated else record.velocity
    return estimate_motion(replace(record, velocity=velocity, acceleration=None, notes=kept), cutoff)


def through_wider(measured: Measured, factor: float) -> Measured:
    """The same with the low pass of every moving run so many times as wide, and the decimation as it is."""
    runs = tuple(
        replace(run, record=_through(run.record, usable(run.record, factor * run.record.cutoff)))
        if run.kind == "tracking"
        else run
        for run in measured.runs
    )
    return replace(measured, runs=runs)


def in_time(measured: Measured, late: float) -> Measured:
    """The same with the torque of every moving run as it was logged so much later, s."""

    def earlier(record: Record) -> Record:
        """Of one run; beyond its end the last value stays."""

        def moved(x: Array) -> Array:
            """A signal, (n,)."""
            return np.interp(record.time + late, record.time, x)

        torque, voltage = (None if x is None else moved(x) for x in (record.torque, record.voltage))
        shifts = {name: moved(x) for name, x in record.torque_shifts.items()}
        return replace(record, torque=torque, voltage=voltage, torque_shifts=shifts)

    runs = (replace(run, record=earlier(run.record)) if run.kind == "tracking" else run for run in measured.runs)
    return replace(measured, runs=tuple(runs))


def _beside_the_slowest(runs: tuple[Run, ...]) -> tuple[Run, ...]:
    """With how much faster than the slowest each moving run was sampled, which its notes then say."""
    moving = [run.record for run in runs if run.kind == "tracking" and run.record.time.size > 1]
    if not moving:
        return runs
    slowest = max(moving, key=lambda record: record.step)

    def told(run: Run) -> Run:
        """The run, where it is faster with the note."""
        ratio = slowest.step / run.record.step
        if run.kind != "tracking" or not ratio > ONE_RATE or run.record.oversampled != 1:
            return run
        message = f"Sampled {ratio:.3g} times as fast as {slowest.file}: it is decimated by so much more, for equations as far apart."
        note = Finding("sampled-faster", NOTE, message, {"ratio": ratio, "slowest": slowest.file})
        return replace(run, record=replace(run.record, oversampled=ratio, notes=(*run.record.notes, note)))

    return tuple(map(told, runs))


def with_law(measured: Measured, law: str) -> Measured:
    """The same under another friction law, by which the points are judged anew."""
    asking = _asking(measured.experiment, law=law)
    if asking.fit.friction == measured.experiment.fit.friction:
        return replace(measured, experiment=asking)
    return with_options(measured, law=law)


def with_options(measured: Measured, **options: object) -> Measured:
    """The same with other options under `fit`, by which the points are judged anew."""
    experiment = _asking(measured.experiment, **options)
    posed = measured_of(experiment, measured.runs)
    return replace(measured, experiment=experiment, segments=posed.segments, searches=posed.searches)


def _asking(experiment: Experiment, **options: object) -> Experiment:
    """The experiment with other options under `fit`, of which its file set what it did."""
    fit = experiment.fit.model_copy(update=options)
    fit.model_fields_set.intersection_update(experiment.fit.model_fields_set)
    return experiment.model_copy(update={"fit": fit})


def nothing_to_fit(measured: Measured) -> str:
    """Why no run can be fitted, one sentence."""
    experiment = measured.experiment
    pairs = zip(measured.runs, measured.segments, strict=True)
    training = [(run, candidates) for run, candidates in pairs if run.kind in {"ramp", "points"} and not run.hold_out]
    if not training:
        return f"{experiment.path.name}: no run to fit (hold-out runs are never fitted); add one under runs"
    every = tuple(s for _, candidates in training for s in candidates)
    return nothing_left(every, tuple(run.record for run, _ in training), experiment.segments)


def refuse_repeated(experiment: Experiment, runs: Sequence[Run]) -> None:
    """Raise InputError where a run is given twice, which would count twice; a hold-out that was fitted is none."""
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
    """Whether two records of one file share rows and what they measured there: two joints of one file share rows alone."""
    rows = (a.time, b.time) if a.lines is None or b.lines is None else (a.lines, b.lines)
    _, of_a, of_b = np.intersect1d(*rows, return_indices=True)
    if not of_a.size:
        return False
    estimated = a.velocity_estimated or b.velocity_estimated
    names = ["torque" if a.voltage is None else "voltage", *([] if estimated else ["velocity"])]
    pairs = [(getattr(a, name), getattr(b, name)) for name in names]
    measured = [(x[of_a], y[of_b]) for x, y in pairs if x is not None and y is not None]
    alike = len(measured) == len(pairs) and all(np.array_equal(x, y) for x, y in measured)
    return alike and _moves_alike(a.position, b.position, of_a, of_b)


def _moves_alike(a: Array | None, b: Array | None, of_a: NDArray[np.intp], of_b: NDArray[np.intp]) -> bool:
    """Whether two positions are one in the rows that they share, but for the turn in which each begins."""
    if a is None or b is None:
        return (a is None) == (b is None)
    x, y = a[of_a] - a[of_a[0]], b[of_b] - b[of_b[0]]
    return bool(np.abs(x - y).max() <= _ROUNDING * max(np.abs(a).max(), np.abs(b).max()))


def _included(experiment: Experiment, runs: Sequence[Run]) -> tuple[tuple[Segment, ...], ...]:
    """The candidates of each run, those rejected that `fit.exclude` names. Raises InputError where it names none."""
    segments = [list(_segments(experiment, run)) for run in runs]
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


def _segments(experiment: Experiment, run: Run) -> tuple[Segment, ...]:
    if run.kind == "ramp":
        found = find_segments(run.record, experiment.segments, experiment.encoder_resolution)
        return with_loads(run.record, found, ("gravity", *point_regressors(experiment)))
    return _given_points(run.record, experiment.segments.minimum_velocity) if run.kind == "points" else ()


def with_loads(record: Record, segments: tuple[Segment, ...], asked: Sequence[str]) -> tuple[Segment, ...]:
    """The segments with what terms of the position are on average while the joint passes: over a long hold not what they are in its middle."""
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
    fast = np.abs(velocity) >= (slowest or 0.0)
    clipped = at_limits(record, "points")

    def against(k: int) -> tuple[Finding, ...]:
        """Why a point is rejected."""
        if not moving[k]:
            message = "At rest: friction at zero velocity is not a function of velocity; remove such rows."
            return (Finding("point-at-rest", NOTE, message),)
        if not fast[k]:
            speed = abs(float(velocity[k]))
            message = f"Slower than segments.minimum_velocity: {speed:.3g}{unit_of('velocity')}, and {slowest:.3g}{unit_of('velocity')} is required."
            return (Finding("point-too-slow", NOTE, message, {"speed": speed, "least": slowest}),)
        return (Finding("saturated", NOTE, "Its torque is at the largest of the file: clipped."),) if clipped[k] else ()

    reasons = [against(k) for k in range(velocity.size)]
    return tuple(
        Segment(
            file=record.file,
            start=k,
            stop=k + 1,
            line=None if record.lines is None else int(record.lines[k]),
            velocity=float(v),
            torque=float(t),
            standard_error=None,
            accepted=not reasons[k],
            reasons=reasons[k],
            labels=record.labels,
            position=None if record.position is None else float(record.position[k]),
            torque_shifts={name: float(shift[k]) for name, shift in record.torque_shifts.items()},
        )
        for k, (v, t) in enumerate(zip(velocity, torque, strict=True))
    )
