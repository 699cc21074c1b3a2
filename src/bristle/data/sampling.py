"""Samples at equal intervals, as every filter assumes."""

from collections.abc import Collection
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial

from bristle.arrays import Array
from bristle.data.differentiation import between_gaps
from bristle.data.encoder import smallest_step
from bristle.data.record import SIGNALS, Record
from bristle.estimation import levels
from bristle.findings import NOTE, Finding

BLOCK = 100  # samples that tell the noise of the position
_MANY = 10.0  # times the samples that there are: more are not made, where gaps are declared to be none
_FEW, _PLACES = 4, 30  # least samples on either side of a bridged gap; places at which the bridge is tried


def evenly_sampled(record: Record, apart: Collection[int] = ()) -> Record:
    """The record at equally spaced samples in each segment between gaps; unchanged where they are so, to 5 %.

    Gaps whose content the motion around them tells are filled, without a torque, except those before the samples
    `apart`. Where the stamps are within a sample of even ones, and the position fits these no worse, it is the stamps
    that jitter. Else samples were lost, or taken unevenly: all signals are interpolated, by Akima, whose cubics follow
    a step.
    """
    record = _bridged(record, apart)
    segments = [s for s in between_gaps(record) if s.stop - s.start > 2]
    intervals = np.concatenate([np.zeros(0), *(np.diff(record.time[s]) for s in segments)]) / record.step
    if not intervals.size or np.std(intervals) < levels.UNEVEN or intervals.sum() > _MANY * record.time.size:
        return record
    time = record.time.copy()
    for s in segments:
        slope, first = np.polyfit(np.arange(s.stop - s.start), record.time[s] - record.time[s.start], 1).tolist()
        time[s] = record.time[s.start] + first + slope * np.arange(s.stop - s.start)
    near = np.abs(time - record.time).max() < record.step and (np.diff(time) > 0).all()
    counted, stamped = np.arange(time.size, dtype=float), record.time / record.step
    if near and jitter(record, counted) <= jitter(record, stamped):
        message = (
            f"The time stamps jitter by {np.std(time - record.time) / record.step:.2g} of a sample (standard deviation) about "
            "even ones, and the position goes no worse with these, which are taken (cleaning: {times: as-written} leaves the "
            "stamps)."
        )
        return replace(record, time=time, notes=(*record.notes, Finding("stamps-jitter", NOTE, message)))
    return _interpolated(record)


def _bridged(record: Record, apart: Collection[int]) -> Record:
    """The record with its shorter gaps filled, its motion by a cubic through as many samples on either side."""
    ahead = np.array([k for k in record.starts[1:] if k not in apart], dtype=np.intp)
    motion = {name: x for name in ("position", "velocity") if (x := getattr(record, name)) is not None}
    missing = np.rint((record.time[ahead] - record.time[ahead - 1]) / record.step).astype(int) - 1
    if not motion or not (missing > 0).any():
        return record
    name, values = next(iter(motion.items()))
    most = 0
    for n in np.unique(missing[(missing > 0) & (missing <= levels.LONGEST_BRIDGE)]).tolist():
        if not _can_bridge(record, values, n, is_position=name == "position"):
            break
        most = n
    which = (missing > 0) & (missing <= most)
    if not which.any():
        return record
    time, rows = record.time, list[Array]()
    count = smallest_step(record.position) if record.position is not None else 0.0
    new: dict[str, list[Array]] = {name: [] for name in SIGNALS if getattr(record, name) is not None}
    for k, n in zip(ahead[which].tolist(), missing[which].tolist(), strict=True):
        rows.append(np.linspace(time[k - 1], time[k], n + 2)[1:-1])
        beside = slice(max(k - max(n, _FEW), 0), k + max(n, _FEW))
        for name, made in new.items():
            x = getattr(record, name)
            if name in motion:
                found = Polynomial.fit(time[beside], x[beside], 3)(rows[-1])
                made.append(_counted(found, x[k - 1], count) if name == "position" else found)
            else:
                made.append(np.interp(rows[-1], time[k - 1 : k + 1], x[k - 1 : k + 1]))
    before = np.repeat(ahead[which], missing[which])
    places = ahead[which]
    starts = [k + int(missing[which & (ahead < k)].sum()) for k in record.starts if k not in places]
    message = (
        f"{places.size} gap{'s' * (places.size > 1)} of at most {most} samples {'are' if places.size > 1 else 'is'} bridged by "
        "the motion beside, which tells samples elsewhere as well; equations there, which hold "
        f"{before.size} samples without a torque, are left out."
    )
    changed: dict[str, Any] = {
        name: np.insert(getattr(record, name), before, np.concatenate(made)) for name, made in new.items()
    }
    return replace(
        record,
        **changed,
        time=np.insert(time, before, np.concatenate(rows)),
        starts=tuple(starts),
        unknown=np.insert(np.zeros(time.size, dtype=bool), before, np.ones(before.size, dtype=bool)),
        lines=None if record.lines is None else np.insert(record.lines, before, record.lines[before - 1]),
        notes=(*record.notes, Finding("gaps-bridged", NOTE, message, {"gaps": places.size, "samples": before.size})),
    )


