from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import ArrayLike

from bristle.data.differentiation import between_gaps, derivative, estimate_motion, smoothed, without_rests
from bristle.data.record import Record

from .experiments import present


def _record(time: ArrayLike, position: ArrayLike, starts: tuple[int, ...] = (0,)) -> Record:
    stamps = np.asarray(time, dtype=float)
    return Record(
        file="a.csv", time=stamps, position=np.asarray(position, dtype=float), starts=starts, rows=stamps.size
    )


def test_a_slow_sine_comes_back() -> None:
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


def test_the_filter_is_zero_phase_and_of_twice_half_power() -> None:
    """Forward and backward, a sine at the cut-off keeps its phase and half of its amplitude."""
    t = np.arange(4000) * 1e-3
    sine = np.asarray(np.sin(2 * np.pi * 20 * t), dtype=float)
    inside = slice(500, -500)
    np.testing.assert_allclose(smoothed(_record(t, sine), sine, 20.0)[inside], sine[inside] / 2, atol=2e-3)


def test_a_noisy_end_does_not_pin_the_signal() -> None:
    """The ends of a ramp come back with hardly any of the noise of the end samples; a ramp without noise comes back as it is, either way."""
    time, rng = np.arange(2000) / 500, np.random.default_rng(5)
    ramp, record = 0.3 * time, _record(time, time)
    for noisy in (False, True):
        assert smoothed(record, ramp, 2.0, noisy=noisy) == pytest.approx(ramp, abs=2e-3)
    noise = rng.standard_normal((200, time.size))
    ends = {noisy: [smoothed(record, ramp + x, 2.0, noisy=noisy)[0] for x in noise] for noisy in (False, True)}
    assert np.std(ends[True]) < 0.35
    assert np.std(ends[False]) == pytest.approx(1, rel=0.15)


def test_nothing_crosses_a_gap() -> None:
    """Each segment is what it would be alone, whatever stands in the other."""
    t = np.arange(100) * 1e-2
    first, second = np.sin(t), 1e6 + np.cos(3 * t)
    both = estimate_motion(_record(np.concatenate([t, t + 50]), np.concatenate([first, second]), (0, 100)), 10.0)
    alone = estimate_motion(_record(t, first), 10.0)
    np.testing.assert_allclose(present(both.velocity)[:100], present(alone.velocity), atol=1e-9)
    assert [s.stop for s in between_gaps(both)] == [100, 200]


def test_short_segments_are_left_out_and_counted() -> None:
    """A segment too short to filter is dropped, said, and the starts still point at the segments left."""
    t = np.concatenate([np.arange(50) * 0.01, 10 + np.arange(3) * 0.01, 20 + np.arange(40) * 0.01])
    record = estimate_motion(_record(t, t**2, (0, 50, 53)), 10.0)
    assert (record.time.size, record.starts, record.dropped) == (90, (0, 50), 3)
    assert record.time[50] == 20
    assert any((note.code, note.numbers) == ("rows-of-short-segments", {"rows": 3}) for note in record.notes)
    with pytest.raises(ValueError, match="no segment between gaps has 16 samples"):
        estimate_motion(_record(t[:10], t[:10]), 10.0)


def test_a_cutoff_beyond_nyquist_is_lowered_and_said() -> None:
    """At 20 Hz no filter of 100 Hz exists: it becomes 8 Hz, which a note says."""
    t = np.arange(100) * 0.05
    (note,) = estimate_motion(_record(t, np.sin(t)), 100.0).notes
    assert note.numbers["cutoff"] == pytest.approx(8.0)
    assert (note.numbers["why"].code, note.numbers["why"].numbers) == ("cutoff-lowered", {"asked": 100.0})


def test_a_logged_velocity_stays_and_is_differentiated() -> None:
    """With velocity logged, only the acceleration is estimated, from the velocity; with nothing logged it is refused."""
    t = np.arange(1000) * 1e-2
    record = replace(_record(t, np.zeros(1000) + t), velocity=np.asarray(t**2, dtype=float), position=None)
    moved = estimate_motion(record, 5.0)
    np.testing.assert_array_equal(present(moved.velocity), t**2)
    np.testing.assert_allclose(present(moved.acceleration)[100:-100], 2 * t[100:-100], atol=1e-3)
    assert moved.notes[-1].code == "acceleration-from-velocity"
    with pytest.raises(ValueError, match="neither position nor velocity"):
        estimate_motion(replace(record, velocity=None), 5.0)


def test_central_differences_are_exact_for_parabolas_on_any_grid() -> None:
    """The derivative of t**2 is 2 t inside, with irregular intervals too."""
    t = np.cumsum(np.random.default_rng(0).uniform(0.5, 1.5, 50))
    np.testing.assert_allclose(derivative(_record(t, t), t**2)[1:-1], 2 * t[1:-1])


def test_rests_are_left_out_unless_nothing_is_left() -> None:
    """Three seconds at one place are no motion; a record of which all rests, as of one whose time is in another unit, stays as it is."""
    t = np.arange(2000) / 100
    q = np.where(t < 8, np.sin(t), np.where(t < 13, np.sin(8.0), np.sin(t - 5)))
    record = Record(file="x", time=t, position=q, velocity=q, torque=q)
    kept = without_rests(record)
    assert (kept.time.size, kept.starts) == (1499, (0, 800))
    assert [n.code for n in kept.notes] == ["rests-left-out"]
    slow = Record(file="x", time=1e6 * t, position=np.rint(q), velocity=q, torque=q, cutoff=1e-5)
    assert without_rests(slow) is slow
