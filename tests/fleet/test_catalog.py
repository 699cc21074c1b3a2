import contextlib
import math
import re
import string
import time
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bristle.errors import InputError, check_name
from bristle.questions.fleet import dataset
from bristle.questions.fleet.catalog import CATALOG, CatalogRow, called, read_catalog, time_of
from bristle.questions.fleet.files import Stamp
from bristle.questions.fleet.sessions import JointSession, joint_sessions
from bristle.questions.fleet.survey import FleetInput, Surveyed

pytest.importorskip("fsspec", reason="needs the extra fleet")
HEAD = "file,unit,session,joint,type,temperature,load,tags\n"


def rows_of(folder: Path, text: str) -> list[CatalogRow]:
    path = folder / "catalog.csv"
    path.write_text(text, encoding="utf-8")
    return read_catalog(path)


def refusal(folder: Path, text: str) -> str:
    with pytest.raises(InputError) as refused:
        rows_of(folder, text)
    return str(refused.value)


def test_a_catalog_is_read_and_called(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Text, numbers and time of a row; the file lies relative to the catalog's folder, a time with a zone becomes UTC."""
    (row,) = rows_of(tmp_path, HEAD + "a/b.yaml,r1,2026-05-31T14:30+02:00,j1,wrist,21.5,3e1,new grease\n")
    assert row == CatalogRow(
        "a/b.yaml", str(tmp_path / "a/b.yaml"), "r1", datetime(2026, 5, 31, 12, 30), "j1", "wrist", 21.5, 30.0, "new grease", ""
    )  # fmt: skip
    # comma, semicolon or tab: the one that the first line has most of; a mark of UTF-8, blank lines and a row given again count for nothing
    for separator in ",;\t":
        text = "\ufefffile,unit,session\n\na,b.yaml,r1,2026-01-01\na,b.yaml,r1,2026-01-01\n".replace("a,b", "ab")
        (row,) = rows_of(tmp_path, text.replace(",", separator))
        assert (row.file, row.unit, row.failure) == ("ab.yaml", "r1", "")
    # what is wrong in a row is said of that row; the next is read, and nothing that cannot be shown is kept
    wrong = []
    for row, said in (
        (",r1,2026-01-01,,,,,", "file: got nothing"),
        ("a,,2026-01-01,,,,,", "unit: got nothing"),
        ("a,r1,,,,,,", "session: got nothing"),
        ("a,r1,yesterday,,,,,", "session: got 'yesterday'"),
        ("a,r1,0001-01-01T00:00+14:00,,,,,", "session: got"),
        ("a,r1,1066-10-14,,,,,", "expected a year between"),
        ("a,r1,2026-01-01,,,warm,,", "temperature: got 'warm'; expected a number, deg C"),
        ("a,r1,2026-01-01,,,-300,,", "temperature: got -300"),
        ("a,r1,2026-01-01,,,,1e999,", "load: got '1e999'"),
        ("a,r1,2026-01-01,,,,,x\x07y", "control character"),
        (f"a,{'r' * 500},2026-01-01,,,,,", "unit: got 500 characters"),
        ("a,r1,2026-01-01,,,,,,,,", "got 11 fields in line 2; expected 8"),
    ):
        bad, good = rows_of(tmp_path, f"{HEAD}{row}\nb.yaml,r2,2026-01-01\n")
        shown = all(x.isprintable() and len(x) <= 450 for x in (bad.file, bad.unit, bad.tags, bad.failure))
        wrong += [] if said in bad.failure and shown and (good.unit, good.failure) == ("r2", "") else [(row, bad, good)]
    assert wrong == []
    # by its file, or the last folder before what varies
    assert called("a/fleet.csv") == "fleet"
    assert called("s3://bucket/logs/{unit}/{session}.yaml") == "logs"
    assert called(Path("a/b/{unit}_{session}.yaml")) == "b"
    # fields in braces match inside one part of a path, a field that is named twice must agree, `**` stands for folders
    for name in ("2026-01-01/a/r1_wrist.yaml", "2026-01-01/r2_wrist.yaml", "wrist.yaml", "2026-01-02/r1_x.txt"):
        (tmp_path / "logs" / "r1" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "logs" / "r1" / name).touch()
    monkeypatch.chdir(tmp_path)
    (row,) = read_catalog("logs/{unit}/{session}/**/{unit}_{type}.yaml")
    file = "logs/r1/2026-01-01/a/r1_wrist.yaml"
    assert row[:6] == (file, str(tmp_path / file), "r1", datetime(2026, 1, 1), "", "wrist")
    (absolute,) = read_catalog(f"{tmp_path}/logs/{{unit}}/{{session}}/?/*_{{type}}.yaml")
    assert absolute.file == str(tmp_path / row.file)
    # a DataFrame and a Parquet file with dates and numbers give the rows of the same text; what is missing stays so
    pytest.importorskip("pyarrow", reason="needs the extra fleet")
    times = pd.to_datetime(["2026-01-01", "2026-01-02T03:00"], format="ISO8601")
    columns = {"file": ["/a.yaml", "/b.yaml"], "unit": ["r1", "2"], "session": times, "temperature": [21.5, None]}
    frame = pd.DataFrame(columns)
    frame.to_parquet(tmp_path / "c.parquet")
    text = "file,unit,session,temperature\n/a.yaml,r1,2026-01-01,21.5\n/b.yaml,2,2026-01-02T03:00,\n"
    expected = rows_of(tmp_path, text)
    assert str(read_catalog(frame)) == str(read_catalog(tmp_path / "c.parquet")) == str(expected)
    assert math.isnan(expected[1].temperature)


def test_what_is_no_catalog_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Wrong columns, no row, or a pattern that tells too little or matches nothing: one sentence that names the catalog and what is wrong."""
    monkeypatch.chdir(tmp_path)
    named = f"{tmp_path / 'catalog.csv'}: "
    texts = {
        "": "has no column file",
        HEAD: "holds no row",
        "file,unit\na,b\n": "has no column session",
        "file,unit,sesion\na,b,c\n": "got the column 'sesion'; did you mean 'session'?",
        "file,unit,session,colour\na,b,c,d\n": "got the column 'colour'; expected file, unit, session, joint",
        "file,unit,session,unit\na,b,c,d\n": "got the column 'unit' twice",
    }
    said = [(text, refusal(tmp_path, text), words) for text, words in texts.items()]
    assert not [each for each in said if each[2] not in each[1] or not each[1].startswith(named)]
    for pattern, words in (
        ("logs/{unit}.yaml", "has no {session}"),
        ("logs/{unit}/{sesion}.yaml", "did you mean {session}?"),
        ("logs/{unit}/{session}/{file}", "got {file}"),
        ("nowhere/{unit}/{session}.yaml", "matches no file"),
    ):
        with pytest.raises(InputError, match=re.escape(words)):
            read_catalog(pattern)
    # bytes that are no text, a folder, a missing file, and a Parquet file that is none: a sentence each
    pytest.importorskip("pyarrow", reason="needs the extra fleet")
    (tmp_path / "x.csv").write_bytes(b"\xff\xfe\x00")
    (tmp_path / "x.parquet").write_bytes(b"nothing")
    bad = {"x.csv": "not text", "x.parquet": "not a readable Parquet", "none.csv": "No such file", ".": "folder"}
    for name, said in bad.items():
        with pytest.raises(InputError, match=said):
            read_catalog(tmp_path / name)


texts = st.text(alphabet=st.characters(), max_size=30)
tables = st.lists(st.lists(texts, max_size=9), max_size=6)


@given(
    header=st.lists(st.sampled_from([*CATALOG, "x", ""]), max_size=9), table=tables, separator=st.sampled_from(",;\t")
)
@settings(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_no_text_breaks_a_catalog(tmp_path: Path, header: list[str], table: list[list[str]], separator: str) -> None:
    """Whatever a CSV file holds, it is rows that can be shown, or one InputError."""
    lines = [separator.join(line) for line in [header, *table]]
    (tmp_path / "c.csv").write_bytes("\n".join(lines).encode("utf-8", "replace"))
    try:
        rows = read_catalog(tmp_path / "c.csv")
    except InputError:
        return
    assert all(check_name(x, "it") == x for row in rows for x in row if isinstance(x, str))
    assert all(row.failure or (row.file and row.unit and row.session) for row in rows)


CELL = st.one_of(st.none(), st.integers(), st.floats(), st.binary(max_size=5), texts, st.datetimes())


@given(cells=st.tuples(CELL, CELL, CELL, CELL, CELL))
@settings(max_examples=200)
def test_no_cell_breaks_a_frame(cells: tuple[object, ...]) -> None:
    """Whatever the cells of a DataFrame hold, they are a row, or one InputError."""
    names = ("file", "unit", "session", "temperature", "load")
    frame = pd.DataFrame({name: pd.Series([cell], dtype=object) for name, cell in zip(names, cells, strict=True)})
    (row,) = read_catalog(frame)
    assert row.failure or row.session is not None


@given(text=st.one_of(st.datetimes().map(str), st.text(alphabet=string.digits + "-:TZ+W. ", max_size=30)))
def test_no_time_breaks_it(text: str) -> None:
    """A session's text is a time of this or the last century, or an InputError."""
    with contextlib.suppress(InputError):
        assert 1900 <= time_of(text).year <= 2200


def surveyed(path: str, *joints: str, robot: bool = False) -> Surveyed:
    return Surveyed(path, (FleetInput(".", path, Stamp(1, "1"), f"sha of {path}"),), joints=joints, robot=robot)


def row(path: str, unit: str = "r1", session: str = "2026-01-01", **more: str) -> CatalogRow:
    text = {"joint": "", "type": "", "tags": "", "failure": ""} | more
    nan, time = math.nan, datetime.fromisoformat(session)
    return CatalogRow(path, path, unit, time, text["joint"], text["type"], nan, nan, text["tags"], text["failure"])


def test_which_rows_are_sessions() -> None:
    """All joints of a robot, or the one asked for; a joint that it lacks is a failure. A single joint may be called otherwise."""
    files = {"a": surveyed("a", "j1", "j2", robot=True), "b": surveyed("b", "wrist")}
    rows = [row("a"), row("a", "r2", joint="j2"), row("a", "r3", joint="j9"), row("b", "r4", joint="left")]
    frame = joint_sessions(rows, files)
    assert frame["joint"].tolist() == ["j1", "j2", "j2", "j9", "left"]
    assert frame["name"].tolist() == ["j1", "j2", "j2", "", "wrist"]
    assert frame["failure"].tolist()[3] == "joint: got 'j9'; the file has j1, j2"
    assert frame["key"].tolist()[1] == frame["key"].tolist()[2] != frame["key"].tolist()[0]
    assert frame["type"].tolist() == frame["joint"].tolist()
    # two rows of one unit, joint and session are refused together, in one failure that names both; the others stand
    files = {name: surveyed(name, "j") for name in "abc"}
    frame = joint_sessions([row("a"), row("b"), row("c", session="2026-02-01")], files)
    assert frame["file"].tolist() == ["c", "a"]
    said = "2 rows of the catalog are of this joint and session (a, b); name each session once"
    assert frame["failure"].tolist() == ["", said]
    # of a joint of two types the sessions of the rarer one are left out, of two that are as common those of the later one
    files = {"a": surveyed("a", "j")}
    rows = [row("a", session=f"2026-01-0{k}", type=kind) for k, kind in enumerate("abb", 1)]
    frame = joint_sessions([*rows, row("a", "r2", type="b"), row("a", "r2", "2026-01-02", type="a")], files)
    assert [bool(x) for x in frame["left_out"]] == [True, False, False, False, True]
    assert frame["left_out"][0] == "of type 'a', but 'b' in 2 of the 3 sessions of this joint; give it one type"
    # in a catalog in order of time the sessions behind one jump back are left out, as far as they are earlier than those before it
    rows = [*days("r1", 1, 2, 3, 4, 5), *days("r2", 5, 6, 7, 1, 2, 8), *days("r3", 1, 2, 3)]
    frame = joint_sessions(rows, {"a": surveyed("a", "j")})
    assert frame[frame["left_out"] != ""]["session"].dt.day.tolist() == [1, 2]
    said = "its time lies before 2026-01-07 00:00, of a session above it in the catalog; set the clock right"
    assert frame["left_out"][8] == said
    # a catalog that is in no order of time, or the other way round, is only that
    for numbers in ((5, 4, 3, 2, 1), (3, 1, 5, 2, 4), (2, 1), (1, 3, 2)):
        frame = joint_sessions([*days("r1", *numbers), *days("r2", *numbers)], {"a": surveyed("a", "j")})
        assert (frame["left_out"] == "").all(), numbers
    # a session of 1970 among those of a year is left out wherever its row stands; a fleet of old sessions alone is old
    rows = [row("a", "r1", "1970-01-01T00:03"), *days("r1", 1, 2, 3), *days("r2", 1, 2, 3)]
    frame = joint_sessions(rows, {"a": surveyed("a", "j")})
    assert [bool(x) for x in frame["left_out"]] == [True] + 6 * [False]
    assert frame["left_out"][0] == "its time is 1970-01-01 00:03, that of a clock that was reset; set it right"
    old = joint_sessions([row("a", "r1", f"1998-01-0{k}") for k in (1, 2)], {"a": surveyed("a", "j")})
    assert set(old["left_out"]) == {""}


def days(unit: str, *numbers: int) -> list[CatalogRow]:
    return [row("a", unit, f"2026-01-{k:02d}") for k in numbers]


pa = pytest.importorskip("pyarrow", reason="needs the extra fleet")


def results(keys: list[str], rows: int = 3) -> Any:
    """So many rows of each key, as tasks give them; one has an open bound."""
    names = [f"p{k}" for k in reversed(range(rows))]
    made = {name: [None] * len(keys) * rows for name in dataset.OF_TASK} | {
        "key": np.repeat(keys, rows).tolist(), "parameter": names * len(keys), "direction": ["+"] * len(keys) * rows,
        "value": [float(k) for k in range(len(keys) * rows)], "upper": [math.inf] * len(keys) * rows, "severity": ["none"] * len(keys) * rows,
    }  # fmt: skip  # a table
    return pa.table(made, schema=dataset.schema_of(dataset.OF_TASK, coded=False))


def sessions(keys: list[str], failures: dict[int, str] | None = None) -> pd.DataFrame:
    """A joint session of each key, from the last to the first."""
    day, why = pd.Timestamp("2026-01-01"), failures or {}
    units = (f"r{len(keys) - k:06d}" for k in range(len(keys)))
    rows = [
        JointSession(unit, "j", "t", day, math.nan, 2.0, "", f"f{k}", f"/f{k}", "j", key, why.get(k, ""))
        for k, (unit, key) in enumerate(zip(units, keys, strict=True))
    ]
    frame = pd.DataFrame(rows, columns=list(JointSession._fields))
    return frame.assign(session=frame["session"].astype("datetime64[us]"))


def test_rows_and_files_of_a_dataset(tmp_path: Path) -> None:
    """The columns are as documented, the rows sorted; of a failure there is one row, of a key that two sessions share each has its own."""
    table = dataset.assembled(sessions(["a", "b", "a", ""], {3: "no such file"}), results(["a", "b", "c"]))
    frame = table.to_pandas()
    assert tuple(frame.columns) == tuple(dataset.COLUMNS)
    assert frame["unit"].tolist() == ["r000001", *np.repeat(["r000002", "r000003", "r000004"], 3)]
    assert frame["parameter"].tolist()[1:] == 3 * ["p0", "p1", "p2"]
    assert frame["value"].tolist()[1:] == [2, 1, 0, 5, 4, 3, 2, 1, 0]
    assert frame["failure"].tolist()[0] == "no such file"
    assert frame.loc[0, ["direction", "value", "key", "tags", "left_out"]].isna().all()
    assert (frame["upper"][1:] == math.inf).all()
    assert frame["tags"].isna().all()
    assert frame.sort_values(list(dataset.ORDER), kind="stable").index.tolist() == list(range(10))
    # whatever order catalog and results come in, the dataset has the same bytes
    keys = [f"k{k}" for k in range(50)]
    rng = np.random.default_rng(0)
    one = dataset.parquet_of(dataset.assembled(sessions(keys), results(keys)))
    mixed = results(keys).take(rng.permutation(150))
    other = dataset.parquet_of(dataset.assembled(sessions(keys).sample(frac=1, random_state=1), mixed))
    assert one == other
    # the last dataset written is read, also by pandas; results of a key that sessions share are known once
    out, keys = str(tmp_path), [f"k{k}" for k in range(20)]
    for known in (keys, [*keys, "k20"]):
        dataset.write_dataset(out, dataset.assembled(sessions([*known, known[0]]), results(known)))
    assert dataset.read_dataset(out).num_rows == len(pd.read_parquet(tmp_path / "results")) == 66
    found = dataset.known_results(out)
    assert found.num_rows == 63
    assert set(found["key"].to_pylist()) == {*keys, "k20"}
    # a file of somebody else's, or a damaged one, is refused in a sentence and stays; other names are left alone
    other = tmp_path / "other"
    (other / "results").mkdir(parents=True)
    path = other / dataset.DATASET
    pd.DataFrame({"a": [1]}).to_parquet(path)
    pd.DataFrame({"a": [1]}).to_parquet(other / "results" / "mine.parquet")
    with pytest.raises(InputError, match="is not part of a fleet's dataset"):
        dataset.read_dataset(str(other))
    path.write_bytes(b"PAR1")
    with pytest.raises(InputError, match="is damaged"):
        dataset.read_dataset(str(other))
    path.unlink()
    assert dataset.read_dataset(str(other)).num_rows == 0
    # of tasks whose files cannot be read the keys are told, the others are read
    (other / "tasks").mkdir()
    for key in ("a", "b"):
        Path(dataset.task_file(str(other), key)).write_bytes(dataset.task_bytes(key, (), "two\nlines"))
    Path(dataset.task_file(str(other), "b")).write_bytes(b"")
    table, damaged = dataset.read_tasks(str(other), {"a", "b", "c"})
    assert damaged == {"b", "c"}
    assert table["failure"].to_pylist() == ["two lines"]


@pytest.mark.slow
def test_a_hundred_thousand_sessions_are_read_at_once(tmp_path: Path) -> None:
    """1e5 joint sessions, 1e6 rows, are compacted in a minute and read by pandas in 5 s."""
    keys = [f"{k:032x}" for k in range(100_000)]
    begun = time.perf_counter()
    dataset.write_dataset(str(tmp_path), dataset.assembled(sessions(keys), results(keys, 10)))
    wrote = time.perf_counter()
    frame = pd.read_parquet(tmp_path / "results")
    read = time.perf_counter()
    assert len(frame) == 1_000_000
    assert wrote - begun < 60
    assert read - wrote < 5
