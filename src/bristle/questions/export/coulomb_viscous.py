"""Coulomb and viscous friction, which is all that most simulators hold: the best values along a motion, what they lose, and where they are from."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from bristle.errors import one_line
from bristle.model.parameters import unit
from bristle.page.wording import number
from bristle.questions.export.artefact import Artefact, Request, artefact_of, notes
from bristle.questions.export.exported import ExportedJoint
from bristle.questions.export.loss import Loss, StatedMotion, all_motions, best_coulomb_viscous, coulomb_viscous, losses


@dataclass(frozen=True, slots=True, kw_only=True)
class CoulombViscous:
    """The best values for one joint along a motion."""

    joint: ExportedJoint
    motion: StatedMotion
    coulomb: float
    """N*m."""
    viscous: float
    """N*m*s/rad."""
    losses: tuple[Loss, ...]

    @property
    def sentence(self) -> str:
        """The values, and the motion for which they are the best."""
        kind, motion = self.joint.kind, self.motion
        return (
            f"Coulomb {number(self.coulomb)} {unit('torque', kind)}, viscous {number(self.viscous)} {unit('alpha_2', kind)}: "
            f"the least squared torque error along a sine of {number(motion.amplitude)} {unit('position', kind)} at {motion.frequency:g} Hz"
        )


def best_values(joints: Sequence[ExportedJoint], request: Request, target: str) -> tuple[CoulombViscous, ...]:
    """Of each joint, along the motion that is asked for. Raises InputError where a joint's torque is known as a current alone."""
    found = []
    for joint in (joint.in_newton(target) for joint in joints):
        motions = all_motions(joint, request.amplitude, request.frequency)
        coulomb, viscous = best_coulomb_viscous(joint, motions[0])
        lost = losses(joint, coulomb_viscous(coulomb, viscous), motions)
        found.append(CoulombViscous(joint=joint, motion=motions[0], coulomb=coulomb, viscous=viscous, losses=lost))
    return tuple(found)


def with_best_values(
    found: Sequence[CoulombViscous], target: str, ending: str, content: bytes, holds: str, *, armature: bool = False
) -> Artefact:
    """What a target takes of them, as `artefact_of`: v abs(v) is among what the values stand for."""
    joints, lost = [one.joint for one in found], {one.joint.name: one.losses for one in found}
    return artefact_of(joints, target, ending, content, holds, lost, counted=("quadratic",), armature=armature)


def comment_lines(one: CoulombViscous, holds: str) -> Iterator[str]:
    """What stands beside the values, a line each that can be shown in a terminal; a comment's own marks are not escaped."""
    yield f"bristle: {one_line(one.sentence)}"
    yield one_line(holds)
    yield from map(one_line, notes(one.joint, one.losses))
