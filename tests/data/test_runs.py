from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bristle.data.experiment.load import read_runs
from bristle.errors import InputError

from ..conftest import present
from ..sameness import of_kind
from .experiments import SIGNALS, assert_refused, experiment, first_record, signals_with, write_log

_T = np.arange(400) * 1e-3


def _log(folder: Path, name: str = "log.csv", **columns: Any) -> Path:
    given_columns = {"t": _T, "q": np.sin(9 * _T), "tau": np.cos(9 * _T), "v": 9 * np.cos(9 * _T)} | columns
    return write_log(folder, name, **given_columns)


def test_runs_in_order_with_variables(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Globs sort by name, several matches are several runs, and no machine path shows, not even with a variable in it."""
    (tmp_path / "logs").mkdir()
    for name in ("v_2.csv", "v_1.csv"):
        _log(tmp_path / "logs", name)
    monkeypatch.setenv("RIG_LOGS", str(tmp_path / "logs"))
    entry = {"experiment": "ramp", "hold_out": True, "temperature": 21, "load": "2 kg"}
    entries = [{"files": "${RIG_LOGS}/v_*.csv", **entry}, {"files": "logs/v_2.csv", "experiment": "tracking"}]
    runs = read_runs(experiment(tmp_path, runs=entries))
    assert [run.record.file for run in runs] == ["${RIG_LOGS}/v_1.csv", "${RIG_LOGS}/v_2.csv", "logs/v_2.csv"]
    assert [run.hold_out for run in runs] == [True, True, False]
    assert runs[0].record.labels == {"temperature": "21", "load": "2 kg"}
    assert len(runs[0].record.sha256) == 64
    monkeypatch.delenv("RIG_LOGS")
    says = {"${RIG_LOGS}/v_1.csv": "RIG_LOGS, which is not set", "x_*.csv": "matches no file", "x.csv": "is not a file"}
    read = {files: experiment(tmp_path, runs=[{"files": files, **entry}]) for files in says}
    assert_refused((partial(read_runs, read[files]), told) for files, told in says.items())


def test_torques_points_and_signals_of_a_run(tmp_path: Path) -> None:
    """Torque, current (k_t i), voltage (8) and a scaled reading of another unit all give the same torque."""
    k_t, resistance = 0.5, 2.0
    tau, v = np.cos(9 * _T), 9 * np.cos(9 * _T)
    _log(tmp_path, i=tau / k_t, u=resistance * tau / k_t + k_t * v)
    velocity, motor = {"column": "v", "unit": "rad/s"}, {"torque_constant": "0.5 N*m/A", "resistance": "2 ohm"}
    for drive in (
        {"torque": {"column": "tau", "unit": "N*m"}},
        {"torque": {"column": "i", "unit": "A", "scale": "0.5 N*m/A"}},
        {"torque": {"column": "tau", "unit": "mNm", "scale": 1000}},
        {"current": {"column": "i", "unit": "A"}},
        {"voltage": {"column": "u", "unit": "V"}},
    ):
        record = first_record(tmp_path, signals={**signals_with(torque=None, velocity=velocity), **drive}, motor=motor)
        np.testing.assert_allclose(present(record.torque), tau, atol=1e-12)
        assert record.acceleration is not None
    flipped = first_record(tmp_path, signals=signals_with(torque={"column": "tau", "unit": "N*m", "scale": -1}))
    np.testing.assert_allclose(present(flipped.torque), -tau)
    # per standard error: s / x of the torque for a scale or for k_t of a current; of a voltage the derivatives of k_t (u - k_t w) / R
    k_t, R = 0.5, 2.0
    tau, v = np.cos(9 * _T), 9 * np.cos(9 * _T)
    u = R * tau / k_t + k_t * v
    _log(tmp_path, i=tau / k_t, u=u)
    velocity = {"column": "v", "unit": "rad/s"}
    motor = {"torque_constant": "0.5 +/- 0.01 N*m/A", "resistance": "2 ± 0.1 ohm"}
    by_k_t, by_R = "torque_constant 0.5 +/- 0.01 N*m/A", "resistance 2 +/- 0.1 ohm"
    by_voltage = {
        by_k_t: 0.01 * (-u - 2 * k_t * v) / R,
        by_R: -0.1 / R * (k_t * (-u - k_t * v) / R),
        "scale of voltage -1 +/- 0.01": 0.01 * k_t * u / R,
    }
    cases: list[tuple[dict[str, Any], dict[str, Any]]] = [
        ({"torque": {"column": "tau", "unit": "N*m"}}, {}),
        ({"torque": {"column": "tau", "unit": "N*m", "scale": "1 +/- 0.02"}}, {"scale of torque 1 +/- 0.02": 0.02 * tau}),
        ({"torque": {"column": "i", "unit": "A", "scale": "0.5 +/- 0.01 N*m/A"}}, {"scale of torque 0.5 +/- 0.01 N*m/A": 0.02 * tau}),
        ({"current": {"column": "i", "unit": "A"}}, {by_k_t: 0.02 * tau}),
        ({"voltage": {"column": "u", "unit": "V", "scale": "-1 +/- 0.01"}}, by_voltage),
    ]  # fmt: skip  # a table
    for drive, expected in cases:
        record = first_record(tmp_path, signals={**signals_with(torque=None, velocity=velocity), **drive}, motor=motor)
        assert list(record.torque_shifts) == list(expected)
        for name, shift in expected.items():
            np.testing.assert_allclose(record.torque_shifts[name], shift, atol=1e-12)
    # points need velocity and torque alone; time counts them, and rows that are not finite are dropped
    (tmp_path / "points.csv").write_text("v,tau\n60,1\nnan,2\n-120,3\n")
    signals = {"velocity": {"column": "v", "unit": "rpm"}, "torque": {"column": "tau", "unit": "N*m"}}
    record = first_record(tmp_path, signals=signals, runs=[{"files": "points.csv", "experiment": "points"}])
    assert record.time.tolist() == [0, 1]
    np.testing.assert_allclose(present(record.velocity), [2 * np.pi, -4 * np.pi])
    assert (record.rows, record.dropped) == (3, 1)
    # a run's own signals replace the experiment's, one by one; a current replaces a torque
    _log(tmp_path, p=np.degrees(np.sin(9 * _T)))
    own = {"position": {"column": "p", "unit": "deg"}, "current": {"column": "tau", "unit": "A"}}
    runs = [{"files": "log.csv", "experiment": "tracking", "signals": own}]
    record = first_record(tmp_path, runs=runs, motor={"torque_constant": "2 N*m/A"})
    np.testing.assert_allclose(present(record.position), np.sin(9 * _T), atol=1e-12)
    np.testing.assert_allclose(present(record.torque), 2 * np.cos(9 * _T), atol=1e-12)


def test_wrapped_positions_are_unwrapped(tmp_path: Path) -> None:
    """A position that wraps at the full turn, in any unit, comes back whole; undeclared it is refused, naming the fix."""
    truth, degrees, counts = 40 * _T, 180 / np.pi, 1000 / (2 * np.pi)
    cases = [("rad", True, 1.0), ("deg", True, degrees), ("deg", "360 deg", degrees), ("counts", True, counts)]
    for unit, wraps, scale in cases:
        _log(tmp_path, q=np.mod(truth, 2 * np.pi) * scale)
        position = {"column": "q", "unit": unit, "wraps": wraps}
        record = first_record(tmp_path, signals=signals_with(position=position), encoder_resolution="1000 counts/rev")
        np.testing.assert_allclose(present(record.position), truth, atol=1e-9)
        (note,) = of_kind(record.notes, "unwrapped")
        assert note.numbers["turns"] == 2
        assert note.numbers["period"] == pytest.approx(2 * np.pi)
        del position["wraps"]
        with pytest.raises(InputError, match="declare wraps: true"):
            first_record(tmp_path, signals=signals_with(position=position), encoder_resolution="1000 counts/rev")
    # repeated and backward stamps, rows that are not finite, and gaps: each dropped or refused as declared, counted and said
    time, tau = np.array(_T), np.cos(9 * _T)
    time[100], tau[50] = time[99], np.nan
    time[200:] += 1.0
    _log(tmp_path, t=time, tau=tau)
    record = first_record(tmp_path)
    assert (record.rows, record.dropped, record.time.size) == (400, 2, 398)
    assert record.starts == (0, 198)
    (gap,) = of_kind(record.notes, "gaps")
    (sampling,) = of_kind(record.notes, "sampling")
    dropped = of_kind(record.notes, "rows-not-finite", "rows-repeated")
    assert [*map(str, dropped)] == [
        "1 row dropped: inf, nan or empty (first: line 52).",
        "1 row dropped: a time stamp repeats (first: line 102).",
    ]
    assert (gap.numbers["gaps"], gap.numbers["longest"]) == (1, pytest.approx(1.001))
    assert sampling.numbers["step"] == pytest.approx(1e-3)
    assert first_record(tmp_path, cleaning={"gap": 2000}).starts == (0,)
    time[300] = 0.0
    _log(tmp_path, t=time)
    with pytest.raises(ValueError, match=r"1 row \(first: line 302\) at which time runs backward"):
        first_record(tmp_path)
    shorter = first_record(tmp_path, cleaning={"backward": "drop"})
    assert shorter.dropped == 2
    (backward,) = of_kind(shorter.notes, "rows-backward")
    assert str(backward) == "1 row dropped: time runs backward (first: line 302)."


def test_delays_velocities_and_useless_data(tmp_path: Path) -> None:
    """A torque logged 2.5 ms late comes back in time with the position, and a note says so; a delay as long as the run is refused."""
    _log(tmp_path, tau=np.cos(9 * (_T - 2.5e-3)))
    torque = SIGNALS["torque"]
    record = first_record(tmp_path, signals=signals_with(torque=torque | {"delay": "2.5 ms"}))
    np.testing.assert_allclose(present(record.torque)[:-3], np.cos(9 * _T)[:-3], atol=2e-5)
    assert "Torque taken 0.0025 s earlier than logged: the declared delay." in map(str, record.notes)
    early = first_record(tmp_path, signals=signals_with(torque=torque | {"delay": "-1 ms"}))
    assert "Torque taken 0.001 s later than logged: the declared delay." in map(str, early.notes)
    np.testing.assert_allclose(present(early.torque)[1:], np.cos(9 * (_T - 3.5e-3))[1:], atol=2e-5)
    with pytest.raises(ValueError, match=r"torque: delay: got 1 s in a run of 0\.399 s"):
        first_record(tmp_path, signals=signals_with(torque=torque | {"delay": "1 s"}))
    # a ramp without velocity has it from its position, by the rate where there is no time, and the notes say so
    q = 0.3 * _T + 1e-3 * np.sin(50 * _T)
    _log(tmp_path, q=q)
    record = first_record(
        tmp_path, signals=signals_with(time={"rate": "1 kHz"}), runs=[{"files": "log.csv", "experiment": "ramp"}]
    )
    assert float(np.median(present(record.velocity))) == pytest.approx(0.3, rel=0.2)
    (derived,) = of_kind(record.notes, "motion-from-position")
    assert derived.numbers["why"].code == "cutoff-of-holds"
    (declared,) = of_kind(record.notes, "rate-declared")
    assert declared.numbers == {"rate": 1000.0}
    # All-NaN, constant and timeless logs, and one sample, are one sentence that opens with the file
    cases: list[tuple[dict[str, Any], str]] = [
        ({"tau": np.full(400, np.nan)}, "torque holds no finite number"),
        ({"q": np.zeros(400)}, "position is 0 .* in all 400 rows"),
        ({"tau": np.ones(400)}, "torque is 1 .* in all 400 rows"),
        ({"v": np.full(400, 2.0)}, "velocity is 2 .* leave velocity out"),
        ({"t": np.zeros(400)}, "only 1 row left"),
        ({"t": -_T}, "time runs backward"),
        ({"t": [0], "q": [1], "tau": [2], "v": [3]}, "only 1 row"),
    ]
    asks, signals = [], signals_with(velocity={"column": "v", "unit": "rad/s"})
    for k, (columns, says) in enumerate(cases):
        _log(tmp_path, f"log_{k}.csv", **columns)
        runs = [{"files": f"log_{k}.csv", "experiment": "tracking"}]
        asks.append((partial(first_record, tmp_path, signals=signals, runs=runs), rf"^log_{k}\.csv: .*{says}"))
    assert_refused(asks)
    # samples of a text file are told by its lines, the header being 1, dropped rows counted; where these are unknown by rows, from 1
    tau = np.cos(9 * _T)
    tau[50] = np.nan
    _log(tmp_path, tau=tau)
    record = first_record(tmp_path)
    assert record.where(0, 10) == "lines 2-11"
    assert record.where(50, 51) == "line 53"
    assert replace(record, lines=None).where(0, 10) == "rows 1-10"
