from collections.abc import Mapping

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import lsq_linear
from scipy.signal import lfilter

from bristle.arrays import Array
from bristle.estimation import bootstrap
from bristle.estimation.autocorrelation import autocorrelation, inflation, lag_one, standard_error
from bristle.estimation.bootstrap import block_bootstrap, bootstrap_at, residual_bootstrap
from bristle.estimation.covariance import covariance, student
from bristle.estimation.linear import bounded_least_squares
from bristle.estimation.multistart import MultistartSolution, solve_from_starts
from bristle.estimation.nonlinear import LeastSquares, Minimum, Unknowns, minimise
from bristle.estimation.profile_likelihood import profiles
from bristle.identification.static.grid import Projected, solve_at
from bristle.identification.static.problem import from_points


def unknowns(*names: str, logarithmic: tuple[str, ...] = ()) -> Unknowns[str]:
    """Free unknowns; those of logarithms are positive."""
    p, positive = len(names), np.array([name in logarithmic for name in names])
    return Unknowns(
        names=names, logarithmic=positive, scale=np.where(positive, 1.0, 2.0), lower=np.full(p, -np.inf),
        upper=np.full(p, np.inf), least=np.where(positive, 0.0, -np.inf),
    )  # fmt: skip  # a list of values


def line(measured: Array, columns: Array) -> LeastSquares[str]:
    """A linear problem in a, b and so on."""
    known = unknowns(*"abcdef"[: columns.shape[1]])

    def evaluate(x: Array) -> tuple[Array, Array]:
        return columns @ known.natural(x) - measured, columns * known.slopes(x)

    return LeastSquares(unknowns=known, evaluate=evaluate)


def solved(problem: LeastSquares[str], values: Mapping[str, float]) -> MultistartSolution[str]:
    own = problem.unknowns

    def solve(at: Mapping[str, float], most: int, _lowest: float) -> tuple[LeastSquares[str], Minimum]:
        return problem, minimise(problem.evaluate, own.scaled(at), own.lower, own.upper, most, settled=1e-14)

    return solve_from_starts(solve, [values], lambda posed, minimum: (posed, minimum))


def test_in_a_linear_problem_covariance_profile_and_bootstrap_coincide() -> None:
    """White noise: errors are the textbook's to a tenth, profile ends are Student's with them, and bootstrap-t's to what chance leaves."""
    rng = np.random.default_rng(0)
    columns = rng.standard_normal((3000, 2))
    problem = line(columns @ [1.0, -2.0] + rng.standard_normal(3000), columns)
    solution = solved(problem, {"a": 0.0, "b": 0.0})
    matrix, freedom = solution.covariance, solution.freedom
    textbook, _ = covariance(columns, solution.minimum.cost)
    assert matrix == pytest.approx(textbook, rel=0.1, abs=0.1 * np.sqrt(textbook.diagonal().prod()))
    assert solution.widening == pytest.approx(1.0, abs=0.1)
    found, better = profiles(solution)
    drawn, _ = bootstrap_at(solution)
    assert better is None
    for j, name in enumerate(problem.unknowns.names):
        value, reach = solution.values[name], student(freedom) * np.sqrt(matrix[j, j])
        assert found[name].interval == pytest.approx((value - reach, value + reach), abs=1e-5 * reach)
        assert drawn[name][0] == pytest.approx([value - reach, value + reach], abs=0.2 * reach)


