from collections.abc import Callable
from dataclasses import replace
from itertools import product
from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats
from scipy.optimize import brentq, minimize, nnls

from bristle.arrays import Array
from bristle.data.experiment.schema import FitOptions
from bristle.estimation.covariance import covariance as uncertainty
from bristle.estimation.interval_comparison import warnings
from bristle.estimation.levels import FACTOR
from bristle.identification.fits import Uncertainty
from bristle.identification.static.grid import Solution, default_range, solve
from bristle.identification.static.problem import Regression, from_points
from bristle.identification.static.profiles import StaticProfiles, profiled
from bristle.identification.static.solution import StaticSolution, solve_static
from bristle.identification.static.uncertainty import three_ways
from bristle.model.parameters import Lugre, ParameterName, Stribeck

from ..names import named, parse
from .conftest import GRIPPER, curve

SPEEDS = np.geomspace(0.15 * GRIPPER.v_s, 0.8, 16)


def least(problem: Regression, v_s: Array, name: ParameterName | None = None, held: float = 0.0) -> float:
    """The cost at given v_s with a linear parameter held at a value, minimised over the others by non-negative least squares."""
    # a parameter that may be negative is the difference of two that may not
    names = problem.names[: len(problem.names) - len(problem.peaks)]
    design = problem.design(v_s)
    rest = problem.torque - (held * design[:, names.index(name)] if name else 0.0)
    columns = [design[:, k] for k in range(len(names)) if names[k] != name]
    columns += [-design[:, k] for k in range(len(names)) if names[k] != name and not names[k].name.startswith("alpha")]
    scaled = np.array([c / np.linalg.norm(c) for c in columns if c.any()]).T
    return float(nnls(scaled, rest)[1]) ** 2


def brute(problem: Regression, solution: Solution, name: ParameterName | None = None, held: float = 0.0) -> float:
    """The same minimised over v_s as well: the best of a dense grid over the range, refined by a simplex that stays within it."""
    if not problem.peaks:
        return least(problem, np.zeros(0), name, held)
    low, high = np.log(solution.grid[[0, -1]])
    axis = np.linspace(low, high, {1: 120, 2: 16}[len(problem.peaks)])
    nodes = [np.array(u) for u in product(axis, repeat=len(problem.peaks))]
    nodes.append(np.log(solution.theta[-len(problem.peaks) :]))

    def cost(u: Array) -> float:
        return least(problem, np.exp(np.clip(u, low, high)), name, held)

    best = min(nodes, key=cost)
    simplex = best + 0.5 * (axis[1] - axis[0]) * np.vstack([np.zeros(best.size), np.eye(best.size)])
    options: Any = {"initial_simplex": simplex, "xatol": 1e-8, "fatol": 1e-14 * solution.cost, "maxiter": 400}
    found = minimize(cost, best, method="Nelder-Mead", options=options)
    return min(float(found.fun), cost(best))


def assert_exact(problem: Regression, solution: Solution, found: StaticProfiles, rel: float = 1e-5) -> None:
    """Each end of each linear parameter is the constrained one; a little beyond it the cost lies above the threshold."""
    names = problem.names[: len(problem.names) - len(problem.peaks)]
    assert_ends(problem, solution, found, names, rel)
    for name, value in zip(names, solution.theta, strict=False):
        for end in found.intervals[name]:
            beyond = end + 0.02 * (end - value)
            if np.isfinite(end) and (beyond > 0 or not name.name.startswith("alpha")):
                assert brute(problem, solution, name, beyond) > found.threshold, (name, beyond)


def assert_ends(
    problem: Regression, solution: Solution, found: StaticProfiles, names: tuple[ParameterName, ...], rel: float = 1e-5
) -> None:
    """Each end costs the threshold by brute force, or is a bound of zero that costs no more; an open end is alpha_1's."""
    room = found.threshold - solution.cost
    for name in names:
        value = float(solution.theta[problem.names.index(name)])
        low, high = found.intervals[name]
        assert low <= value * (1 + 1e-9)
        assert value <= high * (1 + 1e-9)
        assert np.isfinite(high) or name.name == "alpha_1"
        for end in (low, high) if np.isfinite(high) else (low,):
            above = brute(problem, solution, name, end) - found.threshold
            if end == 0 and name.name.startswith("alpha"):
                assert above <= rel * room, name
            else:
                assert above == pytest.approx(0, abs=rel * room), (name, end)


