"""MuJoCo without LuGre: `<joint frictionloss= damping= armature=>`, by itself or merged into a given MJCF.

Coulomb friction, N*m, and damping, N*m*s/rad, of any version of MuJoCo (N and N*s/m where the joint slides). MuJoCo's
dry friction is a soft constraint: near standstill it is steep and viscous, so that a joint creeps where it should stick.
"""

from collections.abc import Sequence
from dataclasses import replace

from bristle.questions.export.artefact import Artefact, ExportTarget, Request, without_inertia
from bristle.questions.export.coulomb_viscous import CoulombViscous, artefact_of, best_values, comment_lines
from bristle.questions.export.exported import ExportedJoint
from bristle.questions.export.mjcf import (
    STEP,
    mjcf_attributes,
    mjcf_example_body,
    mjcf_example_model,
    mjcf_joint,
    mjcf_joint_lines,
    mjcf_read,
)
from bristle.questions.export.xml_edit import comment

NAME = "mujoco-frictionloss"
_HOLDS = "Coulomb friction and damping, the same in both directions, as <joint frictionloss damping>; no Stribeck peak and no presliding"


def write_frictionloss(joints: Sequence[ExportedJoint], request: Request) -> Artefact:
    """The best values along the motion that is asked for.

    Raises InputError where a joint's torque is a current, or the file that is merged into is no MJCF or lacks the joint.
    """
    found = best_values(joints, request, NAME)
    if request.into is None:
        content = frictionloss_example(found)
    else:
        document = mjcf_read(request)
        for one in found:
            joint = mjcf_joint(document, one.joint)
            document.set_attributes(joint, _attributes(one))
            document.annotate(joint, _note(one))
        content = document.written()
    artefact = artefact_of(found, NAME, "_frictionloss.xml", content, _HOLDS)
    return replace(artefact, said=(*artefact.said, *without_inertia(joints)))


def _attributes(one: CoulombViscous) -> dict[str, str]:
    return mjcf_attributes(one.joint, damping=f"{one.viscous!r} 0 0", frictionloss=repr(one.coulomb))


def _note(one: CoulombViscous) -> str:
    return "\n".join((*comment_lines(one, _HOLDS), *mjcf_joint_lines(one.joint)))


def frictionloss_example(found: Sequence[CoulombViscous]) -> bytes:
    """A whole small model with each joint."""
    bodies = [f"{comment(_note(one))}\n{mjcf_example_body(one.joint, _attributes(one))}" for one in found]
    return mjcf_example_model(bodies, STEP)


TARGET = ExportTarget(fitted=True, write=write_frictionloss, merges=True)
