"""Moving data in few equations: the same sums of squares."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

from bristle.arrays import Array
from bristle.data.record import Record
from bristle.identification.static.grid import default_range, solve
from bristle.identification.static.problem import Regression, from_points, from_records, with_prior
from bristle.identification.static.profiles import reduced

from ..names import parse
from .conftest import GRIPPER, curve


def moving(directions: tuple[str, ...], *, decimation: int = 10) -> Regression:
    """Six seconds at 1 kHz through standstill, filtered, with inertia; a prior on alpha_0."""
    rng, time = np.random.default_rng(3), np.arange(6000) / 1000
    velocity = 0.5 * np.sin(5 * time) + 0.2 * np.sin(13 * time) + 1e-4 * rng.standard_normal(time.size)
    acceleration = np.gradient(velocity, time)
    torque = curve(velocity, GRIPPER) + 0.004 * acceleration + 1e-3 * rng.standard_normal(time.size)
    record = Record(
        file="motion.csv", time=time, velocity=velocity, acceleration=acceleration, torque=torque, starts=(0, 3500)
    )
    problem, _, _ = from_records([record], directions, ("inertia", "offset"), decimation)
    name = "alpha_0" if len(directions) == 1 else "alpha_0-"
    return with_prior(problem, parse(name), 0.02, 1e-3, 5e-4)


CASES = {
    "one direction": moving(("both",)),
    "two directions": moving(("+", "-")),
    "not filtered": moving(("+", "-"), decimation=1),
}
SMALL = {name: reduced(problem, default_range(problem.velocity)) for name, problem in CASES.items()}


def any_theta(problem: Regression, seed: int) -> Array:
    """Parameters of any sign, each up to twice what makes its column as long as the torque; v_s in the range searched."""
    rng, (low, high) = np.random.default_rng(seed), default_range(problem.velocity)
    v_s = np.exp(rng.uniform(np.log(low), np.log(high), len(problem.peaks)))
    design = problem.design(v_s)
    scale = np.linalg.norm(problem.torque) / np.linalg.norm(design, axis=0)
    return np.concatenate([2 * scale * rng.uniform(-1, 1, scale.size), v_s])


@pytest.mark.parametrize("case", CASES)
@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_sums_of_squares_are_the_same_for_every_theta(case: str, seed: int) -> None:
    """Not at the minimum alone: for any parameters with v_s in the range the cost is that of all equations, to 1e-8 of the torque's square."""
    problem, few = CASES[case], SMALL[case]
    theta = any_theta(problem, seed)
    expected, found = (float(np.sum(p.residuals(theta) ** 2)) for p in (problem, few))
    assert found == pytest.approx(expected, rel=1e-8, abs=1e-8 * float(problem.torque @ problem.torque))


@pytest.mark.parametrize("case", CASES)
def test_gradients_and_solution_are_the_same(case: str) -> None:
    """J'J, J'r and the least cost agree too, with an order of magnitude fewer equations, and names and bounds are kept."""
    problem, few = CASES[case], SMALL[case]
    assert few.names == problem.names
    assert few.torque.size < 0.2 * problem.torque.size
    whole, solution = (solve(p, default_range(problem.velocity)) for p in (problem, few))
    assert solution.theta == pytest.approx(whole.theta, rel=1e-5)
    assert solution.cost == pytest.approx(whole.cost, rel=1e-6)
    J, own = problem.jacobian(whole.theta), few.jacobian(whole.theta)
    scale = np.linalg.norm(J, axis=0)
    assert (own / scale).T @ (own / scale) == pytest.approx((J / scale).T @ (J / scale), abs=1e-5)


def test_points_stay_as_they_are() -> None:
    """Points that nothing smooths are returned themselves."""
    velocity = np.geomspace(0.02, 0.8, 12)
    problem = from_points(velocity, curve(velocity, GRIPPER), ("both",))
    assert reduced(problem, (0.01, 0.8)) is problem


def test_one_speed_is_enough() -> None:
    """A motion at one speed in either sense, smoothed, is reduced without harm."""
    velocity = np.tile(np.repeat([0.3, -0.3], 50), 4)
    raw = from_points(velocity, curve(velocity, GRIPPER), ("both",))
    smooth = sparse.csr_array(sparse.kron(sparse.eye_array(40), np.full((1, 10), 0.1)))
    problem = replace(raw, torque=smooth @ raw.torque, linear=smooth @ raw.linear, smooth=smooth)
    theta = np.array([0.01, 0.02, 0.003, 0.1])
    expected, found = (float(np.sum(p.residuals(theta) ** 2)) for p in (problem, reduced(problem, (0.1, 0.3))))
    assert found == pytest.approx(expected, rel=1e-8)
