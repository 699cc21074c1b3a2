from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from bristle.arrays import Array, Interval
from bristle.estimation.covariance import student
from bristle.estimation.profile_likelihood import profiles
from bristle.findings import NOTE, Finding
from bristle.identification.dynamic.descent import fit, solve_dynamic
from bristle.identification.dynamic.fit import DynamicSolution, fit_tracking
from bristle.identification.dynamic.problem import DynamicProblem, Motion, Prior, Unknown, Values
from bristle.identification.dynamic.uncertainty import profile_until_stable, with_three_ways
from bristle.identification.fits import Estimate, TrackingFit
from bristle.model.parameters import Direction, Lugre, ParameterName

from ..conftest import present
from ..names import named, parse
from .conftest import GRIPPER, TONES, by_name, codes, error_of, holds, moved, posed, tones, value_of

STEP = 2e-3
TRUTH = by_name(GRIPPER)
LUGRE = named(dict.fromkeys(Lugre._fields, 1.0))
A, B, C = map(parse, "abc")


def fitted(noise: float, seed: int, priors: Sequence[Prior] = (), slow: float = 0.25) -> DynamicSolution:
    """The fit, from the truth on, of a run of the gripper, 4 s, slow and fast, with white noise on the torque."""
    v = tones(np.arange(0, 4, STEP), ((slow, 0.5), *TONES[1:]))
    problem = replace(posed(moved(v, STEP, noise=noise, seed=seed)), priors=tuple(priors), sigma=3e-4)
    return fit_tracking(problem, TRUTH, "revolute", search=False)


@pytest.fixture(scope="module")
def gripper() -> DynamicSolution:
    return fitted(3e-4, 0)


def linear(columns: Array, torque: Array, priors: Sequence[Prior] = ()) -> DynamicProblem:
    """A problem with a column for each of a, b and so on, and nothing else that is free."""
    names = (A, B, C)[: columns.shape[1]]
    t = np.arange(torque.size, dtype=np.float64)
    motion = Motion(
        file="x", time=t, velocity=np.ones(t.size), torque=torque, extra=columns, smooth=None, measured=torque
    )

    def equations(
        _: DynamicProblem, known: Values, __: Sequence[dict[Unknown, Array]]
    ) -> Iterator[tuple[Array, dict[Unknown, Array]]]:
        yield torque - columns @ [known[n] for n in names], dict(zip(names, columns.T, strict=True))

    return DynamicProblem(
        motions=(motion,), directions=(Direction.BOTH,), extra_names=names, fixed=LUGRE, initial_states=(),
        equations=equations, priors=tuple(priors), sigma=1.0,
    )  # fmt: skip  # a list of values


def solved(problem: DynamicProblem, start: Values) -> DynamicSolution:
    """The problem's minimum next to a start, with a fit that says its intervals by the covariance."""
    solution = solve_dynamic(problem, start, search=False)
    reach = student(solution.freedom)
    errors = solution.scaled_errors * solution.posed.unknowns.scale
    parameters = {
        name: Estimate(
            value=solution.values[name],
            unit="",
            standard_error=error,
            interval=(solution.values[name] - reach * error, solution.values[name] + reach * error),
        )
        for name, error in zip(problem.names, errors.tolist(), strict=True)
        if isinstance(name, ParameterName)
    }
    converged = Finding("converged", NOTE, "The fit converged.")
    found = TrackingFit(
        parameters=parameters, rms=1.0, relative_error=1.0, n=1, outcome=converged, starts=1, reached=1, condition=1.0
    )  # fmt: skip  # a list of values
    return DynamicSolution(found, problem, solution.values, solution)


def close(one: Interval | None, other: Interval | None, share: float) -> None:
    low, high = present(other)
    assert present(one) == pytest.approx((low, high), abs=share * (high - low))


