from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike
from scipy.signal import lfilter

from bristle.data.bandwidth import decimation, of_held_speeds, of_motion, of_slow_loading
from bristle.data.differentiation import between_gaps, derivative, estimate_motion, smoothed, without_rests
from bristle.data.record import Record

from ..conftest import present


def _record(time: ArrayLike, position: ArrayLike, starts: tuple[int, ...] = (0,)) -> Record:
    stamps = np.asarray(time, dtype=float)
    return Record(
        file="a.csv", time=stamps, position=np.asarray(position, dtype=float), starts=starts, rows=stamps.size
    )


def test_derivatives_of_segments() -> None:
    """Well below the cut-off, velocity and acceleration are the derivatives of the position, without delay."""
    t = np.arange(4000) * 1e-3
    w = 2 * np.pi * 0.5
    record = estimate_motion(_record(t, np.sin(w * t)), 50.0)
    inside = slice(200, -200)
    np.testing.assert_allclose(present(record.velocity)[inside], w * np.cos(w * t)[inside], atol=1e-4 * w)
    np.testing.assert_allclose(present(record.acceleration)[inside], -(w**2) * np.sin(w * t)[inside], atol=1e-3 * w**2)
    (note,) = record.notes
    assert (note.code, note.numbers["cutoff"]) == ("motion-from-position", 50.0)
    assert note.numbers["why"].code == "cutoff-asked"
    # each segment is what it would be alone, whatever stands in the other
    t = np.arange(100) * 1e-2
    first, second = np.sin(t), 1e6 + np.cos(3 * t)
    both = estimate_motion(_record(np.concatenate([t, t + 50]), np.concatenate([first, second]), (0, 100)), 10.0)
    alone = estimate_motion(_record(t, first), 10.0)
    np.testing.assert_allclose(present(both.velocity)[:100], present(alone.velocity), atol=1e-9)
    assert [s.stop for s in between_gaps(both)] == [100, 200]
    # a segment too short to filter is dropped, said, and the starts still point at the segments left
    t = np.concatenate([np.arange(50) * 0.01, 10 + np.arange(3) * 0.01, 20 + np.arange(40) * 0.01])
    record = estimate_motion(_record(t, t**2, (0, 50, 53)), 10.0)
    assert (record.time.size, record.starts, record.dropped) == (90, (0, 50), 3)
    assert record.time[50] == 20
    assert any((note.code, note.numbers) == ("rows-of-short-segments", {"rows": 3}) for note in record.notes)
    with pytest.raises(ValueError, match="no segment between gaps has 16 samples"):
        estimate_motion(_record(t[:10], t[:10]), 10.0)
    # at 20 Hz no filter of 100 Hz exists: it becomes 8 Hz, which a note says
    t = np.arange(100) * 0.05
    (note,) = estimate_motion(_record(t, np.sin(t)), 100.0).notes
    assert note.numbers["cutoff"] == pytest.approx(8.0)
    assert (note.numbers["why"].code, note.numbers["why"].numbers) == ("cutoff-lowered", {"asked": 100.0})
    # with velocity logged, only the acceleration is estimated, from the velocity; with nothing logged it is refused
    t = np.arange(1000) * 1e-2
    record = replace(_record(t, np.zeros(1000) + t), velocity=np.asarray(t**2, dtype=float), position=None)
    moved = estimate_motion(record, 5.0)
    np.testing.assert_array_equal(present(moved.velocity), t**2)
    np.testing.assert_allclose(present(moved.acceleration)[100:-100], 2 * t[100:-100], atol=1e-3)
    assert moved.notes[-1].code == "acceleration-from-velocity"
    with pytest.raises(ValueError, match="neither position nor velocity"):
        estimate_motion(replace(record, velocity=None), 5.0)
    # three seconds at one place are no motion; a record that rests throughout stays as it is
    t = np.arange(2000) / 100
    q = np.where(t < 8, np.sin(t), np.where(t < 13, np.sin(8.0), np.sin(t - 5)))
    record = Record(file="x", time=t, position=q, velocity=q, torque=q)
    kept = without_rests(record)
    assert (kept.time.size, kept.starts) == (1499, (0, 800))
    assert [n.code for n in kept.notes] == ["rests-left-out"]
    slow = Record(file="x", time=1e6 * t, position=np.rint(q), velocity=q, torque=q, cutoff=1e-5)
    assert without_rests(slow) is slow


