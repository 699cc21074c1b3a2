from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

import bristle
from bristle.arrays import Array
from bristle.data.experiment.schema import RunKind
from bristle.data.record import Record
from bristle.data.torque_checks import at_limits, check_torque
from bristle.findings import CRITICAL, Finding, Severity
from bristle.model.functions import steady_torque_function
from bristle.model.parameters import Lugre
from bristle.model.vectorize import evaluate

from .experiments import present
from .test_signal_checks import RATE, checked, moving

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
    # of 200 motions, noisy ones and ones sampled at irregular instants that are logged among them, at most one has a
    # warning
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


@pytest.mark.parametrize("share", [0.03, 0.3])
@pytest.mark.parametrize("rest", [0.0, 2.0])
def test_a_slow_loading_that_does_not_begin_at_zero(share: float, rest: float) -> None:
    """An offset of the load cell is named with its size, whichever its sign."""
    for seed in range(20):
        record = cycles(seed, rest)
        offset = share * float(present(record.torque).max()) * (-1) ** seed
        (found,) = check_torque(replace(record, torque=present(record.torque) + offset), "presliding")
        assert found.code == "loaded-at-start"
        assert found.numbers["torque"] == pytest.approx(offset, abs=1e-3)


@pytest.mark.parametrize("limit", [0.3, 0.5])
def test_a_slow_loading_that_is_clipped(limit: float) -> None:
    """A torque that stays at its limits while the joint goes on moving is clipped; one that is held there is not."""
    for seed in range(20):
        record = cycles(seed)
        cut = np.clip(present(record.torque), -limit, limit)
        assert kinds(replace(record, torque=cut), "presliding") == ["clipped"]
        still = present(record.position)[np.maximum.accumulate(np.where(np.abs(cut) < limit, np.arange(cut.size), 0))]
        assert kinds(replace(record, torque=cut, position=still), "presliding") == []


@pytest.mark.parametrize("share", [0.7, 0.8])
def test_points_at_a_limit_are_those_and_no_others(share: float) -> None:
    """Three points with the largest torque to the last digit are clipped; of a torque that is rounded, or has no noise at all, none is."""
    for seed in range(20):
        torque = present((record := table(seed)).torque)
        limit = share * float(np.abs(torque).max())
        clipped = np.abs(torque) >= limit
        assert 3 <= clipped.sum() < clipped.size / 2
        assert np.array_equal(at_limits(replace(record, torque=np.clip(torque, -limit, limit)), "points"), clipped)
        (exact,) = evaluate(steady_torque_function(), present(record.velocity), 0.5, 0.2, 0.4, 0.08)
        for other in (torque, exact, np.round(torque, 1)):
            assert not at_limits(replace(record, torque=other), "points").any()


@pytest.mark.parametrize("width", [0.1, 0.4])
def test_a_dead_zone(width: float) -> None:
    """A torque that is zero wherever it changes its sign is named with the share of the samples; a command of zero at rest is not."""
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
        at = np.repeat(np.arange(t.size), np.where(np.arange(t.size) % 800 == 799, 200, 1))
        still = np.diff(at, prepend=-1) == 0
        resting = replace(
            record, time=np.arange(at.size) / RATE, position=np.cumsum(v)[at] / RATE,
            velocity=np.where(still, 0.0, v[at]), torque=np.where(still, 0.0, torque[at]),
        )  # fmt: skip  # a list of values
        assert kinds(resting, "tracking") == []


@pytest.mark.parametrize("levels", [8, 30])
def test_a_torque_of_few_levels(levels: int) -> None:
    """A torque that is rounded to a few levels is named with the level and how many there are, unless its noise is larger than one."""
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


@pytest.mark.parametrize("share", [0.5, 2.0])
def test_sampling_that_jitters(share: float) -> None:
    """Instants about the regular ones, which no stamp tells, are seen in the position to 15 %."""
    for seed in range(20):
        record, v = moving(seed, logged=False)
        away = share * np.random.default_rng(seed).uniform(-0.5, 0.5, v.size) / RATE
        (found,) = said(replace(record, position=sampled(record, record.time + away)))
        assert found.code == "sampled-irregularly"
        assert found.severity is Severity.CAUTION
        assert found.numbers["jitter"] == pytest.approx(share / np.sqrt(12), rel=0.15)


@pytest.mark.parametrize("cutoff", [20.0, 3.0])
def test_a_velocity_through_a_filter_lags(cutoff: float) -> None:
    """One pole makes the lag that is said, to 10 % and a sample, and velocity is what to leave out; a delay and a lead alike."""
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
