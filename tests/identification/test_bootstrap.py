from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from bristle.arrays import Array
from bristle.estimation import covariance
from bristle.estimation.bootstrap import residual_bootstrap, variances_differ
from bristle.identification.moving_runs import load_columns
from bristle.identification.static import uncertainty
from bristle.identification.static.batch import Batch
from bristle.identification.static.grid import default_range, solve
from bristle.identification.static.problem import Regression, from_points
from bristle.identification.static.profiles import profiled
from bristle.identification.static.uncertainty import StaticDraws, resample
from bristle.model.parameters import Direction, Lugre

from ..names import parse
from .conftest import GRIPPER, curve

SPEEDS = np.geomspace(0.15 * GRIPPER.v_s, 0.8, 16)


def resampled(problem: Regression, draws: int = 199, seed: int = 0) -> StaticDraws:
    v_s_range = default_range(problem.velocity)
    return resample(problem, solve(problem, v_s_range), v_s_range, draws, seed)


def gripper(noise: Array) -> Regression:
    return from_points(SPEEDS, curve(SPEEDS, GRIPPER) + noise, ("both",))


def location(torque: Array) -> Regression:
    """Nothing but a constant, at one speed: the mean of some numbers."""
    velocity = np.full(torque.size, 1.0)
    columns = np.ones((torque.size, 1))
    return Regression(
        directions=(Direction.BOTH,), peaks=(), velocity=velocity, torque=torque, linear=columns,
        linear_names=(parse("offset"),),
    )  # fmt: skip  # a list of values


@settings(max_examples=25)
@given(seed=st.integers(0, 10**6), count=st.integers(10, 40))
def test_of_a_mean_it_is_the_textbooks(seed: int, count: int) -> None:
    """A mean: the interval is mean - t* s / sqrt(n) at the quantiles of (mean* - mean) / se* of the very draws; raised residuals cancel out."""
    torque = np.random.default_rng(seed).exponential(1.0, count)
    found = resampled(location(torque), 199, seed)
    mean, n = torque.mean(), count
    noise = (torque - mean)[np.random.default_rng(seed).integers(0, n, (n, 199))] / np.sqrt(1 - 1 / n)
    t = noise.mean(axis=0) / (noise.std(axis=0, ddof=1) / np.sqrt(n))
    error = torque.std(ddof=1) / np.sqrt(n)
    low = mean - np.quantile(t, 0.975, method="higher") * error
    high = mean - np.quantile(t, 0.025, method="lower") * error
    assert found.draws[0] == pytest.approx(mean + noise.mean(axis=0))
    assert (found.low[0], found.high[0]) == pytest.approx((low, high), rel=1e-9)


def test_intervals_of_points_by_bootstrap(monkeypatch: pytest.MonkeyPatch) -> None:
    """Means of 15 exponential numbers: bootstrap-t holds the truth more often than Student's t, in 92 to 97 % of 600 sets (Hall, 1988)."""
    rng, hits, by_t = np.random.default_rng(0), 0, 0
    for k in range(600):
        torque = rng.exponential(1.0, 15)
        found = resampled(location(torque), 199, k)
        hits += int(found.low[0] <= 1 <= found.high[0])
        by_t += int(abs(torque.mean() - 1) <= 2.1448 * torque.std(ddof=1) / np.sqrt(15))
    assert hits > by_t
    assert 0.92 <= hits / 600 <= 0.97
    # torque that dips where it should peak: alpha_1 is zero, and the interval of v_s open to both sides; the others are finite
    noise = 1e-5 * np.random.default_rng(1).standard_normal(16)
    problem = from_points(SPEEDS, curve(SPEEDS, GRIPPER._replace(alpha_1=-0.005)) + noise, ("both",))
    solution = solve(problem, (0.01, 0.1))
    found = resample(problem, solution, (0.01, 0.1), 40)
    assert solution.theta[2] == 0
    assert (found.low[3], found.high[3]) == (0, np.inf)
    assert np.isfinite([found.low[:3], found.high[:3]]).all()
    # without residuals every draw is the estimate, and every interval the truth, to rounding
    found = resampled(gripper(np.zeros(16)))
    truth = np.array([GRIPPER.alpha_0, GRIPPER.alpha_2, GRIPPER.alpha_1, GRIPPER.v_s])
    for ends in (found.low, found.high, *found.draws.T[:20]):
        assert ends == pytest.approx(truth, rel=2e-4)
    # over noise from little to so much that draws end at bounds: lower ends below upper ones, none below zero, none nan
    for seed in range(8):
        found = resampled(gripper((1e-4, 2e-3)[seed % 2] * np.random.default_rng(seed).standard_normal(16)), 99)
        assert not np.isnan(np.concatenate([found.low, found.high, found.draws.ravel()])).any()
        assert (found.low <= found.high).all()
        assert (found.low >= 0).all()
    # of 600 points the ends of the intervals that one step gives lie where refits have them, to a tenth of the interval
    speeds = np.geomspace(0.15 * GRIPPER.v_s, 0.8, 600)
    noise = 2e-4 * np.random.default_rng(6).standard_normal(600)
    problem = from_points(speeds, curve(speeds, GRIPPER) + noise, ("both",))
    again = resampled(problem, 999)
    monkeypatch.setattr(uncertainty, "MANY", 0)
    step = resampled(problem, 999)
    width = again.high - again.low
    assert (np.abs(step.low - again.low) < 0.1 * width).all()
    assert (np.abs(step.high - again.high) < 0.1 * width).all()


