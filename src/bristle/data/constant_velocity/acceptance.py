"""Evidence on candidates for segments of constant velocity, and the reasons that reject them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from bristle.arrays import Array
from bristle.data.constant_velocity.changepoints import CandidateSpan
from bristle.data.experiment.signals import Seconds, Speed
from bristle.data.experiment.yaml_file import StrictModel
from bristle.data.record import Record
from bristle.estimation import levels
from bristle.estimation.autocorrelation import inflation, standard_error, white_noise
from bristle.findings import CAUTION, NOTE, Finding, unit_of


@dataclass(frozen=True, slots=True, kw_only=True)
class Scale:
    """Typical values of a run, to which its candidates are compared."""

    quantum: float  # encoder resolution, as declared or else the smallest step seen, rad; 0 where there is no position
    fastest: float  # largest mean speed of any candidate, rad/s
    duration: float  # typical duration of a plateau: the median, weighted by duration, s
    distance: float  # typical distance travelled in one, rad
    extremes: tuple[float, ...]  # largest abs(torque) and abs(voltage), inf where too few levels show a limit
    commanded: bool  # whether a plateau below the largest torque holds one value: then the torque is a command


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """Measurements of one candidate; velocities and torques as in `Segment`."""

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
    clipped: float  # share of samples at the extreme torque or voltage; of a possible command only if not all


def usual_scale(record: Record, candidates: Sequence[CandidateSpan], resolution: float | None) -> Scale:
    """Typical values of a run, from its plateaus, or from all of it where there is none."""
    velocity, time = np.asarray(record.velocity), record.time
    plateaus = [s for s in candidates if s.plateau] or [CandidateSpan(0, time.size, False)]
    durations = np.array([time[s.stop - 1] - time[s.start] for s in plateaus])
    speeds = np.array([abs(float(np.mean(velocity[s.start : s.stop]))) for s in plateaus])
    steps = np.abs(np.diff(record.position)) if record.position is not None else np.zeros(0)
    smallest = float(np.min(steps, where=steps > 1e-9 * steps.max(initial=0.0), initial=np.inf))
    signals = [np.abs(x) for x in (record.torque, record.voltage) if x is not None]
    torque = np.abs(np.asarray(record.torque))
    lower = [x for s in plateaus if (x := torque[s.start : s.stop]).max() < torque.max() * (1 - 1e-6)]
    return Scale(
        quantum=resolution or (smallest if np.isfinite(smallest) else 0.0),
        fastest=float(speeds.max()),
        duration=_weighted_median(durations, durations),
        distance=_weighted_median(durations * speeds, durations),
        extremes=tuple(float(x.max()) if np.unique(x).size > levels.ENOUGH else np.inf for x in signals),
        commanded=any(np.ptp(x) == 0 for x in lower),
    )


def evidence(record: Record, candidate: CandidateSpan, usual: Scale) -> Evidence:
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
        velocity_error=drift_noise / (levels.DEVIATIONS * np.sqrt(12)),
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
    )


def _drift(x: Array) -> tuple[float, float, float]:
    """Range of the parabola through x, four deviations of what noise makes of it, samples per independent one."""
    n = x.size
    if n < 4:
        return float(np.ptp(x)), 0.0, 1.0
    s = np.linspace(-1, 1, n)
    basis = np.stack([np.ones(n), s, s * s - np.mean(s * s)])
    fitted = (basis @ x / (basis * basis).sum(axis=1)) @ basis
    rest = x - fitted
    correlation = inflation(rest)
    return float(np.ptp(fitted)), levels.DEVIATIONS * float(np.std(rest) * np.sqrt(12 * correlation / n)), correlation


def _swing(v: Array, position: Array | None, time: Array, mean: float, quantum: float) -> tuple[float, float, float]:
    """Deviation, and shares at rest and backward, of v averaged so that noise is a tenth of the mean."""
    from scipy.ndimage import uniform_filter1d

    n, speed = v.size, abs(mean)
    if n < levels.SWING_SAMPLES or speed == 0:
        return 0.0, 0.0, 0.0
    step = (time[-1] - time[0]) / (n - 1)
    noise = white_noise(v)
    window = int(np.ceil(max((10 * noise / speed) ** 2, 10 * quantum / (speed * step), 1.0)))
    visible = position is None or float(np.std(position - position[0] - mean * (time - time[0]))) > quantum
    if window > n // levels.SWING_WINDOWS or not visible:
        return 0.0, 0.0, 0.0
    smooth = uniform_filter1d(v, window)[window // 2 : n - window // 2] * np.sign(mean)
    slow = levels.STANDS * speed
    return float(np.std(smooth)), float(np.mean(np.abs(smooth) < slow)), float(np.mean(smooth < -slow))


def _weighted_median(x: Array, weight: Array) -> float:
    order = np.argsort(x)
    total = np.cumsum(weight[order])
    return float(x[order][np.searchsorted(total, total[-1] / 2)])


class Thresholds(StrictModel):
    """What a constant-velocity segment must satisfy, as under `segments`; None: from the data's own noise floor."""

    minimum_duration: Seconds | None = None  # shortest segment that counts, s
    velocity_tolerance: Annotated[float, Field(gt=0, lt=1)] | None = None  # largest drift relative to the mean
    minimum_velocity: Speed | None = None  # slowest mean velocity that counts as motion, rad/s


