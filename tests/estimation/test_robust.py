import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.signal import lfilter
from scipy.special import stdtrit
from scipy.stats import false_discovery_control, multivariate_normal, norm

from bristle.estimation.moderation import moderated, normal_errors
from bristle.estimation.multiple_tests import false_discovery, false_discovery_within, simes
from bristle.estimation.robust import (
    SCALE_EFFICIENCY,
    common_variance,
    differences_of,
    fit_differences,
    population,
    variance_interval,
    without_each,
)
from bristle.estimation.score_test import Candidate, Fitted, explained, moved_by, scores
from bristle.estimation.step_test import Levels, Steps, largest_p, step_scan
from bristle.findings import CAUTION, Finding


def test_common_variance_is_consistent_and_its_efficiency_is_stated() -> None:
    """Of normal residuals with known variances beside it the mean over repeats is the truth, and the scatter that of the stated efficiency."""
    rng = np.random.default_rng(0)
    known = np.zeros(400)
    found = np.array([common_variance(rng.standard_normal(400) * 0.3, known) for _ in range(4000)])
    assert found.mean() == pytest.approx(0.09, rel=0.01)
    assert 2 / 400 / found.var() * found.mean() ** 2 == pytest.approx(SCALE_EFFICIENCY, rel=4 * np.sqrt(2 / 4000))
    known = rng.uniform(0.01, 0.2, 20_000)
    r = rng.standard_normal(20_000) * np.sqrt(2 * 0.09 + known)
    assert common_variance(r, known, 2.0) == pytest.approx(0.09, rel=0.03)
    # two residuals in a hundred, however far out, raise it by less than a tenth, where the mean square rises without bound
    rng = np.random.default_rng(1)
    r = rng.standard_normal(5000)
    r[::50] = 1e3
    assert common_variance(r, np.zeros(5000)) < 1.1
    assert np.mean(r**2) > 1e4
    # the 95 % interval of the variance beside a known one holds the truth in about 95 % of repeats
    rng = np.random.default_rng(2)
    held = 0
    for _ in range(1000):
        r = rng.standard_normal(60) * np.sqrt(1.0 + 0.25)
        low, high = variance_interval(common_variance(r, np.full(60, 0.25)), 0.25, 60 * SCALE_EFFICIENCY)
        held += low <= 1.0 <= high
    assert 0.93 < held / 1000 < 0.97