def test_the_filter_and_the_bandwidth_of_a_run() -> None:
    """Forward and backward, a sine at the cut-off keeps its phase and half of its amplitude."""
    t = np.asarray(np.arange(4000) * 1e-3, dtype=float)
    sine = np.asarray(np.sin(2 * np.pi * 20 * t), dtype=float)
    inside = slice(500, -500)
    both = smoothed(_record(t, sine), np.column_stack([sine, t]), 20.0).T  # each by itself
    assert all(np.array_equal(x, smoothed(_record(t, sine), y, 20.0)) for x, y in zip(both, (sine, t), strict=True))
    np.testing.assert_allclose(smoothed(_record(t, sine), sine, 20.0)[inside], sine[inside] / 2, atol=2e-3)
    # the ends of a ramp come back with hardly any of the noise of the end samples; a ramp without noise comes back as it is, either way
    time, rng = np.arange(2000) / 500, np.random.default_rng(5)
    ramp, record = 0.3 * time, _record(time, time)
    for noisy in (False, True):
        assert smoothed(record, ramp, 2.0, noisy=noisy) == pytest.approx(ramp, abs=2e-3)
    noise = rng.standard_normal((200, time.size))
    ends = {noisy: [smoothed(record, ramp + x, 2.0, noisy=noisy)[0] for x in noise] for noisy in (False, True)}
    assert np.std(ends[True]) < 0.35
    assert np.std(ends[False]) == pytest.approx(1, rel=0.15)
    # the derivative of t**2 is 2 t inside, with irregular intervals too
    t = np.cumsum(np.random.default_rng(0).uniform(0.5, 1.5, 50))
    np.testing.assert_allclose(derivative(_record(t, t), t**2)[1:-1], 2 * t[1:-1])
    # a triangle's spectrum ends where the highest of its lines falls into noise, not after the first
    t = np.arange(0, 40, 1e-3)
    triangle = np.interp(t % 4, [0, 1, 3, 4], [0, 1, -1, 0])
    noise = 1e-3 * np.random.default_rng(0).standard_normal(t.size)
    cutoff, why = of_held_speeds(Record(file="a", time=t, position=triangle + noise))
    assert 2 < cutoff == why.numbers["shown"] / 2 < 20
    # noise a hundred times as large lowers the cut-off; it is below the sampling rate's Nyquist frequency in any case
    t = np.arange(0, 30, 5e-3)
    v = np.repeat([0.5, -0.5, 0.2, -0.2, 1.0, -1.0], t.size // 6)
    q, rng = np.cumsum(v) * 5e-3, np.random.default_rng(0)
    fine, coarse = (
        of_held_speeds(Record(file="a", time=t, position=q + s * rng.standard_normal(t.size)))[0] for s in (1e-6, 1e-4)
    )
    assert coarse < fine < 100
    # a cycle of 10 s has 99.9 % of its power in its first harmonics; ten times the noise changes nothing
    t = np.arange(0, 40, 5e-3)
    cycle, rng = np.interp(t % 10, [0, 2.5, 7.5, 10], [0, 1, -1, 0]), np.random.default_rng(0)
    for size in (0.0, 1e-3, 1e-2, 0.1):
        cutoff, _ = of_slow_loading(Record(file="a", time=t, torque=cycle + size * rng.standard_normal(t.size)))
        assert cutoff == pytest.approx(10 * 0.5, rel=0.3)
    # with counts of a hundredth of the travel, a fiftieth and a twentieth the cut-off is four times the motion's bandwidth
    for count in (0.04, 0.08, 0.2):
        cutoff, why = of_motion(moving(200.0, 20.0, 0.0, 0.01, count))
        assert cutoff == pytest.approx(4 * why.numbers["motion"])


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


def test_the_cut_off_follows_noise_and_vibration() -> None:
    """Of a motion with power at every frequency the cut-off is twice that where J (2 pi f)**2 times its noise is the torque's, within a fifth."""
    for noise, torque_noise in ((3e-5, 0.1), (6e-5, 0.1), (1e-4, 0.1)):
        rng, rate = np.random.default_rng(0), 1000.0
        t = np.arange(30_000) / rate
        v = lfilter([4e-4], np.convolve([1, -0.98], [1, -0.98]), 100 * rng.standard_normal(t.size))
        torque = J * np.gradient(v, 1 / rate) + 0.05 * v + torque_noise * rng.standard_normal(t.size)
        q = np.cumsum(v) / rate + noise * rng.standard_normal(t.size)
        cutoff, _ = of_motion(Record(file="run.csv", time=t, position=q, torque=torque))
        assert cutoff == pytest.approx(2 * np.sqrt(torque_noise / (J * noise)) / (2 * np.pi), rel=0.2)
    # one of 31 Hz that makes a twentieth of the speed's power, and a millionth of the position's, passes; a ten-
    # thousandth does not
    for size, passes in ((0.0015, True), (0.0001, False)):
        rng, t = np.random.default_rng(1), np.arange(6000) / 500
        w, sizes = 2 * np.pi * np.array([0.17, 0.41, 1.1, 31.0]), np.array([0.75, 0.2, 0.045, size])
        angle = t[:, None] * w
        q, v, a = np.sin(angle) @ sizes, np.cos(angle) @ (sizes * w), -np.sin(angle) @ (sizes * w**2)
        torque = J * a + 0.7 * np.tanh(v / 0.01) + 0.4 * v + 0.003 * rng.standard_normal(t.size)
        run = Record(file="run.csv", time=t, position=q + 1e-6 * rng.standard_normal(t.size), torque=torque)
        assert (of_motion(run)[0] > 31) == passes


@settings(max_examples=20)
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
