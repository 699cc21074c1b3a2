"""The compensated joint in closed loop: plant, sampled controller with compensator, drive and encoder, batched over cases; and what a run measured.

One control period: the encoder reads, PID and compensator ask for a torque, the drive gives it (or the voltage that the motor model makes of it), and
the plant goes on by exact steps of its frozen linear system. Numbers are inputs of one compiled function, so that cases with other parameters, gains
and encoders share it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, Literal, NamedTuple

import casadi as ca
import numpy as np

from bristle.control import compensator as compensating
from bristle.control.compensator import Compensator, Measurement, Reference
from bristle.control.loop import THREADS, Current, plant_rates, plant_step
from bristle.control.loop import State as Plant
from bristle.control.pid import AT_REST, Gains, Memory, pid
from bristle.data.sensor import quantise
from bristle.model import law, motor
from bristle.model.arrays import Array
from bristle.model.parameters import Motor, Pair, pair_of

Expression = Any
"""A float or a CasADi symbol: CasADi carries no types."""
_CHUNK = 1000
"""Samples of every case in one CasADi call: what bounds the memory."""
_INPUTS, _NUMBERS = 7, 35


@dataclass(frozen=True, slots=True, kw_only=True)
class Wiring:
    """What is connected to what; the numbers stand in `Case`. Raises ValueError where the delay or the steps of the plant are no counts."""

    compensator: Compensator = field(default_factory=Compensator)
    drive: Literal["torque", "voltage"] = "torque"
    """What the drive takes: the torque itself, or the voltage that the motor model makes of it, back-EMF at the reference velocity."""
    delay: int = 0
    """Control periods from the command to the drive."""
    encoder: bool = False
    """Whether positions are counted; else they are measured as they are."""
    speedometer: bool = False
    """Whether the compensator is given the true velocity; else it differentiates the position where it needs one."""
    substeps: int = 1
    """Steps of the plant in a control period."""

    def __post_init__(self) -> None:
        """Refuse what cannot work."""
        if self.delay < 0 or self.substeps < 1:
            raise ValueError(
                f"wiring: got delay {self.delay} and substeps {self.substeps}; expected zero or more, and one or more"
            )
        if self.drive not in {"torque", "voltage"}:
            raise ValueError(f"wiring: drive: got {self.drive!r}; expected torque or voltage")


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """The numbers of one run."""

    plant: Pair[float]
    """Friction as it is."""
    motor: Motor[float]
    model: Pair[float]
    """Friction as the compensator takes it."""
    gains: Gains[float]
    torque_limit: float = float("inf")
    """Largest torque asked for, controller and compensator together, N*m."""
    resolution: float = 1.0
    """One count, rad, where there is an encoder."""


class Course(NamedTuple):
    """What a run is given at every control period; arrays (n,), or (cases, n) where cases differ."""

    position: Array
    """Reference, rad."""
    velocity: Array
    """rad/s."""
    acceleration: Array
    """rad/s**2."""
    load: Array | float = 0.0
    """Disturbing torque, positive along positive velocity, N*m."""
    drift_0: Array | float = 1.0
    """The plant's alpha_0 over that of the case: friction that changes during the run."""
    drift_2: Array | float = 1.0
    """The same of alpha_2."""
    noise: Array | float = 0.0
    """Added to the measured position, rad."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trajectory:
    """What happened, at every control period; arrays of shape (cases, n)."""

    time: Array
    """s, (n,)."""
    reference: Array
    """rad, (n,) or (cases, n)."""
    position: Array
    """True, rad."""
    velocity: Array
    """True, rad/s."""
    torque: Array
    """Asked of the drive, N*m."""
    voltage: Array
    """V; nan where the drive takes a torque."""
    friction: Array
    """True, N*m."""
    compensation: Array
    """Torque of the compensator, N*m."""
    theta: Array
    """Gains of each adapted parameter, (cases, parameters, n)."""

    @property
    def error(self) -> Array:
        """Position error, measured from the reference: y_ref - y, rad."""
        return self.reference - self.position

    def rms_error(self, since: float = 0.0) -> Array:
        """Root mean square of the position error from a time on, rad, (cases,)."""
        return self._rms(self.error, since)

    def peak_error(self, since: float = 0.0) -> Array:
        """Largest position error from a time on, rad, (cases,)."""
        peak: Array = np.abs(self.error[:, self.time >= since]).max(axis=1)
        return peak

    def rms_torque(self, since: float = 0.0) -> Array:
        """Root mean square of the torque asked for, N*m, (cases,)."""
        return self._rms(self.torque, since)

    def chatter(self, since: float = 0.0) -> Array:
        """Total variation of the torque asked for, per second, N*m/s, (cases,)."""
        kept = self.time >= since
        varied: Array = np.abs(np.diff(self.torque[:, kept], axis=1)).sum(axis=1)
        return varied / float(np.ptp(self.time[kept]))

    def energy(self, since: float = 0.0) -> Array:
        """Work that the drive did at the joint, J, (cases,)."""
        kept = self.time >= since
        return np.asarray(np.trapezoid(self.torque[:, kept] * self.velocity[:, kept], self.time[kept], axis=1))

    def _rms(self, values: Array, since: float) -> Array:
        return np.asarray(np.sqrt(np.mean(values[:, self.time >= since] ** 2, axis=1)))


def simulate(
    wiring: Wiring, cases: Sequence[Case], course: Course, period: float, *, stiff: bool = False
) -> Trajectory:
    """Runs every case from rest at its first reference position.

    Args:
        wiring: shared by all.
        cases: one or more.
        course: what is given at every control period.
        period: s.
        stiff: whether CVODES solves the plant between samples: the reference to compare with, some hundred times slower.

    Raises ValueError where the period is not positive, the reference is not finite, or nothing is to be run.
    """
    n = course.position.shape[-1]
    if not cases or n < 2 or not period > 0:
        raise ValueError(
            f"got {len(cases)} cases, {n} samples and a period of {period:g} s; expected at least one, two, and a positive period"
        )
    given = np.stack([np.broadcast_to(np.asarray(x, dtype=float), (len(cases), n)) for x in course])
    if not np.isfinite(given).all():
        raise ValueError(
            "the reference, load, drift or noise of a run holds a value that is not finite; expected numbers throughout"
        )
    numbers = np.array([_numbers(case, period) for case in cases]).T
    memory: Any = np.array([_at_rest(wiring, float(y)) for y in given[0, :, 0]]).T
    rows = 6 + compensating.adapted_count(wiring.compensator)
    logs = np.empty((rows, len(cases), n))
    for first in range(0, n, _CHUNK):
        last = min(first + _CHUNK, n)
        inputs = given[:, :, first:last].reshape(_INPUTS, -1)
        memory, log = _run(wiring, last - first, len(cases), stiff=stiff)(memory, inputs, numbers)
        logs[:, :, first:last] = log.full().reshape(rows, len(cases), last - first)
    y, v, T, V, friction, own = logs[:6]
    return Trajectory(
        time=np.asarray(period * np.arange(n)), reference=course.position, position=y, velocity=v, torque=T,
        voltage=V if wiring.drive == "voltage" else np.full_like(V, np.nan), friction=friction, compensation=own,
        theta=np.moveaxis(logs[6:], 0, 1),
    )  # fmt: skip  # a list of values


def _numbers(case: Case, period: float) -> list[float]:
    limit = min(case.torque_limit, 1e300)
    return [
        *case.plant.positive,
        *case.plant.negative,
        *case.model.positive,
        *case.model.negative,
        *case.motor,
        *case.gains,
        limit,
        case.resolution,
        period,
    ]


def _at_rest(wiring: Wiring, position: float) -> list[float]:
    own = compensating.packed(compensating.start(wiring.compensator, pair_of([0.0] * 12), position))
    return [position, 0.0, 0.0, *AT_REST, *own, *[0.0] * (2 * wiring.delay)]


class _Period(NamedTuple):
    """A control period as expressions: what goes in, what the controller made of it, and what the plant is to do with that."""

    memory: Expression
    given: Expression
    numbers: Expression
    state: Plant
    friction: Pair[Any]
    motor: Motor[Any]
    load: Expression
    current: Current
    sent: Expression
    """To the drive: N*m or V."""
    h: Expression
    kept: Sequence[Expression]
    """The controller's memory."""
    log: Expression


