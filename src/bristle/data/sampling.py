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
    # a tenth: less is no evidence for the stamps
    if near and _roughness(record, counted) <= 1.1 * _roughness(record, stamped):
        off = np.std(time - record.time) / record.step
        message = f"The time stamps jitter by {off:.2g} of a sample; even ones, which fit no worse, are taken."
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
        f"{size} uneven samples (by {100 * apart:.0f} % of an interval) are interpolated at {row.size} even times."
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


def _roughness(record: Record, time: Array) -> float:
    """How far every second position is off the spline through the others over `time`, (n,): median where it is fast."""
    from scipy.interpolate import CubicSpline

    left = [np.zeros(0)]
    for s in between_gaps(record):
        if record.position is not None and s.stop - s.start > BLOCK:
            t, q = time[s], record.position[s]
            off, moved = CubicSpline(t[::2], q[::2])(t[1:-1:2]) - q[1:-1:2], np.abs(q[2::2] - q[:-2:2])
            left.append(np.abs(off[moved >= np.quantile(moved, 0.75)]))
    sizes = np.concatenate(left)
    return float(np.median(sizes)) if sizes.size else 0.0
