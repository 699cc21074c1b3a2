"""Samples that are not equally far apart are made so: the joint is where it was, and its friction what it was."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import bristle
from bristle.arrays import Array
from bristle.data.encoder import smallest_step
from bristle.data.record import Record
from bristle.data.sampling import evenly_sampled, jitter
from bristle.data.torque_checks import at_limits
from bristle.identification.measured import measure
from bristle.model.parameters import Lugre
from bristle.model.rollout import rollout
from bristle.questions.joint_report.brief import brief_report

from .experiments import experiment, present, write_log
from .test_motion_checks import sampled
from .test_signal_checks import RATE, moving

TRUTH, INERTIA = Lugre(0.25, 0.08, 0.4, 0.05, 400.0, 1.0), 0.08


def at(record: Record, time: Array) -> Record:
    """What would have been logged at other times."""
    return replace(
        record,
        time=time,
        position=sampled(record, time),
        velocity=None,
        torque=np.interp(time, record.time, present(record.torque)),
    )


def even(record: Record) -> bool:
    """Whether samples are equally far apart in each segment."""
    return all(
        np.ptp(np.diff(part)) < 1e-6 * record.step for part in np.split(record.time, record.starts[1:]) if part.size > 2
    )


def test_even_samples_are_left_as_they_are() -> None:
    """The record itself is returned, and that of what was made even; stamps that are off by a hundredth of a sample are even."""
    record, v = moving(0)
    off = record.time + 0.01 * np.random.default_rng(0).uniform(-1, 1, v.size) / RATE
    assert evenly_sampled(record) is record
    assert evenly_sampled(noisy := replace(record, time=off)) is noisy


@pytest.mark.parametrize("share", [0.02, 0.2, 0.5])
def test_lost_samples_are_where_the_joint_was(share: float) -> None:
    """Rows lost at random are filled to the position that was there, to half a count of the encoder (rms)."""
    for seed in range(5):
        record, v = moving(seed, logged=False)
        kept = np.random.default_rng(seed).random(v.size) >= share
        kept[[0, -1]] = True
        found = evenly_sampled(at(record, record.time[kept]))
        assert even(found)
        assert found.notes[-1].code == "samples-uneven"
        there = np.interp(found.time, record.time, present(record.position))
        assert np.sqrt(np.mean((present(found.position) - there) ** 2)) < 0.5 * smallest_step(present(record.position))


def test_stamps_are_told_from_instants() -> None:
    """Stamps that jitter give way to even ones, instants that do are interpolated: either way hardly any of the jitter is left."""
    for seed in range(20):
        record, v = moving(seed, logged=False)
        away = record.time + 0.5 * np.random.default_rng(seed).uniform(-0.5, 0.5, v.size) / RATE
        for log, code in (
            (replace(record, time=away, velocity=None), "stamps-jitter"),
            (at(record, away), "samples-uneven"),
        ):
            found = evenly_sampled(log)
            assert found.notes[-1].code == code
            assert even(found)
            assert jitter(found, found.time / found.step) < 0.05
    assert jitter(replace(record, time=away), away / record.step) > 0.1


def test_an_encoder_still_counts() -> None:
    """Positions that are whole counts are so afterwards, where rows are missing one by one and in a row."""
    record, v = moving(0, "sines", logged=False)
    count, kept = 2e-3, np.random.default_rng(0).random(v.size) > 0.1
    coarse = replace(record, position=count * np.round(present(record.position) / count), velocity=None)
    lost = replace(
        coarse, time=coarse.time[kept], position=present(coarse.position)[kept], torque=present(coarse.torque)[kept]
    )
    gaps = bursts(coarse, 12)
    for log in (lost, replace(gaps, position=count * np.round(present(gaps.position) / count))):
        found = evenly_sampled(log)
        assert found.time.size > log.time.size
        assert present(found.position) / count == pytest.approx(np.round(present(found.position) / count), abs=1e-6)


@given(
    st.lists(st.floats(0.01, 4.9), min_size=3, max_size=60),
    st.integers(0, 2),
)
def test_any_stamps_that_rise(intervals: list[float], cuts: int) -> None:
    """Whatever the intervals: even, as long, finite, and no further beyond what was read than that reaches."""
    time = np.cumsum([0.0, *intervals])
    starts = tuple(sorted({0, *(time.size * k // (cuts + 1) for k in range(1, cuts + 1))}))
    record = Record(
        file="a", time=time, torque=np.sin(time), velocity=np.cos(time), starts=starts, lines=np.arange(time.size)
    )
    found = evenly_sampled(record)
    assert len(found.starts) <= len(starts)
    assert found is record or even(found)
    assert found.filled is None or found.filled.size == found.time.size
    assert found.time[-1] <= time[-1] + 1e-9 or found.notes[-1].code == "stamps-jitter"
    assert present(found.torque).min() >= present(record.torque).min() - np.ptp(present(record.torque))
    assert present(found.torque).max() <= present(record.torque).max() + np.ptp(present(record.torque))
    assert present(found.lines).size == found.time.size


def bursts(record: Record, longest: int, share: float = 0.2) -> Record:
    """The record without some rows in a row, so many at most, with the gaps that this leaves."""
    rng, kept = np.random.default_rng(0), np.ones(record.time.size, dtype=bool)
    while kept.mean() > 1 - share:
        k = int(rng.integers(50, kept.size - 50 - longest))
        kept[k : k + int(rng.integers(6, longest + 1))] = False
    time = record.time[kept]
    return replace(at(record, time), starts=(0, *(np.flatnonzero(np.diff(time) > 5.5 * record.step) + 1).tolist()))


def test_gaps_that_the_motion_tells_are_bridged() -> None:
    """Bursts of lost rows in a smooth motion: hardly a gap, the position to half of what the joint does in a sample; their torque is marked."""
    for seed in range(5):
        record, v = moving(seed, "sines", logged=False)
        log = bursts(record, 12)
        found = evenly_sampled(log)
        assert len(log.starts) > 20
        assert len(found.starts) <= 3  # but where bursts fell together
        assert even(found)
        assert "gaps-bridged" in {note.code for note in found.notes}
        there = np.interp(found.time, record.time, present(record.position))
        assert np.abs(present(found.position) - there).max() < 0.5 * np.abs(np.diff(present(record.position))).max()
        known = np.isin(np.rint(found.time / record.step), np.rint(log.time / record.step))
        assert not (present(found.filled) & known).any()
        assert present(found.filled).sum() == pytest.approx(v.size - log.time.size, rel=0.2)
        assert at_limits(found)[present(found.filled)].all()


def test_gaps_that_nothing_tells_stay() -> None:
    """A position that goes anywhere meanwhile, a gap that is to stay, and one that is too long, keep their segments."""
    record, v = moving(0, "sines", logged=False)
    walk = replace(record, position=np.cumsum(np.random.default_rng(0).standard_normal(v.size)))
    assert len(evenly_sampled(bursts(walk, 30)).starts) > 10
    log = bursts(record, 12)
    assert len(evenly_sampled(log, log.starts[1:3]).starts) == 3
    kept = np.abs(np.arange(v.size) - v.size // 2) > 150
    long = replace(
        at(record, record.time[kept]), starts=(0, int(np.flatnonzero(np.diff(record.time[kept]) > 0.1)[0]) + 1)
    )
    assert len(evenly_sampled(long).starts) == 2


def test_no_more_are_made_than_can_be_held() -> None:
    """An hour that is declared to be no gap, in a log of microseconds, is not filled."""
    time = np.concatenate([np.arange(500), 3.6e9 + np.arange(500)]) * 1e-6
    record = Record(file="a", time=time, position=np.sin(time), torque=np.cos(time))
    assert evenly_sampled(record) is record


def test_friction_is_what_it_was(tmp_path: Path) -> None:
    """Of a motion of which every second row or so was lost: the curve to 1 %. As written, its samples stay where they are."""
    t = np.arange(0, 12, 0.002)
    w, size, phase = (np.array([x]).T for x in ([0.23, 0.71, 1.3], [0.5, 0.2, 0.05], [1.0, 2.0, 3.0]))
    w = 2 * np.pi * w
    x = w * t + phase
    q, v, a = (size * np.sin(x)).sum(0), (size * w * np.cos(x)).sum(0), -(size * w**2 * np.sin(x)).sum(0)
    rng = np.random.default_rng(0)
    T = rollout(v, 0.002, TRUTH).torque + INERTIA * a + 0.01 * rng.standard_normal(t.size)
    kept = rng.random(t.size) > 0.5
    write_log(tmp_path, t=t[kept], q=q[kept], tau=T[kept])
    keys: dict[str, Any] = {"fit": {"regressors": ["inertia"]}, "simulated": True}
    file = experiment(tmp_path, cleaning={"times": "auto"}, **keys).path
    speeds = np.linspace(0.05, 2.0, 40)
    true = bristle.friction(speeds, TRUTH)
    results = bristle.identify(file)
    found = results.model().friction(speeds)
    assert "interpolated at even times (cleaning.times overrules)" in " ".join(brief_report(results.joints).split())
    assert np.linalg.norm(found - true) < 0.01 * np.linalg.norm(true)
    (run,) = measure(experiment(tmp_path, cleaning={"times": "as-written"}, **keys)).runs
    assert "samples-uneven" not in {note.code for note in run.record.notes}
