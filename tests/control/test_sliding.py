"""Sliding mode with a boundary layer: what the paper's introduction holds against it, measured."""

import numpy as np
import pytest

from bristle.control.closed_loop import simulate
from bristle.control.compensator import Compensator
from bristle.control.control_period import LoopOptions
from bristle.control.pid import AT_REST, Gains, Memory, Sliding, pid, sliding
from bristle.simulation import edro

from .conftest import H, case, sine

BARE = Compensator(name="none")


def test_within_its_layer_it_is_a_pd_controller() -> None:
    """There T = K / layer (de/dt + slope e), which is (21) with K_d = K / layer and K_p = slope K_d; beyond, T = +-K."""
    gains, layer = Sliding(K=2.0, slope=15.0, layer=10.0, filter_time=0.002), AT_REST
    same, alike = Gains(K_p=3.0, K_i=0.0, K_d=0.2, filter_time=0.002), AT_REST
    for error in 0.02 * np.sin(np.arange(30)):
        T, layer = sliding(layer, float(error), 0.01, gains)
        expected, alike = pid(alike, float(error), 0.01, same, 1e9)
        assert float(T) == pytest.approx(float(expected), abs=1e-12)
    for error, T in ((50.0, 2.0), (-50.0, -2.0)):
        assert float(sliding(Memory(0.0, 0.0, error), error, 0.01, gains)[0]) == T


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


def test_without_a_layer_it_is_refused() -> None:
    """A layer of zero or nan is refused in one sentence."""
    for layer in (0.0, np.nan):
        with pytest.raises(ValueError, match=r"sliding: layer: got .*; expected a positive number"):
            case("wrist pitch", sliding=Sliding(2.0, 15.0, layer, 0.0))
