"""Checks of the signals of a record against one another, before anything is fitted; none knows a friction law."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
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
from bristle.data.sampling import BLOCK, jitter
from bristle.data.torque_checks import check_torque
from bristle.errors import InputError
from bristle.estimation import levels
from bristle.estimation.autocorrelation import inflation
from bristle.findings import CAUTION, CRITICAL, Finding

_TIMES = ("s", "ms", "us")
SPANS = (1, 4, 16, 64, 256)  # samples over which travel is compared: noise hides a short one, a reversal a long one
_AROUND = 5  # samples on either side that tell the usual travel of one
_NAMED = 4  # places in one sentence
_BESIDE = 20  # samples on either side of a held reading that tell its speed


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
        found += [factor := velocity_factor(record, signals, context), position_jumps(record, signals, context)]
        found += [held_position(record, signals), count_mismatch(record, signals.position, context)]
    if kind == "tracking":
        found += [irregular_sampling(record), None if factor else velocity_lag(record)]
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
            message = (
                f"Unit of {name}: the header of {file}{OTHER_FILES} states {unit}, and {declared} is declared. Write {remedy}; "
                "where the header is wrong, correct it, or leave the unit out of it."
            )
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
    best: TravelRatio | None = None
    for moved, said, _ in travels(record):
        if moved.size < levels.ENOUGH or not (moved.any() and said.any()):
            continue
        across, moved_2, said_2 = float(moved @ said), float(moved @ moved), float(said @ said)
        correlation = across / np.sqrt(moved_2 * said_2)
        size = max(abs(correlation), 1e-9)
        value = np.sqrt(moved_2 / said_2)
        error = np.sqrt(max(1 - size**2, 0.0) / (moved.size - 2)) / size
        away = size * np.exp(-min(levels.DEVIATIONS * error, 50.0))  # by which a factor is surely not one
        found = TravelRatio(float(np.copysign(value, correlation)), value * away, value / away, correlation)
        if best is None or found.low * best.high > best.low * found.high:
            best = found
    return best


def velocity_factor(record: Record, signals: Signals, context: Context) -> Finding | None:
    """The finding on a logged velocity that is another than its position's by a factor, or that has nothing to do with it."""
    ratio = travel_ratio(record)
    if ratio is None:
        return None
    if abs(ratio.correlation) < levels.UNRELATED:
        position, velocity = np.asarray(record.position)[:: SPANS[2]], np.asarray(record.velocity)
        both = (np.diff(position), velocity[:: SPANS[2]] - velocity.mean())
        if any(x.size < 2 * levels.ENOUGH or float(x[1:] @ x[:-1]) < 0.5 * float(x @ x) for x in both):
            return None
        message = (
            f"The logged velocity of {record.file}{OTHER_FILES} has nothing to do with its position (correlation "
            f"{ratio.correlation:.2f}): name the right column under signals.velocity, or leave velocity out to have it "
            "estimated."
        )
        numbers: dict[str, Any] = {"files": (record.file,), "correlation": ratio.correlation}
        return Finding("velocity-unrelated", CRITICAL, message, numbers, {"torque": np.inf})
    sure = ratio.high < levels.FACTOR_KNOWN * ratio.low
    if not sure or (ratio.value > 0 and ratio.low < 1 + levels.SAME_FACTOR and ratio.high > 1 - levels.SAME_FACTOR):
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
    if context.gear and apart(max(size, 1 / size), abs(context.gear.ratio)) < levels.SAME_FACTOR:
        return [f"the other side for {name} under motor.gear" for name in ("velocity", "position")]
    lines = list[str]()
    if not apart(size, 1.0) < levels.SAME_FACTOR:
        for name, wanted in (("velocity", size), ("position", 1 / size)):
            signal: Signal | None = getattr(signals, name)
            if signal is not None and not signal.unit.strip().startswith("count"):
                others = other_units(name, signal, context)
                near = [u for u, by in others if u != "counts" and apart(by, wanted) < levels.SAME_FACTOR]
                lines += [f"`unit: {u}` under signals.{name}" for u in near]
        time, rate = signals.time, None if signals.time is None else signals.time.rate
        if time is not None and time.unit not in {None, ISO}:
            now = units.factor(time.unit or "s", "s")
            near = [x for x in _TIMES if apart(units.factor(x, "s") / now, size) < levels.SAME_FACTOR]
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
    """The caution on steps of the position in motion that neither speed nor time explains, or on lost samples."""
    if record.position is None or record.time.size < 2 * BLOCK:
        return None
    count = smallest_step(record.position)
    places, counted = [], True
    for s in between_gaps(record):
        if s.stop - s.start < 2 * BLOCK:
            continue
        intervals = np.diff(record.time[s]) / record.step
        found = _jumps(np.diff(record.position[s]), intervals, count)
        places += [(s.start + k, size, samples) for k, size, samples in found]
        counted = counted and (not found or bool(np.ptp(intervals) <= levels.COUNTED_TIMES))
    if not places:
        return None
    _, sizes, travels = np.abs(np.array(places)).T
    if sizes.size > levels.ENOUGH and np.ptp(sizes) < levels.SLIPS * sizes.mean() and np.median(travels) > levels.JUMP:
        return None
    word, rows = _rows(record, signals, [k + 1 for k, *_ in places])
    where = f"{record.file} {word}{'s' * (len(rows) > 1)} {', '.join(shortened(list(map(str, rows))))}"
    if counted and all(samples > 0 for *_, samples in places):
        place = f"{where} (about {sum(n for *_, n in places):.1f} samples)"
        message = (
            f"Samples are missing, or the encoder slipped: {place}{OTHER_PLACES}. The position jumps there by more than its "
            "speed explains, while the time goes on: speeds from it, and the acceleration there, are wrong. Log the time of "
            "each sample, or split the log."
        )
        return Finding("lost-samples", CAUTION, message, {"files": (place,)})
    largest = max((size for _, size, _ in places), key=abs)
    most = "up to " if len(places) > 1 else ""
    place = f"{where} (by {most}{abs(largest):.2g} {si('position', context)})"
    message = (
        f"The position jumps: {place}{OTHER_PLACES}. Neither its speed nor the time explains it, as where an encoder slips, "
        "misses counts or is reset: speeds from it, and the acceleration there, are wrong. Mend the encoder, or split the "
        "log there."
    )
    return Finding("position-jumps", CAUTION, message, {"files": (place,)})


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

    side, about = np.sign(usual), 2 * levels.PLAY + 1
    one_way = minimum_filter1d(side, about) * maximum_filter1d(side, about) > 0
    far = (size > levels.JUMP_TRAVEL * np.abs(usual)) & (size > levels.JUMP * noise + 2 * count)
    found = (before * after > 0) & one_way & far
    found &= np.abs(np.convolve(off, np.ones(2 * _AROUND + 1), "same")) > 0.5 * np.abs(off)  # it does not come back
    best = [k for k in np.flatnonzero(found) if size[k] >= size[max(k - _AROUND, 0) : k + _AROUND + 1].max()]
    lost = np.where(excess < 0, excess - travel, excess)
    return [(int(inner[k]), float(lost[k]), float(lost[k] / abs(usual[k]))) for k in best]


