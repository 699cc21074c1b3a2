"""Low pass and decimation of a run, from its own spectra.

Friction at a reversal, presliding and inertia need the fast part of a motion; beyond it a position holds noise, whose
second derivative drowns the acceleration, so that a fit finds less inertia. A moving run is cut off at twice the
frequency at which its motion or its effort falls into noise, or the inertia makes more torque of the motion's noise
than the effort has, and then lower, as long as that raises the inertia; but at no less than four times the frequency
below which 99.9 % of the position's power lies, for noise may hide what a smooth motion does in its reversals. Both
sides of the equations go through the same filter, which biases nothing.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.data.differentiation import between_gaps, estimate_motion, smoothed, usable
from bristle.data.encoder import smallest_step
from bristle.data.record import Record
from bristle.estimation import levels
from bristle.findings import NOTE, Finding

_LADDER = 2**0.5  # a cut-off over the next one that is tried


def of_motion(record: Record) -> tuple[float, Finding]:
    """Cut-off of the low pass of a moving run, Hz, with the reason.

    From the longest piece between gaps: its position or velocity, and its effort if known.
    """
    part, motion, effort = _longest(record), _known(record, "velocity", "position"), _known(record, "torque", "voltage")
    moves = _shown(np.asarray(motion)[part], record.step, int(motion is record.position))
    own = moves.own if motion is record.position else _own(record)
    least = usable(record, levels.OVER_BAND * own)
    if effort is None:
        shown = _first(moves, own)
        return usable(record, max(least, levels.OVER_SEEN * shown)), _by_motion(own, shown)

    # where the inertia makes as much of the motion's noise as the effort has, both white; a command has none
    drives, order = _shown(effort[part], record.step), 2 if record.velocity is None else 1
    shown = min(_first(moves, own), _first(drives, own))
    if drives.noise > levels.NO_NOISE * 2 * record.step * np.var(effort[part]):
        made = max((sum(_inertia(record, effort, least)) ** 2) * moves.noise, 1e-300)  # by an inertia that may be
        shown = min(shown, float((drives.noise / made) ** (0.5 / order) / (2 * np.pi)))
    cutoff = usable(record, max(least, levels.OVER_SEEN * shown))
    if moves.counted:  # what counts take the fit gives back
        return cutoff, _by_motion(own, shown)

    # down the ladder while the acceleration is noise, which takes from the inertia
    (inertia, error), tried = _inertia(record, effort, cutoff), cutoff / _LADDER
    while tried > least:
        lower, its_error = _inertia(record, effort, tried)
        of_lower, of_error = levels.INERTIA_STANDS
        if lower < levels.SURE * its_error or lower - inertia <= max(of_lower * lower, of_error * error):
            break
        cutoff, inertia, error, tried = tried, lower, its_error, tried / _LADDER
    return cutoff, _by_motion(own, shown)


def without_noisy_velocity(record: Record) -> Record:
    """The record without a logged velocity of far more noise than the slope of its position has after the low pass, with a note."""
    if record.position is None or record.velocity is None:
        return record
    bare, part = replace(record, velocity=None), _longest(record)
    logged, position = (_shown(x[part], record.step) for x in (record.velocity, record.position))

    def slope_below(cutoff: float) -> float:
        """Rms of the derivative of the position's white noise up to a cut-off."""
        return float(2 * np.pi * np.sqrt(position.noise * cutoff**3 / 3))

    # that of the velocity, up to the Nyquist frequency; the cut-off, which costs more, only where it can matter
    own = float(np.sqrt(logged.noise / (2 * record.step)))
    if own <= levels.NOISIER * slope_below(usable(record, levels.OVER_BAND * position.own)):
        return record
    slope = slope_below(of_motion(bare)[0])
    if own <= levels.NOISIER * slope:
        return record
    message = f"the slope of the position, {own / slope:.2g} times quieter than the logged one (fit.set_up: as-written overrules)"
    return replace(
        bare, notes=(*record.notes, Finding("velocity-noisy", NOTE, message, {"logged": own, "slope": slope}))
    )


def _by_motion(motion: float, shown: float) -> Finding:
    """The reason for a moving run's cut-off: bandwidth of its motion, and where its signals fall into noise, Hz."""
    message = f", for 99.9 % of the motion lies below {motion:.3g} Hz, and beyond {shown:.3g} Hz its signals are noise"
    return Finding("cutoff-of-motion", NOTE, message, {"motion": motion, "shown": shown})


def of_held_speeds(record: Record) -> tuple[float, Finding]:
    """Cut-off of the low pass of a position at held speeds, Hz, with the reason: half of where it falls into noise."""
    position = _shown(np.asarray(record.position)[_longest(record)], record.step)
    shown = _first(position, position.own)
    why = f", half of the frequency up to which the position shows more than noise, {shown:.3g} Hz"
    return usable(record, levels.OVER_SEEN_HELD * shown), Finding("cutoff-of-holds", NOTE, why, {"shown": shown})


