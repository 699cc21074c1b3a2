import contextlib
import json
import struct
import sys
import warnings
import zipfile
from collections.abc import Callable
from decimal import Decimal
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import scipy.io
import scipy.sparse
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bristle.data import isolated, text_layout, text_table
from bristle.data.binary_tables import is_json_log, names_of
from bristle.data.columns import Key
from bristle.data.mat import columns_of
from bristle.data.text_table import read_table
from bristle.data.units import EXACT, factor, fits, plus_minus, to_si
from bristle.errors import InputError

from .experiments import assert_refused, refusal

_QUICK = settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
_finite = st.floats(allow_nan=False, allow_infinity=False)


def _write(folder: Path, content: str | bytes, name: str = "log.csv") -> Path:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def _mat(path: Path, column: int | str, index: int | None = None) -> list[float]:
    """A column of a MAT-file, in this process, for one that is sound."""
    (values,) = columns_of(path, [Key(column, index)])
    return list(values.tolist())


def _column(path: Path, column: int | str, index: int | None = None) -> list[float]:
    key = Key(column, index)
    values: list[float] = read_table(path, [key]).columns[key].tolist()
    return values


@_QUICK
@given(
    st.lists(st.lists(_finite, min_size=3, max_size=3), min_size=1, max_size=8),
    st.sampled_from(",;\t| "),
    st.booleans(),
)
def test_any_table_comes_back(tmp_path: Path, rows: list[list[float]], delimiter: str, header: bool) -> None:
    """What is written with any delimiter, with or without a header, is read back, by name and by number."""
    lines = [delimiter.join(["t", "q", "tau"])] * header + [delimiter.join(map(repr, row)) for row in rows]
    table = read_table(_write(tmp_path, "\n".join(lines)), [Key(0), Key("tau" if header else 2)])
    expected = np.array(rows)
    assert table.rows == len(rows)
    np.testing.assert_allclose(table.columns[Key(0)], expected[:, 0], rtol=1e-14, atol=1e-320)
    np.testing.assert_allclose(table.columns[Key("tau" if header else 2)], expected[:, 2], rtol=1e-14, atol=1e-320)


@pytest.mark.parametrize("suffix", [".npz", ".json", ".parquet"])
def test_damaged_containers_are_refused_in_a_sentence(tmp_path: Path, suffix: str) -> None:
    """A container with any byte run overwritten, or cut short, gives its column or an InputError, nothing else."""
    whole = _container(tmp_path, suffix, q=np.arange(50.0)).read_bytes()
    rng = np.random.default_rng(0)
    paths = []
    for k in range(120):
        start = int(rng.integers(len(whole)))
        noise = rng.bytes(int(rng.integers(1, 12)))
        broken = whole[:start] if k % 3 == 0 else whole[:start] + noise + whole[start + len(noise) :]
        paths.append(_write(tmp_path, broken, f"broken{k}{suffix}"))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # numpy warns of some damage before it refuses it
        refusals = [refusal(path, [Key("q")]) for path in paths]
    assert sum(said is not None for said in refusals) > 20


def _container(folder: Path, suffix: str, **columns: Any) -> Path:
    path = folder / f"whole{suffix}"
    if suffix == ".mat":
        scipy.io.savemat(path, columns)
    elif suffix == ".npz":
        np.savez(path, **columns)
    elif suffix == ".json":
        path.write_text(json.dumps({name: x.tolist() for name, x in columns.items()}), encoding="utf-8")
    else:
        pytest.importorskip("pyarrow", reason="the extra `parquet` is not installed")
        pd.DataFrame(columns).to_parquet(path)
    return path


@pytest.mark.parametrize("suffix", [".mat", ".npz", ".json", ".parquet"])
def test_containers_come_back_as_floats(tmp_path: Path, suffix: str) -> None:
    """A column of any number type is read as floats of the same value, so that no integer arithmetic overflows later."""
    kinds = ("float64", "float32", "int16", "uint8")
    path = _container(tmp_path, suffix, **{kind: np.array([0, 1, 250]).astype(kind) for kind in kinds})
    table = read_table(path, [Key(kind) for kind in kinds])
    assert [column.dtype for column in table.columns.values()] == [np.float64] * 4
    assert [column.tolist() for column in table.columns.values()] == [[0, 1, 250]] * 4
    assert names_of(path) == kinds


