"""Whether a candidate counts as motion at constant velocity: each reason says what would have let it in."""

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil, floor, log10

from bristle.data.constant_velocity.statistics import Evidence, Scale
from bristle.diagnostics import Kind, but
from bristle.findings import Finding

_TOLERANCE = 0.05
"""Default drift of the velocity, relative to its mean; or what noise alone gives, where that is more."""
_SWING = 0.25
"""Scatter of the mean velocities of eighths of a segment, relative to their mean, beyond which there is no mean to
speak of."""
_SHARE = 0.25
"""Of the typical plateau of a run: what is shorter both in time and in travel is a piece of something else."""
_INDEPENDENT = 5.0
"""Fewest independent samples of velocity and torque."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Thresholds:
    """What a constant-velocity segment must satisfy. None: from the data's own noise floor."""

    minimum_duration: float | None = None
    """Shortest segment that counts, s."""
    velocity_tolerance: float | None = None
    """Largest drift of the velocity over a segment, relative to its mean."""
    torque_limit: float | None = None
    """Torque at which the drive saturates, N*m."""
    minimum_velocity: float | None = None
    """Slowest mean velocity that counts as motion, rad/s."""


def reasons(e: Evidence, usual: Scale, t: Thresholds) -> tuple[Finding, ...]:
    """Why a candidate does not count, with what would have let it in; empty where it does."""
    steady = (
        _at_rest(e, usual, t, 0.0)
        or _accelerating(e, t)
        or _hunting(e)
        or _at_rest(e, usual, t, 5 * e.velocity_error)  # which means little where the velocity drifts or swings
        or _unsteady(e, t)
        or _unsettled(e)
    )
    if steady and steady.code == "accelerating" and not steady.numbers["option"]:
        return (Kind.TRANSIENT(duration=e.duration, drift=e.drift, velocity=e.velocity),)
    against = [reason for reason in (_too_short(e, usual, t, steady), steady, _saturated(e, t)) if reason]
    return tuple(but(reason, alone=len(against) < 2) for reason in against)


def warnings(e: Evidence) -> tuple[Finding, ...]:
    """Warnings about a candidate that counts."""
    out = []
    speed = abs(e.velocity)
    if sticks(e):
        out.append(Kind.STICK_SLIP(swing=e.swing / speed, resting=e.resting))
    if abs(e.logged - e.velocity) > max(0.005 * speed, 4 * e.velocity_error):
        out.append(Kind.POSITION_DIFFERS(slope=e.velocity, logged=e.logged))
    if e.torque_drift > max(0.1 * abs(e.torque), e.torque_drift_noise):
        out.append(Kind.TORQUE_DRIFTS(drift=e.torque_drift, torque=e.torque))
    if e.torque_error is None:
        out.append(Kind.TORQUE_UNSURE())
    return tuple(out)


def sticks(e: Evidence) -> bool:
    """Whether the joint sticks and slips.

    It rests over 5 % of the time, or its velocity swings by over 30 % of the mean.
    """
    return e.resting > 0.05 or e.swing > 0.3 * abs(e.velocity)


def _too_short(e: Evidence, usual: Scale, t: Thresholds, other: Finding | None) -> Finding | None:
    """Where there is another reason too, no threshold is proposed: it would let in what is no plateau."""
    if t.minimum_duration is not None:
        if e.duration >= t.minimum_duration * (1 - 1e-9):
            return None
        asked = Kind.DURATION_ASKED(asked=t.minimum_duration)
    elif e.torque_error is None:
        asked = Kind.DEPENDENT_TORQUE()
    elif e.samples < _INDEPENDENT * e.correlation:
        asked = Kind.SAMPLES_ASKED(asked=_INDEPENDENT * e.correlation * e.duration / e.samples, count=_INDEPENDENT)
    elif e.duration < _SHARE * usual.duration and abs(e.velocity) * e.duration < _SHARE * usual.distance:
        asked = Kind.USUAL_ASKED(duration=_SHARE * usual.duration, travel=_SHARE * usual.distance)
    else:
        return None
    option = "" if other else Kind.OR_MINIMUM_DURATION(value=_rounded(e.duration, floor))
    return Kind.TOO_SHORT(alone=True, duration=e.duration, asked=asked, option=option)


def _at_rest(e: Evidence, usual: Scale, t: Thresholds, noise: float) -> Finding | None:
    noise_floor = max(noise, 5 * usual.quantum / e.duration if e.duration > 0 else 0.0, 1e-3 * usual.fastest)
    least = noise_floor if t.minimum_velocity is None else t.minimum_velocity
    speed = abs(e.velocity)
    if speed > least or (t.minimum_velocity is not None and speed >= least > 0):
        return None
    wanted = Kind.NOISE_FLOOR() if t.minimum_velocity is None else Kind.MINIMUM_VELOCITY()
    option = Kind.OR_MINIMUM_VELOCITY(value=_rounded(speed, floor)) if speed > 1e-6 * usual.fastest else ""
    return Kind.AT_REST(alone=True, speed=speed, wanted=wanted, least=least, option=option)


def _accelerating(e: Evidence, t: Thresholds) -> Finding | None:
    speed = abs(e.velocity)
    tolerance = max(_TOLERANCE * speed, min(e.drift_noise, 0.5 * speed))
    allowed = tolerance if t.velocity_tolerance is None else t.velocity_tolerance * speed
    if e.drift <= allowed:
        return None
    return Kind.ACCELERATING(
        alone=True, drift=e.drift, velocity=e.velocity, allowed=allowed, option=_tolerance(e.drift, speed)
    )


def _hunting(e: Evidence) -> Finding | None:
    if e.backward <= 0.1:
        return None
    return Kind.HUNTING(alone=True, backward=e.backward)


def _unsteady(e: Evidence, t: Thresholds) -> Finding | None:
    speed = abs(e.velocity)
    allowed = max(_SWING, t.velocity_tolerance or 0.0) * speed
    if e.scatter <= allowed:
        return None
    return Kind.UNSTEADY(
        alone=True, scatter=e.scatter, velocity=e.velocity, allowed=allowed, option=_tolerance(e.scatter, speed)
    )


def _tolerance(deviation: float, speed: float) -> Finding | str:
    """What to set to allow this deviation, where that can be set at all."""
    share = _rounded(deviation / max(speed, 1e-300), ceil)
    return Kind.OR_VELOCITY_TOLERANCE(value=share) if float(share) < 1 else ""


def _rounded(x: float, way: Callable[[float], int]) -> str:
    """A number of three digits, rounded down (floor) or up (ceil): as a threshold it does what is said of it."""
    unit = 10.0 ** (floor(log10(x)) - 2) if x > 0 else 1.0
    return f"{way(x / unit * (1 - 1e-9 if way is floor else 1 + 1e-9)) * unit:.3g}"


def _unsettled(e: Evidence) -> Finding | None:
    if e.torque_drift <= max(abs(e.torque), e.torque_drift_noise):
        return None
    return Kind.UNSETTLED(alone=True, drift=e.torque_drift, torque=e.torque)


def _saturated(e: Evidence, t: Thresholds) -> Finding | None:
    if t.torque_limit is not None:
        share, limit = e.limited, Kind.LIMIT_GIVEN(limit=t.torque_limit)
    else:
        share, limit = e.clipped, Kind.LIMIT_SEEN()
    if share <= 0.05:
        return None
    return Kind.SATURATED(alone=True, share=share, limit=limit)
