"""The whole plan as references in the order to play.

Constant velocities, loading where they end, and the motion about the middle.
"""

from collections.abc import Sequence

from bristle.identification.limits import Limits
from bristle.questions.experiment_design import references as reference
from bristle.questions.experiment_design.excitation import MotionDesign
from bristle.questions.experiment_design.loading import CYCLES, LoadingDesign
from bristle.questions.experiment_design.references import PlannedRun
from bristle.questions.experiment_design.start import Start
from bristle.questions.experiment_design.velocities import VelocityPlan, largest_deflection


def schedule(
    start: Start,
    limits: Limits,
    velocities: Sequence[VelocityPlan],
    loadings: Sequence[LoadingDesign],
    motion: MotionDesign,
) -> tuple[PlannedRun, ...]:
    """Every reference of a plan, runs numbered from 1. Raises InputError where the travel is too short for a hold."""
    ramps = _ramps(start, limits, velocities)
    runs, step = max(r.run for r in ramps), 1 / limits.rate
    loads = [reference.load_reference(x, k, CYCLES, step) for k, x in enumerate(loadings, runs + 1)]
    move = reference.move_reference(float(ramps[-1].position[-1]), _middle(limits), limits, step)
    last = reference.motion_reference(motion.lines, runs + len(loads) + 1, limits, motion.duration, step)
    return (*ramps, *loads, move, last)


def duration(
    start: Start,
    limits: Limits,
    velocities: Sequence[VelocityPlan],
    loadings: Sequence[LoadingDesign],
    motion: float,
) -> float:
    """What all of it takes at most, s, with a motion of so many seconds. Raises as `schedule` does."""
    step = 1 / limits.rate
    loads = [reference.load_reference(x, 0, CYCLES, step) for x in loadings]
    move = reference.move_reference(limits.position[0], _middle(limits), limits, step)
    played = [*_ramps(start, limits, velocities), *loads, move]
    return sum(r.position.size for r in played) / limits.rate + motion + step


def _ramps(start: Start, limits: Limits, velocities: Sequence[VelocityPlan]) -> list[PlannedRun]:
    """The runs at constant velocity in the order to play, with the moves between them."""
    deflection = largest_deflection(start)
    runs = enumerate((v for plan in velocities for v in plan.velocities), 1)
    holds = [hold for run, v in runs for hold in reference.passes(v, run, deflection, limits)]
    played: list[PlannedRun] = []
    position, step = _middle(limits), 1 / limits.rate
    for begin, hold in reference.ordered(holds, limits):
        if abs(begin - position) > 1e-9 * limits.travel:
            played.append(reference.move_reference(position, begin, limits, step))
        played.append(reference.hold_reference(hold, begin, step))
        position = begin + hold.travel
    return played


def _middle(limits: Limits) -> float:
    return (limits.position[0] + limits.position[1]) / 2