def _rows(record: Record, signals: Signals, samples: Sequence[int]) -> tuple[str, list[int]]:
    """The word of the file for its rows, and the numbers of these samples: lines of text, else rows of data."""
    if record.lines is not None:
        return "line", [int(record.lines[k]) for k in samples]
    rate = None if signals.time is None else signals.time.rate
    return "row", [round(float(record.time[k]) * rate) + 1 if rate else k + 1 for k in samples]


def held_position(record: Record, signals: Signals) -> Finding | None:
    """The caution on readings that repeat in the midst of a motion, and then catch up: they were not refreshed."""
    if record.position is None or record.time.size < 2 * BLOCK:
        return None
    found = list[tuple[int, int]]()
    for s in between_gaps(record):
        position = record.position[s]
        steps = np.diff(position)
        moves = np.flatnonzero(steps)
        if not moves.size:
            continue
        # the count is the 0.05 quantile of steps: the smallest are no smaller
        count = float(np.quantile(np.abs(steps[moves]), 0.05))
        start, end, times = moves[:-1] + 1, moves[1:], np.diff(moves) - 1
        ok = (times >= levels.HELD_READING) & (start >= _BESIDE) & (end + 1 + _BESIDE < position.size)
        start, end, times = start[ok], end[ok], times[ok]
        before, after = position[start] - position[start - _BESIDE], position[end + 1 + _BESIDE] - position[end + 1]
        speed, fastest = (before + after) / (2 * _BESIDE), np.maximum(np.abs(before), np.abs(after)) / _BESIDE
        caught, due = steps[end], speed * (times + 1)
        held = (before * after > 0) & (np.abs(caught - due) < 0.5 * np.abs(due))
        held &= np.abs(caught) > fastest + levels.HELD_READING * count
        found += zip((s.start + start[held]).tolist(), times[held].tolist(), strict=True)
    if not found:
        return None
    word, (first,) = _rows(record, signals, [found[0][0]])
    place = f"{record.file} ({len(found)} times, first at {word} {first})"
    samples = int(np.median([n for _, n in found]))
    share = 100 * sum(n for _, n in found) / record.position.size
    message = (
        f"The position stays the same for {samples} samples of a motion and then catches up at once: {place}{OTHER_PLACES}, "
        f"{share:.2g} % of the samples. The reading was not refreshed: speeds from it, and the acceleration there, are wrong. "
        "Log each reading once, with the time at which it was taken."
    )
    return Finding("position-held", CAUTION, message, {"files": (place,), "samples": samples, "share": share})


