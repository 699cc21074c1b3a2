import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bristle.control.pid import AT_REST, Gains, Memory, Sliding, pid, sliding

GAINS = Gains(3.0, 1.2, 0.2, 0.0)
errors = st.lists(st.floats(-1, 1), min_size=1, max_size=30)


def run(
    values: list[float], gains: Gains[float] = GAINS, limit: float = 1e9, h: float = 1e-3
) -> list[tuple[float, Memory[float]]]:
    """The output and the memory after each error."""
    out, memory = [], AT_REST
    for error in values:
        output, memory = pid(memory, error, h, gains, limit)
        out.append((output, memory))
    return out


@settings(deadline=None, max_examples=50)
@given(errors)
def test_unlimited_output_is_21(values: list[float]) -> None:
    """Far from the limit, the output is K_p e + K_i sum(e) h + K_d (e - e_before) / h."""
    h, e = 1e-3, np.array(values)
    expected = 3 * e + 1.2 * h * np.cumsum(e) + 0.2 * np.diff(e, prepend=0.0) / h
    np.testing.assert_allclose([u for u, _ in run(values)], expected, rtol=1e-12, atol=1e-12)


@settings(deadline=None, max_examples=50)
@given(errors, st.floats(1e-3, 10))
def test_integral_never_pushes_into_the_limit(values: list[float], limit: float) -> None:
    """The output stays within the limit; a sample whose output meets it with room to spare does not move the integral further that way."""
    before = 0.0
    for output, memory in run(values, limit=limit):
        assert abs(output) <= limit
        wanted = GAINS.K_p * memory.error + GAINS.K_d * memory.derivative + before
        if abs(wanted) > limit:
            assert memory.integral * np.sign(wanted) <= before * np.sign(wanted) + 1e-15
        before = memory.integral


def test_saturation_does_not_wind_up() -> None:
    """After a long saturation the output leaves its limit within a few samples of the error's change of sign; a wound-up one would not."""
    gains, limit = Gains(1.0, 10.0, 0.0, 0.0), 1.0
    outputs = [u for u, _ in run([2.0] * 5000 + [-0.1] * 5, gains, limit)]
    assert outputs[4999] == limit
    assert max(outputs[5000:]) < 0


def test_filter_has_unit_gain_on_a_ramp() -> None:
    """On an error that grows steadily the filtered derivative goes to its slope."""
    h, slope = 1e-3, 0.5
    _, memory = run([slope * h * (k + 1) for k in range(400)], Gains(0.0, 0.0, 1.0, 0.01), h=h)[-1]
    assert memory.derivative == pytest.approx(slope, rel=1e-12)


def test_within_its_layer_sliding_mode_is_a_pd_controller() -> None:
    """There T = K / layer (de/dt + slope e), which is (21) with K_d = K / layer and K_p = slope K_d; beyond, T = +-K."""
    gains, layer = Sliding(K=2.0, slope=15.0, layer=10.0, filter_time=0.002), AT_REST
    same, alike = Gains(K_p=3.0, K_i=0.0, K_d=0.2, filter_time=0.002), AT_REST
    for error in 0.02 * np.sin(np.arange(30)):
        T, layer = sliding(layer, float(error), 0.01, gains)
        expected, alike = pid(alike, float(error), 0.01, same, 1e9)
        assert float(T) == pytest.approx(float(expected), abs=1e-12)
    for error, T in ((50.0, 2.0), (-50.0, -2.0)):
        assert float(sliding(Memory(0.0, 0.0, error), error, 0.01, gains)[0]) == T
