from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from bristle.arrays import Array
from bristle.data.constant_velocity.segments import Thresholds, find_segments
from bristle.data.differentiation import estimate_motion
from bristle.data.encoder import count_mismatch
from bristle.data.experiment.schema import RunKind
from bristle.data.experiment.signals import Context, Position, Signals
from bristle.data.record import OTHER_FILES, OTHER_PLACES, Record
from bristle.data.signal_checks import check_signals, merged, travel_ratio
from bristle.findings import CAUTION, CRITICAL, Finding, Severity
from bristle.model.functions import steady_torque_function
from bristle.model.vectorize import evaluate

from .experiments import first_record, present, signals_with, write_log

RATE = 500.0


def signals(**more: Any) -> Signals:
    """Position, velocity and torque in SI, at a declared rate."""
    given = {
        "time": {"rate": RATE},
        "position": {"column": 0, "unit": "rad"},
        "velocity": {"column": 1, "unit": "rad/s"},
        "torque": {"column": 2, "unit": "N*m"},
    }
    return Signals.model_validate(given | more)


def moving(seed: int, kind: str = "sines", *, logged: bool = True, duration: float = 8.0) -> tuple[Record, Array]:
    """A clean run of a joint with friction (9) and inertia, of any size: an encoder, noise on velocity and torque; and its true velocity."""
    rng = np.random.default_rng(seed)
    t, scale = np.arange(int(duration * RATE)) / RATE, 10 ** rng.uniform(-1, 1.3)
    if kind == "sines":
        f, phase, size = rng.uniform(0.1, 2, 3), rng.uniform(0, 6, 3), rng.uniform(0.3, 1, 3)
        v = scale * sum(a * np.sin(2 * np.pi * w * t + p) for a, w, p in zip(size, f, phase, strict=True)) / 2
    elif kind == "trapezia":
        v = scale * np.clip(3 * np.sin(2 * np.pi * t / rng.uniform(1, 3)), -1, 1)
    else:
        steps = scale * np.geomspace(0.02, 1, 8) * np.tile([1, -1], 4)
        v = np.convolve(np.repeat(steps, t.size // 8), np.ones(51) / 51, "same")
    count, noise = scale * 10 ** rng.uniform(-5, -4), rng.standard_normal((2, t.size))
    q = np.round((np.cumsum(v) / RATE + rng.uniform(0, count)) / count) * count
    (friction,) = evaluate(steady_torque_function(), v, 1.0, rng.uniform(0, 1), 0.5 / scale, 0.1 * scale)
    torque = friction + rng.uniform(0.01, 0.2) / scale * np.gradient(v, 1 / RATE) + 10 ** rng.uniform(-3, -1) * noise[0]
    own = v + scale * 10 ** rng.uniform(-4, -2) * noise[1] if logged else None
    return Record(file="run.csv", time=t, position=q, velocity=own, torque=torque), v


def checked(record: Record, kind: RunKind = "tracking", cutoff: float = 100.0, **more: Any) -> tuple[Finding, ...]:
    given_signals = signals(**more) if record.velocity is not None else signals(velocity=None, **more)
    return check_signals(estimate_motion(record, cutoff), kind, given_signals, Context())


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["sines", "trapezia", "ramps"])
def test_clean_records_are_left_alone(kind: str) -> None:
    """Of a hundred clean records of each motion, with and without a logged velocity, at most one has any warning."""
    found = [
        d
        for seed in range(100)
        for d in checked(moving(seed, kind, logged=seed % 3 > 0)[0], "ramp" if seed % 2 else "tracking")
    ]
    assert len(found) <= 1, Counter(d.code for d in found)


@pytest.mark.parametrize("kind", ["tracking", "ramp", "presliding"])
@pytest.mark.parametrize(
    ("factor", "line"),
    [
        (180 / np.pi, "`unit: deg/s` under signals.velocity"),
        (np.pi / 180, "`unit: deg` under signals.position"),
        (30 / np.pi, "`unit: rpm` under signals.velocity"),
        (1.2, "`scale` of signals.velocity 0.83"),
        (0.5, "`rate: 250 Hz`"),
        (-1.0, "opposite sign"),
        (-180 / np.pi, "opposite sign"),
    ],
)
def test_a_velocity_that_is_not_that_of_the_position(kind: RunKind, factor: float, line: str) -> None:
    """A logged velocity that is off by a factor is critical in every kind of run, fast or slow: the factor to 2 %, and the line that mends it."""
    for seed in range(5):
        record, _ = moving(seed, "sines" if kind == "tracking" else "ramps")
        said = checked(replace(record, velocity=factor * present(record.velocity)), kind)
        (found,) = (d for d in said if d.code != "loaded-at-start")  # which it is, taken for slow loading
        assert found.code == "velocity-factor"
        assert found.severity is Severity.CRITICAL
        assert found.numbers["ratio"] == pytest.approx(1 / factor, rel=0.02)
        assert line in str(found)
        assert "`unit: rad/s`" not in str(found)  # which is what was declared


def test_what_is_named_and_what_is_left_alone() -> None:
    """A unit is proposed where it, in place of the declared one and times its scale, makes the two agree."""
    record, _ = moving(3)
    (found,) = checked(
        replace(record, velocity=present(record.velocity) * np.pi / 180),
        velocity={"column": 1, "unit": "deg/s", "scale": 2},
    )
    assert "`unit: rad/s` under signals.velocity" in str(found)
    slow = replace(record, time=record.time * 1e-3)
    (found,) = checked(slow, cutoff=1e5, time={"column": "t", "unit": "ms"})
    assert found.numbers["ratio"] == pytest.approx(1e3, rel=0.02)
    assert "`unit: s` under signals.time" in str(found)
    # a smooth velocity that has nothing to do with the position is critical; noise about a joint at rest is not
    for seed in range(5):
        record, _ = moving(seed)
        other, _ = moving(seed + 100)
        (found,) = checked(replace(record, velocity=other.velocity), "ramp")
        assert found.code in {"velocity-unrelated", "velocity-factor"}
        noise = np.random.default_rng(seed).standard_normal((2, record.time.size))
        assert checked(replace(record, position=1e-4 * noise[0], velocity=1e-2 * noise[1]), "ramp") == ()
    # a reading that was held and then caught up, a spike, and measured time stamps with a gap say nothing of lost samples
    record, v = moving(1, "trapezia")
    assert record.position is not None
    fast = int(np.flatnonzero(np.abs(v) > 0.9 * np.abs(v).max())[300])
    spike = np.array([0.0, 0.3 * abs(v[fast]), 0.0, 0.0])
    for change in (np.full(4, record.position[fast - 1]), record.position[fast : fast + 4] + spike):
        q = record.position.copy()
        q[fast : fast + 4] = change
        assert not [d for d in checked(replace(record, position=q), "ramp") if d.code == "lost-samples"]
    keep = np.delete(np.arange(v.size), np.arange(fast, fast + 4))
    stamped = Record(file="run.csv", time=record.time[keep], position=record.position[keep], torque=v[keep])
    assert checked(stamped, "ramp", time={"column": "t", "unit": "s"}) == ()
    # a staircase of commanded torque, and a torque that follows from a voltage, are what they are
    record, _ = moving(2)
    n = record.time.size
    stairs = np.concatenate([np.repeat(np.linspace(-1, 1, 9), n // 10), np.linspace(1, 0, n - 9 * (n // 10))])
    assert checked(replace(record, torque=stairs)) == ()
    cut = np.clip(present(record.torque), -0.5, 0.5)
    assert checked(replace(record, torque=cut, voltage=cut)) == ()
    # a velocity that is the position itself goes neither with it nor against it: no factor is said, and nothing divides by zero
    time = np.arange(4000.0) / RATE
    position = np.sin(2 * np.pi * time)
    record = Record(file="run.csv", time=time, position=position, velocity=position, torque=np.cos(time))
    found = travel_ratio(record)
    assert found is not None
    assert found.low < 1e-3
    assert found.high > 1e3
    assert [d.code for d in checked(record, "ramp")] == ["velocity-unrelated"]
    # with noise as large as the velocity itself, the truth lies between the two regressions
    for seed in range(20):
        record, v = moving(seed)
        noise = np.std(v) * np.random.default_rng(seed).standard_normal(v.size)
        found = travel_ratio(replace(record, velocity=2 * v + noise))
        assert found is not None
        assert found.low < 0.5 < found.high
        assert found.high < 1.5 * found.low


@pytest.mark.parametrize(("lost", "named"), [(4, 0.95), (20, 0.8)])
def test_lost_samples_are_named_by_their_row(lost: int, named: float) -> None:
    """Samples lost in motion under a declared rate are a caution with the row, and how many, in nearly every record; at rest they cannot be seen."""
    hits = 0
    for seed in range(60):
        record, v = moving(seed, ["sines", "trapezia", "ramps"][seed % 3], logged=seed % 2 > 0)
        fast = np.flatnonzero(np.abs(v) > 0.4 * np.abs(v).max())
        at = int(np.random.default_rng(seed).choice(fast[(fast > 100) & (fast < v.size - 150)]))
        keep = np.delete(np.arange(v.size), np.arange(at, at + lost))
        parts = {
            name: values[keep]
            for name in ("position", "velocity", "torque")
            if (values := getattr(record, name)) is not None
        }
        found = checked(replace(record, time=record.time[: keep.size], **parts), "ramp")
        hits += any(d.code == "lost-samples" and f"row {at + 1} " in str(d) for d in found)
        assert all(d.code == "lost-samples" and d.severity is Severity.CAUTION for d in found)
    assert hits >= named * 60


@pytest.mark.parametrize("counted", [True, False])
@pytest.mark.parametrize(("held", "every"), [(5, 200), (9, 10)])
def test_a_reading_that_is_not_refreshed(counted: bool, held: int, every: int) -> None:
    """A position held now and then, or read more seldom than logged, is a caution with the samples that it stays; read each time, it is none."""
    for seed in range(20):
        record, v = moving(seed, ["sines", "trapezia"][seed % 2])
        q = present(record.position) if counted else np.cumsum(v) / RATE
        k = np.arange(v.size)
        stays = q[np.maximum.accumulate(np.where((k % every < held) & (k > 0), 0, k))]
        (found,) = [d for d in checked(replace(record, position=stays)) if d.code == "position-held"]
        assert found.severity is Severity.CAUTION
        assert found.numbers["samples"] == pytest.approx(held, abs=1)
        assert not [d for d in checked(replace(record, position=q)) if d.code == "position-held"]


@pytest.mark.parametrize("share", [0.1, 0.4])
@pytest.mark.parametrize("levels", [None, 400])
def test_a_clipped_torque_of_a_moving_run(share: float, levels: int | None) -> None:
    """A torque cut off where it is largest, with or without the steps of a converter, is a caution that names the share of the samples."""
    for seed in range(20):
        record, _ = moving(seed)
        step = np.ptp(present(record.torque)) / (levels or np.inf)
        torque = np.round(present(record.torque) / step) * step if levels else present(record.torque)
        limit = np.sort(np.abs(torque))[int((1 - share) * torque.size)]
        (found,) = checked(replace(record, torque=np.clip(torque, -limit, limit)))
        assert found.code == "clipped-left-out"
        assert found.numbers["share"] == pytest.approx(share, abs=0.03)
        assert checked(replace(record, torque=torque)) == ()


@pytest.mark.parametrize("limit", [1.2, 1.4])
def test_a_plateau_that_is_clipped_in_whole_is_rejected(limit: float) -> None:
    """Every sample of a plateau at the largest torque: the reason says so; with a voltage or a held command it is kept."""
    t = np.arange(12000) / 1000
    rng = np.random.default_rng(0)
    v = np.repeat([0.2, 0.6, 1.0], 4000) + 1e-3 * rng.standard_normal(t.size)
    torque = 0.8 + 0.8 * v + 0.01 * rng.standard_normal(t.size)
    record = Record(file="ramp.csv", time=t, velocity=v, torque=np.minimum(torque, limit))
    cut = [
        r.numbers["share"]
        for s in find_segments(record, Thresholds())
        for r in s.reasons
        if r.code == "saturated" and s.velocity > 0.9
    ]
    assert max(cut) == 1
    held = 0.8 + 0.8 * np.concatenate([np.repeat([0.2, 0.6], 4000), np.linspace(0.6, 1, 50), np.full(3950, 1.0)])
    for open_loop in (replace(record, torque=held), replace(record, torque=torque, voltage=np.minimum(10 * held, 16))):
        assert any(s.accepted and s.velocity > 0.9 for s in find_segments(open_loop, Thresholds()))


def written(folder: Path, position: str, columns: Array) -> tuple[Finding, ...]:
    """The warnings of a log with time, position and torque, where the position is declared as given."""
    write_log(folder, **dict(zip(("t", "q", "tau"), columns.T, strict=True)))
    declared = signals_with(position=yaml.safe_load(f"{{column: q, {position}}}"))
    return first_record(folder, signals=declared, encoder_resolution="4096 counts/rev").warnings


@pytest.mark.parametrize("counts", [3, 600])
def test_counts_given_as_rad_are_critical(tmp_path: Path, counts: float) -> None:
    """Whole numbers of rad, in small and in large steps, are encoder counts, however they are said to wrap; as counts they are what they are."""
    t = np.arange(2000) / 1000
    log = np.column_stack([t, np.round(counts * np.cumsum(np.sin(3 * t)) / 100), np.sin(3 * t) + 0.1 * np.cos(3 * t)])
    for position in ("unit: rad", "unit: rad, wraps: true", "unit: rev"):
        found = written(tmp_path, position, log)
        (whole,) = [d for d in found if d.code == "whole-positions"]
        assert whole.severity is Severity.CRITICAL
        assert "`unit: counts`" in str(whole)
    for position in ("unit: counts", "unit: mrad", "unit: rad, scale: 0.001"):
        assert not [d for d in written(tmp_path, position, log) if d.code == "whole-positions"]


def test_files_with_one_fault_are_one_warning(tmp_path: Path) -> None:
    """Files alike are named together, a few of many; what is critical comes first; another remedy is another warning."""

    def factor(file: str, ratio: float, remedy: str) -> Finding:
        numbers = {"files": (file,), "ratio": ratio, "remedy": remedy}
        return Finding("velocity-factor", CRITICAL, f"Of {file}{OTHER_FILES}: {ratio:g}.", numbers)

    alike = [factor(f"{k}.csv", 57.0 + k / 10, "x") for k in range(9)]
    lost = [
        Finding("lost-samples", CAUTION, f"Lost: {place}{OTHER_PLACES}.", {"files": (place,)})
        for place in ("a.csv row 5", "b.csv row 9")
    ]
    found = merged([*lost, *alike, factor("z.csv", -1.0, "y")])
    assert [d.code for d in found] == ["velocity-factor", "velocity-factor", "lost-samples"]
    assert found[0].numbers["files"] == ("0.csv", "1.csv", "2.csv", "3.csv", "and 5 more")
    assert found[0].numbers["ratio"] == 57.0
    assert [*map(str, found)] == [
        "Of 0.csv, 1.csv, 2.csv, 3.csv, and 5 more: 57.",
        "Of z.csv: -1.",
        "Lost: a.csv row 5; b.csv row 9.",
    ]
    assert str(alike[0]) == "Of 0.csv: 57."
    # positions whose steps are not the declared count: the unit that explains it, bits, rounding, or the factor; none where they agree
    t = np.arange(4000) / 1000
    count = 2 * np.pi / 4096
    q, torque = np.round(np.sin(3 * t) * np.exp(-t / 9) / count) * count, np.sin(3 * t) + 0.1 * np.cos(3 * t)
    cases = (
        (q, "unit: rad", None),
        (np.rad2deg(q), "unit: deg", None),
        (np.rad2deg(q), "unit: rad", ("count-unit", Severity.CRITICAL, "Write `unit: deg` under")),
        (q, "unit: deg", ("count-unit", Severity.CRITICAL, "Write `unit: rad` under")),
        (q / (2 * np.pi), "unit: rad", ("count-unit", Severity.CRITICAL, "Write `unit: rev` under")),
        (1e3 * q, "unit: rad", ("count-unit", Severity.CRITICAL, "Write `unit: mrad` under")),
        (51 * q, "unit: rad", ("count-contradicts", Severity.CRITICAL, "51 times")),
        (q / 4, "unit: rad", ("count-bits", Severity.NOTE, "0.25 times")),
        (np.round(q, 2), "unit: rad", ("count-rounded", Severity.CAUTION, "rounded to steps of 0.01 rad")),
        (np.round(np.rad2deg(q)), "unit: deg", ("whole-degrees", Severity.CAUTION, "`unit: counts`")),
    )
    for logged, position, wanted in cases:
        found = [
            d
            for d in written(tmp_path, position, np.column_stack([t, logged, torque]))
            if d.code.startswith(("count", "whole"))
        ]
        assert [(d.code, d.severity) for d in found] == ([] if wanted is None else [wanted[:2]])
        assert wanted is None or wanted[2] in str(found[0])


def counted(seed: int) -> tuple[Array, float]:
    """A position behind an encoder of any count, moving, resting or creeping, and that count."""
    rng = np.random.default_rng(seed)
    n = int(10 ** rng.uniform(2.3, 4))
    t = np.arange(n) / n
    q = (
        np.sin(rng.uniform(3, 60) * t) + np.sin(rng.uniform(3, 60) * t),
        np.cumsum(np.repeat(rng.uniform(-1, 1, 8), n // 8 + 1)[:n]) / n,
        2e-3 * np.cumsum(rng.standard_normal(n)) / np.sqrt(n),
        np.repeat(rng.uniform(-2, 2, 30), n // 30 + 1)[:n],
    )[seed % 4]
    count = 2 * np.pi / 2 ** int(rng.integers(8, 22)) if rng.integers(2) else 10 ** rng.uniform(-6, -2)
    return np.round((q + rng.uniform(0, count)) / count) * count, count


def test_encoders_are_left_alone() -> None:
    """Of 400 positions behind encoders of any count, in any unit, at most one is said to contradict its encoder or its unit, declared or not."""
    found = []
    for seed in range(400):
        q, count = counted(seed)
        signal = Position(column="q", unit=("rad", "deg", "rev", "mrad")[seed % 3])
        record = Record(file="run.csv", time=np.arange(q.size) / RATE, position=q)
        found += [count_mismatch(record, signal, Context(resolution=r)) for r in (count, None)]
    assert len([d for d in found if d is not None]) <= 1
    # without a declared count, degrees given as rad and rad given as degrees are told by a turn of 2**n counts; so declared, nothing is
    # said
    count = 2 * np.pi / 4096
    turns = np.round(np.sin(np.arange(4000) / 300) / count) * count
    for unit, other, factor in (("rad", "deg", 180 / np.pi), ("deg", "rad", np.pi / 180), ("rad", "rev", 0.5 / np.pi)):
        record = Record(file="run.csv", time=np.arange(4000.0), position=turns * factor)
        found = count_mismatch(record, Position(column="q", unit=unit), Context())
        assert found is not None
        assert found.code == "counts-of-a-turn"
        assert found.severity is Severity.CAUTION
        assert "4096 with `unit: " + other + "`" in str(found)
    right = Record(file="run.csv", time=np.arange(4000.0), position=turns)
    assert count_mismatch(right, Position(column="q", unit="rad"), Context()) is None