def irregular_sampling(record: Record) -> Finding | None:
    """The caution on white noise of the position that grows with the speed: of unknown instants of sampling."""
    about = jitter(record, record.time / record.step)
    if about < levels.UNEVEN:
        return None
    message = (
        f"The position of {record.file}{OTHER_FILES} is noisy in proportion to its speed, as if sampled {about:.2g} of a "
        "sample (standard deviation) off its time: this takes away from the inertia. Log the time at which each sample was "
        "taken, in the loop of the controller."
    )
    return Finding("sampled-irregularly", CAUTION, message, {"files": (record.file,), "jitter": about})


def travels(record: Record, spans: Sequence[int] = SPANS) -> Iterator[tuple[Array, Array, Array]]:
    """Travel of the position, of the integral of the logged velocity, and change of velocity, over spans of samples.

    Nothing without both signals.
    """
    if record.position is None or record.velocity is None or record.velocity_estimated:
        return
    area = np.concatenate([[0.0], np.cumsum((record.velocity[1:] + record.velocity[:-1]) / 2 * np.diff(record.time))])
    for span in spans:
        ends = [np.arange(s.start, s.stop, span) for s in between_gaps(record)]
        both = (record.position, area, record.velocity)
        moved, said, changed = (np.concatenate([np.diff(x[k]) for k in ends]) for x in both)
        yield moved, said, changed


def velocity_lag(record: Record) -> Finding | None:
    """The caution on a logged velocity that is late, or early, against the position.

    The integral of a velocity through one pole of time constant L is behind the position by L times its change; of one
    that is L late, to the first order. Regression over spans, with a factor and an offset beside it: noise of the
    velocity makes L smaller, no larger.
    """
    found = []
    for moved, said, changed in travels(record, SPANS[1:]):
        X = np.column_stack([changed, said, np.ones(said.size)])
        scale = np.sqrt((X**2).sum(axis=0))
        if said.size < levels.ENOUGH or not (np.isfinite(scale).all() and scale.all()):
            continue
        X /= scale
        if np.linalg.matrix_rank(X, tol=1e-6) < X.shape[1]:
            continue
        of_X = np.linalg.inv(X.T @ X)
        b = of_X @ (X.T @ moved)
        rest = moved - X @ b
        error = np.sqrt(of_X[0, 0] * (rest @ rest) / (said.size - 3) * inflation(rest))
        share = float(abs(b[0]) / np.sqrt(said @ said))
        found.append((float(b[0] / scale[0]), float(error / scale[0]), share))
    if not found:
        return None
    lag, error, share = max(found, key=lambda x: abs(x[0]) / max(x[1], 1e-12))
    if abs(lag) - levels.LAG * record.step < levels.DEVIATIONS * error or share < levels.MATTERS:
        return None
    lags, why, remedy = (
        ("lags behind", "filtered", "it unfiltered") if lag > 0 else ("leads", "the command", "the measured one")
    )
    lag, samples, error = abs(lag), abs(lag) / record.step, error / record.step
    message = (
        f"The logged velocity of {record.file}{OTHER_FILES} {lags} its position by {lag:.2g} s ({samples:.2g} samples, "
        f"standard error {error:.2g}), as where it is {why}: friction at reversals and the inertia are wrong. Leave "
        f"`velocity` out under signals to have it estimated from the position, or log {remedy}."
    )
    numbers = {
        "files": (record.file,),
        "lag": lag,
        "samples": samples,
        "error": error,
        "remedy": remedy,
        "filtered": why == "filtered",
    }
    return Finding("velocity-lags", CAUTION, message, numbers)
