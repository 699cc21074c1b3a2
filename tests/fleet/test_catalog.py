import contextlib
import math
import string
from datetime import datetime
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bristle.errors import InputError, check_name
from bristle.questions.fleet import dataset
from bristle.questions.fleet.catalog import CATALOG, CatalogRow, called, read_catalog, time_of
from bristle.questions.fleet.sessions import JointSession, joint_sessions
from bristle.questions.fleet.survey import FleetInput, Surveyed

HEAD = "file,unit,session,joint,type,temperature,load,tags\n"


def rows_of(folder: Path, text: str) -> list[CatalogRow]:
    path = folder / "catalog.csv"
    path.write_text(text, encoding="utf-8")
    return read_catalog(path)


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
        ("a,r1,1970-01-01,,,,,", "expected a year between 2001 and 2200"),
        ("a,r1,2026-01-01,,,warm,,", "temperature: got 'warm'; expected a number, deg C"),
        ("a,r1,2026-01-01,,,-300,,", "temperature: got '-300'"),
        ("a,r1,2026-01-01,,,,1e999,", "load: got '1e999'"),
        ("a,r1,2026-01-01,,,,,x\x07y", "control character"),
        (f"a,{'r' * 500},2026-01-01,,,,,", "unit: got 500 characters"),
    ):
        bad, good = rows_of(tmp_path, f"{HEAD}{row}\nb.yaml,r2,2026-01-01\n")
        shown = all(x.isprintable() and len(x) <= 450 for x in (bad.file, bad.unit, bad.tags, bad.failure))
        wrong += [] if said in bad.failure and shown and (good.unit, good.failure) == ("r2", "") else [(row, bad, good)]
    assert wrong == []
    # by its file, or the last folder before what varies
    assert called("a/fleet.csv") == "fleet"
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
    """Wrong columns, no row, what is no table, or a pattern that tells too little: one sentence that names the catalog and what is wrong."""
    monkeypatch.chdir(tmp_path)
    cases = {
        "": "is not readable as CSV in UTF-8",
        HEAD: "holds no row",
        "file,unit\na,b\n": "has no column session",
        "file,unit,sesion\na,b,c\n": "got the column 'sesion'; did you mean 'session'?",
        "file,unit,session,colour\na,b,c,d\n": "got the column 'colour'; expected file, unit, session, joint",
        "file,unit,session,unit\na,b,c,d\n": "got the column 'unit' twice",
        f"{HEAD}a,r1,2026-01-01,,,,,,,,\n": "Expected 8 fields in line 2, saw 11",
        "logs/{unit}.yaml": "has no column session",
        "logs/{unit}/{sesion}.yaml": "did you mean 'session'?",
        "logs/{unit}/{session}/{file}": "got the column 'file' twice",
        "nowhere/{unit}/{session}.yaml": "matches no file",
        "none.csv": "no such file",
        ".": "is a folder",
        "bytes.csv": "is not readable as CSV in UTF-8",
        "bytes.parquet": "is not readable as Parquet file",
    }
    Path("bytes.csv").write_bytes(b"\xff\xfe\x00")
    Path("bytes.parquet").write_bytes(b"nothing")
    wrong = []
    for text, words in cases.items():
        name = text if text and "\n" not in text else "catalog.csv"
        if name == "catalog.csv":
            Path(name).write_text(text, encoding="utf-8")
        with pytest.raises(InputError) as refused:
            read_catalog(name)
        wrong += [] if words in str(refused.value) and str(refused.value).startswith(f"{name}: ") else [refused.value]
    assert wrong == []


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
    with contextlib.suppress(InputError):
        (row,) = read_catalog(frame)
        assert row.failure or row.session is not None


@given(text=st.one_of(st.datetimes().map(str), st.text(alphabet=string.digits + "-:TZ+W. ", max_size=30)))
def test_no_time_breaks_it(text: str) -> None:
    """A session's text is a time of this or the last century, or an InputError."""
    with contextlib.suppress(InputError):
        assert 2001 <= time_of(text).year <= 2200


def surveyed(path: str, *joints: str, robot: bool = False) -> Surveyed:
    return Surveyed(path, (FleetInput(".", path, (1, 1), f"sha of {path}"),), joints=joints, robot=robot)


