"""Sliding mode with a boundary layer: what the paper's introduction holds against it, measured."""

import numpy as np
import pytest

from bristle.control.closed_loop import simulate
from bristle.control.compensator import Compensator
from bristle.control.control_period import LoopOptions
from bristle.control.pid import Sliding
from bristle.simulation import edro

from .conftest import H, case, sine

BARE = Compensator(name="none")


def test_a_thin_layer_tracks_and_chatters() -> None:
    """Without any model base rotation follows 1 rad at 0.5 Hz to a hundredth of the PID's error, and asks for a hundred times its chatter."""
    joint, course = case("base rotation", sliding=Sliding(2.0, 15.0, 0.01, 0.0)), sine(6.0, 0.5)
    linear = simulate(LoopOptions(compensator=BARE), [joint], course, H)
    thin = simulate(LoopOptions(compensator=BARE, controller="sliding"), [joint], course, H)
    assert thin.rms_error(1.0)[0] < 0.01 * linear.rms_error(1.0)[0]
    assert thin.chatter(1.0)[0] > 100 * linear.chatter(1.0)[0]
    assert np.abs(thin.torque).max() <= 2.0


def test_a_wide_layer_is_as_calm_as_the_pid() -> None:
    """The default layer is wide: on every joint its chatter is within a tenth of the PID's, and its error no larger than that by a tenth."""
    for name in edro.TABLE_1:
        linear, wide = (
            simulate(LoopOptions(compensator=BARE, controller=which), [case(name)], sine(6.0, 0.5), H)
            for which in ("pid", "sliding")
        )
        assert wide.chatter(1.0)[0] == pytest.approx(linear.chatter(1.0)[0], rel=0.1)
        assert wide.rms_error(1.0)[0] < 1.1 * linear.rms_error(1.0)[0]
