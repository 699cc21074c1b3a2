"""Whether a candidate counts as motion at constant velocity: each reason says what would have let it in."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from math import ceil, floor, log10
from typing import Annotated

from pydantic import Field

from bristle.data.constant_velocity.statistics import Evidence, Scale
from bristle.data.experiment.signals import Seconds, Speed, quantity
from bristle.data.experiment.yaml_file import StrictModel
from bristle.findings import CAUTION, NOTE, Finding, unit_of

_SHARE = 0.25
"""Of the typical plateau of a run: what is shorter both in time and in travel is a piece of something else."""
_INDEPENDENT = 5.0  # fewest independent samples of velocity and torque


class Thresholds(StrictModel):
    """What a constant-velocity segment must satisfy, as under `segments`. None: from the data's own noise floor."""

    minimum_duration: Seconds | None = None
    """Shortest segment that counts, s."""
    velocity_tolerance: Annotated[float, Field(gt=0, lt=1)] | None = None
    """Largest drift of the velocity over a segment, relative to its mean."""
    torque_limit: Annotated[float, quantity("torque"), Field(gt=0)] | None = None
    """Torque at which the drive saturates, N*m."""
    minimum_velocity: Speed | None = None
    """Slowest mean velocity that counts as motion, rad/s."""


def reasons(e: Evidence, usual: Scale, t: Thresholds) -> tuple[Finding, ...]:
    """Why a candidate does not count, with what would have let it in; empty where it does."""
    steady = next(_unsteadiness(e, usual, t), None)
    if steady and steady.code == "transient":
        return (steady,)
    against = [reason for reason in (_too_short(e, usual, t, steady), steady, _saturated(e, t)) if reason]
    effect = "would make it pass" if len(against) < 2 else "would remove this reason, not the other"
    return tuple(replace(reason, message=f"{reason.message} {effect}.") for reason in against)


def warnings(e: Evidence) -> Iterator[Finding]:
    """Warnings about a candidate that counts."""
    speed, velocity, torque = abs(e.velocity), unit_of("velocity"), unit_of("torque")
    if sticks(e):
        swing = e.swing / speed
        message = (
            f"Stick-slip: the velocity deviates by {100 * swing:.0f} % of its mean and is zero {100 * e.resting:.0f} % of the time; "
            "the mean torque is not the friction at the mean velocity."
        )
        yield Finding("stick-slip", CAUTION, message, {"swing": swing, "resting": e.resting})
    if abs(e.logged - e.velocity) > max(0.005 * speed, 4 * e.velocity_error):
        message = (
            f"The slope of the position, {e.velocity:.4g}{velocity}, and the mean of the logged velocity, {e.logged:.4g}{velocity}, differ: "
            "check for missing samples, a wrong unit or a wrong sampling rate."
        )
        yield Finding("position-differs", CAUTION, message, {"slope": e.velocity, "logged": e.logged})
    if e.torque_drift > max(0.1 * abs(e.torque), e.torque_drift_noise):
        message = (
            f"The torque changes by {e.torque_drift:.3g}{torque} over the segment (mean {e.torque:.4g}{torque}), more than its noise: it "
            "depends on position, temperature or time, or had not settled."
        )
        yield Finding("torque-drifts", CAUTION, message, {"drift": e.torque_drift, "torque": e.torque})
    if e.torque_error is None:
        message = "Fewer than two of the torque samples are independent; the standard error of the torque is unknown."
        yield Finding("torque-unsure", NOTE, message)


def sticks(e: Evidence) -> bool:
    """Whether the joint sticks and slips: it rests over 5 % of the time, or its velocity swings by over 30 % of the mean."""
    return e.resting > 0.05 or e.swing > 0.3 * abs(e.velocity)


def _too_short(e: Evidence, usual: Scale, t: Thresholds, other: Finding | None) -> Finding | None:
    """Messages here lack their effect, which `reasons` adds; beside another reason no threshold is proposed: it would let in no plateau."""
    if t.minimum_duration is not None:
        if e.duration >= t.minimum_duration * (1 - 1e-9):
            return None
        asked = f"segments.minimum_duration requires {t.minimum_duration:.3g} s"
    elif e.torque_error is None:
        asked = "fewer than two of its torque samples are independent"
    elif e.samples < _INDEPENDENT * e.correlation:
        least = _INDEPENDENT * e.correlation * e.duration / e.samples
        asked = f"{_INDEPENDENT:g} independent samples require {least:.3g} s"
    elif e.duration < _SHARE * usual.duration and abs(e.velocity) * e.duration < _SHARE * usual.distance:
        duration, travel = _SHARE * usual.duration, _SHARE * usual.distance
        asked = f"a quarter of this run's typical plateau, {duration:.3g} s or {travel:.3g} of travel, is required"
    else:
        return None
    option = "" if other else f", or a segments.minimum_duration of {_rounded(e.duration, floor)} s,"
    message = f"Too short: {e.duration:.3g} s; {asked}. A longer hold{option}"
    return Finding("too-short", NOTE, message, {"duration": e.duration})


