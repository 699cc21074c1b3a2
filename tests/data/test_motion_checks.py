"""Jumps, jitter and a lag put into a simulated motion are named with their size; a clean motion is left alone."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from bristle.arrays import Array
from bristle.data.record import Record
from bristle.findings import Finding, Severity

from .experiments import present
from .test_signal_checks import RATE, checked, moving

MOTION = ("lost-samples", "position-jumps", "sampled-irregularly", "velocity-lags")
STAMPED = {"column": "t", "unit": "s"}


def said(record: Record, stamped: bool = False) -> list[Finding]:
    """What is said of the motion of a moving run."""
    found = checked(record, time=STAMPED) if stamped else checked(record)
    return [d for d in found if d.code in MOTION]


def sampled(record: Record, at: Array) -> Array:
    """The position at other times, (n,), at the resolution of the log."""
    return np.asarray(np.interp(at, record.time, present(record.position)))


def test_clean_motions_are_left_alone() -> None:
    """Of 200 motions, noisy ones and ones sampled at irregular instants that are logged among them, at most one has a warning."""
    found = []
    for seed in range(200):
        record, v = moving(seed, ("sines", "trapezia")[seed % 2])
        rng = np.random.default_rng(seed)
        noise = 10 ** rng.uniform(-5, -2) * np.std(v) * rng.standard_normal(v.size)
        at = record.time + rng.uniform(-0.4, 0.4, v.size) / RATE
        found += said(replace(record, position=present(record.position) + noise * (seed % 4 == 1)))
        found += said(replace(record, time=at, position=sampled(record, at)), stamped=True) if seed % 4 == 0 else []
    assert len(found) <= 1, Counter(d.code for d in found)


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


def test_counts_under_something_that_drifts_are_no_jumps() -> None:
    """A coarse encoder whose reading drifts, as where a clock or a second encoder is subtracted, steps by counts, and does not slip."""
    t = np.arange(30_000) / RATE
    q = 2e-6 * np.round(2e-4 * np.sin(2 * np.pi * t / 20) / 2e-6) + 2e-8 * t * RATE
    record, _ = moving(0, "sines")
    found = said(replace(record, time=t, position=q, velocity=None, torque=np.sin(2 * np.pi * t / 20)))
    assert "position-jumps" not in {d.code for d in found}


def test_a_joint_that_stops_or_starts_does_not_slip() -> None:
    """Steps from rest, stops, and reversals within one sample are motions."""
    for seed in range(20):
        record, v = moving(seed)
        hard = np.where(np.sin(2 * np.pi * record.time) > 0, np.abs(v).max(), 0.0) * np.sign(np.sin(record.time))
        q = np.cumsum(hard) / RATE
        assert not said(replace(record, position=q, velocity=hard))


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
