"""The embedded default of Ed-Ro, as the virtual bench measures it on Table 1: what the paper does not give is assumed, and said in `ASSUMPTIONS`."""

from collections.abc import Sequence
from math import pi, sqrt
from typing import NamedTuple

import numpy as np

from bristle.control.pid import Gains
from bristle.control.plant import Sensors
from bristle.model.parameters import Motor
from bristle.simulation.edro import PID_GAINS, TABLE_1, inertia
from bristle.simulation.references import Multisine, SlowLoads
from virtual_bench import Clock, Logs, Ramps, Rig, logged, ramp_gains, ramp_logs

TORQUE_CONSTANT, RESISTANCE, DRIVE = 0.35, 2.1, 12.0
"""Assumed of every joint: k_t (N*m/A, at the joint), R (ohm), and the drive's largest voltage (V) at rest."""

PEAK = 0.85  # assumed: of each direction's true alpha_0 + alpha_1, where its slow loading turns

LINES: tuple[tuple[float, float, float], ...] = (
    (0.0, 0.23, 0.0), (8.0, 0.61, 0.3), (5.0, 1.7, 1.0), (1.2, 4.1, 2.0), (0.5, 7.3, 0.5), (0.15, 13.0, 2.2),
)  # fmt: skip  # a table
"""Assumed, moving runs: amplitude in largest bristle deflections of the joint, frequency (Hz) and phase (rad); the first line has `WIDE` rad."""

WIDE = 0.35  # assumed: amplitude of the slowest line, rad

HELD_OUT_LINES: tuple[tuple[float, float, float], ...] = (
    (0.0, 0.31, 1.0), (7.0, 0.83, 2.3), (4.0, 1.3, 0.1), (1.0, 3.3, 1.4), (0.4, 6.1, 2.9),
)  # fmt: skip  # a table
"""Assumed: the same of the held-out run, at other frequencies."""

CUTOFF, DECIMATION = 60.0, 5
"""How the moving runs are fitted: low pass of the position, Hz, and one equation in so many samples, so that 40 Hz are left."""

CLOCK = Clock(period=2e-3, decimation=5)  # assumed: control at 500 Hz, logged at 100 Hz

RESOLUTION = 2 * pi / 2**20
"""Assumed: rad per count at the joint, as of a 4096-line encoder, read in quadrature, on the motor behind a 64:1 gear."""

BANDWIDTH = 60.0  # assumed: of the bench's ramp controller, rad/s

NOISE, DISTURBANCE = 0.0055, 0.02
"""Assumed, relative to the larger alpha_0 of the joint: standard error of a plateau's mean torque from voltage noise; torque noise on the plant."""


class Setting(NamedTuple):
    """One joint of the embedded default."""

    name: str
    """A key of `TABLE_1`."""
    top_speed: float
    """Assumed: fastest plateau, rad/s; lower where the joint pitches."""


SETTINGS: dict[str, Setting] = {
    "gripper": Setting("gripper rotation", 1.2),
    "wrist": Setting("wrist pitch", 1.0),
    "elbow": Setting("elbow pitch", 1.0),
    "base": Setting("base rotation", 1.2),
}
"""File stem -> joint, in the order of Table 1."""


def _assumptions(controller: str, speeds: str) -> tuple[str, ...]:
    """What the bench assumes with this controller and these plateaus, a sentence each."""
    return (
        "SIMULATED: a motor and LuGre friction with the parameters of Table 1; no measurement of the robot is in these data.",
        f"Motor, every joint: torque constant {TORQUE_CONSTANT} N*m/A at the joint, resistance {RESISTANCE} ohm, no inductance; "
        "the paper gives none of them.",
        "Inertia: (15) inverted, J = (sigma_1 / 0.2)**2 / sigma_0, the mean of the two directions (the paper gives none).",
        f"Encoder: {RESOLUTION:.3g} rad per count at the joint, 20 bits a turn, ideal.",
        controller,
        f"Sampling: control at {1 / CLOCK.period:g} Hz; position and the mean voltage since, logged at {1 / (CLOCK.period * CLOCK.decimation):g} Hz.",
        f"Noise: white on the logged voltage, such that a 4 s plateau's mean torque has a standard error of {100 * NOISE:g} % of the larger alpha_0; "
        f"white torque noise on the plant, {100 * DISTURBANCE:g} % of it per control period.",
        speeds,
        f"Presliding: voltage along slow open-loop ramps to {PEAK:g} of the true alpha_0 + alpha_1 of each direction and back, twice, no torque "
        "noise: LuGre creeps under vibration, and the ramps' noise would halve the sigma_0 that is found.",
        "Moving runs: six sines of the angle of our choice, from a slow wide one to a few bristle deflections at 13 Hz, no torque noise; control and "
        "logging at 500 Hz, each voltage the mean of the two control periods about its sample, with half the ramps' noise.",
        "Gravity, cables, temperature and position-dependent friction are absent.",
    )


ASSUMPTIONS: tuple[str, ...] = _assumptions(
    f"Ramp controller: the bench's own PID at {BANDWIDTH:g} rad/s with velocity feed-forward; "
    "with the paper's, slow plateaus stick and slip.",
    "Speeds: 22 of our choice, the same back and forth, from a quarter of the smaller v_s to 1.0 rad/s (pitch) or 1.2 rad/s (rotation).",
)
"""What the embedded default assumes, a sentence each."""

PAPER_PID_SPEEDS: tuple[float, ...] = (0.4, 0.7, 1.0, 1.5, 3.0, 6.0, 10.0, 16.0)
"""Plateaus of the example under the paper's PID, in multiples of base rotation's v_s for negative velocity."""

