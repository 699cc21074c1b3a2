import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import curve_fit

from bristle.arrays import Array
from bristle.data.constant_velocity.segments import Segment
from bristle.data.experiment.schema import FitOptions
from bristle.identification.fits import StaticFit
from bristle.identification.moving_runs import load_columns
from bristle.identification.static.fit import PointInfo, estimate_static, fit_static
from bristle.identification.static.grid import Projected, default_range, plain_grid, solve, solve_at
from bristle.identification.static.problem import from_points
from bristle.model.parameters import Lugre

from ..names import parse
from .conftest import GRIPPER, codes, curve, holds, white

STATIC = ("alpha_0", "alpha_1", "alpha_2", "v_s")


def segments_of(velocity: Array, torque: Array, stick_slip: NDArray[np.bool_] | None = None) -> tuple[Segment, ...]:
    return tuple(
        Segment(
            file=f"run_{k}.csv", start=0, stop=100, velocity=v, torque=T, standard_error=None, accepted=True,
            stick_slip=stick_slip is not None and bool(stick_slip[k]),
        )
        for k, (v, T) in enumerate(zip(velocity.tolist(), torque.tolist(), strict=True))
    )  # fmt: skip  # a list of values


def points(velocity: Array, torque: Array, stick_slip: NDArray[np.bool_] | None = None) -> StaticFit:
    where = PointInfo(segments=segments_of(velocity, torque, stick_slip))
    return fit_static(from_points(velocity, torque, ("+",)), FitOptions(), "revolute", where)[0]["+"]


@pytest.mark.slow
def test_intervals_cover_the_truth_as_often_as_they_say(gripper: Lugre[float], speeds: Array) -> None:
    """95 % intervals cover each true parameter in 95 % of 300 repetitions, within three binomial deviations; `benchmarks/coverage.py` does 1000."""
    rng = np.random.default_rng(0)
    hits = dict.fromkeys(STATIC, 0)
    for _ in range(300):
        torque = curve(speeds, gripper) + 0.01 * gripper.alpha_0 * rng.standard_normal(speeds.size)
        found = estimate_static(from_points(speeds, torque, ("+",)), FitOptions(), "revolute")
        for name in STATIC:
            hits[name] += holds(found[name].interval, getattr(gripper, name))
    assert all(abs(count / 300 - 0.95) < 3 * np.sqrt(0.95 * 0.05 / 300) for count in hits.values()), hits


def test_peaks_are_found_where_they_are(speeds: Array, gripper: Lugre[float]) -> None:
    """From Coulomb and viscous friction alone, alpha_1 and v_s do not exist and say why; the other two are there and right."""
    torque = 0.02 + 0.04 * speeds + white(speeds.size, 1e-4, 3)
    fit = points(speeds, torque)
    assert fit.outcome.code == "static-no-stribeck"
    for name in ("alpha_1", "v_s"):
        estimate = fit.parameters[name]
        assert estimate.value is None
        assert estimate.warnings[0].code == "no-stribeck"
    for name, true in (("alpha_0", 0.02), ("alpha_2", 0.04)):
        assert holds(fit.parameters[name].interval, true)
    # a significant concave bend over the whole range, as worn or lubricated drives show it, is not fitted by a Stribeck term
    velocity = np.linspace(0.01, 0.12, 40)
    torque = 20 + 200 * velocity - 400 * velocity**2 + white(40, 0.02, 4)
    fit = points(velocity, torque)
    assert fit.outcome.code == "static-no-stribeck"
    (refused,) = (warning for warning in fit.warnings if warning.code == "no-stribeck")
    assert refused.numbers["why"].code in {"bend", "no-peak"}
    # a curve that rises at every speed keeps a Stribeck term that the data show: alpha_2 > 0.86 alpha_1 / v_s is none
    p = gripper._replace(alpha_2=gripper.alpha_1 / gripper.v_s)
    assert (np.diff(curve(speeds, p)) > 0).all()
    fit = points(speeds, curve(speeds, p) + white(speeds.size, 2e-5, 6))
    assert fit.outcome.code == "static-converged"
    assert fit.parameters["v_s"].value == pytest.approx(p.v_s, rel=0.1)
    # with flagged points the warning has the fit without them, from the other points alone
    flags = speeds < 0.02
    torque = curve(speeds, gripper) + white(speeds.size, 1e-4, 6)
    fit = points(speeds, torque, flags)
    alone = points(speeds[~flags], torque[~flags])
    (warning,) = (w for w in fit.warnings if w.code == "stick-slip-points")
    assert warning.numbers["alpha_0"] == pytest.approx(alone.parameters["alpha_0"].value, rel=1e-5)
    # ten points at one speed cannot tell Coulomb from viscous friction, and say so; together they are known
    velocity = np.full(10, 0.2)
    fit = points(velocity, curve(velocity, gripper) + white(10, 1e-5, 8))
    assert all("one-speed-only" in codes(fit.parameters[name].warnings) for name in ("alpha_0", "alpha_2"))
    assert fit.parameters["alpha_0"].value == pytest.approx(float(curve(np.array([0.2]), gripper)[0]), rel=1e-3)
    assert fit.parameters["alpha_2"].value == 0
    # with no speed below v_s the Stribeck term is dropped
    velocity = np.geomspace(1.2 * gripper.v_s, 0.8, 14)
    assert points(velocity, curve(velocity, gripper) + white(14, 2e-5, 8)).outcome.code == "static-no-stribeck"