def reasons(e: Evidence, usual: Scale, t: Thresholds) -> tuple[Finding, ...]:
    """Reasons that reject a candidate; none where it counts."""
    steady = next(_unsteadiness(e, usual, t), None)
    if steady and steady.code == "transient":
        return (steady,)
    return tuple(reason for reason in (_too_short(e, usual, t), steady, _saturated(e)) if reason)


def warnings(e: Evidence) -> Iterator[Finding]:
    """Warnings about an accepted candidate."""
    speed, velocity, torque = abs(e.velocity), unit_of("velocity"), unit_of("torque")
    if sticks(e):
        swing = e.swing / speed
        message = (
            f"Stick-slip: the velocity swings by {100 * swing:.0f} %, and rests {100 * e.resting:.0f} % of the time."
        )
        yield Finding("stick-slip", CAUTION, message, {"swing": swing, "resting": e.resting})
    if abs(e.logged - e.velocity) > max(levels.POSITION_DIFFERS * speed, levels.DEVIATIONS * e.velocity_error):
        message = f"The position moves at {e.velocity:.4g}{velocity}, the logged velocity is {e.logged:.4g}{velocity}."
        yield Finding("position-differs", CAUTION, message, {"slope": e.velocity, "logged": e.logged})
    if e.torque_drift > max(levels.TORQUE_DRIFTS * abs(e.torque), e.torque_drift_noise):
        message = f"The torque changes by {e.torque_drift:.3g}{torque} over the segment (mean {e.torque:.4g}{torque})."
        yield Finding("torque-drifts", CAUTION, message, {"drift": e.torque_drift, "torque": e.torque})


def sticks(e: Evidence) -> bool:
    """Whether the joint sticks and slips: it rests over a share of the time, or its velocity swings too far about its mean."""
    return e.resting > levels.STICKS or e.swing > levels.SWINGS * abs(e.velocity)


def _too_short(e: Evidence, usual: Scale, t: Thresholds) -> Finding | None:
    if t.minimum_duration is not None:
        if e.duration >= t.minimum_duration * (1 - 1e-9):
            return None
        asked = f"segments.minimum_duration requires {t.minimum_duration:.3g} s"
    elif e.torque_error is None:
        asked = "fewer than two of its torque samples are independent"
    elif e.samples < levels.SEVERAL * e.correlation:
        least = levels.SEVERAL * e.correlation * e.duration / e.samples
        asked = f"{levels.SEVERAL:g} independent samples require {least:.3g} s"
    elif (
        e.duration < levels.SHORT_PLATEAU * usual.duration
        and abs(e.velocity) * e.duration < levels.SHORT_PLATEAU * usual.distance
    ):
        duration, travel = levels.SHORT_PLATEAU * usual.duration, levels.SHORT_PLATEAU * usual.distance
        asked = f"a quarter of this run's typical plateau, {duration:.3g} s or {travel:.3g} of travel, is required"
    else:
        return None
    message = f"Too short: {e.duration:.3g} s; {asked}. Hold the speed for longer."
    return Finding("too-short", NOTE, message, {"duration": e.duration})