def row(path: str, unit: str = "r1", session: str = "2026-01-01", **more: str) -> CatalogRow:
    text = {"joint": "", "type": "", "tags": "", "failure": ""} | more
    nan, time = math.nan, datetime.fromisoformat(session)
    return CatalogRow(path, path, unit, time, text["joint"], text["type"], nan, nan, text["tags"], text["failure"])


def test_which_rows_are_sessions() -> None:
    """All joints of a robot, or the one asked for; a joint that it lacks is a failure. A single joint may be called otherwise."""
    files = {"a": surveyed("a", "j1", "j2", robot=True), "b": surveyed("b", "wrist")}
    rows = [row("a"), row("a", "r2", joint="j2"), row("a", "r3", joint="j9"), row("b", "r4", joint="left")]
    frame = joint_sessions(rows, files)
    assert frame["joint"].tolist() == frame["type"].tolist() == ["j1", "j2", "j2", "j9", "left"]
    assert frame["name"].tolist() == ["j1", "j2", "j2", "j9", "wrist"]
    assert frame["failure"].tolist()[3] == "joint: got 'j9'; the file has j1, j2"
    assert frame["key"].tolist()[1] == frame["key"].tolist()[2] != frame["key"].tolist()[0]
    # two rows of one unit, joint and session are refused together, in one failure that names both; the others stand
    files = {name: surveyed(name, "j") for name in "abc"}
    frame = joint_sessions([row("a"), row("b"), row("c", session="2026-02-01")], files)
    assert frame["file"].tolist() == ["a", "c"]
    said = "2 rows of the catalog are of this joint and session (a, b); name each session once"
    assert frame["failure"].tolist() == [said, ""]


pytest.importorskip("pyarrow", reason="needs the extra fleet")


def results(keys: list[str], rows: int = 3) -> pd.DataFrame:
    """So many rows of each key, as tasks give them; one has an open bound."""
    names, count = [f"p{k}" for k in reversed(range(rows))], len(keys) * rows
    made = {"key": np.repeat(keys, rows), "parameter": names * len(keys), "direction": "+", "severity": "none"}
    frame = pd.DataFrame({**made, "value": np.arange(float(count)), "upper": math.inf})
    return frame.reindex(columns=dataset.OF_TASK).astype(object)


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
    assert frame.loc[0, ["direction", "value", "key", "tags"]].isna().all()
    assert (frame["upper"][1:] == math.inf).all()
    assert frame["tags"].isna().all()
    # whatever order catalog and results come in, the dataset has the same bytes, which pandas reads
    keys = [f"k{k}" for k in range(50)]
    for k, mixed in enumerate((results(keys), results(keys).sample(frac=1, random_state=0))):
        own = sessions([*keys, keys[0]]).sample(frac=1, random_state=k)
        dataset.write_dataset(tmp_path / str(k), dataset.assembled(own, mixed))
    one, other = (tmp_path / str(k) for k in range(2))
    assert (one / dataset.DATASET).read_bytes() == (other / dataset.DATASET).read_bytes()
    assert len(pd.read_parquet(one / "results")) == 153
    # results of a key that sessions share are known once, beside those of the journal, of which a half-written line is none
    (one / "tasks").mkdir()
    dataset.journal(one, [{"key": "new", "parameter": "p", "value": math.inf}])
    with (one / dataset.JOURNAL).open("a") as file:
        file.write('\n[{"key": "k1", "par')
    dataset.journal(one, [{"key": "refused", "failure": "no"}])
    found = dataset.known_results(one, {"k0", "new", "refused"})
    assert found["key"].tolist() == [*3 * ["k0"], "new", "refused"]
    assert found["value"].tolist()[:4] == [2, 1, 0, math.inf]
    # a file of somebody else's, or a damaged one, is refused in a sentence and stays
    path = one / dataset.DATASET
    pd.DataFrame({"a": [1]}).to_parquet(path)
    with pytest.raises(InputError, match="is not part of a fleet's dataset"):
        dataset.read_dataset(one)
    path.write_bytes(b"PAR1")
    with pytest.raises(InputError, match="is damaged"):
        dataset.read_dataset(one)
    path.unlink()
    assert dataset.read_dataset(one).num_rows == 0