@pytest.mark.parametrize(
    ("count", "outcome"), [(1, "static-too-few"), (2, "static-too-few"), (4, "static-no-stribeck")]
)
def test_few_points_give_few_parameters(count: int, outcome: str, gripper: Lugre[float]) -> None:
    """Never more parameters than the points carry: none from two, two from four, each absence with its reason."""
    velocity = np.linspace(0.05, 0.5, count)
    fit = points(velocity, curve(velocity, gripper))
    assert fit.outcome.code == outcome
    assert all(estimate.value is not None or estimate.warnings for estimate in fit.parameters.values())


def test_units_directions_and_checks_of_a_fit(speeds: Array, gripper: Lugre[float]) -> None:
    """The same fit of a prismatic joint is in N, N*s/m and m/s."""
    torque = curve(speeds, GRIPPER) + white(speeds.size, 1e-5, 10)
    found = estimate_static(from_points(speeds, torque, ("both",)), FitOptions(), "prismatic")
    assert [found[name].unit for name in STATIC] == ["N", "N", "N*s/m", "m/s"]
    # where two directions share a regressor, what is left without the points that stick is each direction's own, not the other's
    v = np.concatenate([speeds, -speeds])
    torque = np.concatenate([curve(speeds, gripper), -0.5 * curve(speeds, gripper)])
    torque = torque + white(v.size, 1e-5, 2)
    q = np.random.default_rng(3).uniform(0.0, 3.0, v.size)
    problem = from_points(
        v, torque + 0.01 * np.sin(q), ("+", "-"), {"gravity_sin": np.sin(q), "gravity_cos": np.cos(q)}
    )
    where = PointInfo(segments=segments_of(v, torque, np.arange(v.size) % 5 == 1))
    fits, _ = fit_static(problem, FitOptions(), "revolute", where)
    (warning,) = (w for w in fits["shared"].warnings if w.code == "stick-slip-points")
    for d, share in (("+", 1.0), ("-", 0.5)):
        assert warning.numbers[f"alpha_0{d}"] == pytest.approx(share * gripper.alpha_0, rel=0.1)
    assert {"gravity_sin", "gravity_cos"} <= warning.numbers.keys()
    # without a Stribeck term the full fit has none either, and finds the cost that the reported residuals have
    torque = 0.02 + 0.04 * speeds + white(speeds.size, 1e-4, 3)
    options = FitOptions()
    fits, checks = fit_static(from_points(speeds, torque, ("+",)), options, "revolute", PointInfo())
    assert fits["+"].outcome.code == "static-no-stribeck"
    assert checks["+"].verdict.numbers["cost"] == pytest.approx(
        float(fits["+"].residuals @ fits["+"].residuals), rel=1e-12
    )
    assert checks["+"].agrees
    assert set(map(str, checks["+"].parameters)) == {"alpha_0+", "alpha_2+"}
    # Coulomb and viscous friction asked for: the outcome says so, whatever the data show
    fits, _ = fit_static(
        from_points(speeds, curve(speeds, gripper), ("+",)), FitOptions(law="coulomb-viscous"), "revolute", PointInfo()
    )
    assert fits["+"].outcome.code == "static-as-asked"
    assert fits["+"].parameters["alpha_1"].value is None


