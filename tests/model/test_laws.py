import pickle
import re
from collections.abc import Iterator
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
from bristle.model.laws import registry
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import FASTEST, Law, OwnParameter, Peak, ViscousTerm
from bristle.model.laws.registry import competing, law_named, register_law
from bristle.model.parameters import (
    Direction,
    Lugre,
    Motor,
    Pair,
    ParameterName,
    fields_of,
    in_direction,
    least_of,
    lugre_of,
    pair_of,
    static_fields_of,
    unit,
)
from bristle.model.rollout import rollout, rollout_jacobian
from bristle.model.vectorize import evaluate
from bristle.simulation.edro import TABLE_1

LAWS = (*competing(), law_named("free-exponent"), law_named("free-exponent+quadratic"))
OWN = {"alpha_3": -0.011, "delta": 1.3, FASTEST: 0.8}
FORMULAS = {
    "gaussian": lambda x: np.exp(-(x**2)),
    "exponential": lambda x: np.exp(-x),
    "lorentzian": lambda x: 1 / (1 + x**2),
    "free-exponent": lambda x: np.exp(-(x ** OWN["delta"])),
}
"""Each peak over abs(v) / v_s, written as a textbook does."""


@pytest.fixture(params=LAWS, ids=lambda one: one.name)
def chosen(request: pytest.FixtureRequest) -> Law:
    own: Law = request.param
    return own


def set_of(one: Law, **changed: float) -> Lugre[float]:
    values = {**TABLE_1["gripper rotation"].positive._asdict(), **OWN, **changed}
    return lugre_of(one)(**{name: values[name] for name in fields_of(one)})


@pytest.fixture
def outside() -> Iterator[Law]:
    """A law whose peak and term come from outside the package."""
    power = OwnParameter(name="steepness", symbol="n", units=("1", "1"), searched=(0.5, 3.0))
    cubic = OwnParameter(name="cubic", symbol="c", units=("N*m*s**3/rad**3", "N*s**3/m**3"), least=-float("inf"))
    register_law(
        Peak(
            name="power", title="power-law", shape=lambda v, v_s, n: (1 + v**2 / v_s**2) ** -n, own=(power,), reach=3.0
        )
    )
    register_law(ViscousTerm(name="cubic", title="v³", coefficient=cubic, rate=lambda speed: speed**2))
    yield law_named("power+cubic")
    for name in ("power", "cubic"):
        registry._PARTS.pop(name)
        registry._COMPETE.discard(name)


def test_steady_curves_peaks_and_derivatives(chosen: Law) -> None:
    """T_ss is (alpha_0 + alpha_1 s) sgn v + alpha_2 v + alpha_3 v abs(v), odd in v, to rounding, at measured speeds."""
    p, v = set_of(chosen), np.geomspace(1e-4, 0.8, 60)
    peak = FORMULAS[chosen.peak.name](v / p.v_s)
    expected = p.alpha_0 + p.alpha_1 * peak + p.alpha_2 * v
    if chosen.terms:
        expected += OWN["alpha_3"] * v**2
    for sign in (1.0, -1.0):
        (torque,) = evaluate(functions.steady_torque_function(chosen), sign * v, *p.stribeck)
        np.testing.assert_allclose(torque, sign * expected, rtol=1e-13)
    # every peak is one at rest, even, falling, and nine tenths of it are gone at `reach` v_s (of delta = 1 for the free exponent)
    v, own = ca.SX.sym("v"), [OWN[x.name] for x in chosen.peak.own]
    shape = ca.Function("shape", [v], [chosen.peak.shape(v, 0.072, *own)])
    at = shape(np.linspace(-1, 1, 401)[None]).full()[0]
    assert float(shape(0.0)) == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(at, at[::-1], rtol=1e-12)
    assert (np.diff(at[200:]) <= 0).all()
    gone = ca.Function("gone", [v], [chosen.peak.shape(v, 0.072, *([1.0] * len(own)))])
    assert float(gone(chosen.peak.reach * 0.072)) == pytest.approx(0.1, abs=0.006)
    # dT_ss/dp and dT_f/dp by CasADi agree with central differences to 1e-7 of the torque, beyond v_end too
    p = set_of(chosen)
    v = np.array([-2.0, -0.7, -0.05, -1e-3, 2e-3, 0.04, 0.3, 0.79, 1.5])
    by = evaluate(functions.steady_jacobian_function(chosen), v, *p.stribeck)
    for k, name in enumerate(static_fields_of(chosen)):
        differences = _central(lambda x, name=name: _steady(p._replace(**{name: x}), v), getattr(p, name))
        np.testing.assert_allclose(by[k], differences, atol=1e-7 * np.abs(_steady(p, v)).max() / abs(getattr(p, name)))
    z = 0.4 * p.alpha_0 / p.sigma_0
    T, _, *by_p = evaluate(functions.torque_sensitivity_function(chosen), z, v, *p)
    for slope, name in zip(by_p, fields_of(chosen), strict=True):
        differences = _central(lambda x, name=name: _torque(z, v, p._replace(**{name: x})), getattr(p, name))
        np.testing.assert_allclose(slope, differences, atol=1e-7 * np.abs(T).max() / abs(getattr(p, name)))


