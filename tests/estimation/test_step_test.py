"""The scan for a step: its p-values hold, it finds the step, and what was taken off beforehand widens its errors."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import multivariate_normal, norm

from bristle.estimation.step_test import Levels, Steps, largest_p, step_scan


def scan(y: np.ndarray, variance: np.ndarray, baseline: int, freedom: float = np.inf) -> Steps:
    """The scan of series without regressors."""
    return step_scan(Levels(y, variance, np.zeros((*y.shape, 0)), np.zeros((0, 0))), baseline, freedom)


@pytest.mark.parametrize(("c", "rho"), [(0.5, 0.3), (1.5, 0.9), (3.0, 0.7), (3.5, 0.95), (4.0, 0.2)])
def test_two_places_by_the_bivariate_normal(c: float, rho: float) -> None:
    """With two places of a step the p-value is exact: that of the larger of two correlated normal variables, by SciPy."""
    # weights before and after with that correlation: odds in the ratio rho**2
    before, after = np.array([[1.0, 1.0]]), np.array([[1.0, rho**2]])
    inside = multivariate_normal(cov=[[1, rho], [rho, 1]])
    both = inside.cdf([c, c]) - 2 * inside.cdf([-c, c]) + inside.cdf([-c, -c])
    assert largest_p(np.array([c]), before, after)[0] == pytest.approx(1 - both, rel=2e-4)


def test_p_values_hold_without_a_step() -> None:
    """In 1e5 series without a step, of unequal variances and lengths, p falls below a level no more often than that, and hardly less often."""
    rng = np.random.default_rng(0)
    variance = rng.uniform(0.5, 4.0, (100_000, 9))
    length = rng.integers(5, 10, 100_000)
    variance[np.arange(9) >= length[:, None]] = np.inf
    y = rng.standard_normal(variance.shape) * np.sqrt(np.where(np.isfinite(variance), variance, 1.0))
    p = scan(y, variance, 3).p
    for level in (0.05, 0.01, 0.001):
        assert 0.8 * level < (p < level).mean() < level + 3 * np.sqrt(level / 1e5)


def test_one_place_is_the_plain_test() -> None:
    """A row with one observation after the baseline has the p-value of a normal variable, and of Student's t with few degrees of freedom."""
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


def test_what_was_taken_off_widens_the_error() -> None:
    """A regressor that itself steps there adds its coefficient's variance; one that does not adds nothing."""
    y, variance = np.zeros((1, 8)), np.ones((1, 8))
    y[0, 5:] = 10.0
    step = (np.arange(8.0) >= 5).astype(float)[None, :, None]
    wide = step_scan(Levels(y, variance, step, np.array([[4.0]])), 3, np.inf)
    assert wide.error[0] == pytest.approx(np.sqrt(1 / 5 + 1 / 3 + 4.0))
    same = step_scan(Levels(y, variance, np.ones((1, 8, 1)), np.array([[4.0]])), 3, np.inf)
    assert same.error[0] == pytest.approx(np.sqrt(1 / 5 + 1 / 3))
