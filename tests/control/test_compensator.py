"""Compensators and adaptation: identities of the laws, two routes to one torque, and what no input may break."""

from dataclasses import replace
from itertools import product

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bristle.control import adaptation as adapting
from bristle.control.adaptation import LAWS, STEPS, Adaptation, Learnt, gradient, learn, printed
from bristle.control.compensator import NAMES, Compensator, Measurement, Reference, compiled, initial_state, step
from bristle.model import functions, law
from bristle.model.parameters import Lugre, Pair
from bristle.model.rollout import rollout

from .conftest import PAIR, H, P, follow

ANY = st.floats(-1e300, 1e300) | st.sampled_from([np.nan, np.inf, -np.inf])


def number(x: object) -> float:
    """What CasADi made of numbers, as a float."""
    return float(ca.DM(x))  # type: ignore[call-overload]  # a number, of CasADi or Python


def torque_of(name: str, z: float, v: float) -> float:
    """The derivative of T_f by one parameter at given z, by CasADi."""
    out = functions.torque_sensitivity_function()(z, v, *P)
    return number(out[2 + Lugre._fields.index(name)])


@pytest.mark.parametrize(("v", "z"), [(0.03, 0.003), (-0.1, -0.002), (0.5, 0.003)])
def test_printed_is_the_derivative_by_alpha_1(v: float, z: float) -> None:
    """(19) as typeset equals dT_f / d alpha_1 and not d alpha_0, from which it differs by exp(-(v / v_s)**2); (20) is dT_f / d alpha_2."""
    assert number(printed("alpha_0", z, v, P)) == pytest.approx(torque_of("alpha_1", z, v), rel=1e-12)
    assert number(printed("alpha_0", z, v, P)) == pytest.approx(
        torque_of("alpha_0", z, v) * np.exp(-((v / P.v_s) ** 2)), rel=1e-12
    )
    assert number(printed("alpha_2", z, v, P)) == pytest.approx(torque_of("alpha_2", z, v), rel=1e-12)


@pytest.mark.parametrize("v", [0.02, -0.02, 0.3, -0.3])
def test_laws_in_steady_sliding(v: float) -> None:
    """There the total derivative by alpha_0 is sgn(v), the partial one sigma_1 abs(v) / g sgn(v), and that by theta alpha_0 times the partial."""
    z, g = float(ca.DM(law.steady_deflection(v, P))), float(ca.DM(law.stribeck(v, P)))
    dz = float(ca.DM(functions.steady_deflection_function()(v, *P)[1]))
    learnt = Learnt((1.0, 1.0), (P.alpha_0 * dz, 0.0), ())
    found = {name: gradient(Adaptation(law=name), z, v, P, learnt) for name in LAWS}
    assert number(found["total"][0]) == pytest.approx(np.sign(v), rel=1e-12)
    assert number(found["partial"][0]) == pytest.approx(P.sigma_1 * abs(v) / g * np.sign(v), rel=1e-9)
    assert number(found["partial-theta"][0]) == pytest.approx(P.alpha_0 * number(found["partial"][0]), rel=1e-12)
    assert all(
        number(G[1]) == pytest.approx(v * (P.alpha_2 if name == "partial-theta" else 1.0)) for name, G in found.items()
    )


@pytest.mark.parametrize("name", NAMES)
def test_a_load_is_coulomb_friction(name: str) -> None:
    """Under a constant load every compensator gives what it gives of a joint whose alpha_0 is larger by the level, to rounding."""
    compensator, more = Compensator(name=name), Pair(*(law.loaded(p, 0.004) for p in PAIR))  # type: ignore[arg-type]  # a name
    run, one, other = compiled(compensator), initial_state(compensator, PAIR), initial_state(compensator, more)
    for k, speed in enumerate((0.3 * np.sin(np.arange(0, 3, 0.01))).tolist()):
        r, m = Reference(1e-3 * k, speed, 0.0), Measurement(1e-3 * k + 1e-4, speed)
        one, T = run(one, r._replace(level=0.004), m, H)
        other, expected = run(other, r, m, H)
        assert pytest.approx(expected, rel=1e-12, abs=1e-15) == T
    assert one.parameters == PAIR


