"""Bounded linear least squares against another solver."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from bristle.estimation.linear import bounded_least_squares, orthonormal
from bristle.identification.static.grid import Projected, solve_at
from bristle.identification.static.problem import from_points


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**6), free=st.integers(0, 3), bounded=st.integers(0, 4))
def test_bounded_least_squares_is_lsq_linears(seed: int, free: int, bounded: int) -> None:
    """Any columns, with a bound of zero on some, in any order and scale: the same solution as scipy's lsq_linear, and no bound broken."""
    rng = np.random.default_rng(seed)
    count = free + bounded
    if count == 0:
        return
    design = rng.standard_normal((12, count)) + 0.5
    lower = rng.permutation([0.0] * bounded + [-np.inf] * free)
    torque = rng.standard_normal(12)
    scale = 10.0 ** rng.uniform(-2, 2, count)
    found = bounded_least_squares(design * scale, torque, lower)
    assert (found >= lower).all()
    expected = lsq_linear(design, torque, (lower, np.inf), method="bvls", tol=1e-14).x
    assert found * scale == pytest.approx(expected, abs=1e-9)


def test_no_columns_have_an_empty_basis() -> None:
    """Nothing spans nothing, in silence."""
    q, inverse = orthonormal(np.zeros((7, 0)))
    assert (q.shape, inverse.shape) == ((7, 0), (0, 0))


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_costs_with_bounds_are_those_of_bounded_least_squares(seed: int) -> None:
    """Whatever the torques, so that any set of bounds is active, with gravity and without: each grid cost is that of the bounded solution there."""
    rng = np.random.default_rng(seed)
    velocity, v_s = np.geomspace(0.01, 0.8, 12), np.geomspace(0.004, 0.7, 9)
    extra = {"gravity_sin": np.sin(9 * velocity)} if seed % 2 else {}
    problem = from_points(velocity, rng.standard_normal(12) + rng.uniform(-2, 2), ("both",), extra)
    expected = [solve_at(problem, [s]).cost for s in v_s.tolist()]
    assert Projected(problem).costs(v_s) == pytest.approx(expected, rel=1e-7)
