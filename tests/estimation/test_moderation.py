"""Variances of few degrees of freedom: made steady by what they have in common, and left alone where that is nothing."""

import numpy as np
import pytest
from scipy.special import stdtrit

from bristle.estimation.moderation import moderated, normal_errors

RNG = np.random.default_rng(0)


def drawn(truth: np.ndarray, freedom: float) -> np.ndarray:
    """Estimates of variances with so many degrees of freedom."""
    return truth * RNG.chisquare(freedom, truth.shape) / freedom


@pytest.mark.parametrize("freedom", [2.0, 4.0, 10.0])
def test_what_is_one_variance_becomes_one(freedom: float) -> None:
    """Estimates of one variance become that, with a fifth of their scatter at the most, and rest on many more degrees of freedom."""
    found = drawn(np.full(1000, 2.5), freedom)
    steady, more = moderated(found, np.full(1000, freedom))
    assert np.median(steady) == pytest.approx(2.5, rel=0.1)
    assert np.log(steady).std() < np.log(found).std() / 5
    assert more.min() > 4 * freedom


def test_what_has_nothing_in_common_stays() -> None:
    """Over ten decades the larger half keep their estimates; those with infinitely many degrees of freedom always do, and one alone."""
    truth = 10.0 ** RNG.uniform(-10, 0, 500)
    found = drawn(truth, 8.0)
    steady, more = moderated(found, np.full(500, 8.0))
    large = found > np.median(found)
    assert steady[large] == pytest.approx(found[large], rel=0.15)
    assert more == pytest.approx(8.0, rel=0.05)
    mixed = np.where(np.arange(500) % 2 == 0, np.inf, 8.0)
    steady, more = moderated(found, mixed)
    assert np.array_equal(steady[::2], found[::2])
    assert np.isinf(more[::2]).all()
    assert moderated(found[:1], np.array([3.0]))[0] == found[:1]


def test_the_prior_is_found() -> None:
    """Variances drawn from a scaled inverse chi-squared with 6 degrees of freedom: so many are added, within a quarter."""
    truth = 6.0 / RNG.chisquare(6.0, 5000)
    _, more = moderated(drawn(truth, 4.0), np.full(5000, 4.0))
    assert more - 4.0 == pytest.approx(6.0, rel=0.25)


def test_normal_errors_are_as_wide_as_they_say() -> None:
    """Estimates with intervals of 4 degrees of freedom lie outside 1.96 of the errors made of these in 5 %, outside 3.29 in 0.1 % of the cases."""
    true = np.full(20_000, 0.3)
    error = np.sqrt(drawn(true**2, 4.0))
    z = true * RNG.standard_normal(true.size) / normal_errors(error, float(stdtrit(4.0, 0.975)) * error)
    assert (np.abs(z) > 1.96).mean() == pytest.approx(0.05, abs=0.006)
    assert (np.abs(z) > 3.29).mean() < 0.003
    plain = np.array([1.0, 2.0, 3.0, 4.0])
    assert normal_errors(plain, np.array([1.95996, np.inf, np.nan, 3.0])) == pytest.approx(plain, rel=1e-5)