@pytest.mark.parametrize("rho", [0.0, 0.9])
@pytest.mark.parametrize("told", [False, True])
def test_in_a_linear_problem_all_three_coincide(rho: float, told: bool) -> None:
    """Profile and covariance agree to 1e-6 of the width, residuals correlated or not, a prior or none; bootstrap-t to what chance leaves."""
    rng = np.random.default_rng(3)
    columns = np.column_stack([np.ones(3000), np.sin(np.arange(3000) / 40), rng.standard_normal(3000)])
    torque = columns @ [1.0, 2.0, 3.0] + lfilter([1.0], [1.0, -rho], rng.standard_normal(3000))
    priors = [Prior("static", (A,), np.array([1.1]), np.array([[1 / 0.1]]))] if told else []
    rows = np.vstack([columns, [[10.0 * told, 0.0, 0.0]]])
    exact = np.linalg.lstsq(rows, np.append(torque, 11.0 * told))[0]
    found = solved(linear(columns, torque, priors), dict(zip((A, B, C), exact.tolist(), strict=True)))
    seen, better = profiles(found.solution)
    assert better is None
    three = with_three_ways(found, found.fit, seen).uncertainty
    for name in (A, B, C):
        close(three[name].profile, three[name].covariance, 1e-6)
        close(three[name].bootstrap, three[name].covariance, 0.12)
        assert not three[name].warnings
    assert three[A].draws.std() > 0


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
    seen, _ = profiles(gripper.solution)
    for name, (interval, (values, height), warnings) in seen.items():
        assert not warnings
        assert (np.diff(values) > 0).all()
        at = int(np.searchsorted(values, gripper.values[name] * (1 - 1e-9)))
        assert height[at] == 0
        assert (np.diff(height)[:at] <= 1e-3).all()
        assert (np.diff(height)[at:] >= -1e-3).all()
        np.testing.assert_allclose(np.interp(interval, values, height), 1.0, atol=1e-6)
    # a well-posed fit costs two evaluations a side (28 for seven parameters); progress is told parameter by parameter
    count, told = [0], list[tuple[str, int, int]]()
    posed = gripper.solution.posed

    def counted(x: Array) -> tuple[Array, Array]:
        count[0] += 1
        return posed.evaluate(x)

    solution = gripper.solution._replace(posed=replace(posed, evaluate=counted))
    profiles(solution, lambda *what: told.append(what))
    assert count[0] <= 30
    assert [done for _, done, _ in told] == list(range(7))
    assert {of for _, _, of in told} == {7}

    # no restart, no warning, the same fit
    def never(_: Values) -> DynamicSolution:
        raise AssertionError

    again, _ = profile_until_stable(gripper, never)
    assert again.fit.warnings == gripper.fit.warnings
    assert again.values == gripper.values


def two_minima(k: float = 1.0, tilt: float = 0.2) -> DynamicProblem:
    """A cost with a minimum near a = -1 and a lower one at a = 1: k**2 (a**2 - 1)**2 + tilt**2 (a - 1)**2, and noise that a does not touch."""
    problem = linear(np.ones((60, 1)), np.ones(60))
    noise = np.random.default_rng(0).standard_normal(60)
    noise[:2] = 0.0

    def double(
        _: DynamicProblem, known: Values, __: Sequence[dict[Unknown, Array]]
    ) -> Iterator[tuple[Array, dict[Unknown, Array]]]:
        a, rest, slope = known[A], noise.copy(), np.zeros(60)
        rest[:2] = k * (a * a - 1), tilt * (a - 1)
        slope[:2] = -2 * k * a, -tilt
        yield rest, {A: slope}

    return replace(problem, equations=double)


def test_profiles_that_restart_the_fit_or_stay_open() -> None:
    """Begun in the higher of two minima, the profile walks into the lower one; the fit is done again from there, and says so."""
    problem = two_minima()
    first = solved(problem, {A: -1.0})
    assert first.values[A] == pytest.approx(-1.0, abs=0.1)
    assert profiles(first.solution)[1] is not None
    again, seen = profile_until_stable(first, lambda end: solved(problem, {A: end[A]}))
    assert again.values[A] == pytest.approx(1.0, abs=1e-3)
    assert "refitted" in codes(again.fit.warnings)
    assert seen[A].interval[0] < 1 < seen[A].interval[1]
    # where the new fit ends in the old minimum each time, the search stops after three, says it, and still gives an interval
    first = solved(two_minima(), {A: -1.0})
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
        if name in TRUTH and three.profile is not None:
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
