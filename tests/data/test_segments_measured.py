"""Constant-velocity segments of measured logs; the folder is named by BRISTLE_DATA."""

import numpy as np
import pytest
from scipy.io import loadmat
from scipy.signal import butter, filtfilt

from bristle.data.constant_velocity.segments import Segment, Thresholds, find_segments
from bristle.data.record import Record

from .experiments import measured


def accepted(record: Record) -> list[Segment]:
    """The segments that count."""
    return [s for s in find_segments(record, Thresholds()) if s.accepted]


def test_kinova_gives_one_point_per_run() -> None:
    """Measured: one accepted segment in each of ten runs, means as seen with the last two thirds; the two slowest stick and slip."""
    seen = [(0.041, 1.52), (0.068, 1.49), (0.113, 1.48), (0.117, 1.43), (0.319, 1.57)]
    seen += [(0.510, 1.72), (0.714, 1.85), (0.918, 2.01), (1.310, 2.31), (1.505, 2.47)]
    files = sorted(measured("kinova_gen3_joint7").glob("velocity_*.csv"))
    points = []
    for file in files:
        rows = np.loadtxt(file)
        rows = rows[np.isfinite(rows).all(axis=1)]
        time, position = np.arange(len(rows)) / 999, np.unwrap(rows[:, 1])
        record = Record(file=file.name, time=time, position=position, velocity=rows[:, 2], torque=7.6 * rows[:, 5])
        points += accepted(record)
    assert [s.velocity for s in points] == pytest.approx([v for v, _ in seen], rel=0.03)
    assert [s.torque for s in points] == pytest.approx([torque for _, torque in seen], rel=0.03)
    assert [s.stick_slip for s in points] == [True] * 2 + [False] * 8


def test_emps_gives_its_three_plateaus_in_both_directions() -> None:
    """Measured: every accepted segment lies at 0.042, 0.083 or 0.125 m/s, each level many times and in both directions."""
    data = loadmat(measured("emps", "DATA_EMPS.mat"))
    time, position = data["t"].ravel(), data["qm"].ravel()
    velocity = np.gradient(filtfilt(*butter(4, 100 / 500), position), time)
    torque = 35.15 * data["vir"].ravel()
    record = Record(file="emps", time=time, position=position, velocity=velocity, torque=torque)
    found = accepted(record)
    levels = np.array([0.042, 0.083, 0.125])
    nearest = np.argmin(np.abs(np.abs([s.velocity for s in found])[:, None] - levels), axis=1)
    assert np.abs([s.velocity for s in found]) == pytest.approx(levels[nearest], rel=0.02)
    counts = {(int(k), s.velocity > 0) for k, s in zip(nearest, found, strict=True)}
    assert len(counts) == 6
    assert 24 <= len(found) <= 40
