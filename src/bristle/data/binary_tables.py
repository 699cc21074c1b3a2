"""Columns of files with named arrays, by their suffix: JSON, NPZ and Parquet here, MAT and HDF5 elsewhere."""

import json
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bristle.arrays import Array
from bristle.data.columns import Key, bounded, numeric, offered, place_of, reading
from bristle.data.hdf5 import read_hdf5
from bristle.data.isolated import Columns
from bristle.data.mat import read_mat
from bristle.errors import InputError

_MEMORY = 10  # times as many bytes as a float
_WHAT, _HOW = 'JSON of records, as [{"t": 0, "q": 1}, ...], or of columns', "expected as many numbers in each"
SCHEMA = "schema"  # a key of every JSON file that bristle writes
_NPZ = ("NPZ file", "write it again with numpy.savez")


def read_binary(path: Path, keys: Sequence[Key]) -> dict[Key, Array]:
    """Columns of a MAT, NPZ, JSON, Parquet or HDF5 file, by name, path or number. Raises InputError.

    `q[2]` is the third column of a matrix, or of a column of lists, q.
    """
    named = [key.inside() or key for key in keys]
    return dict(zip(keys, READERS[path.suffix.lower()](path, named), strict=True))


def names_of(path: Path) -> tuple[str, ...]:
    """Names of the numeric columns in a file: struct fields as dotted paths, matrix columns as `q[2]`.

    A name may repeat. Raises InputError where the file cannot be read.
    """
    return tuple(READERS[path.suffix.lower()](path, None))


def is_json_log(path: Path) -> bool:
    """Whether a JSON file holds a log, and no results of bristle; False where it cannot be read."""
    if path.suffix.lower() != ".json" or not path.is_file():
        return False
    try:
        data = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(data, list) or (isinstance(data, dict) and SCHEMA not in data)


def _json(path: Path, keys: Sequence[Key] | None) -> Iterator[Any]:
    """Columns by name (of objects in a record with dots, as `motor.current`) or by number, or of no keys all names.

    Raises InputError where the file is no such JSON, or a column is missing or holds no numbers.
    """
    import pandas as pd

    with reading(_WHAT, _HOW):
        text = path.read_bytes()
        if path.suffix.lower() != ".json":  # an object in each line
            text = b"[" + b",\n".join(line for line in text.splitlines() if line.strip()) + b"]"
        data = json.loads(text)
        if not isinstance(data, list | dict):
            raise InputError(f"is not {_WHAT}; {_HOW}")
        records = isinstance(data, list) and all(isinstance(row, dict) for row in data)
        # missing names of a record are filled in, and a value takes far more memory than a float
        bounded(_MEMORY * len(data) * len(set[str]().union(*data)) if records else 0)
        frame = pd.json_normalize(data) if records else pd.DataFrame(data)
    bounded(frame.size)
    names = [str(name) for name in frame.columns]
    columns = [_array(frame.iloc[:, k]) for k in range(len(names))]
    if keys is None:
        yield from (of for name, x in zip(names, columns, strict=True) for of in offered(name, x.shape, x.dtype))
        return
    for key in keys:
        yield numeric(columns[place_of(key, names)], key)


def _array(column: Any) -> np.ndarray[Any, np.dtype[Any]]:
    """The values of a column, (n,), or of one of lists of one length, (n, k); null is nan."""
    if column.dtype.kind == "O":
        plain = column.map(lambda x: x is None or isinstance(x, int | float)).all()
        lists = column.map(lambda x: len(x) if isinstance(x, list) else -1)
        if plain or (lists.iloc[0] >= 0 and (lists == lists.iloc[0]).all()):
            with reading(_WHAT, _HOW):
                return np.array(column.tolist(), dtype=float if plain else None)
    return np.asarray(column)


def _npz(path: Path, keys: Sequence[Key] | None) -> Iterator[Any]:
    """Columns of a NumPy archive, by the name of the array; pickled objects are refused."""
    with reading(*_NPZ), zipfile.ZipFile(path) as members:
        bounded(sum(member.file_size for member in members.infolist()) / 4)
    with reading(*_NPZ):
        archive = np.load(path, allow_pickle=False)
    with archive:
        if keys is None:
            for name in archive.files:
                array = np.zeros(())
                with reading(*_NPZ), suppress(ValueError):  # of Python objects
                    array = archive[name]
                yield from offered(name, array.shape, array.dtype)
            return
        for key in keys:
            name = archive.files[place_of(replace(key, column=str(key.column)), archive.files, "array")]
            with reading(f"NPZ file with plain numbers in {key}", _NPZ[1]):
                array = archive[name]
            yield numeric(array, key)


def _parquet(path: Path, keys: Sequence[Key] | None) -> Iterator[Any]:
    """Columns of a Parquet file, by name or by number from 0; it needs the extra `parquet`."""
    try:
        import pyarrow as pa
        from pyarrow import compute, parquet, types
    except ImportError as error:
        install = "install it with pip install 'bristle[parquet]'"
        raise InputError(f"is a Parquet file, which needs pyarrow; {install}") from error
    with reading("Parquet file"):
        file = parquet.ParquetFile(path)
    with file:
        schema = file.schema_arrow
        if keys is None:
            numbers = (types.is_integer, types.is_floating, types.is_decimal)
            yield from (field.name for field in schema if any(is_one(field.type) for is_one in numbers))
            return
        names = [schema.names[place_of(key, schema.names)] for key in keys]
        bounded(file.metadata.num_rows * len(names))
        with reading("Parquet file"):
            table = file.read(columns=sorted(set(names)))
        for key, name in zip(keys, names, strict=True):
            with reading("Parquet file", f"expected in every row of column {key} a number, or as many in a list"):
                column = table.column(name)
                column = column if key.index is None else compute.list_element(column, key.index)
                yield np.array(column.cast(pa.float64(), safe=False).to_numpy(), dtype=float)


READERS: dict[str, Columns] = {
    ".mat": read_mat,
    ".npz": _npz,
    **dict.fromkeys((".json", ".jsonl", ".ndjson"), _json),
    **dict.fromkeys((".parquet", ".pq"), _parquet),
    **dict.fromkeys((".h5", ".hdf5", ".hdf"), read_hdf5),
}
"""Readers by suffix."""
