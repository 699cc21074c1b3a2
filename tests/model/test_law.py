from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from bristle.arrays import Array
from bristle.model import functions, law, motor
from bristle.model.law import is_passive
from bristle.model.parameters import Lugre, Motor, Pair, ParameterName, in_direction, unit
from bristle.model.rollout import rollout
from bristle.model.vectorize import evaluate
from bristle.simulation.edro import TABLE_1

positive = st.floats(1e-3, 1e3)
velocities = st.floats(-10, 10, allow_subnormal=False)
sets = st.builds(Lugre, positive, positive, positive, st.floats(0.01, 10), positive, positive)


@given(v=velocities, p=sets)
def test_bristle_rests_in_steady_state(v: float, p: Lugre[float]) -> None:
    """At the steady deflection dz/dt = 0, and T_f is the steady torque (9)."""
    z = float(law.steady_deflection(v, p))
    assert float(law.bristle_rate(z, v, p)) == pytest.approx(0, abs=1e-12 * abs(v))
    assert float(law.torque(z, v, p)) == pytest.approx(
        float(law.steady_torque(v, p)), rel=1e-12, abs=1e-12 * p.sigma_1 * abs(v)
    )
    # equation (4) is dz/dt = lambda (z_ss - z)
    z = 0.3
    expected = float(law.relaxation(v, p) * (law.steady_deflection(v, p) - z))
    assert float(law.bristle_rate(z, v, p)) == pytest.approx(expected, rel=1e-9, abs=1e-9 * abs(v))
    # T_ss is its own derivative times alpha_0, alpha_1, alpha_2 (11)-(12), and the Stribeck shape is the column of alpha_1
    static = p[:4]
    (torque,) = evaluate(functions.steady_torque_function(), v, *static)
    columns = evaluate(functions.steady_jacobian_function(), v, *static)
    assert float(torque) == pytest.approx(
        float(sum(c * x for c, x in zip(columns[:3], static[:3], strict=True))), rel=1e-12
    )
    (shape,) = evaluate(functions.stribeck_shape_function(), v, p.v_s)
    again, slope = evaluate(functions.stribeck_shape_slope_function(), v, p.v_s)
    assert float(again) == float(shape)
    assert float(columns[1]) == pytest.approx(float(shape), rel=1e-12)
    assert float(columns[3]) == pytest.approx(p.alpha_1 * float(slope), rel=1e-12)


@given(z=st.floats(-1, 1), v=velocities, p=sets)
def test_odd_symmetry(z: float, v: float, p: Lugre[float]) -> None:
    """T_f and T_ss change sign, and nothing else, with the direction of motion; the static law of a set has its curve."""
    assert float(law.torque(-z, -v, p)) == -float(law.torque(z, v, p))
    assert (
        float(law.steady_torque(-v, p)) == -float(law.steady_torque(v, p)) == -float(law.steady_torque(v, p.stribeck))
    )
    # with theta_1 = theta_2 = 1, (16)-(18) are (3)-(5)
    assert float(law.torque(z, v, law.adapted(p, {"alpha_0": 1.0, "alpha_2": 1.0}))) == float(law.torque(z, v, p))
    # `at` = v gives the same torque; at another velocity, torque is affine in v
    assert float(law.torque(z, v, p, at=v)) == float(law.torque(z, v, p))
    line = [float(law.torque(z, u, p, at=0.3)) for u in (v - 1, v, v + 1)]
    assert line[1] - line[0] == pytest.approx(line[2] - line[1], rel=1e-6)


