from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import bristle
from bristle.arrays import Array
from bristle.data.differentiation import estimate_motion
from bristle.data.encoder import smallest_step
from bristle.data.record import Record
from bristle.data.run_kinds import Stretches, kinds_of, stretches
from bristle.data.sampling import evenly_sampled, jitter
from bristle.data.torque_checks import at_limits
from bristle.identification.measured import measure
from bristle.model.parameters import Lugre
from bristle.model.rollout import rollout
from bristle.questions.joint_report.brief import brief_report

from ..conftest import present
from .experiments import assert_refused, experiment, write_log
from .test_signal_checks import RATE, moving, sampled

TRUTH, INERTIA = Lugre(0.25, 0.08, 0.4, 0.05, 400.0, 1.0), 0.08


def at(record: Record, time: Array) -> Record:
    return replace(
        record, time=time, position=sampled(record, time), velocity=None,
        torque=np.interp(time, record.time, present(record.torque)),
    )  # fmt: skip  # a list of values


def even(record: Record) -> bool:
    return all(
        np.ptp(np.diff(part)) < 1e-6 * record.step for part in np.split(record.time, record.starts[1:]) if part.size > 2
    )


def test_even_records_and_friction_stay_as_they_are(tmp_path: Path) -> None:
    """The record itself is returned, and that of what was made even; stamps that are off by a hundredth of a sample are even."""
    record, v = moving(0)
    off = record.time + 0.01 * np.random.default_rng(0).uniform(-1, 1, v.size) / RATE
    assert evenly_sampled(record) is record
    assert evenly_sampled(noisy := replace(record, time=off)) is noisy
    # stamps that jitter give way to even ones, instants that do are interpolated: either way hardly any of the jitter is left
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
    # an hour that is declared to be no gap, in a log of microseconds, is not filled
    time = np.concatenate([np.arange(500), 3.6e9 + np.arange(500)]) * 1e-6
    record = Record(file="a", time=time, position=np.sin(time), torque=np.cos(time))
    assert evenly_sampled(record) is record
    # a record keeps what it was given, whatever happens to the caller's array, and cannot be written to
    time = np.array([0.0, 1.0, 2.0])
    record = Record(file="a.csv", time=time, torque=time)
    time[:] = 7.0
    assert present(record.torque).tolist() == record.time.tolist() == [0.0, 1.0, 2.0]
    with pytest.raises(ValueError, match="read-only"):
        record.time[0] = 1.0
    # one long interval does not move the sampling interval; a single sample has none
    assert Record(file="", time=np.array([0.0, 1.0, 2.0, 9.0])).step == 1.0
    assert np.isnan(Record(file="", time=np.array([0.0])).step)
    # time must be one finite, strictly increasing column, and every signal finite and as long
    times: list[Any] = [[], [[0.0, 1.0]], [0.0, 0.0], [1.0, 0.0], [0.0, np.nan]]
    asks = [(partial(Record, file="a.csv", time=np.array(time)), r"^a\.csv: time") for time in times]
    pair = partial(Record, file="a.csv", time=np.array([0.0, 1.0]))
    asks += [(partial(pair, velocity=np.array(v)), r"^a\.csv: velocity") for v in ([1.0], [1.0, np.inf])]
    assert_refused(asks)
    # a motion of which every second row is lost has its curve to 1 %; as written, its samples stay where they are
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
    # bursts of lost rows in a smooth motion: hardly a gap, the position to half of what the joint does in a sample; their torque is marked
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
        assert not (present(found.unknown) & known).any()
        assert present(found.unknown).sum() == pytest.approx(v.size - log.time.size, rel=0.2)
        assert at_limits(found)[present(found.unknown)].all()
    # a position that goes anywhere meanwhile, a gap that is to stay, and one that is too long, keep their segments
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


@given(st.lists(st.floats(0.01, 4.9), min_size=3, max_size=60), st.integers(0, 2))
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
    assert found.unknown is None or found.unknown.size == found.time.size
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


G0, STIFFNESS, J = 0.5, 100.0, 0.05  # N*m, N*m/rad, kg*m**2: the joint bends by 5 mrad, of which a count is a hundredth


