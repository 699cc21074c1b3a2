"""Whether the signals of a record agree with one another, before anything is fitted; no check knows a friction law."""

from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from bristle.data import motion_checks, units
from bristle.data.columns import ISO
from bristle.data.encoder import apart, count_mismatch, other_units
from bristle.data.experiment.schema import RunKind
from bristle.data.experiment.signals import Context, Signal, Signals
from bristle.data.record import OTHER_FILES, OTHER_PLACES, Record
from bristle.data.sampling import DEVIATIONS
from bristle.data.torque_checks import check_torque
from bristle.errors import InputError
from bristle.findings import CAUTION, CRITICAL, Finding

_FACTOR = 0.05
"""Velocity and position of one motion differ by less: sampling rates and gears are known better than that."""
_TIMES = ("s", "ms", "us")


class TravelRatio(NamedTuple):
    """Travel of the position over that of the logged velocity."""

    value: float  # geometric mean of the two regressions; negative where they go opposite ways
    low: float  # least abs(value) that the noise of either signal allows
    high: float
    correlation: float


def check_signals(record: Record, kind: RunKind, signals: Signals, context: Context) -> tuple[Finding, ...]:
    """What is wrong with the signals of a run as it is fitted, as far as they show it by themselves; of points with their torque alone."""
    found: list[Finding | None] = [*check_torque(record, kind)]
    factor = None if kind == "points" else _velocity_factor(record, signals, context)
    if kind != "points":
        found += [
            factor,
            motion_checks.position_jumps(record, signals, context),
            motion_checks.held_position(record, signals),
        ]
        found.append(count_mismatch(record, signals.position, context))
    if kind == "tracking":
        found += [motion_checks.irregular_sampling(record), None if factor else motion_checks.velocity_lag(record)]
    return tuple(filter(None, found))


def check_units(file: str, stated: Mapping[str, str], signals: Signals) -> tuple[Finding, ...]:
    """Signals whose unit is another than the one that the file states of their column, `stated` by signal.

    A signal with a scale other than 1 or -1 was thought about, and nothing is said of it.
    """
    found = []
    for name, unit in stated.items():
        signal = getattr(signals, name)
        plain = not isinstance(signal, Signal) or abs(units.scale_parts(signal.scale)[0]) == 1
        declared = signal.unit
        alike = declared is not None and declared.strip().startswith("count")
        with suppress(InputError):
            alike = alike or bool(unit and declared and abs(units.factor(unit, declared) - 1) < 1e-6)
        if unit and declared and plain and declared != ISO and not alike:
            remedy = f"`unit: {unit}` under signals.{name}"
            message = (
                f"Unit of {name}: the header of {file}{OTHER_FILES} states {unit}, and {declared} is declared. Write {remedy}; where the header "
                "is wrong, correct it, or leave the unit out of it."
            )
            numbers = {"files": (file,), "signal": name, "stated": unit, "declared": declared, "remedy": remedy}
            found.append(Finding("unit-differs", CAUTION, message, numbers))
    return tuple(found)


def merged(found: Iterable[Finding]) -> tuple[Finding, ...]:
    """The same, those of one kind and one remedy as one that names all their files, with the numbers of the first."""
    groups, said = dict[tuple[str, str], list[Finding]](), list[Finding]()
    for d in found:
        groups.setdefault((d.code, str(d.numbers.get("remedy", ""))), []).append(d)
    for _, (first, *others) in sorted(groups.items(), key=lambda x: x[0]):
        files = motion_checks.shortened([file for x in (first, *others) for file in x.numbers["files"]])
        message = first.message
        for mark, between in ((OTHER_FILES, ", "), (OTHER_PLACES, "; ")):
            message = message.replace(mark, "".join(f"{between}{file}" for file in files[1:]))
        said.append(replace(first, message=message, numbers={**first.numbers, "files": files}))
    return tuple(sorted(said, key=lambda d: d.severity is not CRITICAL))