def _central(f: Any, x: float) -> Array:
    h = 1e-3 * abs(x)
    slope: Array = (8 * (f(x + h) - f(x - h)) - (f(x + 2 * h) - f(x - 2 * h))) / (12 * h)
    return slope


def _steady(p: Lugre[float], v: Array) -> Array:
    return evaluate(functions.steady_torque_function(p.law), v, *p.stribeck)[0]


def _torque(z: float, v: Array, p: Lugre[float]) -> Array:
    return evaluate(functions.torque_function(p.law), z, v, *p)[0]


def test_rollouts_jacobians_and_passivity_of_laws(chosen: Law) -> None:
    """Along a motion through reversals T_f agrees with Radau at 1e-10 to 1e-4 of its largest value, under every law."""
    p, h = set_of(chosen), 1e-3
    t = np.arange(400) * h
    v = 0.3 * np.sin(2 * np.pi * 2.5 * t) + 0.1 * np.sin(2 * np.pi * 7.0 * t)
    level = ca.Function("level", [x := ca.SX.sym("x")], [law.relaxation(x, p)])

    def rate(at: float, z: Array) -> Array:
        u = float(np.interp(at, t, v))
        slope: Array = u - float(level(u)) * z
        return slope

    found = solve_ivp(rate, (0, t[-1]), [0.0], "LSODA", t, rtol=1e-9, atol=1e-12, max_step=h / 2)
    expected = evaluate(functions.torque_function(chosen), found.y[0], v, *p)[0]
    torque = rollout(v, h, p, z0=0.0).torque
    assert np.abs(torque - expected).max() <= 1e-4 * np.abs(expected).max()
    # the derivative of T_f along a motion is that of differences of rollouts, for a set and a pair, in all parameters
    p, h = set_of(chosen), 1e-3
    v = 0.3 * np.sin(2 * np.pi * 2.5 * np.arange(300) * h)
    pair = Pair(p, p._replace(alpha_0=0.8 * p.alpha_0, v_s=1.2 * p.v_s))
    by, by_pair = rollout_jacobian(v, h, p, 0.0).by_parameters, rollout_jacobian(v, h, pair, 0.0).by_parameters
    count = len(fields_of(chosen))
    assert (by.shape, by_pair.shape) == ((300, count), (300, 2 * count))
    for k, name in enumerate(fields_of(chosen)):
        x = getattr(p, name)
        one = _central(lambda u, name=name: rollout(v, h, p._replace(**{name: u}), 0.0).torque, x)
        np.testing.assert_allclose(by[:, k], one, atol=2e-5 * max(np.abs(one).max(), 1e-9))
        of_pair = _central(
            lambda u, name=name: rollout(v, h, pair._replace(positive=p._replace(**{name: u})), 0.0).torque, x
        )
        np.testing.assert_allclose(by_pair[:, k], of_pair, atol=2e-5 * max(np.abs(of_pair).max(), 1e-9))
    # where `is_passive` says so, the running work from rest is never negative within the measured speeds; where not, a full bristle drives
    p, rng, h = set_of(chosen), np.random.default_rng(0), 1e-3
    assert law.is_passive(p)
    t = np.arange(3000) * h
    for _ in range(10):
        v = np.sum([0.2 * np.sin(2 * np.pi * f * t + a) for f, a in rng.uniform(0, 5, (3, 2))], axis=0)
        torque = rollout(v, h, p, z0=0.0).torque
        work = np.concatenate([[0.0], np.cumsum((torque * v)[1:] + (torque * v)[:-1]) * h / 2])
        assert (work >= -1e-4 * np.abs(work).max()).all()
    driving = p._replace(sigma_1=10 * p.alpha_2 * p.alpha_0 / p.alpha_1)
    assert not law.is_passive(driving)
    full = (p.alpha_0 + p.alpha_1) / p.sigma_0
    assert (_torque(full, np.geomspace(0.1, 0.8, 50), driving) < 0).any()
    # a law's tuple keeps its type through replacing, pickling and pairs; the paper's is `Lugre` itself
    p = set_of(chosen)
    assert isinstance(p._replace(alpha_0=1.0), type(p))
    again = pickle.loads(pickle.dumps(p))  # noqa: S301  # our own bytes
    assert (again, type(again), again.law) == (p, type(p), chosen)
    assert pair_of([*p, *p], chosen) == Pair(p, p)
    assert (type(p) is Lugre) == (chosen == GAUSSIAN)


