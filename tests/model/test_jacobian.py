"""The rollout's Jacobian is the exact derivative of the rollout."""

import casadi as ca
import numpy as np
import pytest

from bristle.arrays import Array
from bristle.model import law
from bristle.model.parameters import Lugre, Pair
from bristle.model.rollout import rollout, rollout_jacobian

STEP = 2e-3


def motion() -> Array:
    """Two reversals, one of them between samples, at low and at high speed."""
    t = np.arange(300) * STEP
    v: Array = 0.06 * np.sin(2 * np.pi * 1.7 * t) + 0.01
    return v


def difference(velocity: Array, p: Lugre[float], k: int, z0: float | None) -> Array:
    """Central difference of the torque with respect to parameter k."""
    d = 1e-6 * p[k]
    up, down = (
        rollout(velocity, STEP, Lugre(*(x + s * d * (j == k) for j, x in enumerate(p))), z0).torque for s in (1, -1)
    )
    return (up - down) / (2 * d)


@pytest.mark.parametrize("z0", [None, 1e-3])
def test_jacobian_equals_finite_differences(table_set: Lugre[float], z0: float | None) -> None:
    """Each column is the derivative of the torque, the steady start included where z0 is not given."""
    p = table_set._replace(v_s=0.12345)  # a value at which no node comes or goes
    result = rollout_jacobian(motion(), STEP, p, z0)
    for k in range(6):
        numeric = difference(motion(), p, k, z0)
        np.testing.assert_allclose(result.by_parameters[:, k], numeric, atol=1e-6 * np.abs(numeric).max())


def test_derivative_by_the_start(gripper: Lugre[float]) -> None:
    """dT_f/dz0 is exact: T_f is affine in z0, so one difference of any size gives it; it fades as the bristle slides."""
    v = np.concatenate([motion(), np.full(3000, 0.5)])
    first, second = (rollout(v, STEP, gripper, z0).torque for z0 in (0.0, 1e-3))
    by_z0 = rollout_jacobian(v, STEP, gripper, 0.0).by_z0
    np.testing.assert_allclose(by_z0, (second - first) / 1e-3, atol=1e-9 * gripper.sigma_0)
    assert by_z0[0] == pytest.approx(
        gripper.sigma_0 * (1 - gripper.sigma_1 * v[0] / float(law.stribeck(v[0], gripper))), rel=1e-12
    )
    assert np.abs(by_z0[-1]) < 1e-100


def test_jacobian_equals_that_of_mapaccum(gripper: Lugre[float]) -> None:
    """CasADi's own derivative of its own `mapaccum` of the same step, whose reversals fall on samples, is the same."""
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


def test_pair_of_equal_sets_is_the_set(gripper: Lugre[float]) -> None:
    """With equal directions the pair's torque is the set's, and its two sets of columns add up to the set's columns."""
    one, two = rollout_jacobian(motion(), STEP, gripper), rollout_jacobian(motion(), STEP, Pair(gripper, gripper))
    np.testing.assert_allclose(two.torque, one.torque, atol=1e-5 * np.abs(one.torque).max())
    total = two.by_parameters[:, :6] + two.by_parameters[:, 6:]
    np.testing.assert_allclose(total, one.by_parameters, atol=1e-4 * np.abs(one.by_parameters).max())


def test_jacobian_of_a_pair_equals_finite_differences(pair: Pair[float]) -> None:
    """For direction-dependent sets too, within what moving the switch of sigma_0 by less than a step can do."""
    flat = np.array([*pair.positive, *pair.negative])
    flat[[3, 9]] = 0.12345
    result = rollout_jacobian(motion(), STEP, Pair(Lugre(*flat[:6]), Lugre(*flat[6:])))
    for k in range(12):
        d = 1e-6 * flat[k] * (np.arange(12) == k)
        up, down = (rollout(motion(), STEP, Pair(Lugre(*q[:6]), Lugre(*q[6:]))).torque for q in (flat + d, flat - d))
        numeric = (up - down) / (2 * d[k])
        np.testing.assert_allclose(result.by_parameters[:, k], numeric, atol=2e-3 * np.abs(numeric).max())


def test_empty_and_single_sample(pair: Pair[float]) -> None:
    """No sample gives (0, 6) or (0, 12); one sample gives the derivative of the steady torque (9), zero for sigma_0 and sigma_1."""
    assert rollout_jacobian(np.zeros(0), STEP, pair.positive).by_parameters.shape == (0, 6)
    assert rollout_jacobian(np.zeros(0), STEP, pair).by_parameters.shape == (0, 12)
    row = rollout_jacobian(np.array([-0.05]), STEP, pair).by_parameters[0]
    shape = np.exp(-((0.05 / pair.negative.v_s) ** 2))
    slope = -pair.negative.alpha_1 * shape * 2 * 0.05**2 / pair.negative.v_s**3
    np.testing.assert_allclose(row[6:], [-1, -shape, -0.05, slope, 0, 0], atol=1e-12)
    np.testing.assert_array_equal(row[:6], np.zeros(6))
