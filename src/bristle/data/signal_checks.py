"""Checks of the signals of a record against one another, before anything is fitted; none knows a friction law."""

from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from bristle.arrays import Array
from bristle.data import units
from bristle.data.columns import ISO
from bristle.data.differentiation import between_gaps
from bristle.data.encoder import apart, count_mismatch, other_units, smallest_step
from bristle.data.experiment.schema import RunKind
from bristle.data.experiment.signals import Context, Signal, Signals, si
from bristle.data.record import OTHER_FILES, OTHER_PLACES, Record
from bristle.data.sampling import BLOCK, DEVIATIONS
from bristle.data.torque_checks import check_torque
from bristle.errors import InputError
from bristle.findings import CAUTION, CRITICAL, Finding

_FACTOR = 0.05  # by which velocity and position differ at most: sampling rates and gears are known better than that
_TIMES = ("s", "ms", "us")
_SPANS = (1, 4, 16, 64, 256)  # samples over which travel is compared: noise hides a short one, a reversal a long one
_FEWEST = 20  # spans that tell a factor
_AROUND = 5  # samples on either side that tell the usual travel of one
_JUMP = 10.0  # standard deviations of a step, beyond which it is a jump: noise of steps is no worse
_NAMED = 4  # places in one sentence


class TravelRatio(NamedTuple):
    """Travel of the position over that of the logged velocity."""

    value: float  # geometric mean of the two regressions; negative where they go opposite ways
    low: float  # least abs(value) that the noise of either signal allows
    high: float
    correlation: float


def check_signals(record: Record, kind: RunKind, signals: Signals, context: Context) -> tuple[Finding, ...]:
    """Findings on the signals of a run by themselves; of points on their torque alone."""
    found: list[Finding | None] = [*check_torque(record, kind)]
    if kind != "points":
        found += [_velocity_factor(record, signals, context), position_jumps(record, signals, context)]
        found.append(count_mismatch(record, signals.position, context))
    return tuple(filter(None, found))