def _controlled(wiring: Wiring) -> _Period:
    """The controller's part of a period."""
    memory = ca.SX.sym("memory", len(_at_rest(wiring, 0.0)))
    asked = memory.shape[0] - 2 * wiring.delay
    u, q = ca.SX.sym("u", _INPUTS), ca.SX.sym("q", _NUMBERS)
    parts, given, numbers = ca.vertsplit(memory), ca.vertsplit(u), ca.vertsplit(q)
    state, control, own = Plant(*parts[:3]), Memory(*parts[3:6]), parts[6:asked]
    r, (load, drift_0, drift_2, noise) = Reference(*given[:3]), given[3:]
    drift = {"alpha_0": drift_0, "alpha_2": drift_2}
    friction, model = Pair(*(law.adapted(p, drift) for p in pair_of(numbers[:12]))), pair_of(numbers[12:24])
    m, gains, (limit, resolution, h) = Motor(*numbers[24:28]), Gains(*numbers[28:32]), numbers[32:]
    seen = state.position + noise
    seen = quantise(seen, resolution) if wiring.encoder else seen
    measured = Measurement(seen, state.velocity if wiring.speedometer else None)
    before = compensating.unpacked(own, model, compensating.adapted_count(wiring.compensator))
    new_own, T_c = compensating.step(wiring.compensator, before, r, measured, h)
    T_pid, control = pid(control, r.position - seen, h, gains, limit)
    T = ca.fmin(ca.fmax(T_pid + T_c, -limit), limit)
    V = motor.voltage(T, r.velocity, m)
    line = [*parts[asked:], T, V]  # what was asked for, the oldest first
    true = law.torque(state.deflection, state.velocity, law.active(state.deflection, state.velocity, friction))
    return _Period(
        memory, u, q, state, friction, m, load, motor.current_for if wiring.drive == "torque" else motor.current,
        line[wiring.drive == "voltage"], h,
        kept=[*control, *compensating.packed(new_own), *line[2:]],
        log=ca.vertcat(state.position, state.velocity, T, V, true, T_c, *new_own.learnt.theta),
    )  # fmt: skip  # a list of values


