from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from scipy.signal import lfilter

import bristle
from bristle.arrays import Array
from bristle.data.constant_velocity.segments import Thresholds, find_segments
from bristle.data.differentiation import estimate_motion
from bristle.data.encoder import count_mismatch
from bristle.data.experiment.schema import RunKind
from bristle.data.experiment.signals import Context, Position, Signals
from bristle.data.record import OTHER_FILES, OTHER_PLACES, Record
from bristle.data.signal_checks import check_signals, merged, travel_ratio
from bristle.data.torque_checks import at_limits, check_torque, with_unknown
from bristle.findings import CAUTION, CRITICAL, Finding, Severity
from bristle.model.functions import steady_torque_function
from bristle.model.parameters import Lugre
from bristle.model.vectorize import evaluate

from ..conftest import present
from .experiments import first_record, signals_with, write_log

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
def test_clean_records_are_left_alone() -> None:
    """Of a hundred clean records of each motion, with and without a logged velocity, at most one has any warning."""
    for kind in ("sines", "trapezia", "ramps"):
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
    found = present(travel_ratio(record))
    assert found.low < 1e-3
    assert found.high > 1e3
    assert [d.code for d in checked(record, "ramp")] == ["velocity-unrelated"]
    # with noise as large as the velocity itself, the truth lies between the two regressions
    for seed in range(20):
        record, v = moving(seed)
        noise = np.std(v) * np.random.default_rng(seed).standard_normal(v.size)
        found = present(travel_ratio(replace(record, velocity=2 * v + noise)))
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
    # without a declared count, degrees for rad and rad for degrees are told by a turn of 2**n counts; declared, not
    count = 2 * np.pi / 4096
    turns = np.round(np.sin(np.arange(4000) / 300) / count) * count
    for unit, other, factor in (("rad", "deg", 180 / np.pi), ("deg", "rad", np.pi / 180), ("rad", "rev", 0.5 / np.pi)):
        record = Record(file="run.csv", time=np.arange(4000.0), position=turns * factor)
        found = present(count_mismatch(record, Position(column="q", unit=unit), Context()))
        assert found.code == "counts-of-a-turn"
        assert found.severity is Severity.CAUTION
        assert "4096 with `unit: " + other + "`" in str(found)
    right = Record(file="run.csv", time=np.arange(4000.0), position=turns)
    assert count_mismatch(right, Position(column="q", unit="rad"), Context()) is None


G0, SIGMA_0 = 0.7, 1000.0


def kinds(record: Record, kind: RunKind) -> list[str]:
    return [d.code for d in check_torque(record, kind)]


def cycles(seed: int, rest: float = 0.0) -> Record:
    """Two slow cycles to 0.85 g0 of a bristle without inertia, dx = dT / (sigma_0 (1 - sgn(dx) T / g0)), after a rest of so many seconds."""
    t: Array = np.arange(round(32 * RATE)) / RATE
    load = 0.85 * G0 * np.interp(np.maximum(t - rest, 0) % 16, [0, 4, 8, 12, 16], [0, 1, 0, -1, 0])
    dT = np.diff(load, prepend=0.0)
    q = np.cumsum(dT / (SIGMA_0 * (1 - np.sign(dT) * load / G0)))
    noise = 1e-3 * G0 * np.random.default_rng(seed).standard_normal(t.size)
    return Record(file="slow.csv", time=t, position=q, torque=load + noise)


def table(seed: int, n: int = 20) -> Record:
    """Points of a joint in both directions."""
    v = np.geomspace(0.01, 1.5, n)
    v = np.concatenate([-v[::-1], v])
    (torque,) = evaluate(steady_torque_function(), v, 0.5, 0.2, 0.4, 0.08)
    torque = torque + 0.005 * np.random.default_rng(seed).standard_normal(v.size)
    return Record(file="points.csv", time=np.arange(v.size, dtype=np.float64), velocity=v, torque=torque)


