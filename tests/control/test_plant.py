from functools import lru_cache

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from bristle.arrays import Array
from bristle.control.closed_loop import simulate
from bristle.control.compensator import Compensator, Reference
from bristle.control.control_period import Case, Disturbance, LoopOptions
from bristle.control.pid import AT_REST, pid
from bristle.control.plant import State, exponential, plant_step, quantise
from bristle.model import law, motor
from bristle.model.parameters import Motor, Pair
from bristle.simulation import edro
from virtual_bench import ramp_gains

GRIPPER, BASE = edro.TABLE_1["gripper rotation"], edro.TABLE_1["base rotation"]
MOTOR = Motor(0.35, 2.1, 0.0, 1.27e-3)
BENCH = LoopOptions(compensator=Compensator(name="none"), drive="voltage", encoder=True)


@lru_cache
def stepper(pair: Pair[float], m: Motor[float]) -> ca.Function:
    """(position, velocity, deflection), voltage, load, h -> the next three, by one plant step."""
    s, V, load, h = ca.SX.sym("s", 3), ca.SX.sym("V"), ca.SX.sym("load"), ca.SX.sym("h")
    return ca.Function("step", [s, V, load, h], [ca.vertcat(*plant_step(State(*ca.vertsplit(s)), V, load, h, pair, m))])


@lru_cache
def rates(pair: Pair[float], m: Motor[float]) -> ca.Function:
    """The plant's derivative, straight from the law and the motor."""
    s, V, load = ca.SX.sym("s", 3), ca.SX.sym("V"), ca.SX.sym("load")
    _, v, z = ca.vertsplit(s)
    p = law.active(z, v, pair)
    a = motor.acceleration(motor.current(V, v, m), law.torque(z, v, p) - load, m)
    return ca.Function("rates", [s, V, load], [ca.vertcat(v, a, law.bristle_rate(z, v, p))])


def radau(state: Array, V: float, load: float, h: float, pair: Pair[float], m: Motor[float]) -> Array:
    """The plant after h, by a tight stiff solution."""
    f = rates(pair, m)
    out = solve_ivp(lambda _, s: f(s, V, load).full().ravel(), (0, h), state, "Radau", rtol=1e-7, atol=1e-10)
    assert out.success
    return np.asarray(out.y[:, -1])


A_SYMBOL, H_SYMBOL = ca.SX.sym("A", 2, 2), ca.SX.sym("h")
EXPONENTIAL = ca.Function("exponential", [A_SYMBOL, H_SYMBOL], [exponential(A_SYMBOL, H_SYMBOL)])
negative = st.floats(-1e6, -1e-6)


@settings(max_examples=100)
@given(negative, negative, st.floats(-1e6, 1e6), st.floats(-1e3, 1e3), st.floats(1e-6, 1.0))
def test_exponential_is_that_of_scipy(a: float, d: float, b: float, c: float, h: float) -> None:
    """The closed form equals SciPy's matrix exponential for real, complex and stiff stable matrices."""
    A = np.array([[a, b], [c, d]])
    if np.linalg.eigvals(A).real.max() > 0:
        A[1, 0] = -c if b * c > 0 else c
    ours = EXPONENTIAL(A, h).full()
    reference = expm(A * h)
    scale = np.abs(A * h).max() + 1
    np.testing.assert_allclose(ours, reference, rtol=1e-9, atol=1e-12 * scale)


@pytest.mark.parametrize("A", [[[-2.0, 0.0], [0.0, -2.0]], [[-2.0, 1.0], [0.0, -2.0]], [[-3.0, 1.0], [-1.0, -1.0]]])
def test_equal_eigenvalues_need_no_case(A: list[list[float]]) -> None:
    """At a double eigenvalue, with one eigenvector or two, the closed form is still exact."""
    ours = ca.evalf(exponential(ca.SX(ca.DM(A)), 0.7)).full()
    np.testing.assert_allclose(ours, expm(0.7 * np.array(A)), rtol=1e-13, atol=1e-14)