def simulated(
    rng: np.random.Generator, owners: int, times: int, slope: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Observations of owners at levels of their own, with a regressor that wanders, scatter 0.03 and errors of 0.01: y, known, X, owner."""
    X = rng.standard_normal((owners, times)).cumsum(axis=1)
    y = rng.standard_normal((owners, 1)) + slope * X
    y += 0.03 * rng.standard_normal(y.shape) + 0.01 * rng.standard_normal(y.shape)
    return y.ravel(), np.full(y.size, 1e-4), X.reshape(-1, 1), np.repeat(np.arange(owners), times)


@pytest.mark.parametrize("owners", [8, 60])
def test_errors_of_a_slope_are_those_of_repeats(owners: int) -> None:
    """By the model with few groups, by their scores with many: the slope is right, and its stated variance that of repeats."""
    rng = np.random.default_rng(3)
    slopes, stated = [], []
    for _ in range(300):
        y, known, X, owner = simulated(rng, owners, 6, 0.01)
        fit = fit_differences(y, known, X, differences_of(owner), owner)
        slopes.append(fit.coefficients[0])
        stated.append(fit.covariance[0, 0])
    assert np.mean(slopes) == pytest.approx(0.01, abs=4 * np.std(slopes) / np.sqrt(300))
    assert np.mean(stated) == pytest.approx(np.var(slopes), rel=0.25)


def test_equal_values_and_values_with_nothing_in_common() -> None:
    """Equal values with no error are a population without spread, with and without each of them."""
    for found in (population(np.full(4, 0.3), np.zeros(4)), without_each(np.full(4, 0.3), np.zeros(4))):
        assert np.max(found.variance) == np.max(found.mean_error) == 0.0
        assert np.max(found.mean) == pytest.approx(0.3, rel=1e-15)
    # of values with known errors: the mean within its stated error, the variance between them, whatever three strays in a hundred do
    rng = np.random.default_rng(5)
    means, stated = [], []
    for _ in range(300):
        known = rng.uniform(1e-4, 4e-3, 100)
        values = 2.0 + rng.standard_normal(100) * np.sqrt(0.01 + known)
        values[:3] += 5.0
        found = population(values, known)
        means.append(found.mean)
        stated.append(found.mean_error)
        assert 0.06 < np.sqrt(found.variance) < 0.15
    assert np.mean(means) == pytest.approx(2.0, abs=0.01)
    assert np.mean(stated) == pytest.approx(np.std(means), rel=0.2)
    # one owner in ten steps by five standard deviations, all at the same time and up: the slope moves by less than two of its errors
    rng = np.random.default_rng(4)
    y, known, X, owner = simulated(rng, 200, 8, 0.01)
    late = np.tile(np.arange(8) >= 5, 200) & (owner % 10 == 0)
    fit = fit_differences(y + 0.15 * late, known, X, differences_of(owner), owner)
    assert abs(fit.coefficients[0] - 0.01) < 2 * np.sqrt(fit.covariance[0, 0])
    assert np.sqrt(fit.variance) == pytest.approx(0.03, rel=0.08)
    # variances drawn from a scaled inverse chi-squared with 6 degrees of freedom: so many are added, within a quarter
    rng = np.random.default_rng(0)
    truth = 6.0 / rng.chisquare(6.0, 5000)
    _, more = moderated(drawn(truth, 4.0, rng), np.full(5000, 4.0))
    assert more - 4.0 == pytest.approx(6.0, rel=0.25)
    # estimates with intervals of 4 degrees of freedom lie outside 1.96 of the errors made of these in 5 %, outside 3.29 in 0.1 % of the
    # cases
    true = np.full(20_000, 0.3)
    error = np.sqrt(drawn(true**2, 4.0, rng))
    z = true * rng.standard_normal(true.size) / normal_errors(error, float(stdtrit(4.0, 0.975)) * error)
    assert (np.abs(z) > 1.96).mean() == pytest.approx(0.05, abs=0.006)
    assert (np.abs(z) > 3.29).mean() < 0.003


def drawn(truth: np.ndarray, freedom: float, rng: np.random.Generator) -> np.ndarray:
    """Estimates of variances with so many degrees of freedom."""
    return truth * rng.chisquare(freedom, truth.shape) / freedom


@pytest.mark.parametrize("freedom", [2.0, 10.0])
def test_what_is_one_variance_becomes_one(freedom: float) -> None:
    """Estimates of one variance become that, with a fifth of their scatter at the most, and rest on many more degrees of freedom."""
    found = drawn(np.full(1000, 2.5), freedom, np.random.default_rng(0))
    steady, more = moderated(found, np.full(1000, freedom))
    assert np.median(steady) == pytest.approx(2.5, rel=0.1)
    assert np.log(steady).std() < np.log(found).std() / 5
    assert more.min() > 4 * freedom


levels = arrays(float, st.integers(1, 40), elements=st.floats(1e-300, 1.0))


@given(levels, st.integers(0, 2**32))
def test_each_group_as_scipy_has_it(p: np.ndarray, seed: int) -> None:
    """Adjusted p-values are SciPy's, of all and of each group by itself, to the last digits of the smallest; Simes's is the least of its group."""
    group = np.random.default_rng(seed).integers(0, 4, p.size)
    np.testing.assert_allclose(false_discovery(p), false_discovery_control(p), rtol=1e-12)
    within, least = false_discovery_within(p, group), simes(p, group)
    for k in np.unique(group):
        own = false_discovery_control(p[group == k])
        np.testing.assert_allclose(within[group == k], own, rtol=1e-12)
        np.testing.assert_allclose(least[k], own.min(), rtol=1e-12)


def scan(y: np.ndarray, variance: np.ndarray, baseline: int, freedom: float = np.inf) -> Steps:
    return step_scan(Levels(y, variance, np.zeros((*y.shape, 0)), np.zeros((0, 0))), baseline, freedom)


@pytest.mark.parametrize(("c", "rho"), [(0.5, 0.3), (3.5, 0.95), (4.0, 0.2)])
def test_two_places_by_the_bivariate_normal(c: float, rho: float) -> None:
    """With two places of a step the p-value is exact: that of the larger of two correlated normal variables, by SciPy."""
    # weights before and after with that correlation: odds in the ratio rho**2
    before, after = np.array([[1.0, 1.0]]), np.array([[1.0, rho**2]])
    inside = multivariate_normal(cov=[[1, rho], [rho, 1]])
    both = inside.cdf([c, c]) - 2 * inside.cdf([-c, c]) + inside.cdf([-c, -c])
    assert largest_p(np.array([c]), before, after)[0] == pytest.approx(1 - both, rel=2e-4)


def test_p_values_without_a_step_and_without_tests() -> None:
    """In 1e5 series without a step, of unequal variances and lengths, p falls below a level no more often than that, and hardly less often."""
    rng = np.random.default_rng(0)
    variance = rng.uniform(0.5, 4.0, (100_000, 9))
    length = rng.integers(5, 10, 100_000)
    variance[np.arange(9) >= length[:, None]] = np.inf
    y = rng.standard_normal(variance.shape) * np.sqrt(np.where(np.isfinite(variance), variance, 1.0))
    p = scan(y, variance, 3).p
    for level in (0.05, 0.01, 0.001):
        assert 0.8 * level < (p < level).mean() < level + 3 * np.sqrt(level / 1e5)
    # a row with one observation after the baseline has the p-value of a normal variable, and of Student's t with few degrees of freedom
    y = np.array([[0.0, 0.0, 0.0, 3.0]])
    alone = scan(y, np.ones((1, 4)), 3)
    z = 3.0 / np.sqrt(1 + 1 / 3)
    assert alone.z[0] == pytest.approx(z)
    assert alone.p[0] == pytest.approx(2 * norm.sf(z))
    assert scan(y, np.ones((1, 4)), 3, 4.0).p[0] == pytest.approx(
        2 * 0.0302, rel=0.02
    )  # t of 4 degrees of freedom beyond 2.598


@given(st.integers(3, 9), st.floats(-5, 5).filter(lambda x: abs(x) > 0.5), st.integers(0, 2**32))
def test_a_clear_step_is_found_where_it_is(at: int, size: float, seed: int) -> None:
    """A step of fifty standard deviations is placed exactly, with its size and error; the sign of y changes the sign of z alone."""
    y = 0.01 * np.random.default_rng(seed).standard_normal((1, 10)) + size * (np.arange(10) >= at)
    found = scan(y, np.full((1, 10), 1e-4), 3)
    assert found.after[0] == at
    assert found.size[0] == pytest.approx(size, abs=5 * found.error[0])
    assert found.error[0] == pytest.approx(0.01 * np.sqrt(1 / at + 1 / (10 - at)))
    assert scan(-y, np.full((1, 10), 1e-4), 3).z[0] == -found.z[0]


def test_the_score_test_is_a_linear_fit_and_tells_causes_first() -> None:
    """Of a linear model the size, its share and what moves are those of least squares with the columns, exactly, in any unit."""
    rng = np.random.default_rng(0)
    known, columns, y = rng.normal(size=(200, 4)), rng.normal(size=(200, 2)) * [1.0, 1e-9], rng.normal(size=200)
    fitted = np.linalg.lstsq(known, y)[0]
    whole = np.linalg.lstsq(np.hstack([known, columns * [1.0, 1e9]]), y)[0]
    (found,) = scores(known, y - known @ fitted, [columns])
    assert found.sizes * [1.0, 1e-9] == pytest.approx(whole[4:])
    assert -moved_by(known, columns @ found.sizes) == pytest.approx(whole[:4] - fitted)
    left = float(np.sum((y - np.hstack([known, columns * [1.0, 1e9]]) @ whole) ** 2))
    assert found.squares == pytest.approx(float(np.sum((y - known @ fitted) ** 2)) - left)
    # what is known already, a column of zeros, or one of more samples than there are, is not significant; beside known ones of no rank too
    x = np.random.default_rng(1).normal(size=(30, 3))
    known = np.hstack([x, x[:, :1], np.zeros((30, 1))])
    y = np.random.default_rng(2).normal(size=30)
    for columns in (x[:, :2], np.zeros((30, 1))):
        assert scores(known, y, [columns])[0].p == 1.0
    assert scores(known[:4], y[:4], [y[:4, None]])[0].p == 1.0
    assert scores(known, y, [y[:, None]])[0].p < 1e-6
    # of a cause and a column that goes along with it the cause alone, then a second cause; a refused one leaves room
    rng, n = np.random.default_rng(5), 500
    cause, other, noise = rng.normal(size=(3, n))
    alike = cause + 0.3 * rng.normal(size=n)
    rest = cause + 0.5 * other + 0.1 * noise
    fit = Fitted(np.zeros((n, 0)), rest, np.zeros(0), np.zeros(0, dtype=bool), 1.0)

    def row(code: str, column: np.ndarray[tuple[int, ...], np.dtype[np.float64]], refused: bool = False) -> Candidate:
        return Candidate(
            lambda *_: None if refused else Finding(code, CAUTION, code), (column[:, None],), is_friction=True
        )

    found, left, _ = explained(fit, [row("alike", alike), row("other", other), row("cause", cause)])
    assert [x.code for x in found] == ["cause", "other"]
    assert np.std(left) == pytest.approx(0.1, rel=0.1)
    found, *_ = explained(fit, [row("alike", alike), row("cause", cause, refused=True)])
    assert [x.code for x in found] == ["alike"]


@pytest.mark.parametrize(("rho", "waves", "most"), [(0.0, 1, 0.08), (0.0, 90, 0.08), (0.5, 5, 0.09), (0.9, 20, 0.1)])
def test_it_is_as_rare_as_it_says(rho: float, waves: int, most: float) -> None:
    """Of noise that grows along the record, white or correlated, p < 0.05 in some 5 % of 500 draws, for a slow column and a fast one."""
    rng, n = np.random.default_rng(3), 600
    t = np.linspace(0, 1, n)
    noise = lfilter([1.0], [1.0, -rho], rng.normal(size=(500, n + 100)))[:, 100:] * (0.5 + t)
    known, column = np.stack([np.ones(n), t], axis=1), np.cos(2 * np.pi * waves * t)[:, None]
    p = [scores(known, x - known @ np.linalg.lstsq(known, x)[0], [column])[0].p for x in noise]
    assert 0.02 <= np.mean(np.array(p) < 0.05) <= most
