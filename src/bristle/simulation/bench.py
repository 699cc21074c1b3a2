"""The virtual test bench: the constant-velocity experiments of section 3.2, simulated.

A joint (motor and LuGre friction, one set per direction) follows ramps of its angle under a controller of the bench's own; an encoder counts, the
applied voltage is logged with noise, and a torque noise disturbs the plant. What comes out is what a user would log: time, position, voltage.
"""

from collections.abc import Sequence
from math import ceil
from typing import NamedTuple

import numpy as np
import pandas as pd

from bristle.arrays import Array
from bristle.control.pid import Gains
from bristle.control.plant import STILL, Clock, Log, Loop, simulate
from bristle.control.sensors import Sensors, white_noise
from bristle.model import functions
from bristle.model.parameters import Lugre, Motor, Pair, Stribeck
from bristle.model.vectorize import evaluate

Seed = int | Sequence[int]


class Plateau(NamedTuple):
    """A stretch of constant reference velocity, after its run-in."""

    velocity: float
    """rad/s."""
    start: float
    """s."""
    stop: float
    """s."""


class Reference(NamedTuple):
    """An angle to follow, at every control period."""

    time: Array
    """s."""
    position: Array
    """rad."""
    velocity: Array
    """rad/s."""
    plateaus: tuple[Plateau, ...]


class Ramps(NamedTuple):
    """The plan of a ramp experiment: each speed forth and then back, speed after speed, so that the joint ends where it began."""

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


class Loads(NamedTuple):
    """The plan of a presliding experiment, open loop: torque grows slowly to a peak below breakaway, falls faster, and so to the other side."""

    positive: float
    """Peak along positive torque, N*m, > 0."""
    negative: float
    """Peak along negative torque, N*m, > 0."""
    rise: float = 25.0
    """Time to each peak, s."""
    fall: float = 4.0
    """Time from it back to zero, s."""
    cycles: int = 1


class Rig(NamedTuple):
    """A joint on the bench, its controller and its sensors."""

    loop: Loop
    sensors: Sensors


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


def on_bench(
    pair: Pair[float], motor: Motor[float], sensors: Sensors, gains: Gains[float], clock: Clock, volts: float
) -> Rig:
    """A joint under PID control on the bench, with a drive of at most about `volts`."""
    return Rig(Loop(pair, motor, gains, volts * motor.k_t / motor.R, sensors.resolution, clock), sensors)


def ramp_reference(ramps: Ramps, clock: Clock) -> Reference:
    """Piecewise-linear velocity: rest, then for each speed a leg forth and a leg back, each with its run-in and its plateau, and rest.

    A slow leg runs in from up to twice its speed, slowing all the way, so that only the plateau is constant.
    """
    times, speeds, plateaus = [0.0, 0.5], [0.0, 0.0], []
    for speed in ramps.speeds:
        for velocity in (speed, -speed):
            first = velocity * max(1.0, min(2.0, 0.15 / speed))
            run_in = max(ramps.settle, 2 * ramps.run_in / abs(first + velocity))
            start = times[-1] + ramps.turn + run_in
            stop = start + ramps.plateau
            times += [start - run_in, start, stop, stop + ramps.turn]
            speeds += [first, velocity, velocity, 0.0]
            plateaus.append(Plateau(velocity, start, stop))
    periods = ceil((times[-1] + times[1]) / (clock.period * clock.decimation)) * clock.decimation
    time = np.arange(periods, dtype=np.float64) * clock.period
    sampled = np.interp(time, times, speeds)
    position = np.concatenate([[0.0], np.cumsum(sampled[1:] + sampled[:-1])]) * (clock.period / 2)
    return Reference(time, position, sampled, tuple(plateaus))


def multisine(
    lines: Sequence[tuple[float, float, float]], duration: float, clock: Clock, rest: float = 0.5
) -> Reference:
    """A sum of sines of the angle, (amplitude rad, frequency Hz, phase rad) each, faded in and out over `rest` seconds."""
    every = clock.decimation
    time = np.arange(ceil(duration / (clock.period * every)) * every, dtype=np.float64) * clock.period
    fade = np.clip(np.minimum(time, duration - time) / rest, 0.0, 1.0)
    fade = fade**3 * (10 - 15 * fade + 6 * fade**2)
    position = fade * sum(a * np.sin(2 * np.pi * f * time + phase) for a, f, phase in lines)
    return Reference(time, position, np.gradient(position, clock.period), ())