def log(rate: float, v: Array, q: Array | None = None, T: Array | None = None, *, velocity: bool = True) -> Record:
    """A motion with Coulomb and viscous friction and an inertia, or with the torque given, with noise and counts."""
    rng, q = np.random.default_rng(0), np.cumsum(v) / rate if q is None else q
    T = G0 * np.tanh(v / 0.003) + 0.2 * v + J * np.gradient(v) * rate if T is None else T
    record = Record(
        file="log.csv",
        time=np.arange(q.size) / rate,
        position=5e-5 * np.round(q / 5e-5),
        torque=T + 0.01 * G0 * rng.standard_normal(q.size),
        velocity=v + 1e-3 * rng.standard_normal(v.size) if velocity else None,
    )
    return record if velocity else estimate_motion(record, 10.0)


def held(rate: float, speeds: Array) -> Array:
    """Each speed back and forth for 2 s, with a rest and a tenth of a second to speed up."""
    rise = np.linspace(0, 1, int(0.1 * rate))
    shape = np.concatenate([rise, np.ones(int(2 * rate)), rise[::-1], np.zeros(int(0.3 * rate))])
    return np.concatenate([sign * v * shape for v in speeds for sign in (1, -1)])


def swung(rate: float, seconds: float) -> Array:
    """The velocity of two sines, rad/s."""
    t = np.arange(int(seconds * rate)) / rate
    return 1.0 * np.sin(2 * np.pi * 0.3 * t) + 0.6 * np.sin(2 * np.pi * 0.8 * t)


def loaded(rate: float, share: float) -> Record:
    """Three slow cycles of torque up to a share of breakaway, with the bristles' own softening."""
    quarter = np.linspace(0, share * G0, int(1.5 * rate))
    T = np.tile(np.concatenate([quarter, quarter[::-1], -quarter, -quarter[::-1]]), 3)
    dT = np.gradient(T)
    q = np.cumsum(dT / (STIFFNESS * (1 - np.sign(dT) * T / G0)))
    return log(rate, np.gradient(q) * rate, q, T)


def kind(record: Record) -> str:
    return kinds_of([(record.file, stretches(record, "revolute"))])[0]


def test_the_kind_of_a_run_is_what_is_done() -> None:
    """At 100 and 1000 Hz, with a logged velocity and without: six speeds held are a ramp run, two sines a tracking one."""
    for rate in (100.0, 1000.0):
        for velocity in (True, False):
            assert kind(log(rate, held(rate, np.geomspace(0.05, 1.5, 6)), velocity=velocity)) == "ramp"
            assert kind(log(rate, swung(rate, 20), velocity=velocity)) == "tracking"
    # cycles of torque below breakaway are slow loading, whole; a small but sliding motion of the same travel is not
    for rate in (100.0, 1000.0):
        record = loaded(rate, 0.8)
        assert kind(record) == "presliding"
        assert stretches(record, "revolute").loaded > 0.8 * record.time[-1]
        small = 0.02 * np.sin(2 * np.pi * np.arange(int(10 * rate)) / rate)
        assert kind(log(rate, small)) == "tracking"


