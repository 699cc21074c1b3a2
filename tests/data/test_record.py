from functools import partial
from typing import Any

import numpy as np
import pytest

from bristle.data.record import Record

from .experiments import assert_refused, present


def test_copies_and_freezes() -> None:
    """A record keeps what it was given, whatever happens to the caller's array, and cannot be written to."""
    time = np.array([0.0, 1.0, 2.0])
    record = Record(file="a.csv", time=time, torque=time)
    time[:] = 7.0
    assert present(record.torque).tolist() == record.time.tolist() == [0.0, 1.0, 2.0]
    with pytest.raises(ValueError, match="read-only"):
        record.time[0] = 1.0


def test_refuses_what_is_no_time_series() -> None:
    """Time must be one finite, strictly increasing column, and every signal finite and as long."""
    times: list[Any] = [[], [[0.0, 1.0]], [0.0, 0.0], [1.0, 0.0], [0.0, np.nan]]
    asks = [(partial(Record, file="a.csv", time=np.array(time)), r"^a\.csv: time") for time in times]
    pair = partial(Record, file="a.csv", time=np.array([0.0, 1.0]))
    asks += [(partial(pair, velocity=np.array(v)), r"^a\.csv: velocity") for v in ([1.0], [1.0, np.inf])]
    assert_refused(asks)


def test_step_is_the_median_interval() -> None:
    """One long interval does not move the sampling interval; a single sample has none."""
    assert Record(file="", time=np.array([0.0, 1.0, 2.0, 9.0])).step == 1.0
    assert np.isnan(Record(file="", time=np.array([0.0])).step)
