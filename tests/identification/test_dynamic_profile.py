from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from bristle.arrays import Array
from bristle.estimation.covariance import student
from bristle.estimation.multistart import solve_from_starts
from bristle.estimation.nonlinear import LeastSquares, Minimum, Unknowns, minimise
from bristle.estimation.profile_likelihood import profiles
from bristle.identification.dynamic.descent import fit
from bristle.identification.dynamic.fit import DynamicSolution, fit_tracking
from bristle.identification.dynamic.problem import Prior, Unknown, Values
from bristle.identification.dynamic.uncertainty import profile_until_stable, with_three_ways
from bristle.identification.fits import Estimate
from bristle.model.parameters import ParameterName

from ..names import named, parse
from .conftest import GRIPPER, TONES, by_name, codes, error_of, holds, moved, posed, tones, value_of

STEP = 2e-3
TRUTH = by_name(GRIPPER)
A = parse("a")


def fitted(noise: float, seed: int, priors: Sequence[Prior] = (), slow: float = 0.25) -> DynamicSolution:
    """The fit, from the truth on, of a run of the gripper, 4 s, slow and fast, with white noise on the torque."""
    v = tones(np.arange(0, 4, STEP), ((slow, 0.5), *TONES[1:]))
    problem = replace(posed(moved(v, STEP, noise=noise, seed=seed)), priors=tuple(priors), sigma=3e-4)
    return fit_tracking(problem, TRUTH, "revolute", search=False)


@pytest.fixture(scope="module")
def gripper() -> DynamicSolution:
    return fitted(3e-4, 0)


def test_profiles_of_moving_data(gripper: DynamicSolution) -> None:
    """Each end, put in as a fixed value and all else fitted by the whole descent, costs J_min + (t error)**2 / (J'J)**-1_jj."""
    seen, _ = profiles(gripper.solution)
    problem, solution = gripper.problem, gripper.solution
    rows, jacobian = solution.minimum.residuals, solution.minimum.jacobian
    inverse = np.diag(np.linalg.inv(jacobian.T @ jacobian))
    for j, name in enumerate(problem.names[:-1]):
        assert isinstance(name, ParameterName)
        high = (student(solution.freedom) * solution.scaled_errors[j]) ** 2 / inverse[j]
        for value in seen[name].interval:
            rest = replace(problem, fixed={name: value})
            _, minimum = fit(rest, {n: v for n, v in gripper.values.items() if n != name})
            assert (minimum.cost - rows @ rows) / high == pytest.approx(1.0, abs=0.02)
    # it is zero at the estimate, one at both ends, ascends in value, and falls to the estimate and rises from it
    for name, (interval, (values, height), warnings) in seen.items():
        assert not warnings
        assert (np.diff(values) > 0).all()
        at = int(np.searchsorted(values, gripper.values[name] * (1 - 1e-9)))
        assert height[at] == 0
        assert (np.diff(height)[:at] <= 1e-3).all()
        assert (np.diff(height)[at:] >= -1e-3).all()
        np.testing.assert_allclose(np.interp(interval, values, height), 1.0, atol=1e-6)
    # progress is told parameter by parameter
    told = list[tuple[int, int]]()
    profiles(gripper.solution, lambda _, done, of: told.append((done, of)))
    assert told == [(k, 7) for k in range(7)]

    # no restart, no warning, the same fit
    def never(_: Values) -> DynamicSolution:
        raise AssertionError

    again, _ = profile_until_stable(gripper, never)
    assert again.fit.warnings == gripper.fit.warnings
    assert again.values == gripper.values


def two_minima(gripper: DynamicSolution, start: float) -> DynamicSolution:
    """The end next to a start of a cost with a minimum near a = -1 and a lower one at a = 1: (a**2 - 1)**2 + 0.04 (a - 1)**2, and noise."""
    noise, no = np.random.default_rng(0).standard_normal(58), np.full(1, np.inf)
    names: tuple[Unknown, ...] = (A,)
    unknowns = Unknowns(names=names, logarithmic=np.zeros(1, bool), scale=np.ones(1), lower=-no, upper=no, least=-no)

    def evaluate(x: Array) -> tuple[Array, Array]:
        a = x[0]
        return np.array([a * a - 1, 0.2 * (a - 1), *noise]), np.array([[2 * a], [0.2], *np.zeros((58, 1))])

    def solve(at: Values, *_: float) -> tuple[LeastSquares[Unknown], Minimum]:
        return LeastSquares(unknowns=unknowns, evaluate=evaluate), minimise(evaluate, np.array([at[A]]), -no, no)

    solution = solve_from_starts(solve, [{A: start}], lambda posed, minimum: (posed, minimum))
    return gripper._replace(solution=solution, values=solution.values)


