"""The embedded robot: a made-up six-axis arm with the friction of Table 1, scaled to it, moved by multisines and logged.

The motion is imposed: the torque is what Pinocchio's inverse dynamics ask for it, what the rotor's inertia takes, and
LuGre's friction along it. A drive's current is that over its torque constant, with noise; the position is counted.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from bristle.arrays import Array
from bristle.control.compensator import Reference
from bristle.control.plant import white_noise
from bristle.data.robot.motion import RigidBody, rigid_body
from bristle.data.robot.urdf import read_urdf
from bristle.model.parameters import Lugre, Pair
from bristle.model.rollout import rollout
from bristle.simulation.edro import TABLE_1
from bristle.simulation.references import Multisine

FOLDER = Path(__file__).resolve().parent  # of the arm's files
STIFFER = 4.0
"""Times which a bristle's stiffness is beside what the torques are: it deflects by 0.8 mrad, not 3 mrad, as gears of arms are stiffer."""


class ArmJoint(NamedTuple):
    """One joint of the arm; all but its friction's shape is assumed."""

    name: str
    """In the URDF."""
    source: str
    """Whose friction it has: a key of `TABLE_1`."""
    scale: float
    """Times which its torques are."""
    torque_constant: float
    """N*m/A, at the joint, gear included."""
    inertia: float
    """Of the rotor, seen at the joint, kg*m**2."""
    free: bool
    """Whether bristle has to find the torque constant."""
    home: float
    """About which it moves, rad."""
    travel: float
    """Largest distance from there, rad."""
    speed: float
    """Largest of the motion, rad/s."""
    lines: tuple[int, ...]
    """Periods of its sines in `PERIOD`, the first two alike in speed."""

    @property
    def friction(self) -> Pair[float]:
        """Its friction in both directions: the source's for larger torques and a stiffer gear, of five digits."""
        by = self.scale
        factors = (by, by, by, 1.0, STIFFER * by, by)
        sets = (zip(p, factors, strict=True) for p in TABLE_1[self.source])
        return Pair(*(Lugre(*(float(f"{x * factor:.5g}") for x, factor in own)) for own in sets))


JOINTS: tuple[ArmJoint, ...] = (
    ArmJoint("turret", "base rotation", 8.0, 9.8, 0.55, False, 0.0, 1.6, 1.8, (8, 9, 5, 15)),
    ArmJoint("shoulder", "base rotation", 12.0, 11.2, 0.62, True, 0.5, 0.9, 1.5, (9, 10, 6, 14)),
    ArmJoint("elbow", "elbow pitch", 14.0, 8.4, 0.30, True, 1.1, 1.1, 1.8, (7, 8, 3, 17)),
    ArmJoint("wrist_roll", "wrist pitch", 9.0, 6.1, 0.08, False, 0.0, 1.8, 2.4, (8, 9, 4, 19)),
    ArmJoint("wrist_pitch", "wrist pitch", 8.0, 6.1, 0.08, False, 0.4, 1.2, 2.4, (9, 10, 5, 23)),
    ArmJoint("flange", "gripper rotation", 20.0, 4.2, 0.04, False, 0.0, 2.2, 2.8, (10, 11, 4, 21)),
)
"""In the URDF's order, and that of the log's columns."""

PERIOD, HELD_OUT_PERIOD = 40.0, 16.0  # length of the logs, s
RATE, SUBSTEPS = 125.0, 8  # samples a second, and steps of the simulated friction in each
RESOLUTION = 2 * np.pi / 2**19  # rad per count at the joint
NOISE = 0.03  # of the current: standard deviation of a sample over that of the larger alpha_0
SHARES = (1.0, 0.8, 0.7, 0.35)  # of each line, in speed
CUTOFF, DECIMATION = 20.0, 6
"""How the runs are fitted: low pass of the positions, Hz, far above the motion's 0.6 Hz; and one equation in so many samples."""

ASSUMPTIONS: tuple[str, ...] = (
    "SIMULATED: no such arm exists; masses, lengths and limits of arm.urdf are made up.",
    f"Friction: LuGre with alpha_0, alpha_1, alpha_2 and sigma_1 of Table 1 times a factor for each joint, sigma_0 {STIFFER:g} times stiffer beside "
    "them, v_s as it is; two joints share base rotation, and two wrist pitch.",
    "Motion: imposed, four sines for each joint with random phases, faded in and out over half a second; no controller.",
    "Torque: inverse dynamics of the URDF, the rotor's inertia as seen at the joint, and friction; gears and links are rigid.",
    f"Current: torque over the torque constant, with white noise of {100 * NOISE:g} % of the larger alpha_0; no ripple, no delay.",
    f"Encoder: {RESOLUTION:.3g} rad per count at the joint, 19 bits a turn, ideal; position and current logged at {RATE:g} Hz.",
    "Temperature, load and position change nothing of the friction.",
)
"""What the embedded robot assumes, a sentence each."""


class ArmLog(NamedTuple):
    """What the arm's drives logged: s, (n,); rad and A, (n, joints)."""

    time: Array
    position: Array
    current: Array


def body() -> RigidBody:
    """The arm without friction. Raises InputError where Pinocchio is missing."""
    urdf = read_urdf(FOLDER / "arm.urdf")
    return rigid_body(urdf, [joint.name for joint in JOINTS], (0.0, 0.0, -9.81), None)


def simulate_arm(seed: int, *, held_out: bool = False) -> ArmLog:
    """One log of the whole arm; each seed has its own phases and noise, the held-out run its own lines as well.

    Raises InputError where Pinocchio is missing.
    """
    rng = np.random.default_rng((seed, int(held_out)))
    duration = HELD_OUT_PERIOD if held_out else PERIOD
    time = np.arange(round(duration * RATE) * SUBSTEPS + 1) / (RATE * SUBSTEPS)
    motions = [_motion(joint, rng, time, duration) for joint in JOINTS]
    moved = zip(JOINTS, motions, strict=True)
    rolled = [rollout(motion.velocity, 1 / (RATE * SUBSTEPS), joint.friction).torque for joint, motion in moved]
    friction = np.column_stack(rolled)[::SUBSTEPS]
    q, v, a = (np.column_stack([m[k] for m in motions])[::SUBSTEPS] for k in range(3))
    torque = body().torques(q, v, a) + np.array([joint.inertia for joint in JOINTS]) * a + friction
    current = torque / np.array([joint.torque_constant for joint in JOINTS])
    counted = np.round(q / RESOLUTION) * RESOLUTION
    return ArmLog(time[::SUBSTEPS], counted, current + white_noise(rng, 1.0, current.shape) * noises())


def noises() -> Array:
    """Standard deviation of each current's noise, A, (joints,)."""
    return np.array([NOISE * max(p.alpha_0 for p in joint.friction) / joint.torque_constant for joint in JOINTS])


def _motion(joint: ArmJoint, rng: np.random.Generator, time: Array, duration: float) -> Reference:
    """Sines of random phases about `home`, as wide and as fast as allowed; two neighbouring ones beat, so that slow parts come."""
    turns = np.array(joint.lines) + (1 if duration == HELD_OUT_PERIOD else 0)
    frequency = turns / PERIOD
    amplitude = np.array(SHARES) / (2 * np.pi * frequency)
    sines = Multisine(amplitude, frequency, rng.uniform(0, 2 * np.pi, turns.size))
    shape = sines.at(time, duration)  # fading over half a second
    factor = min(joint.travel / np.abs(shape.position).max(), joint.speed / np.abs(shape.velocity).max())
    return Reference(joint.home + factor * shape.position, factor * shape.velocity, factor * shape.acceleration)
