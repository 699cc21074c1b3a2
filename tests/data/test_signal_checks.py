from collections import Counter
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import bristle
from bristle.arrays import Array
from bristle.data.constant_velocity.segments import Thresholds, find_segments
from bristle.data.differentiation import estimate_motion
from bristle.data.encoder import count_mismatch
from bristle.data.experiment.schema import RunKind
from bristle.data.experiment.signals import Context, Position, Signals
from bristle.data.record import OTHER_FILES, OTHER_PLACES, Record
from bristle.data.signal_checks import check_signals, merged, travel_ratio
from bristle.data.torque_checks import at_limits, check_torque
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


_FACTORS = {
    180 / np.pi: "`unit: deg/s` under signals.velocity", np.pi / 180: "`unit: deg` under signals.position",
    30 / np.pi: "`unit: rpm` under signals.velocity", 1.2: "`scale` of signals.velocity 0.83", 0.5: "`rate: 250 Hz`",
    -1.0: "opposite sign", -180 / np.pi: "opposite sign",
}  # fmt: skip  # a table


def test_a_velocity_that_is_not_that_of_the_position() -> None:
    """A logged velocity that is off by a factor is critical in every kind of run, fast or slow: the factor to 2 %, and the line that mends it."""
    kinds: tuple[RunKind, ...] = ("tracking", "ramp", "presliding")
    for kind, (factor, line), seed in product(kinds, _FACTORS.items(), range(3)):
        record, _ = moving(seed, "sines" if kind == "tracking" else "ramps")
        (found,) = checked(replace(record, velocity=factor * present(record.velocity)), kind)
        assert (found.code, found.severity) == ("velocity-factor", Severity.CRITICAL)
        assert found.numbers["ratio"] == pytest.approx(1 / factor, rel=0.02)
        assert line in str(found)
        assert "`unit: rad/s`" not in str(found)  # which is what was declared
    # a unit is proposed where it, in place of the declared one and times its scale, makes the two agree
    record, _ = moving(3)
    declared = {"column": 1, "unit": "deg/s", "scale": 2}
    (found,) = checked(replace(record, velocity=present(record.velocity) * np.pi / 180), velocity=declared)
    assert "`unit: rad/s` under signals.velocity" in str(found)
    (found,) = checked(replace(record, time=record.time * 1e-3), cutoff=1e5, time={"column": "t", "unit": "ms"})
    assert "`unit: s` under signals.time" in str(found)
    # a smooth velocity that has nothing to do with the position is critical; noise about a joint at rest is not
    for seed in range(5):
        record, _ = moving(seed)
        (found,) = checked(replace(record, velocity=moving(seed + 100)[0].velocity), "ramp")
        assert found.code in {"velocity-unrelated", "velocity-factor"}
        noise = np.random.default_rng(seed).standard_normal((2, record.time.size))
        assert checked(replace(record, position=1e-4 * noise[0], velocity=1e-2 * noise[1]), "ramp") == ()
    # a velocity that is the position itself goes neither with it nor against it: no factor is said, and nothing divides by zero
    time = np.arange(4000.0) / RATE
    position = np.sin(2 * np.pi * time)
    record = Record(file="run.csv", time=time, position=position, velocity=position, torque=np.cos(time))
    assert [d.code for d in checked(record, "ramp")] == ["velocity-unrelated"]
    # with noise as large as the velocity itself, the truth lies between the two regressions
    for seed in range(20):
        record, v = moving(seed)
        noise = np.std(v) * np.random.default_rng(seed).standard_normal(v.size)
        ratio = present(travel_ratio(replace(record, velocity=2 * v + noise)))
        assert ratio.low < 0.5 < ratio.high < 1.5 * ratio.low


def jumps(record: Record, **more: Any) -> list[Finding]:
    return [d for d in checked(record, "ramp", **more) if d.code == "position-jumps"]