def test_private_unknowns_of_blocks_are_projected_out() -> None:
    """A level of its own in each of many blocks, one at its bound: the same minimum and errors as with a column each, in any number of blocks."""
    rng, starts = np.random.default_rng(1), tuple(range(0, 400, 8))
    x, own = rng.standard_normal((400, 2)), np.linspace(1.0, 2.0, 400)
    dense = own[:, None] * (np.arange(400)[:, None] // 8 == np.arange(50))
    levels = rng.normal(0, 0.3, 50)
    levels[7] = -2.0  # beyond the bound
    y = x @ [1.0, -2.0] + dense @ levels + 0.1 * rng.standard_normal(400)
    lower, upper = (np.append([s * np.inf] * 2, np.full(50, s)) for s in (-1.0, 1.0))

    def evaluate(at: Array) -> tuple[Array, Array]:
        return np.hstack([x, dense]) @ at - y, np.column_stack([x, own])

    def each(at: Array) -> tuple[Array, Array]:
        return evaluate(at)[0], np.hstack([x, dense])

    found = minimise(evaluate, np.zeros(52), lower, upper, settled=1e-12, blocks=starts)
    plain = minimise(each, np.zeros(52), lower, upper, settled=1e-12)
    assert found.x == pytest.approx(plain.x, abs=1e-5)
    assert found.x[2 + 7] == -1.0
    assert found.converged
    free = np.delete(plain.jacobian, 2 + 7, axis=1)
    errors = covariance(free, plain.cost)[0][:2, :2] * (400 - 51)
    assert covariance(found.jacobian, found.cost)[0] * (400 - 2) == pytest.approx(errors, rel=1e-6)
    assert found.private.off(dense)[:, np.arange(50) != 7] == pytest.approx(0.0, abs=1e-12)


def test_the_lowest_of_several_minima_is_kept() -> None:
    """Of starts in three valleys the lowest end is the solution, and counted; a further start that shows nothing is passed over."""
    known = unknowns("a")

    def evaluate(x: Array) -> tuple[Array, Array]:
        """A cost with minima near -1 and 1, the latter lower; flat at 50."""
        a = float(known.natural(x)[0])
        if a > 40:
            return np.ones(3), np.zeros((3, 1))
        return np.array([a * a - 1, 0.2 * (a - 1), 1.0]), np.array([[2 * a], [0.2], [0.0]]) * known.slopes(x)

    problem = LeastSquares(unknowns=known, evaluate=evaluate)

    def solve(a: float, most: int, lowest: float) -> tuple[LeastSquares[str], Minimum]:
        start = known.scaled({"a": a})
        return problem, minimise(evaluate, start, known.lower, known.upper, most, lowest=lowest)

    found = solve_from_starts(solve, [-1.5, 1.5, 50.0, 0.5], lambda posed, minimum: (posed, minimum))
    assert found.values["a"] == pytest.approx(1.0, abs=1e-3)
    assert (found.starts, found.reached) == (4, 2)
    # no sample and a constant have no correlation
    assert autocorrelation(np.zeros(0)).size == lag_one(np.full(9, 0.1)) == 0
    assert lag_one(np.tile([1.0, -1.0], 50)) == pytest.approx(-0.99)


@settings(max_examples=60)
@given(seed=st.integers(0, 10**6), free=st.integers(0, 3), bounded=st.integers(0, 4))
def test_bounded_least_squares_is_lsq_linears(seed: int, free: int, bounded: int) -> None:
    """Any columns, with a bound of zero on some, in any order and scale: the same solution as scipy's lsq_linear, and no bound broken."""
    rng = np.random.default_rng(seed)
    count = free + bounded
    if count == 0:
        return
    design = rng.standard_normal((12, count)) + 0.5
    lower = rng.permutation([0.0] * bounded + [-np.inf] * free)
    torque = rng.standard_normal(12)
    scale = 10.0 ** rng.uniform(-2, 2, count)
    found = bounded_least_squares(design * scale, torque, lower)
    assert (found >= lower).all()
    expected = lsq_linear(design, torque, (lower, np.inf), method="bvls", tol=1e-14).x
    assert found * scale == pytest.approx(expected, abs=1e-9)


@settings(max_examples=30)
@given(seed=st.integers(0, 10**6))
def test_costs_with_bounds_are_those_of_bounded_least_squares(seed: int) -> None:
    """Whatever the torques, so that any set of bounds is active, with gravity and without: each grid cost is that of the bounded solution there."""
    rng = np.random.default_rng(seed)
    velocity, v_s = np.geomspace(0.01, 0.8, 12), np.geomspace(0.004, 0.7, 9)
    extra = {"gravity_sin": np.sin(9 * velocity)} if seed % 2 else {}
    problem = from_points(velocity, rng.standard_normal(12) + rng.uniform(-2, 2), ("both",), extra)
    expected = [solve_at(problem, [s]).cost for s in v_s.tolist()]
    assert Projected(problem).costs(v_s) == pytest.approx(expected, rel=1e-7)


def ar1(rho: float, shape: tuple[int, ...], seed: int = 0) -> Array:
    """AR(1) noise along the last axis, stationary."""
    noise = np.random.default_rng(seed).normal(size=(*shape[:-1], shape[-1] + 500))
    return np.asarray(lfilter([1.0], [1.0, -rho], noise)[..., 500:])


def mean_of(x: Array, **options: int) -> Array:
    return block_bootstrap(-np.ones((x.size, 1)), x - x.mean(), **options).steps[:, 0]  # type: ignore[arg-type]


def test_correlated_noise_inflates_the_variance_of_a_mean() -> None:
    """Over series the mean variance of the draws is 1 / (n (1 - rho)**2), less what block ends cut off: 2 rho / ((1 - rho**2) L), and L / n."""
    for rho in (0.0, 0.5, 0.8):
        n, length, series = 4000, 100, 40
        found = [mean_of(ar1(rho, (n,), seed), length=length, draws=300, seed=seed).var() for seed in range(series)]
        cut = 2 * rho / ((1 - rho**2) * length) + length / n
        true = (1 - cut) / (n * (1 - rho) ** 2)
        spread = np.std(found) / np.sqrt(series)
        assert np.mean(found) == pytest.approx(true, abs=3.5 * spread)
        assert spread < 0.05 * true
    # AR(1) noise inflates the variance of a mean by (1 + rho) / (1 - rho)
    for rho in (0.0, 0.5, 0.9):
        measured = np.mean([inflation(x) for x in ar1(rho, (30, 10_000))])
        assert measured == pytest.approx((1 + rho) / (1 - rho), rel=0.07)
        # over repetitions, the standard error's root mean square is the standard deviation of the means
        x = ar1(rho, (200, 4000), seed=1)
        errors = [standard_error(row) or np.inf for row in x]
        assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(np.std(x.mean(axis=1)), rel=0.12)


def test_bootstrap_knows_skewness_priors_and_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    """The mean of exponential noise: bootstrap-t reaches farther up than down, as the truth lies."""
    x = np.random.default_rng(2).exponential(size=60)
    low, high = block_bootstrap(-np.ones((60, 1)), x - x.mean(), length=1, draws=8000).interval(0, 1.0)
    assert high > 1.15 * -low
    # with a prior of its own weight the draws scatter by (G s**2 + sigma**2 P**2) / (G + P**2)**2, and t is of unit variance
    rng = np.random.default_rng(3)
    n, P, sigma, s = 1000, 30.0, 1.5, 0.7
    J, left = rng.standard_normal((n, 1)), s * rng.standard_normal(n)
    left -= J[:, 0] * (J[:, 0] @ left) / (J[:, 0] @ J[:, 0])
    found = block_bootstrap(J, left, priors=np.array([[P]]), sigma=sigma, length=1, draws=3000)
    G = float(J[:, 0] @ J[:, 0])
    assert found.steps.std() == pytest.approx(np.sqrt(G * s**2 + sigma**2 * P**2) / (G + P**2), rel=0.06)
    assert found.studentised.std() == pytest.approx(1.0, rel=0.06)
    # blocks that cut correlation make draws scatter by too little; t has unit variance all the same
    x = ar1(0.9, (6000,), 4)
    short = block_bootstrap(-np.ones((x.size, 1)), x - x.mean(), length=12, draws=2000)
    true = 10 / np.sqrt(x.size)
    assert short.steps.std() < 0.8 * true
    assert short.studentised.std() == pytest.approx(1.0, rel=0.08)
    # residuals that are one constant per segment: with segments as blocks the mean scatters as the mean of as many independent values
    rng = np.random.default_rng(5)
    level = rng.standard_normal(50)
    x = np.repeat(level - level.mean(), 20)
    found = block_bootstrap(-np.ones((1000, 1)), x, range(0, 1000, 20), length=1000, draws=4000)
    assert found.blocks == 50
    assert found.steps.std() == pytest.approx(level.std() / np.sqrt(50), rel=0.06)
    # however few numbers are drawn at once: as many draws, all different, the same errors and covariance s**2 (J'J)**-1
    rng, n = np.random.default_rng(3), 200
    J, residuals = np.column_stack([np.ones(n), np.linspace(-1, 1, n)]), rng.standard_normal(n)
    whole, errors = residual_bootstrap(J, residuals, np.ones(n), draws=4000)
    monkeypatch.setattr(bootstrap, "_AT_ONCE", 7 * n)
    parts, same = residual_bootstrap(J, residuals, np.ones(n), draws=4000)
    np.testing.assert_allclose(same, errors, rtol=1e-12)
    np.testing.assert_allclose(np.cov(parts.steps.T), np.cov(whole.steps.T), rtol=0.1, atol=6e-4)
    assert len(np.unique(parts.steps[:, 0])) == 4000


@given(st.floats(-6, 6), st.integers(0, 5))
@settings(max_examples=20)
def test_a_step_scales_with_its_parameter(power: float, seed: int) -> None:
    """Expressing a parameter in another unit changes its steps by that unit and nothing else, t not at all."""
    rng = np.random.default_rng(seed)
    J, left = rng.standard_normal((200, 2)), rng.standard_normal(200)
    unit = np.array([10.0**power, 1.0])
    one, other = (block_bootstrap(j, left, length=5, draws=50, seed=seed) for j in (J, J * unit))
    np.testing.assert_allclose(other.steps * unit, one.steps, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(other.studentised, one.studentised, rtol=1e-6, atol=1e-9)


@given(arrays(float, st.integers(1, 60), elements=st.floats(-1e6, 1e6)), st.floats(1e-3, 1e3), st.floats(-1e3, 1e3))
@example(np.array([np.finfo(float).tiny, 0, 0, 0, 0, 0]), 1.0, 0.0)
def test_inflation_is_bounded_and_ignores_sign(x: Array, scale: float, shift: float) -> None:
    """1 <= inflation <= n for any data, short or constant; a change of sign changes nothing, nor does a change of unit by a power of two."""
    tau = inflation(x)
    assert 1.0 <= tau <= max(x.size, 1)
    assert inflation(-x) == tau
    assert inflation(x * 2.0**5) == tau
    assert inflation(np.full(x.size, scale + shift)) == 1.0


@given(arrays(float, st.integers(2, 60), elements=st.floats(-1e3, 1e3)))
def test_autocorrelation_is_that_of_the_definition(x: Array) -> None:
    """The FFT gives the sums of products of the definition; lag zero is one, and no lag exceeds it."""
    rho, centred = autocorrelation(x), x - x.mean()
    assert rho[0] == pytest.approx(1.0)
    assert np.all(np.abs(rho) <= 1 + 1e-9)
    if np.ptp(x) > 1e-3:
        direct = [centred[k:] @ centred[: x.size - k] / (centred @ centred) for k in range(x.size)]
        assert rho == pytest.approx(np.array(direct), abs=1e-9)