def travel_ratio(record: Record) -> TravelRatio | None:
    """How many times as far the position moves as the integral of the logged velocity.

    Regression of one on the other, over spans of the record, is low by the noise of the regressor and high by that of
    the other (Fuller, Measurement Error Models, 1987, section 1.1): the truth lies between. None where a signal is
    missing, the velocity was estimated from the position, or too little moves.
    """
    best: TravelRatio | None = None
    for moved, said, _ in motion_checks.travels(record):
        if moved.size < motion_checks.FEWEST or not (moved.any() and said.any()):
            continue
        across, moved_2, said_2 = float(moved @ said), float(moved @ moved), float(said @ said)
        correlation = across / np.sqrt(moved_2 * said_2)
        size = max(abs(correlation), 1e-9)
        value = np.sqrt(moved_2 / said_2)
        error = np.sqrt(max(1 - size**2, 0.0) / (moved.size - 2)) / size
        away = size * np.exp(-min(DEVIATIONS * error, 50.0))  # by which a factor is surely not one
        found = TravelRatio(float(np.copysign(value, correlation)), value * away, value / away, correlation)
        if best is None or found.low * best.high > best.low * found.high:
            best = found
    return best


def _velocity_factor(record: Record, signals: Signals, context: Context) -> Finding | None:
    ratio = travel_ratio(record)
    if ratio is None:
        return None
    # correlation over a span that a velocity and its position have, where neither is mere noise
    if (
        abs(ratio.correlation) < 0.7
    ):  # a velocity that is smooth, while the position moves smoothly too: noise is neither
        position, velocity = np.asarray(record.position)[:: motion_checks.SPANS[2]], np.asarray(record.velocity)
        both = (np.diff(position), velocity[:: motion_checks.SPANS[2]] - velocity.mean())
        if any(x.size < 2 * motion_checks.FEWEST or float(x[1:] @ x[:-1]) < 0.5 * float(x @ x) for x in both):
            return None
        message = (
            f"The logged velocity of {record.file}{OTHER_FILES} has nothing to do with its position (correlation {ratio.correlation:.2f}): name "
            "the right column under signals.velocity, or leave velocity out to have it estimated."
        )
        numbers: dict[str, Any] = {"files": (record.file,), "correlation": ratio.correlation}
        return Finding(
            "velocity-unrelated", CRITICAL, message, numbers, {"torque": np.inf}
        )  # no curve is known from it
    sure = ratio.high < 2.0 * ratio.low  # a factor is told where noise leaves it uncertain by less than this
    if not sure or (ratio.value > 0 and ratio.low < 1 + _FACTOR and ratio.high > 1 - _FACTOR):
        return None
    remedy = " or ".join(_remedies(signals, context, ratio.value))
    message = (
        f"The position of {record.file}{OTHER_FILES} moves {ratio.value:.3g} times as far as its logged velocity says: one of the two is wrong "
        f"by this factor, and with it friction against speed. What makes them agree: {remedy}."
    )
    numbers = {"files": (record.file,), "ratio": ratio.value, "remedy": remedy}
    return Finding("velocity-factor", CRITICAL, message, numbers)


def _remedies(signals: Signals, context: Context, ratio: float) -> list[str]:
    """Lines that would make position and velocity agree: units that are this far apart, or else a factor; and a sign."""
    size = abs(ratio)
    if context.gear and apart(max(size, 1 / size), abs(context.gear.ratio)) < _FACTOR:
        return [f"the other side for {name} under motor.gear" for name in ("velocity", "position")]
    lines = list[str]()
    if not apart(size, 1.0) < _FACTOR:
        for name, wanted in (("velocity", size), ("position", 1 / size)):
            signal: Signal | None = getattr(signals, name)
            if signal is not None and not signal.unit.strip().startswith("count"):
                units_of = other_units(name, signal, context)
                lines += [
                    f"`unit: {u}` under signals.{name}"
                    for u, by in units_of
                    if u != "counts" and apart(by, wanted) < _FACTOR
                ]
        time, rate = signals.time, None if signals.time is None else signals.time.rate
        if time is not None and time.unit not in {None, ISO}:
            now = units.factor(time.unit or "s", "s")
            lines += [
                f"`unit: {x}` under signals.time" for x in _TIMES if apart(units.factor(x, "s") / now, size) < _FACTOR
            ]
        if not lines:
            lines.append(f"a `scale` of signals.velocity {size:.3g} times as large")
            lines += [] if rate is None else [f"`rate: {rate / size:.3g} Hz` under signals.time"]
    turned = ["the opposite sign of `scale` under signals.velocity or signals.position"]
    return [*lines, *(turned if ratio < 0 else [])]