def solved(problem: Regression, variance_inflation: float = 1.0) -> tuple[Solution, StaticProfiles]:
    solution = solve(problem, default_range(problem.velocity))
    return solution, profiled(problem, solution, variance_inflation)


def measured(truth: Lugre[float], velocity: Array, noise: float, seed: int) -> Array:
    return curve(velocity, truth) + noise * np.random.default_rng(seed).standard_normal(velocity.size)


def without_peak(velocity: Array, torque: Array, extra: dict[str, Array] | None = None) -> Regression:
    """Coulomb and viscous friction alone."""
    return replace(from_points(velocity, torque, ("both",), extra), peaks=())


@given(seed=st.integers(0, 10**6), variance_inflation=st.floats(1.0, 3.0))
def test_without_a_peak_the_profile_is_the_students_interval(seed: int, variance_inflation: float) -> None:
    """A linear problem away from its bounds: every profile ends where Student's t with the covariance does, to 1e-9, extra regressors too."""
    rng = np.random.default_rng(seed)
    velocity = rng.uniform(-1, 1, 30)
    extra = {"offset": np.ones(30), "gravity_sin": np.sin(3 * rng.uniform(-1, 1, 30))}
    torque = 0.5 * np.sign(velocity) + velocity - 0.2 + 0.3 * extra["gravity_sin"] + 0.02 * rng.standard_normal(30)
    problem = without_peak(velocity, torque, extra)
    solution, found = solved(problem, variance_inflation)
    covariance, freedom = uncertainty(problem.linear, solution.cost, variance_inflation)
    reach = stats.t.ppf(0.975, freedom) * np.sqrt(np.diag(covariance))
    for name, value, half in zip(problem.names, solution.theta, reach, strict=True):
        assert found.intervals[name] == pytest.approx((value - half, value + half), rel=1e-9, abs=1e-9 * half)


@given(seed=st.integers(0, 10**6))
def test_at_a_bound_the_profile_is_that_of_non_negative_least_squares(seed: int) -> None:
    """Where viscous friction is hardly there, intervals end at zero, or where non-negative least squares with one held costs the threshold."""
    rng = np.random.default_rng(seed)
    velocity = rng.uniform(0.1, 1, 12)
    problem = without_peak(velocity, 0.02 + 0.001 * rng.uniform(-1, 1) * velocity + 1e-3 * rng.standard_normal(12))
    solution, found = solved(problem)
    assert_exact(problem, solution, found, rel=1e-7)
    alpha_0, alpha_2 = parse("alpha_0"), parse("alpha_2")
    if alpha_2 in solution.at_bound:
        assert found.intervals[alpha_2][0] == 0
        # the other is then alone, and its lower end has the other's free value: alpha_0 falls where alpha_2 rises
        low = found.intervals[alpha_0][0]
        assert brentq(
            lambda c: least(problem, np.zeros(0), alpha_0, c) - found.threshold, 0, solution.theta[0], xtol=1e-14
        ) == pytest.approx(low, rel=1e-7)


@given(
    seed=st.integers(0, 10**6),
    noise=st.floats(1e-3, 4e-2),
    start=st.floats(0.15, 0.7),
    viscous=st.sampled_from([1.0, 0.02, 0.0]),
)
@settings(max_examples=8)
def test_one_peak_ends_where_brute_force_does(seed: int, noise: float, start: float, viscous: float) -> None:
    """Over random noise and designs, with viscous friction and without: every end costs the threshold by brute force over v_s."""
    truth = GRIPPER._replace(alpha_2=viscous * GRIPPER.alpha_2)
    velocity = np.geomspace(start * truth.v_s, 0.8, 14)
    problem = from_points(velocity, measured(truth, velocity, noise * truth.alpha_0, seed), ("both",))
    solution, found = solved(problem)
    assert_exact(problem, solution, found)


