from collections.abc import Callable, Sequence
from itertools import combinations, pairwise
from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from bristle.arrays import Array
from bristle.model import functions, law, time_refinement, vectorize
from bristle.model import rollout as module
from bristle.model.parameters import Lugre, Pair
from bristle.model.rollout import rollout, rollout_jacobian
from bristle.model.vectorize import evaluate, scan, vectorised
from bristle.simulation.edro import TABLE_1

STIFFNESS = np.array([1.0, 6.1843, 1e2, 1e3, 1e4, 1e5, 1e6])


def slow(t: NDArray[Any]) -> Any:
    """0.1 rad/s at 1 Hz."""
    return 0.1 * np.sin(2 * np.pi * t)


def fast(t: NDArray[Any]) -> Any:
    """0.5 rad/s at 1.3 Hz plus 0.2 at 3.7 Hz."""
    return 0.5 * np.sin(2 * np.pi * 1.3 * t) + 0.2 * np.sin(2 * np.pi * 3.7 * t)


def radau(velocity: Array, step: Array, p: Lugre[float], sigma_0: Array) -> Array:
    """Deflection from rest by SciPy's Radau at rtol 1e-10, for several stiffnesses at once: (n, len(sigma_0))."""
    # the velocity is linear between samples; integration restarts at each sample and zero crossing, at no kink

    def decay(v: float) -> Any:
        return sigma_0 * abs(v) / (p.alpha_0 + p.alpha_1 * np.exp(-((v / p.v_s) ** 2)))

    def rate(t: float, z: Array, v0: float, slope: float) -> Any:
        return line(t, v0, slope) - decay(line(t, v0, slope)) * z

    def jacobian(t: float, _: Array, v0: float, slope: float) -> Any:
        return np.diag(-decay(line(t, v0, slope)))

    z = np.zeros((velocity.size, sigma_0.size))
    options: dict[str, Any] = {"method": "Radau", "rtol": 1e-10, "atol": 1e-10 * p.alpha_0 / sigma_0, "jac": jacobian}
    for k, (v0, v1, h) in enumerate(zip(velocity[:-1], velocity[1:], step, strict=True)):
        y = z[k]
        stops = [0.0, h * v0 / (v0 - v1), h] if v0 * v1 < 0 else [0.0, h]
        for span in pairwise(stops):
            y = solve_ivp(rate, span, y, args=(v0, (v1 - v0) / h), **options).y[:, -1]
        z[k + 1] = y
    return z


def line(t: float, v0: float, slope: float) -> float:
    return v0 + slope * t


def torque_error(velocity: Array, step: Array, p: Lugre[float], sigma_0: float, z: Array) -> float:
    """Largest error of the rollout's torque from the one that z gives, relative to the largest torque."""
    p = p._replace(sigma_0=sigma_0)
    (expected,) = evaluate(functions.torque_function(), z, velocity, *p)
    return float(np.abs(rollout(velocity, step, p, z0=0.0).torque - expected).max() / np.abs(expected).max())


GRIPPER = TABLE_1["gripper rotation"].positive


def test_error_at_1_khz_is_small_at_any_stiffness() -> None:
    """From sigma_0 = 1 to 1e6 the torque is within 1e-5 (slow trace) or 5e-5 (fast trace) of Radau's, relative to the largest torque."""
    errors = []
    for trace, start, allowed in ((slow, 0.465, 1e-5), (fast, 0.36, 5e-5)):  # a window with a reversal in it
        velocity, step = trace(start + np.arange(80) * 1e-3), np.full(79, 1e-3)
        assert np.ptp(np.sign(velocity)) == 2
        z = radau(velocity, step, GRIPPER, STIFFNESS)
        errors += [torque_error(velocity, step, GRIPPER, s, z[:, k]) / allowed for k, s in enumerate(STIFFNESS)]
    assert max(errors) <= 1, errors