def test_jumps_of_the_position_are_named_by_their_row() -> None:
    """Samples lost in motion under a declared rate are a caution with the row in nearly every record; at rest they cannot be seen."""
    for lost, named in ((4, 0.95), (20, 0.8)):
        hits = 0
        for seed in range(40):
            record, v = moving(seed, ["sines", "trapezia", "ramps"][seed % 3], logged=seed % 2 > 0)
            fast = np.flatnonzero(np.abs(v) > 0.4 * np.abs(v).max())
            at = int(np.random.default_rng(seed).choice(fast[(fast > 100) & (fast < v.size - 150)]))
            keep = np.delete(np.arange(v.size), np.arange(at, at + lost))
            signals = {
                name: x[keep] for name in ("position", "velocity", "torque") if (x := getattr(record, name)) is not None
            }
            hits += any(
                f"row {at + 1} " in str(d) for d in jumps(replace(record, time=record.time[: keep.size], **signals))
            )
        assert hits >= named * 40
    # a slip in motion, either way, is one with the row and its size, whether the time was counted or measured
    for samples, stamped, seed in product((-20.0, -5.0, 5.0, 20.0), (False, True), range(8)):
        record, v = moving(seed, "trapezia")
        steady = np.flatnonzero((np.abs(v) == np.abs(v).max()) & (np.arange(v.size) > 100))
        at = int(next(k for k in steady if (np.abs(v[k - 10 : k + 10]) == np.abs(v[k])).all()))
        slip = samples * v[at] / RATE
        time = record.time + stamped * 0.1 * np.random.default_rng(seed).uniform(-1, 1, v.size) / RATE
        q = np.interp(time, record.time, present(record.position)) + slip * (np.arange(v.size) >= at)
        (found,) = jumps(replace(record, time=time, position=q), **({"time": STAMPED} if stamped else {}))
        assert found.severity is Severity.CAUTION
        assert f"row {at + 1} " in str(found)
        assert found.numbers["size"] == pytest.approx(abs(slip), rel=0.1)
    # a reading that was held and then caught up, and a spike, are none
    record, v = moving(1, "trapezia")
    position = present(record.position)
    fast = int(np.flatnonzero(np.abs(v) > 0.9 * np.abs(v).max())[300])
    spike = np.array([0.0, 0.3 * abs(v[fast]), 0.0, 0.0])
    for change in (np.full(4, position[fast - 1]), position[fast : fast + 4] + spike):
        q = position.copy()
        q[fast : fast + 4] = change
        assert jumps(replace(record, position=q)) == []
    # nor is a coarse encoder whose reading drifts, as where a clock is subtracted, nor steps from rest, stops, and reversals within a sample
    t = np.arange(30_000) / RATE
    q = 2e-6 * np.round(2e-4 * np.sin(2 * np.pi * t / 20) / 2e-6) + 2e-8 * t * RATE
    assert jumps(Record(file="run.csv", time=t, position=q, torque=np.sin(2 * np.pi * t / 20))) == []
    for seed in range(20):
        record, v = moving(seed)
        hard = np.where(np.sin(2 * np.pi * record.time) > 0, np.abs(v).max(), 0.0) * np.sign(np.sin(record.time))
        assert jumps(replace(record, position=np.cumsum(hard) / RATE, velocity=hard)) == []


STAMPED = {"column": "t", "unit": "s"}


