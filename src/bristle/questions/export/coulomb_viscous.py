"""Coulomb and viscous friction, which is all that most simulators hold: the best values along a motion, what they lose, and where they are from."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from bristle.errors import InputError, one_line, short
from bristle.findings import Finding
from bristle.model.parameters import slides, unit
from bristle.page.wording import number
from bristle.questions.export.artefact import Request, large_losses, left_out
from bristle.questions.export.exported import ExportedJoint
from bristle.questions.export.loss import (
    Loss,
    StatedMotion,
    all_motions,
    best_coulomb_viscous,
    coulomb_viscous,
    losses,
)
from bristle.questions.export.notes import notes
from bristle.questions.export.xml_edit import XmlElement, joint_named

_TYPES = {False: ("revolute", "continuous"), True: ("prismatic",)}
"""Of a joint in a URDF or an SDF, by whether the exported one slides."""


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
    return tuple(_best(joint.in_newton(target), request) for joint in joints)


def _best(joint: ExportedJoint, request: Request) -> CoulombViscous:
    motions = all_motions(joint, request.amplitude, request.frequency)
    coulomb, viscous = best_coulomb_viscous(joint, motions[0])
    found = losses(joint, coulomb_viscous(coulomb, viscous), motions)
    return CoulombViscous(joint=joint, motion=motions[0], coulomb=coulomb, viscous=viscous, losses=found)


def losses_of(found: Sequence[CoulombViscous]) -> Mapping[str, tuple[Loss, ...]]:
    """Those of each joint, by its name."""
    return {one.joint.name: one.losses for one in found}


def said_of(found: Sequence[CoulombViscous], target: str) -> tuple[Finding, ...]:
    """What the target loses of each joint, and what it leaves out."""
    return (
        *large_losses(target, losses_of(found)),
        *(x for one in found for x in left_out(one.joint, target, counted=("quadratic",))),
    )


def comment_lines(one: CoulombViscous, holds: str) -> Iterator[str]:
    """What stands beside the values, a line each that can be shown in a terminal; a comment's own marks are not escaped."""
    yield f"bristle: {one_line(one.sentence)}"
    yield one_line(holds)
    yield from map(one_line, notes(one.joint, one.losses))


AXIS_HOLDS = (
    "Coulomb friction and damping, the same in both directions; no Stribeck peak, no presliding, and no rotor inertia."
)
"""What the `<dynamics>` of a URDF or an SDF has of a joint."""


def axis_note(one: CoulombViscous) -> str:
    """What stands beside `<dynamics>`; its first two words mark it as ours."""
    return "\n     ".join(comment_lines(one, AXIS_HOLDS))


def axis_values(one: CoulombViscous) -> dict[str, str]:
    """What `<dynamics>` has, every digit."""
    return {"damping": repr(one.viscous), "friction": repr(one.coulomb)}


def place_of(what: str, elements: Sequence[XmlElement], joint: ExportedJoint, remedy: str = "") -> XmlElement:
    """The one element of a file's joints that has the joint's name.

    Raises InputError where there is none, opening the list of its joints with a remedy, or two, or it does not move as the exported one.
    """
    found = joint_named(what, elements, joint.name, remedy)
    got, expected = found.attributes.get("type", ""), _TYPES[slides(joint.kind)]
    if got not in expected:
        raise InputError(
            f"{what}, line {found.line}: joint {short(joint.name)} is {short(got)}, and the identified one is {joint.kind}; "
            f"expected {' or '.join(expected)}"
        )
    return found