def test_even_variances_are_called_uneven_at_about_the_rate_of_the_test() -> None:
    """Of 2000 sets of 30 even Gaussian residuals, about 1 % look uneven, 3 % at most."""
    rng = np.random.default_rng(0)
    velocity = np.geomspace(0.01, 1, 30)
    assert np.mean([variances_differ(rng.standard_normal(30), velocity) for _ in range(2000)]) <= 0.03
    assert not variances_differ(rng.standard_normal(9) * np.arange(9) ** 3, velocity[:9])
    assert not variances_differ(np.zeros(30), velocity)
    # noise that grows twentyfold from slow to fast is drawn by signs, even noise by residuals, in nearly all of 40 sets
    velocity = np.geomspace(0.15 * GRIPPER.v_s, 0.8, 60)
    rng = np.random.default_rng(2)
    wild = {True: 0, False: 0}
    for grows in wild:
        size = 1e-4 * np.geomspace(1, 20, 60) if grows else np.full(60, 3e-4)
        for _ in range(20):
            torque = curve(velocity, GRIPPER) + size * rng.standard_normal(60)
            left = solve(from_points(velocity, torque, ("both",)), default_range(velocity)).residuals
            wild[grows] += variances_differ(left, velocity)
    assert wild[True] >= 18
    assert wild[False] <= 2
    # where no column holds a constant, residuals need not sum to zero; the mean of draws still is the estimate
    rng = np.random.default_rng(9)
    column, residuals = 0.5 + rng.standard_normal(20), 0.5 + rng.standard_normal(20)
    residuals -= column * (column @ residuals) / (column @ column)
    assert abs(residuals.mean()) > 0.1
    found, _ = residual_bootstrap(column[:, None], residuals, np.linspace(0.1, 1, 20), draws=4000)
    assert not variances_differ(residuals, np.linspace(0.1, 1, 20))
    assert abs(found.steps.mean()) < 4 * found.steps.std() / np.sqrt(4000)


@pytest.mark.parametrize("grows", [False, True])
def test_draws_scatter_as_the_covariance_does_or_as_the_robust_one(*, grows: bool) -> None:
    """Of a line: draws of residuals have the covariance s**2 (X'X)**-1 about the estimate, within a tenth."""
    # where the standard deviation grows with speed wild ones have (X'X)**-1 X' diag(r / (1 - h))**2 X (X'X)**-1
    velocity = np.geomspace(0.01, 1, 60)
    noise = (2e-3 * velocity if grows else 1e-3) * np.random.default_rng(3 if grows else 5).standard_normal(60)
    problem = replace(from_points(velocity, 0.02 + 0.04 * velocity + noise, ("both",)), peaks=())
    found, solution = resampled(problem, 20_000), solve(problem, (0.01, 1.0))
    assert variances_differ(solution.residuals, velocity) == grows
    X = problem.linear
    inverse = np.linalg.inv(X.T @ X)
    raised = solution.residuals / (1 - np.diag(X @ inverse @ X.T))
    textbook = inverse @ X.T @ np.diag(raised**2) @ X @ inverse if grows else solution.cost / 58 * inverse
    assert np.cov(found.draws) == pytest.approx(textbook, rel=0.08 if grows else 0.1)
    assert found.draws.mean(axis=1) == pytest.approx(solution.theta, rel=0.01)


NAMES = ("alpha_0", "alpha_2", "alpha_1", "v_s")
TRUTH = np.array([getattr(GRIPPER, name) for name in NAMES])


def batch(velocity: Array, noise: float, sets: int, seed: int, truth: Lugre[float] = GRIPPER) -> Batch:
    """Sets of torques of the gripper at the same velocities; noise in parts of alpha_0."""
    drawn = noise * truth.alpha_0 * np.random.default_rng(seed).standard_normal((velocity.size, sets))
    torques = curve(velocity, truth)[:, None] + drawn
    return Batch(from_points(velocity, torques[:, 0], ("both",)), torques, default_range(velocity))