positive = st.floats(0.1, 10.0)


def named(velocity: Array, torque: Array, direction: str = "both") -> dict[str, float]:
    problem = from_points(velocity, torque, (direction,))
    return dict(zip((n.name for n in problem.names), solve(problem, default_range(velocity)).theta, strict=True))


@given(positive, positive, positive, st.floats(0.3, 3.0))
def test_noise_free_points_give_back_the_parameters(a0: float, a1: float, a2: float, reach: float) -> None:
    """Without noise the minimum of the profile is the truth, whatever the parameters, to 1e-5 relative (the profile is flat to rounding there)."""
    p = Lugre(a0, a1, a2, reach, 1.0, 0.0)
    velocity = np.geomspace(0.1, 10.0, 25)
    found = named(velocity, curve(velocity, p))
    assert [found[n] for n in ("alpha_0", "alpha_1", "alpha_2", "v_s")] == pytest.approx(p[:4], rel=1e-5)


@settings(max_examples=30)
@given(st.integers(0, 10_000))
def test_refined_minimum_is_below_every_value_of_the_plain_grid(seed: int) -> None:
    """The continuous minimum costs no more than any of the paper's 500 values of v_s."""
    velocity = np.geomspace(0.01, 0.8, 14)
    torque = curve(velocity, GRIPPER) + 5e-4 * np.random.default_rng(seed).standard_normal(14)
    problem = from_points(velocity, torque, ("both",))
    v_s_range = default_range(velocity)
    _, costs, _ = plain_grid(problem, v_s_range)
    assert solve(problem, v_s_range).cost <= costs.min() * (1 + 1e-9)


@pytest.mark.parametrize("noise", [0.0, 1e-12, 1e-3, 1.0])
def test_flat_profiles_have_a_minimum_too(noise: float) -> None:
    """Where there is no peak, or nothing but noise, the search ends, at no more than the cost of any grid value, for any of 200 draws."""
    rng = np.random.default_rng(1)
    velocity = np.geomspace(0.01, 0.8, 12)
    for _ in range(200):
        torque = 0.02 + 0.04 * velocity + noise * rng.standard_normal(12)
        solution = solve(from_points(velocity, torque, ("both",)), default_range(velocity))
        assert np.isfinite(solution.theta).all()
        assert solution.cost <= solution.profiles[0].min() * (1 + 1e-6) + 1e-14 * (torque @ torque)


