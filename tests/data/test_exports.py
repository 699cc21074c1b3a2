import contextlib
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bristle.data.columns import Key
from bristle.data.experiment.draft import DraftedRun, Told, draft_experiment
from bristle.data.experiment.load import load_experiment, read_runs
from bristle.data.text_layout import text_layout
from bristle.data.text_table import read_table
from bristle.errors import InputError

from ..conftest import present
from .experiments import assert_refused, refusal

N = 60
T = np.round(np.arange(N) * 1e-3, 6)
Q = np.round(np.degrees(0.4 * np.sin(40 * T)), 5)  # deg
I = np.round(700 * np.cos(40 * T) + 20, 3)  # noqa: E741  # the symbol
"""mA."""


def lines(*formats: str, columns: tuple[Any, ...] = (T, Q, I), between: str = ",", end: str = "\n") -> str:
    rows = zip(*columns, strict=True)
    return "".join(between.join(f.format(x) for f, x in zip(formats, row, strict=True)) + end for row in rows)


def tektronix() -> str:
    """An oscilloscope of now: metadata with numbers, of one cell and of three, then the names."""
    metadata = "Model,MSO54\nFirmware Version,1.28.4\n\nWaveform Type,ANALOG,,\nHorizontal Units,s\nRecord Length,10000\nProbe Attenuation,10,1\n"
    text = f"{metadata}Vertical Units,V,A\nLabel,,\nTIME,CH1,CH2\n{lines('{:.6e}', '{:.6e}', '{:.6e}')}"
    return text.replace("\n", "\r\n")


def tektronix_beside() -> str:
    """An older one: the metadata stand in the left columns, beside the first rows of data."""
    left = [
        "Record Length,2.500000e+03,", "Sample Interval,1.0e-03,", "Trigger Point,1.25e+03,", ",,", "Source,CH1,", "Vertical Units,V,",
    ]  # fmt: skip  # a table
    rows = lines("{:.9f}", "{:.5f}", columns=(T, Q), end=",\n").splitlines()
    return "".join(f"{left[k] if k < len(left) else ',,'},{row}\n" for k, row in enumerate(rows))


def picoscope() -> str:
    """Names, units in brackets, and an empty line."""
    return f"Time,Channel A,Channel B\n(ms),(V),(mA)\n\n{lines('{:.4f}', '{:.6f}', '{:.4f}', columns=(1e3 * T, Q, I))}"


def twincat() -> str:
    """A block of a time and a value for each channel, of which the second has half as many rows."""
    keys = {"Name": ("Axis1.ActPos", "Axis1.ActCurrent"), "SymbolComment": ("", ""), "Data-Type": ("REAL64", "REAL64"), "SampleTime[ms]": ("1", "2"),
            "SymbolBased": ("True", "True"), "Unit": ("deg", "mA"), "ScaleFactor": ("1", "1")}  # fmt: skip  # a table
    block = "".join(f"{key};{a};{key};{b}\n" for key, (a, b) in keys.items())
    half = [f"{2 * k};{I[2 * k]:.3f}" if 2 * k < N else ";" for k in range(N)]
    return (
        f"Name;Scope Project\nFile;C:\\logs\\a.svdx\nStarttime of export;133590240000000000;01.05.2024;12:00:00\n\n{block}"
        + "".join(f"{k};{Q[k]:.5f};{half[k]}\n" for k in range(N))
    )


def siemens() -> str:
    """A trace in quotes, with a byte order mark, dates, decimal commas, and units in brackets below the names."""
    header = '\ufeff"Trace";"Axis_1"\n"Cycle";"1 ms"\n"Timestamp";"actPosition";"actCurrent"\n"";"[°]";"[mA]"\n'
    stamps = [f"01.05.2024 12:00:00,{k:03d}" for k in range(N)]
    return header + "".join(
        f'"{stamp}";"{q:.5f}";"{i:.3f}"\n'.replace(".", ",").replace("01,05,2024", "01.05.2024")
        for stamp, q, i in zip(stamps, Q, I, strict=True)
    )


def labview() -> str:
    """Two headers with tabs, a column of comments that is empty, and a time of day among the metadata."""
    first = (
        "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\n"
        "X_Columns\tOne\nDate\t2024/05/01\nTime\t12:00:00.123456\n***End_of_Header***\t\n\t\n"
    )
    second = "Channels\t2\t\t\nSamples\t60\t60\t\nY_Unit_Label\tdeg\tmA\t\nX0\t0.0E+0\t0.0E+0\t\nDelta_X\t0.001\t0.001\t\n***End_of_Header***\t\t\t\n"
    return f"{first}{second}X_Value\tPosition\tCurrent\tComment\n{lines('{:.6f}', '{:.6f}', '{:.6f}', between=chr(9), end=chr(9) + chr(10))}"