def _at_rest(e: Evidence, usual: Scale, t: Thresholds, noise: float) -> Iterator[Finding]:
    noise_floor = max(noise, 5 * usual.quantum / e.duration if e.duration > 0 else 0.0, 1e-3 * usual.fastest)
    least = noise_floor if t.minimum_velocity is None else t.minimum_velocity
    speed = abs(e.velocity)
    if speed > least or (t.minimum_velocity is not None and speed >= least > 0):
        return
    wanted = "the noise floor" if t.minimum_velocity is None else "segments.minimum_velocity"
    moves, unit = speed > 1e-6 * usual.fastest, unit_of("velocity")
    option = f", or a segments.minimum_velocity of {_rounded(speed, floor)}," if moves else ""
    message = (
        f"At rest or below breakaway: its mean speed is {speed:.3g}{unit}, and {wanted} is {least:.3g}{unit}. "
        f"More torque{option}"
    )
    yield Finding("at-rest", NOTE, message, {"speed": speed, "least": least})


def _unsteadiness(e: Evidence, usual: Scale, t: Thresholds) -> Iterator[Finding]:
    """Why there is no steady motion, of which the first counts: transient, with a whole message, where no tolerance would let it in."""
    yield from _at_rest(e, usual, t, 0.0)
    speed, unit, of_torque = abs(e.velocity), unit_of("velocity"), unit_of("torque")
    # default drift of the velocity, relative to its mean; or what noise alone gives, where that is more
    tolerance = max(0.05 * speed, min(e.drift_noise, 0.5 * speed))
    allowed = tolerance if t.velocity_tolerance is None else t.velocity_tolerance * speed
    option, drift = _tolerance(e.drift, speed), {"drift": e.drift, "velocity": e.velocity}
    if e.drift > allowed and not option:
        message = (
            f"Transient: for {e.duration:.3g} s its velocity changes by {e.drift:.3g}{unit} about a mean of {e.velocity:.3g}{unit}, on the way "
            "from one speed to another; it is not a plateau, and no setting makes it one."
        )
        yield Finding("transient", NOTE, message, {"duration": e.duration, **drift})
    if e.drift > allowed:
        message = (
            f"Accelerating: its velocity drifts by {e.drift:.3g}{unit} about a mean of {e.velocity:.3g}{unit}; {allowed:.3g}{unit} is "
            f"allowed. A steadier motion{option}"
        )
        yield Finding("accelerating", NOTE, message, {**drift, "allowed": allowed})
    if e.backward > 0.1:
        message = (
            f"Hunting: it moves backward {100 * e.backward:.0f} % of the time; 10 % is allowed. "
            "A controller that does not oscillate"
        )
        yield Finding("hunting", NOTE, message, {"backward": e.backward})
    yield from _at_rest(e, usual, t, 5 * e.velocity_error)  # which means little where the velocity drifts or swings
    # scatter of the mean velocities of eighths of a segment, relative to their mean, beyond which there is no mean to speak of
    allowed = max(0.25, t.velocity_tolerance or 0.0) * speed
    if e.scatter > allowed:
        message = (
            f"Stick-slip without a steady mean: the means of its eighths scatter by {e.scatter:.3g}{unit} about {e.velocity:.3g}{unit}; "
            f"{allowed:.3g}{unit} is allowed. A longer hold or a stiffer controller{_tolerance(e.scatter, speed)}"
        )
        yield Finding("unsteady", NOTE, message, {"scatter": e.scatter, "velocity": e.velocity, "allowed": allowed})
    if e.torque_drift > max(abs(e.torque), e.torque_drift_noise):
        message = (
            f"Below breakaway, or not settled: its torque changes by {e.torque_drift:.3g}{of_torque}, more than its mean of "
            f"{e.torque:.4g}{of_torque}. A longer hold at this speed"
        )
        yield Finding("unsettled", NOTE, message, {"drift": e.torque_drift, "torque": e.torque})


def _tolerance(deviation: float, speed: float) -> str:
    """What to set to allow this deviation; empty where it cannot be set."""
    share = _rounded(deviation / max(speed, 1e-300), ceil)
    return f", or a segments.velocity_tolerance of {share}," if float(share) < 1 else ""


def _rounded(x: float, way: Callable[[float], int]) -> str:
    """A number of three digits, rounded down (floor) or up (ceil): as a threshold it does what is said of it."""
    unit = 10.0 ** (floor(log10(x)) - 2) if x > 0 else 1.0
    return f"{way(x / unit * (1 - 1e-9 if way is floor else 1 + 1e-9)) * unit:.3g}"


def _saturated(e: Evidence, t: Thresholds) -> Finding | None:
    if t.torque_limit is not None:
        share, limit = e.limited, f"segments.torque_limit, {t.torque_limit:.4g}{unit_of('torque')}"
    else:
        share, limit = e.clipped, "the largest torque or voltage of the run"
    if share <= 0.05:
        return None
    message = (
        f"Saturated: {100 * share:.0f} % of its samples are at {limit}; 5 % is allowed. "
        "A lower speed, or a higher torque_limit,"
    )
    return Finding("saturated", NOTE, message, {"share": share})