def test_steady_curve_has_its_limits(table_set: Lugre[float], gripper: Lugre[float]) -> None:
    """Just above rest T_ss is the breakaway level alpha_0 + alpha_1; far above v_s it is Coulomb and viscous friction alone; at rest 0."""
    p = table_set
    assert float(law.steady_torque(1e-9, p)) == pytest.approx(p.alpha_0 + p.alpha_1, rel=1e-6)
    assert float(law.steady_torque(20 * p.v_s, p)) == pytest.approx(p.alpha_0 + 20 * p.alpha_2 * p.v_s, rel=1e-12)
    assert float(law.steady_torque(0, p)) == 0
    # a full bristle at sudden high speed opposes motion in every passive set, and drives it in base rotation (-). There alone alpha_2 is
    # not beyond sigma_1 alpha_1 / alpha_0, 0.134 < 0.248 (docs/paper.md)
    v = np.geomspace(0.1, 1e4, 200)
    full = np.full(v.size, (p.alpha_0 + p.alpha_1) / p.sigma_0)
    (torque,) = evaluate(functions.torque_function(), full, v, *p)
    assert bool(np.all(torque > 0)) == is_passive(p) == (p != TABLE_1["base rotation"].negative)
    least = p.sigma_1 * p.alpha_1 / p.alpha_0
    assert is_passive(p) or (round(p.alpha_2, 3), round(least, 3)) == (0.134, 0.248)
    # at v = 0.03, z = 0.003 the right-hand side of (19) as printed is dT_f/d alpha_1, and not dT_f/d alpha_0
    # the digits are those of docs/paper.md
    v, z = 0.03, 0.003
    p = Lugre(*(ca.SX.sym(name) for name in Lugre._fields))
    theta = ca.SX.sym("theta", 2)
    torque = law.torque(z, v, law.adapted(p, {"alpha_0": theta[0], "alpha_2": theta[1]}))
    by = ca.Function("by", [ca.vertcat(*p), theta], [ca.jacobian(torque, ca.vertcat(*p, theta))])
    row = np.array(by(ca.DM(list(gripper)), [1, 1])).ravel()
    g = float(law.stribeck(v, gripper))
    printed = gripper.sigma_0 * gripper.sigma_1 * v * z / g**2 * np.exp(-((v / gripper.v_s) ** 2))
    assert round(printed, 7) == 0.0149170
    assert round(row[1], 7) == 0.0149170
    assert round(row[0], 7) == 0.0177452
    assert row[6] == pytest.approx(gripper.alpha_0 * row[0], rel=1e-12)  # the gains are theta: the strict gradient
    assert row[7] == pytest.approx(gripper.alpha_2 * v, rel=1e-12)
    # energy balance: the work on the spring is the change of sigma_0 z^2 / 2 plus what relaxation loses, lambda sigma_0 z^2
    h = 1e-4
    t = np.arange(20001) * h
    v = 0.1 * np.sin(2 * np.pi * t) + 0.04 * np.sin(2 * np.pi * 2.7 * t)
    z = rollout(v, h, gripper, z0=0.0).z
    g = gripper.alpha_0 + gripper.alpha_1 * np.exp(-((v / gripper.v_s) ** 2))
    lost = integral(gripper.sigma_0**2 * np.abs(v) / g * z**2, h)
    taken = integral(gripper.sigma_0 * z * v, h)
    np.testing.assert_allclose(taken, 0.5 * gripper.sigma_0 * z**2 + lost, atol=1e-6 * taken.max())


@given(V=st.floats(-24, 24), w=velocities, k_t=positive, R=positive, J=positive)
def test_motor_equations_agree(V: float, w: float, k_t: float, R: float, J: float) -> None:
    """Without inductance (1) rests at the current (6); its torque is (7); (8) inverted gives the voltage back; (2) balances at (8)."""
    m = Motor(k_t, R, 1e-3, J)
    i = motor.current(V, w, m)
    size = abs(V) + abs(k_t * w) + 1e-200
    assert motor.current_rate(i, V, w, m) == pytest.approx(0, abs=1e-12 * size / m.L)
    assert motor.drive_torque(V, w, m) == pytest.approx(k_t * i, rel=1e-12, abs=1e-300)
    assert motor.voltage(motor.drive_torque(V, w, m), w, m) == pytest.approx(V, abs=1e-12 * size)
    assert motor.acceleration(i, motor.drive_torque(V, w, m), m) == pytest.approx(0, abs=1e-12 * k_t * size / R / J)


def test_units_functions_and_names() -> None:
    """Two calls give the same object, with named inputs and outputs."""
    assert functions.step_function() is functions.step_function()
    assert functions.step_function().name_in() == ["v0", "v1", "h", *Lugre._fields]
    assert functions.step_sensitivity_function().name_out()[:3] == ["a", "b", "a_alpha_0"]
    assert functions.step_parameters() == ("alpha_0", "alpha_1", "v_s", "sigma_0")
    # a sign is a direction; a bare LuGre parameter is of both directions, any other is shared; what prints is read as the same parameter
    expected = {
        "alpha_0+": ("alpha_0", "+"), "sigma_1-": ("sigma_1", "-"), "v_s": ("v_s", "both"), "inertia": ("inertia", "shared"),
    }  # fmt: skip  # a table
    for text, parts in expected.items():
        name = ParameterName.parse(text)
        assert (name.name, name.direction) == parts
        assert str(name) == f"{name}" == text
    positive = ParameterName.parse("alpha_0+")
    assert (positive.within("+"), positive.within("shared")) == ("alpha_0", "alpha_0+")
    # what is known of a direction is its own value, else that of both, else the shared one; of another direction nothing
    known = {ParameterName.parse(name): x for name, x in {"alpha_0+": 1.0, "v_s": 2.0, "inertia": 3.0}.items()}
    assert [in_direction(known, n, "+") for n in ("alpha_0", "v_s", "inertia", "sigma_0")] == [1.0, 2.0, 3.0, None]
    assert in_direction(known, "alpha_0", "-") is None
    assert in_direction(known, "alpha_0", "both") is None
    # in both kinds of joint, each unit parses and the terms of (1)-(5) have the dimension of what they are added to
    pint = pytest.importorskip("pint")
    registry = pint.UnitRegistry()
    for kind in ("revolute", "prismatic"):
        u = {
            name: registry.parse_units(unit(name, kind))
            for name in (*Lugre._fields, *Motor._fields, "torque", "position", "velocity", "voltage")
        }
        terms = ["alpha_0", "alpha_1"]
        products = [("alpha_2", "velocity"), ("sigma_0", "position"), ("sigma_1", "velocity")]
        dimensions = [u[t] for t in terms] + [u[a] * u[b] for a, b in products] + [u["k_t"] * u["voltage"] / u["R"]]
        assert all(d.dimensionality == u["torque"].dimensionality or kind == "revolute" for d in dimensions)
        assert all(d.is_compatible_with(u["torque"] * registry.rad**n) for d in dimensions for n in (0, 1))
        assert (u["J"] * registry.parse_units(unit("acceleration", kind))).is_compatible_with(u["torque"])
    with pytest.raises(KeyError):
        unit("stiction")


