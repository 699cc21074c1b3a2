import re
import shutil
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from bristle.data.binary_tables import names_of
from bristle.data.columns import Key
from bristle.data.experiment.draft import draft_experiment
from bristle.data.hdf5 import columns_of
from bristle.data.text_table import read_table
from bristle.errors import InputError

from .experiments import assert_refused, refusal

h5py = pytest.importorskip("h5py", reason="the extra `hdf5` is not installed")

_TABLE = np.array([(k, -k, b"x") for k in range(5)], dtype=[("position", "f4"), ("counts", "i2"), ("tag", "S1")])


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file with vectors, a matrix, a table, links, and what is not read."""
    folder = tmp_path_factory.mktemp("hdf5")
    with h5py.File(folder / "other.h5", "w") as file:
        file["q"] = np.arange(5.0)
    (folder / "raw").write_bytes(bytes(40))
    with h5py.File(folder / "log.h5", "w") as file:
        file["t"] = np.arange(5)
        file.create_dataset(
            "arm/q", data=np.arange(10.0).reshape(5, 2), chunks=(2, 2), compression="gzip", shuffle=True,
            fletcher32=True,
        )  # fmt: skip  # a list of values
        file["arm/column"] = np.arange(5.0).reshape(5, 1)
        file["arm/a.b"] = np.arange(5.0) + 1
        file["log"] = _TABLE
        file["one"], file["flags"] = 3.0, np.array([True, False, True, True, False])
        file["soft"], file["away"] = h5py.SoftLink("/arm/column"), h5py.ExternalLink("other.h5", "/q")
        file["soft_away"], file["circle"] = h5py.SoftLink("/away"), h5py.SoftLink("/circle")
        file["text"] = np.array([b"a"] * 5)
        file.create_dataset("lists", (5,), dtype=h5py.vlen_dtype(float))
        file.create_dataset("references", (5,), dtype=h5py.ref_dtype)
        file.create_dataset("complex", data=np.ones(5, complex))
        file.create_dataset("outside", (5,), "f8", external=[("raw", 0, 40)])
        layout = h5py.VirtualLayout((5,), "f8")
        layout[:] = h5py.VirtualSource("other.h5", "q", (5,))
        file.create_virtual_dataset("virtual", layout)
        file.create_dataset("huge", (10**12,), "f8", chunks=(1000,))
    return folder / "log.h5"


_READ: dict[Key, list[float]] = {
    Key("t"): [0, 1, 2, 3, 4], Key("/t"): [0, 1, 2, 3, 4], Key("/arm/q", 1): [1, 3, 5, 7, 9],
    Key("arm/column"): [0, 1, 2, 3, 4], Key("/arm/a.b"): [1, 2, 3, 4, 5], Key("/log.position"): [0, 1, 2, 3, 4],
    Key("/log/counts"): [0, -1, -2, -3, -4], Key("/soft"): [0, 1, 2, 3, 4], Key("flags"): [1, 0, 1, 1, 0],
}  # fmt: skip  # a list of values
_REFUSED: dict[Key, str] = {
    Key("x"): "nothing is named 'x'; there are: arm, away, ",
    Key("/arm/x"): "nothing is named 'x'; there are: a.b, column, q",
    Key("/arm"): "is a group, with a.b, column, q; name a dataset",
    Key("/arm/q"): "is a matrix of shape (5, 2); say which column with index: 0 to 1",
    Key("/arm/q", 2): "has shape (5, 2); index counts", Key("/t", 0): "has shape (5,); index counts",
    Key("one"): "holds a single number",
    Key("/log"): "is a table with the fields position, counts, tag; name one, as in '/log'.position",
    Key("/log.speed"): "no field 'speed'; there are: position, counts, tag",
    Key("/log.tag"): "holds no plain numbers", Key("text"): "holds no plain numbers, but text, references or lists",
    Key("lists"): "holds no plain numbers", Key("references"): "holds no plain numbers",
    Key("complex"): "holds no plain numbers, but values of type complex128",
    Key("away"): "is behind a link to another file", Key("soft_away"): "is behind a link to another file",
    Key("circle"): "too many links", Key("outside"): "is stored in other files; copy the data into the file",
    Key("virtual"): "is stored in other files", Key("huge"): "holds 1e+12 numbers, over the limit of 200000000",
    Key("/"): "is not a path", Key(0): "is not a path",
}  # fmt: skip  # a list of values


def _all(path: Path, key: Key) -> list[float]:
    (values,) = columns_of(path, [key])
    return list(values.tolist())


def test_paths_and_names_of_datasets(log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Vectors, columns of matrices, fields of tables and links inside the file are read as floats; what is no plain number in it is refused."""
    assert {key: _all(log, key) for key in _READ} == _READ
    assert_refused((partial(_all, log, key), re.escape(says)) for key, says in _REFUSED.items())
    table = read_table(log, [*_READ])
    assert {key: column.tolist() for key, column in table.columns.items()} == _READ
    assert {column.dtype for column in table.columns.values()} == {np.dtype(np.float64)}
    assert "is a group" in str(refusal(log, [Key("/arm")]))
    shutil.copy(log, log.with_name("LOG.HDF"))  # the suffix says the format in whatever case
    assert read_table(log.with_name("LOG.HDF"), [Key("t")]).rows == 5
    # empty, cut short or random: one sentence, which a user gets with the name of the file
    whole = log.read_bytes()
    for content in (b"", b"\x89HDF\r\n\x1a\n", np.random.default_rng(0).bytes(3000), whole[: len(whole) // 2]):
        (tmp_path / "broken.h5").write_bytes(content)
        assert len(str(refusal(tmp_path / "broken.h5", [Key("/arm/q", 1)]))) < 500
    # the vectors of numbers are offered by path, through no link; a draft takes them by their names
    assert {"/t", "/arm/column", "/log.position", "/log.counts", "/flags"} <= set(names_of(log))
    assert not {"/soft", "/away", "/text", "/arm/q", "/one"} & set(names_of(log))
    with h5py.File(tmp_path / "log.hdf5", "w") as file:
        file["time"] = 0.01 * np.arange(200)
        file["joint/position"], file["joint/torque"] = np.sin(file["time"][()]), np.cos(file["time"][()])
    assert [line.split(",")[0] for line in draft_experiment([tmp_path / "log.hdf5"]).signals] == [
        'time: {column: "/time"', 'position: {column: "/joint/position"', 'torque: {column: "/joint/torque"',
    ]  # fmt: skip  # a list of lines
    # variables and structs of version 7.3 are read by the same names as those of version 7; cells and text are refused
    path = _mat_7_3(tmp_path / "log.mat")
    table = read_table(path, [Key("t"), Key("data.q"), Key("data.m", 1)])
    assert [column.tolist() for column in table.columns.values()] == [[0, 1, 2, 3], [0, 1, 2, 3], [4, 5, 6, 7]]
    assert set(names_of(path)) == {"t", "data.q", "data.m[0]", "data.m[1]"}
    for column, says in {
        "runs{1}.q": "is in a cell or an array of structs", "runs": "holds no plain numbers, but cell", "label": "but char",
        "data": "is a group", "x": "nothing is named 'x'", "data.m": r"matrix of shape \(4, 2\)",
    }.items():  # fmt: skip  # a table
        with pytest.raises(InputError, match=says):
            list(columns_of(path, [Key(column)]))
    # a missing h5py is named, with the command that installs it
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(InputError, match=r"needs h5py; install it with pip install 'bristle\[hdf5\]'"):
        read_table(log, [Key("t")])


def _mat_7_3(path: Path) -> Path:
    """A file as MATLAB writes one of version 7.3: matrices with their rows last, structs as groups."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values, kind in (
            ("t", np.arange(4.0).reshape(1, 4), "double"),
            ("data/q", np.arange(4.0).reshape(4, 1), "single"),
            ("data/m", np.arange(8.0).reshape(2, 4), "double"),
            ("label", np.arange(4, dtype="u2").reshape(4, 1), "char"),
        ):
            file[name] = values
            file[name].attrs["MATLAB_class"] = np.bytes_(kind)
        file.create_dataset("runs", (1, 2), dtype=h5py.ref_dtype).attrs["MATLAB_class"] = np.bytes_("cell")
    content = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512)
    path.write_bytes(content + path.read_bytes()[512:])
    return path