def of_slow_loading(record: Record) -> tuple[float, Finding]:
    """Cut-off of the low pass of slow loading, Hz, with the reason: ten times the bandwidth of the torque."""
    own = _shown(np.asarray(record.torque)[_longest(record)], record.step).own
    why = f", ten times the frequency below which 99.9 % of it lies, {own:.3g} Hz"
    return usable(record, levels.OVER_BAND_LOADING * own), Finding("cutoff-of-loading", NOTE, why, {"own": own})


def decimation(records: Sequence[Record]) -> int:
    """Samples per equation of moving runs, of the slowest of them."""
    needed = max(max(levels.PER_BANDWIDTH * _own(r), levels.PER_CUTOFF * r.cutoff) for r in records)
    return max(int(1 / (max(r.step for r in records) * needed)), 1)


def _longest(record: Record) -> slice:
    return max(between_gaps(record), key=lambda s: s.stop - s.start)


def _known(record: Record, *names: str) -> Array | None:
    """The first of these signals that the record has."""
    return next((x for name in names if (x := getattr(record, name)) is not None), None)


def _own(record: Record) -> float:
    """Frequency below which 99.9 % of the power of a position that is logged, else of the velocity, lies, Hz."""
    logged = ("velocity",) if record.integrated else ("position", "velocity")
    return _shown(np.asarray(_known(record, *logged))[_longest(record)], record.step).own


class _Shown(NamedTuple):
    """Spectrum of a signal against its noise, in bins that grow with the frequency."""

    f: Array  # Hz
    seen: NDArray[np.bool_]  # whether it exceeds its noise there
    own: float  # below which 99.9 % of its power lies, noise apart, Hz
    beyond: Array  # share of the power of its derivative that is seen from there on; 0 where no order is given
    noise: float  # its density, per Hz
    counted: bool  # whether it is mostly of counts


def _shown(x: Array, step: float, order: int | None = None) -> _Shown:
    # the one-sided power spectral density above 0 Hz, the mean taken off, under a Hann window
    window = np.hanning(x.size + 2)[1:-1]
    power = (np.abs(np.fft.rfft((x - x.mean()) * window)) ** 2 * 2 * step / np.sum(window**2))[1:]
    f = np.arange(1.0, power.size + 1) / (x.size * step)
    count, moved = smallest_step(x), np.abs(np.diff(x))
    uneven = np.mean(np.abs(moved - np.median(moved)) > count / 2) > levels.UNEVEN_STEPS
    highest, counts = float(np.median(power[f >= f[-1] / 2])) / np.log(2), count**2 / 6 * step if uneven else 0.0
    noise = max(highest, counts)
    edges = [0]
    while edges[-1] < f.size:
        edges.append(max(edges[-1] + 3, round(edges[-1] * 2 ** (1 / 12))))  # twelve an octave, of three lines or more
    size = np.diff([*edges[:-1], f.size])
    middle, mean = (np.add.reduceat(values, edges[:-1]) / size for values in (f, power))
    seen = mean > levels.SHOWN * noise
    below = np.cumsum((power - noise) * np.repeat(seen, size))  # what noise adds up to beyond is no motion
    own = float(f[np.argmax(below >= levels.IN_BAND * below[-1])])
    moved = np.zeros(size.size) if order is None else size * seen * (mean - noise) * middle ** (2 * order)
    beyond = np.cumsum(moved[::-1])[::-1] / max(moved.sum(), 1e-300)
    return _Shown(middle, seen, own, beyond, noise, counts > highest / 2)


def _first(shown: _Shown, above: float) -> float:
    """The first frequency above one beyond which nothing is seen for a while; else the last one.

    A square wave has gaps between its lines; what moves the joint further up, as vibration does, is part of its motion.
    """
    f, sure = shown.f, np.append(0, np.cumsum(shown.seen))
    empty = sure[np.searchsorted(f, levels.SHOWN_AGAIN * f, "right")] == sure[:-1]
    lost = np.flatnonzero(empty & (f > above) & (shown.beyond <= levels.BENDS))
    return float(f[lost[0]]) if lost.size else float(f[-1])


def _inertia(record: Record, effort: Array, cutoff: float) -> tuple[float, float]:
    """Inertia and its standard error, by regression below a cut-off, Hz, with friction, gravity and an offset."""
    moved = estimate_motion(record, cutoff)
    v, a = np.asarray(moved.velocity), np.asarray(moved.acceleration)
    q = np.zeros(v.size) if moved.position is None else moved.position
    every = max(int(0.4 / (cutoff * record.step)), 1)
    signals = np.column_stack([a, np.sign(v), v, np.sin(q), np.cos(q), np.ones(q.size), effort])
    below = smoothed(record, signals, cutoff)[::every]
    X, y = below[:, :-1], below[:, -1]
    theta = np.linalg.lstsq(X, y, rcond=None)[0]
    variance = np.linalg.pinv(X.T @ X)[0, 0] * float(np.var(y - X @ theta))
    return float(abs(theta[0])), float(np.sqrt(variance))