def test_slow_loading_at_any_rate_is_presliding() -> None:
    """Each rise of 0.5 s is one, though at 67 Hz it has 33 or 34 samples, 0.48 or 0.49 s from the first to the last."""
    t = np.arange(670) / 67.0
    T = 0.8 * G0 * np.sin(np.pi * t + 0.03)
    q = np.cumsum(np.gradient(T) / (STIFFNESS * (1 - np.sign(np.gradient(T)) * T / G0)))
    found = stretches(log(67.0, np.gradient(q) * 67.0, q, T, velocity=False), "revolute")
    assert (found.kind, found.moving) == ("presliding", 0.0)
    # of held velocities with two sines after them a ramp run leaves out the sines; a tracking run nothing
    record = log(250.0, np.concatenate([held(250.0, np.geomspace(0.05, 1.5, 6)), swung(250.0, 13)]))
    does = stretches(record, "revolute")
    assert does.kind == "ramp"
    assert does.unused("ramp") == pytest.approx(13 / (13 + 26.4), abs=0.1)
    assert does.unused("tracking") == 0
    assert str(does) == "constant velocity 59%, other motion 41%"
    # a slow cycle of torque that breaks the joint away in each direction is slow loading, wherever the second begins
    rate, quarter = 500.0, np.linspace(0, 0.99 * G0, 5000)
    way = np.cumsum(np.gradient(quarter) / (STIFFNESS * (1 - quarter / G0)))
    slide = np.linspace(0, 1.0, 1500)
    q = np.concatenate([way, way[-1] + slide, way[-1] + 1.0 - way, 0.0 - slide])
    T = np.concatenate([quarter, np.full(1500, 1.05 * G0), -quarter, np.full(1500, -1.05 * G0)])
    assert kind(log(rate, np.gradient(q) * rate, q, T)) == "presliding"
    # a motion of several sines within 23 or 5 mrad, twelve or five times as far as the bristle bends, goes with its direction for half of it
    t = np.arange(0, 30, 2e-3)
    sines = np.sin(2 * np.pi * np.array([[0.3], [0.9], [2.1]]) * t)
    for size, law in ((1.0, Lugre(1.2, 0.5, 0.8, 0.05, 900.0, 6.0)), (0.2, Lugre(1.5, 0.7, 0.55, 0.08, 2500.0, 8.0))):
        q = size * np.minimum(t / 2, 1) ** 3 * (np.array([0.012, 0.004, 0.0015]) @ sines)
        v = np.gradient(q, t)
        T = rollout(v, 2e-3, law).torque + 0.06 * np.gradient(v, t)
        assert kind(log(500.0, v, q, T, velocity=False)) == "tracking"
    # a joint that slides for a moment at each of some speeds takes half a second to turn, and slides all the same
    speeds = np.ravel([(x, -x) for x in np.geomspace(0.008, 0.3, 8)])
    moves = np.concatenate([np.append(np.full(300, x), np.zeros(500)) for x in speeds])
    v = np.convolve(moves, np.full(1000, 1e-3), "valid")
    T = rollout(v, 1e-3, Lugre(0.8, 0.35, 0.6, 0.05, 1000.0, 1.0)).torque
    T = T + 0.01 * np.random.default_rng(0).standard_normal(v.size)
    assert kind(log(1000.0, v, np.cumsum(v) / 1000, T, velocity=False)) == "tracking"
    # slow loading, as of a joint that sticks before each of many speeds, is presliding where hardly anything else is
    # done
    # with a third of the time between its speeds a run is tracking, one log of several too; with a fifth it is a ramp
    speeds = (0.1, 0.2, 0.4, -0.1, -0.2, -0.4)
    assert Stretches(held=5, loaded=26, broken=0, moving=17, total=48, speeds=speeds).kind == "tracking"
    assert Stretches(held=6, loaded=20, broken=0, moving=1, total=27, speeds=(0.3, -0.3)).kind == "presliding"
    few = Stretches(held=10, loaded=0, broken=0, moving=5, total=16, speeds=speeds)
    more = Stretches(held=12, loaded=0, broken=0, moving=3, total=16, speeds=(*speeds, 0.8))
    single = Stretches(held=3, loaded=0, broken=0, moving=1.5, total=5, speeds=(0.1,))
    assert [kinds_of([("a.csv", x)]) for x in (few, more, single)] == [["tracking"], ["ramp"], ["ramp"]]
    assert kinds_of([("a.csv", few), ("b.csv", more)]) == ["tracking", "tracking"]
    # so is one that holds fewer velocities than a curve has numbers, but for a single speed
    two, pair = replace(more, speeds=(0.1, 0.4, -0.1, -0.4)), replace(more, speeds=(0.3, -0.3))
    assert [kinds_of([("a.csv", x)]) for x in (two, pair)] == [["tracking"], ["ramp"]]
    # logs whose names differ in numbers alone are what most of them are: one that sticks and slips does not leave its series
    steady = Stretches(held=9, loaded=0, broken=0, moving=1, total=10, speeds=(0.5,))
    sticks = Stretches(held=0, loaded=0, broken=0, moving=10, total=10)
    logs = [("v_0.01.csv", sticks), ("v_0.1.csv", steady), ("v_0.5.csv", steady), ("swing.csv", sticks)]
    assert kinds_of(logs) == ["ramp", "ramp", "ramp", "tracking"]
    several = Stretches(held=9, loaded=0, broken=0, moving=1, total=10, speeds=(*speeds, 0.8))
    slow = Stretches(held=0, loaded=10, broken=0, moving=0, total=10)
    for of, kinds in (
        ([slow, several, several], ["presliding", "ramp", "ramp"]),
        ([several, several, sticks], ["ramp", "ramp", "tracking"]),
    ):
        assert kinds_of([(f"log{k}.csv", does) for k, does in enumerate(of)]) == kinds