def test_profiles_at_bounds_and_ends() -> None:
    """With alpha_0 near nothing several parameters reach zero inside the intervals: brute force and faces still agree."""
    truth = GRIPPER._replace(alpha_0=2e-4, alpha_2=2e-3)
    for seed in range(4):
        problem = from_points(SPEEDS, measured(truth, SPEEDS, 4e-4, seed), ("both",))
        solution, found = solved(problem)
        assert_exact(problem, solution, found)
        assert found.intervals[parse("alpha_0")][0] == 0
    # where v_s is open to both sides, every drawn cost is finite, and none lies below that of brute force over the range of v_s
    velocity = np.geomspace(1.3 * GRIPPER.v_s, 0.8, 12)
    problem = from_points(velocity, measured(GRIPPER, velocity, 1.5e-3, 1), ("both",))
    solution, found = solved(problem)
    assert found.intervals[parse("v_s")] == (0, np.inf)
    room = found.threshold - solution.cost
    for name in map(parse, ("alpha_0", "alpha_2", "alpha_1")):
        value, (low, high) = float(solution.theta[problem.names.index(name)]), found.intervals[name]
        values, heights = found.curve(name, value, low, min(high, 10 * value))
        assert np.isfinite(heights).all()
        expected = [(brute(problem, solution, name, x) - solution.cost) / room for x in values[::10]]
        assert heights[::10] == pytest.approx(np.maximum(expected, 0), abs=5e-3, rel=5e-3)
    # exact torques cost nothing, so nothing else costs as little: every interval has the truth in it and no width, to rounding
    problem = from_points(SPEEDS, curve(SPEEDS, GRIPPER), ("both",))
    _, found = solved(problem)
    for name, (low, high) in found.intervals.items():
        true = getattr(GRIPPER, name.name)
        assert (low, high) == pytest.approx((true, true), rel=1e-5)
    # where v_s has no limit on a side, alpha_1 has no upper end; elsewhere every interval is finite and v_s lies inside its own
    open_, closed = 0, 0
    for seed in range(12):
        velocity = np.geomspace((1.0 if seed % 2 else 0.2) * GRIPPER.v_s, 0.8, 12)
        problem = from_points(velocity, measured(GRIPPER, velocity, 8e-4, seed), ("both",))
        solution, found = solved(problem)
        low, high = found.intervals[parse("v_s")]
        unlimited = low == 0 or np.isinf(high)
        assert np.isinf(found.intervals[parse("alpha_1")][1]) == unlimited
        assert all(np.isfinite(end) for name in problem.linear_names for end in found.intervals[name])
        assert low <= solution.theta[-1] <= high
        open_, closed = open_ + unlimited, closed + (not unlimited)
    assert min(open_, closed) >= 2
    # an estimate at its bound has its own sentence, and one interval alone parts from none
    (said,) = warnings(0.0, (0.0, 1.0), (0.0, 9.0), (0.0, 3.0), at_bound=True)
    assert said.code == "intervals-at-bound"
    assert [w.code for w in warnings(1.0, (0.0, 2.0), None, None, few=FIVE)] == ["no-bootstrap"]
    assert warnings(1.0, (0.0, 2.0), None, None) == ()
    assert warnings(1.0, (1.0, 1.0), (1.0, 1.0 + 1e-12), (1.0, 1.0)) == ()


@pytest.mark.parametrize(("viscous", "seed"), [(1.0, 1), (0.0, 2)])
def test_two_peaks_end_where_brute_force_does(viscous: float, seed: int) -> None:
    """Two directions that share gravity: ends cost the threshold by brute force over both v_s, where one v_s is open and bounds are near as well."""
    velocity = np.concatenate([SPEEDS[::2], -SPEEDS[1::2]])
    position = np.linspace(0, 9, velocity.size)
    down = 0.8 * curve(velocity, GRIPPER._replace(v_s=0.05))
    truth = np.where(velocity > 0, curve(velocity, GRIPPER._replace(alpha_2=viscous * GRIPPER.alpha_2)), down)
    noise = 4e-4 * np.random.default_rng(seed).standard_normal(velocity.size)
    extra = {"gravity_sin": np.sin(position)}
    problem = from_points(velocity, truth + 0.003 * extra["gravity_sin"] + noise, ("+", "-"), extra)
    solution, found = solved(problem)
    assert np.isinf(found.intervals[parse("alpha_1-")][1])
    assert_ends(problem, solution, found, tuple(map(parse, ("alpha_0-", "alpha_1-", "gravity_sin"))), rel=1e-5)


CURVED: dict[str, Callable[[], Regression]] = {
    "one peak": lambda: from_points(SPEEDS, measured(GRIPPER, SPEEDS, 4e-4, 3), ("both",)),
    "at a bound": lambda: from_points(
        SPEEDS, measured(GRIPPER._replace(alpha_0=2e-4, alpha_2=1e-3), SPEEDS, 4e-4, 1), ("both",)
    ),
    "no peak": lambda: without_peak(SPEEDS, 0.02 + 1e-3 * SPEEDS + 1e-3 * np.cos(40 * SPEEDS)),
}