PAPER_PID_ASSUMPTIONS: tuple[str, ...] = _assumptions(
    f"Controller: the paper's PID (21) with gains {PID_GAINS.K_p:g}, {PID_GAINS.K_i:g}, {PID_GAINS.K_d:g}, as if for radians and N*m.",
    f"Speeds: {', '.join(f'{k:g}' for k in PAPER_PID_SPEEDS)} times 0.062 rad/s, back and forth, eight seconds each.",
)
"""What that example assumes."""


def motor(name: str) -> Motor[float]:
    """The assumed motor of a joint of Table 1, seen at the joint."""
    return Motor(TORQUE_CONSTANT, RESISTANCE, 0.0, inertia(TABLE_1[name]))


def speeds(stem: str) -> tuple[float, ...]:
    """The plateaus of the embedded default, rad/s: dense through the Stribeck region of both directions, and fast ones for alpha_2."""
    name, top = SETTINGS[stem]
    slow, fast = sorted(p.v_s for p in TABLE_1[name])
    chosen = [*np.geomspace(slow / 4, 2 * fast, 12), 3 * fast, *np.linspace(0.45 * top, top, 9)]
    return tuple(sorted(round(float(v), 4) for v in chosen))


def ramps(stem: str) -> Ramps:
    """The plan of a joint's ramps; each plateau begins eight bristle deflections after its turn."""
    deflection = max((p.alpha_0 + p.alpha_1) / p.sigma_0 for p in TABLE_1[SETTINGS[stem].name])
    return Ramps(speeds(stem), run_in=8 * deflection)


def rig(stem: str, gains: Gains[float] | None = None) -> Rig:
    """A joint of the embedded default on the bench, under `gains`, or else under the bench's own controller."""
    name = SETTINGS[stem].name
    pair, m, plan = TABLE_1[name], motor(name), ramps(stem)
    level = max(p.alpha_0 for p in pair)
    per_sample = NOISE * level * sqrt(plan.plateau / (CLOCK.period * CLOCK.decimation))
    sensors = Sensors(RESOLUTION, per_sample * m.R / m.k_t, DISTURBANCE * level)
    return Rig(pair, m, gains or ramp_gains(m.J, BANDWIDTH), DRIVE * m.k_t / m.R, sensors, CLOCK)


def logs(stem: str, seeds: Sequence[int]) -> Logs:
    """What the bench logs of a joint, once for each seed; seed 0 is the embedded default. Joints have independent noise."""
    stream = list(SETTINGS).index(stem)
    return ramp_logs(rig(stem), ramps(stem), [(seed, stream) for seed in seeds])


def load_logs(stem: str, seeds: Sequence[int]) -> Logs:
    """What the bench logs of a joint in presliding, once for each seed."""
    positive, negative = (PEAK * (p.alpha_0 + p.alpha_1) for p in TABLE_1[SETTINGS[stem].name])
    loads = SlowLoads((positive, -negative) * 2, rise=16.0, fall=3.0)
    joint = _quiet(stem)._replace(gains=Gains(0.0, 0.0, 0.0, 0.0))  # open loop
    time = joint.clock.instants(loads.duration)
    return logged(joint, time, loads.at(time), _stream(seeds, stem, 1), anywhere=True)


def tracking_logs(stem: str, seeds: Sequence[int], *, held_out: bool = False, resolution: float = RESOLUTION) -> Logs:
    """What the bench logs of a joint following `LINES` for 14 s, or `HELD_OUT_LINES` for 6 s, once for each seed; `resolution` in rad per count."""
    pair = TABLE_1[SETTINGS[stem].name]
    deflection = max((p.alpha_0 + p.alpha_1) / p.sigma_0 for p in pair)
    lines = [(a * deflection or WIDE, f, phase) for a, f, phase in (HELD_OUT_LINES if held_out else LINES)]
    joint = _quiet(stem)  # control and logging at 500 Hz, with half the ramps' noise of a sample
    sensors = joint.sensors._replace(resolution=resolution, voltage_noise=0.5 * joint.sensors.voltage_noise)
    joint = joint._replace(clock=CLOCK._replace(decimation=1), sensors=sensors)
    duration = 6.0 if held_out else 14.0
    time = joint.clock.instants(duration)
    motion = Multisine(*np.array(lines).T).at(time, duration)
    # The controller knows positions alone: the velocity that it feeds forward is their central difference.
    motion = motion._replace(velocity=np.gradient(motion.position, joint.clock.period))
    return logged(joint, time, motion, _stream(seeds, stem, 2 + held_out), centred=True)


def _quiet(stem: str) -> Rig:
    """A joint on the bench without torque noise."""
    joint = rig(stem)
    return joint._replace(sensors=joint.sensors._replace(torque_noise=0.0))


def _stream(seeds: Sequence[int], stem: str, experiment: int) -> list[tuple[int, ...]]:
    """Seeds whose noise no other joint and no other experiment has."""
    return [(seed, list(SETTINGS).index(stem), experiment) for seed in seeds]


def paper_pid_logs(stem: str, multiples: Sequence[float], seed: int = 0) -> Logs:
    """The same bench under the paper's PID (21), at multiples of the negative direction's v_s: base rotation sticks and slips from 0.4 to 1.5.

    The fall of (9) in the Stribeck region is steeper there than K_d is high.
    """
    v_s = TABLE_1[SETTINGS[stem].name].negative.v_s
    plan = ramps(stem)._replace(speeds=tuple(k * v_s for k in multiples), plateau=8.0)
    return ramp_logs(rig(stem, PID_GAINS), plan, [(seed, len(SETTINGS))])
