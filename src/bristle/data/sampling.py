"""Samples at equal intervals, as every filter assumes."""

from dataclasses import replace
from typing import Any

import numpy as np

from bristle.arrays import Array
from bristle.data.differentiation import between_gaps
from bristle.data.encoder import smallest_step
from bristle.data.record import SIGNALS, Record
from bristle.findings import NOTE, Finding

UNEVEN = 0.05  # of a sampling interval, standard deviation: less of it hides nothing
BLOCK = 100  # samples that tell the noise of the position
DEVIATIONS = 4.0  # standard errors by which something is surely not zero: 6e-5 of clean records
_MANY = 10.0  # times the samples that there are: more are not made, where gaps are declared to be none


def evenly_sampled(record: Record) -> Record:
    """The record at equally spaced samples in each segment between gaps; unchanged where they are so, to 5 %.

    Where the stamps are within a sample of even ones, and the position fits these no worse, it is the stamps that
    jitter. Else samples were lost, or taken unevenly: all signals are interpolated, by Akima, whose cubics follow a
    step.
    """
    segments = [s for s in between_gaps(record) if s.stop - s.start > 2]
    intervals = np.concatenate([np.zeros(0), *(np.diff(record.time[s]) for s in segments)]) / record.step
    if not intervals.size or np.std(intervals) < UNEVEN or intervals.sum() > _MANY * record.time.size:
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
            if name == "position" and count:  # a whole number of counts from the reading before
                x = values[before] + count * np.round((x - values[before]) / count)
            made.append(x)
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
        notes=(*record.notes, Finding("samples-uneven", NOTE, message, {"apart": apart})),
    )


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
    if not of_speed > 0 or more <= max(DEVIATIONS * error, floor):
        return 0.0
    both = fast[1:] & fast[:-1]
    z = np.clip(r / np.sqrt(_variance(r[fast])), -DEVIATIONS, DEVIATIONS)
    correlation = float(z[1:][both] @ z[:-1][both]) / max(float(z[1:][both] @ z[1:][both]), 1e-12)
    # correlation of neighbours in what a cubic through neighbours leaves: -0.8 of white noise, positive of a vibration
    return float(np.sqrt(more / of_speed)) if correlation < -0.6 else 0.0


def _variance(x: Array) -> float:
    deviation = float(np.median(np.abs(x)) / 0.6745)
    return deviation * deviation
