"""An exported joint played in MuJoCo: position and velocity imposed along sines, its friction beside what is held and what was identified."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from bristle.arrays import Array
from bristle.errors import one_line
from bristle.model.parameters import slides, unit
from bristle.page.wording import shortened
from bristle.questions.export.artefact import NotInstalled, Request
from bristle.questions.export.exported import FREQUENCY, ExportedJoint
from bristle.questions.export.loss import Friction, StatedMotion, all_motions, friction_of, rms_percent
from bristle.simulation.references import Sine

STEP = 0.002
"""Time step of the example and of `check`, s."""
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
