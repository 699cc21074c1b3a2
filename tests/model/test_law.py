"""The equations: identities of LuGre and of the motor, and the digits that the paper's equation (19) really has."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bristle.model import functions, law, motor
from bristle.model.parameters import Lugre, Motor, ParameterName, in_direction, unit
from bristle.model.vectorize import evaluate

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


@given(z=st.floats(-1, 1), v=velocities, p=sets)
def test_odd_symmetry(z: float, v: float, p: Lugre[float]) -> None:
    """T_f and T_ss change sign, and nothing else, with the direction of motion; the static law of a set has its curve."""
    assert float(law.torque(-z, -v, p)) == -float(law.torque(z, v, p))
    assert (
        float(law.steady_torque(-v, p)) == -float(law.steady_torque(v, p)) == -float(law.steady_torque(v, p.stribeck))
    )


@given(v=velocities, p=sets)
def test_rate_is_relaxation_toward_the_steady_deflection(v: float, p: Lugre[float]) -> None:
    """Equation (4) is dz/dt = lambda (z_ss - z)."""
    z = 0.3
    expected = float(law.relaxation(v, p) * (law.steady_deflection(v, p) - z))
    assert float(law.bristle_rate(z, v, p)) == pytest.approx(expected, rel=1e-9, abs=1e-9 * abs(v))


def test_steady_curve_has_its_limits(table_set: Lugre[float]) -> None:
    """Just above rest T_ss is the breakaway level alpha_0 + alpha_1; far above v_s it is Coulomb and viscous friction alone; at rest 0."""
    p = table_set
    assert float(law.steady_torque(1e-9, p)) == pytest.approx(p.alpha_0 + p.alpha_1, rel=1e-6)
    assert float(law.steady_torque(20 * p.v_s, p)) == pytest.approx(p.alpha_0 + 20 * p.alpha_2 * p.v_s, rel=1e-12)
    assert float(law.steady_torque(0, p)) == 0


@given(v=velocities, p=sets)
def test_steady_curve_is_linear_but_in_v_s(v: float, p: Lugre[float]) -> None:
    """T_ss is its own derivative times alpha_0, alpha_1, alpha_2 (11)-(12), and the Stribeck shape is the column of alpha_1."""
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


def test_printed_19_is_the_derivative_by_alpha_1_not_alpha_0(gripper: Lugre[float]) -> None:
    """At v = 0.03, z = 0.003 the right-hand side of (19) as printed is dT_f/d alpha_1, and not dT_f/d alpha_0.

    The digits are those of docs/paper.md.
    """
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


@given(z=st.floats(-1, 1), v=velocities, p=sets)
def test_adaptive_form_at_one_is_the_law(z: float, v: float, p: Lugre[float]) -> None:
    """With theta_1 = theta_2 = 1, (16)-(18) are (3)-(5)."""
    assert float(law.torque(z, v, law.adapted(p, {"alpha_0": 1.0, "alpha_2": 1.0}))) == float(law.torque(z, v, p))


@given(z=st.floats(-1, 1), v=velocities, p=sets)
def test_freezing_lambda_where_it_is_changes_nothing(z: float, v: float, p: Lugre[float]) -> None:
    """`at` = v gives the same torque; at another velocity, torque is affine in v."""
    assert float(law.torque(z, v, p, at=v)) == float(law.torque(z, v, p))
    line = [float(law.torque(z, u, p, at=0.3)) for u in (v - 1, v, v + 1)]
    assert line[1] - line[0] == pytest.approx(line[2] - line[1], rel=1e-6)


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


def test_units_are_those_of_the_equations() -> None:
    """In both kinds of joint, each unit parses and the terms of (1)-(5) have the dimension of what they are added to."""
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


def test_each_function_is_built_once() -> None:
    """Two calls give the same object, with named inputs and outputs."""
    assert functions.step_function() is functions.step_function()
    assert functions.step_function().name_in() == ["v0", "v1", "h", *Lugre._fields]
    assert functions.step_sensitivity_function().name_out()[:3] == ["a", "b", "a_alpha_0"]
    assert functions.step_parameters() == ("alpha_0", "alpha_1", "v_s", "sigma_0")


def test_a_parameter_prints_as_it_is_read() -> None:
    """A sign is a direction; a bare LuGre parameter is of both directions, any other is shared; what prints is read as the same parameter."""
    expected = {
        "alpha_0+": ("alpha_0", "+"), "sigma_1-": ("sigma_1", "-"), "v_s": ("v_s", "both"), "inertia": ("inertia", "shared"),
    }  # fmt: skip  # a table
    for text, parts in expected.items():
        name = ParameterName.parse(text)
        assert (name.name, name.direction) == parts
        assert str(name) == f"{name}" == text
    positive = ParameterName.parse("alpha_0+")
    assert (positive.within("+"), positive.within("shared")) == ("alpha_0", "alpha_0+")


def test_a_direction_knows_its_own_value_first() -> None:
    """What is known of a direction is its own value, else that of both, else the shared one; of another direction nothing."""
    known = {ParameterName.parse(name): x for name, x in {"alpha_0+": 1.0, "v_s": 2.0, "inertia": 3.0}.items()}
    assert [in_direction(known, n, "+") for n in ("alpha_0", "v_s", "inertia", "sigma_0")] == [1.0, 2.0, 3.0, None]
    assert in_direction(known, "alpha_0", "-") is None
    assert in_direction(known, "alpha_0", "both") is None
