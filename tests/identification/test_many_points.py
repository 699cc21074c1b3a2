"""Many points: what is computed in parts is the whole, what many points give is what few give, and no row is too far down to be looked at."""

import numpy as np
import pytest
from numpy.typing import NDArray

import bristle
from bristle.arrays import Array
from bristle.estimation.covariance import covariance
from bristle.identification.static import grid, strays
from bristle.identification.static.grid import Projected, default_range, solve
from bristle.identification.static.problem import Regression, from_points, log_grid
from bristle.identification.static.strays import find_strays

from .conftest import GRIPPER, curve

NOISE = 3e-4


def points(count: int, seed: int = 0) -> tuple[Array, Array]:
    """Points of the gripper at random speeds, with even noise."""
    rng = np.random.default_rng(seed)
    v = rng.uniform(0.01, 1.0, count)
    return v, curve(v, GRIPPER) + NOISE * rng.standard_normal(count)


def with_strays(count: int, rows: NDArray[np.intp], seed: int = 0, farthest: float = 40.0) -> Regression:
    """The same with some rows off by 12 deviations of the noise and up to `farthest`, up and down."""
    v, T = points(count, seed)
    T[rows] += NOISE * np.geomspace(12, farthest, rows.size) * (-1.0) ** np.arange(rows.size)
    return from_points(v, T, ("+",))


def test_costs_over_v_s_in_parts_are_those_of_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """J_s on a grid, worked on a few values at a time, one value where there are more points than that, is J_s at once to 1e-12."""
    problem = from_points(*points(300), ("+",))
    values = log_grid(default_range(problem.velocity), 40)
    whole = Projected(problem).costs(values)
    for at_once in (2000, 100):
        monkeypatch.setattr(grid, "_AT_ONCE", at_once)
        assert Projected(problem).costs(values) == pytest.approx(whole, rel=1e-12)


def test_points_given_again_and_again_have_the_same_estimate() -> None:
    """Sixty points given twenty times: the same parameters, and standard errors smaller by sqrt((n - p) / (k n - p))."""
    v, T = points(60)
    once, often = bristle.fit(v, T), bristle.fit(np.tile(v, 20), np.tile(T, 20))
    assert list(often.params.values()) == pytest.approx(list(once.params.values()), rel=1e-6)
    errors = np.array(list(once.stderr.values())) * np.sqrt((60 - 4) / (1200 - 4))
    assert list(often.stderr.values()) == pytest.approx(errors, rel=1e-5)


def test_strays_left_out_together_are_those_left_out_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 1200 points with a dozen strays the same are named either way; without strays none, and with an eighth and more it is misfit."""
    rows = np.arange(40, 1200, 100)
    problem = with_strays(1200, rows)
    together = find_strays(problem)
    monkeypatch.setattr(strays, "SINGLY", 10_000)
    assert find_strays(problem) == together
    monkeypatch.undo()
    assert set(together.rows) == set(rows.tolist())
    assert find_strays(from_points(*points(1200), ("+",))) == ((), False)
    assert find_strays(with_strays(1200, np.arange(0, 1200, 6), farthest=3000.0)).misfit


def test_a_stray_is_found_in_the_last_row_too() -> None:
    """Of 12 000 points the last one is looked at as the first is."""
    assert find_strays(with_strays(12_000, np.array([0, 11_999]))).rows == (11_999, 0)


@pytest.mark.slow
def test_of_many_strays_fifty_are_named_and_the_others_counted() -> None:
    """Sixty strays of 1500 points: their count is said, fifty are named, the rest is a number; the fit without all of them is that of the others."""
    rows = np.arange(10, 1500, 25)
    problem = with_strays(1500, rows)
    found = bristle.fit(problem.velocity, problem.torque)
    (told,) = (w for w in found.warnings if w.code in {"strays", "strays-matter"})
    assert told.numbers["count"] == rows.size
    assert len(told.numbers["points"]) == 51
    assert "; and 10 more" in str(told)
    fit = found.joint.static["+"]
    assert len(fit.strays) == rows.size
    rest = from_points(np.delete(problem.velocity, rows), np.delete(problem.torque, rows), ("+",))
    alone = solve(rest, default_range(rest.velocity))
    error = np.sqrt(np.diag(covariance(alone.jacobian, alone.cost)[0]))
    for name, value, one in zip(rest.names, alone.theta.tolist(), error.tolist(), strict=True):
        assert told.numbers[name.name] == pytest.approx(value, rel=1e-6)
        assert f"{name.name} {value:.4g} +/- {one:.2g}" in str(told)
