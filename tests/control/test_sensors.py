import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bristle.control.plant import quantise, white_noise


@settings(deadline=None)
@given(st.floats(-100, 100), st.floats(1e-6, 1))
def test_reading_is_the_nearest_count(x: float, resolution: float) -> None:
    """A reading is a whole number of counts, at most half a count from the truth, and reads as itself."""
    reading = quantise(x, resolution)
    assert abs(reading - x) <= resolution / 2 * (1 + 1e-9) + 1e-12
    assert reading / resolution == pytest.approx(round(reading / resolution), abs=1e-6)
    assert quantise(reading, resolution) == pytest.approx(reading, abs=1e-12)


@settings(deadline=None)
@given(st.floats(-100, 100), st.floats(0, 10), st.floats(1e-6, 1))
def test_reading_never_falls_while_the_joint_rises(x: float, more: float, resolution: float) -> None:
    """The encoder is monotone."""
    assert quantise(x + more, resolution) >= quantise(x, resolution)


def test_symbol_and_float_agree() -> None:
    """A CasADi symbol is quantised as a float is."""
    s = ca.SX.sym("s")
    f = ca.Function("f", [s], [quantise(s, 0.01)])
    for x in (-1.2345, -0.005, 0.0, 0.00499, 0.005, 3.21):
        assert float(f(x)) == quantise(x, 0.01)


def test_noise_has_the_standard_deviation_asked_for() -> None:
    """Mean zero and the stated deviation within five standard errors, and neighbours independent; the seed fixes it."""
    x = white_noise(np.random.default_rng(1), 0.3, (2, 50_000))
    assert abs(x.mean()) < 5 * 0.3 / np.sqrt(x.size)
    assert abs(x.std() / 0.3 - 1) < 5 / np.sqrt(2 * x.size)
    assert abs(np.mean(x[:, 1:] * x[:, :-1])) < 5 * 0.09 / np.sqrt(x.size)
    np.testing.assert_array_equal(x, white_noise(np.random.default_rng(1), 0.3, (2, 50_000)))


def test_negative_deviation_is_refused() -> None:
    """A negative standard deviation is named in one sentence."""
    with pytest.raises(ValueError, match="expected zero or more"):
        white_noise(np.random.default_rng(0), -1.0, (3,))