@lru_cache(maxsize=32)
def _tick(wiring: Wiring) -> ca.Function:
    """One control period: (memory, what is given, numbers) -> (memory, log)."""
    now = _controlled(wiring)
    new = now.state
    for _ in range(wiring.substeps):
        new = plant_step(new, now.sent, now.load, now.h / wiring.substeps, now.friction, now.motor, now.current)
    return ca.Function(
        "tick", [now.memory, now.given, now.numbers], [ca.vertcat(*new, *now.kept), now.log], {"cse": True}
    )


@lru_cache(maxsize=8)
def _stiff_tick(wiring: Wiring) -> ca.Function:
    """The same, the plant by CVODES at tight tolerances: variable steps and orders, implicit, nothing of the fast step in it."""
    now = _controlled(wiring)
    x = ca.SX.sym("x", 3)
    _, v, z = ca.vertsplit(x)
    constants = ca.vertcat(now.sent, now.load, *now.friction.positive, *now.friction.negative, *now.motor, now.h)
    held = ca.SX.sym("held", constants.shape[0])
    sent, load, *q = ca.vertsplit(held)
    rates = ca.vertcat(v, plant_rates(v, z, sent, load, pair_of(q), Motor(*q[12:16]), now.current))
    options = {"abstol": 1e-10, "reltol": 1e-8, "max_num_steps": 1_000_000}
    solver = ca.integrator("stiff", "cvodes", {"x": x, "p": held, "ode": q[16] * rates}, 0.0, 1.0, options)
    controller = ca.Function(
        "controller", [now.memory, now.given, now.numbers], [constants, ca.vertcat(*now.kept), now.log], {"cse": True}
    )
    memory, u, numbers = (
        ca.MX.sym(name, s.shape[0]) for name, s in zip("muq", (now.memory, now.given, now.numbers), strict=True)
    )
    inputs, kept, log = controller(memory, u, numbers)
    new = solver(x0=memory[:3], p=inputs)["xf"]
    return ca.Function("stiff", [memory, u, numbers], [ca.vertcat(new, kept), log])


@lru_cache(maxsize=32)
def _run(wiring: Wiring, samples: int, cases: int, *, stiff: bool) -> ca.Function:
    tick = _stiff_tick(wiring) if stiff else _tick(wiring)
    memory, u, q = ca.MX.sym("memory", tick.size1_in(0)), ca.MX.sym("u", _INPUTS, samples), ca.MX.sym("q", _NUMBERS)
    ends, logs = tick.mapaccum(samples)(memory, u, ca.repmat(q, 1, samples))
    run = ca.Function("run", [memory, u, q], [ends[:, -1], logs])
    return run if cases == 1 else run.map(cases) if stiff else run.map(cases, "thread", THREADS)
