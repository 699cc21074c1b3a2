"""References that a controller can play: each planned run as position and velocity over time, or as torque where it loads below breakaway.

Velocity goes from one value to the next by 3 s**2 - 2 s**3 of the time, so the acceleration is continuous; each hold begins with a run-in that is
not averaged. Runs forth and back are ordered so that the position stays within its limits, with moves between them where it would not.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil
from typing import Literal, NamedTuple

import numpy as np
from numpy.polynomial import Polynomial

from bristle.arrays import Array
from bristle.data.record import freeze
from bristle.errors import InputError
from bristle.identification.limits import Limits
from bristle.questions.experiment_design.excitation import Lines, course
from bristle.questions.experiment_design.loading import LoadingDesign

SETTLE = 0.6
"""Least run-in before a hold is averaged, s."""
DEFLECTIONS = 8.0
"""Bristle deflections travelled in a run-in: what came before is then forgotten to exp(-8)."""
TURN = 0.2
"""Least time from rest to a constant velocity, s."""
SHORTEST = 0.25
"""Least averaging time of one pass, s."""
FALL = 0.2
"""Time in which a load falls back to zero, as a share of its rise."""
_REST = 0.5
"""Rest before and after each run that starts from rest, s."""
_SMOOTH = Polynomial([0.0, 0.0, 3.0, -2.0])
"""From one velocity to the next."""
_TRAVELLED = _SMOOTH.integ()
_ACROSS = Polynomial([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])
"""From one position to the next, at rest at both."""
_STEEPEST = float(_SMOOTH.deriv()(0.5))
_FASTEST = float(_ACROSS.deriv()(0.5))
_HARDEST = float(np.abs(_ACROSS.deriv(2)(_ACROSS.deriv(3).roots().real)).max())
_USED = 0.999
"""Of each limit, so that rounding in a file stays within it."""

Kind = Literal["ramp", "presliding", "tracking", "move"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """One run; what is not commanded is nan. Arrays of shape (n,), n >= 1."""

    kind: Kind
    run: int
    """Its number, from 1; 0 for a move."""
    position: Array
    """rad."""
    velocity: Array
    """rad/s."""
    torque: Array
    """N*m."""

    def __post_init__(self) -> None:
        """Copy and freeze every array."""
        freeze(self)


class Hold(NamedTuple):
    """One pass at a constant velocity."""

    run: int
    velocity: float
    """rad/s, with its sign."""
    run_in: float
    """s."""
    averaged: float
    """s."""
    ramp: float
    """Time from rest to the velocity, s."""

    @property
    def travel(self) -> float:
        """From rest to rest, rad, with its sign."""
        return self.velocity * (self.run_in + self.averaged + self.ramp)

    @property
    def duration(self) -> float:
        """From rest to rest, s."""
        return self.run_in + self.averaged + 2 * self.ramp


def ramp_time(velocity: float, limits: Limits) -> float:
    """Time from rest to a velocity within the largest acceleration, s; at least `TURN`."""
    return max(TURN, _STEEPEST * abs(velocity) / (_USED * limits.acceleration))


def run_in(speed: float, deflection: float) -> float:
    """Time at a speed (rad/s) before its hold is averaged, s: until a bristle that bends by `deflection` rad has forgotten; at least `SETTLE`."""
    return max(SETTLE, DEFLECTIONS * deflection / speed)


def passes(velocity: float, run: int, deflection: float, limits: Limits) -> list[Hold]:
    """The holds of one run, as many as the travel makes necessary, whose averaging times add up to `limits.hold`.

    Raises InputError where the travel is too short for any.
    """
    before, ramp = run_in(abs(velocity), deflection), ramp_time(velocity, limits)
    room = _USED * limits.travel / abs(velocity) - before - ramp
    if room < min(SHORTEST, limits.hold):
        raise InputError(
            f"the travel of {limits.travel:.3g} leaves {max(room, 0.0):.2g} s to average at a velocity of {velocity:.3g}; "
            f"expected at least {SHORTEST:g} s: widen plan.position, lower plan.velocity, or raise plan.acceleration"
        )
    count = ceil(limits.hold / room - 1e-9)
    return [Hold(run, velocity, before, limits.hold / count, ramp)] * count


def fastest(deflection: float, limits: Limits) -> float:
    """The largest speed up to `limits.velocity` at which the travel leaves a hold of half of `limits.hold`, or of SHORTEST, rad/s.

    Raises InputError where that is not above the slowest.
    """
    speeds = np.geomspace(limits.slowest, limits.velocity, 400)
    least = max(SHORTEST, 0.5 * limits.hold)
    needed = [v * (run_in(v, deflection) + least + ramp_time(v, limits)) for v in speeds.tolist()]
    fits = speeds[np.array(needed) <= _USED * limits.travel]
    if fits.size < 2:
        raise InputError(
            f"the travel of {limits.travel:.3g} is too short for a hold of {least:.2g} s at any speed above {limits.slowest:.3g}; "
            "widen plan.position, or shorten plan.hold"
        )
    return float(fits[-1])


def ordered(holds: Sequence[Hold], limits: Limits) -> list[tuple[float, Hold]]:
    """Every pass with the position at which it starts, rad: forth and back in turn, as near as can be to where the last one ended."""
    forth = sorted((h for h in holds if h.velocity > 0), key=lambda h: abs(h.travel))
    back = sorted((h for h in holds if h.velocity < 0), key=lambda h: abs(h.travel))
    found, at = [], (limits.position[0] + limits.position[1]) / 2
    spare = (1 - _USED) * limits.travel / 2
    low, high = limits.position[0] + spare, limits.position[1] - spare
    ahead = True
    while forth or back:
        queue = (forth or back) if ahead else (back or forth)
        hold = queue.pop(0)
        at = min(max(at, low - min(hold.travel, 0.0)), high - max(hold.travel, 0.0))
        found.append((at, hold))
        at, ahead = at + hold.travel, not ahead
    return found


_LONGEST = 1e7
"""Samples of one run's reference."""


