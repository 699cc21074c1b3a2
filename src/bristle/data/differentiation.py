"""Velocity and acceleration from logged signals: a zero-phase low pass, then the derivatives of a spline."""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise

import numpy as np

from bristle.arrays import Array
from bristle.data.record import SIGNALS, Record
from bristle.errors import InputError
from bristle.estimation import levels
from bristle.findings import CAUTION, NOTE, Finding

Choice = Callable[[Record], tuple[float, Finding]]  # a rule for the cut-off of a record's low pass, Hz, with the reason
ORDER = 4  # order of the Butterworth filter, which runs forward and backward
LOWEST = 1e-6  # cut-off of the low pass over the sampling rate


def estimate_motion(record: Record, cutoff: float | Choice) -> Record:
    """The record with velocity and acceleration filled, segment by segment; its notes state the cut-off.

    Position goes through a Butterworth low pass of order 4 with `cutoff`, Hz, or by a rule for it, forward and
    backward; a quintic spline through it gives both derivatives (central differences would lose 1.5 % of an
    acceleration at a thirtieth of the sampling rate). A logged velocity stays, but for its noise at rest
    (`without_noise_at_rest`); the acceleration is then its derivative, after the same filter. A cut-off at or above the
    Nyquist frequency is lowered to 0.8 of it. Segments between gaps shorter than 16 samples are left out and counted.

    Raises InputError where there is neither position nor velocity, or no segment is long enough.
    """
    record = without_short_segments(record, levels.SHORTEST, "differentiated")
    values = record.position if record.velocity is None else record.velocity
    if values is None:
        raise InputError(f"{record.file}: neither position nor velocity; name one of them under signals")
    if callable(cutoff):
        used, why = cutoff(record)
    elif (used := usable(record, cutoff)) == cutoff:
        why = Finding("cutoff-asked", NOTE, ", as asked")
    else:
        lowered = f", lowered from {cutoff:g} Hz, which is not below the Nyquist frequency"
        why = Finding("cutoff-lowered", CAUTION, lowered, {"asked": cutoff})
    smooth, estimated = smoothed(record, values, used), record.velocity is None
    message = (
        f"{'Velocity and acceleration from position' if estimated else 'Acceleration from velocity'}: Butterworth low pass "
        f"of order {ORDER}, forward and backward, cut-off {used:.3g} Hz{why.message}; then the derivatives of a quintic spline."
    )
    numbers = {"cutoff": used, "why": why}
    logged = None if record.velocity is None else without_noise_at_rest(record, record.velocity, smooth, used)
    note = Finding("motion-from-position" if estimated else "acceleration-from-velocity", NOTE, message, numbers)
    return replace(
        record,
        velocity=derivative(record, smooth) if logged is None else logged,
        velocity_estimated=estimated,
        acceleration=derivative(record, smooth, 2 if estimated else 1),
        cutoff=used,
        notes=(*record.notes, note),
    )


def without_noise_at_rest(record: Record, velocity: Array, smooth: Array, cutoff: float) -> Array:
    """A logged velocity, (n,), set to zero where it is noise about zero and the position stays: at rest that noise would bend a bristle.

    `smooth` is the same after a low pass with `cutoff`, Hz.
    """
    q, share = np.zeros(velocity.size) if record.position is None else record.position, cutoff * record.step
    # noise that the low pass leaves, by what it takes away
    white = 1.4826 * float(np.median(np.abs(velocity - smooth))) * np.sqrt(2 * share / (1 - 2 * share))
    within = np.abs(smooth) < min(levels.SURE * white, levels.STILL * float(np.abs(smooth).max()))
    ends = np.flatnonzero(np.diff(within, prepend=False, append=False)).reshape(-1, 2)
    still = velocity.copy()
    for start, stop in ends[np.diff(ends, axis=1)[:, 0] * share >= levels.STILL_PERIODS]:
        if not np.ptp(q[start:stop]) and np.median(np.abs(np.diff(velocity[start:stop]))) > 0:
            still[start:stop] = 0.0
    return still


def usable(record: Record, cutoff: float) -> float:
    """The cut-off, Hz, lowered to a share of the record's Nyquist frequency where it is not below that."""
    nyquist = 0.5 / record.step
    return cutoff if cutoff < nyquist else levels.BELOW_NYQUIST * nyquist


@lru_cache(maxsize=256)
def _sections(cutoff: float, rate: float) -> Array:
    """Second-order sections of the low pass of a cut-off at a sampling rate, both Hz."""
    from scipy.signal import butter

    return np.asarray(butter(ORDER, cutoff, fs=rate, output="sos"))


