"""Whether a stretch of a run counts as motion at constant velocity: each reason a sentence, with what would have let it in."""

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil, floor, log10

from bristle.data.constant_velocity.statistics import Evidence, Scale

_TOLERANCE = 0.05
"""Default drift of the velocity, relative to its mean; or what noise alone gives, where that is more."""
_SWING = 0.25
"""Scatter of the mean velocities of eighths of a segment, relative to their mean, beyond which there is no mean to speak of."""
POSITION_DIFFERS = "The slope of the position"
"""How the doubt begins that position and velocity disagree."""
_LETS = "would let it in"
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


def reasons(e: Evidence, usual: Scale, t: Thresholds) -> tuple[str, ...]:
    """Why a stretch does not count, one sentence each, with what would have let it in; empty where it does."""
    steady = (
        _at_rest(e, usual, t, 0.0)
        or _accelerating(e, t)
        or _hunting(e)
        or _at_rest(e, usual, t, 5 * e.velocity_error)  # which means little where the velocity drifts or swings
        or _unsteady(e, t)
        or _unsettled(e)
    )
    found = [reason for reason in (_too_short(e, usual, t), steady, _saturated(e, t)) if reason]
    return tuple(
        found if len(found) < 2 else [r.replace(_LETS, "would answer this reason, not the other") for r in found]
    )


def doubts(e: Evidence) -> tuple[str, ...]:
    """What to doubt about a stretch that counts, one sentence each."""
    found = []
    speed = abs(e.velocity)
    if sticks(e):
        found.append(
            f"Stick-slip: the velocity deviates by {e.swing / speed:.0%} of its mean and rests {e.resting:.0%} of the time; "
            "its mean torque is not the friction at its mean velocity."
        )
    if abs(e.logged - e.velocity) > max(0.005 * speed, 4 * e.velocity_error):
        found.append(
            f"{POSITION_DIFFERS}, {e.velocity:.4g}, and the mean of the velocity, {e.logged:.4g}, differ: "
            "samples may be missing, or a unit or the sampling rate be off."
        )
    if e.torque_drift > max(0.1 * abs(e.torque), e.torque_drift_noise):
        found.append(
            f"The torque changes by {e.torque_drift:.3g} over the segment, mean {e.torque:.4g}, more than its noise: "
            "it depends on position, temperature or time, or had not settled."
        )
    if e.torque_error is None:
        found.append("The torque holds fewer than two independent samples; its standard error is not known.")
    return tuple(found)


def sticks(e: Evidence) -> bool:
    """Whether the joint sticks and slips: it rests over 5 % of the time, or its velocity swings by over 30 % of the mean."""
    return e.resting > 0.05 or e.swing > 0.3 * abs(e.velocity)


def _too_short(e: Evidence, usual: Scale, t: Thresholds) -> str | None:
    if t.minimum_duration is not None:
        if e.duration >= t.minimum_duration * (1 - 1e-9):
            return None
        asked = f"segments.minimum_duration asks for {t.minimum_duration:.3g} s"
    elif e.torque_error is None:
        asked = "fewer than two of its torque samples are independent"
    elif e.samples < _INDEPENDENT * e.correlation:
        asked = f"{_INDEPENDENT * e.correlation * e.duration / e.samples:.3g} s hold the {_INDEPENDENT:g} independent samples asked for"
    elif e.duration < _SHARE * usual.duration and abs(e.velocity) * e.duration < _SHARE * usual.distance:
        least = f"{_SHARE * usual.duration:.3g} s or {_SHARE * usual.distance:.3g} of travel"
        asked = f"a quarter of this run's typical plateau, {least}, is asked for"
    else:
        return None
    option = f"segments.minimum_duration: {_rounded(e.duration, floor)} s"
    return f"Too short: it lasts {e.duration:.3g} s, and {asked}; a longer hold, or {option}, {_LETS}."


def _at_rest(e: Evidence, usual: Scale, t: Thresholds, noise: float) -> str | None:
    own = max(noise, 5 * usual.quantum / e.duration if e.duration > 0 else 0.0, 1e-3 * usual.fastest)
    least = own if t.minimum_velocity is None else t.minimum_velocity
    speed = abs(e.velocity)
    if speed > least or (t.minimum_velocity is not None and speed >= least > 0):
        return None
    wanted = "the noise floor" if t.minimum_velocity is None else "segments.minimum_velocity"
    option = f", or a segments.minimum_velocity of {_rounded(speed, floor)}," if speed > 1e-6 * usual.fastest else ""
    return f"At rest or below breakaway: its mean speed is {speed:.3g}, and {wanted} is {least:.3g}; more torque{option} {_LETS}."


def _accelerating(e: Evidence, t: Thresholds) -> str | None:
    speed = abs(e.velocity)
    own = max(_TOLERANCE * speed, min(e.drift_noise, 0.5 * speed))
    allowed = own if t.velocity_tolerance is None else t.velocity_tolerance * speed
    if e.drift <= allowed:
        return None
    return (
        f"Accelerating: its velocity drifts by {e.drift:.3g}, mean {e.velocity:.3g}, and {allowed:.3g} is allowed; a steadier motion"
        f"{_tolerance(e.drift, speed)} {_LETS}."
    )


def _hunting(e: Evidence) -> str | None:
    if e.backward <= 0.1:
        return None
    return f"Hunting: it moves backward {e.backward:.0%} of the time, and 10 % is allowed; a controller that does not oscillate {_LETS}."


def _unsteady(e: Evidence, t: Thresholds) -> str | None:
    speed = abs(e.velocity)
    allowed = max(_SWING, t.velocity_tolerance or 0.0) * speed
    if e.scatter <= allowed:
        return None
    return (
        f"Stick-slip without a steady mean: the means of its eighths scatter by {e.scatter:.3g} about {e.velocity:.3g}, and {allowed:.3g} is "
        f"allowed; a longer hold or a stiffer controller{_tolerance(e.scatter, speed)} {_LETS}."
    )


def _tolerance(deviation: float, speed: float) -> str:
    """What to set to allow this deviation, where that can be set at all."""
    share = _rounded(deviation / max(speed, 1e-300), ceil)
    return f", or a segments.velocity_tolerance of {share}," if float(share) < 1 else ""


def _rounded(x: float, way: Callable[[float], int]) -> str:
    """A number of three digits, rounded down (floor) or up (ceil), so that as a threshold it does what is said of it."""
    unit = 10.0 ** (floor(log10(x)) - 2) if x > 0 else 1.0
    return f"{way(x / unit * (1 - 1e-9 if way is floor else 1 + 1e-9)) * unit:.3g}"


def _unsettled(e: Evidence) -> str | None:
    if e.torque_drift <= max(abs(e.torque), e.torque_drift_noise):
        return None
    return (
        f"Below breakaway, or not settled: its torque changes by {e.torque_drift:.3g}, more than its mean {e.torque:.4g}; "
        f"a longer hold at this speed {_LETS}."
    )


def _saturated(e: Evidence, t: Thresholds) -> str | None:
    if t.torque_limit is not None:
        share, limit = e.limited, f"segments.torque_limit, {t.torque_limit:.4g}"
    else:
        share, limit = e.clipped, "the largest torque or voltage of the run"
    if share <= 0.05:
        return None
    return f"Saturated: {share:.0%} of its samples are at {limit}, and 5 % is allowed; a lower speed, or a higher torque_limit, {_LETS}."
