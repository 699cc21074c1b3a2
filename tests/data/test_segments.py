from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import butter, filtfilt, lfilter

from bristle.arrays import Array
from bristle.data.constant_velocity.segments import Segment, Thresholds, find_segments, nothing_left
from bristle.data.record import Record
from bristle.findings import CRITICAL, Finding
from bristle.model.functions import steady_torque_function
from bristle.model.vectorize import evaluate

from ..conftest import present

RATE = 500.0
LEVELS = (0.05, 0.1, 0.3, 0.6, 1.0, 1.5)
NOISE = 0.02
TRUE = (1.3, 0.2, 0.75, 0.1)


def friction(velocity: Array) -> Array:
    return evaluate(steady_torque_function(), velocity, TRUE[0], TRUE[1], TRUE[2], TRUE[3])[0]


def staircase(seed: int = 0, hold: float = 2.0, signs: tuple[int, ...] = (1, -1)) -> Record:
    """Plateaus at LEVELS in each direction, joined by 0.3 s ramps through rest, with white velocity and torque noise; and inertia."""
    rng = np.random.default_rng(seed)
    knots, values, t = [0.0, 0.5], [0.0, 0.0], 0.5
    for sign in signs:
        for level in LEVELS:
            knots += [t + 0.3, t + 0.3 + hold, t + 0.6 + hold]
            values += [sign * level, sign * level, 0.0]
            t += 0.6 + hold
    time = np.arange(0, t + 0.5, 1 / RATE)
    v = np.interp(time, knots, values)
    torque = friction(v) + 0.1 * np.gradient(v, time) + NOISE * rng.normal(size=v.size)
    position = np.cumsum(v) / RATE
    noisy = v + 2e-3 * rng.normal(size=v.size)
    return Record(file="staircase.csv", time=time, position=position, velocity=noisy, torque=torque)


def quantised(record: Record, counts: int) -> Record:
    """The record as an encoder of so many counts per turn sees it, its velocity from zero-phase filtered differences."""
    q = 2 * np.pi / counts
    position = q * np.floor(present(record.position) / q)
    b, a = butter(2, 20 / (RATE / 2))
    return replace(record, position=position, velocity=np.gradient(filtfilt(b, a, position), record.time))


def accepted(segments: tuple[Segment, ...]) -> list[Segment]:
    return [s for s in segments if s.accepted]


def is_right(found: list[Segment], levels: list[float], rel: float = 0.02) -> bool:
    """Whether the velocities are these, in this order."""
    return [s.velocity for s in found] == pytest.approx(levels, rel=rel)


BOTH = [*LEVELS, *(-v for v in LEVELS)]


def test_plateaus_are_found_or_rejected_with_their_reason() -> None:
    """Twelve plateaus in both directions: twelve accepted segments, with the right velocities, and torques within four standard errors."""
    found = accepted(find_segments(staircase(), Thresholds()))
    assert is_right(found, BOTH, rel=1e-3)
    off = [(s.torque - friction(np.array([s.velocity]))[0]) / (s.standard_error or np.nan) for s in found]
    assert np.abs(off).max() < 4
    assert not any(s.stick_slip for s in found)
    # triangles, sines, ramps of velocity and rest hold no segment; the longest candidate says why. Nor does a joint that creeps while its
    # torque goes through zero, which is bent, not slid, or that hunts about a slow mean
    for name, (record, code) in _NOT_CONSTANT.items():
        found = find_segments(record, Thresholds())
        longest = max(found, key=lambda s: s.stop - s.start)
        of = found if code in {"unsettled", "hunting"} else [longest]
        assert (name, accepted(found)) == (name, [])
        assert code in [reason.code for segment in of for reason in segment.reasons], name
    # a joint that rests half of the time and slips in between, at a steady mean, is one segment, with a warning
    slips = 0.08 * np.maximum(np.sin(2 * np.pi * 4 * T), 0.0) * (1 + 0.1 * np.sin(2 * np.pi * 0.9 * T))
    (segment,) = accepted(find_segments(motion(slips, 1.5 + 0.2 * np.cos(2 * np.pi * 4 * T)), Thresholds()))
    assert segment.stick_slip
    assert segment.velocity == pytest.approx(0.08 / np.pi, rel=0.05)
    assert any(warning.code == "stick-slip" for warning in segment.warnings)
    # five plateaus with rests as long between them are five segments, none of which sticks
    velocity = np.tile(np.r_[np.zeros(300), np.linspace(0, 0.5, 20), np.full(300, 0.5), np.linspace(0.5, 0, 20)], 5)
    found = accepted(find_segments(motion(velocity), Thresholds()))
    assert is_right(found, [0.5] * 5)
    assert not any(s.stick_slip for s in found)
    # a torque clipped for a third of a plateau is saturated
    free = motion(np.full(N, 0.5), 1.8 + 0.1 * np.random.default_rng(1).normal(size=N))
    (segment,) = find_segments(replace(free, torque=np.minimum(present(free.torque), 1.84)), Thresholds())
    assert any(reason.code == "saturated" for reason in segment.reasons)
    assert accepted(find_segments(free, Thresholds()))