@pytest.mark.parametrize("how", LAWS)
def test_a_load_is_not_adapted(how: str) -> None:
    """A gain scales alpha_0 alone: where that starts at half of the joint's, a gain of 2 gives the joint's torque under any load.

    G by alpha_0 is then that of the joint itself, but where a law's own has the start in it.
    """
    a = Adaptation(law=how, gamma=(0.0, 0.0))  # type: ignore[arg-type]  # a law
    half = P._replace(alpha_0=P.alpha_0 / 2)
    acting = adapting.effective(half, a, (2.0, 1.0), 0.01)
    assert number(law.torque(2e-3, 0.2, acting)) == pytest.approx(
        number(law.torque(2e-3, 0.2, law.loaded(P, 0.01))), rel=1e-14
    )
    scale = 2.0 if how == "partial-theta" else 1.0
    if how != "printed":
        G = gradient(a, 2e-3, 0.2, half, Learnt((2.0, 1.0), (0.0, 0.0), ()), 0.01)
        expected = gradient(a, 2e-3, 0.2, P, Learnt((1.0, 1.0), (0.0, 0.0), ()), 0.01)
        assert scale * number(G[0]) == pytest.approx(number(expected[0]), rel=1e-12)


def test_a_load_that_moves_is_followed_as_in_the_rollout() -> None:
    """Along a level that changes, the feed-forward is the rollout with that level: the mean difference falls in proportion to the period."""
    off = []
    for h in (2e-3, 1e-3):
        t = np.arange(0, 4, h)
        v, level = 0.3 * np.sin(3 * t), 0.004 * np.abs(np.sin(2 * t))
        state, run, T = initial_state(Compensator(), PAIR), compiled(Compensator()), []
        for speed, more in zip(v.tolist(), level.tolist(), strict=True):
            state, one = run(state, Reference(0.0, speed, 0.0, level=more), Measurement(0.0, speed), h)
            T.append(one)
        off.append(float(np.abs(np.array(T) - rollout(v, h, PAIR, 0.0, level=level).torque).mean()))
    assert off[1] < 1e-3 * P.alpha_0
    assert off[1] / off[0] < 0.6


def motion(n: int = 3000) -> np.ndarray:
    """A velocity from rest, with reversals."""
    t = H * np.arange(n)
    v: np.ndarray = 0.3 * np.sin(2 * np.pi * 0.7 * t) + 0.1 * np.sin(2 * np.pi * 2.3 * t)
    return v


def test_feed_forward_is_the_rollout_of_the_reference() -> None:
    """Sample by sample, the paper's compensator gives what `rollout` gives over the whole of the reference velocity, to the error of two steps."""
    v = motion()
    _, torque = follow(Compensator(), v)
    expected = rollout(v, H, PAIR, 0.0).torque
    assert np.abs(torque - expected).max() < 2e-3 * np.abs(expected).max()


@pytest.mark.parametrize("names", [("alpha_0", "alpha_2"), ("sigma_0", "v_s", "alpha_1")])
def test_sensitivity_beside_the_bristle_is_that_of_another_gain(names: tuple[str, ...]) -> None:
    """The total law's dz / d theta equals the difference of two runs whose parameters, of both directions, differ by a little."""
    v = motion(700)
    base = Adaptation(law="total", parameters=names, gamma=(0.0,) * len(names))
    state, _ = follow(Compensator(adaptation=base), v)
    for k, name in enumerate(names):
        ends = []
        for factor in (1 + 1e-6, 1 - 1e-6):
            pair = Pair(*(p._replace(**{name: factor * getattr(p, name)}) for p in PAIR))
            run, own = compiled(Compensator()), initial_state(Compensator(), pair)
            for speed in v.tolist():
                own, _ = run(own, Reference(0.0, speed, 0.0), Measurement(0.0, speed), H)
            ends.append(own.deflection)
        assert state.learnt.sensitivity[k] == pytest.approx((ends[0] - ends[1]) / 2e-6, rel=1e-4, abs=1e-10)


