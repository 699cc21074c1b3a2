"""Targets with Coulomb and viscous friction only: the best values along a motion, and Isaac Lab's actuators of them.

From Isaac Sim 5.0 on PhysX takes static and dynamic friction as efforts and viscous friction as effort by velocity
(docstrings of isaaclab.actuators.ActuatorBaseCfg and of PhysX's PxJointFrictionParams).
"""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from bristle.errors import one_line
from bristle.model.parameters import unit
from bristle.page.wording import number
from bristle.questions.export.export import Artefact, ExportTarget, Request, artefact_of, in_ascii, notes
from bristle.questions.export.exported import ExportedJoint
from bristle.questions.export.loss import Loss, StatedMotion, all_motions, best_coulomb_viscous, coulomb_viscous, losses
from bristle.questions.export.xml_edit import XmlDocument, model_read


@dataclass(frozen=True, slots=True, kw_only=True)
class CoulombViscous:
    """The best values for one joint along a motion, N*m and N*m*s/rad."""

    joint: ExportedJoint
    motion: StatedMotion
    coulomb: float
    viscous: float
    losses: tuple[Loss, ...]


def best_values(joints: Sequence[ExportedJoint], request: Request, target: str) -> tuple[CoulombViscous, ...]:
    """The best values of each joint along the requested motion. Raises InputError as `in_newton`."""
    found = []
    for joint in (joint.in_newton(target) for joint in joints):
        motions = all_motions(joint, request.amplitude, request.frequency)
        coulomb, viscous = best_coulomb_viscous(joint, motions[0])
        lost = losses(joint, coulomb_viscous(coulomb, viscous), motions)
        found.append(CoulombViscous(joint=joint, motion=motions[0], coulomb=coulomb, viscous=viscous, losses=lost))
    return tuple(found)


def target_of(
    name: str,
    ending: str,
    holds: str,
    new: Callable[[Sequence[CoulombViscous]], bytes],
    merge: Callable[[XmlDocument, CoulombViscous], None] | None = None,
    model: tuple[str, str] = ("", ""),
    *,
    armature: bool = False,
) -> ExportTarget:
    """A target with the best values, which include v abs(v); other arguments as of `artefact_of`.

    `new` makes a file of them; `merge` puts those of a joint into a `model`, of this kind and root element.
    """

    def write(joints: Sequence[ExportedJoint], request: Request) -> Artefact:
        found = best_values(joints, request, name)
        if request.into is None or merge is None:
            content = new(found)
        else:
            document = model_read(request.into, request.into_name, *model)
            for one in found:
                merge(document, one)
            content = document.written()
        lost = {one.joint.name: one.losses for one in found}
        return artefact_of(joints, name, ending, content, holds, lost, counted=("quadratic",), armature=armature)

    return ExportTarget(write=write, fitted=True, merges=merge is not None)


def comment_lines(one: CoulombViscous, holds: str) -> Iterator[str]:
    """Lines of the comment beside the values."""
    kind, motion = one.joint.kind, one.motion
    yield (
        f"bristle: Coulomb {number(one.coulomb)} {unit('torque', kind)}, viscous {number(one.viscous)} {unit('alpha_2', kind)}: the least "
        f"squared torque error along a sine of {number(motion.amplitude)} {unit('position', kind)} at {motion.frequency:g} Hz"
    )
    yield one_line(holds)
    yield from map(one_line, notes(one.joint, one.losses))


_ISAAC_HOLDS = "static, dynamic and viscous friction, the same in both directions, and armature; no Stribeck velocity and no presliding."
_ISAAC_HEAD = """\
# Actuators of Isaac Lab with identified friction: put them into `actuators` of your ArticulationCfg.
#
# For Isaac Sim 5.0 and later, where friction and dynamic_friction are efforts and viscous_friction is effort by velocity.
# In Isaac Sim 4.5 friction is a coefficient of the transmitted load, and the other two are not applied: do not use it there.
# PhysX holds a joint at rest up to `friction`; a Newton backend takes it as the friction of a moving joint: give it dynamic_friction.
# stiffness and damping None: as the asset has them. A joint is in one group alone: take its name out of the others.
# joint_names_expr is a regular expression of the name as it was identified; USD names have letters, digits and _ only.
"""


def static_effort(one: CoulombViscous) -> float:
    """Static effort, N*m: alpha_0 + alpha_1, mean of both directions, and at least the dynamic one, as PhysX asks."""
    return max(sum(p.alpha_0 + p.alpha_1 for p in one.joint.curves) / 2, one.coulomb)


def _isaac_snippet(found: Sequence[CoulombViscous]) -> bytes:
    parts = [f"{_ISAAC_HEAD}\nfrom isaaclab.actuators import ImplicitActuatorCfg\n\nACTUATORS = {{\n"]
    for one in found:
        kind, name, J = one.joint.kind, one.joint.name, one.joint.rotor_inertia
        lines = "".join(f"    # {in_ascii(line)}\n" for line in comment_lines(one, _ISAAC_HOLDS))
        of_armature = "all that the joint accelerates: take off what the asset's links have of it"
        if J is None:
            of_armature = "no inertia is known: as the asset has it"
        elif one.joint.inertia != J:
            of_armature = "of the rotor, as identified beside the links"
        parts.append(f"""\
{lines}    {name!a}: ImplicitActuatorCfg(
        joint_names_expr=[{re.escape(name)!a}],
        stiffness=None,
        damping=None,
        friction={static_effort(one)!r},  # {unit("torque", kind)}, at rest: alpha_0 + alpha_1, the mean of both directions
        dynamic_friction={one.coulomb!r},  # {unit("torque", kind)}
        viscous_friction={one.viscous!r},  # {unit("alpha_2", kind)}
        armature={J!r},  # {unit("inertia", kind)}; {of_armature}
    ),
""")
    return "".join((*parts, "}\n")).encode("ascii")


ISAAC = target_of("isaac", "_actuators.py", _ISAAC_HOLDS, _isaac_snippet, armature=True)
