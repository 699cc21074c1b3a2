from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bristle.arrays import Array
from bristle.data.columns import brought_to
from bristle.data.experiment.load import Experiment, read_runs
from bristle.data.record import Record
from bristle.identification.measured import measure

from ..conftest import present
from ..conftest import run as bristle
from . import experiments
from .experiments import SIGNALS, assert_refused, signals_with, write_log

N = 600
T = np.arange(N) * 1e-3
Q, TAU = np.sin(9 * T), np.cos(9 * T)


def log(folder: Path, name: str = "log.csv", rows: slice = slice(None), **columns: Any) -> None:
    logged = {"t": T, "q": Q, "tau": TAU} | columns
    write_log(folder, name, **{column: x[rows] for column, x in logged.items()})


def experiment(folder: Path, *runs: dict[str, Any], signals: Any = None, **more: Any) -> Experiment:
    """An experiment of runs that are tracking ones unless they say otherwise."""
    entries = [{"files": "log.csv", "experiment": "tracking", **run} for run in runs or ({},)]
    return experiments.experiment(folder, signals=signals_with(**(signals or {})), runs=entries, **more)


def records(folder: Path, *runs: dict[str, Any], **more: Any) -> list[Record]:
    return [x.record for x in read_runs(experiment(folder, *runs, **more))]


# parts of a file


@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(2, N - 20), st.integers(20, N))
def test_a_part_is_its_rows(tmp_path: Path, first: int, length: int) -> None:
    """`rows` takes the lines that it names, both ends included, `time` the same samples by their stamps; both are said, and none is dropped."""
    if not (tmp_path / "log.csv").exists():
        log(tmp_path)
    last = min(first + length - 1, N + 1)
    by_time = {"from": f"{T[first - 2]:.3f} s", "to": f"{1e3 * T[last - 2]:.0f} ms"}
    for part in ({"rows": f"{first}-{last}"}, {"time": by_time}):
        (found,) = records(tmp_path, part)
        assert (found.rows, found.dropped) == (last - first + 1, 0)
        np.testing.assert_array_equal(found.time, T[first - 2 : last - 1])
        np.testing.assert_array_equal(present(found.torque), TAU[first - 2 : last - 1])
        assert found.where(0, found.time.size) == f"lines {first}-{last}"
        assert found.file.startswith("log.csv (")
        assert [n for n in found.notes if n.code == "part-taken"]


def test_parts_of_one_file_are_runs(tmp_path: Path) -> None:
    """Two parts of a file are two runs where they share no row; where they do, or one is the whole, they are refused, held out or not."""
    log(tmp_path, v=np.linspace(-1, 1, N))
    np.savez(tmp_path / "log.npz", t=T, q=Q, tau=TAU)

    def rows(*parts: dict[str, Any], suffix: str = "csv", **more: Any) -> list[int]:
        runs = [{"files": f"log.{suffix}", **part} for part in parts]
        return [x.record.rows for x in measure(experiment(tmp_path, *runs, **more)).runs]

    overlap: list[tuple[list[dict[str, Any]], str]] = [
        ([{"rows": "2-200"}, {"rows": "200-400"}], "is given twice"),
        ([{"rows": "2-200"}, {}], "is given twice"),
        ([{"rows": "2-200"}, {"time": {"from": "0.1 s"}, "hold_out": True}], "is held out and fitted as well"),
    ]
    for suffix in ("csv", "npz"):
        assert rows({"rows": "2-200"}, {"rows": "201-400", "hold_out": True}, suffix=suffix) == [199, 200]
        assert rows({"time": {"to": "0.2 s"}}, {"time": {"from": "0.201 s"}}, suffix=suffix) == [201, N - 201]
        assert_refused((partial(rows, *parts, suffix=suffix), says) for parts, says in overlap)
    signals = {"time": None, "position": None, "velocity": {"column": "v", "unit": "rad/s"}}
    points = [{"rows": part, "experiment": "points"} for part in ("2-100", "101-300", "100-200")]
    assert rows(*points[:2], signals=signals) == [99, 200]
    assert_refused([(partial(rows, *points[::2], signals=signals), "is given twice")])
    # ranges beyond the file, empty or turned round, and lists that are none: one sentence, with which the command ends with 2
    log(tmp_path)
    for part, says in _BAD_PARTS.items():
        assert_refused([(partial(records, tmp_path, yaml.safe_load(part)), says)])
        ran = bristle("inspect", tmp_path / "experiment.yaml")
        assert (part, ran.code, len(ran.said)) == (part, 2, 1)
    # files out of order, that overlap, given twice or of other columns are no run
    for name, span in (("a.csv", slice(0, 300)), ("b.csv", slice(300, N)), ("c.csv", slice(200, N))):
        log(tmp_path, name, span)
    (tmp_path / "other.csv").write_text("x,y\n1,2\n3,4\n")
    says = {
        "b.csv a.csv": r"b\.csv, a\.csv: the second begins before the first ends",
        "a.csv c.csv": "the second begins before the first ends",
        "a.csv a.csv": "files name 'a.csv' twice",
        "a.csv none.csv": r"'none\.csv' is not a file",
        "a.csv other.csv": r"other\.csv: no column named 't'",
    }
    asks = [
        (partial(records, tmp_path, {"files": files.split(), "joined": True}), told) for files, told in says.items()
    ]
    assert_refused(asks)