def test_mat_files_are_read_whole(tmp_path: Path) -> None:
    """A dotted path reaches into structs, cells (from 1) and columns of a matrix (from 0)."""
    runs = np.empty((1, 2), dtype=object)
    runs[0, 0], runs[0, 1] = {"q": np.zeros(3)}, {"q": np.array([1.0, 2.0, 3.0]), "m": np.arange(6.0).reshape(3, 2)}
    path = tmp_path / "log.mat"
    scipy.io.savemat(path, {"data": {"run": runs, "t": np.arange(3.0)}, "k": 2.0})
    assert _column(path, "data.t") == [0, 1, 2]
    assert _mat(path, "data.run{2}.q") == [1, 2, 3]
    assert _mat(path, "data.run{2}.m", 1) == _column(path, "data.run{2}.m[1]") == [1, 3, 5]
    assert "data.run{2}.q" in names_of(path)
    says = {
        "data.run{3}.q": "2 elements", "data.x": "there are: run, t", "x": "there are: data, k",
        "data.run{2}.m": "say which column with index", "data.t.u": "not a struct", "data": "no plain array",
        "data..t": "dotted path",
    }  # fmt: skip  # a list of values
    assert_refused((partial(_mat, path, column), told) for column, told in says.items())
    with pytest.raises(InputError, match="columns differ in length"):
        read_table(path, [Key("data.t"), Key("k")])
    # they are read in both byte orders; sizes that lead backward, out of the file or beyond all numbers are refused in a sentence
    for order in "<>":
        content = _version_4(order, 1000 * (order == ">"), 3, 1, 0, 2) + struct.pack(f"{order}3d", 1, 2, 3)
        path = _write(tmp_path, content, "log.mat")
        assert _mat(path, "q") == [1, 2, 3]
        assert names_of(path) == ("q",)
    headers = [(0, -1, 3, 0, 2), (0, 2**31 - 1, 2**31 - 1, 1, 2), (0, 1, 1, 0, 0), (99, 1, 1, 0, 2)]
    paths = [_write(tmp_path, _version_4("<", *x) + bytes(8), f"{k}.mat") for k, x in enumerate(headers)]
    assert_refused((partial(_column, path, "q"), "is damaged") for path in paths)
    # beside an object of MATLAB, which SciPy knows no name of, the arrays are read and listed
    path = tmp_path / "log.mat"
    scipy.io.savemat(path, {"q": np.arange(5.0)})
    head, texts = _part(6, struct.pack("<II", 17, 0)), [_part(1, text) for text in (b"thing", b"MCOS", b"timeseries")]
    numbers = [(6, struct.pack("<II", 13, 0)), (5, struct.pack("<ii", 1, 1)), (1, b""), (6, bytes(4))]
    thing = b"".join([head, *texts, _part(14, b"".join(_part(*part) for part in numbers))])
    path.write_bytes(path.read_bytes() + _part(14, thing))
    assert _column(path, "q") == [0, 1, 2, 3, 4]
    assert names_of(path) == ("q",)


_SI = {
    "deg": "rad", "rev": "rad", "rpm": "rad/s", "mNm": "N*m", "mA": "A", "mm/s": "m/s", "ms": "s", "kHz": "Hz",
    "g*cm^2": "kg*m**2",
}  # fmt: skip  # a list of values


@_QUICK
@given(st.floats(1e-9, 1e9), st.sampled_from(sorted(_SI.items())))
def test_units_round_trip(value: float, units: tuple[str, str]) -> None:
    """A quantity in any unit is its SI value in SI, to rounding."""
    logged, si = units
    exact = to_si(f"{value * factor(logged, si)!r} {si}", si)
    assert to_si(f"{value!r} {logged}", si) == pytest.approx(exact, rel=1e-12)


