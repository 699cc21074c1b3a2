"""Block bootstrap of a least-squares step: what it knows of correlation, priors and seeds."""

from itertools import combinations_with_replacement

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from bristle.arrays import Array
from bristle.estimation import bootstrap
from bristle.estimation.bootstrap import block_bootstrap, residual_bootstrap


def correlated(rho: float, n: int, seed: int) -> Array:
    """AR(1) noise with innovations of variance one, (n,)."""
    noise = np.random.default_rng(seed).standard_normal(n + 500)
    return np.asarray(lfilter([1.0], [1.0, -rho], noise)[500:], dtype=float)


def mean_of(x: Array, **options: int) -> Array:
    """What the mean of x moves by in resampled data, (B,)."""
    return block_bootstrap(-np.ones((x.size, 1)), x - x.mean(), **options).steps[:, 0]  # type: ignore[arg-type]


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.8])
def test_the_mean_of_correlated_noise_scatters_as_it_should(rho: float) -> None:
    """Over series the mean variance of the draws is 1 / (n (1 - rho)**2), less what block ends cut off: 2 rho / ((1 - rho**2) L), and L / n."""
    n, length, series = 4000, 100, 40
    found = [mean_of(correlated(rho, n, seed), length=length, draws=300, seed=seed).var() for seed in range(series)]
    cut = 2 * rho / ((1 - rho**2) * length) + length / n
    true = (1 - cut) / (n * (1 - rho) ** 2)
    spread = np.std(found) / np.sqrt(series)
    assert np.mean(found) == pytest.approx(true, abs=3.5 * spread)
    assert spread < 0.05 * true


def test_skewed_data_have_a_skewed_interval() -> None:
    """The mean of exponential noise: bootstrap-t reaches farther up than down, as the truth lies."""
    x = np.random.default_rng(2).exponential(size=60)
    low, high = block_bootstrap(-np.ones((60, 1)), x - x.mean(), length=1, draws=8000).interval(0, 1.0)
    assert high > 1.15 * -low


def test_priors_count() -> None:
    """With a prior of its own weight the draws scatter by (G s**2 + sigma**2 P**2) / (G + P**2)**2, and t is of unit variance."""
    rng = np.random.default_rng(3)
    n, P, sigma, s = 1000, 30.0, 1.5, 0.7
    J, left = rng.standard_normal((n, 1)), s * rng.standard_normal(n)
    left -= J[:, 0] * (J[:, 0] @ left) / (J[:, 0] @ J[:, 0])
    found = block_bootstrap(J, left, priors=np.array([[P]]), sigma=sigma, length=1, draws=3000)
    G = float(J[:, 0] @ J[:, 0])
    assert found.steps.std() == pytest.approx(np.sqrt(G * s**2 + sigma**2 * P**2) / (G + P**2), rel=0.06)
    assert found.studentised.std() == pytest.approx(1.0, rel=0.06)


def test_studentised_draws_do_not_know_the_block_length() -> None:
    """Blocks that cut correlation make draws scatter by too little; t has unit variance all the same."""
    x = correlated(0.9, 6000, 4)
    short = block_bootstrap(-np.ones((x.size, 1)), x - x.mean(), length=12, draws=2000)
    true = 10 / np.sqrt(x.size)
    assert short.steps.std() < 0.8 * true
    assert short.studentised.std() == pytest.approx(1.0, rel=0.08)


def test_the_seed_says_it_all() -> None:
    """The same seed gives the same bytes, another one others."""
    x = correlated(0.5, 500, 0)
    assert mean_of(x, seed=7).tobytes() == mean_of(x, seed=7).tobytes()
    assert mean_of(x, seed=7).tobytes() != mean_of(x, seed=8).tobytes()


@given(st.floats(-6, 6), st.integers(0, 5))
@settings(deadline=None, max_examples=20)
def test_a_step_scales_with_its_parameter(power: float, seed: int) -> None:
    """Expressing a parameter in another unit changes its steps by that unit and nothing else, t not at all."""
    rng = np.random.default_rng(seed)
    J, left = rng.standard_normal((200, 2)), rng.standard_normal(200)
    unit = np.array([10.0**power, 1.0])
    one, other = (block_bootstrap(j, left, length=5, draws=50, seed=seed) for j in (J, J * unit))
    np.testing.assert_allclose(other.steps * unit, one.steps, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(other.studentised, one.studentised, rtol=1e-6, atol=1e-9)


def test_segments_as_long_as_a_cell_are_blocks_of_their_own() -> None:
    """Residuals that are one constant per segment: with segments as blocks the mean scatters as the mean of as many independent values."""
    rng = np.random.default_rng(5)
    level = rng.standard_normal(50)
    x = np.repeat(level - level.mean(), 20)
    found = block_bootstrap(-np.ones((1000, 1)), x, range(0, 1000, 20), length=1000, draws=4000)
    assert found.blocks == 50
    assert found.steps.std() == pytest.approx(level.std() / np.sqrt(50), rel=0.06)


def test_of_a_mean_t_is_that_of_each_resample() -> None:
    """Of three values with blocks of one, t is (mean* - mean) / (s* / sqrt(3)) of one of the ten resamples that there are, s* about its own mean."""
    x = np.array([-2.0, 0.5, 1.5])
    samples = [np.array(one) for one in combinations_with_replacement(x, 3) if np.ptp(one) > 0]
    expected = np.array([-one.mean() / (one.std(ddof=1) / np.sqrt(3)) for one in samples])
    found = block_bootstrap(-np.ones((3, 1)), x, length=1, draws=300).studentised[:, 0]
    usual = found[np.abs(found) < 1e6]  # three times the same value has no s*
    assert 200 < usual.size < 300
    assert np.abs(np.abs(usual)[:, None] - np.abs(expected)).min(axis=1).max() < 1e-9
    assert np.unique(np.round(usual, 9)).size == expected.size


def test_draws_in_parts_are_draws(monkeypatch: pytest.MonkeyPatch) -> None:
    """However few numbers are drawn at once: as many draws, all different, the same errors of the estimate, and the covariance s**2 (J'J)**-1."""
    rng, n = np.random.default_rng(3), 200
    J, residuals = np.column_stack([np.ones(n), np.linspace(-1, 1, n)]), rng.standard_normal(n)
    whole, errors = residual_bootstrap(J, residuals, np.ones(n), draws=4000)
    monkeypatch.setattr(bootstrap, "_AT_ONCE", 7 * n)
    parts, same = residual_bootstrap(J, residuals, np.ones(n), draws=4000)
    assert parts.steps.shape == parts.studentised.shape == whole.steps.shape == (4000, 2)
    np.testing.assert_allclose(same, errors, rtol=1e-12)
    np.testing.assert_allclose(np.cov(parts.steps.T), np.cov(whole.steps.T), rtol=0.1, atol=6e-4)
    assert len(np.unique(parts.steps[:, 0])) == 4000
