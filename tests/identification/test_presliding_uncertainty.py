from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from bristle.arrays import Array
from bristle.data.record import Record
from bristle.data.slow_loading import Loading, find_loadings
from bristle.estimation.covariance import student
from bristle.findings import CAUTION, Finding
from bristle.identification.fits import Uncertainty
from bristle.identification.presliding.fit import fit_presliding
from bristle.identification.presliding.stiffness import REACH, KnownValue, by_edges, of_loading, stiffness
from bristle.identification.presliding.uncertainty import stiffness_uncertainty

from .conftest import G0, GRIPPER, bent, ends_of, holds, known, value_of

TIME = np.arange(0, 20, 0.02)
TORQUE = 0.78 * G0 * TIME / 20
FINE = 2 * np.pi / 2**17
WAYS = ("edges", "samples")


def loadings(seed: int, noise: float = 0.02, runs: int = 2) -> list[Loading]:
    """Slow ramps that rest anywhere in a count, with noise in the torque."""
    rng = np.random.default_rng(seed)
    y = bent(TORQUE)
    found: list[Loading] = []
    for _ in range(runs):
        position = FINE * np.floor(y / FINE + rng.uniform())
        torque = TORQUE + noise * GRIPPER.alpha_0 * rng.standard_normal(TIME.size)
        found += find_loadings(Record(file="ramp.csv", time=TIME, position=position, torque=torque), 10.0, FINE, None)
    return found


def three_ways(own: list[Loading], level: KnownValue, way: str, seed: int = 0) -> Uncertainty:
    return stiffness_uncertainty(own, level, way, stiffness(own, level, "revolute")[way], seed)


def ends(three: Uncertainty) -> Array:
    """Of covariance, profile and bootstrap, (3, 2)."""
    return np.array([three.covariance, three.profile, three.bootstrap], dtype=np.float64)


def widths(three: Uncertainty) -> Array:
    """The same, (3,)."""
    own: Array = np.diff(ends(three), axis=1)[:, 0]
    return own


def test_profiles_of_slow_loading() -> None:
    """At given g0 the line through the count edges is linear least squares: both intervals are the same to 1e-6 of the width."""
    three = three_ways(loadings(0), known(G0, 0.0), "edges")
    np.testing.assert_allclose(ends(three)[1], ends(three)[0], rtol=0, atol=1e-6 * widths(three)[0])
    assert not three.warnings
    # a g0 that may be much lower makes a much stiffer joint: the profile reaches farther up than the covariance, which is symmetric
    own, level = loadings(2), known(G0, 0.06 * G0)
    levels = (known(0.9 * G0, 0.0), level, known(1.1 * G0, 0.0))
    low, value, high = (value_of(stiffness(own, x, "revolute")["edges"]) for x in levels)
    three = three_ways(own, level, "edges")
    longer = np.sign((low - value) - (value - high))
    for low_end, high_end in map(ends_of, (three.profile, three.bootstrap)):
        assert np.sign((high_end - value) - (value - low_end)) == longer
    # the presliding fit carries the recommended estimator's; the same seed draws the same bytes, another one others
    own, level = loadings(0), known(G0, 0.003 * G0)
    fit = fit_presliding(own, level, None, "revolute")
    same, other = (three_ways(own, level, fit.recommended, seed) for seed in (0, 1))
    assert fit.uncertainty["sigma_0"].draws.tobytes() == same.draws.tobytes() != other.draws.tobytes()
    assert fit.uncertainty["sigma_0"].profile == other.profile
    # where no sample is left below a g0 within its error, that g0 is left out: no end of an interval is nan, or the other end
    (whole,) = loadings(0, 0.0, runs=1)
    few = slice(-12, None)
    late = replace(whole, quantum=0.0, **{n: getattr(whole, n)[few] for n in ("time", "displacement", "torque")})
    level = known(1.01 * float(late.torque[-1]) / REACH, 0.1 * G0)
    assert late.torque[0] > REACH * (level.value - level.standard_error)
    three = three_ways([late], level, "samples")
    for low, high in map(ends_of, (three.covariance, three.profile)):
        assert low < high
    # where counts hide the motion the profile is the lower bound, open above, with the reason; nothing is drawn
    own, level = loadings(0), known(G0, 0.01 * G0)
    estimates = stiffness(own, level, "revolute")
    finer = Finding("within-noise", CAUTION, "sigma_0 is at least 2 N*m/rad.", {"least": 2.0})
    hidden = Uncertainty(covariance=None, profile=(2.0, np.inf), bootstrap=None, warnings=(finer,))
    bound = estimates["edges"].__class__(value=None, unit="", interval=(2.0, np.inf), warnings=hidden.warnings)
    three = stiffness_uncertainty(own, level, "edges", bound)
    assert three.profile == (2.0, np.inf)
    assert three.covariance is None
    assert three.bootstrap is None
    assert three.warnings == hidden.warnings
    assert three.draws.size == 0