def test_units_of_logs() -> None:
    """Counts, counts per turn, scales, values with their standard error; and what is known by heart is what pint says."""
    off = {pair: x for pair, x in EXACT.items() if factor(f"{pair[0]} ", pair[1]) != pytest.approx(x, rel=1e-15)}
    assert off == {}
    # whether a unit is one of a quantity's, too
    every = {unit for pair in EXACT for unit in pair}
    assert [(unit, si) for unit in every for si in _SI.values() if fits(unit, si) != fits(f"{unit} ", si)] == []
    assert factor("counts/s", "rad/s", resolution=1e-3) == pytest.approx(1e-3)
    assert to_si("4096 counts/rev", "rad") == pytest.approx(2 * np.pi / 4096)
    assert factor("A", "N*m", scale="-7.6 N*m/A") == pytest.approx(-7.6)
    assert factor("V", "N", scale="35.15 N/V") == pytest.approx(35.15)
    assert factor("1/min", "rad/s") == factor("min^-1", "rad/s") == pytest.approx(np.pi / 30)
    assert factor("1/min", "Hz") == pytest.approx(1 / 60)
    assert factor("V/rpm", "N*m/A") == pytest.approx(30 / np.pi)
    assert plus_minus("95.1 ± 0.5 kg", "kg") == plus_minus("(95.1 +/- 0.5) kg", "kg") == (95.1, 0.5)
    assert plus_minus("95.1 kg ± 500 g", "kg") == plus_minus("95.1 kg +/- 0.5", "kg") == pytest.approx((95.1, 0.5))
    assert plus_minus("9 kg", "kg") == (9, None)
    with pytest.raises(InputError, match="not a unit of kg"):
        plus_minus("95.1 N ± 0.5 kg", "kg")
    # a unit that is unknown or of another dimension, Hz for rad/s, bare numbers, and what is very long, large or small: a short sentence
    # each. Whatever reads it: a quantity, one with an error, a unit, a scale
    units = {
        "rad/s": ["Hz"], "Hz": ["rad/s"], "rad": ["degC", "%", "counts"], "N": ["N*m", "foo"],
        "m": ["rad", "", "()", "m**9**9**9**9", "m**99", "m" * 100, "2 m"], "s": ["__import__('os')"],
    }  # fmt: skip  # a list of values
    bare: list[Any] = [3, "3", None, "inf rad", "rad", [1], "1 N", {"a": 1}]
    hostile = ["1" * 500_000 + "x", "1 rad " + "+-" * 200_000, "(" * 500_000, "1" + " " * 500_000 + "rad"]
    hostile += ["1 " + "counts/" * 100_000, "1 Qm**9*Qm**9", "1 Qm**9*Qm**9*Qm**9", "1e400 rad", "1e-200 rad"]
    hostile += ["1e200 counts/rev", "1 rad +/- 1e400", "1e300 rad +/- 1 rad"]
    readers: list[Callable[[str, str], object]] = [to_si, plus_minus, factor]
    asks: list[tuple[Callable[[], object], str]]
    asks = [(partial(factor, x, target), "unit .*(expected|needs)") for target, all_ in units.items() for x in all_]
    asks += [(partial(to_si, value, "rad"), "expected") for value in bare]
    asks += [(partial(read, text, "rad"), "") for text in hostile for read in readers]
    asks += [(partial(factor, "rad", "rad", scale=text), "") for text in hostile]
    assert_refused(asks, seconds=2)


_PARTS = [*"mkNs*/()^-+129e% °µΩQq0._éjJ", "rad", "**", "deg", "nan", "inf", "counts", "rev", "Hz", "pi"]


@settings(max_examples=300)
@given(st.lists(st.sampled_from(_PARTS), max_size=12).map("".join))
def test_any_unit_is_taken_or_refused(unit: str) -> None:
    """No text makes the units raise anything but InputError, and what is taken is a finite size."""
    for target in ("rad", "N*m", "s"):
        with contextlib.suppress(InputError):
            assert 0 < factor(unit, target, resolution=1e-3) < np.inf


def _npy(shape: str = "(10,)", dtype: str = "'<f8'", data: bytes = bytes(80), version: int = 1) -> bytes:
    header = f"{{'descr': {dtype}, 'fortran_order': False, 'shape': {shape}, }}\n".encode()
    return b"\x93NUMPY" + bytes([version, 0]) + struct.pack("<H", len(header)) + header + data