def ros() -> str:
    """No header; seconds and nanoseconds, a frame and names of joints, then positions and efforts."""
    return "".join(f"1714557600,{k * 1_000_000},base,joint_1,joint_2,{Q[k]},{-Q[k]},{I[k]},0.5\n" for k in range(N))


def excel() -> str:
    """As a German Excel saves it: the separator told, names in German, units below, decimal commas."""
    rows = lines("{:.4f}", "{:.5f}", "{:.3f}", between=";").replace(".", ",")
    return f"sep=;\nZeit;Winkel;Strom\ns;Grad;mA\n{rows}".replace("\n", "\r\n")


EXPORTS: dict[str, tuple[Callable[[], str], list[int | str], tuple[str, ...] | None]] = {
    "Tektronix": (tektronix, ["TIME", "CH1", "CH2"], None),
    "Tektronix, beside": (tektronix_beside, [3, 4], None),
    "PicoScope": (picoscope, ["Time", "Channel A", "Channel B"], ("ms", "V", "mA")),
    "TwinCAT": (twincat, [0, "Axis1.ActPos", "Axis1.ActCurrent"], ("", "deg", "", "mA")),
    "Siemens": (siemens, ["Timestamp", "actPosition", "actCurrent"], ("", "°", "mA")),
    "LabVIEW": (labview, ["X_Value", "Position", "Current"], None),
    "ROS 2": (ros, [1, 5, 7], ()),
    "Excel": (excel, ["Zeit", "Winkel", "Strom"], ("s", "Grad", "mA")),
}
"""What writes each, its columns, and the units that its header states, where these are looked at."""
MILLI = {"PicoScope", "TwinCAT"}  # whose time is in ms