def smoothed(record: Record, values: Array, cutoff: float, *, noisy: bool = False) -> Array:
    """A signal of the record, shape (n,), or, none of them `noisy`, several, (n, k), through the zero-phase low pass with `cutoff`, Hz.

    Never across a gap. Beyond its ends the signal is continued by point reflection: about its first and last sample or,
    where it is `noisy`, about the end of a line through half a period of the cut-off. Raises InputError where the
    cut-off is so far below the sampling rate that rounding in the filter hides the signal.
    """
    from scipy.signal import sosfiltfilt

    if cutoff * record.step < LOWEST:
        raise InputError(
            f"{record.file}: a cut-off of {cutoff:g} Hz is too low for a sampling rate of {1 / record.step:.4g} Hz; "
            f"expected at least {LOWEST / record.step:.3g} Hz; check the cut-offs under fit, and the unit of time"
        )
    sections = _sections(cutoff, 1 / record.step)
    # samples by which a segment is continued: those of the cut-off's period, or 15
    reach = max(15, round(1 / (record.step * cutoff)))

    def one(x: Array) -> Array:
        """A segment, or several signals of it."""
        pad = min(reach, len(x) - 1)
        if noisy and pad > 1:
            first, last = (_end(part) for part in (x[pad // 2 :: -1], x[-pad // 2 - 1 :]))
            x = np.concatenate([2 * first - x[pad:0:-1], x, 2 * last - x[-2 : -pad - 2 : -1]])
        # scipy-stubs cannot tell which of the layouts `butter` returns
        smooth = np.asarray(sosfiltfilt(sections, x, axis=0, padlen=pad), dtype=float)
        return smooth[pad : x.size - pad] if noisy and pad > 1 else smooth

    return np.concatenate([one(values[s]) for s in between_gaps(record)])


def _end(part: Array) -> float:
    """End of a line through some samples; the last sample itself where it is further off than noise: a step."""
    at = np.arange(part.size) - (part.size - 1.0)
    slope, level = np.polyfit(at, part, 1).tolist()
    scatter = float(np.std(part - slope * at - level))
    return float(part[-1]) if abs(part[-1] - level) > levels.DEVIATIONS * scatter else float(level)


def derivative(record: Record, values: Array, order: int = 1) -> Array:
    """Time derivative of a signal of the record, shape (n,): that of the quintic spline through it.

    The spline is of lower degree where a segment is shorter; the derivative is zero where it is too short for any.
    """
    from scipy.interpolate import make_interp_spline

    parts = []
    for s in between_gaps(record):
        degree = max((k for k in (1, 3, 5) if k < s.stop - s.start), default=0)
        if degree < order:
            parts.append(np.zeros(s.stop - s.start))
            continue
        spline = make_interp_spline(record.time[s], values[s], k=degree)
        parts.append(np.asarray(spline.derivative(order)(record.time[s])))
    return np.concatenate(parts)


def between_gaps(record: Record) -> list[slice]:
    """The segments of the record between its gaps."""
    stops = (*record.starts[1:], record.time.size)
    return [slice(start, stop) for start, stop in zip(record.starts, stops, strict=True)]


def without_rests(record: Record) -> Record:
    """The record without the stretches in which its position stays for three seconds, which say nothing of friction.

    Only where most of what remains is long enough for its filters; the stretches between are segments, as between gaps.
    """
    if record.position is None:
        return record
    stays = np.append(False, np.diff(record.position) == 0)
    stays[list(record.starts)] = False
    ends = np.flatnonzero(np.diff(np.concatenate([[False], stays, [False]]).astype(int))).reshape(-1, 2)
    rests = [(a - 1, b) for a, b in ends.tolist() if (b - a) * record.step >= levels.STILL_SECONDS]
    moves = np.ones(record.time.size, dtype=bool)
    for start, stop in rests:
        moves[start:stop] = False
    first = {*record.starts, *(stop for _, stop in rests)}
    cuts = sorted({*first, *(start for start, _ in rests), record.time.size})
    shortest = max(levels.SHORTEST, levels.LONG_SEGMENT / (record.cutoff * record.step) if record.cutoff else 0.0)
    long = [slice(a, b) for a, b in pairwise(cuts) if b - a >= shortest and moves[a]]
    if not rests or not long or 2 * sum(s.stop - s.start for s in long) < np.count_nonzero(moves):
        return record
    return _kept(record, long, Finding("rests-left-out", NOTE, "in which the joint rests are left out"))


def with_rests(record: Record) -> Record:
    """The record with the times at which its position has come to rest, within two counts, and its low pass has rung out."""
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    from bristle.data.encoder import smallest_step

    if record.position is None or not record.cutoff or not (count := smallest_step(record.position)):
        return record
    rings, rests = int(np.ceil(levels.FILTERED / (record.cutoff * record.step))), list[float]()
    shortest = levels.RESTS * rings
    for part in between_gaps(record):
        q, last = record.position[part], 0
        high, low = (f.accumulate(q[::-1])[::-1] for f in (np.maximum, np.minimum))
        moves = high - low > levels.MOVED_COUNTS * count  # from there on
        rest = maximum_filter1d(q, shortest) - minimum_filter1d(q, shortest) < levels.REST_COUNTS * count
        for at in (np.flatnonzero(np.diff(rest, prepend=False) & rest) - shortest // 2 + rings).tolist():
            if at > 0 and moves[at] and np.ptp(q[last:at]) > levels.MOVED_COUNTS * count:
                rests.append(float(record.time[part.start + at]))
                last = at
    return replace(record, rests=tuple(rests))


def let_go(record: Record) -> Record:
    """The record of a coasting joint from where it is let go to where it stops: a hand that holds it is friction, too.

    A rest at an end is where the joint stays within 0.002 of its travel for longer than it then takes to go 0.02 of it;
    a constant deceleration takes half as long.
    """
    q = record.position
    if q is None or record.starts != (0,) or not np.ptp(q) > 0:
        return record
    away = levels.STILL * np.ptp(q)
    ends = []
    for off in (np.abs(q - q[0]), np.abs(q - q[-1])[::-1]):
        gone = int(np.argmax(off > away))
        stays = int(np.flatnonzero(off[: gone + 1] <= levels.LET_GO * away)[-1])
        ends.append(stays if stays > gone - stays else 0)
    moves = slice(ends[0], q.size - ends[1])
    if moves.stop - moves.start < levels.SHORTEST or not sum(ends):
        return record
    why = "before the joint was let go, or after it stopped, are left out"
    return _kept(record, [moves], Finding("rests-left-out", NOTE, why))


def without_ends(record: Record) -> Record:
    """The record without two periods of its low pass at each end of a segment, where the acceleration is least known.

    Only where most of it remains.
    """
    edge = int(np.ceil(levels.FILTERED / (record.cutoff * record.step))) if record.cutoff else 0
    long = (s for s in between_gaps(record) if s.stop - s.start >= 2 * edge + levels.SHORTEST)
    inner = [slice(s.start + edge, s.stop - edge) for s in long]
    if not edge or 2 * sum(s.stop - s.start for s in inner) < record.time.size:
        return record
    why = "at the ends of stretches left out, where the acceleration is least known"
    return _kept(record, inner, Finding("ends-left-out", NOTE, why))


def without_short_segments(record: Record, shortest: int, for_what: str) -> Record:
    """The record without segments of fewer samples. Raises InputError where all have fewer."""
    segments = between_gaps(record)
    long = [s for s in segments if s.stop - s.start >= shortest]
    if not long:
        why = f"no segment between gaps has {shortest} samples, too few to be {for_what}"
        raise InputError(f"{record.file}: {why}; log longer, or raise cleaning.gap")
    if len(long) == len(segments):
        return record
    why = f"dropped: segments between gaps shorter than {shortest} samples, which cannot be {for_what}"
    return _kept(record, long, Finding("rows-of-short-segments", CAUTION, why))


def _kept(record: Record, long: list[slice], why: Finding) -> Record:
    """Some segments of a record, and a note on the other rows, whose message goes on after their number."""
    kept = np.concatenate([np.arange(s.start, s.stop) for s in long])
    lost = int(record.time.size - kept.size)
    note = replace(why, message=f"{lost} row{'s' * (lost != 1)} {why.message}.", numbers={"rows": lost})
    names = ("time", *SIGNALS, "lines", "unknown")
    return replace(
        record,
        **{name: values[kept] for name in names if (values := getattr(record, name)) is not None},
        torque_shifts={name: shift[kept] for name, shift in record.torque_shifts.items()},
        starts=(0, *np.cumsum([s.stop - s.start for s in long])[:-1].tolist()),
        dropped=record.dropped + lost,
        notes=(*record.notes, note),
    )
