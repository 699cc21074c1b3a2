"""Slow loading below breakaway: a presliding run cut where its torque turns.

At rest without torque the bristle is not bent, whatever happened before: so each piece begins where its torque passes
zero, and all of them load the same spring.
"""

from collections.abc import Mapping, Sequence
from dataclasses import field
from itertools import pairwise
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array, Number, result, sized, unwritten
from bristle.data.differentiation import between_gaps, derivative, smoothed
from bristle.data.encoder import smallest_step
from bristle.data.record import Record
from bristle.errors import InputError
from bristle.estimation import levels
from bristle.estimation.autocorrelation import white_noise


@result
class Loading:
    """One piece of a presliding run.

    Torque grows from zero in one direction, up to where it turns or the joint breaks away. Displacement and torque are
    counted positive along the direction of loading; arrays are read-only.
    """

    file: str
    direction: str
    """`+` or `-`."""
    start: int
    """First sample, in the record."""
    time: Array = field(metadata=sized("n"))
    """s from the start of the piece, (n,)."""
    displacement: Array = field(metadata=sized("n"))
    """Of the encoder since the start of the piece, rad, (n,)."""
    torque: Array = field(metadata=sized("n"))
    """N*m, through the low pass, (n,)."""
    quantum: float
    """One count, rad; 0 where no counts are seen."""
    edge_displacement: Array = field(metadata=sized("m"))
    """Displacement at the count edges that were crossed, each half a count before the reading that follows it, rad,
    (m,)."""
    edge_torque: Array = field(metadata=sized("m"))
    """Torque there, N*m, (m,)."""
    breakaway: float | None
    """Torque at which it began to slide, N*m; None where it did not."""
    held: float
    """The largest torque that the joint held without sliding, N*m, which the low pass may round off."""
    shares: Mapping[str, float] = field(default_factory=dict)
    """Relative change of its torque per standard error of each constant behind it."""


@result
class Loop:
    """One closed cycle of torque over displacement."""

    file: str
    start: int
    stop: int
    position: Array = field(default_factory=lambda: np.zeros(0), metadata=unwritten("n"))
    """rad, (n,)."""
    torque: Array = field(default_factory=lambda: np.zeros(0), metadata=unwritten("n"))
    """N*m, as logged, (n,)."""
    torque_amplitude: Number = float("nan")
    """Half the range of torque, N*m."""
    displacement_amplitude: Number = float("nan")
    """Half the range of displacement, rad."""
    loss: Number
    """Work lost in the cycle, J."""
    secant: float | None
    """Torque between its extremes over the displacement between them, N*m/rad; None, as the next two, where it is not positive
    and finite, and so no stiffness."""
    slope: float | None
    """Regression of torque on displacement, N*m/rad."""
    inverse_slope: float | None
    """One over the regression of displacement on torque, N*m/rad."""
    counts: int
    """Counts that the cycle spans; 0 where no counts are seen."""


def find_all_loadings(
    records: Sequence[Record], resolution: float | None, breakaway: float | None
) -> tuple[tuple[Loading, ...], ...]:
    """`find_loadings` of each record at its own cut-off, with the torque that any of their loadings held.

    A torque that another loading exceeds without sliding is no breakaway, unless the joint slid far.
    """
    held: dict[str, float] = {}
    while True:
        found = tuple(find_loadings(record, record.cutoff, resolution, breakaway, held) for record in records)
        directions = {x.direction for one in found for x in one}
        reached = {d: max(x.held for one in found for x in one if x.direction == d) for d in directions}
        if reached == held:
            return found
        held = reached


