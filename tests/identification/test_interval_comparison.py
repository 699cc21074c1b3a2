"""Three intervals side by side: silent where they agree, a reason where they part, on real fits as well."""

from typing import Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bristle.arrays import Array
from bristle.data.experiment.schema import FitOptions
from bristle.estimation.interval_comparison import FACTOR, warnings
from bristle.identification.fits import Uncertainty
from bristle.identification.static.grid import default_range
from bristle.identification.static.problem import from_points
from bristle.identification.static.solution import StaticSolution, solve_static
from bristle.identification.static.uncertainty import three_ways
from bristle.model.parameters import Lugre, ParameterName, Stribeck

from ..names import parse
from .conftest import GRIPPER, curve

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
    """Whichever of the three reaches too far, the sentence says on which side, and gives all three intervals."""
    sides = {"below": (stretch, 1.0), "above": (1.0, stretch), "below and above": (stretch, stretch)}
    for side, (low, high) in sides.items():
        own = [(value - size, value + size)] * 3
        own[which] = (value - low * size, value + high * size)
        (warning,) = warnings(value, *own)
        assert warning.code == "intervals-differ"
        said = str(warning)
        assert f"{side} the estimate differ" in said
        assert "(covariance " in said
        assert said.count(" to ") >= 3
        assert "profile" in said
        assert "bootstrap" in said


PLAIN = (9.0, 11.0)
FIVE = "5 points for 4 parameters"


@pytest.mark.parametrize(
    ("profile", "bootstrap", "few", "reason"),
    [
        ((9.0, 13.0), PLAIN, None, "profile-skewed"),
        ((9.0, np.inf), PLAIN, None, "cost-stays-low"),
        ((0.0, 12.0), PLAIN, None, "profile-skewed"),
        (PLAIN, (7.0, 13.0), FIVE, "few-to-resample"),
        (PLAIN, (7.0, 13.0), None, "uneven-residuals"),
        (None, (7.0, 13.0), None, "uneven-residuals"),
    ],
)
def test_the_reason_is_the_one_that_applies(
    profile: tuple[float, float] | None, bootstrap: tuple[float, float], few: str | None, reason: str
) -> None:
    """An open profile, a skewed one, few points, or uneven residuals: each has its own kind, in that order."""
    (warning,) = warnings(10.0, PLAIN, profile, bootstrap, few=few)
    said = str(warning)
    assert warning.numbers["reason"].code == reason
    assert str(warning.numbers["reason"]) in said
    assert "nan" not in said
    assert ("None" in said) is False


def test_at_a_bound_and_alone_nothing_parts() -> None:
    """An estimate at its bound has its own sentence, and one interval alone parts from none."""
    (said,) = warnings(0.0, (0.0, 1.0), (0.0, 9.0), (0.0, 3.0), at_bound=True)
    assert said.code == "intervals-at-bound"
    assert [w.code for w in warnings(1.0, (0.0, 2.0), None, None, few=FIVE)] == ["no-bootstrap"]
    assert warnings(1.0, (0.0, 2.0), None, None) == ()
    assert warnings(1.0, (1.0, 1.0), (1.0, 1.0 + 1e-12), (1.0, 1.0)) == ()


def fitted(
    velocity: Array,
    noise: float,
    seed: int,
    truth: Lugre[float] = GRIPPER,
    *,
    two: bool = False,
    set_up: Literal["auto", "as-written"] = "auto",
) -> tuple[StaticSolution, dict[ParameterName, Uncertainty]]:
    """A fit of simulated points with its three intervals."""
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


def test_in_a_good_design_the_three_agree() -> None:
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


def test_two_directions_have_three_intervals_too() -> None:
    """Points of both directions with a v_s each: eight parameters, sound, and with little noise without warnings."""
    found, three = fitted(np.geomspace(0.15 * GRIPPER.v_s, 0.8, 24), 1e-4, 1, two=True)
    assert len(three) == 8
    assert_sound(found, three)
    assert not [said for own in three.values() for said in own.warnings]


def test_with_few_speeds_below_v_s_a_skewed_or_open_profile_is_said() -> None:
    """Speeds from v_s up: where a Stribeck term is asked for, v_s or alpha_1 says that the profile is skewed or open, and curves stay finite."""
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


@pytest.mark.slow
def test_at_a_bound_the_intervals_are_one_sided() -> None:
    """Without viscous friction its estimate is zero at times: intervals from zero up, and one sentence that says so."""
    hits = 0
    for seed in range(4):
        found, three = fitted(np.geomspace(0.15 * GRIPPER.v_s, 0.8, 16), 4e-4, seed, GRIPPER._replace(alpha_2=0.0))
        assert_sound(found, three)
        own = three[parse("alpha_2")]
        if parse("alpha_2") in found.solution.at_bound:
            hits += 1
            assert [interval[0] for interval in (own.covariance, own.profile) if interval] == [0, 0]
            assert [warning.code for warning in own.warnings] == ["intervals-at-bound"]
    assert 1 <= hits <= 3


def test_few_points_are_called_few() -> None:
    """Six points for four parameters: where bootstrap parts from an even profile, the points are called few."""
    words = []
    for seed in range(10):
        found, three = fitted(np.geomspace(0.2 * GRIPPER.v_s, 0.8, 6), 5e-5, seed)
        assert_sound(found, three)
        words += [str(warning) for own in three.values() for warning in own.warnings]
    assert any("6 points for 4 parameters are few to resample" in warning for warning in words)
