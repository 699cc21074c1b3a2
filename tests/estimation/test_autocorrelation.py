"""Correlated noise and residuals."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.signal import lfilter

from bristle.arrays import Array
from bristle.estimation.autocorrelation import autocorrelation, inflation, lag_one, standard_error

EMPTY = np.zeros(0)


def ar1(rho: float, shape: tuple[int, ...], seed: int = 0) -> Array:
    """AR(1) noise along the last axis, stationary."""
    noise = np.random.default_rng(seed).normal(size=(*shape[:-1], shape[-1] + 500))
    return np.asarray(lfilter([1.0], [1.0, -rho], noise)[..., 500:])


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9])
def test_inflation_of_ar1(rho: float) -> None:
    """AR(1) noise inflates the variance of a mean by (1 + rho) / (1 - rho)."""
    measured = np.mean([inflation(x) for x in ar1(rho, (30, 10_000))])
    assert measured == pytest.approx((1 + rho) / (1 - rho), rel=0.07)


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9])
def test_standard_error_is_the_deviation_of_means(rho: float) -> None:
    """Over repetitions, the standard error's root mean square is the standard deviation of the means."""
    x = ar1(rho, (200, 4000), seed=1)
    errors = [standard_error(row) or np.inf for row in x]
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(np.std(x.mean(axis=1)), rel=0.12)


@settings(deadline=None, max_examples=50)
@given(arrays(float, st.integers(1, 60), elements=st.floats(-1e6, 1e6)), st.floats(1e-3, 1e3), st.floats(-1e3, 1e3))
@example(np.array([np.finfo(float).tiny, 0, 0, 0, 0, 0]), 1.0, 0.0)
def test_inflation_is_bounded_and_ignores_sign(x: Array, scale: float, shift: float) -> None:
    """1 <= inflation <= n for any data, short or constant; a change of sign changes nothing, nor does a change of unit by a power of two."""
    tau = inflation(x)
    assert 1.0 <= tau <= max(x.size, 1)
    assert inflation(-x) == tau
    assert inflation(x * 2.0**5) == tau
    assert inflation(np.full(x.size, scale + shift)) == 1.0


@settings(deadline=None, max_examples=50)
@given(arrays(float, st.integers(2, 60), elements=st.floats(-1e3, 1e3)))
def test_autocorrelation_is_that_of_the_definition(x: Array) -> None:
    """The FFT gives the sums of products of the definition; lag zero is one, and no lag exceeds it."""
    rho, centred = autocorrelation(x), x - x.mean()
    assert rho[0] == pytest.approx(1.0)
    assert np.all(np.abs(rho) <= 1 + 1e-9)
    if np.ptp(x) > 1e-3:
        direct = [centred[k:] @ centred[: x.size - k] / (centred @ centred) for k in range(x.size)]
        assert rho == pytest.approx(np.array(direct), abs=1e-9)


def test_degenerate_series() -> None:
    """No sample, one sample and a constant have no correlation, and a standard error that is unknown or zero."""
    assert autocorrelation(EMPTY).size == 0
    assert lag_one(np.ones(1)) == lag_one(np.full(9, 0.1)) == 0.0
    assert standard_error(np.ones(1)) is None
    assert standard_error(np.full(50, 0.1)) == pytest.approx(0.0, abs=1e-15)
    assert lag_one(np.tile([1.0, -1.0], 50)) == pytest.approx(-0.99)