def find_loadings(
    record: Record,
    cutoff: float,
    resolution: float | None,
    breakaway: float | None,
    held: Mapping[str, float] = MappingProxyType({}),
) -> tuple[Loading, ...]:
    """The pieces of a presliding run, with position and torque, that load from zero torque.

    The torque goes through a zero-phase low pass of `cutoff`, Hz, unless that is at or above the Nyquist frequency. One
    count is `resolution`, rad; None: the smallest step seen. A displacement of `breakaway`, rad, counts as breakaway;
    None: where the speed leaves that of loading and the noise floor for good. Per direction `held` is the largest
    torque that any loading held without sliding, N*m: a joint that slid a short way below it did not break away.

    Raises InputError where the joint slides from the start.
    """
    position, torque, quantum = _signals(record, resolution)
    slow = _low_passed(record, torque, cutoff)
    speed = derivative(record, _low_passed(record, position, cutoff))
    loadings = []
    for piece, sign in _pieces(record, slow):
        if slow is not torque and record.time[piece.stop - 1] - record.time[piece.start] < 1 / cutoff:
            continue  # faster than the low pass can follow: a step, and no slow loading
        torque_along, position_along = sign * slow[piece], sign * position[piece]
        # the last: samples that the low pass makes of a step of the encoder at the end of a run
        slow_speed = 0.5 * levels.SLIDES_FASTER * quantum * cutoff
        least = (slow_speed, levels.SLIDES_COUNTS * quantum, 0.5 / (cutoff * record.step))
        moved, name = position_along - position_along[0], "+" if sign > 0 else "-"
        slide = _slides_at(torque_along, moved, sign * speed[piece], least, breakaway, held.get(name, 0.0))
        _refuse_sliding(record.file, position_along, torque_along, slide, quantum)
        inside = slice(0, slide)
        edges, at = _edges(position_along[inside], quantum)
        slid = float(torque_along[inside].max(initial=0.0))
        loadings.append(
            Loading(
                file=record.file,
                direction=name,
                start=piece.start,
                time=record.time[piece][inside] - record.time[piece.start],
                displacement=moved[inside],
                torque=torque_along[inside],
                quantum=quantum,
                edge_displacement=edges - position_along[0],
                edge_torque=np.interp(at, np.arange(torque_along.size), torque_along),
                breakaway=None if slide is None else float(torque_along[slide]),
                held=_held(torque_along, sign * torque[piece]) if slide is None else slid,
                shares={
                    name: float(torque[piece] @ shift[piece] / (torque[piece] @ torque[piece]))
                    for name, shift in record.torque_shifts.items()
                },
            )
        )
    return tuple(loadings)


def find_loops(record: Record, cutoff: float, resolution: float | None) -> tuple[tuple[Loop, ...], tuple[float, ...]]:
    """The closed cycles of a presliding run, and the distance between the ends of others, as a share of their range.

    A cycle goes from one largest torque to the next, or else from one smallest to the next. It drifts where friction
    differs between directions.
    """
    position, torque, quantum = _signals(record, resolution)
    slow = _low_passed(record, torque, cutoff)
    loops, drifts = [], []
    for segment in between_gaps(record):
        tops, bottoms = torque_turns(slow[segment])
        ends = (tops if tops.size > 1 else bottoms) + segment.start
        for start, stop in zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True):
            y, T = position[start : stop + 1], torque[start : stop + 1]
            if np.ptp(y) == 0 or abs(slow[stop] - slow[start]) > levels.CLOSED * np.ptp(slow):
                continue
            if abs(y[-1] - y[0]) > max(levels.CLOSED_COUNTS * quantum, levels.CLOSED * np.ptp(y)):
                drifts.append(float((y[-1] - y[0]) / np.ptp(y)))
            else:
                centred, level = y - y.mean(), T - T.mean()
                top, bottom = int(T.argmax()), int(T.argmin())
                loops.append(
                    Loop(
                        file=record.file,
                        start=start,
                        stop=stop,
                        position=y,
                        torque=T,
                        torque_amplitude=float(np.ptp(T)) / 2,
                        displacement_amplitude=float(np.ptp(y)) / 2,
                        loss=abs(float(np.trapezoid(T, y))),
                        secant=_stiffness(float(T[top] - T[bottom]), float(y[top] - y[bottom])),
                        slope=_stiffness(float(centred @ level), float(centred @ centred)),
                        inverse_slope=_stiffness(float(level @ level), float(centred @ level)),
                        counts=round(float(np.ptp(y)) / quantum) if quantum else 0,
                    )
                )
    return tuple(loops), tuple(drifts)


def _signals(record: Record, resolution: float | None) -> tuple[Array, Array, float]:
    """Position, torque, and one count, rad: as declared, or the smallest step seen."""
    position, torque = record.position, record.torque
    if position is None or torque is None:
        raise InputError(f"{record.file}: presliding needs position and torque; name both under signals")
    if resolution and not np.ptp(position) / resolution < 2.0**40:  # 2.0**40 counts that no encoder has over any travel
        moves = f"the position moves {np.ptp(position) / resolution:.1g} counts of encoder_resolution"
        raise InputError(f"{record.file}: {moves}, more than any encoder has; check its unit")
    return position, torque, resolution or smallest_step(position)


def _low_passed(record: Record, values: Array, cutoff: float) -> Array:
    """A signal, (n,), through the low pass; the signal itself where the cut-off is not below the Nyquist frequency."""
    return smoothed(record, values, cutoff, noisy=True) if cutoff < 0.5 / record.step else values


