"""The whole plan as references in the order to play: constant velocities, loading where they end, and the motion about the middle."""

from collections.abc import Sequence

from bristle.errors import InputError
from bristle.identification.limits import Limits
from bristle.questions.experiment_design import references as reference
from bristle.questions.experiment_design.excitation import MotionDesign, course
from bristle.questions.experiment_design.loading import LoadingDesign
from bristle.questions.experiment_design.references import PlannedRun
from bristle.questions.experiment_design.start import Start
from bristle.questions.experiment_design.velocities import VelocityPlan, largest_deflection
from bristle.simulation.references import Hold, Move

MOST = 2_000_000
"""Samples of all references at the most: five hours at the usual rate."""


def schedule(
    start: Start,
    limits: Limits,
    velocities: Sequence[VelocityPlan],
    loadings: Sequence[LoadingDesign],
    motion: MotionDesign,
) -> tuple[PlannedRun, ...]:
    """Every reference of a plan, runs numbered from 1. Raises InputError where the travel is too short for a hold."""
    step = 1 / limits.rate
    ramps = [reference.played(part, step, run, begin) for part, run, begin in _parts(start, limits, velocities)]
    runs = max(r.run for r in ramps)
    loads = [reference.played(reference.slow_loads(x), step, k) for k, x in enumerate(loadings, runs + 1)]
    last_place = float(ramps[-1].position[-1])
    move = reference.played(reference.move_within(last_place, _middle(limits), limits), step)
    tracked = course(motion.lines, limits, motion.duration, step)
    return (*ramps, *loads, move, reference.driven("tracking", runs + len(loads) + 1, tracked))


def duration(
    start: Start,
    limits: Limits,
    velocities: Sequence[VelocityPlan],
    loadings: Sequence[LoadingDesign],
    motion: float,
) -> float:
    """What all of it takes at most, s, with a motion of so many seconds.

    Raises InputError as `schedule` does, and where it has more samples than a file may have.
    """
    step = 1 / limits.rate
    move = reference.move_within(limits.position[0], _middle(limits), limits)
    parts = [*(part for part, _, _ in _parts(start, limits, velocities)), *map(reference.slow_loads, loadings), move]
    needed = sum(reference.samples_of(part, step) for part in parts) / limits.rate + motion + step
    if not needed * limits.rate <= MOST:
        raise InputError(
            f"a plan within these limits takes {needed:.3g} s, {needed * limits.rate:.3g} samples at {limits.rate:g} Hz; expected at most {MOST}: "
            "lower plan.rate, shorten plan.hold, raise plan.minimum_velocity or plan.acceleration, or narrow plan.position"
        )
    return float(needed)


def _parts(start: Start, limits: Limits, velocities: Sequence[VelocityPlan]) -> list[tuple[Hold | Move, int, float]]:
    """The runs at constant velocity in the order to play, each with its number and where it begins (rad), and the moves between them."""
    deflection = largest_deflection(start)
    runs = enumerate((v for plan in velocities for v in plan.velocities), 1)
    holds = [hold for run, v in runs for hold in reference.passes(v, run, deflection, limits)]
    parts: list[tuple[Hold | Move, int, float]] = []
    position = _middle(limits)
    for begin, hold in reference.ordered(holds, limits):
        if abs(begin - position) > 1e-9 * limits.travel:
            parts.append((reference.move_within(position, begin, limits), 0, position))
        parts.append((hold, hold.run, begin))
        position = begin + hold.travel
    return parts


def _middle(limits: Limits) -> float:
    return (limits.position[0] + limits.position[1]) / 2