def hold_reference(hold: Hold, start: float, step: float) -> Reference:
    """From rest to the velocity, at it, and to rest again. Raises InputError where that takes more samples than a reference may have."""
    ends = np.cumsum([0.0, hold.ramp, hold.run_in + hold.averaged, hold.ramp])
    if not ends[-1] / step < _LONGEST:
        raise InputError(
            f"a hold at a velocity of {hold.velocity:.3g} takes {ends[-1]:.3g} s, {ends[-1] / step:.1e} samples; expected at most {_LONGEST:g}: "
            "raise plan.minimum_velocity, or give plan.hold, plan.acceleration or a lower plan.rate"
        )
    time = np.arange(ceil(ends[-1] / step - 1e-9) + 1) * step
    up, down = (np.clip((time - t) / hold.ramp, 0.0, 1.0) for t in (ends[0], ends[2]))
    flat = np.clip(time - ends[1], 0.0, ends[2] - ends[1])
    velocity = hold.velocity * (_SMOOTH(up) - _SMOOTH(down))
    way = hold.ramp * _TRAVELLED(up) + flat + hold.ramp * (down - _TRAVELLED(down))
    return _driven("ramp", hold.run, start + hold.velocity * way, velocity)


def move_reference(start: float, stop: float, limits: Limits, step: float) -> Reference:
    """From rest to rest elsewhere, never at a constant velocity."""
    way = stop - start
    duration = max(
        SETTLE,
        _FASTEST * abs(way) / (_USED * limits.velocity),
        (_HARDEST * abs(way) / (_USED * limits.acceleration)) ** 0.5,
    )
    s = np.clip(np.arange(ceil(duration / step) + 1) * step / duration, 0.0, 1.0)
    return _driven("move", 0, start + way * _ACROSS(s), way / duration * _ACROSS.deriv()(s))


def load_reference(plan: LoadingDesign, run: int, cycles: int, step: float) -> Reference:
    """Torque from zero to the peak and back, so many times, open loop, the joint at rest."""
    fall = FALL * plan.rise
    sign = -1.0 if plan.tag == "-" else 1.0
    turns = np.cumsum([0.0, _REST, *[plan.rise, fall, _REST] * cycles])
    torque = sign * plan.peak * np.array([0.0, 0.0, *[1.0, 0.0, 0.0] * cycles])
    time = np.arange(ceil(turns[-1] / step) + 1) * step
    lost = np.full(time.size, np.nan)
    return Reference(kind="presliding", run=run, position=lost, velocity=lost, torque=np.interp(time, turns, torque))


def motion_reference(lines: Lines, run: int, limits: Limits, duration: float, step: float) -> Reference:
    """The tracking motion."""
    found = course(lines, limits, duration, step)
    return _driven("tracking", run, found.position, found.velocity)


def _driven(kind: Kind, run: int, position: Array, velocity: Array) -> Reference:
    return Reference(kind=kind, run=run, position=position, velocity=velocity, torque=np.full(position.size, np.nan))
