"""Many sets at once: the same as one by one, errors as textbooks have them; and intervals that hold the truth as often as they say."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from bristle.arrays import Array
from bristle.estimation import covariance
from bristle.identification.moving_runs import load_columns
from bristle.identification.static.batch import Batch
from bristle.identification.static.grid import default_range, solve
from bristle.identification.static.problem import Regression, from_points
from bristle.identification.static.profiles import profiled
from bristle.identification.static.uncertainty import resample
from bristle.model.parameters import Lugre

from .conftest import GRIPPER, curve

NAMES = ("alpha_0", "alpha_2", "alpha_1", "v_s")
TRUTH = np.array([getattr(GRIPPER, name) for name in NAMES])


def batch(velocity: Array, noise: float, sets: int, seed: int, truth: Lugre[float] = GRIPPER) -> Batch:
    """Sets of torques of the gripper at the same velocities; noise in parts of alpha_0."""
    drawn = noise * truth.alpha_0 * np.random.default_rng(seed).standard_normal((velocity.size, sets))
    torques = curve(velocity, truth)[:, None] + drawn
    return Batch(from_points(velocity, torques[:, 0], ("both",)), torques, default_range(velocity))


def alone(found: Batch, k: int) -> Regression:
    """One set of a batch."""
    return replace(found.problem, torque=found.torques[:, k].copy(), memory={})


def assert_as_one_by_one(found: Batch) -> int:
    """Costs of every set are those of `solve` to 3e-4, estimates to a thousandth of an error; returns how many are at a bound."""
    at_bound = 0
    for k in range(found.cost.size):
        problem = alone(found, k)
        solution = solve(problem, found.v_s_range)
        assert found.cost[k] == pytest.approx(solution.cost, rel=3e-4)
        if not solution.at_bound:
            own = np.sqrt(np.diag(covariance.covariance(solution.jacobian, solution.cost)[0]))
            assert (found.theta[:, k] - solution.theta) / own == pytest.approx(np.zeros(own.size), abs=1e-3)
        at_bound += bool(solution.at_bound)
    return at_bound


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), noise=st.floats(5e-3, 0.03), start=st.floats(0.1, 0.6), count=st.integers(10, 30))
@example(seed=724, noise=0.005859375, start=0.1015625, count=10)
def test_a_batch_is_its_sets_one_by_one(seed: int, noise: float, start: float, count: int) -> None:
    """Over random designs and noise: every set of a batch is as if it were alone."""
    assert_as_one_by_one(batch(np.geomspace(start * GRIPPER.v_s, 0.8, count), noise, 4, seed))


def test_sets_at_a_bound_are_the_same_too() -> None:
    """Few speeds near v_s, hardly any viscous friction: sets at a bound agree as well; there are some."""
    velocity = np.geomspace(0.9 * GRIPPER.v_s, 0.8, 12)
    bare = GRIPPER._replace(alpha_2=0.002)
    assert assert_as_one_by_one(batch(velocity, 0.04, 60, 1, bare)) >= 5


def test_errors_are_those_of_the_covariance() -> None:
    """Standard errors are those of the exact Jacobian at each set's estimate, to 1e-4."""
    found = batch(np.geomspace(0.7 * GRIPPER.v_s, 0.8, 16), 0.03, 60, 7)
    errors = found.errors()
    for k in np.flatnonzero((found.theta > 0).all(axis=0)).tolist():
        spread, _ = covariance.covariance(alone(found, k).jacobian(found.theta[:, k]), float(found.cost[k]))
        assert errors[:, k] == pytest.approx(np.sqrt(np.diag(spread)), rel=1e-4)