_ARCHIVES: list[tuple[list[tuple[str, bytes]], str]] = [
    ([("q.npy", _npy("(1000000000000,)"))], "does not fit into memory|is damaged, or no NPZ file"),
    ([("q.npy", _npy("(-1,)"))], "is damaged, or no NPZ file"),
    ([("q.npy", _npy("[" * 3000 + "]" * 3000))], "is damaged, or no NPZ file"),
    ([("q.npy", _npy(dtype="'|O'"))], "is damaged, or no NPZ file with plain numbers"),
    ([("q.npy", _npy(dtype="'<c16'", shape="(5,)"))], "but complex numbers"),
    ([("q.npy", _npy(dtype="'<M8[s]'"))], "but values of type datetime64"),
    ([("q.npy", _npy("()"))], "a single number"), ([("q.npy", _npy(version=9))], "is damaged, or no NPZ file"),
    ([("q.npy", _npy()), ("q.npy", _npy())], "several arrays named 'q'"),
    ([("../q.npy", _npy())], r"no array named 'q'; there are: ../q"),
    ([("q", b"PK\x03\x04 a file in a file")], "holds no plain array"),
]  # fmt: skip  # a list of values


def test_archives_and_encodings_are_read_or_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Truth values, long floats and headers as Python 2 wrote them are numbers; what is too large for a float is not finite."""
    np.savez(tmp_path / "log.npz", b=np.array([True, False]), g=np.array([1, np.longdouble("1e400")]))
    assert _column(tmp_path / "log.npz", "b") == [1, 0]
    assert _column(tmp_path / "log.npz", "g")[0] == 1
    with zipfile.ZipFile(tmp_path / "old.npz", "w") as archive:
        archive.writestr("q.npy", _npy("(10L,)"))
    assert _column(tmp_path / "old.npz", "q") == [0] * 10
    # UTF-16 with its mark, and Latin-1, are read like UTF-8; `inf`, `nan`, an empty cell and a line cut short are read, and not finite
    text = "t,Winkel [°]\n0,1\n2,3\n"
    for encoding in ("utf-8", "utf-16", "latin-1"):
        assert _column(_write(tmp_path, text.encode(encoding)), "Winkel [°]") == [1, 3]
    values = _column(_write(tmp_path, "t,q\n0,inf\n1,nan\n2,\n3,4\n4"), "q")
    assert np.isfinite(values).tolist() == [False, False, False, True, False]
    # headers that lie, members twice, in folders or of another kind, and objects are one short sentence, without a warning
    for k, (members, _) in enumerate(_ARCHIVES):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # zipfile warns of a name that it writes twice
            with zipfile.ZipFile(tmp_path / f"{k}.npz", "w") as archive:
                for name, data in members:
                    archive.writestr(name, data)
    asks = [(partial(_column, tmp_path / f"{k}.npz", "q"), says) for k, (_, says) in enumerate(_ARCHIVES)]
    assert_refused(asks)
    # a line or a file longer than the stated limits is refused before it is parsed; so is a missing file
    path = _write(tmp_path, b"0,1\n" + b"2" * (text_layout.MAX_LINE + 1))
    asks = [(partial(_column, tmp_path / "none.csv", 0), r"none\.csv: no such file")]
    assert_refused([*asks, (partial(_column, path, 0), f"longer than {text_layout.MAX_LINE} bytes")])
    monkeypatch.setattr(text_table, "MAX_BYTES", 1000)
    assert_refused([(partial(_column, path, 0), "over the limit of 1000")])
    monkeypatch.undo()
    # version 7.3, pickled objects, no MAT-file at all, and a missing pyarrow: each says what to do
    hdf5 = _write(tmp_path, b"MATLAB 7.3 MAT-file".ljust(512) + b"\x89HDF", "new.mat")
    with pytest.raises(InputError, match=r"version 7\.3 .*'-v7'"):
        _column(hdf5, "q")
    with pytest.raises(InputError, match="no MAT-file"):
        _column(_write(tmp_path, "t,q\n0,1\n", "text.mat"), "q")
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(InputError, match=r"pip install 'bristle\[parquet\]'"):
        _column(_write(tmp_path, b"PAR1", "log.parquet"), "q")


def _version_4(order: str, *header: int) -> bytes:
    return struct.pack(f"{order}5i", *header) + b"q\0"


def test_damaged_mat_files_neither_crash_nor_hang(tmp_path: Path) -> None:
    """A type or class that is none, and lengths that do not fit, are damage, also where SciPy ends its process at them."""
    scipy.io.savemat(tmp_path / "whole.mat", {"q": np.arange(3.0)})
    whole, paths = (tmp_path / "whole.mat").read_bytes(), list[Path]()
    numbers, size, lead = struct.pack("<2I", 9, 24), struct.pack("<4I", 5, 8, 1, 3), struct.pack("<4I", 6, 8, 6, 0)
    for k, (old, new) in enumerate((
        (lead, struct.pack("<4I", 6, 8, 77, 0)), (size, struct.pack("<4I", 5, 8, 2**30, 3)), (numbers, struct.pack("<2I", 9, 2**31)),
        (numbers, struct.pack("<2I", 200, 24)), (whole[len(whole) // 2 :], b""),
    )):  # fmt: skip  # a table
        assert whole.count(old) == 1
        paths.append(_write(tmp_path, whole.replace(old, new), f"{k}.mat"))
    assert_refused((partial(_column, path, "q"), "is damaged") for path in paths)


def test_a_library_that_crashes_or_hangs_ends_in_a_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the process that reads crashes, takes too long or says nothing, one sentence says so."""
    path = _container(tmp_path, ".mat", q=np.arange(3.0))
    for worker, says in {
        "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)": "SciPy crashed at it",
        "import time; time.sleep(60)": "SciPy took over 1 s",
        "pass": r"is damaged, or no MAT-file of version 4 to 7 \(no answer\)",
    }.items():
        monkeypatch.setattr(isolated, "CODE", worker)
        monkeypatch.setattr(isolated, "SECONDS", 1.0 if "sleep" in worker else 60.0)
        assert_refused([(partial(_column, path, "q"), says)], str(path))