_BAD_PARTS: dict[str, str] = {
    "{rows: 100-4000}": r"log\.csv: rows: got 100-4000; expected lines between 2 and 601",
    "{rows: 400-100}": "the first row before the last",
    "{rows: -5}": "expected a row",
    "{time: {from: 5 s}}": "no row lies in the part from 5 s of the file",
    "{time: {from: 1 s, to: 1 s}}": "the earlier time first",
    "{time: {from: 1}}": r"runs\.0\.time\.from: got 1; expected a number with its unit",
    "{time: 2 s - 30 s}": r"runs\.0\.time: got '2 s - 30 s'; expected keys with values",
    "{rows: 2-30, time: {to: 1 s}}": "got rows and time; expected one of them",
    "{time: {to: 1 s}, experiment: points}": "points have no time; give rows",
    "{files: []}": r"runs\.0\.files: got \[\]; expected a path or glob",
    "{files: [" + "log.csv," * 2000 + "]}": r"runs\.0\.files: got .* a list of at most 1000",
    "{files: [log.csv, l*.csv]}": "files name 'log.csv' twice",
    "{joined: 'yes'}": r"runs\.0\.joined: got 'yes'",
}


# several files


def test_runs_of_several_files(tmp_path: Path) -> None:
    """Files whose time goes on are one run without a gap; one whose time begins anew follows after a gap, across which nothing is filtered."""
    log(tmp_path, "a.csv", slice(0, 300))
    log(tmp_path, "b.csv", slice(300, N))
    log(tmp_path, "anew.csv", slice(300, N), t=T - T[300])
    (whole,) = records(tmp_path, {"files": ["a.csv", "b.csv"], "joined": True})
    np.testing.assert_allclose(whole.time, T)
    assert (whole.starts, whole.rows, whole.file) == ((0,), N, "a.csv + b.csv")
    (apart,) = records(tmp_path, {"files": ["a.csv", "anew.csv"], "joined": True})
    assert apart.starts == (0, 300)
    np.testing.assert_allclose(np.diff(apart.time[300:]), 1e-3)
    assert len(records(tmp_path, {"files": ["a.csv", "b.csv"]})) == 2
    (cut,) = records(tmp_path, {"files": ["a.csv", "b.csv"], "joined": True, "time": {"from": "0.2 s", "to": "0.4 s"}})
    np.testing.assert_allclose(cut.time, T[200:401])
    stamps = [f"2024-05-01T23:59:59.{700 + k}" if k < 300 else f"2024-05-02T00:00:00.{k - 300:03d}" for k in range(N)]
    for name, rows in (("a.csv", slice(0, 300)), ("b.csv", slice(300, N))):
        log(tmp_path, name, rows, t=np.array(stamps))
    signals = {"time": {"column": "t", "unit": "iso"}}  # dates, over midnight too
    (dated,) = records(tmp_path, {"files": ["a.csv", "b.csv"], "joined": True}, signals=signals)
    np.testing.assert_allclose(dated.time, T, atol=1e-9)
    # a torque of another file, in a unit of time of its own and with fewer samples, is brought to the position; the digest is of both files
    log(tmp_path)
    log(tmp_path, "torque.csv", slice(0, 400, 2), t=1e3 * T)
    torque = SIGNALS["torque"] | {"file": "torque.csv", "time": {"column": "t", "unit": "ms"}}
    (found,) = records(tmp_path, signals={"torque": torque})
    assert (found.rows, found.dropped, found.time.size) == (N, N - 399, 399)
    np.testing.assert_allclose(present(found.torque), TAU[:399], atol=1e-4)
    assert [n.code for n in found.notes].count("own-time") == 1
    (own,) = records(tmp_path)
    assert found.sha256 != own.sha256
    # a second column is added to the first, and no digit of a late date is lost
    log(tmp_path, t=1714557600 + np.arange(N) // 300, ns=np.arange(N) % 300 * 1_000_000 + np.arange(N) // 300 * 0)
    (found,) = records(tmp_path, signals={"time": {"column": "t", "unit": "s", "plus": {"column": "ns", "unit": "ns"}}})
    np.testing.assert_allclose(found.time[:300], T[:300], atol=1e-9)
    np.testing.assert_allclose(found.time[300:], 1 + T[:300], atol=1e-9)


# a time of its own


@given(st.lists(st.floats(0.01, 1), min_size=3, max_size=30), st.floats(-2, 2), st.floats(-2, 2))
def test_a_line_is_a_line_at_any_instants(steps: list[float], slope: float, start: float) -> None:
    """A signal that is a line in time is the same line on any other time, nan beyond its ends; a sample that is missing changes nothing."""
    own = np.cumsum(steps)
    values = start + slope * own
    time = np.linspace(own[0] - 1, own[-1] + 1, 50)
    inside = (time >= own[0]) & (time <= own[-1])
    if np.count_nonzero(inside) == 0:
        return
    spoilt: tuple[Array, Array] = (np.append(own, [np.nan, own[-1]]), np.append(values, [1.0, 7.0]))
    for at, x in ((own, values), spoilt):
        found = brought_to(time, at, x, 1e3)
        np.testing.assert_allclose(found[inside], start + slope * time[inside], atol=1e-9)
        assert np.isnan(found[~inside]).all()


def test_topics_with_rows_of_their_own(tmp_path: Path) -> None:
    """A log whose position and torque stand in different rows is read on the rows of the slower, the other interpolated, and says so."""
    at_q, at_torque = np.arange(N) % 2 == 0, np.arange(N) % 3 == 1
    cells = {"t": T, "q": np.where(at_q & ~at_torque, Q, np.nan), "tau": np.where(at_torque, TAU, np.nan)}
    rows = "".join(
        ",".join("" if np.isnan(x) else repr(float(x)) for x in row) + "\n" for row in zip(*cells.values(), strict=True)
    )
    (tmp_path / "log.csv").write_text("t,q,tau\n" + rows, encoding="utf-8")
    (found,) = records(tmp_path)
    own = np.isfinite(cells["q"])
    assert "own-time" in [note.code for note in found.notes]
    assert found.time.size <= own.sum()
    # a position of the faster topic that wraps is unwrapped before it is interpolated
    wrapped, sparse = np.where(at_q, np.mod(Q, 0.5), np.nan), np.where(np.arange(N) % 14 == 1, TAU, np.nan)
    log(tmp_path, q=wrapped, tau=sparse)
    (turns,) = records(tmp_path, signals={"position": {"column": "q", "unit": "rad", "wraps": "0.5 rad"}})
    inner = slice(2, -2)
    apart = (present(turns.position) - np.interp(turns.time, T, Q))[inner]
    assert np.ptp(apart) < 0.02
    assert present(found.torque) == pytest.approx(np.interp(found.time, T, TAU), abs=0.02 * np.ptp(TAU))


def test_times_that_have_gaps_or_do_not_go_together(tmp_path: Path) -> None:
    """Between two samples far apart there is no value, at the samples themselves there is."""
    own = np.append(np.arange(10.0), 100 + np.arange(10.0))
    found = brought_to(np.array([8.5, 9.0, 50.0, 100.0, 100.5]), own, own, 5.0)
    np.testing.assert_array_equal(found, [8.5, 9.0, np.nan, 100.0, 100.5])
    # a time that is missing, backward, of another unit or hour is one sentence; points have none of their own
    back, one = np.where(np.arange(N) == 300, 0.0, T), np.where(np.arange(N) == 300, 0.3, np.nan)
    log(tmp_path, back=back, late=T + 100, one=one, v=T)
    log(tmp_path, "log2.csv")
    asks = []
    for text, says in _BAD_TIMES.items():
        changes = yaml.safe_load(text)
        signals = {
            k: x and {key: y for key, y in (SIGNALS[k] | x).items() if y is not None} for k, x in changes.items()
        }
        asks.append((partial(records, tmp_path, signals=signals), says))
    pairs = {"velocity": {"column": "v", "unit": "rad/s"}, "torque": SIGNALS["torque"] | {"time": "t"}}
    says = r"points are pairs in rows, without time; leave out signals\.torque\.time"
    asks.append((partial(records, tmp_path, {"experiment": "points"}, signals=pairs), says))
    assert_refused(asks)
    # a unit unlike that of the header is a caution, unless a scale was given
    rows = "".join(f"{t},{q},{tau}\n" for t, q, tau in zip(T, Q, TAU, strict=True))
    (tmp_path / "log.csv").write_text(f"t,q,tau\ns,deg,Nm\n{rows}", encoding="utf-8")
    for unit, scale, differs in (
        ("degree", 1.0, False),
        ("rad", -1.0, True),
        ("rad", 57.3, False),
        ("mdeg", 1.0, True),
    ):
        (found,) = records(tmp_path, signals={"position": {"column": "q", "unit": unit, "scale": scale}})
        warned = [str(w) for w in found.warnings if w.code == "unit-differs"]
        assert ["header of" in warning and "states deg" in warning for warning in warned] == [True] * differs


_BAD_TIMES: dict[str, str] = {
    "torque: {file: x.csv}": "signals.torque: file: a signal of another file needs a time of its own",
    "torque: {file: x.csv, time: t}": "'x.csv' is not a file",
    "torque: {file: '*.csv', time: t}": r"a signal of '\*.csv' goes with one file",
    "torque: {time: {column: t, unit: iso}}": "and unit iso was declared",
    "torque: {time: {column: t, unit: h}}": "has 1 samples in that of the run, .*; check the unit of each",
    "torque: {time: back}": "its own time runs backward in 1 rows",
    "torque: {time: late}": "has 0 samples in that of the run",
    "torque: {time: one}": "1 samples with a time of their own",
    "{time: null, torque: {time: t}}": "no time; give a column",
    "{time: null, position: {time: t}}": "signals.position.time: no unit, and no other time",
    "time: {unit: iso, plus: {column: late, unit: ns}}": "plus: expected it beside a column",
}
