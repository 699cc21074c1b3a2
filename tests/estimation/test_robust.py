"""Robust estimates with known variances: consistent, little moved by strays, and their errors are those that repeats show."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import stdtr

from bristle.estimation.robust import (
    SCALE_EFFICIENCY,
    common_variance,
    differences_of,
    fit_differences,
    population,
    variance_interval,
    without_each,
)


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


def test_strays_hardly_move_the_variance() -> None:
    """Two residuals in a hundred, however far out, raise it by less than a tenth, where the mean square rises without bound."""
    rng = np.random.default_rng(1)
    r = rng.standard_normal(5000)
    r[::50] = 1e3
    assert common_variance(r, np.zeros(5000)) < 1.1
    assert np.mean(r**2) > 1e4


@given(st.integers(0, 2**32), st.floats(0.1, 10.0))
def test_common_variance_scales(seed: int, by: float) -> None:
    """Residuals and errors times a factor give that factor squared; with known variances large enough there is nothing beside them."""
    rng = np.random.default_rng(seed)
    r, known = rng.standard_normal(30), rng.uniform(0, 0.5, 30)
    plain = common_variance(r, known)
    assert common_variance(by * r, by**2 * known) == pytest.approx(by**2 * plain, rel=1e-6, abs=1e-9)
    assert common_variance(r, np.full(30, 100.0)) == 0.0
    assert common_variance(np.zeros(0), np.zeros(0)) == 0.0


def test_interval_of_a_variance_covers_it() -> None:
    """The 95 % interval of the variance beside a known one holds the truth in about 95 % of repeats."""
    rng = np.random.default_rng(2)
    held = 0
    for _ in range(1000):
        r = rng.standard_normal(60) * np.sqrt(1.0 + 0.25)
        low, high = variance_interval(common_variance(r, np.full(60, 0.25)), 0.25, 60 * SCALE_EFFICIENCY)
        held += low <= 1.0 <= high
    assert 0.93 < held / 1000 < 0.97
    assert variance_interval(1.0, 0.0, 0.0) == (0.0, np.inf)


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


def test_levels_that_step_hardly_move_the_slope() -> None:
    """One owner in ten steps by five standard deviations, all at the same time and up: the slope moves by less than two of its errors."""
    rng = np.random.default_rng(4)
    y, known, X, owner = simulated(rng, 200, 8, 0.01)
    late = np.tile(np.arange(8) >= 5, 200) & (owner % 10 == 0)
    fit = fit_differences(y + 0.15 * late, known, X, differences_of(owner), owner)
    assert abs(fit.coefficients[0] - 0.01) < 2 * np.sqrt(fit.covariance[0, 0])
    assert np.sqrt(fit.variance) == pytest.approx(0.03, rel=0.08)


@pytest.mark.parametrize("n", [2, 5, 30])
def test_without_each_is_the_population_of_the_others(n: int) -> None:
    """Mean, its error, variance and degrees of freedom without the k-th value are those of the population of all others."""
    rng = np.random.default_rng(n)
    values, known = rng.standard_normal(n), rng.uniform(0.0, 0.5, n)
    found = without_each(values, known)
    for k in range(n):
        rest = population(np.delete(values, k), np.delete(known, k))
        assert [found.mean[k], found.mean_error[k], found.variance[k]] == pytest.approx(rest[:3], rel=1e-5, abs=1e-6)
        assert found.freedom == rest.freedom


def test_values_that_are_equal_have_no_spread() -> None:
    """Equal values with no error are a population without spread, with and without each of them."""
    for found in (population(np.full(4, 0.3), np.zeros(4)), without_each(np.full(4, 0.3), np.zeros(4))):
        assert np.max(found.variance) == np.max(found.mean_error) == 0.0
        assert np.max(found.mean) == pytest.approx(0.3, rel=1e-15)


@pytest.mark.slow
def test_one_of_few_is_told_by_the_others() -> None:
    """Of 15 normal values the farthest has a p-value below 1/20 of 1/15 in about one case in twenty by the others' mean and spread."""
    rng, called = np.random.default_rng(6), 0
    for _ in range(400):
        values = rng.standard_normal(15)
        others = without_each(values, np.full(15, 0.01))
        z = (values - others.mean) / np.sqrt(others.variance + 0.01 + others.mean_error**2)
        called += 2 * stdtr(others.freedom, -np.abs(z).max()) < 0.05 / 15
    assert 0.02 < called / 400 < 0.08


def test_population_finds_mean_and_spread() -> None:
    """Of values with known errors: the mean within its stated error, the variance between them, whatever three strays in a hundred do."""
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