@pytest.mark.parametrize("pair", [GRIPPER, BASE])
@pytest.mark.parametrize("v", [-1.0, -0.05, 0.01, 0.3])
def test_steady_sliding_is_a_fixed_point(pair: Pair[float], v: float) -> None:
    """At the voltage that (8) gives for the torque of (9), velocity and bristle stay as they are and the joint moves by v h."""
    p, h = pair[int(v < 0)], 1e-3
    z, T = float(law.steady_deflection(v, p)), float(law.steady_torque(v, p))
    new = stepper(pair, MOTOR)([0.2, v, z], motor.voltage(T, v, MOTOR), 0.0, h).full().ravel()
    np.testing.assert_allclose(new, [0.2 + v * h, v, z], rtol=1e-10)


@given(st.sampled_from([1.0, 6.0, 1e3, 1e4, 1e5]), st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
def test_stick_gains_no_energy(sigma_0: float, stretch: float, kick: float) -> None:
    """Left alone in stick, kinetic plus bristle energy never grows from one 1 ms step to the next, however stiff the bristle."""
    p = GRIPPER.positive._replace(sigma_0=sigma_0)
    level = p.alpha_0 * stretch
    start = np.array([0.0, kick * p.alpha_0 / np.sqrt(MOTOR.J * sigma_0), level / sigma_0])
    states = stepper(Pair(p, p), MOTOR).mapaccum(300)(start, 0.0, 0.0, 1e-3).full()
    states = np.column_stack([start, states])
    energy = MOTOR.J * states[1] ** 2 / 2 + sigma_0 * states[2] ** 2 / 2
    assert (np.diff(energy) <= 1e-12 * energy[0] + 1e-300).all()


def test_steps_and_the_bench_agree_with_radau() -> None:
    """Where the motion is smooth, halving the step divides the error against a tight Radau solution by about four."""
    start, V, duration = np.array([0.0, 0.05, 0.002]), 0.4, 0.128
    exact = radau(start, V, 0.0, duration, GRIPPER, MOTOR)
    chains = {n: stepper(GRIPPER, MOTOR).mapaccum(n) for n in (32, 64, 128)}
    ends = (np.asarray(chain(start, V, 0.0, duration / n).full()[:, -1]) for n, chain in chains.items())
    errors = [np.abs(end - exact)[1] for end in ends]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert errors[-1] < 2e-5 * abs(exact[1])
    assert (orders > 1.8).all()
    # through a start and a reversal, the loop stays with a Radau solution of the same sampled, quantised loop to a few counts
    one = Case(
        plant=GRIPPER, motor=MOTOR, model=GRIPPER, gains=ramp_gains(MOTOR.J, 60.0), torque_limit=1.0, resolution=2.4e-5
    )
    t = 2e-3 * np.arange(60)
    reference = Reference(0.01 * np.sin(40 * t), 0.4 * np.cos(40 * t), -16 * np.sin(40 * t))
    run = simulate(BENCH, [one], reference, 2e-3, Disturbance(load=1e-3))
    state, memory, truth = np.zeros(3), AT_REST, []
    for r, w in zip(reference.position, reference.velocity, strict=True):
        _, v, z = state.tolist()
        friction = float(law.torque(z, v, law.active(z, v, GRIPPER)))
        truth.append([quantise(state[0], one.resolution), v, friction])
        demand, memory = pid(memory, r - truth[-1][0], 2e-3, one.gains, one.torque_limit)
        state = radau(state, motor.voltage(demand, w, MOTOR), 1e-3, 2e-3, GRIPPER, MOTOR)
    position, velocity, friction = np.array(truth).T
    assert np.abs(np.asarray(run.measured)[0] - position).max() <= 4 * one.resolution
    assert np.abs(run.velocity[0] - velocity).max() < 0.02 * np.abs(velocity).max()
    assert np.abs(run.friction[0] - friction).max() < 0.01 * np.abs(friction).max()


@given(st.floats(-100, 100), st.floats(0, 10), st.floats(1e-6, 1))
def test_reading_is_the_nearest_count(x: float, more: float, resolution: float) -> None:
    """A reading is a whole number of counts, at most half a count from the truth, reads as itself, and never falls while the joint rises."""
    reading = quantise(x, resolution)
    assert abs(reading - x) <= resolution / 2 * (1 + 1e-9) + 1e-12
    assert reading / resolution == pytest.approx(round(reading / resolution), abs=1e-6)
    assert quantise(reading, resolution) == pytest.approx(reading, abs=1e-12)
    assert quantise(x + more, resolution) >= reading