def _at_rest(e: Evidence, usual: Scale, t: Thresholds, noise: float) -> Iterator[Finding]:
    counts = levels.MOVES * usual.quantum / e.duration if e.duration > 0 else 0.0
    noise_floor = max(noise, counts, levels.MOVES_SPEED * usual.fastest)
    least = noise_floor if t.minimum_velocity is None else t.minimum_velocity
    speed = abs(e.velocity)
    if speed > least or (t.minimum_velocity is not None and speed >= least > 0):
        return
    wanted = "the noise floor" if t.minimum_velocity is None else "segments.minimum_velocity"
    unit = unit_of("velocity")
    message = f"At rest or below breakaway: its mean speed is {speed:.3g}{unit}, and {wanted} is {least:.3g}{unit}."
    yield Finding("at-rest", NOTE, message, {"speed": speed, "least": least})


def _unsteadiness(e: Evidence, usual: Scale, t: Thresholds) -> Iterator[Finding]:
    """Reasons against steady motion, of which the first counts."""
    yield from _at_rest(e, usual, t, 0.0)
    speed, unit, of_torque = abs(e.velocity), unit_of("velocity"), unit_of("torque")
    tolerance = max(levels.DRIFTS * speed, min(e.drift_noise, 0.5 * speed))
    allowed = tolerance if t.velocity_tolerance is None else t.velocity_tolerance * speed
    drift = {"drift": e.drift, "velocity": e.velocity}
    if e.drift > max(allowed, levels.TRANSIENT * speed):
        message = f"Transient: in {e.duration:.3g} s its velocity changes by {e.drift:.3g}{unit}, to another speed."
        yield Finding("transient", NOTE, message, {"duration": e.duration, **drift})
    if e.drift > allowed:
        message = f"Accelerating: its velocity drifts by {e.drift:.3g}{unit}; {allowed:.3g}{unit} is allowed (segments.velocity_tolerance)."
        yield Finding("accelerating", NOTE, message, {**drift, "allowed": allowed})
    if e.backward > levels.HUNTS:
        share, allowed = 100 * e.backward, 100 * levels.HUNTS
        message = f"Hunting: it moves backward {share:.0f} % of the time; {allowed:.0f} % is allowed."
        yield Finding("hunting", NOTE, message, {"backward": e.backward})
    yield from _at_rest(e, usual, t, levels.MOVES * e.velocity_error)  # means little where velocity drifts or swings
    allowed = max(levels.SCATTERS, t.velocity_tolerance or 0.0) * speed
    if e.scatter > allowed:
        message = f"Stick-slip without a steady mean: that of its eighths scatters by {e.scatter:.3g}{unit}; {allowed:.3g}{unit} is allowed."
        yield Finding("unsteady", NOTE, message, {"scatter": e.scatter, "velocity": e.velocity, "allowed": allowed})
    if e.torque_drift > max(abs(e.torque), e.torque_drift_noise):
        message = f"Below breakaway, or not settled: its torque changes by {e.torque_drift:.3g}{of_torque}, more than its mean."
        yield Finding("unsettled", NOTE, message, {"drift": e.torque_drift, "torque": e.torque})


def _saturated(e: Evidence) -> Finding | None:
    if e.clipped <= levels.SATURATED:
        return None
    share, allowed = 100 * e.clipped, 100 * levels.SATURATED
    message = f"Saturated: {share:.0f} % of its samples are at the largest torque or voltage; {allowed:.0f} % is allowed. Move slower."
    return Finding("saturated", NOTE, message, {"share": e.clipped})