def test_clean_torques_and_motions_are_left_alone() -> None:
    """Of a hundred clean runs each, slow loading with and without a rest, points and motions, none has a warning."""
    for seed in range(100):
        assert kinds(cycles(seed, rest=seed % 3), "presliding") == []
        assert kinds(table(seed), "points") == []
        assert kinds(moving(seed)[0], "tracking") == []
        assert with_unknown(record := moving(seed)[0], "tracking") is record
    # the size of a torque, or that of its opposite, of a joint that goes both ways is critical. The torque itself is not, nor one that a
    # load keeps up, nor the size of that of a joint that goes one way
    for seed in range(20):
        record, v = moving(seed)
        p = Lugre(1.0, 0.3, 0.2 / np.abs(v).max(), 0.05 * np.abs(v).max(), 2e3 / np.abs(v).max(), 0.0)
        torque = bristle.simulate(v, 1 / RATE, p) + 0.01 * np.random.default_rng(seed).standard_normal(v.size)
        for unsigned in (np.abs(torque), -np.abs(torque)):
            (found, *_) = check_torque(replace(record, torque=unsigned), "tracking")
            assert (found.code, found.severity) == ("torque-unsigned", CRITICAL)
        loaded = replace(record, torque=torque + 1.5 * np.abs(torque).max())
        for other in (
            replace(record, torque=torque),
            loaded,
            replace(record, torque=torque + 1.02 * np.abs(torque).max()),
            replace(record, velocity=np.abs(v), torque=np.abs(torque)),
        ):
            assert "torque-unsigned" not in kinds(other, "tracking")
    # where most points of a direction have one torque to the last digit it is a limit, however few levels are left
    for seed in range(20):
        for limit, n, codes in (
            (0.3, 6, {"clipped"}),
            (0.5, 6, {"clipped"}),
            *((x, 30, {"clipped", "clipped-left-out"}) for x in (0.72, 0.8)),
        ):
            record = table(seed, n)
            (found,) = check_torque(replace(record, torque=np.clip(present(record.torque), -limit, limit)), "points")
            assert found.code in codes
            assert found.numbers["limits"] == f"{limit:.4g} and -{limit:.4g}"
    # of 200 motions, noisy or sampled at irregular instants that are logged, at most one has a warning
    left = []
    for seed in range(200):
        record, v = moving(seed, ("sines", "trapezia")[seed % 2])
        rng = np.random.default_rng(seed)
        noise = 10 ** rng.uniform(-5, -2) * np.std(v) * rng.standard_normal(v.size)
        at = record.time + rng.uniform(-0.4, 0.4, v.size) / RATE
        left += said(replace(record, position=present(record.position) + noise * (seed % 4 == 1)))
        left += said(replace(record, time=at, position=sampled(record, at)), stamped=True) if seed % 4 == 0 else []
    assert len(left) <= 1, Counter(d.code for d in left)
    # a coarse encoder whose reading drifts, as where a clock or a second encoder is subtracted, steps by counts, and does not slip
    t = np.arange(30_000) / RATE
    q = 2e-6 * np.round(2e-4 * np.sin(2 * np.pi * t / 20) / 2e-6) + 2e-8 * t * RATE
    record, _ = moving(0, "sines")
    found = said(replace(record, time=t, position=q, velocity=None, torque=np.sin(2 * np.pi * t / 20)))
    assert "position-jumps" not in {d.code for d in found}
    # steps from rest, stops, and reversals within one sample are motions
    for seed in range(20):
        record, v = moving(seed)
        hard = np.where(np.sin(2 * np.pi * record.time) > 0, np.abs(v).max(), 0.0) * np.sign(np.sin(record.time))
        q = np.cumsum(hard) / RATE
        assert not said(replace(record, position=q, velocity=hard))