def test_the_solve_agrees_with_another_route(gripper: Lugre[float], speeds: Array) -> None:
    """A range that ends short of the minimum, by much or by little, gives a v_s inside it, at the end nearest to the minimum."""
    torque = curve(speeds, gripper) + 2e-4 * np.random.default_rng(3).standard_normal(speeds.size)
    problem = from_points(speeds, torque, ("both",))
    best = float(solve(problem, default_range(speeds)).theta[-1])
    for factor in (1 - 1e-6, 0.999, 0.9, 0.5):
        assert solve(problem, (0.1 * best, factor * best)).theta[-1] == pytest.approx(factor * best, rel=1e-9)
        assert solve(problem, (best / factor, 10 * best)).theta[-1] == pytest.approx(best / factor, rel=1e-9)
    # on noisy points an independent least-squares solver ends in the same minimum
    found = named(speeds, torque)

    def model(v: Array, a0: float, a1: float, a2: float, v_s: float) -> Array:
        return curve(v, Lugre(a0, a1, a2, v_s, 1.0, 0.0))

    other, _ = curve_fit(model, speeds, torque, p0=gripper[:4], xtol=1e-14, ftol=1e-14)
    assert [found[n] for n in ("alpha_0", "alpha_1", "alpha_2", "v_s")] == pytest.approx(other, rel=1e-6)
    # friction is odd: (-v, -T) has the parameters of (v, T), positive in both directions
    torque = curve(speeds, gripper) + 2e-4 * np.random.default_rng(7).standard_normal(speeds.size)
    assert named(-speeds, -torque, "-") == pytest.approx(named(speeds, torque, "+"), rel=1e-9)
    # residuals move against the Jacobian for a small change of each parameter (central differences, 1e-7 relative)
    both = np.concatenate([speeds, -speeds])
    problem = from_points(both, curve(both, gripper), ("+", "-"), load_columns(("gravity",), lambda _: both, both.size))
    theta = solve(problem, default_range(both)).theta * 1.1
    jacobian = problem.jacobian(theta)
    for k in range(theta.size):
        step = np.zeros(theta.size)
        step[k] = 1e-5 * max(abs(theta[k]), 1e-3)
        central = -(problem.residuals(theta + step) - problem.residuals(theta - step)) / (2 * step[k])
        assert jacobian[:, k] == pytest.approx(central, rel=1e-6, abs=1e-9)
    # without anything shared, the joint problem of both directions is two problems
    rng = np.random.default_rng(11)
    other = gripper._replace(alpha_0=0.0148, alpha_1=0.0040, alpha_2=0.0307, v_s=0.05)
    torque = np.concatenate([curve(speeds, gripper), curve(-speeds, other)]) + 2e-4 * rng.standard_normal(both.size)
    v_s_range = default_range(both)
    joint = from_points(both, torque, ("+", "-"))
    found = dict(zip(joint.names, solve(joint, v_s_range).theta, strict=True))
    n = speeds.size
    for sign, rows in (("+", slice(0, n)), ("-", slice(n, 2 * n))):
        single = from_points(both[rows], torque[rows], (sign,))
        for name, value in zip(single.names, solve(single, v_s_range).theta, strict=True):
            assert found[name] == pytest.approx(value, rel=1e-5)


def test_solves_at_bounds_and_of_points(speeds: Array, gripper: Lugre[float]) -> None:
    """Where friction is lower near standstill (a negative amplitude at this v_s), alpha_1 ends at its bound of zero, and is said to."""
    torque = curve(speeds, GRIPPER._replace(alpha_1=-0.005))
    problem = from_points(speeds, torque, ("both",))
    found = solve_at(problem, [GRIPPER.v_s])
    assert problem.named(found.theta)[parse("alpha_1")] == 0.0
    assert found.at_bound == (parse("alpha_1"),)
    assert found.cost == pytest.approx(Projected(problem).base_cost, rel=1e-9)
    # an offset and gravity in the same linear solve come back exactly, and leave the friction exact
    both = np.concatenate([speeds, -speeds])
    position = np.linspace(0, 5, both.size)
    torque = curve(both, gripper) + 0.003 + 0.01 * np.sin(position) - 0.004 * np.cos(position)
    problem = from_points(both, torque, ("both",), load_columns(("offset", "gravity"), lambda _: position, both.size))
    found = dict(zip(problem.names, solve(problem, default_range(both)).theta, strict=True))
    extra = [found[parse(n)] for n in ("offset", "gravity_sin", "gravity_cos")]
    assert extra == pytest.approx([0.003, 0.01, -0.004], rel=1e-6)
    friction = [found[parse(n)] for n in ("alpha_0", "alpha_1", "alpha_2", "v_s")]
    assert friction == pytest.approx(list(gripper[:4]), rel=1e-6)
    # where all speeds lie far above v_s, nothing limits v_s below, and the answer is at the grid's lower edge or flat there
    velocity = np.linspace(5 * gripper.v_s, 20 * gripper.v_s, 12)
    problem = from_points(velocity, curve(velocity, gripper), ("both",))
    solution = solve(problem, default_range(velocity))
    assert solution.profiles[0][0] <= solution.base_costs[0] * (1 + 1e-9) + 1e-18