def test_encoders_and_settling_hide_no_plateau() -> None:
    """From 12 bits up, every plateau is found, in order, and quantisation is not taken for stick-slip."""
    for counts in (4096, 65536):
        record = quantised(staircase(seed=1), counts)
        found = accepted(find_segments(record, Thresholds(), 2 * np.pi / counts))
        assert is_right(found, BOTH)
        assert not any(s.stick_slip for s in found)
    # of four seconds in which the torque settles, the end is the point, and right; there is none where it never does
    for settling, off in ((0.3, 0.001), (0.5, 0.003), (1.0, None)):
        time = np.arange(0, 6, 1 / RATE)
        v = np.interp(time, [0, 0.9, 1, 5, 5.1, 6], [0, 0, 0.05, 0.05, 0, 0])
        settles = np.where(time > 1, 1 - np.exp((1 - time) / settling), 0.0)
        for seed in range(10):
            noise = np.random.default_rng(seed).normal(size=(2, time.size))
            torque = friction(v) * settles + 0.2 * NOISE * noise[1]
            record = Record(file="slow.csv", time=time, velocity=v + 1e-4 * noise[0], torque=torque)
            found = accepted(find_segments(record, Thresholds()))
            assert len(found) == (off is not None)
            for s in found:
                assert s.torque == pytest.approx(friction(np.array([0.05]))[0], rel=off)
    # a few samples give a rejected candidate or more, and no warning; without velocity and torque a sentence
    for n in (1, 2, 5, 70):
        time = np.linspace(0, 1e-3 * (n - 1), n)
        record = Record(file="short.csv", time=time, velocity=np.zeros(n), torque=np.zeros(n))
        found = find_segments(record, Thresholds())
        assert found
        assert not accepted(found)
        assert "No segment" in nothing_left(found, (record,))
    with pytest.raises(ValueError, match=r"bare\.csv.*under signals"):
        find_segments(Record(file="bare.csv", time=np.arange(5.0)), Thresholds())


def test_the_standard_error_is_right_over_repetitions() -> None:
    """One plateau, known noise: the means scatter about the truth by the standard error, with AR(1) noise."""
    z, n, rho = [], 800, 0.8
    for seed in range(60):
        rng = np.random.default_rng(seed)
        noise = lfilter([np.sqrt(1 - rho**2)], [1.0, -rho], rng.normal(size=n + 200))[200:]
        v = 0.5 + 1e-3 * rng.normal(size=n)
        record = Record(file="one.csv", time=np.arange(n) / RATE, velocity=v, torque=2.0 + 0.05 * noise)
        (segment,) = accepted(find_segments(record, Thresholds()))
        assert segment.standard_error is not None
        z.append((segment.torque - 2.0) / segment.standard_error)
    assert 0.8 < np.sqrt(np.mean(np.square(z))) < 1.2


