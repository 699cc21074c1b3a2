"""The armature current with its lag: it agrees with a stiff solver, vanishes with L, is of second order, and is stable for any L."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

import simulated_edro
from bristle.control.closed_loop import simulate
from bristle.control.control_period import Case, LoopOptions
from bristle.control.plant import State, inductive_step
from bristle.model.parameters import Lugre, Motor, pair_of

from .conftest import H, case, sine

LAGGING = LoopOptions(drive="voltage", inductance=True)


def lagging(name: str, lag: float) -> Case:
    """A joint of Table 1 whose motor has L / R = lag, s."""
    m = simulated_edro.motor(name)
    return case(name, motor=m._replace(L=lag * m.R))


@pytest.mark.parametrize("lag", [2e-4, 2e-3, 2e-2])
@pytest.mark.parametrize("name", ["gripper rotation", pytest.param("base rotation", marks=pytest.mark.slow)])
def test_the_lagging_current_agrees_with_a_stiff_solver(name: str, lag: float) -> None:
    """Over 6 s at 1 kHz exact steps and CVODES differ by less than 1e-4 rad for L / R far below, about and far above the period.

    They differ most in the first of these three periods; every later one is as the third.
    """
    fast, stiff = (simulate(LAGGING, [lagging(name, lag)], sine(6.0, 0.5), H, stiff=which) for which in (False, True))
    assert np.abs(fast.position - stiff.position).max() < 1e-4


def test_without_inductance_it_is_the_loop_that_has_none() -> None:
    """As L goes to zero the distance to the loop without L goes to zero in proportion, to nothing that a step leaves."""
    course = sine(3.0, 0.5)
    none = simulate(LoopOptions(drive="voltage"), [case("wrist pitch")], course, H).position
    off = [
        np.abs(simulate(LAGGING, [lagging("wrist pitch", lag)], course, H).position - none).max()
        for lag in (1e-4, 1e-6, 1e-8)
    ]
    np.testing.assert_allclose(np.divide(off[:-1], off[1:]), 100.0, rtol=0.05)
    assert off[-1] < 1e-7


@pytest.mark.parametrize("lag", [2e-3, 2e-2])
def test_the_step_with_the_current_is_of_second_order(lag: float) -> None:
    """Halving the plant's step three times at one controller rate, the distance to CVODES falls by four each time, to within a factor."""
    one, course = lagging("wrist pitch", lag), sine(2.0, 0.5, 8e-3)
    stiff = simulate(LAGGING, [one], course, 8e-3, stiff=True)
    off = [
        np.abs(simulate(replace(LAGGING, substeps=n), [one], course, 8e-3).position - stiff.position).max()
        for n in (1, 2, 4, 8)
    ]
    assert 1.8 < np.log2(off[0] / off[-1]) / 3 < 2.2


def test_the_step_is_stable_for_any_inductance() -> None:
    """In stick, with or without friction's damping, no mode of (v, z, i) grows in a step, for 20000 motors and bristles over many decades."""
    x, q = ca.SX.sym("x", 4), ca.SX.sym("q", 15)
    numbers = ca.vertsplit(q)
    k_t, R, L = numbers[12:15]
    state, i = inductive_step(
        State(*ca.vertsplit(x[:3])), x[3], 0.0, 0.0, 1.0, pair_of(numbers[:12]), Motor(k_t, R, L, 1.0)
    )
    new = ca.vertcat(*state, i)
    slope = ca.Function("slope", [x, q], [ca.densify(ca.jacobian(new, x)[1:, 1:])])
    rng, n = np.random.default_rng(0), 20000
    k_t, L, stiff, damping, viscous = 10.0 ** rng.uniform(
        [[-3], [-8], [-4], [-4], [-4]], [[3], [8], [6], [4], [4]], (5, n)
    )
    damped, one = rng.integers(0, 2, n), np.ones(n)
    p = Lugre(one, 0 * one, damped * viscous, one, stiff, damped * damping)
    found = slope.map(n)(np.zeros((4, n)), np.array([*p, *p, k_t, one, L])).full()
    modes = np.linalg.eigvals(found.reshape(3, n, 3).transpose(1, 0, 2))
    assert np.abs(modes).max() < 1 + 1e-9


def test_what_has_no_lag_is_refused() -> None:
    """Inductance with a drive of torque, and with a motor of L = 0, in one sentence each."""
    with pytest.raises(ValueError, match="inductance: got a drive of torque"):
        LoopOptions(inductance=True)
    with pytest.raises(ValueError, match="inductance: got L = 0 H for case 1"):
        simulate(LAGGING, [lagging("wrist pitch", 1e-3), case("wrist pitch")], sine(1.0, 0.5), H)