def torque_turns(torque: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Samples of largest and of smallest torque between turns."""
    from scipy.signal import find_peaks

    prominence = levels.PROMINENT * float(np.ptp(torque))
    if prominence == 0:
        return np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)
    return find_peaks(torque, prominence=prominence)[0], find_peaks(-torque, prominence=prominence)[0]


def _pieces(record: Record, torque: Array) -> Sequence[tuple[slice, float]]:
    """Samples and sign of each piece between turns, from where its torque last passed zero."""
    pieces = []
    for segment in between_gaps(record):
        turns = np.sort(np.concatenate(torque_turns(torque[segment]))) + segment.start
        bounds = [segment.start, *turns.tolist(), segment.stop - 1]
        for first, turn in pairwise(bounds):
            part = torque[first : turn + 1]
            sign = 1.0 if part.max() + part.min() > 2 * part[0] else -1.0
            most = float((sign * part).max())
            last = first + int(np.flatnonzero(sign * part >= most - (1 - levels.PIECE_END) * abs(most))[-1])
            part = part[: last + 1 - first]
            before = np.flatnonzero(sign * part <= 0)
            start = first + (int(before[-1]) + 1 if before.size else 0)
            unloaded = before.size > 0 or abs(part[0]) <= levels.CLOSED * np.ptp(torque)
            if unloaded and last + 1 - start >= levels.FEW and sign * torque[last] > levels.PROMINENT * np.ptp(torque):
                pieces.append((slice(start, last + 1), sign))
    return pieces


def _slides_at(
    torque: Array, displacement: Array, speed: Array, least: tuple[float, ...], breakaway: float | None, held: float
) -> int | None:
    """First sample of sliding, faster than in the first half of the loading, up to the peak torque; None: none."""
    least_speed, least_travel, least_samples = least
    if breakaway is not None:
        beyond = np.flatnonzero(displacement >= breakaway)
        return int(beyond[0]) if beyond.size else None
    top = int(np.flatnonzero(torque >= levels.SLIDING_END * torque.max())[-1]) + 1
    onset = top
    while onset > 1:
        first = speed[:onset][torque[:onset] <= torque[onset - 1] / 2]
        usual = max(float(np.median(first)) if first.size else 0.0, 0.0)
        slow = np.flatnonzero(speed[:onset] <= max(levels.ONSET * usual, least_speed))
        earlier = int(slow[-1]) + 1 if slow.size else 0
        if earlier == onset:
            break
        onset = earlier
    if top - onset <= least_samples or displacement[top - 1] - displacement[onset] < least_travel:
        return None
    far = float(displacement.max() - displacement[onset]) > levels.GOES_ON * float(displacement[onset])
    return None if not far and held > levels.HELD_MORE * torque[onset] else onset


def _held(smooth: Array, logged: Array) -> float:
    """The largest torque, N*m, through the low pass, which rounds tips off or overshoots, within the logged one."""
    noise = white_noise(logged)
    most = float(logged.max())
    return min(max(float(smooth.max()), most - levels.DEVIATIONS * noise), most)


def _refuse_sliding(file: str, position: Array, torque: Array, slide: int | None, quantum: float) -> None:
    travel, largest = float(np.ptp(position)), float(torque.max())
    share, far = levels.SLIDING_TRAVEL, travel > 0 and travel > levels.ENOUGH * quantum
    early = position - position[0] <= share * travel
    if slide is None and far and torque[early].max(initial=0.0) > levels.SLIDING * largest:
        why = (
            f"slides: {torque[early].max() / largest:.0%} of its largest torque is there within {share:.0%} of its travel; "
            "a presliding run loads a joint at rest slowly and stays below breakaway; give this one as experiment: tracking or ramp"
        )
        if float((position - position.mean()) @ (torque - torque.mean())) < 0:
            why = "moves against its torque; a drive's torque is positive along positive velocity: give it scale: -1 under signals"
        raise InputError(f"{file}: the joint {why}")


def _edges(position: Array, quantum: float) -> tuple[Array, Array]:
    """Count edges crossed upward, and when, samples, between the readings below and above; few per reading."""
    if quantum == 0 or position.size == 0:
        return np.zeros(0), np.zeros(0)
    count = np.round((position - position[0]) / quantum)
    reached, left = np.maximum.accumulate(count), np.minimum.accumulate(count[::-1])[::-1]
    every = max(np.ceil(left[-1] / (4 * position.size)), 1.0)  # 4 count edges kept, at the most, for each reading
    edges = every * np.arange(1.0, left[-1] // every + 1)
    after = np.searchsorted(reached, edges, side="left")
    before = np.searchsorted(left, edges, side="left") - 1
    return position[0] + (edges - 0.5) * quantum, (after + before) / 2


def _stiffness(torque: float, displacement: float) -> float | None:
    """Torque over displacement; None where that is not positive and finite."""
    value = torque / displacement if displacement else np.inf
    return value if 0 < value < np.inf else None