GRIPPER = TABLE_1["gripper rotation"]


def acting_torque(z: float, v: float, pair: Pair[float]) -> float:
    return float(law.torque(z, v, law.active(z, v, pair)))


def power(z: Array, v: Array, pair: Pair[float]) -> Array:
    """Power into the bristle spring, sigma_0 z v, W."""
    stiffness = evaluate(functions.active_function(), z, v, *pair.positive, *pair.negative)[4]
    return stiffness * z * v


def stored(z: float, pair: Pair[float]) -> float:
    """Energy of the bristle spring, J."""
    return 0.5 * (pair.positive if z > 0 else pair.negative).sigma_0 * z**2


def integral(values: Array, step: float) -> Array:
    """Running integral by the trapezoidal rule, from 0."""
    return np.concatenate([[0.0], np.cumsum((values[1:] + values[:-1]) / 2)]) * step


@given(z=st.floats(-1e-2, 1e-2), v=st.floats(-1, 1))
def test_torque_is_continuous_where_sets_switch(z: float, v: float) -> None:
    """T_f has the same limit from both sides of v = 0 and of z = 0; a switch of the whole set at v = 0 would jump."""
    tiny = 1e-12
    assert acting_torque(z, tiny, GRIPPER) == pytest.approx(acting_torque(z, -tiny, GRIPPER), abs=1e-10)
    assert acting_torque(tiny, v, GRIPPER) == pytest.approx(acting_torque(-tiny, v, GRIPPER), abs=1e-6)
    jump = float(law.torque(z, tiny, GRIPPER.positive) - law.torque(z, -tiny, GRIPPER.negative))
    assert jump == pytest.approx((GRIPPER.positive.sigma_0 - GRIPPER.negative.sigma_0) * z, abs=1e-10)


@pytest.mark.parametrize("amplitude", [1e-5, 1e-3, 1.0], ids=["presliding", "mixed", "sliding"])
def test_no_energy_is_gained_over_closed_cycles(pair: Pair[float], amplitude: float) -> None:
    """Over cycles of position that close, the spring gives back no more than it took: work >= change of stored energy, at every time."""
    n = 4000
    t = np.arange(4 * n) / n
    v = 2 * np.pi * amplitude * (np.cos(2 * np.pi * t) + 0.5 * np.cos(6 * np.pi * t + 1) - 0.5 * np.cos(1))
    z = rollout(v, 1 / n, pair, z0=0.0).z
    taken = integral(power(z, v, pair), 1 / n)
    kept = np.array([stored(x, pair) for x in z])
    assert np.all(taken - kept >= -1e-5 * kept.max())
    per_cycle = np.diff(taken[::n] - kept[::n])
    assert np.all(per_cycle >= -1e-5 * kept.max())


def test_pair_equals_radau(pair: Pair[float]) -> None:
    """Torque of a pair is within 1e-4 of a tight Radau solution of the switched equation through two reversals."""
    h, n = 1e-3, 61
    v = 0.1 * np.sin(2 * np.pi * (0.47 + np.arange(n) * h * 9.5))
    z = np.zeros(n)
    for k in range(n - 1):
        slope = (v[k + 1] - v[k]) / h

        def rate(t: float, y: Array, k: int = k, slope: float = slope) -> Any:
            u = v[k] + slope * t
            p = pair.positive if u >= 0 else pair.negative
            stiffness = (pair.positive if y[0] >= 0 else pair.negative).sigma_0
            return u - stiffness * abs(u) / (p.alpha_0 + p.alpha_1 * np.exp(-((u / p.v_s) ** 2))) * y

        z[k + 1] = solve_ivp(rate, (0, h), z[k : k + 1], method="Radau", rtol=1e-9, atol=1e-12).y[0, -1]
    expected = np.array([acting_torque(*point, pair) for point in zip(z, v, strict=True)])
    assert np.ptp(np.sign(z)) == 2
    assert np.abs(rollout(v, h, pair, z0=0.0).torque - expected).max() <= 1e-4 * np.abs(expected).max()
    # however stiff, one sample after a reversal T_f is the steady torque of the new direction
    stiff = Pair(*(p._replace(sigma_0=1e7 * p.sigma_0, sigma_1=0.0) for p in pair))
    v = np.array([-0.05, -0.05, 0.05, 0.05, -0.05])
    torque = rollout(v, 1e-3, stiff).torque
    expected = [float(law.steady_torque(u, stiff.positive if u > 0 else stiff.negative)) for u in v]
    np.testing.assert_allclose(torque, expected, rtol=1e-3)