def test_extra_regressors_are_carried_along() -> None:
    """With gravity among the columns, which may be negative, a batch is its sets one by one as well."""
    velocity = np.geomspace(0.2 * GRIPPER.v_s, 0.8, 20)
    position = np.linspace(0, 11, velocity.size)
    extra = load_columns(("gravity",), lambda _: position, velocity.size)
    noise = 1e-4 * np.random.default_rng(0).standard_normal((velocity.size, 20))
    torques = (curve(velocity, GRIPPER) - 0.004 * extra["gravity_sin"])[:, None] + noise
    problem = from_points(velocity, torques[:, 0], ("both",), extra)
    found = Batch(problem, torques, default_range(velocity))
    assert_as_one_by_one(found)
    assert found.theta[2] == pytest.approx(np.full(20, -0.004), abs=5e-4)


def test_robust_errors_are_the_textbooks_hc3() -> None:
    """(J'J)**-1 J' diag(r / (1 - h))**2 J (J'J)**-1 at each set's own estimate (MacKinnon and White, 1985)."""
    velocity = np.geomspace(0.15 * GRIPPER.v_s, 0.8, 16)
    found = batch(velocity, 0.01, 25, 3)
    errors = found.errors(robust=True)
    for k in range(25):
        problem, theta = alone(found, k), found.theta[:, k]
        J = problem.jacobian(theta)
        inverse = np.linalg.inv(J.T @ J)
        raised = problem.residuals(theta) / (1 - np.diag(J @ inverse @ J.T))
        textbook = inverse @ J.T @ np.diag(raised**2) @ J @ inverse
        assert errors[:, k] == pytest.approx(np.sqrt(np.diag(textbook)), rel=1e-6)


def covered(low: Array, high: Array) -> Array:
    """How often each parameter's interval holds the truth."""
    hits: Array = ((low <= TRUTH[:, None]) & (TRUTH[:, None] <= high)).mean(axis=1)
    return hits


def test_profiles_cover_as_often_as_they_say() -> None:
    """At 2 % noise the profile holds each truth in 95 %, within three deviations; from v_s up in 93 to 97 %, the covariance alpha_1 in less."""
    for start, sets, most in ((0.15, 2000, 3 * np.sqrt(0.95 * 0.05 / 2000)), (1.0, 1000, 0.02)):
        found = batch(np.geomspace(start * GRIPPER.v_s, 0.8, 16), 0.02, sets, 0)
        intervals = [profiled(x, solve(x, found.v_s_range)).intervals for x in (alone(found, k) for k in range(sets))]
        low, high = np.array([list(one.values()) for one in intervals]).T
        assert covered(low, high) == pytest.approx([0.95] * 4, abs=most)
    reach = covariance.student(12) * found.errors()
    assert covered(found.theta - reach, found.theta + reach)[2] < 0.92


def test_bootstrap_t_covers_as_often_as_it_says() -> None:
    """The same design, 200 sets of 399 draws: bootstrap-t holds each true parameter in 95 %, within three deviations."""
    velocity = np.geomspace(0.15 * GRIPPER.v_s, 0.8, 16)
    found = batch(velocity, 0.02, 200, 1)
    ends = []
    for k in range(200):
        problem = alone(found, k)
        drawn = resample(problem, solve(problem, found.v_s_range), found.v_s_range, 399, seed=k)
        ends.append((drawn.low, drawn.high))
    low, high = np.transpose(ends, (1, 2, 0))
    assert covered(low, high) == pytest.approx([0.95] * 4, abs=3 * np.sqrt(0.95 * 0.05 / 200))


def test_a_range_far_below_every_speed_overflows_nothing() -> None:
    """Where columns at the lower end of the range vanish at every speed, each set still has the cost of `solve`, and no number is infinite."""
    velocity = np.geomspace(0.015, 0.8, 12)
    torques = curve(velocity, GRIPPER)[:, None] + 5e-5 * np.random.default_rng(2).standard_normal((12, 40))
    found = Batch(from_points(velocity, torques[:, 0], ("both",)), torques, (1e-4, 6e3))
    assert np.isfinite(found.theta).all()
    for k in range(0, 40, 8):
        assert found.cost[k] == pytest.approx(solve(alone(found, k), found.v_s_range).cost, rel=1e-2)
