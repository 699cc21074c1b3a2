"""The low pass and the decimation that a run's own spectra ask for."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from bristle.data.bandwidth import decimation, of_held_speeds, of_motion, of_slow_loading
from bristle.data.differentiation import estimate_motion, smoothed
from bristle.data.record import Record

from .experiments import present

J = 0.02


def moving(rate: float, seconds: float, noise: float, torque_noise: float, count: float = 0.0) -> Record:
    """Three sines up to 0.9 Hz of a joint with inertia J and friction, with white noise of position, rad, and torque, N*m, or counts, rad."""
    rng, t = np.random.default_rng(1), np.arange(int(seconds * rate)) / rate
    w, size = 2 * np.pi * np.array([0.31, 0.53, 0.87]), np.array([1.0, 0.6, 0.4])
    angle = t[:, None] * w + size
    q, v, a = np.sin(angle) @ size, np.cos(angle) @ (size * w), -np.sin(angle) @ (size * w**2)
    q = q + noise * rng.standard_normal(t.size)
    q = np.round(q / count) * count if count else q
    torque = J * a + 0.1 * np.tanh(v / 0.01) + 0.05 * v + torque_noise * rng.standard_normal(t.size)
    return Record(file="run.csv", time=t, position=q, torque=torque)


@pytest.mark.parametrize(("noise", "torque_noise"), [(3e-5, 0.1), (6e-5, 0.1), (1e-4, 0.1)])
def test_the_inertia_makes_as_much_of_the_noise_as_the_torque_has(noise: float, torque_noise: float) -> None:
    """Of a motion with power at every frequency the cut-off is twice that where J (2 pi f)**2 times its noise is the torque's, within a fifth."""
    rng, rate = np.random.default_rng(0), 1000.0
    t = np.arange(30_000) / rate
    v = lfilter([4e-4], np.convolve([1, -0.98], [1, -0.98]), 100 * rng.standard_normal(t.size))
    torque = J * np.gradient(v, 1 / rate) + 0.05 * v + torque_noise * rng.standard_normal(t.size)
    q = np.cumsum(v) / rate + noise * rng.standard_normal(t.size)
    cutoff, _ = of_motion(Record(file="run.csv", time=t, position=q, torque=torque))
    assert cutoff == pytest.approx(2 * np.sqrt(torque_noise / (J * noise)) / (2 * np.pi), rel=0.2)


def test_a_low_pass_is_never_narrower_than_the_motion() -> None:
    """With counts of a hundredth of the travel, a fiftieth and a twentieth the cut-off is four times the motion's bandwidth."""
    for count in (0.04, 0.08, 0.2):
        cutoff, why = of_motion(moving(200.0, 20.0, 0.0, 0.01, count))
        assert cutoff == pytest.approx(4 * why.numbers["motion"])


def test_noise_that_grows_with_the_frequency_is_left_below_where_the_inertia_stands_still() -> None:
    """A logged velocity with noise of its own, and a torque that was commanded: the inertia at the cut-off is right to 3 %, at six times it not."""
    run = moving(1000.0, 20.0, 0.0, 0.0)
    rng = np.random.default_rng(0)
    v = np.gradient(present(run.position), run.time)
    noisy = replace(run, velocity=v + 5 * np.diff(rng.standard_normal(v.size + 1)))
    cutoff, _ = of_motion(noisy)
    assert abs(inertia(noisy, cutoff) / J - 1) < 0.03
    assert inertia(noisy, 6 * cutoff) < 0.9 * J


def inertia(record: Record, cutoff: float) -> float:
    """By least squares, both sides through the low pass."""
    moved = estimate_motion(record, cutoff)
    v, a = np.asarray(moved.velocity), np.asarray(moved.acceleration)
    *columns, y = (smoothed(record, x, cutoff) for x in (a, np.sign(v), v, np.ones(v.size), np.asarray(record.torque)))
    return float(np.linalg.lstsq(np.column_stack(columns), y, rcond=None)[0][0])