def test_clipped_torques_and_plateaus() -> None:
    """A torque cut off where it is largest, with or without the steps of a converter, is a caution that names the share of the samples."""
    for share, levels, seed in product((0.1, 0.4), (None, 400), range(10)):
        record, _ = moving(seed)
        step = np.ptp(present(record.torque)) / (levels or np.inf)
        torque = np.round(present(record.torque) / step) * step if levels else present(record.torque)
        limit = np.sort(np.abs(torque))[int((1 - share) * torque.size)]
        (found,) = checked(replace(record, torque=np.clip(torque, -limit, limit)))
        assert found.code == "clipped-left-out"
        assert found.numbers["share"] == pytest.approx(share, abs=0.03)
        assert checked(replace(record, torque=torque)) == ()
    # a staircase of commanded torque, and a torque that follows from a voltage, are what they are
    record, _ = moving(2)
    n = record.time.size
    stairs = np.concatenate([np.repeat(np.linspace(-1, 1, 9), n // 10), np.linspace(1, 0, n - 9 * (n // 10))])
    assert checked(replace(record, torque=stairs)) == ()
    cut = np.clip(present(record.torque), -0.5, 0.5)
    assert checked(replace(record, torque=cut, voltage=cut)) == ()
    # where every sample of a plateau is at the largest torque the reason says so; with a voltage or a held command it is kept
    t = np.arange(12000) / 1000
    rng = np.random.default_rng(0)
    v = np.repeat([0.2, 0.6, 1.0], 4000) + 1e-3 * rng.standard_normal(t.size)
    torque = 0.8 + 0.8 * v + 0.01 * rng.standard_normal(t.size)
    held = 0.8 + 0.8 * np.concatenate([np.repeat([0.2, 0.6], 4000), np.linspace(0.6, 1, 50), np.full(3950, 1.0)])
    for limit in (1.2, 1.4):
        record = Record(file="ramp.csv", time=t, velocity=v, torque=np.minimum(torque, limit))
        fast = [s for s in find_segments(record, Thresholds()) if s.velocity > 0.9]
        assert max(r.numbers["share"] for s in fast for r in s.reasons if r.code == "saturated") == 1
    for open_loop in (replace(record, torque=held), replace(record, torque=torque, voltage=np.minimum(10 * held, 16))):
        assert any(s.accepted and s.velocity > 0.9 for s in find_segments(open_loop, Thresholds()))


def written(folder: Path, position: str, t: Array, q: Array, torque: Array) -> list[tuple[str, Severity, str]]:
    """The warnings about counts of a log with time, position and torque, where the position is declared as given."""
    write_log(folder, t=t, q=q, tau=torque)
    declared = signals_with(position=yaml.safe_load(f"{{column: q, {position}}}"))
    found = first_record(folder, signals=declared, encoder_resolution="4096 counts/rev").warnings
    return [(d.code, d.severity, str(d)) for d in found if d.code.startswith(("count", "whole"))]


def test_counts_and_units_of_positions(tmp_path: Path) -> None:
    """Positions whose steps are not the declared count: the unit that explains it, bits, rounding, or the factor; none where they agree."""
    t = np.arange(4000) / 1000
    count = 2 * np.pi / 4096
    q, torque = np.round(np.sin(3 * t) * np.exp(-t / 9) / count) * count, np.sin(3 * t) + 0.1 * np.cos(3 * t)
    wanted, found = list[tuple[str, ...]](), list[tuple[str, ...]]()
    for logged, position, *says in (
        (q, "unit: rad"), (np.rad2deg(q), "unit: deg"),
        (np.rad2deg(q), "unit: rad", "count-unit", CRITICAL, "Write `unit: deg`"),
        (q, "unit: deg", "count-unit", CRITICAL, "Write `unit: rad`"),
        (q / (2 * np.pi), "unit: rad", "count-unit", CRITICAL, "Write `unit: rev`"),
        (51 * q, "unit: rad", "count-contradicts", CRITICAL, "51 times"),
        (q / 4, "unit: rad", "count-rounded", CAUTION, "0.25 times"),
        (np.round(q, 2), "unit: rad", "count-rounded", CAUTION, "steps of 0.01 rad"),
    ):  # fmt: skip  # a table
        said = written(tmp_path, position, t, logged, torque)
        wanted.append(tuple(says))
        found.append(
            tuple(x for code, severity, text in said for x in (code, severity, says[-1] if says[-1] in text else text))
        )
    assert found == wanted
    # whole numbers of rad are encoder counts, however they are said to wrap; as counts they are what they are
    log = t, np.round(6 * np.cumsum(np.sin(3 * t))), torque
    for position, whole in (
        ("unit: rad, wraps: true", True),
        ("unit: rev", True),
        ("unit: counts", False),
        ("unit: mrad", False),
    ):
        assert ("whole-positions" in [code for code, *_ in written(tmp_path, position, *log)]) == whole


def test_files_with_one_fault_are_one_warning() -> None:
    """Files alike are named together, a few of many; what is critical comes first; another remedy is another warning."""

    def factor(file: str, ratio: float, remedy: str) -> Finding:
        numbers = {"files": (file,), "ratio": ratio, "remedy": remedy}
        return Finding("velocity-factor", CRITICAL, f"Of {file}{OTHER_FILES}: {ratio:g}.", numbers)

    alike = [factor(f"{k}.csv", 57.0 + k / 10, "x") for k in range(9)]
    lost = [
        Finding("position-jumps", CAUTION, f"Lost: {place}{OTHER_PLACES}.", {"files": (place,)})
        for place in ("a.csv row 5", "b.csv row 9")
    ]
    found = merged([*lost, *alike, factor("z.csv", -1.0, "y")])
    assert found[0].numbers["files"] == ("0.csv", "1.csv", "2.csv", "3.csv", "and 5 more")
    assert [*map(str, found)] == [
        "Of 0.csv, 1.csv, 2.csv, 3.csv, and 5 more: 57.",
        "Of z.csv: -1.",
        "Lost: a.csv row 5; b.csv row 9.",
    ]


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


def kinds(record: Record, kind: RunKind = "tracking") -> list[str]:
    return [d.code for d in check_torque(record, kind)]


def cycles(seed: int, rest: float = 0.0) -> Record:
    """Two slow cycles to 0.85 g0 of a bristle without inertia, dx = dT / (sigma_0 (1 - sgn(dx) T / g0)), after a rest of so many seconds."""
    g0, sigma_0 = 0.7, 1000.0
    t: Array = np.arange(round(32 * RATE)) / RATE
    load = 0.85 * g0 * np.interp(np.maximum(t - rest, 0) % 16, [0, 4, 8, 12, 16], [0, 1, 0, -1, 0])
    dT = np.diff(load, prepend=0.0)
    q = np.cumsum(dT / (sigma_0 * (1 - np.sign(dT) * load / g0)))
    noise = 1e-3 * g0 * np.random.default_rng(seed).standard_normal(t.size)
    return Record(file="slow.csv", time=t, position=q, torque=load + noise)


def table(seed: int, n: int = 20) -> Record:
    """Points of a joint in both directions."""
    v = np.geomspace(0.01, 1.5, n)
    v = np.concatenate([-v[::-1], v])
    (torque,) = evaluate(steady_torque_function(), v, 0.5, 0.2, 0.4, 0.08)
    torque = torque + 0.005 * np.random.default_rng(seed).standard_normal(v.size)
    return Record(file="points.csv", time=np.arange(v.size, dtype=np.float64), velocity=v, torque=torque)


def test_torques_without_a_sign_and_clean_ones() -> None:
    """Of clean runs, slow loading with and without a rest, points and motions, none has a warning."""
    for seed in range(50):
        assert kinds(cycles(seed, rest=seed % 3), "presliding") == []
        assert kinds(table(seed), "points") == []
        assert kinds(moving(seed)[0]) == []
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
        one_way = replace(record, velocity=np.abs(v), torque=np.abs(torque))
        for other in (replace(record, torque=torque), loaded, one_way):
            assert "torque-unsigned" not in kinds(other)


def test_limits_of_points_and_of_slow_loading() -> None:
    """Where most points of a direction have one torque to the last digit it is a limit, however few levels are left."""
    both = {"clipped", "clipped-left-out"}
    for seed, (limit, n, codes) in product(
        range(20), ((0.3, 6, {"clipped"}), (0.5, 6, {"clipped"}), (0.72, 30, both), (0.8, 30, both))
    ):
        record = table(seed, n)
        (found,) = check_torque(replace(record, torque=np.clip(present(record.torque), -limit, limit)), "points")
        assert found.code in codes
        assert found.numbers["limits"] == f"{limit:.4g} and -{limit:.4g}"
    # a torque that stays at its limits while the joint goes on moving is clipped; one that is held there is not
    for limit, seed in product((0.3, 0.5), range(10)):
        record = cycles(seed)
        cut = np.clip(present(record.torque), -limit, limit)
        assert kinds(replace(record, torque=cut), "presliding") == ["clipped"]
        stays = np.maximum.accumulate(np.where(np.abs(cut) < limit, np.arange(cut.size), 0))
        assert kinds(replace(record, torque=cut, position=present(record.position)[stays]), "presliding") == []
    # three points with exactly the largest torque are clipped; of a rounded or noiseless torque none is
    for share, seed in product((0.7, 0.8), range(20)):
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
    t = np.arange(4000) / RATE
    at = np.repeat(np.arange(t.size), np.where(np.arange(t.size) % 800 == 799, 200, 1))
    still = np.diff(at, prepend=-1) == 0
    for width, seed in product((0.1, 0.4), range(10)):
        rng = np.random.default_rng(seed)
        v = np.sin(2 * np.pi * rng.uniform(0.5, 1.5) * t + rng.uniform(0, 6))
        torque = np.tanh(v / 0.1) + 0.3 * v + 0.01 * rng.standard_normal(t.size)
        q = np.cumsum(v) / RATE
        record = Record(file="run.csv", time=t, position=q, velocity=v, torque=torque)
        dead = np.sign(torque) * np.maximum(np.abs(torque) - width, 0)
        (found,) = check_torque(replace(record, torque=dead), "tracking")
        assert found.code == "dead-zone"
        assert found.numbers["share"] == pytest.approx(np.mean(dead == 0))
        assert kinds(record) == []
        v, torque, time = np.where(still, 0.0, v[at]), np.where(still, 0.0, torque[at]), np.arange(at.size) / RATE
        assert kinds(Record(file="run.csv", time=time, position=q[at], velocity=v, torque=torque)) == []
    # a torque of few levels is named with the level and their count, unless its noise is larger than one
    for levels, seed in product((8, 30), range(10)):
        record = moving(seed)[0]
        step = float(np.ptp(present(record.torque))) / levels
        noise = step * np.random.default_rng(seed).standard_normal(record.time.size)
        smooth = np.convolve(present(record.torque), np.ones(25) / 25, "same")
        (found,) = check_torque(replace(record, torque=step * np.round(smooth / step)), "tracking")
        assert found.code == "torque-coarse"
        assert found.numbers["step"] == pytest.approx(step)
        assert found.numbers["levels"] <= levels + 1
        assert kinds(replace(record, torque=step * np.round((smooth + noise) / step))) == []