def test_terms_limits_and_names_of_laws(outside: Law) -> None:
    """With alpha_3 < 0 viscous friction beyond v_end is what it is there; with alpha_3 > 0 it goes on; both continuous."""
    v = np.array([0.8, 0.8 * (1 + 1e-9), 2.0, 50.0])
    for alpha_3 in (-0.01, 0.01):
        p = set_of(law_named("gaussian+quadratic"), alpha_3=alpha_3)
        viscous = _steady(p, v) - p.alpha_0
        at_end = 0.8 * p.alpha_2 + alpha_3 * 0.8**2
        expected = [at_end] * 4 if alpha_3 < 0 else p.alpha_2 * v + alpha_3 * v**2
        np.testing.assert_allclose(viscous, expected, rtol=1e-8)
    # without peak and damping LuGre is Dahl: dT/dx = sigma_0 (1 - T sgn(v) / alpha_0), T = alpha_0 (1 - exp(-sigma_0 x / alpha_0))
    p, h = Lugre(0.02, 0.0, 0.0, 1.0, 6.0, 0.0), 1e-3
    x = 0.01 * (1 - np.cos(2 * np.pi * np.arange(501) * h))
    v = np.gradient(x, h)
    torque = rollout(v, h, p, z0=0.0).torque
    travelled = np.concatenate([[0.0], np.cumsum((v[1:] + v[:-1]) / 2) * h])
    rising = travelled[:500] <= travelled.max()
    expected = p.alpha_0 * -np.expm1(-p.sigma_0 * travelled[:500] / p.alpha_0)
    np.testing.assert_allclose(torque[:500][rising], expected[rising], atol=2e-4 * p.alpha_0)
    # a law's name finds it again; `paper` is the Gaussian one; what is no law is a KeyError that names all
    for one in LAWS:
        assert law_named(one.name) == one
    assert law_named("paper") == law_named("auto") == GAUSSIAN
    for wrong in ("gauss", "quadratic", "gaussian+", "gaussian+lorentzian", "gaussian+quadratic+quadratic", ""):
        with pytest.raises(KeyError, match="lorentzian"):
            law_named(wrong)
    assert competing()[0] == GAUSSIAN
    assert "free-exponent" not in {one.peak.name for one in competing()}
    # parameters of a registered law have a unit, a least value and a direction; the law competes with each term
    assert fields_of(outside)[6:] == ("steepness", "cubic", FASTEST)
    assert unit("cubic", "prismatic") == "N*s**3/m**3"
    assert unit("cubic", "prismatic in V") == "V*s**3/m**3"
    assert (least_of("cubic"), least_of("steepness")) == (-np.inf, 0.0)
    assert ParameterName.parse("cubic") == ParameterName("cubic", Direction.BOTH)
    assert {"power", "power+cubic", "power+quadratic", "gaussian+cubic"} <= {one.name for one in competing()}
    p = lugre_of(outside)(**{**set_of(GAUSSIAN)._asdict(), "steepness": 1.5, "cubic": 0.02, FASTEST: 0.8})
    expected = p.alpha_0 + p.alpha_1 * (1 + (0.1 / p.v_s) ** 2) ** -1.5 + p.alpha_2 * 0.1 + 0.02 * 0.1**3
    assert _steady(p, np.array([0.1]))[0] == pytest.approx(expected, rel=1e-12)
    # with what is wrong, and it is not registered
    before, failed = dict(registry._PARTS), []
    for part, wrong in NO_PARTS:
        with pytest.raises(ValueError) as refused:  # noqa: PT011  # the pattern is below
            register_law(part)
        failed += [(wrong, str(refused.value))] * (
            not re.search(wrong, str(refused.value)) or before != registry._PARTS
        )
    assert failed == []