def follow_logs(joint: Rig, reference: Reference, seeds: Sequence[Seed]) -> Logs:
    """A motion followed under the joint's controller, once for each seed; the voltage is the mean of the two logged intervals about each sample.

    A voltage that is held until the next sample belongs half an interval later than the position: at 17 Hz and 500 Hz that is 0.1 rad of phase.
    """
    log, noise, time = _followed(joint, reference, seeds)
    before = np.concatenate([log.voltage[:, :1], log.voltage[:, :-1]], axis=1)
    return Logs(time, log.position, (before + log.voltage) / 2 + noise, ())


def _followed(joint: Rig, reference: Reference, seeds: Sequence[Seed]) -> tuple[Log, Array, Array]:
    load, noise, _ = _noises(joint, reference.time.size, seeds)
    log = simulate(joint.loop, reference.position, reference.velocity, load)
    return log, noise, reference.time[:: joint.loop.clock.decimation]


def load_logs(joint: Rig, loads: Loads, seeds: Sequence[Seed]) -> Logs:
    """The presliding experiment, once for each seed: the voltage follows the plan, open loop; the joint rests anywhere in a count."""
    clock = joint.loop.clock
    times, torques = [0.0, 1.0], [0.0, 0.0]
    for _ in range(loads.cycles):
        for peak in (loads.positive, -loads.negative):
            times += [times[-1] + loads.rise, times[-1] + loads.rise + loads.fall]
            torques += [peak, 0.0]
    periods = ceil((times[-1] + 1.0) / (clock.period * clock.decimation)) * clock.decimation
    time = np.arange(periods, dtype=np.float64) * clock.period
    load, noise, phase = _noises(joint, periods, seeds)
    still = np.zeros(periods)
    open_loop = joint.loop._replace(gains=Gains(0.0, 0.0, 0.0, 0.0))
    start = STILL._replace(position=phase * joint.sensors.resolution)
    log = simulate(open_loop, still, still, load, start, np.interp(time, times, torques))
    return Logs(time[:: clock.decimation], log.position, log.voltage + noise, ())


def _noises(joint: Rig, periods: int, seeds: Sequence[Seed]) -> tuple[Array, Array, Array]:
    """Disturbing torque, N*m, (seeds, periods); voltage noise, V, (seeds, samples); and where in a count the joint rests, in counts, (seeds,)."""
    rngs = [np.random.default_rng(seed) for seed in seeds]
    load = np.stack([white_noise(rng, joint.sensors.torque_noise, (periods,)) for rng in rngs])
    samples = periods // joint.loop.clock.decimation
    noise = np.stack([white_noise(rng, joint.sensors.voltage_noise, (samples,)) for rng in rngs])
    return load, noise, np.array([rng.uniform(-0.5, 0.5) for rng in rngs])


def ramp_logs(joint: Rig, ramps: Ramps, seeds: Sequence[Seed]) -> Logs:
    """The same ramp experiment, once for each seed; one seed gives the same numbers whatever the others are."""
    reference = ramp_reference(ramps, joint.loop.clock)
    log, noise, time = _followed(joint, reference, seeds)
    return Logs(time, log.position, log.voltage + noise, reference.plateaus)


def ramp_experiment(joint: Rig, ramps: Ramps, seed: Seed) -> pd.DataFrame:
    """One ramp experiment as a table of time (s), position (rad) and voltage (V)."""
    logs = ramp_logs(joint, ramps, [seed])
    return pd.DataFrame({"time": logs.time, "position": logs.position[0], "voltage": logs.voltage[0]})


def steady_points(
    p: Lugre[float] | Stribeck[float], velocities: Array, noise: float, rng: np.random.Generator, repetitions: int
) -> Array:
    """Steady torques (9) at planned velocities (rad/s), plus white noise (N*m): shape (repetitions, velocities), N*m, without simulating a loop."""
    (torque,) = evaluate(functions.steady_torque(), velocities, p.alpha_0, p.alpha_1, p.alpha_2, p.v_s)
    return torque + white_noise(rng, noise, (repetitions, velocities.size))
