import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bristle.estimation import covariance as uncertainty
from bristle.estimation.covariance import covariance as fitted_covariance
from bristle.estimation.linear import best_column_p_value
from bristle.findings import CAUTION, Finding
from bristle.identification.static.batch import COARSE, Batch
from bristle.identification.static.grid import Projected, default_range
from bristle.identification.static.problem import from_points
from bristle.model.parameters import Lugre, Pair, ParameterName, Stribeck
from bristle.model.rollout import rollout
from bristle.simulation.bench import steady_points
from bristle.simulation.edro import TABLE_1
from bristle.simulation.fisher import (
    Information,
    covariance,
    gram,
    motion_jacobian,
    names_of,
    static_information,
    static_jacobian,
)

PAIR = TABLE_1["gripper rotation"]
P = PAIR.positive
V = np.geomspace(0.15 * P.v_s, 0.8, 12)
NOISE = 2e-4


def test_information_is_the_inverse_of_what_fits_show() -> None:
    """The derivatives of (9) are sgn(v), exp(-(v / v_s)**2) sgn(v), v, and 2 alpha_1 v**2 / v_s**3 exp(-(v / v_s)**2) sgn(v)."""
    v = np.concatenate([V, -V])
    s, peak = np.sign(v), np.exp(-((v / P.v_s) ** 2))
    exact = np.column_stack([s, s * peak, v, 2 * P.alpha_1 * v**2 / P.v_s**3 * peak * s])
    np.testing.assert_allclose(static_jacobian(v, P), exact, rtol=1e-12, atol=1e-15)
    # with the scatter that a fit leaves, the inverse of the information is the covariance that the fit itself reports
    jacobian = static_jacobian(V, P)
    cost = 3e-7
    own, _ = fitted_covariance(jacobian, cost)
    errors, correlation = covariance(static_information(V, P, np.sqrt(cost / (V.size - 4))))
    np.testing.assert_allclose(errors, np.sqrt(np.diag(own)), rtol=1e-9)
    np.testing.assert_allclose(correlation, own / np.outer(errors, errors), atol=1e-9)
    # 2000 simulated fits scatter as the information says, each parameter within a tenth
    torques = steady_points(P, V, NOISE, np.random.default_rng(0), 2000)
    theta = Batch(from_points(V, torques[0], ("both",)), torques.T, default_range(V), COARSE).theta
    spread = theta.std(axis=1)
    expected = covariance(static_information(V, P, NOISE))[0]
    order = [0, 2, 1, 3]  # the fit has alpha_2 before alpha_1
    np.testing.assert_allclose(spread[order], expected, rtol=0.1)
    # of a pair the positive velocities see the positive set alone, and the other way round
    matrix = static_information(np.concatenate([V, -V]), PAIR, NOISE)
    assert names_of(PAIR)[3:7] == tuple(map(ParameterName.parse, ("v_s+", "sigma_0+", "sigma_1+", "alpha_0-")))
    assert not matrix[:4, 4:].any()
    np.testing.assert_allclose(matrix[:4, :4], static_information(V, P, NOISE), rtol=1e-12)
    np.testing.assert_allclose(matrix[4:, 4:], static_information(-V, PAIR.negative, NOISE), rtol=1e-12)
    # along a constant velocity with a settled bristle a motion's information is that of its samples as static points; sigma is not seen
    for v in (0.5 * P.v_s, 3 * P.v_s, -P.v_s):
        moving = gram(motion_jacobian(np.full(50, v), 1e-3, P), NOISE)
        static = static_information(np.full(50, v), P, NOISE)
        np.testing.assert_allclose(moving[:4, :4], static, rtol=1e-8)
        assert np.abs(moving[4:]).max() <= 1e-9 * np.abs(static).max()
    # with alpha_1 = 0 nothing depends on v_s, in a motion as at constant velocities
    flat = P._replace(alpha_1=0.0)
    t = 1e-3 * np.arange(2001)
    for matrix in (
        static_information(V, flat, NOISE),
        gram(motion_jacobian(np.cos(6 * t), 1e-3, flat), NOISE),
        gram(motion_jacobian(np.cos(6 * t), 1e-3, Pair(flat, PAIR.negative)), NOISE)[:6, :6],
    ):
        assert covariance(matrix)[0][3] == np.inf
    assert np.isfinite(covariance(static_information(V, P, NOISE))[0]).all()
    # where all speeds are far below v_s, alpha_0 and alpha_1 are seen as a sum only, and that is said
    v = np.linspace(1e-3, 2e-3, 10) * P.v_s
    names = tuple(map(ParameterName.parse, Stribeck._fields))
    info = Information(names=names, point=np.ones(4), matrix=static_information(v, P, NOISE))
    assert {"alpha_0", "alpha_1"} in [{*map(str, d.numbers["all"])} for d in info.unseen if d.code == "only-as-sum"]