def test_offsets_and_limits_of_a_torque() -> None:
    """An offset of the load cell is named with its size, whichever its sign."""
    for share in (0.03, 0.3):
        for rest in (0.0, 2.0):
            for seed in range(20):
                record = cycles(seed, rest)
                offset = share * float(present(record.torque).max()) * (-1) ** seed
                (found,) = check_torque(replace(record, torque=present(record.torque) + offset), "presliding")
                assert found.code == "loaded-at-start"
                assert found.numbers["torque"] == pytest.approx(offset, abs=1e-3)
    # a torque that stays at its limits while the joint goes on moving is clipped; one that is held there is not
    for limit in (0.3, 0.5):
        for seed in range(20):
            record = cycles(seed)
            cut = np.clip(present(record.torque), -limit, limit)
            assert kinds(replace(record, torque=cut), "presliding") == ["clipped"]
            still = present(record.position)[
                np.maximum.accumulate(np.where(np.abs(cut) < limit, np.arange(cut.size), 0))
            ]
            assert kinds(replace(record, torque=cut, position=still), "presliding") == []
    # three points with exactly the largest torque are clipped; of a rounded or noiseless torque none is
    for share in (0.7, 0.8):
        for seed in range(20):
            torque = present((record := table(seed)).torque)
            limit = share * float(np.abs(torque).max())
            clipped = np.abs(torque) >= limit
            assert 3 <= clipped.sum() < clipped.size / 2
            assert np.array_equal(at_limits(replace(record, torque=np.clip(torque, -limit, limit)), "points"), clipped)
            (exact,) = evaluate(steady_torque_function(), present(record.velocity), 0.5, 0.2, 0.4, 0.08)
            for other in (torque, exact, np.round(torque, 1)):
                assert not at_limits(replace(record, torque=other), "points").any()


def test_dead_zones_and_levels_of_a_torque() -> None:
    """A torque that is zero wherever it changes its sign is named with the share of the samples; a command of zero at rest is not."""
    for width in (0.1, 0.4):
        t = np.arange(4000) / RATE
        for seed in range(20):
            rng = np.random.default_rng(seed)
            v = np.sin(2 * np.pi * rng.uniform(0.5, 1.5) * t + rng.uniform(0, 6))
            torque = np.tanh(v / 0.1) + 0.3 * v + 0.01 * rng.standard_normal(t.size)
            record = Record(file="run.csv", time=t, position=np.cumsum(v) / RATE, velocity=v, torque=torque)
            dead = np.sign(torque) * np.maximum(np.abs(torque) - width, 0)
            (found,) = check_torque(replace(record, torque=dead), "tracking")
            assert found.code == "dead-zone"
            assert found.numbers["share"] == pytest.approx(np.mean(dead == 0))
            assert kinds(record, "tracking") == []
            # one that takes nothing off beyond it is left out, unless it is as wide as a step between samples
            known = np.abs(torque) >= width
            (found,) = check_torque(replace(record, torque=known * torque), "tracking")
            if width == 0.4:
                assert found.code == "dead-zone-left-out"
                assert np.array_equal(at_limits(replace(record, torque=known * torque)), ~known)
            # holds, which take a few rounded torques far more often than the zone does
            held = replace(record, torque=np.round(1e3 * np.where(np.abs(v) > 0.8, np.sign(v), dead)) / 1e3)
            assert [x.code for x in check_torque(held, "ramp")] == ["dead-zone"]
            at = np.repeat(np.arange(t.size), np.where(np.arange(t.size) % 800 == 799, 200, 1))
            still = np.diff(at, prepend=-1) == 0
            resting = replace(
                record, time=np.arange(at.size) / RATE, position=np.cumsum(v)[at] / RATE,
                velocity=np.where(still, 0.0, v[at]), torque=np.where(still, 0.0, torque[at]),
            )  # fmt: skip  # a list of values
            assert kinds(resting, "tracking") == []
    # a torque of few levels is named with the level and their count, unless its noise is larger than one
    for levels in (8, 30):
        for seed in range(20):
            record = moving(seed)[0]
            step = float(np.ptp(present(record.torque))) / levels
            noise = step * np.random.default_rng(seed).standard_normal(record.time.size)
            smooth = np.convolve(present(record.torque), np.ones(25) / 25, "same")
            (found,) = check_torque(replace(record, torque=step * np.round(smooth / step)), "tracking")
            assert found.code == "torque-coarse"
            assert found.numbers["step"] == pytest.approx(step)
            assert found.numbers["levels"] <= levels + 1
            assert kinds(replace(record, torque=step * np.round((smooth + noise) / step)), "tracking") == []