@pytest.mark.parametrize("name", EXPORTS)
def test_exports_are_read_as_they_are(tmp_path: Path, name: str) -> None:
    """Every number of every column comes back, from the first row to the last, by the names that the file has or by numbers."""
    # a row of units, in brackets or not, and a block's line of them, are the units of the columns; nothing else is
    write, columns, units = EXPORTS[name]
    path = tmp_path / "log.csv"
    path.write_text(write(), encoding="utf-8", newline="")
    assert units in (None, text_layout(path).units)
    keys = [Key(c, stamps=name == "Siemens" and c == "Timestamp") for c in columns]
    time, *values = (read_table(path, [key]).columns[key] for key in keys)
    by = {**dict.fromkeys(MILLI, 1e-3), "ROS 2": 1e-9}.get(name, 1.0)
    np.testing.assert_allclose(time * by, T, atol=1e-9)
    np.testing.assert_allclose(values[0], Q, atol=1e-4)
    for current in values[1:]:
        if name == "TwinCAT":
            np.testing.assert_allclose(current[: N // 2], I[::2], atol=1e-3)
            assert np.isnan(current[N // 2 :]).all()
        else:
            np.testing.assert_allclose(current, I, atol=2e-3)


@pytest.mark.parametrize(
    ("name", "told", "says"),
    [
        ("Excel", {}, ["position: column \"Winkel\"", "unit of position: Grad, as the file's header states", "unit of current: mA"]),
        ("Siemens", {}, ["unit of time: iso, for column \"Timestamp\" holds dates", "unit of position: °"]),
        ("LabVIEW", {"columns": {"time": "X_Value"}, "units": {"position": "deg", "current": "mA"}}, ["position: column \"Position\""]),
        ("PicoScope", {"columns": {"position": "Channel A", "current": "Channel B"}, "units": {"position": "deg"}},
         ["unit of time: ms", "unit of current: mA"]),
        ("Tektronix", {"columns": {"position": "CH1", "current": "CH2"}, "units": {"position": "deg", "current": "mA"}},
         ["time: column \"TIME\""]),
        ("ROS 2", {"columns": {"position": "5", "current": "7", "time": "1"}, "units": {"position": "deg", "current": "mA", "time": "ns"}}, []),
    ],
)  # fmt: skip  # a table
def test_drafts_of_exports_read(tmp_path: Path, name: str, told: dict[str, Any], says: list[str]) -> None:
    """The draft of an export gives position and torque in SI, with the units that its header states, and says so; what it does not know is told."""
    (tmp_path / "log.csv").write_text(EXPORTS[name][0](), encoding="utf-8", newline="")
    draft = draft_experiment([tmp_path / "log.csv"], Told(torque_constant="0.5 N*m/A", **told), tmp_path)
    (tmp_path / "draft.yaml").write_text(draft.text([DraftedRun("tracking")]), encoding="utf-8")
    record = read_runs(load_experiment(tmp_path / "draft.yaml"))[0].record
    np.testing.assert_allclose(present(record.position), np.radians(Q), atol=1e-6)
    np.testing.assert_allclose(present(record.torque), 0.5e-3 * I, atol=1e-5)
    np.testing.assert_allclose(np.diff(record.time), 1e-3, rtol=1e-6)
    assert all(any(sentence.startswith(words) for sentence in draft.guessed) for words in says)


def test_times_and_columns_of_channels(tmp_path: Path) -> None:
    """TwinCAT's channels, sampled every 1 ms and 2 ms, go together on the time of the position, without one row lost but beyond the last sample."""
    (tmp_path / "log.csv").write_text(twincat(), encoding="utf-8")
    (tmp_path / "e.yaml").write_text(
        "joint: {name: axis}\nmotor: {torque_constant: 0.5 N*m/A}\nsignals:\n"
        "  position: {column: Axis1.ActPos, unit: deg, time: {column: 0, unit: ms}}\n"
        "  current: {column: Axis1.ActCurrent, unit: mA, time: 2}\nruns: [{files: log.csv, experiment: tracking}]\n"
    )
    record = read_runs(load_experiment(tmp_path / "e.yaml"))[0].record
    assert (record.rows, record.dropped) == (N, 1)
    np.testing.assert_allclose(present(record.torque)[::2], 0.5e-3 * I[::2], atol=1e-6)
    np.testing.assert_allclose(present(record.torque), 0.5e-3 * I[:-1], rtol=2e-3)
    # of channels with a block each, one sampled otherwise than the time that is read with it is refused, with the line to add
    (tmp_path / "log.csv").write_text(twincat(), encoding="utf-8")
    with pytest.raises(
        InputError, match=r"column 'Axis1\.ActCurrent' has a time of its own, column 2, .*; add time: 2 to the signal"
    ):
        read_table(tmp_path / "log.csv", [Key(0), Key("Axis1.ActPos"), Key("Axis1.ActCurrent")])
    # by a name in the row of names, or by its number. Comments,
    # decimal commas, rows of units, byte order marks and delimiters at the ends of lines shift no column
    path, found = tmp_path / "log.csv", list[tuple[str, int | str, list[float]]]()
    for content, column, _ in _FOUND:
        path.write_text(content, encoding="utf-8", newline="")
        found.append((content, column, read_table(path, [Key(column)]).columns[Key(column)].tolist()))
    assert found == _FOUND
    # ambiguous names, grouped digits, dates that are none, rows of words, tables very wide, long or empty: one short sentence each, soon
    asks = []
    for k, (content, key, says) in enumerate(_REFUSED):
        path = tmp_path / f"{k}.csv"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        asks.append((partial(read_table, path, [key]), says))
    assert_refused(asks, str(tmp_path))


_FOUND: list[tuple[str, int | str, list[float]]] = [
    ("t,q,q\n0,1,2\n1,3,4\n", 2, [2, 4]),
    ("t,position[0],position[1]\n0,1,2\n1,3,4\n", "position[1]", [2, 4]),
    ('t,q\n0,"[1, 2e-1, 3]"\n1,"[4.5, -5, 6]"\n', "q[1]", [0.2, -5]),  # lists in cells
    ("t;q\n0;(1 2 3)\n1;(4 5 6)\n", "q[2]", [3, 6]),
    (f't,q,image\n0,1,"[{"1, " * 60_000}2]"\n1,3,"[{"1, " * 60_000}2]"\n', "q", [1, 3]),  # cells longer than csv reads
    ("t,q,tau\ntime,joint angle,torque\n0,1,2\n1,3,4\n", "joint angle", [1, 3]),
    ("Range,1,2\nGains,3,4\n1,2,3\nt,q,tau\n0,1,2\n1,3,4\n2,5,6\n", "q", [1, 3, 5]),
    ('t,q\n"0,1","1,5"\n"0,2","2,5"\n', "q", [1.5, 2.5]),
    ("t,q\n2024-05-01 12:00:00,1\n2024-05-01 12:00:01,3\n", "q", [1, 3]),
    ("sep=|\nt|q\n0|1\n1|3\n", "q", [1, 3]),
    ("0\t1\t\n2\t3\t\n", 1, [1, 3]),  # a delimiter at the end of each line
    ("t,q\n0,1,\n2,3,\n", "q", [1, 3]),  # the same, but for the header
    ("\ufefft;q\n0;1\n2;3\n", "t", [0, 2]),  # byte order mark
    ("# t q\n0 1\n2 3\n", "q", [1, 3]),  # NumPy's savetxt
    ("# rig 3\nt,q\n0,1\n# paused\n2,3\n", "q", [1, 3]),
    ("time,pos\ns,rad\n0,1\n2,3\n", "pos", [1, 3]),  # a row of units
    ('"t","q, left"\n0,1\n2,3\n', "q, left", [1, 3]),
    ("\n\nt,q\n\n0,1\n2,3\n", "q", [1, 3]),
    ('t,q"\n0,1\n2,3\n"4",5\n', 0, [0, 2, 4]),  # a quote that is never closed hides no row
    ("// a log\nt,q\n0,1\n1,2\n2,3\n3,4\n", "q", [1, 2, 3, 4]),
]


@pytest.mark.parametrize("name", ["position[1]", "position_1", "position.1"])
def test_an_index_finds_an_array_in_names(tmp_path: Path, name: str) -> None:
    """`index` picks the column that a name spells out, however it does; where two do, or none, it is refused."""
    path = tmp_path / "log.csv"
    path.write_text(f"t,{name},position\n0,1,2\n1,3,4\n", encoding="utf-8")
    assert read_table(path, [Key("position", 1)]).columns[Key("position", 1)].tolist() == [1, 3]
    with pytest.raises(InputError, match="no column named 'position' index 0; there are: t"):
        read_table(path, [Key("position", 0)])
    path.write_text(
        f"t,{name},position(1),position[1]_,position_1 ,position[1]\n0,1,2,3,4,5\n1,1,2,3,4,5\n", encoding="utf-8"
    )
    with pytest.raises(InputError, match="several columns named 'position' index 1"):
        read_table(path, [Key("position", 1)])


_REFUSED: list[tuple[str | bytes, Key, str]] = [
    ("t,q,q\n0,1,2\n1,3,4\n", Key("q"), "several columns named 'q', columns 1, 2, counted from 0; write a number, as in column: 2"),
    ("t,q,q\n0,1,2\n1,3,4\n", Key(1, 0), "no column 1 index 0; an index needs the name of an array"),
    ('t,q\n0,"[1, 2]"\n1,"[3, 4]"\n', Key("q"), r"column 'q' holds lists, as '\[1, 2\]'; say which of its numbers, as in q\[0\]"),
    ('t,q\n0,"[1, 2]"\n1,"[3]"\n', Key("q", 1), r"row 2 of column 'q' index 1 holds '\[3\]'; expected a list with a number 1"),
    ('t,q\n0,"[1, 2]"\n1,"[x, 4]"\n', Key("q[0]"), r"row 2 of column 'q\[0\]' holds 'x'; expected a number"),
    ("t;q\n0;1\n1;1.234,5\n2;1,5\n3;2,5\n", Key("q"), "holds '1.234,5'; expected a number without separators of thousands"),
    ('t,q\n0,1\n1,"1,234"\n2,5\n', Key("q"), "holds '1,234'; expected a number without separators of thousands"),
    ("t,q\n2024-05-01T12:00:00Z,1\n2024-05-01T12:00:01Z,2\n", Key("t"), "a column of dates or times of day has unit: iso"),
    ("t,q\n0,1\n1,2\n", Key("t", stamps=True), "row 1 of column 't' holds '0', and unit iso was declared"),
    ("t,q\n2024-05-01T12:00:00Z,1\n2024-13-01T12:00:00Z,2\n", Key("t", stamps=True), "row 2 of column 't' holds '2024-13-01"),
    ("t,q\n0001-01-01T00:00:00Z,1\n0001-01-01T00:00:01Z,2\n", Key("t", stamps=True), "in 1678 to 2261"),
    ("t,q\n05/01/2024 12:00,1\n05/01/2024 12:01,2\n", Key("t", stamps=True), "expected a time such as"),
    ("\n".join(",".join(cell * 100_000) for cell in (["c"], ["s"], ["1"])), Key("c0"), "over the limit"),
    ("Key: value\n" * 100_000 + "t,q\n0,1\n", Key("t"), "no column named 't'|no row of numbers"),
    ("t,q\0\n0,1\n", Key("t"), "not a text file"),
    ("", Key(0), "empty"),
    ("\n \n", Key(0), "no row of numbers"),
    ("t,q\n0,1\n", Key("x"), "no column named 'x'; there are: t, q"),
    ("t,q\n0,1\n", Key(2), "no column 2; columns count from 0"),
    ("0,1\n2,3\n", Key("1"), "without quotes"),
    ("t,q,v\n0,1\n2,3\n", Key("v"), "the header names 'v' as column 3, but its rows have 2 columns"),
    ("t,q\n0,1\n1,oops\n", Key("q"), "row 2 of column 'q' holds 'oops'"),
    ("0,1\n2,3\n4,5,6,7\n", Key(1), "differ in width"),
    (b"t\0,q\n1,2\n", Key(0), "not a text file"),
    (",".join(f"c{k}" for k in range(100_000)) + "\n" + ",".join(["1"] * 100_000) + "\n", Key("c0"), "has 100000 columns"),
    ("t,q\n" + ",\n" * 100_000, Key("t"), "has a header and no row"),
    ("t,q\n0,1\n" * 2 + "1" * 500_000 + "x,1\n", Key("t"), "row 3 of column 't' holds|row 2 of column 't' holds"),
    ("t,q\n0," + "9" * 305 + "\n1,2\n", Key("q"), "line 2 stands between"),
    ("t,q\n0,1\n1," + "9" * 400 + "\n", Key("q"), "row 2 of column 'q' holds 999"),
    ("t,q\n0,1\n", Key(10**25), "no column 10000"),
    ("// a log\nt,q\n0,1\n1,2/5\n2,3\n3,4\n", Key("q"), "row 2 of column 'q' holds '2/5'"),  # a slash is no comment
    ("t,q,tau\n0,1,2\nstart,of,run\n" + "1,2,3\n" * 9, Key("t"), "row 2 of column 't' holds 'start'"),
    *((f"t,q,a,b\n{row}\n1,2,3,4\n", Key("t"), "line 2 stands between names and numbers") for row in ("0,stop,n.i.,off", "0,,,x", "1e-3,a,b,c")),
]  # fmt: skip  # a table


_LINES = st.sampled_from(
    ["t,q,tau", "t;q;tau", "sep=;", "s,deg,Nm", "[s];[deg];[A]", "0,1,2", "0,5;1,5;2", "Name,a,Name,b", "Unit,deg,Unit,A", "Key: value", "Range,1,2",
     "# a", "2024-05-01T12:00:00Z,1,2", "12:00:00.5,1,2", "01.05.2024 12:00:00;1;2", ",,", "", "nan,inf,1e400", '"a', "x" * 300, "\ufeff", "1\t2\t3"]
)  # fmt: skip  # a list
_FRAGMENTS = st.sampled_from(
    [*"0123456789.,;|\t\n\r \"'#%eE+-", "nan", "inf", "t", "time", "\0", "é", "1.5", "\n2 3\n", "9" * 30]
)
_TEXTS = st.one_of(
    st.lists(_LINES, max_size=12).map("\n".join), st.lists(_FRAGMENTS, max_size=60).map("".join), st.text(max_size=200)
)


@settings(max_examples=210, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.one_of(_TEXTS.map(lambda text: text.encode("utf-8", "surrogatepass")), st.binary(max_size=300)),
    st.sampled_from([b"\n", b"\r\n"]),
)
def test_any_small_text_is_read_or_refused(tmp_path: Path, content: bytes, end: bytes) -> None:
    """Headers, blocks, units, dates and rows in any order, and any bytes at all: columns and drafts, or one line that opens with the file."""
    path = tmp_path / "log.csv"
    path.write_bytes(content.replace(b"\n", end))
    names: list[int | str] = [0, 1, "q", "t"]
    for key in (*map(Key, names), Key("t", stamps=True), Key(0, stamps=True), Key("q", 1)):
        refusal(path, [key])
    with contextlib.suppress(InputError):
        draft_experiment([path], Told(torque_constant="1 N*m/A", resistance="1 ohm"))