@pytest.mark.parametrize("way", WAYS)
def test_a_small_error_of_g0_leaves_them_together(way: str) -> None:
    """With an error of g0 over which the estimator is nearly a line all three widths agree, and are wider than without it."""
    own = loadings(0)
    sure, unsure = (three_ways(own, known(G0, share * G0), way) for share in (0.0, 0.003))
    assert (widths(unsure) > widths(sure)).all()
    assert widths(unsure) == pytest.approx(widths(unsure)[0], rel=0.15)
    # it ascends in value and is the statistic of which the interval is made
    own, level = loadings(3), known(G0, 0.003 * G0)
    three, value = three_ways(own, level, way), value_of(stiffness(own, level, "revolute")[way])
    assert (np.diff(three.curve[0]) > 0).all()
    assert np.interp(ends_of(three.profile), *three.curve) == pytest.approx([1.0, 1.0], abs=1e-3)
    assert np.interp(value, *three.curve) == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("share", [0.01, 0.03])
def test_a_profile_ends_where_the_least_over_g0_is_the_threshold(share: float) -> None:
    """At each end ((u - u(g0)) / e(g0))**2 + ((g0 - level) / error)**2, minimised by another method, is the square of Student's t."""
    own, error = loadings(1), share * G0
    three = three_ways(own, known(G0, error), "edges")
    freedom = by_edges([of_loading(x, G0) for x in own])[2]
    for end in ends_of(three.profile):

        def least(x: float, end: float = end) -> float:
            u, e, _ = by_edges([of_loading(one, G0 + x * error) for one in own])
            return ((end - u) / e) ** 2 + x * x

        found = minimize_scalar(least, bounds=(-student(freedom), student(freedom)), method="bounded")
        assert found.fun == pytest.approx(student(freedom) ** 2, rel=0.06)


@pytest.mark.slow
def test_intervals_hold_the_truth() -> None:
    """Over 40 joints whose g0 is off by its error, each way's intervals hold sigma_0 in 85 % at least, by each estimator."""
    error, hits = 0.004 * G0, {way: np.zeros(3) for way in WAYS}
    rng = np.random.default_rng(0)
    for seed in range(40):
        own, level = loadings(seed), known(G0 + error * rng.standard_normal(), error)
        for way in WAYS:
            three = three_ways(own, level, way)
            hits[way] += [holds(x, GRIPPER.sigma_0) for x in (three.covariance, three.profile, three.bootstrap)]
    assert all((found >= 0.85 * 40).all() for found in hits.values()), hits


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("error", [np.nan, np.inf])
def test_a_g0_without_an_error_that_is_a_number_is_taken_as_it_is(way: str, error: float) -> None:
    """Where nothing tells how well g0 is known, the profile is the one at that g0, and no fault of ours."""
    own = loadings(0)
    estimate = stiffness(own, known(G0, 0.0), "revolute")[way]
    unknown, exact = (stiffness_uncertainty(own, known(G0, e), way, estimate) for e in (error, 0.0))
    assert unknown.profile == exact.profile