@pytest.mark.parametrize("case", CURVED)
def test_every_point_of_a_curve_is_brute_force(case: str) -> None:
    """The drawn profile is the constrained minimum, in thresholds above the least: 0 at the estimate, below 1 inside its interval, above outside."""
    problem = CURVED[case]()
    solution, found = solved(problem)
    room = found.threshold - solution.cost
    for name in (*problem.linear_names, *([parse("alpha_1")] if problem.peaks else [])):
        value = float(solution.theta[problem.names.index(name)])
        low, high = found.intervals[name]
        values, heights = found.curve(name, value, low, high)
        assert (np.diff(values) > 0).all()
        assert values[0] >= 0
        expected = [(brute(problem, solution, name, x) - solution.cost) / room for x in values[::8]]
        assert heights[::8] == pytest.approx(np.maximum(expected, 0), abs=2e-3, rel=2e-3)
        assert heights[values == value] == pytest.approx([0], abs=1e-9)
        inside = (values > low) & (values < high)
        assert (heights[inside] < 1 + 2e-3).all()
        assert (heights[~inside & (values > 0)] > 1 - 2e-3).all()


@given(seed=st.integers(0, 10**6), torque=st.floats(1e-3, 1e3), speed=st.floats(1e-3, 1e3))
@settings(max_examples=15)
def test_intervals_follow_units(seed: int, torque: float, speed: float) -> None:
    """In other units of torque and velocity the same parameters and intervals come out, converted: nothing has a scale of its own."""
    measured_torque = measured(GRIPPER, SPEEDS, 5e-4, seed)
    first, plain = solved(from_points(SPEEDS, measured_torque, ("both",)))
    second, other = solved(from_points(speed * SPEEDS, torque * measured_torque, ("both",)))
    assert second.theta == pytest.approx(first.theta * [torque, torque / speed, torque, speed], rel=1e-7)
    factors = named({"alpha_0": torque, "alpha_1": torque, "alpha_2": torque / speed, "v_s": speed})
    for name, ends in plain.intervals.items():
        wide = ends[1] - ends[0]
        expected = np.array(ends) * factors[name]
        if np.isfinite(wide):
            assert other.intervals[name] == pytest.approx(expected, abs=1e-5 * wide * factors[name])
        else:
            assert other.intervals[name] == pytest.approx(expected, rel=1e-4, abs=1e-12)


reach = st.floats(1e-3, 1e6)


@given(value=st.floats(-1e3, 1e3), below=reach, above=reach, stretch=st.floats(1.0, 0.98 * FACTOR))
def test_intervals_within_the_factor_are_not_doubted(value: float, below: float, above: float, stretch: float) -> None:
    """Equal intervals, and any whose reaches differ by less than the factor, say nothing, however skewed together."""
    own = (value - below, value + above)
    wider = (value - stretch * below, value + stretch * above)
    assert warnings(value, own, own, own) == ()
    assert warnings(value, own, wider, own) == ()
    assert warnings(value, wider, None, own) == ()


@given(value=st.floats(-1e3, 1e3), size=reach, stretch=st.floats(1.01 * FACTOR, 100.0), which=st.integers(0, 2))
def test_one_wider_than_the_factor_is_named_with_its_side(
    value: float, size: float, stretch: float, which: int
) -> None:
    """Whichever of the three reaches too far, the sentence says on which side."""
    sides = {"below": (stretch, 1.0), "above": (1.0, stretch), "below and above": (stretch, stretch)}
    for side, (low, high) in sides.items():
        own = [(value - size, value + size)] * 3
        own[which] = (value - low * size, value + high * size)
        (warning,) = warnings(value, *own)
        assert warning.code == "intervals-differ"
        assert f"{side} the estimate differ" in str(warning)


PLAIN = (9.0, 11.0)
FIVE = "5 points for 4 parameters"


