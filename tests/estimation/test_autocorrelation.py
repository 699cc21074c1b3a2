"""Correlated noise and residuals."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.signal import lfilter

from bristle.arrays import Array
from bristle.estimation.autocorrelation import autocorrelation, inflation, lag_one, residual_warnings, standard_error

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


@pytest.mark.parametrize(
    ("axis", "kind", "over"),
    [(1, "residual-trend", "velocity"), (2, "residual-trend", "time"), (3, "residual-ripple", None)],
)
def test_a_planted_trend_or_ripple_is_told(axis: int, kind: str, over: str | None) -> None:
    """A trend over time or velocity, or a ripple over position, of the size of the noise is told, and nothing else is."""
    rng = np.random.default_rng(3)
    noise, velocity, time, position = rng.normal(size=(4, 200))
    signals = (noise, velocity, time, position)
    shape = np.sin(2 * np.pi * 7 * position / np.ptp(position)) if axis == 3 else signals[axis]
    (told,) = residual_warnings(noise + 1.2 * shape, velocity, time, position)
    assert (told.code, told.numbers.get("over")) == (kind, over)
    assert told.numbers["p"] < 0.01


def test_friction_that_falls_is_told_with_its_size() -> None:
    """Friction that falls by 1 from the beginning to the end, in both directions, is no trend of the torque, and is told as what it is."""
    rng, time = np.random.default_rng(4), np.linspace(0, 60, 200)
    velocity = rng.permutation(np.linspace(-1, 1, 200))
    (told,) = residual_warnings(
        0.2 * rng.standard_normal(200) + np.sign(velocity) * (0.5 - time / 60), velocity, time, EMPTY
    )
    assert told.code == "friction-drifts"
    assert told.numbers["change"] == pytest.approx(-1, abs=0.15)
    assert told.effect == {"torque": -told.numbers["change"]}


def test_a_difference_between_directions_is_told() -> None:
    """What a symmetric curve leaves of friction that is not - a constant, or a slope over speed - is told; what is odd in velocity is not."""
    rng = np.random.default_rng(6)
    velocity, noise = rng.uniform(-1, 1, 200), rng.normal(size=200)
    for even in (np.ones(200), np.abs(velocity)):
        told = residual_warnings(noise + even, velocity, EMPTY, EMPTY)
        assert any(warning.code == "directions-differ" for warning in told)
    told = residual_warnings(noise + velocity, velocity, EMPTY, EMPTY)
    assert not any(warning.code == "directions-differ" for warning in told)


def test_noise_alone_is_rarely_told() -> None:
    """White and correlated residuals without a trend give a warning in no more than 2 % of cases, as the 1 % of the correction promises."""
    rng = np.random.default_rng(4)
    time = np.linspace(0, 1, 400)
    cases = [*rng.normal(size=(100, 400)), *ar1(0.7, (100, 400), seed=5)]
    told = [bool(residual_warnings(x, rng.uniform(0, 1, 400), time, rng.uniform(0, 1, 400))) for x in cases]
    assert np.mean(told) <= 0.03


def test_unknown_axes_and_exact_fits_are_not_told() -> None:
    """Axes that are empty, or constant, and residuals that are all zero, or fewer than eight, give no warning."""
    x = np.linspace(0, 1, 30)
    assert residual_warnings(x, EMPTY, EMPTY, EMPTY) == ()
    assert residual_warnings(x, np.ones(30), np.ones(30), np.ones(30)) == ()
    assert residual_warnings(np.zeros(30), x, x, x) == ()
    assert residual_warnings(x[:7], x[:7], x[:7], x[:7]) == ()
