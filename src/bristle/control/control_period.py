"""One control period of the closed loop as expressions, and functions that step it exactly or by CVODES.

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
from bristle.control.pid import AT_REST, Gains, Memory, Sliding, pid, sliding
from bristle.control.plant import STILL, Current, State, inductive_step, plant_rates, plant_step, quantise
from bristle.errors import InputError
from bristle.model import law, motor
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import Expression, Law
from bristle.model.parameters import Motor, Pair, fields_of, pair_of

T = TypeVar("T")
_SOFT: Sliding[float] = Sliding(K=2.0, slope=15.0, layer=10.0, filter_time=0.0)
_KNOWN = {"drive": ("torque", "voltage"), "controller": ("pid", "sliding")}
_CURRENT: dict[str, Current] = {"torque": motor.current_for, "voltage": motor.current}


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopOptions:
    """Structure of the loop. Raises InputError for structures that are not possible."""

    compensator: Compensator = field(default_factory=Compensator)
    drive: Literal["torque", "voltage"] = "torque"
    """Torque, or the voltage of the motor model, with back-EMF at the reference velocity."""
    delay: int = 0  # Control periods from the command to the drive
    encoder: bool = False  # Whether positions are counted
    speedometer: bool = False  # Whether the compensator gets the true velocity
    substeps: int = 1  # Steps of the plant in a period
    controller: Literal["pid", "sliding"] = "pid"  # (21), or sliding mode
    inductance: bool = False  # Whether the current lags the voltage by L / R (1)
    informed: bool = False  # Whether the compensator's model drifts with the plant: the best possible adaptation
    law: Law = GAUSSIAN  # Of the plant; see `with_law_of`
    model_law: Law = GAUSSIAN  # Of the compensator

    def __post_init__(self) -> None:
        if self.delay < 0 or self.substeps < 1:
            raise InputError(
                f"loop: got delay {self.delay} and substeps {self.substeps}; expected zero or more, and one or more"
            )
        for what, known in _KNOWN.items():
            if getattr(self, what) not in known:
                raise InputError(f"loop: {what}: got {getattr(self, what)!r}; expected {' or '.join(known)}")
        if self.inductance and self.drive == "torque":
            raise InputError(
                "loop: inductance: got a drive of torque, whose current does not lag; choose drive voltage"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """Numbers of one run. Raises InputError where sliding mode has no boundary layer."""

    plant: Pair[float]  # True friction
    motor: Motor[float]
    model: Pair[float]  # Friction in the compensator
    gains: Gains[float]
    torque_limit: float = float("inf")  # Of controller and compensator together, N*m
    resolution: float = 1.0  # One encoder count, rad
    sliding: Sliding[float] = _SOFT
    """Of sliding mode; inside its layer the default is a PD controller with the paper's K_p and K_d."""

    def __post_init__(self) -> None:
        if not self.sliding.layer > 0:
            raise InputError(f"case: sliding: layer: got {self.sliding.layer:g}; expected a positive number")


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
    sliding: Sliding[Any]
    torque_limit: Expression
    resolution: Expression
    period: Expression


class LoopMemory(NamedTuple):
    """State of the loop."""

    plant: State
    current: tuple[Expression, ...]  # Of the armature, A, if it lags
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
    memory: LoopMemory
    numbers: Numbers
    friction: Pair[Any]  # Of the plant, drifted
    load: Expression
    sent: Expression  # To the drive: N*m or V
    kept: LoopMemory  # State after the period, with the plant's before
    log: Logged


UNDISTURBED = Given(Reference(0.0, 0.0, 0.0), Disturbance())  # at rest at zero, nothing acting


def no_friction(of: Law) -> Pair[float]:
    """A pair of zeros of this law."""
    return pair_of([0.0] * 2 * len(fields_of(of)), of)


def numbers_of(case: Case, period: float) -> Numbers:
    """A case as numbers, with a period, s."""
    limit = min(case.torque_limit, 1e300)
    return Numbers(case.plant, case.model, case.motor, case.gains, case.sliding, limit, case.resolution, period)


def at_rest(options: LoopOptions, position: float) -> LoopMemory:
    """The state at rest at a reference, rad."""
    state = compensating.initial_state(options.compensator, no_friction(options.model_law), position)
    current, compensator = (0.0,) if options.inductance else (), tuple(compensating.packed(state))
    return LoopMemory(STILL._replace(position=position), current, AT_REST, compensator, ((0.0, 0.0),) * options.delay)


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


