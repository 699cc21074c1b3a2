"""One control period of the closed loop, as expressions and as a function.

Inputs and outputs are named tuples; `flat` and `shaped` convert them to vectors.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, Literal, NamedTuple, TypeVar

import casadi as ca

from bristle.arrays import Array
from bristle.control import compensator as compensating
from bristle.control.compensator import Compensator, Measurement, Reference
from bristle.control.pid import AT_REST, Gains, Memory, pid
from bristle.control.plant import STILL, State, plant_step, quantise
from bristle.errors import InputError
from bristle.model import law, motor
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import Expression, Law
from bristle.model.parameters import Motor, Pair, fields_of, pair_of

T = TypeVar("T")
_CURRENT = {"torque": motor.current_for, "voltage": motor.current}  # by drive


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopOptions:
    """Structure of the loop. Raises InputError for structures that are not possible."""

    compensator: Compensator = field(default_factory=Compensator)
    drive: Literal["torque", "voltage"] = "torque"
    """Torque, or the voltage of the motor model, with back-EMF at the reference velocity."""
    delay: int = 0  # Control periods from the command to the drive
    encoder: bool = False  # Whether positions are counted
    informed: bool = False  # Whether the compensator's model drifts with the plant: the best possible adaptation
    law: Law = GAUSSIAN  # Of the plant; see `with_law_of`
    model_law: Law = GAUSSIAN  # Of the compensator

    def __post_init__(self) -> None:
        if self.delay < 0:
            raise InputError(f"loop: got delay {self.delay}; expected zero or more")
        if self.drive not in _CURRENT:
            raise InputError(f"loop: drive: got {self.drive!r}; expected {' or '.join(_CURRENT)}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """Numbers of one run."""

    plant: Pair[float]  # True friction
    motor: Motor[float]
    model: Pair[float]  # Friction in the compensator
    gains: Gains[float]
    torque_limit: float = float("inf")  # Of controller and compensator together, N*m
    resolution: float = 1.0  # One encoder count, rad


class Disturbance(NamedTuple):
    """Disturbances of a run, per control period: numbers, or arrays (n,) or (cases, n)."""

    load: Array | float = 0.0  # Torque along positive velocity, N*m
    drift_0: Array | float = 1.0  # Factor on the plant's alpha_0
    drift_2: Array | float = 1.0  # Factor on alpha_2
    noise: Array | float = 0.0  # Added to the measured position, rad


class Given(NamedTuple):
    """Inputs of a period."""

    reference: Reference
    disturbance: Disturbance


class Numbers(NamedTuple):
    """The numbers of a `Case`, and the period, s."""

    plant: Pair[Any]
    model: Pair[Any]
    motor: Motor[Any]
    gains: Gains[Any]
    torque_limit: Expression
    resolution: Expression
    period: Expression


class LoopMemory(NamedTuple):
    """State of the loop."""

    plant: State
    controller: Memory[Any]
    compensator: tuple[Expression, ...]  # As in `compensator.packed`
    asked: tuple[tuple[Expression, Expression], ...]
    """Torques, N*m, and voltages, V, on the way to the drive, oldest first."""


class Logged(NamedTuple):
    """Logs at the start of a period, as in `Trajectory`."""

    position: Expression
    velocity: Expression
    measured: Expression
    torque: Expression
    voltage: Expression
    friction: Expression
    compensation: Expression
    theta: tuple[Expression, ...]


class Period(NamedTuple):
    """A control period as expressions."""

    inputs: tuple[ca.SX, ca.SX, ca.SX]  # Memory, given, numbers
    before: LoopMemory
    after: LoopMemory
    log: Logged


UNDISTURBED = Given(Reference(0.0, 0.0, 0.0), Disturbance())  # at rest at zero, nothing acting


def no_friction(of: Law) -> Pair[float]:
    """A pair of zeros of this law."""
    return pair_of([0.0] * 2 * len(fields_of(of)), of)


def numbers_of(case: Case, period: float) -> Numbers:
    """A case as numbers, with a period, s."""
    limit = min(case.torque_limit, 1e300)
    return Numbers(case.plant, case.model, case.motor, case.gains, limit, case.resolution, period)


def at_rest(options: LoopOptions, position: float) -> LoopMemory:
    """The state at rest at a reference, rad."""
    state = compensating.initial_state(options.compensator, no_friction(options.model_law), position)
    return LoopMemory(
        STILL._replace(position=position), AT_REST, tuple(compensating.packed(state)), ((0.0, 0.0),) * options.delay
    )


def blank_log(options: LoopOptions) -> Logged:
    """An empty log."""
    return Logged(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, (0.0,) * compensating.adapted_count(options.compensator))


def with_law_of(options: LoopOptions, cases: Sequence[Case]) -> LoopOptions:
    """The options with the laws of some cases. Raises InputError where cases differ."""
    plants, models = {c.plant.law.name: c.plant.law for c in cases}, {c.model.law.name: c.model.law for c in cases}
    if max(len(plants), len(models)) > 1:
        raise InputError(
            f"loop: got cases of the friction laws {', '.join(plants | models)}; run those of each by themselves"
        )
    return replace(options, law=next(iter(plants.values())), model_law=next(iter(models.values())))


def period_of(options: LoopOptions, constants: Numbers | None = None) -> Period:
    """The control period; constants replace the numbers."""
    memory, before = symbols("memory", at_rest(options, 0.0))
    u, (r, outside) = symbols("u", UNDISTURBED)
    plant, model = no_friction(options.law), no_friction(options.model_law)
    q, case = symbols("q", Numbers(plant, model, Motor(*[0.0] * 4), Gains(*[0.0] * 4), 0.0, 0.0, 0.0))
    case = constants or case
    state, h, limit = before.plant, case.period, case.torque_limit
    drift = {"alpha_0": outside.drift_0, "alpha_2": outside.drift_2}
    friction = Pair(*(law.loaded(law.adapted(p, drift), r.level) for p in case.plant))
    model = Pair(*(law.adapted(p, drift) for p in case.model)) if options.informed else case.model
    seen = state.position + outside.noise
    seen = quantise(seen, case.resolution) if options.encoder else seen
    compensator = compensating.unpacked(before.compensator, model, compensating.adapted_count(options.compensator))
    new_compensator, T_c = compensating.step(options.compensator, compensator, r, Measurement(seen), h)
    T_own, control = pid(before.controller, r.position - seen, h, case.gains, limit)
    T = ca.fmin(ca.fmax(T_own + T_c + r.torque, -limit), limit)
    V = motor.voltage(T, r.velocity, case.motor)
    now, *later = (*before.asked, (T, V))
    sent = now[options.drive == "voltage"]
    new_state = plant_step(state, sent, outside.load, h, friction, case.motor, _CURRENT[options.drive])
    true = law.torque(state.deflection, state.velocity, law.active(state.deflection, state.velocity, friction))
    return Period(
        inputs=(memory, u, q), before=before,
        after=LoopMemory(new_state, control, tuple(compensating.packed(new_compensator)), tuple(later)),
        log=Logged(state.position, state.velocity, seen, T, V, true, T_c, new_compensator.learnt.theta),
    )  # fmt: skip  # a list of values


@lru_cache(maxsize=32)
def control_period(options: LoopOptions, constants: Numbers | None = None) -> ca.Function:
    """(memory, given, numbers) -> (memory, log); constants replace the numbers."""
    now = period_of(options, constants)
    outputs = [ca.vertcat(*flat(now.after)), ca.vertcat(*flat(now.log))]
    return ca.Function("control_period", [*now.inputs], outputs, {"cse": True})


def flat(value: Any) -> list[Any]:
    """Numbers of nested tuples, in order."""
    return [x for part in value for x in flat(part)] if isinstance(value, tuple) else [value]


def shaped(like: T, values: Iterator[Any]) -> T:
    """The inverse of `flat`."""
    if not isinstance(like, tuple):
        value: T = next(values)
        return value
    parts = [shaped(part, values) for part in like]
    return type(like)(*parts) if hasattr(like, "_fields") else type(like)(parts)


def symbols(name: str, like: T) -> tuple[ca.SX, T]:
    """A CasADi vector, (n, 1), and its elements in the shape of nested tuples."""
    vector = ca.SX.sym(name, len(flat(like)))
    return vector, shaped(like, iter(ca.vertsplit(vector)))