MOTION = ("lost-samples", "position-jumps", "sampled-irregularly", "velocity-lags")
STAMPED = {"column": "t", "unit": "s"}


def said(record: Record, stamped: bool = False) -> list[Finding]:
    found = checked(record, time=STAMPED) if stamped else checked(record)
    return [d for d in found if d.code in MOTION]


def sampled(record: Record, at: Array) -> Array:
    """The position at other times, (n,), at the resolution of the log."""
    return np.asarray(np.interp(at, record.time, present(record.position)))


@pytest.mark.parametrize("stamped", [False, True])
@pytest.mark.parametrize("samples", [-20.0, -5.0, 5.0, 20.0])
def test_an_encoder_that_slips_is_named_by_its_row(samples: float, stamped: bool) -> None:
    """A slip in motion is a caution with the row: forward under counted time it may be samples that are lost, else it is a jump of its size."""
    for seed in range(20):
        record, v = moving(seed, "trapezia")
        steady = np.flatnonzero((np.abs(v) == np.abs(v).max()) & (np.arange(v.size) > 100))
        at = int(next(k for k in steady if (np.abs(v[k - 10 : k + 10]) == np.abs(v[k])).all()))
        slip = samples * v[at] / RATE
        time = record.time + stamped * 0.1 * np.random.default_rng(seed).uniform(-1, 1, v.size) / RATE
        q = (sampled(record, time) if stamped else present(record.position)) + slip * (np.arange(v.size) >= at)
        (found,) = said(replace(record, time=time, position=q), stamped)
        assert found.severity is Severity.CAUTION
        assert f"row {at + 1} " in str(found)
        assert found.code == ("lost-samples" if samples > 0 and not stamped else "position-jumps")
        if found.code == "position-jumps":
            assert float(found.numbers["files"][0].split(" by ")[-1].split("(by ")[-1].split()[0]) == pytest.approx(
                abs(slip), rel=0.1
            )


def test_jitter_and_lags_are_named_with_their_size() -> None:
    """Instants about the regular ones, which no stamp tells, are seen in the position to 15 %."""
    for share in (0.5, 2.0):
        for seed in range(20):
            record, v = moving(seed, logged=False)
            away = share * np.random.default_rng(seed).uniform(-0.5, 0.5, v.size) / RATE
            (found,) = said(replace(record, position=sampled(record, record.time + away)))
            assert found.code == "sampled-irregularly"
            assert found.severity is Severity.CAUTION
            assert found.numbers["jitter"] == pytest.approx(share / np.sqrt(12), rel=0.15)
    # one pole makes the lag that is said, to 10 % and a sample; velocity is to be left out; a delay and a lead alike
    for cutoff in (20.0, 3.0):
        for seed in range(20):
            record, v = moving(seed)
            a = np.exp(-2 * np.pi * cutoff / RATE)
            slow = lfilter([1 - a], [1, -a], present(record.velocity), zi=[a * present(record.velocity)[0]])[0]
            lag = 1 / (2 * np.pi * cutoff)
            for velocity, word in ((slow, "lags behind"), (np.interp(record.time + lag, record.time, v), "leads")):
                (found,) = said(replace(record, velocity=velocity))
                assert found.code == "velocity-lags"
                assert found.severity is Severity.CAUTION
                assert found.numbers["lag"] == pytest.approx(lag, rel=0.1, abs=1.5 / RATE)
                assert word in str(found)
                assert "Leave `velocity` out" in str(found)