def _can_bridge(record: Record, values: Array, n: int, *, is_position: bool) -> bool:
    """Whether a cubic through n samples on either side tells n known ones between, to 1 % of motion or noise."""
    side = max(n, _FEW)
    width = 2 * side + n
    first = np.concatenate([np.arange(s.start, s.stop - width + 1) for s in between_gaps(record)])
    if not first.size:
        return False
    between, errors, noise = slice(side, side + n), [], []
    for k in first[:: max(first.size // _PLACES, 1)].tolist():
        t, x = record.time[k : k + width], values[k : k + width]
        out = np.ones(width, dtype=bool)
        out[between] = False
        left = x - Polynomial.fit(t[out], x[out], 3)(t)
        errors.append(np.mean(left[between] ** 2))
        noise.append(np.mean(left[out] ** 2))
    does = n * np.diff(values) if is_position else values
    error, typical = float(np.sqrt(np.mean(errors))), float(np.median(np.abs(does)))
    return error <= max(levels.BRIDGED * typical, levels.BRIDGED_NOISE * float(np.sqrt(np.mean(noise))))


def _counted(position: Array, near: Array | float, count: float) -> Array:
    """The reading of an encoder at a position: a whole number of counts from a reading nearby."""
    return near + count * np.round((position - near) / count) if count else position


def _interpolated(record: Record) -> Record:
    """The record interpolated at even samples, as far apart as they are where none is missing."""
    from scipy.interpolate import Akima1DInterpolator

    segments = between_gaps(record)
    intervals = np.concatenate([np.diff(record.time[s]) for s in segments])
    step = float(intervals.sum() / np.rint(intervals / record.step).sum())  # without those that are missing
    parts = []
    for s in segments:
        first, last = record.time[s.start], record.time[s.stop - 1]
        parts.append(np.minimum(first + step * np.arange(int((last - first) / step + 1e-6) + 1), last))
    count = smallest_step(record.position) if record.position is not None else 0.0
    signals: dict[str, list[Array]] = {name: [] for name in SIGNALS if getattr(record, name) is not None}
    rows = []
    for s, new in zip(segments, parts, strict=True):
        old, before = record.time[s], np.searchsorted(record.time[s], new, side="right") - 1
        rows.append(s.start + before)
        for name, made in signals.items():
            values = getattr(record, name)[s]
            x = Akima1DInterpolator(old, values)(new) if old.size > 2 else np.interp(new, old, values)
            made.append(_counted(x, values[before], count) if name == "position" else x)
    row, size = np.concatenate(rows), record.time.size
    apart = float(np.std(intervals)) / record.step
    message = (
        f"{size} samples that are not equally far apart (by {100 * apart:.0f} % of an interval, standard deviation) are "
        f"interpolated at {row.size} that are (cleaning: {{times: as-written}} leaves them)."
    )
    changed: dict[str, Any] = {name: np.concatenate(made) for name, made in signals.items()}
    return replace(
        record,
        **changed,
        time=np.concatenate(parts),
        starts=tuple(np.cumsum([0, *(x.size for x in parts)])[:-1].tolist()),
        lines=None if record.lines is None else record.lines[row],
        unknown=None if record.unknown is None else np.interp(np.concatenate(parts), record.time, record.unknown) > 0,
        notes=(*record.notes, Finding("samples-uneven", NOTE, message, {"apart": apart})),
    )


def averaged(record: Record, count: int) -> Record:
    """The record at every `count`-th sample, an odd number, which are `fine`: the torque and a logged velocity are means about it.

    A motion through a low pass far below the sampling rate is known from fewer samples.
    """
    first = np.concatenate([np.arange(s.start, s.stop - count + 1, count) for s in between_gaps(record)])
    about, at = first[:, None] + np.arange(count), first + count // 2
    means = {"torque", "voltage", "link_torque"} | (set() if record.velocity_estimated else {"velocity"})
    changed: dict[str, Any] = {
        name: x[about].mean(axis=1) if name in means else x[at]
        for name in SIGNALS
        if (x := getattr(record, name)) is not None
    }
    return replace(
        record,
        **changed,
        time=record.time[at],
        torque_shifts={name: x[about].mean(axis=1) for name, x in record.torque_shifts.items()},
        starts=(0, *np.searchsorted(first, record.starts[1:]).tolist()),
        lines=None if record.lines is None else record.lines[at],
        unknown=None if record.unknown is None else np.asarray(record.unknown[about].any(axis=1)),
        fine=record,
    )


def with_motion(record: Record, moved: Record) -> Record:
    """The record with another motion, of all its samples."""
    shown = moved if record.fine is None else averaged(moved, round(record.step / moved.step))
    motion = {name: getattr(shown, name) for name in ("position", "velocity", "acceleration", "velocity_estimated")}
    return replace(record, **motion, cutoff=moved.cutoff, notes=moved.notes, fine=shown.fine)


def jitter(record: Record, time: Array) -> float:
    """Standard deviation of the sampling instants about `time`, (n,), samples; 0 where noise does not follow speed."""
    if record.position is None:
        return 0.0
    left, speed = [], []
    for s in between_gaps(record):
        if s.stop - s.start > BLOCK:
            # beside the cubic through four neighbours noise has its variance times one and the squares of the cubic's weights
            t, q, inner = time[s], record.position[s], np.arange(2, s.stop - s.start - 2)
            near = [t[inner + k] - t[inner] for k in (-2, -1, 1, 2)]
            ratios = [[near[j] / (near[j] - near[k]) for j in range(4) if j != k] for k in range(4)]
            weights = [np.prod(x, axis=0) for x in ratios]  # of Lagrange
            through = np.sum([w * q[inner + k] for w, k in zip(weights, (-2, -1, 1, 2), strict=True)], axis=0)
            left.append((q[inner] - through) / np.sqrt(1 + np.sum(np.square(weights), axis=0)))
            speed.append((q[inner + 2] - q[inner - 2]) / (near[3] - near[0]))
    if not left:
        return 0.0
    x, r = np.abs(np.concatenate(speed)), np.concatenate(left)
    if not (np.isfinite(x).all() and np.isfinite(r).all()):  # overflown
        return 0.0
    low, high = np.quantile(x, [0.25, 0.75])
    slow, fast = x <= low, x >= high  # the slow quarter has the noise that does not depend on speed
    count = smallest_step(record.position)
    # half of the most that counts make, where each is half a count off in turn
    floor = max(_variance(r[slow]), count * count)
    of_speed = float(np.median(x[fast] ** 2))
    more = _variance(r[fast]) - floor
    # relative standard error of a variance from the median of sizes, times the root of their number
    error = 2.3 * np.sqrt(2 / fast.sum()) * _variance(r[fast])
    if not of_speed > 0 or more <= max(levels.DEVIATIONS * error, floor):
        return 0.0
    both = fast[1:] & fast[:-1]
    z = np.clip(r / np.sqrt(_variance(r[fast])), -levels.DEVIATIONS, levels.DEVIATIONS)
    correlation = float(z[1:][both] @ z[:-1][both]) / max(float(z[1:][both] @ z[1:][both]), 1e-12)
    return float(np.sqrt(more / of_speed)) if correlation < levels.WHITE else 0.0


def _variance(x: Array) -> float:
    deviation = float(np.median(np.abs(x)) / 0.6745)
    return deviation * deviation