def _half(v: Any, v_s: Any) -> Any:
    return 1 / (1 + (v / v_s) ** 2)


def _power(v: Any, v_s: Any, n: Any) -> Any:
    return _half(v, v_s) ** n


def _named(name: str, own: str) -> Peak:
    n = OwnParameter(name=own, symbol="n", units=("1", "1"), searched=(1.0, 2.0))
    return Peak(name=name, title="x", shape=_power, reach=3.0, own=(n,))


def _shaped(shape: Any, reach: float = 3.0) -> Peak:
    return Peak(name="no-peak", title="x", shape=shape, reach=reach)


def _rated(rate: Any) -> ViscousTerm:
    own = OwnParameter(name="c_9", symbol="c", units=("N*m*s/rad", "N*s/m"))
    return ViscousTerm(name="no-term", title="x", coefficient=own, rate=rate)


NO_PARTS: list[tuple[Peak | ViscousTerm, str]] = [
    (_named("gaussian", "n"), "choose another name"), (_named("auto", "n"), "expected letters"), (_named("mine", "alpha_0"), "'alpha_0'"),
    (_named("mine", "delta"), "'delta'"), (_named("mine", "a b"), "'a b'"),
    (_shaped(lambda v, v_s: 2 * _half(v, v_s)), "of 2 at rest"),
    (_shaped(lambda v, v_s: 1 / (1 + v / v_s)), "between v and -v|not finite"),
    (_shaped(lambda v, v_s: 1 + 0 * v / v_s), "does not fall"),
    (_shaped(lambda v, v_s: ca.exp(-ca.sqrt(ca.fabs(v) / v_s))), "no derivative"),
    (_shaped(lambda v: 1 / (1 + v**2)), "CasADi cannot evaluate"),
    (_shaped(_half, reach=0.0), "reach of 0"),
    (Peak(name="x", title="x", shape=_power, reach=3.0, own=(OwnParameter(name="n_9", symbol="n", units=("1", "1")),)), "range to search"),
    (_rated(lambda speed: 1 + speed), "of 1 at rest"), (_rated(lambda speed: -speed), "rise with speed"),
]  # fmt: skip  # a table
"""Parts whose name or whose parameter is another's; peaks that are not even, finite, 1 at rest, falling to 0 with a derivative, or that
no fit can search for; terms that add at rest, or whose rate does not rise."""


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
    """A sign is a direction; a bare LuGre parameter is of both directions, any other is shared; what prints is read as the same parameter."""
    expected = {
        "alpha_0+": ("alpha_0", "+"), "sigma_1-": ("sigma_1", "-"), "v_s": ("v_s", "both"), "inertia": ("inertia", "shared"),
    }  # fmt: skip  # a table
    for text, parts in expected.items():
        name = ParameterName.parse(text)
        assert (name.name, name.direction) == parts
        assert str(name) == f"{name}" == text
    # what is known of a direction is its own value, else that of both, else the shared one; of another direction nothing
    known = {ParameterName.parse(name): x for name, x in {"alpha_0+": 1.0, "v_s": 2.0, "inertia": 3.0}.items()}
    assert [in_direction(known, n, "+") for n in ("alpha_0", "v_s", "inertia", "sigma_0")] == [1.0, 2.0, 3.0, None]
    assert in_direction(known, "alpha_0", "-") is None
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