def test_what_repeats_ends_where_its_lines_do() -> None:
    """Between the lines of a triangle's spectrum there is nothing: it ends where the highest of them falls into noise, not after the first."""
    t = np.arange(0, 40, 1e-3)
    triangle = np.interp(t % 4, [0, 1, 3, 4], [0, 1, -1, 0])
    noise = 1e-3 * np.random.default_rng(0).standard_normal(t.size)
    cutoff, why = of_held_speeds(Record(file="a", time=t, position=triangle + noise))
    assert 2 < cutoff == why.numbers["shown"] / 2 < 20


def test_slow_loading_has_ten_times_the_bandwidth_of_its_torque_whatever_the_noise() -> None:
    """A cycle of 10 s has 99.9 % of its power in its first harmonics; ten times the noise changes nothing."""
    t = np.arange(0, 40, 5e-3)
    cycle, rng = np.interp(t % 10, [0, 2.5, 7.5, 10], [0, 1, -1, 0]), np.random.default_rng(0)
    for size in (0.0, 1e-3, 1e-2, 0.1):
        cutoff, _ = of_slow_loading(Record(file="a", time=t, torque=cycle + size * rng.standard_normal(t.size)))
        assert cutoff == pytest.approx(10 * 0.5, rel=0.3)


def test_held_speeds_ask_for_half_of_what_their_position_shows() -> None:
    """Noise a hundred times as large lowers the cut-off; it is below the sampling rate's Nyquist frequency in any case."""
    t = np.arange(0, 30, 5e-3)
    v = np.repeat([0.5, -0.5, 0.2, -0.2, 1.0, -1.0], t.size // 6)
    q, rng = np.cumsum(v) * 5e-3, np.random.default_rng(0)
    fine, coarse = (
        of_held_speeds(Record(file="a", time=t, position=q + s * rng.standard_normal(t.size)))[0] for s in (1e-6, 1e-4)
    )
    assert coarse < fine < 100


@settings(deadline=None, max_examples=20)
@given(length=st.floats(1e-3, 1e3), torque=st.floats(1e-3, 1e3), time=st.floats(1e-2, 1e2))
def test_units_change_nothing(length: float, torque: float, time: float) -> None:
    """In other units of position and torque the cut-off is the same, and in another unit of time the same in that unit; so is the decimation."""
    run = moving(500.0, 12.0, 3e-6, 0.01)
    other = replace(
        run, time=time * run.time, position=length * present(run.position), torque=torque * present(run.torque)
    )
    cutoff, scaled = of_motion(run)[0], of_motion(other)[0]
    assert scaled * time == pytest.approx(cutoff, rel=0.3)
    assert decimation([replace(other, cutoff=scaled)]) == pytest.approx(
        decimation([replace(run, cutoff=cutoff)]), rel=0.35
    )


@pytest.mark.parametrize(("size", "passes"), [(0.0015, True), (0.0001, False)])
def test_vibration_is_part_of_the_motion(size: float, passes: bool) -> None:
    """One of 31 Hz that makes a twentieth of the speed's power, and a millionth of the position's, passes; a ten-thousandth does not."""
    rng, t = np.random.default_rng(1), np.arange(6000) / 500
    w, sizes = 2 * np.pi * np.array([0.17, 0.41, 1.1, 31.0]), np.array([0.75, 0.2, 0.045, size])
    angle = t[:, None] * w
    q, v, a = np.sin(angle) @ sizes, np.cos(angle) @ (sizes * w), -np.sin(angle) @ (sizes * w**2)
    torque = J * a + 0.7 * np.tanh(v / 0.01) + 0.4 * v + 0.003 * rng.standard_normal(t.size)
    run = Record(file="run.csv", time=t, position=q + 1e-6 * rng.standard_normal(t.size), torque=torque)
    assert (of_motion(run)[0] > 31) == passes