def test_profiles_that_restart_the_fit_or_stay_open(gripper: DynamicSolution) -> None:
    """Begun in the higher of two minima, the profile walks into the lower one; the fit is done again from there, and says so."""
    first = two_minima(gripper, -1.0)
    assert first.values[A] == pytest.approx(-1.0, abs=0.1)
    assert profiles(first.solution)[1] is not None
    again, seen = profile_until_stable(first, lambda end: two_minima(gripper, end[A]))
    assert again.values[A] == pytest.approx(1.0, abs=1e-3)
    assert "refitted" in codes(again.fit.warnings)
    assert seen[A].interval[0] < 1 < seen[A].interval[1]
    # where the new fit ends in the old minimum each time, the search stops after three, says it, and still gives an interval
    again, seen = profile_until_stable(first, lambda _: first)
    assert "still-lower" in codes(again.fit.warnings)
    assert np.isfinite(seen[A].interval).all()
    # a run that is fast throughout: what is not identifiable has open profiles with the reason, nothing is NaN
    found = fitted(3e-3, 1, slow=2.0)
    unseen = {name for name, e in found.fit.parameters.items() if e.value is None}
    assert {parse("alpha_1"), parse("v_s")} <= unseen
    found, seen = profile_until_stable(found, lambda _: fitted(3e-3, 1, slow=2.0))
    fit_ = with_three_ways(found, found.fit, seen)
    assert set(fit_.uncertainty) == set(fit_.parameters)
    for name, three in fit_.uncertainty.items():
        for interval in (three.covariance, three.profile, three.bootstrap):
            assert interval is None or interval[0] <= interval[1]  # nor is an end nan
        assert np.isfinite(three.curve).all()
        assert np.isfinite(three.draws).all()
        is_open = three.profile is None or not np.isfinite(three.profile).all() or three.profile[0] == 0
        assert not is_open or three.warnings or fit_.parameters[name].warnings
        if name in TRUTH and fit_.parameters[name].value is not None:
            assert holds(three.profile, TRUTH[name])
    assert fit_.uncertainty[parse("alpha_1")].profile is None


def test_the_bias_of_counts_moves_all_three_alike(gripper: DynamicSolution) -> None:
    """Where the estimate was moved and its error widened, ends and draws are moved and spread by the same; open ends stay."""
    seen, _ = profiles(gripper.solution)
    alpha_1 = parse("alpha_1")
    seen[alpha_1] = seen[alpha_1]._replace(interval=(0.0, np.inf))
    plain = with_three_ways(gripper, gripper.fit, seen).uncertainty

    def moved(e: Estimate) -> Estimate:
        error = error_of(e)
        return replace(e, value=value_of(e) + 0.5 * error, standard_error=1.5 * error)

    shifted = replace(gripper.fit, parameters={n: moved(e) for n, e in gripper.fit.parameters.items()})
    three = with_three_ways(gripper, shifted, seen).uncertainty
    for name, e in gripper.fit.parameters.items():
        value, error = value_of(e), error_of(e)
        for way in ("profile", "bootstrap"):
            own, old = getattr(three[name], way), getattr(plain[name], way)
            if way == "profile" and name == alpha_1:
                assert own == (0.0, np.inf)
            else:
                expected = value + 0.5 * error + 1.5 * (np.array(old) - value)
                np.testing.assert_allclose(own, np.maximum(expected, 0.0), rtol=1e-9)
        assert three[name].draws.std() == pytest.approx(1.5 * plain[name].draws.std(), rel=1e-3)


@pytest.mark.slow
def test_intervals_hold_the_truth_and_agree() -> None:
    """Twenty runs of the gripper with priors for three parameters: of 140 intervals each way, 89 to 100 % hold the truth."""
    held = {"covariance": 0, "profile": 0, "bootstrap": 0}
    rng = np.random.default_rng(0)
    for seed in range(20):
        errors = named({"alpha_1": 2e-4, "v_s": 3e-3, "sigma_0": 0.1})
        priors = [
            Prior("static", (n,), np.array([TRUTH[n] + s * rng.standard_normal()]), np.array([[1 / s]]))
            for n, s in errors.items()
        ]
        found = fitted(3e-4, seed, priors)
        seen, better = profiles(found.solution)
        assert better is None
        three = with_three_ways(found, found.fit, seen).uncertainty
        for name, truth in TRUTH.items():
            for way in held:
                held[way] += holds(getattr(three[name], way), truth)
    assert all(0.89 * 140 <= hits <= 140 for hits in held.values()), held
