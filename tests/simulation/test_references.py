"""Every kind of reference: velocity and acceleration are the derivatives of the position, and it begins and ends where it should."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bristle.arrays import Array
from bristle.control.closed_loop import simulate
from bristle.control.compensator import Compensator, Reference
from bristle.control.control_period import Case, LoopOptions
from bristle.control.pid import Gains
from bristle.model.parameters import Motor
from bristle.simulation import edro
from bristle.simulation.references import FASTEST, HARDEST, STEEPEST, Hold, Move, Multisine, Sine, SlowLoads

STEP = 1e-4
HOLD = Hold(run=1, velocity=-0.7, run_in=0.6, averaged=0.4, ramp=0.3)
MOVE = Move(start=0.2, stop=-0.5, duration=0.8)
SINES = Multisine(np.array([0.3, 0.02]), np.array([0.4, 5.0]), np.array([0.0, 2.0]))
SINE = Sine(0.4, 1.5)
KINDS: dict[str, tuple[float, Callable[[Array], Reference]]] = {
    "hold": (HOLD.duration, lambda t: HOLD.at(t, 0.5)), "move": (MOVE.duration, MOVE.at),
    "multisine": (2.0, lambda t: SINES.at(t, 2.0)), "sine": (1.0, SINE.at),
}  # fmt: skip  # a table


def instants(duration: float, step: float = STEP) -> Array:
    """From 0 to the duration, s."""
    return np.arange(round(duration / step) + 1, dtype=np.float64) * step


@pytest.mark.parametrize("kind", list(KINDS))
def test_velocity_and_acceleration_are_derivatives(kind: str) -> None:
    """Central differences of the position give the velocity, and those of the velocity the acceleration, to a thousandth."""
    duration, at = KINDS[kind]
    r, inner = at(instants(duration)), slice(1, -1)
    for whole, slope in ((r.position, r.velocity), (r.velocity, r.acceleration)):
        np.testing.assert_allclose(np.gradient(whole, STEP)[inner], slope[inner], atol=1e-3 * np.abs(slope).max())
    assert r.torque == 0.0


@pytest.mark.parametrize("kind", ["hold", "move", "multisine"])
def test_a_run_begins_and_ends_at_rest(kind: str) -> None:
    """Velocity is zero at both ends, and a hold and a move end where they say."""
    duration, at = KINDS[kind]
    r = at(instants(duration))
    np.testing.assert_allclose(r.velocity[[0, -1]], 0.0, atol=1e-12)
    travelled = {"hold": HOLD.travel, "move": MOVE.stop - MOVE.start, "multisine": 0.0}[kind]
    assert r.position[-1] - r.position[0] == pytest.approx(travelled, abs=1e-12)


@settings(max_examples=20, deadline=None)
@given(st.floats(0.1, 2.0), st.floats(0.2, 3.0))
def test_the_largest_slopes_are_those_that_are_stated(velocity: float, duration: float) -> None:
    """A hold's ramp and a move reach the largest velocity and acceleration that their constants give, and no more."""
    hold = Hold(1, velocity, 0.1, 0.1, duration).at(instants(2 * duration + 0.2, duration / 1000))
    assert np.abs(hold.acceleration).max() == pytest.approx(STEEPEST * velocity / duration, rel=1e-5)
    move = Move(0.0, velocity, duration).at(instants(duration, duration / 1000))
    assert move.velocity.max() == pytest.approx(FASTEST * velocity / duration, rel=1e-5)
    assert np.abs(move.acceleration).max() == pytest.approx(HARDEST * velocity / duration**2, rel=1e-5)


def test_slow_loads_reach_their_peaks_and_rest_between() -> None:
    """Each peak with its sign after its rise, zero before, after and at each pause; the joint is asked to stay."""
    loads = SlowLoads((0.3, -0.2), rise=2.0, fall=0.5, rest=1.0, pause=0.25)
    r = loads.at(instants(loads.duration, 0.25))
    assert loads.duration == 1.0 + 2.0 + 0.5 + 0.25 + 2.0 + 0.5 + 1.0
    np.testing.assert_allclose(
        r.torque[[0, 4, 8, 12, 14, 15, 23, 25, 29]], [0, 0, 0.15, 0.3, 0, 0, -0.2, 0, 0], atol=1e-15
    )
    assert not np.any([r.position, r.velocity, r.acceleration])


def test_a_torque_is_played_open_loop() -> None:
    """Without gains the drive gives the reference's torque and nothing else, within its limit."""
    pair, n = edro.TABLE_1["gripper rotation"], 200
    one = Case(
        plant=pair, motor=Motor(1.0, 1.0, 0.0, 1e-3), model=pair, gains=Gains(0.0, 0.0, 0.0, 0.0), torque_limit=0.01
    )
    torque, still = 0.02 * np.sin(0.05 * np.arange(n)), np.zeros(n)
    run = simulate(
        LoopOptions(compensator=Compensator(name="none")), [one], Reference(still, still, still, torque), 1e-3
    )
    np.testing.assert_array_equal(run.torque[0], np.clip(torque, -0.01, 0.01))
