"""Direction-dependent sets: torque is continuous, the bristle gives back no more than it took; and passivity of single sets."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from bristle.arrays import Array
from bristle.model import functions, law
from bristle.model.law import is_passive
from bristle.model.parameters import Lugre, Pair
from bristle.model.rollout import rollout
from bristle.model.vectorize import evaluate
from bristle.simulation.edro import TABLE_1

GRIPPER = TABLE_1["gripper rotation"]


def acting_torque(z: float, v: float, pair: Pair[float]) -> float:
    """T_f at a point of the plane (z, v)."""
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


def test_stiff_pair_takes_the_side_it_moves_to(pair: Pair[float]) -> None:
    """However stiff, one sample after a reversal T_f is the steady torque of the new direction."""
    stiff = Pair(*(p._replace(sigma_0=1e7 * p.sigma_0, sigma_1=0.0) for p in pair))
    v = np.array([-0.05, -0.05, 0.05, 0.05, -0.05])
    torque = rollout(v, 1e-3, stiff).torque
    expected = [float(law.steady_torque(u, stiff.positive if u > 0 else stiff.negative)) for u in v]
    np.testing.assert_allclose(torque, expected, rtol=1e-3)


def test_only_a_set_that_is_not_passive_can_push_forward(table_set: Lugre[float]) -> None:
    """A full bristle at sudden high speed opposes motion in every passive set, and drives it in base rotation (-).

    There alone alpha_2 is not beyond sigma_1 alpha_1 / alpha_0, 0.134 < 0.248 (docs/paper.md).
    """
    p = table_set
    v = np.geomspace(0.1, 1e4, 200)
    full = np.full(v.size, (p.alpha_0 + p.alpha_1) / p.sigma_0)
    (torque,) = evaluate(functions.torque_function(), full, v, *p)
    assert bool(np.all(torque > 0)) == is_passive(p) == (p != TABLE_1["base rotation"].negative)
    least = p.sigma_1 * p.alpha_1 / p.alpha_0
    assert is_passive(p) or (round(p.alpha_2, 3), round(least, 3)) == (0.134, 0.248)


def test_work_is_stored_or_lost(gripper: Lugre[float]) -> None:
    """Energy balance: the work on the spring is the change of sigma_0 z^2 / 2 plus what relaxation loses, lambda sigma_0 z^2."""
    h = 1e-4
    t = np.arange(20001) * h
    v = 0.1 * np.sin(2 * np.pi * t) + 0.04 * np.sin(2 * np.pi * 2.7 * t)
    z = rollout(v, h, gripper, z0=0.0).z
    g = gripper.alpha_0 + gripper.alpha_1 * np.exp(-((v / gripper.v_s) ** 2))
    lost = integral(gripper.sigma_0**2 * np.abs(v) / g * z**2, h)
    taken = integral(gripper.sigma_0 * z * v, h)
    np.testing.assert_allclose(taken, 0.5 * gripper.sigma_0 * z**2 + lost, atol=1e-6 * taken.max())