def check_units(file: str, stated: Mapping[str, str], signals: Signals) -> tuple[Finding, ...]:
    """Signals whose unit is not the one that the file states of their column, `stated` by signal.

    A signal with a scale other than 1 or -1 was thought about, and is left alone.
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
            message = f"The header of {file}{OTHER_FILES} states {unit} for {name}, and {declared} is declared: write {remedy}."
            numbers = {"files": (file,), "signal": name, "stated": unit, "declared": declared, "remedy": remedy}
            found.append(Finding("unit-differs", CAUTION, message, numbers))
    return tuple(found)


def merged(found: Iterable[Finding]) -> tuple[Finding, ...]:
    """Findings, those of one code and remedy merged into one that names all files, with the numbers of the first."""
    groups, said = dict[tuple[str, str], list[Finding]](), list[Finding]()
    for d in found:
        groups.setdefault((d.code, str(d.numbers.get("remedy", ""))), []).append(d)
    for _, (first, *others) in sorted(groups.items(), key=lambda x: x[0]):
        files = shortened([file for x in (first, *others) for file in x.numbers["files"]])
        message = first.message
        for mark, between in ((OTHER_FILES, ", "), (OTHER_PLACES, "; ")):
            message = message.replace(mark, "".join(f"{between}{file}" for file in files[1:]))
        said.append(replace(first, message=message, numbers={**first.numbers, "files": files}))
    return tuple(sorted(said, key=lambda d: d.severity is not CRITICAL))


def travel_ratio(record: Record) -> TravelRatio | None:
    """Ratio of the position's travel to the integral of the logged velocity.

    Regression of one on the other, over spans of the record, is low by the noise of the regressor and high by that of
    the other (Fuller, Measurement Error Models, 1987, section 1.1): the truth lies between. None where a signal is
    missing, the velocity was estimated from the position, or too little moves.
    """
    if record.position is None or record.velocity is None or record.velocity_estimated:
        return None
    area = np.concatenate([[0.0], np.cumsum((record.velocity[1:] + record.velocity[:-1]) / 2 * np.diff(record.time))])
    best: TravelRatio | None = None
    for span in _SPANS:
        ends = [np.arange(s.start, s.stop, span) for s in between_gaps(record)]
        moved, said = (np.concatenate([np.diff(x[k]) for k in ends]) for x in (record.position, area))
        if moved.size < _FEWEST or not (moved.any() and said.any()):
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
    # a velocity and its position correlate by 0.7 over a span, unless one is noise, which is not smooth
    if abs(ratio.correlation) < 0.7:
        position, velocity = np.asarray(record.position)[:: _SPANS[2]], np.asarray(record.velocity)
        both = (np.diff(position), velocity[:: _SPANS[2]] - velocity.mean())
        if any(x.size < 2 * _FEWEST or float(x[1:] @ x[:-1]) < 0.5 * float(x @ x) for x in both):
            return None
        message = (
            f"The logged velocity of {record.file}{OTHER_FILES} has nothing to do with its position (correlation "
            f"{ratio.correlation:.2f}): name the right column under signals.velocity, or leave it out."
        )
        numbers: dict[str, Any] = {"files": (record.file,), "correlation": ratio.correlation}
        return Finding("velocity-unrelated", CRITICAL, message, numbers, {"torque": np.inf})
    sure = ratio.high < 2.0 * ratio.low  # a factor is told where noise leaves it uncertain by less than this
    if not sure or (ratio.value > 0 and ratio.low < 1 + _FACTOR and ratio.high > 1 - _FACTOR):
        return None
    remedy = " or ".join(_remedies(signals, context, ratio.value))
    message = (
        f"The position of {record.file}{OTHER_FILES} moves {ratio.value:.3g} times as far as its logged velocity says: one "
        f"of the two is wrong by this factor, and with it friction against speed. What makes them agree: {remedy}."
    )
    numbers = {"files": (record.file,), "ratio": ratio.value, "remedy": remedy}
    return Finding("velocity-factor", CRITICAL, message, numbers)


def _remedies(signals: Signals, context: Context, ratio: float) -> list[str]:
    """Remedies that make position and velocity agree: units that are this far apart, else a factor; and a sign."""
    size = abs(ratio)
    if context.gear and apart(max(size, 1 / size), abs(context.gear.ratio)) < _FACTOR:
        return [f"the other side for {name} under motor.gear" for name in ("velocity", "position")]
    lines = list[str]()
    if not apart(size, 1.0) < _FACTOR:
        for name, wanted in (("velocity", size), ("position", 1 / size)):
            signal: Signal | None = getattr(signals, name)
            if signal is not None and not signal.unit.strip().startswith("count"):
                others = other_units(name, signal, context)
                near = [u for u, by in others if u != "counts" and apart(by, wanted) < _FACTOR]
                lines += [f"`unit: {u}` under signals.{name}" for u in near]
        time, rate = signals.time, None if signals.time is None else signals.time.rate
        if time is not None and time.unit not in {None, ISO}:
            now = units.factor(time.unit or "s", "s")
            near = [x for x in _TIMES if apart(units.factor(x, "s") / now, size) < _FACTOR]
            lines += [f"`unit: {x}` under signals.time" for x in near]
        if not lines:
            lines.append(f"a `scale` of signals.velocity {size:.3g} times as large")
            lines += [] if rate is None else [f"`rate: {rate / size:.3g} Hz` under signals.time"]
    return lines + ["the opposite sign of `scale` under signals.velocity or signals.position"] * (ratio < 0)


def shortened(names: list[str]) -> tuple[str, ...]:
    """A few of the names, and how many more there are."""
    more = len(names) - _NAMED
    return tuple(names) if more <= 1 else (*names[:_NAMED], f"and {more} more")


def position_jumps(record: Record, signals: Signals, context: Context) -> Finding | None:
    """The caution on steps of the position in motion that neither speed nor time explains."""
    if record.position is None or record.time.size < 2 * BLOCK:
        return None
    count = smallest_step(record.position)
    places = list[tuple[int, float, float]]()
    for s in between_gaps(record):
        if s.stop - s.start >= 2 * BLOCK:
            found = _jumps(np.diff(record.position[s]), np.diff(record.time[s]) / record.step, count)
            places += [(s.start + k + 1, size, travel) for k, size, travel in found]
    if not places:
        return None
    _, sizes, travels = np.abs(np.array(places)).T
    if sizes.size > 20 and np.ptp(sizes) < 0.1 * sizes.mean() and np.median(travels) > _JUMP:
        return None  # alike, among next to no travel: the counts of an encoder under something that drifts

    # where they are: lines of a text file, else rows of data
    word, rate = "row" if record.lines is None else "line", None if signals.time is None else signals.time.rate
    if record.lines is not None:
        rows = [int(record.lines[k]) for k, *_ in places]
    else:
        rows = [round(float(record.time[k]) * rate) + 1 if rate else k + 1 for k, *_ in places]
    where = f"{record.file} {word}{'s' * (len(rows) > 1)} {', '.join(shortened(list(map(str, rows))))}"
    place = f"{where} (by {'up to ' * (len(rows) > 1)}{sizes.max():.2g} {si('position', context)}, {travels.max():.2g} samples)"
    message = (
        f"The position jumps: {place}{OTHER_PLACES}. Samples are lost, or the encoder slips, misses counts or is reset: speeds "
        "from it are wrong there. Log the time of each sample, mend the encoder, or split the log."
    )
    return Finding("position-jumps", CAUTION, message, {"files": (place,), "size": float(sizes.max())})


def _jumps(steps: Array, intervals: Array, count: float) -> list[tuple[int, float, float]]:
    """Places of jumps among steps (n,), over intervals (n,); by how much, and the travel of how many samples."""
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    windows = np.lib.stride_tricks.sliding_window_view(steps, _AROUND)
    inner = np.arange(_AROUND, steps.size - _AROUND)
    before, after = np.median(windows[inner - _AROUND], axis=1), np.median(windows[inner + 1], axis=1)
    usual = np.where(np.abs(before) > np.abs(after), before, after)
    off = steps[inner] - (before + after) / 2
    along, travel = steps[inner] * np.sign(usual), np.abs(usual) * np.maximum(intervals[inner], 1.0)
    excess = np.where(along > 0, np.maximum(along - travel, 0.0), along)  # a stop is none
    size = np.abs(excess)

    # the noise of the noisiest block about each, from the median of deviations
    blocks = np.array_split(np.abs(off), max(off.size // BLOCK, 1))
    padded = np.pad(np.array([np.median(b) for b in blocks]) / 0.6745, 1, mode="edge")
    widest = np.maximum(np.maximum(padded[:-2], padded[1:-1]), padded[2:])
    noise = np.repeat(widest, [b.size for b in blocks])

    # at a reversal, 25 samples about it, a jump is play; 0.75 samples' travel, and less is none
    side = np.sign(usual)
    one_way = minimum_filter1d(side, 51) * maximum_filter1d(side, 51) > 0
    found = (before * after > 0) & one_way & (size > 0.75 * np.abs(usual)) & (size > _JUMP * noise + 2 * count)
    found &= np.abs(np.convolve(off, np.ones(2 * _AROUND + 1), "same")) > 0.5 * np.abs(off)  # it does not come back
    best = [k for k in np.flatnonzero(found) if size[k] >= size[max(k - _AROUND, 0) : k + _AROUND + 1].max()]
    lost = np.where(excess < 0, excess - travel, excess)
    return [(int(inner[k]), float(lost[k]), float(lost[k] / abs(usual[k]))) for k in best]