def test_jacobians_of_motions_and_covariances_of_lines() -> None:
    """Each column is the central difference of the simulated torque, and an extra column is itself."""
    t = 1e-3 * np.arange(3001)
    v, a = 0.3 * np.cos(6 * t), -1.8 * np.sin(6 * t)
    jacobian = motion_jacobian(v, 1e-3, P, {"inertia": a})
    np.testing.assert_array_equal(jacobian[:, 6], a)
    for k, name in enumerate(Lugre._fields):
        h = 1e-5 * P[k]
        up, down = (rollout(v, 1e-3, P._replace(**{name: P[k] + s * h})).torque for s in (1, -1))
        np.testing.assert_allclose(jacobian[:, k], (up - down) / (2 * h), atol=1e-5 * np.abs(jacobian[:, k]).max())
    # a column of zeros, and two equal columns, have infinite standard errors; a column apart from them keeps its own
    rng = np.random.default_rng(1)
    x, y = rng.normal(size=(2, 30))
    matrix = gram(np.column_stack([x, y, y, np.zeros(30)]), 1.0)
    info = Information(names=tuple(map(ParameterName.parse, "abcd")), point=np.ones(4), matrix=matrix)
    assert info.standard_errors[1:].tolist() == [np.inf] * 3
    assert np.isfinite(info.standard_errors[0])
    assert np.isfinite(info.correlation).all()
    nothing, hardly = info.unseen
    assert nothing == Finding("nothing-seen-of", CAUTION, "d is not identifiable.")
    assert nothing.numbers == {"name": ParameterName.parse("d")}
    assert hardly.code == "only-as-sum"
    assert set(map(str, hardly.numbers["all"])) == {"b", "c"}
    with pytest.raises(ValueError, match="read-only"):
        info.matrix[0, 0] = 0.0
    # residuals correlated over tau samples count as n / tau points: the variance grows by tau, freedom shrinks by it
    design = np.random.default_rng(1).standard_normal((100, 3))
    plain, _ = uncertainty.covariance(design, 2.0)
    wide, freedom = uncertainty.covariance(design, 2.0, 4.0)
    assert wide == pytest.approx(4 * plain)
    assert freedom == pytest.approx(100 / 4 - 3)


@given(st.integers(1, 6), st.integers(0, 2**32 - 1))
def test_covariance_is_the_inverse(size: int, seed: int) -> None:
    """Of any information that has an inverse, errors and correlation are those of the inverse, in any units."""
    rng = np.random.default_rng(seed)
    matrix = gram(rng.normal(size=(size + 5, size)), 1.0)
    units = 10 ** rng.uniform(-6, 6, size)
    errors, correlation = covariance(matrix * np.outer(units, units))
    inverse = np.linalg.inv(matrix)
    np.testing.assert_allclose(errors * units, np.sqrt(np.diag(inverse)), rtol=1e-7)
    np.testing.assert_allclose(correlation, inverse / np.sqrt(np.outer(np.diag(inverse), np.diag(inverse))), atol=1e-6)


def test_p_value_is_uniform_where_there_is_no_peak() -> None:
    """Without a Stribeck term the p-value falls below any level about that often: at 5 % and 20 %, over 400 sets, within 3 binomial deviations."""
    rng, speeds = np.random.default_rng(4), np.geomspace(0.15 * P.v_s, 0.8, 16)
    flat = 0.02 + 0.04 * speeds
    values = np.geomspace(*default_range(speeds), 48)
    p_values = []
    for _ in range(400):
        problem = from_points(speeds, flat + 1e-4 * rng.standard_normal(speeds.size), ("both",))
        projected = Projected(problem)
        off, length = projected.off(values)
        cost = projected.costs(values).min()
        p_values.append(best_column_p_value(off, length, projected.q, (projected.base_cost - cost) / cost, draws=1000))
    for level in (0.05, 0.20):
        seen = np.mean(np.array(p_values) <= level)
        assert abs(seen - level) <= 3 * np.sqrt(level * (1 - level) / 400) + 0.002
