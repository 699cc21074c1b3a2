"""What a candidate shows: means, standard errors, drifts, swings, each with the noise that it stands against."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bristle.arrays import Array
from bristle.data.constant_velocity.changepoints import CandidateSpan
from bristle.data.record import Record
from bristle.estimation.autocorrelation import inflation, standard_error


@dataclass(frozen=True, slots=True, kw_only=True)
class Scale:
    """What is usual in a run, for its candidates to be compared with."""

    quantum: float  # encoder resolution, as declared or else the smallest step seen, rad; 0 where there is no position
    fastest: float  # largest mean speed of any candidate, rad/s
    duration: float  # typical duration of a plateau: the median, weighted by duration, s
    distance: float  # typical distance travelled in one, rad
    extremes: tuple[float, ...]
    """Largest abs(torque) and abs(voltage), where there are enough levels for a limit to stand out."""
    commanded: bool
    """Whether a plateau below the largest torque holds one value: then the torque is a command, and holds others too."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """What one candidate shows; velocities and torques as in `Segment`."""

    samples: int
    duration: float
    velocity: float
    logged: float  # mean of the velocity signal, rad/s
    velocity_error: float  # standard error of `logged`, its drift apart
    torque: float
    torque_error: float | None
    correlation: float  # samples per independent sample of velocity or torque, whichever has more, drifts apart
    drift: float  # range of the parabola through the velocity, rad/s
    drift_noise: float  # what noise alone makes of it, four deviations
    torque_drift: float
    torque_drift_noise: float
    scatter: float  # standard deviation of the mean velocities of eighths, rad/s
    swing: float  # standard deviation of the velocity that is not noise, rad/s; 0 where noise hides it
    resting: float  # share of the time at less than a tenth of the mean velocity
    backward: float  # share of the time moving the other way, faster than a tenth of the mean velocity
    clipped: float
    """Share of samples at the record's extreme torque or voltage; of what may be a command where it is not all."""
    limited: float  # share of samples at or beyond the torque limit


def usual_scale(record: Record, candidates: Sequence[CandidateSpan], resolution: float | None) -> Scale:
    """What is usual in a run; from its plateaus, or from all of it where there is none."""
    velocity, time = np.asarray(record.velocity), record.time
    plateaus = [s for s in candidates if s.plateau] or [CandidateSpan(0, time.size, False)]
    durations = np.array([time[s.stop - 1] - time[s.start] for s in plateaus])
    speeds = np.array([abs(float(np.mean(velocity[s.start : s.stop]))) for s in plateaus])
    steps = np.abs(np.diff(record.position)) if record.position is not None else np.zeros(0)
    smallest = float(np.min(steps, where=steps > 1e-9 * steps.max(initial=0.0), initial=np.inf))
    signals = [np.abs(x) for x in (record.torque, record.voltage) if x is not None]
    torque = np.abs(np.asarray(record.torque))
    levels = [x for s in plateaus if (x := torque[s.start : s.stop]).max() < torque.max() * (1 - 1e-6)]
    return Scale(
        quantum=resolution or (smallest if np.isfinite(smallest) else 0.0),
        fastest=float(speeds.max()),
        duration=_weighted_median(durations, durations),
        distance=_weighted_median(durations * speeds, durations),
        extremes=tuple(float(x.max()) if np.unique(x).size > 20 else np.inf for x in signals),
        commanded=any(np.ptp(x) == 0 for x in levels),
    )


def evidence(record: Record, candidate: CandidateSpan, usual: Scale, torque_limit: float | None) -> Evidence:
    """Measure one candidate of a run."""
    part = slice(candidate.start, candidate.stop)
    time, v, torque = record.time[part], np.asarray(record.velocity)[part], np.asarray(record.torque)[part]
    n, logged = v.size, float(v.mean())
    velocity, position = logged, None if record.position is None else record.position[part]
    if position is not None and n >= 3:
        velocity = float(np.polyfit(time - time.mean(), position - position[0], 1)[0])
    swing, resting, backward = _swing(v, position, time, velocity, usual.quantum)
    drift, drift_noise, v_correlation = _drift(v)
    torque_drift, torque_drift_noise, t_correlation = _drift(torque)
    signals = [np.abs(x[part]) for x in (record.torque, record.voltage) if x is not None]
    pinned = [float(np.mean(x >= e * (1 - 1e-6))) for x, e in zip(signals, usual.extremes, strict=True)]
    measured = record.voltage is None and not usual.commanded
    return Evidence(
        samples=n,
        duration=float(time[-1] - time[0] + np.nan_to_num(record.step)),
        velocity=velocity,
        logged=velocity if record.velocity_estimated else logged,
        velocity_error=drift_noise / (4 * np.sqrt(12)),
        torque=float(torque.mean()),
        torque_error=standard_error(torque) if n > 1 else None,
        correlation=max(v_correlation, t_correlation),
        drift=drift,
        drift_noise=drift_noise,
        torque_drift=torque_drift,
        torque_drift_noise=torque_drift_noise,
        scatter=float(np.std([x.mean() for x in np.array_split(v, 8)])) if n >= 8 else 0.0,
        swing=swing,
        resting=resting,
        backward=backward,
        clipped=max([share for share in pinned if share < 1 or measured], default=0.0),
        limited=float(np.mean(np.abs(torque) >= 0.999 * torque_limit)) if torque_limit else 0.0,
    )


def _drift(x: Array) -> tuple[float, float, float]:
    """Range of the parabola through x, four standard deviations of the range that noise gives a constant, and samples per independent one."""
    n = x.size
    if n < 4:
        return float(np.ptp(x)), 0.0, 1.0
    s = np.linspace(-1, 1, n)
    basis = np.stack([np.ones(n), s, s * s - np.mean(s * s)])
    fitted = (basis @ x / (basis * basis).sum(axis=1)) @ basis
    rest = x - fitted
    correlation = inflation(rest)
    return float(np.ptp(fitted)), 4 * float(np.std(rest) * np.sqrt(12 * correlation / n)), correlation


def _swing(v: Array, position: Array | None, time: Array, mean: float, quantum: float) -> tuple[float, float, float]:
    """Deviation, and shares at rest and backward, of v averaged over a window just long enough for noise to be a tenth of the mean."""
    from scipy.ndimage import uniform_filter1d

    n, speed = v.size, abs(mean)
    if n < 32 or speed == 0:
        return 0.0, 0.0, 0.0
    step = (time[-1] - time[0]) / (n - 1)
    noise = float(np.median(np.abs(np.diff(v, 2)))) / (0.6745 * np.sqrt(6))
    window = int(np.ceil(max((10 * noise / speed) ** 2, 10 * quantum / (speed * step), 1.0)))
    visible = position is None or float(np.std(position - position[0] - mean * (time - time[0]))) > quantum
    if window > n // 16 or not visible:
        return 0.0, 0.0, 0.0
    smooth = uniform_filter1d(v, window)[window // 2 : n - window // 2] * np.sign(mean)
    return float(np.std(smooth)), float(np.mean(np.abs(smooth) < 0.1 * speed)), float(np.mean(smooth < -0.1 * speed))


def _weighted_median(x: Array, weight: Array) -> float:
    order = np.argsort(x)
    total = np.cumsum(weight[order])
    return float(x[order][np.searchsorted(total, total[-1] / 2)])
