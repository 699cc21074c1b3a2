"""An exported joint played in MuJoCo: position and velocity imposed along sines, its friction beside what is held and what was identified."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np

from bristle.arrays import Array
from bristle.errors import one_line
from bristle.model.parameters import slides, unit
from bristle.page.wording import shortened
from bristle.questions.export.coulomb_viscous import best_values
from bristle.questions.export.export import Artefact, Request
from bristle.questions.export.exported import FREQUENCY, ExportedJoint
from bristle.questions.export.loss import Friction, StatedMotion, all_motions, coulomb_viscous, friction_of, rms_percent
from bristle.questions.export.mjcf import (
    FRICTIONLOSS_NAME,
    STEP,
    MjcfHeld,
    frictionloss_example,
    mjcf_actuators,
    mjcf_example,
    mjcf_held,
    own_actuator,
)
from bristle.simulation.references import Sine
from export_checks.common import NotInstalled, as_read

_IMPOSED = (1.0, 0.1, 0.02)
"""Amplitudes, rad; of a joint that slides, of the declared motion."""
_PERIODS = 3
"""That are played; the last one counts."""


def mjcf_mujoco(oldest: tuple[int, int]) -> Any:
    """The module. Raises NotInstalled where there is none, or it is too old."""
    try:
        import mujoco
    except ImportError as missing:
        raise NotInstalled("MuJoCo is not installed; install bristle[mujoco]") from missing
    if tuple(map(int, mujoco.__version__.split(".")[:2])) < oldest:
        raise NotInstalled(
            f"MuJoCo {mujoco.__version__} is older than {'.'.join(map(str, oldest))}; install bristle[mujoco]"
        )
    return mujoco


def mjcf_model(mujoco: Any, artefact: bytes, example: bytes | None) -> tuple[Any, list[str]]:
    """The artefact as MuJoCo compiles it, and lines; the example instead where the model that was merged into lacks its files.

    Contacts and limits are off, so that nothing but friction acts against an imposed motion.
    """
    lines: list[str] = []
    try:
        model = mujoco.MjModel.from_xml_string(artefact.decode("utf-8"))
    except ValueError as error:
        if example is None:
            raise
        lines.append(
            f"the merged model does not load from its text alone ({one_line(str(error), 200)}); its friction was run in an example"
        )
        model = mujoco.MjModel.from_xml_string(example.decode("utf-8"))
    bits = mujoco.mjtDisableBit
    model.opt.disableflags |= int(bits.mjDSBL_CONTACT) | int(bits.mjDSBL_LIMIT) | int(bits.mjDSBL_EQUALITY)
    model.opt.timestep, model.opt.integrator = STEP, int(mujoco.mjtIntegrator.mjINT_EULER)
    return model, lines


Played = Callable[[StatedMotion], Array]
"""(motion) -> friction torque, N*m, (n,), at each time step of the last period, as MuJoCo has it."""


def mjcf_compared(joint: ExportedJoint, request: Request, held: Friction, played: Played) -> Iterator[str]:
    """A line for each motion: how far MuJoCo is from the model that it holds, and from the joint."""
    q, name = unit("position", joint.kind), shortened(joint.name)
    for motion in _imposed(joint, request):
        torque = played(motion)
        own, lost = (rms_percent(torque, at_steps(friction, motion)) for friction in (held, friction_of(joint)))
        yield (
            f"{name}, {motion.amplitude:.3g} {q} at {motion.frequency:g} Hz imposed at {1000 * STEP:g} ms: torque RMS error "
            f"{own:.2g} % of the model held, {lost:.2g} % of the joint"
        )


def _imposed(joint: ExportedJoint, request: Request) -> list[StatedMotion]:
    """1, 0.1 and 0.02 rad, then the declared motion and the stated ones."""
    declared, *stated = all_motions(joint, request.amplitude, request.frequency)
    full = declared.amplitude if slides(joint.kind) else 1.0
    return [*(StatedMotion("imposed", full * share, FREQUENCY) for share in _IMPOSED), declared, *stated]


def step_times(motion: StatedMotion) -> Array:
    """The times at which `check` imposes a motion, s."""
    return np.asarray(STEP * np.arange(round(_PERIODS / (motion.frequency * STEP))), dtype=np.float64)


def at_steps(friction: Friction, motion: StatedMotion) -> Array:
    """A model's torque at MuJoCo's time steps over the last period, N*m, from ten samples in each."""
    time = np.asarray(np.arange(10 * step_times(motion).size) * (STEP / 10), dtype=np.float64)
    torque = friction(np.asarray(Sine(motion.amplitude, motion.frequency).at(time).velocity), STEP / 10)[::10]
    return last_period(torque)


def last_period(torque: Array) -> Array:
    """Of what `step_times` has."""
    return torque[-(torque.size // _PERIODS) :]


def check_mjcf(artefact: Artefact, joints: Sequence[ExportedJoint], request: Request) -> tuple[str, ...]:
    """Each joint along imposed motions: MuJoCo against what it holds, and against the joint."""
    mujoco = mjcf_mujoco((3, 7))
    found = [mjcf_held(joint, request) for joint in joints]
    example = mjcf_example(found, "\n".join(map(mjcf_actuators, found)))
    model, lines = mjcf_model(mujoco, artefact.content, None if request.into is None else example)
    for one in found:
        lines += mjcf_compared(one.joint, request, one.symmetric.friction, partial(_played, mujoco, model, one))
    return tuple(lines)


def _played(mujoco: Any, model: Any, held: MjcfHeld, motion: StatedMotion) -> Array:
    """Position and velocity are set before each step; the actuators then have the friction of that instant."""
    data, name = mujoco.MjData(model), held.joint.name
    joint = model.joint(as_read(name))
    own = [
        model.actuator(as_read(x)).id
        for x in (own_actuator(name), f"{own_actuator(name)} bias")[: 2 if held.symmetric.bias else 1]
    ]
    at = Sine(motion.amplitude, motion.frequency).at(step_times(motion))
    q, v = joint.qposadr[0], joint.dofadr[0]
    torque = np.empty(at.velocity.size)
    for k, (position, velocity) in enumerate(zip(at.position, at.velocity, strict=True)):
        data.qpos[:], data.qvel[:] = model.qpos0, 0.0
        data.qpos[q] += position
        data.qvel[v] = velocity
        mujoco.mj_step(model, data)
        torque[k] = -data.actuator_force[own].sum()
    torque += (model.actuator_damping[own[0]] + model.dof_damping[v]) * at.velocity
    return last_period(torque + model.dof_frictionloss[v] * np.sign(at.velocity))


def check_frictionloss(artefact: Artefact, joints: Sequence[ExportedJoint], request: Request) -> tuple[str, ...]:
    """Each joint along imposed motions: MuJoCo's inverse dynamics against what it holds, and against the joint."""
    mujoco = mjcf_mujoco((2, 1))
    found = best_values(joints, request, FRICTIONLOSS_NAME)
    model, lines = mjcf_model(mujoco, artefact.content, None if request.into is None else frictionloss_example(found))
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
