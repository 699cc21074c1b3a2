"""Columns as logged to a `Record`: units, bad rows, time stamps, gaps, wrapped positions; each change is counted."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.data import units
from bristle.data.encoder import whole_positions
from bristle.data.experiment.constants import ONE, commanded_torque, followed_at_once
from bristle.data.experiment.schema import MotorConstants
from bristle.data.experiment.signals import COMMANDS, Cleaning, Command, Context, Position, Signal, Signals, Time
from bristle.data.experiment.tables import keys_of
from bristle.data.record import Record
from bristle.data.sampling import evenly_sampled
from bristle.data.text_table import RawTable
from bristle.errors import InputError
from bristle.estimation import levels
from bristle.findings import CAUTION, NOTE, Finding

_LARGEST = 1e20  # of a signal in SI; its inverse is the smallest: beyond, squares overflow, and a unit is wrong
_STEPS = (1e-12, 1e12)  # seconds that a sampling interval may have


@dataclass(slots=True)
class _Rows:
    """The rows that are left, by signal, and findings on the others."""

    data: dict[str, Array]
    number: NDArray[np.intp]  # line of each row in the file, or row of data, from 1
    word: str  # `line` or `row`
    notes: list[Finding]
    warnings: list[Finding] = field(default_factory=list)
    # rows before each one in which the drive was off; empty where it never was
    off_before: NDArray[np.intp] = field(default_factory=lambda: np.zeros(0, dtype=np.intp))

    def drop(self, bad: NDArray[np.bool_], why: Finding, refused: str = "") -> None:
        """Leave rows out, with a finding whose message goes on after their number, the first of them in its braces.

        Raises InputError, with what is wrong and what to do, where they are `refused`.
        """
        if not bad.any():
            return
        count, first = int(bad.sum()), f"(first: {self.word} {self.number[np.argmax(bad)]})"
        if refused:
            raise InputError(f"{_count(count)} {first} {refused}")
        message = f"{_count(count)} {why.message.format(first)}."
        self.notes.append(replace(why, message=message, numbers={"rows": count}))
        self.data = {name: values[~bad] for name, values in self.data.items()}
        self.number = self.number[~bad]
        self.off_before = self.off_before[~bad] if self.off_before.size else self.off_before


def make_record(
    file: str,
    table: RawTable,
    signals: Signals,
    cleaning: Cleaning,
    context: Context,
    *,
    labels: Mapping[str, str] | None = None,
    points: bool = False,
    motor: MotorConstants | None = None,
) -> Record:
    """The record of a time series or, with `points`, of velocity-torque pairs, whose time counts them.

    A logged current is in `torque`, A. Raises InputError where the data cannot be used as declared.
    """
    rows = _scaled(table, signals, context)
    if not points and signals.time is not None and signals.time.rate is not None:
        rows.data["time"] = np.arange(table.rows) / signals.time.rate if table.time is None else table.time
        message = f"Time from the declared rate of {signals.time.rate:g} Hz."
        rows.notes.append(Finding("rate-declared", NOTE, message, {"rate": signals.time.rate}))
    _drop_bad(rows, table, cleaning)
    if points:
        _enough(rows)
        _refuse_constant(rows)
        before = 0 if table.numbers is None else int(table.numbers[0]) - 1 - (table.header or 0)
        rows.data["time"] = np.arange(rows.number.size, dtype=float) + before
        return _record(file, table, rows, (0,), labels or {})
    _drop_by_time(rows, cleaning)
    _enough(rows)
    starts = _gaps(rows, cleaning.gap, stamped="time" in keys_of(signals))
    if signals.position is not None:
        whole = whole_positions(file, table.columns[keys_of(signals)["position"]], signals.position, context)
        rows.warnings += [whole] if whole else []
        _unwrap(rows, signals.position, context, told=whole is not None)
    if signals.drive() == "command":
        motor = motor or ONE
        period = None if signals.position is None else signals.position.period(context)
        held = signals.command.held if signals.command else False
        if signals.command is not None and signals.command.fresh:  # the commands alone are late
            for name in COMMANDS.keys() & rows.data.keys():
                _take(rows, name, signals.command, starts)
        rows.data["torque"] = commanded_torque(rows.data, motor, starts, period, held=bool(held))
        rows.warnings += [followed_at_once(file, rows.data, motor, context)] if held is None else []
        rows.data = {name: values for name, values in rows.data.items() if name not in COMMANDS}
    _refuse_constant(rows)
    for logged, signal in signals:
        if isinstance(signal, Signal) and not (isinstance(signal, Command) and signal.fresh):
            _take(rows, "torque" if logged in COMMANDS else logged, signal, starts)
    record = _record(file, table, rows, starts, labels or {})
    off = np.flatnonzero(np.diff(rows.off_before) > 0) + 1 if rows.off_before.size else ()
    return evenly_sampled(record, {*off}) if cleaning.times == "auto" else record


def _record(file: str, table: RawTable, rows: _Rows, starts: tuple[int, ...], labels: Mapping[str, str]) -> Record:
    drive: dict[str, Any] = {("torque" if name == "current" else name): values for name, values in rows.data.items()}
    return Record(
        file=file,
        **drive,
        starts=starts,
        rows=table.rows,
        dropped=table.rows - rows.number.size,
        lines=rows.number if rows.word == "line" else None,
        sha256=table.sha256,
        notes=tuple(rows.notes),
        warnings=tuple(rows.warnings),
        labels=labels,
    )


def _scaled(table: RawTable, signals: Signals, context: Context) -> _Rows:
    data = {}
    for name, key in keys_of(signals).items():
        signal: Signal | Time = getattr(signals, name)
        if isinstance(signal, Signal):
            data[name] = table.columns[key] * signal.factor(name, context)
        else:
            time = table.time
            data[name] = table.columns[key] * units.factor(signal.unit or "s", "s") if time is None else time
        size = np.abs(data[name], where=np.isfinite(data[name]), out=np.zeros(data[name].shape))
        largest = float(size.max(initial=0.0))
        if largest and not 1 / _LARGEST < largest < _LARGEST:
            expected = f"between {1 / _LARGEST:g} and {_LARGEST:g}; check its unit and scale"
            raise InputError(f"{name} reaches {largest:.3g} (SI) at most; expected {expected}")
    return _Rows(data, table.lines, "row" if table.header is None else "line", list(table.notes))


def _drop_bad(rows: _Rows, table: RawTable, cleaning: Cleaning) -> None:
    """Leave out rows with values that are not finite, and rows in which the drive is off."""
    bad = np.zeros(table.rows, dtype=bool)
    for name, values in rows.data.items():
        missing = ~np.isfinite(values)
        if missing.all():
            what = f"no finite number in any of {table.rows} rows"
            raise InputError(f"{name} holds {what}; name the column that was logged")
        bad |= missing
    if bad.all() and cleaning.non_finite == "drop":
        raise InputError(f"no row of {table.rows} is finite in every signal; leave out a signal that was not logged")
    refused = "not finite (inf, nan or empty); correct the log, or declare cleaning: {non_finite: drop}"
    why = Finding("rows-not-finite", CAUTION, "dropped: inf, nan or empty {}")
    rows.drop(bad, why, refused * (cleaning.non_finite == "refuse"))
    off = rows.data.pop("enabled", np.ones(0)) == 0
    if off.any() and off.all():
        what = f"enabled is 0 in all {off.size} rows: the drive was never on"
        raise InputError(f"{what}; name another column, or leave enabled out")
    rows.off_before = np.cumsum(off) if off.any() else rows.off_before
    said = "left out {}: the drive is off there and the motor open, so its command is not a torque"
    rows.drop(off, Finding("rows-motor-off", NOTE, said))


def _drop_by_time(rows: _Rows, cleaning: Cleaning) -> None:
    time = rows.data["time"]
    seen = np.maximum.accumulate(time)
    behind = np.append(False, time[1:] < seen[:-1])[: time.size]
    twice = np.append(False, time[1:] <= seen[:-1])[: time.size] & ~behind
    if twice.mean() > levels.REPEATED and np.ptp(time) > 0:
        step = float(np.median(np.diff(np.unique(time))))
        raise InputError(
            f"the time stamp of {100 * twice.mean():.0f} % of the rows repeats the one before: its column counts in steps of {step:.3g} s; "
            "name one with more digits, or give the rate in its place, as in --rate '100 Hz' (time: {rate: 100 Hz})"
        )
    k, remedy = int(np.argmax(behind)), "split the log, or declare cleaning: {backward: drop}"
    refused = f"at which time runs backward ({seen[k - 1]:.9g} s to {time[k]:.9g} s); {remedy}"
    runs_back = Finding("rows-backward", CAUTION, "dropped: time runs backward {}")
    rows.drop(behind, runs_back, refused * (cleaning.backward == "refuse"))
    rows.drop(twice[~behind], Finding("rows-repeated", CAUTION, "dropped: a time stamp repeats {}"))


def _gaps(rows: _Rows, gap: float, *, stamped: bool) -> tuple[int, ...]:
    """First samples of the segments between gaps; notes the regularity of time."""
    intervals = np.diff(rows.data["time"])
    step = float(np.median(intervals))
    if not _STEPS[0] < step < _STEPS[1]:
        spans = f"time spans {rows.data['time'][0]:.9g} s to {rows.data['time'][-1]:.9g} s in steps of {step:.3g} s"
        raise InputError(f"{spans}; check the unit of time, or the rate")
    off = np.diff(rows.off_before) > 0 if rows.off_before.size else np.zeros(intervals.size, dtype=bool)
    wide = (intervals > gap * step) & ~off
    worst = float(np.abs(intervals[~(wide | off)] - step).max(initial=0.0)) / step
    if stamped:
        message = f"Sampling interval {step:.4g} s (median, {1 / step:.6g} Hz); jitter: at most {100 * worst:.0f} %."
        rows.notes.append(Finding("sampling", NOTE, message, {"step": step, "rate": 1 / step, "jitter": 100 * worst}))
    if wide.any():
        count, longest = int(wide.sum()), float(intervals.max())
        longer = f"longer than {gap:g} intervals (cleaning.gap), the longest {longest:.4g} s"
        apart = "the parts between gaps are treated separately, unless the motion beside one shows what happened"
        message = f"{count} gap{'s' * (count != 1)} {longer}; {apart}."
        rows.notes.append(Finding("gaps", CAUTION, message, {"gaps": count, "longest": longest}))
    return (0, *(int(k) + 1 for k in np.flatnonzero(wide | off)))


def _unwrap(rows: _Rows, signal: Position, context: Context, *, told: bool) -> None:
    position, period = rows.data["position"], signal.period(context)
    jumps = np.diff(position)
    if period is not None:
        rows.data["position"] = np.unwrap(position, period=period)
        turns = int((np.abs(jumps) > period / 2).sum())
        unit, times = "rad" if context.kind == "revolute" else "m", f"{turns} time{'s' * (turns != 1)}"
        message = f"Position wraps at {period:.6g} {unit}: unwrapped {times}."
        rows.notes.append(Finding("unwrapped", NOTE, message, {"period": period, "turns": turns}))
    elif context.kind_of("position") == "revolute" and signal.wraps is None and not told:
        turn = 2 * np.pi * abs(context.to_joint("position"))
        full = np.flatnonzero(np.abs(np.abs(jumps) / turn - 1) < levels.FULL_TURN)
        if full.size:
            first = f"(first: {rows.word} {rows.number[full[0] + 1]})"
            raise InputError(
                f"position jumps by a full turn between samples, {full.size} times {first}; declare wraps: true under "
                "signals.position, or wraps: false if the joint does move so fast"
            )


def _take(rows: _Rows, name: str, signal: Signal, starts: tuple[int, ...]) -> None:
    """Move a signal by its declared delay: linear between samples, held beyond the ends of a segment."""
    time, delay, late = rows.data["time"], abs(signal.delay), signal.delay > 0
    if not delay:
        return
    if not delay < levels.LATEST * (time[-1] - time[0]):
        got = f"{name}: delay: got {signal.delay:g} s in a run of {time[-1] - time[0]:.3g} s"
        raise InputError(f"{got}; expected less than a tenth of it, such as 1 ms")
    parts = zip(np.split(time, starts[1:]), np.split(rows.data[name], starts[1:]), strict=True)
    rows.data[name] = np.concatenate([np.interp(t + signal.delay, t, values) for t, values in parts])
    way = "earlier" if late else "later"
    message = f"{name.capitalize()} taken {delay:.4g} s {way} than logged: the declared delay."
    rows.notes.append(Finding("taken-earlier" if late else "taken-later", NOTE, message, {"delay": delay}))


def _enough(rows: _Rows) -> None:
    if rows.number.size < 2:
        raise InputError(f"only {_count(rows.number.size)} left; expected a log with many samples")


def _refuse_constant(rows: _Rows) -> None:
    for name, values in rows.data.items():
        if name != "time" and (values == values[0]).all():
            estimated = ", or leave velocity out to have it estimated from position"
            raise InputError(
                f"{name} is {values[0]:g} (SI) in all {values.size} rows, which is a set point or a dead sensor, not a "
                f"measurement; name another column{estimated * (name == 'velocity' and 'position' in rows.data)}"
            )


def _count(count: int) -> str:
    return f"{count} row{'s' * (count != 1)}"
