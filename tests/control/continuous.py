"""The compensated joint as one continuous equation, integrated by CVODES: what the sampled loop tends to.

The paper used such blocks, with ode45. The plant under a torque drive, PID (21) with the exact derivative, the
compensator's bristle, the gains by their law; nothing is sampled or limited.
"""

from collections.abc import Callable, Sequence
from math import inf

import casadi as ca
import numpy as np

from bristle.control import compensator as compensating
from bristle.control.adaptation import Learnt, effective, gradient, rate
from bristle.control.closed_loop import Trajectory
from bristle.control.compensator import Compensator, Measurement, Reference
from bristle.control.control_period import Case
from bristle.control.plant import plant_rates
from bristle.model import law, motor
from bristle.model.laws.parts import Expression
from bristle.model.parameters import Pair


def simulate_continuous(
    case: Case, compensator: Compensator, reference: Callable[[Expression], Expression], duration: float, period: float
) -> Trajectory:
    """Runs a case from rest for a duration, s, logged every period, s; there is no encoder, and the compensator measures the true velocity."""
    # `reference` is the position, rad, of a CasADi symbol of time, s. A limit of the torque, a filter and least
    # squares, which are sampled alone, are left out
    gains = compensating.adapted_count(compensator)
    t, x = ca.SX.sym("t"), ca.SX.sym("x", 5 + 2 * gains)
    y, v, z, integral, *memory = ca.vertsplit(x)
    y_ref = reference(t)
    v_ref = ca.jacobian(y_ref, t)
    r = Reference(y_ref, v_ref, ca.jacobian(v_ref, t))
    memory_rates, T_c = _compensated(compensator, case.model, r, Measurement(y, v), memory)
    K_p, K_i, K_d, _ = case.gains
    T = K_p * (r.position - y) + integral + K_d * (r.velocity - v) + T_c
    plant = plant_rates(v, z, T, 0.0, case.plant, case.motor, motor.current_for)
    rates = ca.vertcat(v, plant, K_i * (r.position - y), *memory_rates)
    friction = law.torque(z, v, law.active(z, v, case.plant))
    logged = ca.vertcat(r.position, y, v, T, friction, T_c, *memory[1 : 1 + gains])
    log = ca.Function("log", [t, x], [logged])
    time = np.asarray(period * np.arange(round(duration / period) + 1))
    settings = {"abstol": 1e-10, "reltol": 1e-8, "max_num_steps": 10_000_000}
    solver = ca.integrator("continuous", "cvodes", {"t": t, "x": x, "ode": rates}, 0.0, time, settings)
    start = [0.0] * 5 + [1.0] * gains + [0.0] * gains
    followed, *rows = log.map(time.size)(time[None], solver(x0=start)["xf"]).full()
    y, v, T, friction, T_c = (row[None] for row in rows[:5])
    return Trajectory(
        time=time, reference=followed, position=y, velocity=v, torque=T, voltage=np.full_like(T, np.nan), friction=friction,
        compensation=T_c, theta=np.array(rows[5:]).reshape(1, gains, time.size),
    )  # fmt: skip  # a list of values


def _compensated(
    compensator: Compensator, pair: Pair[float], r: Reference, m: Measurement, memory: Sequence[Expression]
) -> tuple[list[Expression], Expression]:
    """Of the compensator: the rates of its bristle, its gains and dz / d theta; and its torque, N*m."""
    z, *learnt = memory
    state = compensating.initial_state(compensator, pair)
    if not compensator.name.startswith("lugre"):
        return [0.0], compensating.step(compensator, state, r, m, inf)[1]
    a, n = compensator.adaptation, len(learnt) // 2
    known = Learnt(tuple(learnt[:n]), tuple(learnt[n:]), ())
    v, e = compensating.driving(compensator, state, r, m, inf), m.position - r.position
    p = law.active(z, v, pair)
    now = effective(p, a, known.theta) if a else p
    T, dz = law.torque(z, v, now), law.bristle_rate(z, v, now)
    rates = [dz - compensator.observer_gain * e if compensator.name == "lugre-observer" else dz]
    if a:
        pulls, (low, high) = rate(a, known, gradient(a, z, v, p, known), e), a.limits
        for theta, pull in zip(known.theta, pulls, strict=True):  # which stops at its limits
            up = ca.if_else(theta < high, ca.fmax(pull, 0.0), 0.0)
            rates.append(up + ca.if_else(theta > low, ca.fmin(pull, 0.0), 0.0))
        by_z, pairs = ca.jacobian(dz, z), zip(known.theta, known.sensitivity, strict=True)
        rates += [by_z * s + ca.jacobian(dz, theta) for theta, s in pairs]
    return rates, compensator.inertia * r.acceleration + compensator.share * T