@settings(max_examples=4)
@given(st.tuples(*[st.floats(-4, 4)] * 3), st.sampled_from([1.0, -1.0]))
def test_units_and_sign_change_no_decision(powers: tuple[float, float, float], sign: float) -> None:
    """Time, velocity and torque in any other units, and motion in the other direction, leave every cut and every decision as it was."""
    tick, speed, load = (2.0 ** round(3 * p) for p in powers)
    record = staircase(seed=2, hold=0.5, signs=(1,))
    other = replace(
        record, time=record.time * tick, velocity=present(record.velocity) * speed * sign,
        position=present(record.position) * speed * tick * sign, torque=present(record.torque) * load * sign,
    )  # fmt: skip  # a list of values
    before, after = find_segments(record, Thresholds()), find_segments(other, Thresholds())
    assert [(s.start, s.stop, s.accepted) for s in before] == [(s.start, s.stop, s.accepted) for s in after]
    assert [s.velocity * speed * sign for s in before] == pytest.approx([s.velocity for s in after])


RECORDS = [staircase(seed=3, hold=0.5, signs=(1,)), quantised(staircase(seed=4, hold=0.5, signs=(-1,)), 4096)]
limits = st.tuples(st.floats(1e-9, 3.0), st.floats(1e-3, 0.999), st.floats(1e-9, 2.0))


@settings(max_examples=6)
@given(st.sampled_from(RECORDS), limits, limits)
def test_loosening_a_threshold_never_rejects(record: Record, one: tuple[float, ...], two: tuple[float, ...]) -> None:
    """What tight thresholds accept, looser ones accept; and each candidate is either accepted or has a reason."""
    least, most = np.minimum(one, two), np.maximum(one, two)
    tight = Thresholds(minimum_duration=most[0], velocity_tolerance=least[1], minimum_velocity=most[2])
    loose = Thresholds(minimum_duration=least[0], velocity_tolerance=most[1], minimum_velocity=least[2])
    before, after = find_segments(record, tight), find_segments(record, loose)
    assert [s.start for s in before] == [s.start for s in after]
    assert all(b.accepted <= a.accepted for b, a in zip(before, after, strict=True))
    assert all(s.accepted == (not s.reasons) for s in (*before, *after))


def motion(velocity: Array, torque: Array | None = None) -> Record:
    """A run with this velocity, its friction and inertia or the torque given, and little noise."""
    time = np.arange(velocity.size) / RATE
    rng = np.random.default_rng(9)
    torque = friction(velocity) + 0.1 * np.gradient(velocity, time) if torque is None else torque
    noisy = velocity + 1e-4 * rng.normal(size=velocity.size)
    return Record(
        file="motion.csv", time=time, velocity=noisy, torque=torque + 1e-3 * rng.normal(size=time.size),
        position=np.cumsum(velocity) / RATE,
    )  # fmt: skip  # a list of values


N = 3000
T = np.arange(N) / RATE


_NOT_CONSTANT: dict[str, tuple[Record, str]] = {
    "triangle": (motion(np.abs(2 * (T / 3 % 1) - 1)), "transient"),
    "sine": (motion(np.sin(2 * np.pi * T)), "transient"),
    "ramp": (motion(np.linspace(0.2, 1, N)), "transient"),
    "drift": (motion(np.linspace(0.6, 1, N)), "accelerating"),
    "rest": (motion(np.zeros(N)), "at-rest"),
    "creep through a reversal": (replace(motion(np.full(N, 0.01)), torque=np.linspace(0.5, -0.4, N)), "unsettled"),
    "a limit cycle that reverses": (motion(0.1 + 0.5 * np.sin(2 * np.pi * 4 * T)), "hunting"),
}


def test_the_message_where_nothing_is_left() -> None:
    """One message says how many candidates each threshold rejected, and what is wrong with the velocity."""
    record = staircase(seed=6, hold=0.5, signs=(1,))
    found = find_segments(record, Thresholds(minimum_velocity=100.0))
    assert not accepted(found)
    wrong = Finding("velocity-factor", CRITICAL, "The position moves 57.3 times as far.")
    message = nothing_left(found, (replace(record, warnings=(wrong,)),))
    assert f"{len(found)} candidates" in message
    assert "at rest or below breakaway: " in message
    assert str(wrong) in message
