"""One control period of the closed loop as expressions, and the functions that step it: exactly, or with CVODES between samples."""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import casadi as ca

from bristle.control import compensator as compensating
from bristle.control.compensator import Measurement, Reference
from bristle.control.pid import AT_REST, Gains, Memory, Sliding, pid, sliding
from bristle.control.plant import Current, inductive_step, plant_rates, plant_step
from bristle.control.plant import State as Plant
from bristle.control.sensors import quantise
from bristle.control.wiring import Case, Wiring
from bristle.model import law, motor
from bristle.model.parameters import Motor, Pair, pair_of

Expression = Any
"""A float or a CasADi symbol: CasADi carries no types."""
INPUTS, NUMBERS = 7, 39
"""What a period is given: a sample of each of the `Course`, and the numbers of a case."""

_CURRENT: dict[str, Current] = {"torque": motor.current_for, "voltage": motor.current}


def numbers_of(case: Case, period: float) -> list[float]:
    """A case as the numbers that a period takes."""
    limit = min(case.torque_limit, 1e300)
    return [
        *case.plant.positive,
        *case.plant.negative,
        *case.model.positive,
        *case.model.negative,
        *case.motor,
        *case.gains,
        *case.sliding,
        limit,
        case.resolution,
        period,
    ]


def at_rest(wiring: Wiring, position: float) -> list[float]:
    """What the loop remembers at rest at its reference, rad: plant, controller, compensator, and what it asked of the drive."""
    control = AT_REST if wiring.derivative == "error" else AT_REST._replace(error=-position)
    own = compensating.packed(compensating.start(wiring.compensator, pair_of([0.0] * 12), position))
    return [position, *[0.0] * (plant_size(wiring) - 1), *control, *own, *[0.0] * (2 * wiring.delay)]


def plant_size(wiring: Wiring) -> int:
    """Numbers of the plant's state: position, velocity, deflection and, where it lags, the current."""
    return 3 + wiring.inductance


class Period(NamedTuple):
    """A control period as expressions: what goes in, what the controller made of it, and what the plant is to do with that."""

    memory: Expression
    given: Expression
    numbers: Expression
    plant: Sequence[Expression]
    friction: Pair[Any]
    motor: Motor[Any]
    load: Expression
    sent: Expression
    """To the drive: N*m or V."""
    h: Expression
    kept: Sequence[Expression]
    """The controller's memory."""
    log: Expression


def controlled(wiring: Wiring) -> Period:
    """The controller's part of a period."""
    memory = ca.SX.sym("memory", len(at_rest(wiring, 0.0)))
    asked = memory.shape[0] - 2 * wiring.delay
    u, q = ca.SX.sym("u", INPUTS), ca.SX.sym("q", NUMBERS)
    parts, given, numbers = ca.vertsplit(memory), ca.vertsplit(u), ca.vertsplit(q)
    n = plant_size(wiring)
    state, control, own = Plant(*parts[:3]), Memory(*parts[n : n + 3]), parts[n + 3 : asked]
    r, (load, drift_0, drift_2, noise) = Reference(*given[:3]), given[3:]
    drift = {"alpha_0": drift_0, "alpha_2": drift_2}
    friction, model = Pair(*(law.adapted(p, drift) for p in pair_of(numbers[:12]))), pair_of(numbers[12:24])
    model = Pair(*(law.adapted(p, drift) for p in model)) if wiring.informed else model
    m, gains, (limit, resolution, h) = Motor(*numbers[24:28]), Gains(*numbers[28:32]), numbers[36:]
    seen = state.position + noise
    seen = quantise(seen, resolution) if wiring.encoder else seen
    measured = Measurement(seen, state.velocity if wiring.speedometer else None)
    before = compensating.unpacked(own, model, compensating.adapted_count(wiring.compensator))
    new_own, T_c = compensating.step(wiring.compensator, before, r, measured, h)
    if wiring.controller == "sliding":
        T_own, control = sliding(control, r.position - seen, h, Sliding(*numbers[32:36]))
    else:
        of = -seen if wiring.derivative == "measurement" else None
        T_own, control = pid(control, r.position - seen, h, gains, limit, of)
    T = ca.fmin(ca.fmax(T_own + T_c, -limit), limit)
    V = motor.voltage(T, r.velocity if wiring.back_emf else 0.0, m)
    line = [*parts[asked:], T, V]  # what was asked for, the oldest first
    true = law.torque(state.deflection, state.velocity, law.active(state.deflection, state.velocity, friction))
    return Period(
        memory, u, q, parts[:n], friction, m, load, line[wiring.drive == "voltage"], h,
        kept=[*control, *compensating.packed(new_own), *line[2:]],
        log=ca.vertcat(state.position, state.velocity, T, V, true, T_c, *new_own.learnt.theta),
    )  # fmt: skip  # a list of values


def moved(wiring: Wiring, now: Period, sent: Expression) -> list[Expression]:
    """The plant after the period, with this held at the drive."""
    state, i, h = Plant(*now.plant[:3]), list(now.plant[3:]), now.h / wiring.substeps
    for _ in range(wiring.substeps):
        if wiring.inductance:
            state, i[0] = inductive_step(state, i[0], sent, now.load, h, now.friction, now.motor)
        else:
            state = plant_step(state, sent, now.load, h, now.friction, now.motor, _CURRENT[wiring.drive])
    return [*state, *i]


@lru_cache(maxsize=32)
def tick(wiring: Wiring) -> ca.Function:
    """One control period: (memory, what is given, numbers) -> (memory, log)."""
    now = controlled(wiring)
    new = ca.vertcat(*moved(wiring, now, now.sent), *now.kept)
    return ca.Function("tick", [now.memory, now.given, now.numbers], [new, now.log], {"cse": True})


@lru_cache(maxsize=8)
def stiff_tick(wiring: Wiring) -> ca.Function:
    """The same, the plant by CVODES at tight tolerances: variable steps and orders, implicit, nothing of the fast step in it."""
    now = controlled(wiring)
    x = ca.SX.sym("x", len(now.plant))
    _, v, z, *i = ca.vertsplit(x)
    constants = ca.vertcat(now.sent, now.load, *now.friction.positive, *now.friction.negative, *now.motor, now.h)
    held = ca.SX.sym("held", constants.shape[0])
    sent, load, *q = ca.vertsplit(held)
    m, current = Motor(*q[12:16]), (lambda *_: i[0]) if i else _CURRENT[wiring.drive]
    lag = [motor.current_rate(i[0], sent, v, m)] if i else []
    rates = ca.vertcat(v, plant_rates(v, z, sent, load, pair_of(q), m, current), *lag)
    options = {"abstol": 1e-10, "reltol": 1e-8, "max_num_steps": 1_000_000}
    solver = ca.integrator("stiff", "cvodes", {"x": x, "p": held, "ode": q[16] * rates}, 0.0, 1.0, options)
    controller = ca.Function(
        "controller", [now.memory, now.given, now.numbers], [constants, ca.vertcat(*now.kept), now.log], {"cse": True}
    )
    memory, u, numbers = (
        ca.MX.sym(name, s.shape[0]) for name, s in zip("muq", (now.memory, now.given, now.numbers), strict=True)
    )
    inputs, kept, log = controller(memory, u, numbers)
    new = solver(x0=memory[: len(now.plant)], p=inputs)["xf"]
    return ca.Function("stiff", [memory, u, numbers], [ca.vertcat(new, kept), log])
