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
from bristle.model.parameters import Motor, Pair

Seed = int | Sequence[int]


class Plateau(NamedTuple):
    """A stretch of constant reference velocity, rad/s, after its run-in, from start to stop, s."""

    velocity: float
    start: float
    stop: float


class Ramps(NamedTuple):
    """A ramp experiment: each speed forward and then back, so that the joint ends where it began; the velocity is piecewise linear.

    A slow leg runs in from up to twice its speed, slowing all the way, so that only the plateau is constant.
    """

    speeds: tuple[float, ...]
    """rad/s, > 0."""
    plateau: float = 4.0
    """Time at each constant velocity, s."""
    run_in: float = 0.05
    """Least angle travelled before each plateau, rad: several bristle deflections, so that each plateau begins in steady state."""
    settle: float = 0.6
    """Least time before each plateau, s."""
    turn: float = 0.2
    """Time to reach a leg's first speed from rest, and to stop from its last, s."""
    rest: float = 0.5
    """Before the first leg and after the last, s."""

    @property
    def plateaus(self) -> tuple[Plateau, ...]:
        """Forward and back in turn."""
        times, velocities = self._corners()
        return tuple(map(Plateau, velocities[3::4], times[3::4], times[4::4]))

    @property
    def duration(self) -> float:
        """In s."""
        return self._corners()[0][-1] + self.rest

    def at(self, time: Array) -> Reference:
        """At evenly spaced instants; the position is the integral of the sampled velocity by the trapezoidal rule."""
        step, velocity = float(time[1]), np.interp(time, *self._corners())
        position = np.concatenate([[0.0], np.cumsum(velocity[1:] + velocity[:-1])]) * (step / 2)
        return Reference(position, velocity, np.gradient(velocity, step))

    def _corners(self) -> tuple[list[float], list[float]]:
        """Times, s, and velocities, rad/s, between which the velocity is linear: two at rest, then four of each leg."""
        times, velocities = [0.0, self.rest], [0.0, 0.0]
        for velocity in (sign * speed for speed in self.speeds for sign in (1, -1)):
            first = velocity * max(1.0, min(2.0, 0.15 / abs(velocity)))
            run_in = max(self.settle, 2 * self.run_in / abs(first + velocity))
            start = times[-1] + self.turn + run_in
            stop = start + self.plateau
            times += [start - run_in, start, stop, stop + self.turn]
            velocities += [first, velocity, velocity, 0.0]
        return times, velocities


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