def alone(found: Batch, k: int) -> Regression:
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


@settings(max_examples=20)
@given(seed=st.integers(0, 10**6), noise=st.floats(5e-3, 0.03), start=st.floats(0.1, 0.6), count=st.integers(10, 30))
@example(seed=724, noise=0.005859375, start=0.1015625, count=10)
def test_a_batch_is_its_sets_one_by_one(seed: int, noise: float, start: float, count: int) -> None:
    """Over random designs and noise: every set of a batch is as if it were alone."""
    assert_as_one_by_one(batch(np.geomspace(start * GRIPPER.v_s, 0.8, count), noise, 4, seed))


def test_sets_at_once_are_those_one_by_one_and_cover() -> None:
    """Few speeds near v_s, hardly any viscous friction: sets at a bound agree as well; there are some."""
    velocity = np.geomspace(0.9 * GRIPPER.v_s, 0.8, 12)
    bare = GRIPPER._replace(alpha_2=0.002)
    assert assert_as_one_by_one(batch(velocity, 0.04, 60, 1, bare)) >= 5
    # standard errors are those of the exact Jacobian at each set's estimate, to 1e-4
    found = batch(np.geomspace(0.7 * GRIPPER.v_s, 0.8, 16), 0.03, 60, 7)
    errors = found.errors()
    for k in np.flatnonzero((found.theta > 0).all(axis=0)).tolist():
        spread, _ = covariance.covariance(alone(found, k).jacobian(found.theta[:, k]), float(found.cost[k]))
        assert errors[:, k] == pytest.approx(np.sqrt(np.diag(spread)), rel=1e-4)
    # (J'J)**-1 J' diag(r / (1 - h))**2 J (J'J)**-1 at each set's own estimate (MacKinnon and White, 1985)
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
    # at 2 % noise the profile holds each truth in 95 %, within three deviations; from v_s up in 93 to 97 %, the covariance alpha_1 in less
    for start, sets, most in ((0.15, 2000, 3 * np.sqrt(0.95 * 0.05 / 2000)), (1.0, 1000, 0.02)):
        found = batch(np.geomspace(start * GRIPPER.v_s, 0.8, 16), 0.02, sets, 0)
        intervals = [profiled(x, solve(x, found.v_s_range)).intervals for x in (alone(found, k) for k in range(sets))]
        low, high = np.array([list(one.values()) for one in intervals]).T
        assert covered(low, high) == pytest.approx([0.95] * 4, abs=most)
    reach = covariance.student(12) * found.errors()
    assert covered(found.theta - reach, found.theta + reach)[2] < 0.92
    found = batch(velocity, 0.02, 200, 1)
    ends = []
    for k in range(200):
        problem = alone(found, k)
        drawn = resample(problem, solve(problem, found.v_s_range), found.v_s_range, 399, seed=k)
        ends.append((drawn.low, drawn.high))
    low, high = np.transpose(ends, (1, 2, 0))
    assert covered(low, high) == pytest.approx([0.95] * 4, abs=3 * np.sqrt(0.95 * 0.05 / 200))
    # with gravity among the columns, which may be negative, a batch is its sets one by one as well
    velocity = np.geomspace(0.2 * GRIPPER.v_s, 0.8, 20)
    position = np.linspace(0, 11, velocity.size)
    extra = load_columns(("gravity",), lambda _: position, velocity.size)
    noise = 1e-4 * np.random.default_rng(0).standard_normal((velocity.size, 20))
    torques = (curve(velocity, GRIPPER) - 0.004 * extra["gravity_sin"])[:, None] + noise
    problem = from_points(velocity, torques[:, 0], ("both",), extra)
    found = Batch(problem, torques, default_range(velocity))
    assert_as_one_by_one(found)
    assert found.theta[2] == pytest.approx(np.full(20, -0.004), abs=5e-4)
    # where columns at the lower end of the range vanish at every speed, each set still has the cost of `solve`, and no number is infinite
    velocity = np.geomspace(0.015, 0.8, 12)
    torques = curve(velocity, GRIPPER)[:, None] + 5e-5 * np.random.default_rng(2).standard_normal((12, 40))
    found = Batch(from_points(velocity, torques[:, 0], ("both",)), torques, (1e-4, 6e3))
    assert np.isfinite(found.theta).all()
    for k in range(0, 40, 8):
        assert found.cost[k] == pytest.approx(solve(alone(found, k), found.v_s_range).cost, rel=1e-2)


def covered(low: Array, high: Array) -> Array:
    hits: Array = ((low <= TRUTH[:, None]) & (TRUTH[:, None] <= high)).mean(axis=1)
    return hits