def test_a_gain_that_is_not_wrong_stays() -> None:
    """Without a position error nothing is learnt; outside the dead zone the gains move down the error's sign, inside they do not."""
    v = motion(400)
    for way in LAWS:
        state, _ = follow(Compensator(adaptation=Adaptation(law=way)), v)
        assert state.learnt.theta == (1.0, 1.0)
    slide = np.full(300, 0.4)
    up, _ = follow(Compensator(adaptation=Adaptation()), slide, e=-0.01)
    down, _ = follow(Compensator(adaptation=Adaptation()), slide, e=0.01)
    still, _ = follow(Compensator(adaptation=Adaptation(dead_zone=0.02)), slide, e=0.01)
    assert up.learnt.theta[1] > 1 > down.learnt.theta[1]
    assert still.learnt.theta == (1.0, 1.0)


def test_least_squares_keeps_its_matrix_positive() -> None:
    """P of least squares stays symmetric and positive, and its trace no larger than it began, with and without forgetting."""
    for forgetting in (0.0, 5.0):
        a = Adaptation(step="least-squares", forgetting=forgetting, gamma=(50.0, 200.0))
        learnt, rng = adapting.nothing_learnt(a), np.random.default_rng(0)
        for _ in range(300):
            G = tuple(rng.standard_normal(2) * 10)
            learnt = learn(a, learnt, G, 0.01, 1e-2)
            learnt = Learnt(*(tuple(map(number, part)) for part in learnt))
            matrix = np.reshape(learnt.covariance, (2, 2))
            np.testing.assert_allclose(matrix, matrix.T, rtol=1e-9, atol=1e-12)
            assert np.linalg.eigvalsh(matrix).min() > 0
            assert np.trace(matrix) <= 250 * (1 + 1e-12)


@settings(max_examples=1000, deadline=None)
@given(
    st.sampled_from(list(product(LAWS, STEPS))), st.lists(st.tuples(ANY, ANY, ANY), min_size=1, max_size=4),
    st.floats(0, 1e6), st.floats(1e-6, 10.0),
)  # fmt: skip  # a list of strategies
@pytest.mark.slow
def test_gains_stay_within_their_limits_whatever_comes(
    way: tuple[adapting.Law, adapting.Step], samples: list[tuple[float, float, float]], gamma: float, h: float
) -> None:
    """For any law, step, rate and sampling, and any signals, infinite and undefined ones too, every gain is finite and within its limits."""
    a = Adaptation(law=way[0], step=way[1], gamma=(gamma, gamma), limits=(0.2, 4.0))
    run, state = compiled(Compensator(adaptation=a)), initial_state(Compensator(adaptation=a), PAIR)
    for position, speed, measured in samples:
        state, _ = run(state, Reference(position, speed, 0.0), Measurement(measured, speed), h)
        assert all(0.2 <= theta <= 4.0 for theta in state.learnt.theta)


@pytest.mark.parametrize("name", NAMES)
def test_one_step_is_the_same_with_numbers_symbols_and_compiled(name: str) -> None:
    """With floats, and compiled from symbols, a step of every compensator gives one torque and one state."""
    c = Compensator(name=name, inertia=0.01, share=0.8, adaptation=Adaptation() if name.startswith("lugre") else None)  # type: ignore[arg-type]
    state = initial_state(c, PAIR, 0.1)
    for velocity in (0.2, None):
        r, m = Reference(0.1, 0.3, 0.5), Measurement(0.11, velocity)
        plain, T = step(c, state, r, m, H)
        other, same = compiled(c, velocity=velocity is not None)(state, r, m, H)
        assert number(T) == pytest.approx(same, rel=1e-12)
        assert number(plain.deflection) == pytest.approx(other.deflection, rel=1e-12, abs=1e-300)
        assert [number(x) for x in plain.learnt.theta] == pytest.approx(other.learnt.theta)


def test_bad_compensators_are_refused() -> None:
    """An unknown name, adaptation where there is no bristle, a share below zero and a softness of zero are refused."""
    with pytest.raises(ValueError, match="compensator: got 'dahl'; expected one of none, coulomb"):
        Compensator(name="dahl")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="coulomb cannot adapt"):
        Compensator(name="coulomb", adaptation=Adaptation())
    with pytest.raises(ValueError, match="share: got -1"):
        replace(Compensator(), share=-1.0)
    with pytest.raises(ValueError, match="softness: got 0; expected a positive number"):
        Compensator(softness=0.0)