def _part(kind: int, data: bytes) -> bytes:
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


def test_mat_variables_of_other_kinds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Integers and truth values are numbers; sparse arrays, text, cells and complex numbers are refused by what they are."""
    path = tmp_path / "log.mat"
    sparse = scipy.sparse.csc_matrix(np.array([[0.0], [2.0], [0.0]]))
    scipy.io.savemat(path, {"i": np.arange(3, dtype="i2"), "b": np.arange(3) > 0, "s": sparse, "t": "abc", "z": np.arange(3) * 1j,
                            "c": np.array(["a", 1.0], dtype=object)})  # fmt: skip
    assert [_mat(path, name) for name in "ib"] == [[0, 1, 2], [0, 1, 1]]
    says = {"s": r"column 's' is a sparse array; in MATLAB save full\(s\)"}
    says |= {"t": "but text", "z": "but complex numbers", "c": "but cells"}
    assert_refused((partial(_mat, path, name), told) for name, told in says.items())
    # both are read, nulls as missing numbers, lists of one length as matrices; what is no table of numbers is refused in a sentence
    rows = [{"t": 0.5 * k, "q": [k, 2 * k], "tau": None if k == 1 else float(k), "name": "a"} for k in range(3)]
    path = tmp_path / "log.json"
    for data in (rows, {name: [row[name] for row in rows] for name in rows[0]}):
        path.write_text(json.dumps(data), encoding="utf-8")
        assert names_of(path) == ("t", "q[0]", "q[1]", "tau")
        assert (_column(path, "t"), _column(path, "q[1]"), _column(path, "q", 0)) == ([0, 0.5, 1], [0, 2, 4], [0, 1, 2])
        np.testing.assert_array_equal(_column(path, "tau"), [0, np.nan, 2])
        assert is_json_log(path)
    says = {
        '{"t": [1, 2], "q": [1]}': "is damaged, or no JSON of records",
        '{"t": ["a", "b"]}': "column 't' holds no plain array of numbers",
        '[{"t": [1, 2]}, {"t": [1, 3]}]': r"say which column with index: 0 to 1, or as in t\[0\]",
        "[" * 100_000: "is damaged, or no JSON",
        '[{"t": 1e999}, {"t": 1' + "0" * 5000 + "}]": "is damaged, or no JSON",
    }
    asks = []
    for k, (text, said) in enumerate(says.items()):
        (tmp_path / f"{k}.json").write_text(text, encoding="utf-8")
        asks.append((partial(_column, tmp_path / f"{k}.json", "t"), said))
    assert_refused(asks)
    # a record in each line, with objects in it; a file that would be nearly all empty is refused before it fills the memory
    lines = "\n".join(json.dumps({"t": k, "motor": {"current": 2 * k}}) for k in range(3))
    (tmp_path / "log.jsonl").write_text(lines + "\n\n", encoding="utf-8")
    assert names_of(tmp_path / "log.jsonl") == ("t", "motor.current")
    assert _column(tmp_path / "log.jsonl", "motor.current") == [0, 2, 4]
    (tmp_path / "wide.json").write_text(json.dumps([{f"k{k}": 1} for k in range(14_000)]), encoding="utf-8")
    (tmp_path / "bad.ndjson").write_text(lines + "\n{", encoding="utf-8")
    asks = [
        (partial(_column, tmp_path / "wide.json", "k0"), "over the limit"),
        (partial(_column, tmp_path / "bad.ndjson", "t"), "line 4"),
    ]
    assert_refused(asks)
    (tmp_path / "results.json").write_text('{"schema": "bristle-results/3"}', encoding="utf-8")
    assert not is_json_log(tmp_path / "results.json")

    # a ValueError of our own, while a file is read, is no bad input: it stays what it is
    def fail(*_: object) -> None:
        raise ValueError("ours")

    monkeypatch.setattr("bristle.data.binary_tables.numeric", fail)
    monkeypatch.setattr("bristle.data.text_table.text_layout", fail)
    for path in (_container(tmp_path, ".npz", q=np.arange(3.0)), _write(tmp_path, "q\n1\n2\n")):
        with pytest.raises(ValueError, match=r"^ours$") as caught:
            _column(path, "q")
        assert not isinstance(caught.value, InputError)


def test_parquet_columns_of_all_kinds(tmp_path: Path) -> None:
    """A pandas index, dictionaries and decimals of numbers are columns; nested ones, text and names given twice are refused by what they are."""
    pa = pytest.importorskip("pyarrow", reason="the extra `parquet` is not installed")
    parquet = pytest.importorskip("pyarrow.parquet")
    path = tmp_path / "log.parquet"
    pd.DataFrame({"t": [0.0, 1.0], "q": [3, 4]}).set_index("t").to_parquet(path)
    assert (_column(path, "t"), _column(path, "q")) == ([0, 1], [3, 4])
    columns = {
        "dict": pa.array([1.5, 2.5]).dictionary_encode(), "decimal": pa.array([Decimal("1.5"), Decimal("2.5")]),
        "large": pa.array([2**62 + 1, 2**62]), "list": pa.array([[1.0], [2.0]]),
        "struct": pa.array([{"a": 1.0}, {"a": 2.0}]), "words": pa.array(["a", "b"]).dictionary_encode(),
    }  # fmt: skip  # a list of values
    parquet.write_table(pa.table(columns), path)
    assert names_of(path) == ("dict", "decimal", "large")
    assert _column(path, "dict") == _column(path, "decimal") == [1.5, 2.5]
    assert _column(path, "large") == [float(2**62)] * 2
    for name in ("list", "struct", "words"):
        with pytest.raises(InputError, match=f"expected in every row of column '{name}' a number"):
            _column(path, name)
    rows = pa.table(
        {
            "q": [[1.0, 2.0], [3.0, 4.0]],
            "fixed": pa.array([[1, 2], [3, 4]], pa.list_(pa.int32(), 2)),
            "uneven": [[1.0, 2.0], [3.0]],
        }
    )
    parquet.write_table(rows, path)
    assert (_column(path, "q[1]"), _column(path, "fixed", 0)) == ([2, 4], [1, 3])
    with pytest.raises(InputError, match="expected in every row of column 'uneven' index 1 a number"):
        _column(path, "uneven[1]")
    parquet.write_table(pa.table([columns["large"], columns["decimal"]], names=["q", "q"]), path)
    for column in ("q", 0):
        with pytest.raises(InputError, match="several columns named 'q'"):
            _column(path, column)