def controlled(options: LoopOptions, constants: Numbers | None = None) -> Period:
    """The controller's part of a period."""
    memory, before = symbols("memory", at_rest(options, 0.0))
    u, (r, outside) = symbols("u", UNDISTURBED)
    plant, model = no_friction(options.law), no_friction(options.model_law)
    nothing = Numbers(plant, model, Motor(*[0.0] * 4), Gains(*[0.0] * 4), _SOFT, 0.0, 0.0, 0.0)
    q, case = symbols("q", nothing)
    case = constants or case
    state, h, limit = before.plant, case.period, case.torque_limit
    drift = {"alpha_0": outside.drift_0, "alpha_2": outside.drift_2}
    friction = Pair(*(law.loaded(law.adapted(p, drift), r.level) for p in case.plant))
    model = Pair(*(law.adapted(p, drift) for p in case.model)) if options.informed else case.model
    seen = state.position + outside.noise
    seen = quantise(seen, case.resolution) if options.encoder else seen
    measured = Measurement(seen, state.velocity if options.speedometer else None)
    compensator = compensating.unpacked(before.compensator, model, compensating.adapted_count(options.compensator))
    new_compensator, T_c = compensating.step(options.compensator, compensator, r, measured, h)
    if options.controller == "sliding":
        T_own, control = sliding(before.controller, r.position - seen, h, case.sliding)
    else:
        T_own, control = pid(before.controller, r.position - seen, h, case.gains, limit)
    T = ca.fmin(ca.fmax(T_own + T_c + r.torque, -limit), limit)
    V = motor.voltage(T, r.velocity, case.motor)
    now, *later = (*before.asked, (T, V))
    true = law.torque(state.deflection, state.velocity, law.active(state.deflection, state.velocity, friction))
    return Period(
        inputs=(memory, u, q), memory=before, numbers=case, friction=friction, load=outside.load, sent=now[options.drive == "voltage"],
        kept=LoopMemory(state, before.current, control, tuple(compensating.packed(new_compensator)), tuple(later)),
        log=Logged(state.position, state.velocity, seen, T, V, true, T_c, new_compensator.learnt.theta),
    )  # fmt: skip  # a list of values


def after(options: LoopOptions, now: Period, sent: Expression) -> LoopMemory:
    """State after the period, with this held at the drive."""
    state, current, case = now.memory.plant, now.memory.current, now.numbers
    h = case.period / options.substeps
    for _ in range(options.substeps):
        if options.inductance:
            state, i = inductive_step(state, current[0], sent, now.load, h, now.friction, case.motor)
            current = (i,)
        else:
            state = plant_step(state, sent, now.load, h, now.friction, case.motor, _CURRENT[options.drive])
    return now.kept._replace(plant=state, current=current)


@lru_cache(maxsize=32)
def control_period(options: LoopOptions, constants: Numbers | None = None) -> ca.Function:
    """(memory, given, numbers) -> (memory, log); constants replace the numbers."""
    now = controlled(options, constants)
    new = ca.vertcat(*flat(after(options, now, now.sent)))
    return ca.Function("control_period", [*now.inputs], [new, ca.vertcat(*flat(now.log))], {"cse": True})


@lru_cache(maxsize=8)
def stiff_control_period(options: LoopOptions) -> ca.Function:
    """The same with the plant by CVODES at tight tolerances."""
    now = controlled(options)
    kept = ca.vertcat(*flat(now.kept))
    state = ca.vertcat(*flat((now.memory.plant, now.memory.current)))
    x, (plant, current) = symbols("x", (now.memory.plant, now.memory.current))
    constants = (now.sent, now.load, now.friction, now.numbers.motor, now.numbers.period)
    held, (sent, load, friction, m, h) = symbols("held", constants)
    drawn = (lambda *_: current[0]) if current else _CURRENT[options.drive]
    lag = [motor.current_rate(current[0], sent, plant.velocity, m)] if current else []
    v = plant.velocity
    rates = ca.vertcat(v, plant_rates(v, plant.deflection, sent, load, friction, m, drawn), *lag)
    settings = {"abstol": 1e-10, "reltol": 1e-8, "max_num_steps": 1_000_000}
    solver = ca.integrator("stiff", "cvodes", {"x": x, "p": held, "ode": h * rates}, 0.0, 1.0, settings)
    log = ca.vertcat(*flat(now.log))
    controller = ca.Function("controller", [*now.inputs], [ca.vertcat(*flat(constants)), kept, log], {"cse": True})
    inputs = [ca.MX.sym(name, s.shape[0]) for name, s in zip("muq", now.inputs, strict=True)]
    given, new, logged = controller(*inputs)
    n = state.shape[0]
    moved = solver(x0=inputs[0][:n], p=given)["xf"]
    return ca.Function("stiff_control_period", inputs, [ca.vertcat(moved, new[n:]), logged])


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
