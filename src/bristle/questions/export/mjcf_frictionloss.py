"""MuJoCo without LuGre: `<joint frictionloss= damping= armature=>`, by itself or merged into a given MJCF.

Coulomb friction, N*m, and damping, N*m*s/rad, of any version of MuJoCo (N and N*s/m where the joint slides). MuJoCo's
dry friction is a soft constraint: near standstill it is steep and viscous, so that a joint creeps where it should stick.
"""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from bristle.arrays import Array
from bristle.questions.export.artefact import Artefact, ExportTarget, Request, slug, without_inertia
from bristle.questions.export.coulomb_viscous import CoulombViscous, best_values, comment_lines, losses_of, said_of
from bristle.questions.export.exported import ExportedJoint
from bristle.questions.export.loss import StatedMotion, coulomb_viscous
from bristle.questions.export.mjcf import (
    mjcf_armature,
    mjcf_example_body,
    mjcf_example_model,
    mjcf_joint,
    mjcf_joint_lines,
    mjcf_read,
)
from bristle.questions.export.mjcf_played import STEP, last_period, mjcf_compared, mjcf_model, mjcf_mujoco, step_times
from bristle.questions.export.xml_edit import as_read, comment
from bristle.simulation.references import Sine

NAME = "mujoco-frictionloss"
_HOLDS = "Coulomb friction and damping, the same in both directions, as <joint frictionloss damping>; no Stribeck peak and no presliding"


def write_frictionloss(joints: Sequence[ExportedJoint], request: Request) -> Artefact:
    """The best values along the motion that is asked for.

    Raises InputError where a joint's torque is a current, or the file that is merged into is no MJCF or lacks the joint.
    """
    found = best_values(joints, request, NAME)
    return Artefact(
        name=f"{slug(joints)}_frictionloss.xml",
        content=_example(found) if request.into is None else _merged(found, request),
        holds=_HOLDS,
        losses=losses_of(found),
        said=(*said_of(found, NAME), *without_inertia(joints)),
    )


def _attributes(one: CoulombViscous) -> dict[str, str]:
    return {
        **mjcf_armature(one.joint),
        "damping": f"{one.viscous!r} 0 0",
        "frictionloss": repr(one.coulomb),
        "springdamper": "0 0",
    }


def _note(one: CoulombViscous) -> str:
    return "\n".join((*comment_lines(one, _HOLDS), *mjcf_joint_lines(one.joint)))


def _example(found: Sequence[CoulombViscous]) -> bytes:
    bodies = [f"{comment(_note(one))}\n{mjcf_example_body(one.joint, _attributes(one))}" for one in found]
    return mjcf_example_model(bodies, STEP)


def _merged(found: Sequence[CoulombViscous], request: Request) -> bytes:
    document = mjcf_read(request)
    for one in found:
        joint = mjcf_joint(document, one.joint)
        document.set_attributes(joint, _attributes(one))
        document.annotate(joint, _note(one))
    return document.written()


def check_frictionloss(artefact: Artefact, joints: Sequence[ExportedJoint], request: Request) -> tuple[str, ...]:
    """Each joint along imposed motions: MuJoCo's inverse dynamics against what it holds, and against the joint."""
    mujoco = mjcf_mujoco((2, 1))
    found = best_values(joints, request, NAME)
    model, lines = mjcf_model(mujoco, artefact.content, None if request.into is None else _example(found))
    for one in found:
        held = coulomb_viscous(one.coulomb, one.viscous)
        lines += mjcf_compared(one.joint, request, held, partial(frictionloss_played, mujoco, model, one.joint))
    return tuple(lines)


def frictionloss_played(mujoco: Any, model: Any, joint: ExportedJoint, motion: StatedMotion) -> Array:
    """Friction torque of the last period, N*m, (n,): what inverse dynamics asks for to keep to the motion."""
    data, own = mujoco.MjData(model), model.joint(as_read(joint.name))
    q, v = own.qposadr[0], own.dofadr[0]
    at = Sine(motion.amplitude, motion.frequency).at(step_times(motion))
    torque = np.empty(at.velocity.size)
    for k, (position, velocity, acceleration) in enumerate(zip(*at[:3], strict=True)):
        data.qpos[:], data.qvel[:], data.qacc[:] = model.qpos0, 0.0, 0.0
        data.qpos[q] += position
        data.qvel[v], data.qacc[v] = velocity, acceleration
        mujoco.mj_inverse(model, data)
        torque[k] = -data.qfrc_constraint[v] + model.dof_damping[v] * velocity
    return last_period(torque)


TARGET = ExportTarget(fitted=True, write=write_frictionloss, check=check_frictionloss, merges=True)