def test_the_reason_is_the_one_that_applies() -> None:
    """An open profile, a skewed one, few points, or uneven residuals: each has its own kind, in that order."""
    for profile, bootstrap, few, reason in (
        ((9.0, 13.0), PLAIN, None, "profile-skewed"),
        ((9.0, np.inf), PLAIN, None, "cost-stays-low"),
        ((0.0, 12.0), PLAIN, None, "profile-skewed"),
        (PLAIN, (7.0, 13.0), FIVE, "few-to-resample"),
        (PLAIN, (7.0, 13.0), None, "uneven-residuals"),
        (None, (7.0, 13.0), None, "uneven-residuals"),
    ):
        (warning,) = warnings(10.0, PLAIN, profile, bootstrap, few=few)
        assert warning.numbers["reason"].code == reason
        assert str(warning.numbers["reason"]) in str(warning)


def fitted(
    velocity: Array,
    noise: float,
    seed: int,
    truth: Lugre[float] = GRIPPER,
    *,
    two: bool = False,
    set_up: Literal["auto", "as-written"] = "auto",
) -> tuple[StaticSolution, dict[ParameterName, Uncertainty]]:
    if two:
        velocity = np.concatenate([velocity, -velocity])
    torque = curve(velocity, truth) + noise * np.random.default_rng(seed).standard_normal(velocity.size)
    v_s_range = default_range(velocity)
    problem = from_points(velocity, torque, ("+", "-") if two else ("both",))
    found = solve_static(problem, FitOptions(set_up=set_up), "revolute", v_s_range)
    return found, three_ways(found, v_s_range)


def assert_sound(found: StaticSolution, three: dict[ParameterName, Uncertainty]) -> None:
    """Each parameter has three intervals about its estimate, never nan."""
    assert tuple(three) == found.problem.names
    for name, own in three.items():
        value = float(found.solution.theta[found.problem.names.index(name)])
        assert own.profile == found.profiled.intervals[name]
        for interval in (own.covariance, own.profile, own.bootstrap):
            assert interval is None or not np.isnan(interval).any()
        assert own.profile is not None
        assert own.profile[0] <= value * (1 + 1e-9)
        assert value <= own.profile[1] * (1 + 1e-9)
        assert name.name not in Stribeck._fields or min(own.profile[0], *(own.covariance or (0,))) >= 0
        assert np.isfinite(own.curve).all()
        assert np.isfinite(own.draws).all()


def test_three_intervals_agree_or_say_why_not() -> None:
    """40 speeds, 0.5 % noise: no warning on any parameter in any of five sets, and all ends within a quarter of a width of the profile's."""
    for seed in range(5):
        found, three = fitted(np.geomspace(0.15 * GRIPPER.v_s, 0.8, 40), 1e-4, seed)
        assert_sound(found, three)
        for own in three.values():
            assert own.warnings == ()
            assert own.profile is not None
            wide = own.profile[1] - own.profile[0]
            assert own.covariance == pytest.approx(own.profile, abs=0.25 * wide)
            assert own.bootstrap == pytest.approx(own.profile, abs=0.25 * wide)
    # points of both directions with a v_s each: eight parameters, sound, and with little noise without warnings
    found, three = fitted(np.geomspace(0.15 * GRIPPER.v_s, 0.8, 24), 1e-4, 1, two=True)
    assert len(three) == 8
    assert_sound(found, three)
    assert not [said for own in three.values() for said in own.warnings]
    # speeds from v_s up: where a Stribeck term is asked for, v_s or alpha_1 says that the profile is skewed or open, and curves stay finite
    said, kept, open_ = 0, 0, 0
    for seed in range(12):
        found, three = fitted(np.geomspace(GRIPPER.v_s, 0.8, 16), 4e-4, seed, set_up="as-written")
        assert_sound(found, three)
        if found.problem.peaks:
            kept += 1
            found_warnings = [warning for name in ("alpha_1", "v_s") for warning in three[parse(name)].warnings]
            reasons = {w.numbers["reason"].code for w in found_warnings if w.code == "intervals-differ"}
            said += bool(reasons & {"profile-skewed", "cost-stays-low"})
            open_ += bool(np.isinf(three[parse("alpha_1")].profile or ()).any())
    assert kept >= 8
    assert open_ >= 1
    assert said >= 0.9 * kept
    # six points for four parameters: where bootstrap parts from an even profile, the points are called few
    words = []
    for seed in range(10):
        found, three = fitted(np.geomspace(0.2 * GRIPPER.v_s, 0.8, 6), 5e-5, seed)
        assert_sound(found, three)
        words += [str(warning) for own in three.values() for warning in own.warnings]
    assert any("6 points for 4 parameters are few to resample" in warning for warning in words)
