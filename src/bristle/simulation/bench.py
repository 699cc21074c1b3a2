"""The virtual test bench: the constant-velocity experiments of section 3.2, simulated.

A joint (motor and LuGre friction, one set per direction) follows ramps of its angle under a controller of the bench's own; an encoder counts, the
applied voltage is logged with noise, and a torque noise disturbs the plant. What comes out is what a user would log: time, position, voltage.
"""

from collections.abc import Sequence
from math import ceil
from typing import NamedTuple

import numpy as np

from bristle.arrays import Array
from bristle.control.closed_loop import Trajectory, simulate
from bristle.control.compensator import Compensator, Reference
from bristle.control.control_period import Case, Disturbance, LoopOptions
from bristle.control.pid import Gains
from bristle.control.plant import Sensors, white_noise
from bristle.model import functions
from bristle.model.parameters import Lugre, Motor, Pair, Stribeck
from bristle.model.vectorize import evaluate
from bristle.simulation.references import Plateau, Ramps

Seed = int | Sequence[int]


class Clock(NamedTuple):
    """The times of a sampled loop."""

    period: float
    """Control period, s."""
    decimation: int
    """Control periods between logged samples."""

    def instants(self, duration: float) -> Array:
        """Every control period until the duration, s, has passed and a logged sample ends; (periods,)."""
        periods = ceil(duration / (self.period * self.decimation)) * self.decimation
        return np.arange(periods, dtype=np.float64) * self.period


class Rig(NamedTuple):
    """A joint on the bench, its controller and its sensors."""

    pair: Pair[float]
    motor: Motor[float]
    gains: Gains[float]
    torque_limit: float
    """Largest torque that the controller asks for, N*m."""
    sensors: Sensors
    clock: Clock


class Logs(NamedTuple):
    """What the bench logged: time, s, shape (samples,); encoder position, rad, and voltage, V, both of shape (seeds, samples)."""

    time: Array
    position: Array
    voltage: Array
    plateaus: tuple[Plateau, ...]


def ramp_gains(J: float, bandwidth: float) -> Gains[float]:
    """The bench's own controller, for an inertia J (kg*m**2): real poles at 1/3, 1/3 and 4/3 of `bandwidth` (rad/s) where there is no friction.

    Stiff enough when K_d = 2 J bandwidth well exceeds the steepest fall of (9), about 0.86 alpha_1 / v_s - alpha_2; else the joint sticks and slips.
    """
    return Gains(
        K_p=J * bandwidth**2, K_i=4 / 27 * J * bandwidth**3, K_d=2 * J * bandwidth, filter_time=0.2 / bandwidth
    )


def follow(rig: Rig, reference: Reference, load: Array) -> Trajectory:
    """What happens at every control period, once for each disturbing torque, N*m, (cases, periods)."""
    case = Case(
        plant=rig.pair, motor=rig.motor, model=rig.pair, gains=rig.gains, torque_limit=rig.torque_limit, resolution=rig.sensors.resolution
    )  # fmt: skip  # a list of values
    options = LoopOptions(compensator=Compensator(name="none"), drive="voltage", encoder=True)
    return simulate(options, [case] * len(load), reference, rig.clock.period, Disturbance(load=load), alike=True)


def ramp_logs(rig: Rig, ramps: Ramps, seeds: Sequence[Seed]) -> Logs:
    """The same ramp experiment, once for each seed; one seed gives the same numbers whatever the others are."""
    time = rig.clock.instants(ramps.duration)
    return logged(rig, time, ramps.at(time), seeds)._replace(plateaus=ramps.plateaus)


def logged(
    rig: Rig, time: Array, reference: Reference, seeds: Sequence[Seed], *, centred: bool = False, anywhere: bool = False
) -> Logs:
    """A reference followed once for each seed; the position where each sample begins, and the mean voltage over it, with noise.

    Sampled, the controller's ripple would alias into the voltage. `centred`: the mean of that and the one before, as a voltage that is held until
    the next sample belongs half an interval later than the position: at 17 Hz and 500 Hz that is 0.1 rad of phase. `anywhere`: the joint begins
    at rest anywhere in a count.
    """
    rngs, every, sensors = [np.random.default_rng(seed) for seed in seeds], rig.clock.decimation, rig.sensors
    if time.size % every:
        raise ValueError(f"got {time.size} control periods; expected a multiple of the decimation {every}")
    load = np.stack([white_noise(rng, sensors.torque_noise, (time.size,)) for rng in rngs])
    noise = np.stack([white_noise(rng, sensors.voltage_noise, (time.size // every,)) for rng in rngs])
    if anywhere:
        start = np.array([rng.uniform(-0.5, 0.5) for rng in rngs]) * sensors.resolution
        reference = reference._replace(position=reference.position + start[:, None])
    run = follow(rig, reference, load)
    voltage = run.voltage.reshape(*noise.shape, every).mean(axis=2)
    if centred:
        voltage = (np.concatenate([voltage[:, :1], voltage[:, :-1]], axis=1) + voltage) / 2
    return Logs(time[::every], np.asarray(run.measured)[:, ::every], voltage + noise, ())


def steady_points(
    p: Lugre[float] | Stribeck[float], velocities: Array, noise: float, rng: np.random.Generator, repetitions: int
) -> Array:
    """Steady torques (9) at planned velocities (rad/s), plus white noise (N*m): shape (repetitions, velocities), N*m, without simulating a loop."""
    curve = p.stribeck if isinstance(p, Lugre) else p
    (torque,) = evaluate(functions.steady_torque_function(p.law), velocities, *curve)
    return torque + white_noise(rng, noise, (repetitions, velocities.size))
