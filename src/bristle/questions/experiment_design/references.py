"""References of a plan within its limits: holds at constant velocity, their order, and all samples to play.

Each hold begins with a run-in that is not averaged. Runs go back and forth within the limits of position, with moves
between them where needed.
"""

from collections.abc import Sequence
from math import ceil
from typing import Literal

import numpy as np

from bristle.arrays import Array, result
from bristle.control.compensator import Reference
from bristle.errors import InputError
from bristle.model.parameters import Direction
from bristle.questions.experiment_design.excitation import MotionDesign, course
from bristle.questions.experiment_design.loading import CYCLES, LoadingDesign
from bristle.simulation.limits import Limits
from bristle.simulation.references import FASTEST, HARDEST, STEEPEST, Hold, Move, SlowLoads

SETTLE = 0.6  # least run-in before a hold is averaged, s
DEFLECTIONS = 8.0  # bristle deflections travelled in a run-in: the earlier state decays to exp(-8)
TURN = 0.2  # least time from rest to a constant velocity, s
SHORTEST = 0.25  # least averaging time of one pass, s
_REST = 0.5  # rest before and after each run that starts from rest, s
_USED = 0.999  # used share of each limit, because of rounding in a file
MOST = 2_000_000  # most samples of all references: five hours at the usual rate

Parts = list[tuple[Hold | Move, float]]  # holds and moves, each with its initial position, rad
Kind = Literal["ramp", "presliding", "tracking", "move"]


@result
class PlannedRun:
    """One run: position, rad, velocity, rad/s, torque, N*m, (n,); nan where not commanded."""

    kind: Kind
    run: int  # its number, from 1; 0 for a move
    position: Array
    velocity: Array
    torque: Array


def ramp_time(velocity: float, limits: Limits) -> float:
    """Time from rest to a velocity within the largest acceleration, s; at least `TURN`."""
    return max(TURN, STEEPEST * abs(velocity) / (_USED * limits.acceleration))


def run_in(speed: float, deflection: float) -> float:
    """Run-in at a speed, rad/s, with a bristle deflection, rad, before a hold is averaged, s."""
    return max(SETTLE, DEFLECTIONS * deflection / speed)


def passes(velocity: float, run: int, deflection: float, limits: Limits) -> list[Hold]:
    """The holds of a run, averaged over `limits.hold` together. Raises InputError where the travel is too short."""
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
    """Largest speed, rad/s, at which the travel leaves a hold. Raises InputError where it is not above the slowest."""
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
    """Every pass with its initial position, rad: back and forth in turn, near the end of the last one."""
    forth = sorted((h for h in holds if h.velocity > 0), key=lambda h: abs(h.travel))
    back = sorted((h for h in holds if h.velocity < 0), key=lambda h: abs(h.travel))
    found, at, ahead, spare = [], _middle(limits), True, (1 - _USED) * limits.travel / 2
    low, high = limits.position[0] + spare, limits.position[1] - spare
    while forth or back:
        queue = (forth or back) if ahead else (back or forth)
        hold = queue.pop(0)
        at = min(max(at, low - min(hold.travel, 0.0)), high - max(hold.travel, 0.0))
        found.append((at, hold))
        at, ahead = at + hold.travel, not ahead
    return found


def move_within(start: float, stop: float, limits: Limits) -> Move:
    """A move from rest to rest within the limits."""
    way = abs(stop - start)
    fast = FASTEST * way / (_USED * limits.velocity)
    hard = (HARDEST * way / (_USED * limits.acceleration)) ** 0.5
    return Move(start, stop, max(SETTLE, fast, hard))


def slow_loads(plan: LoadingDesign) -> SlowLoads:
    """The loads of a direction, which rise and fall."""
    peak = -plan.peak if plan.direction is Direction.NEGATIVE else plan.peak
    return SlowLoads((peak,) * CYCLES, plan.rise, 0.2 * plan.rise, rest=_REST, pause=_REST)


def samples_of(part: Hold | Move | SlowLoads, step: float) -> float:
    """Number of samples of a part."""
    duration = part.duration - 1e-9 * step if isinstance(part, Hold) else part.duration
    return float(np.ceil(duration / step)) + 1


def played(part: Hold | Move | SlowLoads, step: float, start: float = 0.0, run: int = 0) -> PlannedRun:
    """A hold, a move, or loads as a run, sampled every step, s; `start`: initial position of a hold, rad."""
    time = np.arange(int(samples_of(part, step)), dtype=np.float64) * step
    if isinstance(part, Hold):
        return _driven("ramp", part.run, part.at(time, start))
    if isinstance(part, Move):
        return _driven("move", 0, part.at(time))
    lost = np.full(time.size, np.nan)
    return PlannedRun(kind="presliding", run=run, position=lost, velocity=lost, torque=part.at(time).torque)


def _driven(kind: Kind, run: int, by: Reference) -> PlannedRun:
    lost = np.full(by.position.size, np.nan)
    return PlannedRun(kind=kind, run=run, position=by.position, velocity=by.velocity, torque=lost)


def in_turn(velocities: Sequence[float], deflection: float, limits: Limits) -> Parts:
    """The runs at constant velocity, rad/s, in order, with moves between them. Raises InputError as `passes`."""
    holds = [hold for run, v in enumerate(velocities, 1) for hold in passes(v, run, deflection, limits)]
    parts: Parts = []
    position = _middle(limits)
    for begin, hold in ordered(holds, limits):
        if abs(begin - position) > 1e-9 * limits.travel:
            parts.append((move_within(position, begin, limits), position))
        parts.append((hold, begin))
        position = begin + hold.travel
    return parts


def duration(parts: Parts, loadings: Sequence[LoadingDesign], limits: Limits, motion: float) -> float:
    """Most time of all references, s, with a `motion` of this time, s. Raises InputError beyond `MOST` samples."""
    step = 1 / limits.rate
    move = move_within(limits.position[0], _middle(limits), limits)
    every = [*(part for part, _ in parts), *map(slow_loads, loadings), move]
    needed = sum(samples_of(part, step) for part in every) / limits.rate + motion + step
    if not needed * limits.rate <= MOST:
        raise InputError(
            f"a plan within these limits takes {needed:.3g} s, {needed * limits.rate:.3g} samples at {limits.rate:g} Hz; expected at most {MOST}: "
            "lower plan.rate, shorten plan.hold, raise plan.minimum_velocity or plan.acceleration, or narrow plan.position"
        )
    return float(needed)


def schedule(
    parts: Parts, loadings: Sequence[LoadingDesign], limits: Limits, motion: MotionDesign
) -> tuple[PlannedRun, ...]:
    """The whole plan in order, runs numbered from 1: constant velocities, slow loading, and the tracking motion."""
    step = 1 / limits.rate
    ramps = [played(part, step, begin) for part, begin in parts]
    runs = max(r.run for r in ramps)
    loads = [played(slow_loads(x), step, run=k) for k, x in enumerate(loadings, runs + 1)]
    move = played(move_within(float(ramps[-1].position[-1]), _middle(limits), limits), step)
    tracked = course(motion.lines, limits, motion.duration, step)
    return (*ramps, *loads, move, _driven("tracking", runs + len(loads) + 1, tracked))


def _middle(limits: Limits) -> float:
    return (limits.position[0] + limits.position[1]) / 2