def test_error_on_irregular_steps() -> None:
    """Irregular sampling changes nothing: the error is as small."""
    rng = np.random.default_rng(3)
    step: Array = rng.uniform(2e-4, 1.8e-3, 60)
    velocity = slow(0.47 + np.concatenate([[0.0], np.cumsum(step)]))
    sigma_0 = np.array([6.1843, 1e4])
    z = radau(velocity, step, GRIPPER, sigma_0)
    assert max(torque_error(velocity, step, GRIPPER, s, z[:, k]) for k, s in enumerate(sigma_0)) <= 1e-5
    # where lambda h <~ 1, halving the nodes of one and the same piecewise-linear velocity divides the error by about four
    coarse = 0.03 * np.sin(2 * np.pi * (0.44 + np.arange(16) * 8e-3))
    sigma_0 = 20.0
    z = radau(coarse, np.full(15, 8e-3), GRIPPER, np.array([sigma_0]))[:, 0]
    p, errors = GRIPPER._replace(sigma_0=sigma_0), []
    for parts in (1, 2, 4, 8):
        fine = np.interp(np.arange(15 * parts + 1) / parts, np.arange(16), coarse)
        errors.append(np.abs(rollout(fine, 8e-3 / parts, p, z0=0.0).z[::parts] - z).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert sigma_0 * 0.03 / GRIPPER.alpha_0 * 8e-3 < 1
    np.testing.assert_allclose(orders, 2.0, atol=0.25)


anything = st.floats(-10, 10)
scaled = st.builds(
    Lugre, st.floats(0.01, 10), st.floats(0, 10), st.floats(0, 10), st.floats(0.01, 1),
    st.floats(-2, 8).map(lambda e: 10.0**e), st.floats(0, 1),
)  # fmt: skip  # a list of values
speeds = hnp.arrays(float, st.integers(0, 60), elements=anything)


@given(velocity=speeds, p=scaled, h=st.floats(1e-5, 1.0), start=st.floats(-1, 1))
def test_deflection_is_bounded(velocity: Array, p: Lugre[float], h: float, start: float) -> None:
    """abs(z) never exceeds (alpha_0 + alpha_1) / sigma_0 once below it, at any stiffness, step and velocity."""
    bound = (p.alpha_0 + p.alpha_1) / p.sigma_0
    z = rollout(velocity, h, p, z0=start * bound).z
    assert np.all(np.abs(z) <= bound * (1 + 1e-12))


@given(velocity=speeds, p=scaled, h=st.floats(1e-5, 1.0))
def test_rollout_is_odd(velocity: Array, p: Lugre[float], h: float) -> None:
    """The opposite motion gives the opposite deflection and torque."""
    there, back = rollout(velocity, h, p), rollout(-velocity, h, p)
    np.testing.assert_allclose(back.torque, -there.torque, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(back.z, -there.z, rtol=1e-9, atol=1e-15)


@given(v=st.floats(1e-3, 10), sign=st.sampled_from([-1, 1]), p=scaled, h=st.floats(1e-5, 1.0))
def test_constant_velocity_stays_in_steady_state(v: float, sign: int, p: Lugre[float], h: float) -> None:
    """At constant velocity the default start is the steady state, and T_f is T_ss (9) throughout."""
    (expected,) = evaluate(functions.steady_torque_function(), sign * v, *p[:4])
    torque = rollout(np.full(20, sign * v), h, p).torque
    np.testing.assert_allclose(torque, float(expected), rtol=1e-9 * (1 + p.sigma_1 * v / p.alpha_0))


def test_rest_and_chunks(gripper: Lugre[float], monkeypatch: pytest.MonkeyPatch) -> None:
    """With v = 0 throughout, z stays at z0 and T_f = sigma_0 z0."""
    held = rollout(np.zeros(10), 1e-3, gripper, z0=1e-3)
    np.testing.assert_array_equal(held.z, np.full(10, 1e-3))
    np.testing.assert_allclose(held.torque, gripper.sigma_0 * 1e-3, rtol=1e-15)
    # for motion much smaller than g / sigma_0, z follows position: T_f is sigma_0 y + (sigma_1 + alpha_2) v
    t = np.arange(1001) * 1e-3
    v = 1e-7 * np.sin(2 * np.pi * t)
    y = 1e-7 * (1 - np.cos(2 * np.pi * t)) / (2 * np.pi)
    expected = gripper.sigma_0 * y + (gripper.sigma_1 + gripper.alpha_2) * v
    np.testing.assert_allclose(rollout(v, 1e-3, gripper, z0=0.0).torque, expected, atol=1e-4 * np.abs(expected).max())
    # no sample gives empty arrays; one sample is the start, steady or given
    assert rollout(np.zeros(0), 1e-3, gripper).torque.shape == (0,)
    one = rollout(np.array([0.05]), np.zeros(0), gripper)
    assert one.torque == pytest.approx(
        float(evaluate(functions.steady_torque_function(), 0.05, *gripper[:4])[0]), rel=1e-12
    )
    # out of a standstill against a deflection of next to nothing, z is the angle travelled: no 0/0 where it turns
    one = Lugre(1.0, 0.0, 0.0, 1.0, 1.0, 0.0)
    for v, z0 in ((-1e-135, 6e-247), (-1e-3, 1e-300), (-1e-3, 5e-324)):
        assert rollout(np.array([0.0, v]), 1e-3, Pair(one, one), z0).z[-1] == pytest.approx(v / 2 * 1e-3, rel=1e-6)
    # the result does not depend on how many samples are worked on at a time, nor on continuing from the last z
    v = fast(np.arange(800) * 2e-3)
    whole = rollout(v, 2e-3, gripper)
    for chunk in (1, 7, 799, 800):
        monkeypatch.setattr(module, "AT_ONCE", chunk)
        np.testing.assert_allclose(rollout(v, 2e-3, gripper).torque, whole.torque, rtol=1e-12, atol=1e-15)
    second = rollout(v[300:], np.full(499, 2e-3), gripper, z0=float(whole.z[300]))
    np.testing.assert_allclose(second.torque, whole.torque[300:], rtol=1e-12, atol=1e-15)
    monkeypatch.undo()
    # where velocity steps across the whole Stribeck region between samples, the nodes in between bring the error down tenfold
    rng = np.random.default_rng(0)
    v = rng.normal(0, 0.2, 200)
    finer = np.interp(np.arange(199 * 200 + 1) / 200, np.arange(200), v)
    exact = rollout(finer, 1e-3 / 200, gripper, z0=0.0).torque[::200]
    error = np.abs(rollout(v, 1e-3, gripper, z0=0.0).torque - exact).max()
    monkeypatch.setattr(time_refinement, "_FINE", np.inf)
    without = np.abs(rollout(v, 1e-3, gripper, z0=0.0).torque - exact).max()
    assert error < 0.1 * without


@given(
    motions=st.lists(hnp.arrays(float, st.integers(1, 30), elements=anything), min_size=1, max_size=5), data=st.data()
)
@pytest.mark.parametrize("sets", [1, 2])
def test_motions_together_are_each_by_itself(sets: int, motions: list[Array], data: st.DataObject) -> None:
    """Motions one behind the other, under a load, give the deflection, torque and derivatives that each gives alone."""
    of = [data.draw(scaled) for _ in range(sets)]
    p: Lugre[float] | Pair[float] = of[0] if sets == 1 else Pair(*of)
    bound = min(one.alpha_0 / one.sigma_0 for one in of)
    z0 = np.array([data.draw(st.floats(-1, 1)) * bound for _ in motions])
    sizes = [v.size for v in motions]
    level = np.stack([np.linspace(0.0, 0.5, sum(sizes)), np.linspace(1.0, 0.0, sum(sizes))])
    begins = np.cumsum([0, *sizes])[:-1]

    def derived(velocity: Array, start: float | Array, level: Array, begins: Any) -> Array:
        rows = list(np.empty((6 * sets + 2, velocity.size)))
        rolled = module.rollout_into(rows, velocity, 1e-2, p, start, 1.0, level, begins)
        again = rollout(velocity, 1e-2, p, start, 1.0, level[0], begins)
        np.testing.assert_allclose([again.z, again.torque], [rolled.z, rolled.torque], rtol=1e-12, atol=1e-12 * bound)
        return np.stack([rolled.z, rolled.torque, *rows])

    alone = [
        derived(v, float(z), level[:, b : b + v.size], np.zeros(1, dtype=int))
        for v, z, b in zip(motions, z0, begins, strict=True)
    ]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "AT_ONCE", data.draw(st.sampled_from([7, 15_000])))
        together = derived(np.concatenate(motions), z0, level, begins)
    expected_rows = np.hstack(alone)
    # Terms as large as the torque cancel in p dT/dp: z, the torque and dT/dz0 have no such rounding.
    scales = [np.inf, np.inf, *np.maximum(np.ravel(of), 0.01), of[0].alpha_0, np.inf]
    rounding = 1e-15 * np.abs(expected_rows[1]).max() / np.array(scales) + 1e-140
    for row, expected, least in zip(together, expected_rows, rounding, strict=True):
        np.testing.assert_allclose(row, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max() + least)


@pytest.mark.parametrize("stiffer", ["positive", "negative"])
@pytest.mark.parametrize("times", [1.0, 1e2, 1e8])
def test_signs_of_deflection_settle_whatever_the_stiffness(
    pair: Pair[float], stiffer: str, times: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After a reversal z keeps the sign of the softer direction for hundreds of samples: the result is that of some samples at a time."""
    p = getattr(pair, stiffer)
    pair = pair._replace(**{stiffer: p._replace(sigma_0=times * p.sigma_0)})
    v = slow(np.arange(2500) * 1e-3)
    whole = rollout(v, 1e-3, pair)
    monkeypatch.setattr(module, "AT_ONCE", 25)
    parts = rollout(v, 1e-3, pair)
    np.testing.assert_allclose(whole.z, parts.z, atol=1e-9 * np.abs(parts.z).max())
    np.testing.assert_allclose(whole.torque, parts.torque, atol=1e-6 * np.abs(parts.torque).max())


def test_bad_input_is_refused_in_one_sentence(gripper: Lugre[float]) -> None:
    """Wrong shapes, values that are not finite and steps that are not positive are ValueErrors that name what was got."""
    v, step = np.zeros(3), np.array([1e-3])
    with pytest.raises(ValueError, match="velocity has shape"):
        rollout(np.zeros((2, 2)), 1e-3, gripper)
    with pytest.raises(ValueError, match="not finite"):
        rollout(np.array([0.0, np.nan]), 1e-3, gripper)
    with pytest.raises(ValueError, match="expected one positive number or 2"):
        rollout(v, step, gripper)
    with pytest.raises(ValueError, match="not positive"):
        rollout(v, np.array([1e-3, -1e-3]), gripper)


STEP = 2e-3


def motion() -> Array:
    """Two reversals, one of them between samples, at low and at high speed."""
    t = np.arange(300) * STEP
    v: Array = 0.06 * np.sin(2 * np.pi * 1.7 * t) + 0.01
    return v


def test_jacobian_from_the_steady_start_equals_differences(table_set: Lugre[float]) -> None:
    """Each column is the central difference of the torque, the steady start included."""
    p = table_set._replace(v_s=0.12345)  # a value at which no node comes or goes
    by = rollout_jacobian(motion(), STEP, p).by_parameters
    for k, (name, x) in enumerate(p._asdict().items()):
        up, down = (rollout(motion(), STEP, p._replace(**{name: x + d})).torque for d in (1e-6 * x, -1e-6 * x))
        numeric = (up - down) / (2e-6 * x)
        np.testing.assert_allclose(by[:, k], numeric, atol=1e-6 * np.abs(numeric).max())


def test_derivatives_by_the_start_and_of_a_pair(gripper: Lugre[float], pair: Pair[float]) -> None:
    """dT_f/dz0 is exact: T_f is affine in z0, so one difference of any size gives it; it fades as the bristle slides."""
    v = np.concatenate([motion(), np.full(3000, 0.5)])
    first, second = (rollout(v, STEP, gripper, z0).torque for z0 in (0.0, 1e-3))
    by_z0 = rollout_jacobian(v, STEP, gripper, 0.0).by_z0
    np.testing.assert_allclose(by_z0, (second - first) / 1e-3, atol=1e-9 * gripper.sigma_0)
    assert by_z0[0] == pytest.approx(
        gripper.sigma_0 * (1 - gripper.sigma_1 * v[0] / float(law.stribeck(v[0], gripper))), rel=1e-12
    )
    assert np.abs(by_z0[-1]) < 1e-100
    # CasADi's own derivative of its own `mapaccum` of the same step, whose reversals fall on samples, is the same
    n = 101
    v = 0.02 * np.sin(2 * np.pi * np.arange(n) / 50)
    v[::25] = 0.0
    z, v0, v1, p = ca.SX.sym("z"), ca.SX.sym("v0"), ca.SX.sym("v1"), ca.SX.sym("p", 6)
    a, b = law.bristle_step(v0, v1, STEP, Lugre(*ca.vertsplit(p)))
    following = a * z + b
    step = ca.Function("step", [z, v0, v1, p], [following, law.torque(following, v1, Lugre(*ca.vertsplit(p)))])
    q = ca.MX.sym("q", 6)
    torque = step.mapaccum(n - 1)(1e-3, v[None, :-1], v[None, 1:], ca.repmat(q, 1, n - 1))[1].T
    theirs = np.array(ca.Function("J", [q], [ca.jacobian(torque, q)])(ca.DM(list(gripper))))
    ours = rollout_jacobian(v, STEP, gripper, z0=1e-3).by_parameters
    np.testing.assert_allclose(ours[1:], theirs, rtol=1e-9, atol=1e-12 * np.abs(theirs).max())
    # with equal directions the pair's torque is the set's, and its two sets of columns add up to the set's columns
    one, two = rollout_jacobian(motion(), STEP, gripper), rollout_jacobian(motion(), STEP, Pair(gripper, gripper))
    np.testing.assert_allclose(two.torque, one.torque, atol=1e-5 * np.abs(one.torque).max())
    total = two.by_parameters[:, :6] + two.by_parameters[:, 6:]
    np.testing.assert_allclose(total, one.by_parameters, atol=1e-4 * np.abs(one.by_parameters).max())
    # no sample gives (0, 6) or (0, 12); one sample gives the derivative of the steady torque (9), zero for sigma_0 and sigma_1
    assert rollout_jacobian(np.zeros(0), STEP, pair.positive).by_parameters.shape == (0, 6)
    assert rollout_jacobian(np.zeros(0), STEP, pair).by_parameters.shape == (0, 12)
    row = rollout_jacobian(np.array([-0.05]), STEP, pair).by_parameters[0]
    shape = np.exp(-((0.05 / pair.negative.v_s) ** 2))
    slope = -pair.negative.alpha_1 * shape * 2 * 0.05**2 / pair.negative.v_s**3
    np.testing.assert_allclose(row[6:], [-1, -shape, -0.05, slope, 0, 0], atol=1e-12)
    np.testing.assert_array_equal(row[:6], np.zeros(6))


UNARY: dict[str, Callable[[Any], Any]] = {
    **{f.__name__: f for f in (ca.exp, ca.expm1, ca.sin, ca.cos, ca.tan, ca.atan, ca.sinh, ca.cosh, ca.tanh, ca.asinh)},
    **{f.__name__: f for f in (ca.erf, ca.fabs, ca.sign, ca.floor, ca.ceil)},
    "log": lambda x: ca.log(ca.fabs(x) + 0.1), "log1p": lambda x: ca.log1p(ca.fabs(x)), "sqrt": lambda x: ca.sqrt(ca.fabs(x)),
    "sq": lambda x: x**2, "cube": lambda x: x**3, "constpow": lambda x: (ca.fabs(x) + 0.1) ** 2.5, "twice": lambda x: 2 * x,
    "inv": lambda x: 1 / (x + 10), "neg": lambda x: -x, "asin": lambda x: ca.asin(x / 4), "acos": lambda x: ca.acos(x / 4),
    "acosh": lambda x: ca.acosh(x + 5), "atanh": lambda x: ca.atanh(x / 4), "not": lambda x: ca.logic_not(x > 0),
}  # fmt: skip  # a table
BINARY: dict[str, Callable[[Any, Any], Any]] = {
    **{f.__name__: f for f in (ca.atan2, ca.hypot, ca.copysign, ca.fmod, ca.fmin, ca.fmax)},
    "add": lambda x, y: x + y, "sub": lambda x, y: x - y, "mul": lambda x, y: x * y, "div": lambda x, y: x / (y + 10),
    "pow": lambda x, y: (ca.fabs(x) + 0.1) ** y, "lt": lambda x, y: x < y, "le": lambda x, y: x <= y,
    "eq": lambda x, y: ca.floor(x) == ca.floor(y), "ne": lambda x, y: ca.floor(x) != ca.floor(y),
    "and": lambda x, y: ca.logic_and(x > 0, y > 0), "or": lambda x, y: ca.logic_or(x > 0, y > 0),
    "if_else": lambda x, y: ca.if_else(x < y, ca.exp(x), y), "if_else_zero": lambda x, y: ca.if_else(x < y, 1 / x, 0),
}  # fmt: skip  # a table
X, Y = ca.SX.sym("x"), ca.SX.sym("y")
rng = np.random.default_rng(1)
VALUES = np.concatenate([rng.uniform(-3, 3, 40), [0.0, 1.0, -1.0, 2.0, 3.0]])
OTHERS = rng.permutation(VALUES)


def by_casadi(function: ca.Function, *columns: np.ndarray) -> list[np.ndarray]:
    outputs = function.map(columns[0].size).call([ca.DM(c).T for c in columns])
    return [np.array(output.full()).ravel() for output in outputs]


def both_routes(function: ca.Function, *inputs: np.ndarray) -> list[Sequence[np.ndarray]]:
    """Our evaluation as small inputs get it, and through blocks and buffers as large ones do."""
    shape = np.broadcast_shapes(*(x.shape for x in inputs))
    out = [np.empty(shape) for _ in range(function.n_out())]
    with np.errstate(all="ignore"):
        return [evaluate(function, *inputs), vectorised(function)(*inputs, out=out)]


def far(function: ca.Function, *inputs: np.ndarray, rtol: float = 1e-13, atol: float = 1e-15) -> bool:
    """Whether an output is not CasADi's, by one of the two routes."""
    theirs = by_casadi(function, *(np.ascontiguousarray(x) for x in np.broadcast_arrays(*inputs)))
    same = (
        np.allclose(a, b, rtol, atol, equal_nan=True)
        for x in both_routes(function, *inputs)
        for a, b in zip(x, theirs, strict=True)
    )
    return not all(same)


def test_every_operation_and_its_derivatives_equal_casadi() -> None:
    """Elementary functions of one argument and of two, both arrays and either a scalar, and the operations in their derivatives."""
    wrong = []
    for name, one in UNARY.items():
        expression = one(X)
        wrong += [name] * far(ca.Function("f", [X], [expression, ca.densify(ca.jacobian(expression, X))]), VALUES)
    for name, two in BINARY.items():
        expression = ca.densify(two(X, Y))
        gradient = ca.densify(ca.jacobian(expression, ca.vertcat(X, Y)))
        function = ca.Function("f", [X, Y], [expression, gradient[0], gradient[1]])
        pairs = ((VALUES, OTHERS), (VALUES, np.array(0.7)), (np.array(-1.3), OTHERS))
        wrong += [name for x, y in pairs if far(function, x, y)]
    assert wrong == []


leaves = st.sampled_from([X, Y, ca.SX(0.5), ca.SX(-2)])
trees = st.recursive(
    leaves,
    lambda inner: st.one_of(
        st.tuples(st.sampled_from([ca.sin, ca.tanh, ca.fabs, ca.sign, ca.floor]), inner).map(lambda t: t[0](t[1])),
        st.tuples(st.sampled_from(["add", "sub", "mul", "atan2", "fmin", "lt", "if_else_zero"]), inner, inner).map(
            lambda t: BINARY[t[0]](t[1] + 2, t[2]) if t[0] == "if_else_zero" else BINARY[t[0]](t[1], t[2])
        ),
    ),
    max_leaves=12,
)


@given(first=trees, second=trees)
def test_any_expression_equals_casadi(first: Any, second: Any) -> None:
    """Registers are shared without one value overwriting another that is still needed, whatever the expression, also across outputs."""
    function = ca.Function("f", [X, Y], [first, first * second, ca.SX(second), X])
    assert not far(function, VALUES, OTHERS, rtol=1e-12, atol=1e-13)


def test_shapes_blocks_and_refusals(monkeypatch: pytest.MonkeyPatch) -> None:
    """A column and a row give a table; constants, structural zeros and inputs come out as wide; scalars give zero-dimensional arrays."""
    function = ca.Function("f", [X, Y], [X + Y, ca.SX(3.0), ca.SX(1, 1), X, X + Y])
    x, y = np.arange(3.0)[:, None], np.arange(4.0)[None, :]
    for outputs in both_routes(function, x, y):
        total, three, nothing, same, again = outputs
        assert not any(np.shares_memory(a, b) for a, b in combinations((*outputs, x, y), 2))
        expected = np.broadcast_arrays(x + y, x + y, 3.0, 0.0, x)
        np.testing.assert_array_equal([total, again, three, nothing, same], expected)
    assert [o.shape for o in evaluate(function, 1.0, 2.0)] == [()] * 5
    assert [o.shape for o in evaluate(function, np.zeros(0), 2.0)] == [(0,)] * 5
    # vectors, unknown operations, wrong numbers of inputs and shapes that do not broadcast are ValueErrors that say what was expected
    vector = ca.SX.sym("vector", 2)
    with pytest.raises(ValueError, match="expected 1x1 each"):
        vectorised(ca.Function("f", [vector], [vector[0]]))
    with pytest.raises(ValueError, match="no NumPy counterpart"):
        vectorised(ca.Function("f", [X, Y], [ca.remainder(X, Y)]))
    function = ca.Function("f", [X, Y], [X + Y])
    with pytest.raises(ValueError, match="got 1 inputs; expected 2"):
        evaluate(function, VALUES)
    with pytest.raises(ValueError, match="broadcast"):
        evaluate(function, np.zeros(3), np.zeros(4))
    # the result does not depend on the block size, and `out` receives it
    function = ca.Function("f", [X, Y], [ca.exp(X) * Y, ca.sin(X + Y)])
    x, y = rng.normal(size=(2, 1000))
    expected = np.array(evaluate(function, x, y))
    for block in (1, 7, 999, 1000, 1001):
        monkeypatch.setattr(vectorize, "_BLOCK", block)
        out = np.empty((2, 1000))
        vectorised(function)(x, y, out=list(out))
        np.testing.assert_array_equal(out, expected)


finite = st.floats(-1, 1, allow_subnormal=False)


@given(data=st.data(), n=st.integers(0, 40), m=st.integers(1, 4))
def test_scan_equals_the_plain_loop(data: st.DataObject, n: int, m: int) -> None:
    """z[k + 1] = a[k] z[k] + b[k], for one recurrence and for several that share a."""
    a = data.draw(hnp.arrays(float, n, elements=finite))
    b = data.draw(hnp.arrays(float, (m, n), elements=finite))
    z0 = data.draw(hnp.arrays(float, m, elements=finite))
    expected = np.empty((m, n + 1))
    expected[:, 0] = z0
    for k in range(n):
        expected[:, k + 1] = a[k] * expected[:, k] + b[:, k]
    np.testing.assert_allclose(scan(a, b, z0), expected, rtol=1e-14, atol=1e-14)
    np.testing.assert_allclose(scan(a, b[0], z0[0]), expected[0], rtol=1e-14, atol=1e-14)
