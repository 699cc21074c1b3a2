"""Columns from MAT, NPZ, Parquet and HDF5 files, which hold named arrays."""

import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from bristle.arrays import Array
from bristle.data.columns import Key, bounded, is_vector, numeric, reading
from bristle.data.hdf5 import hdf5_names, read_hdf5
from bristle.data.mat import mat_names, read_mat
from bristle.errors import InputError, short, short_list

__all__ = ["Key", "names_of", "read_hdf5", "read_mat", "read_npz", "read_parquet"]

_HEADERS = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
_SAVEZ = "write it again with numpy.savez"


def read_npz(path: Path, keys: Sequence[Key]) -> dict[Key, Array]:
    """Columns of a NumPy archive, by the name of the array. Raises InputError; pickled objects are refused."""
    with reading("NPZ file", _SAVEZ):
        archive = zipfile.ZipFile(path)
    with archive:
        there = [name.removesuffix(".npy") for name in archive.namelist()]
        bounded(sum(member.file_size for member in archive.infolist()) / 4)
        for key in keys:
            if there.count(str(key.column)) != 1:
                problem = "several arrays" if key.column in there else "no array"
                raise InputError(f"{problem} named {key}; there are: {short_list(there)}")
        members = dict(zip(there, archive.infolist(), strict=True))
        return {key: numeric(_array(archive, members[str(key.column)], key), key) for key in keys}


def _array(archive: zipfile.ZipFile, member: zipfile.ZipInfo, key: Key) -> "np.ndarray[Any, Any]":
    """The array that a member holds; raises InputError where it holds another thing, or less than its header says."""
    shape, dtype = _header(archive, member)
    if dtype.hasobject:
        raise InputError(f"column {key} holds no plain array of numbers, but Python objects; expected one per sample")
    bounded(np.prod(shape, dtype=float))
    if min(shape, default=0) < 0 or np.prod(shape, dtype=float) * dtype.itemsize > member.file_size:
        raise InputError(f"is damaged: array {key} is shorter than its header says, {shape}; {_SAVEZ}")
    with reading("NPZ file", _SAVEZ), archive.open(member) as file:
        return np.asarray(np.lib.format.read_array(file, allow_pickle=False))


def _header(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> tuple[tuple[int, ...], "np.dtype[Any]"]:
    """Shape and type of the array that a member holds."""
    with reading("NPZ file", _SAVEZ), archive.open(member) as file:
        shape, _, dtype = _HEADERS[np.lib.format.read_magic(file)](file)
    return shape, dtype


def read_parquet(path: Path, keys: Sequence[Key]) -> dict[Key, Array]:
    """Columns of a Parquet file, by name or by number from 0. Raises InputError; needs the extra `parquet`."""
    with _parquet(path) as file:
        import pyarrow as pa

        there = list(file.schema_arrow.names)
        names = {key: _named(key, there) for key in keys}
        for key, name in names.items():
            kind = file.schema_arrow.field(name).type
            if not _is_number(kind):
                raise InputError(
                    f"column {key} holds no numbers, but {short(str(kind))}; expected one number per sample"
                )
        bounded(file.metadata.num_rows * len(names))
        with reading("Parquet file"):
            table = file.read(columns=sorted(set(names.values())))
            return {
                key: np.array(table.column(name).cast(pa.float64(), safe=False).to_numpy(), dtype=float)
                for key, name in names.items()
            }


def _named(key: Key, there: Sequence[str]) -> str:
    """The name of the column that a key means, which has it alone."""
    number = isinstance(key.column, int)
    if key.index is not None or (key.column >= len(there) if isinstance(key.column, int) else key.column not in there):
        raise InputError(f"no column {key}; there are: {short_list(there)}")
    name = there[key.column] if isinstance(key.column, int) else key.column
    if there.count(name) > 1:
        which = f", as column {key} is" if number else ""
        raise InputError(f"several columns named {short(name)}{which}; give each its own name")
    return name


def _is_number(kind: Any) -> bool:
    """Whether a column of an Arrow type holds one number per row; a dictionary of numbers does."""
    from pyarrow import types

    if types.is_dictionary(kind):
        return _is_number(kind.value_type)
    return bool(types.is_integer(kind) or types.is_floating(kind) or types.is_decimal(kind))


def names_of(path: Path) -> tuple[str, ...]:
    """Names of the one-dimensional numeric columns that a MAT, NPZ, Parquet or HDF5 file offers, structs as dotted paths.

    A name may repeat. Raises InputError where the file cannot be read.
    """
    suffix = path.suffix.lower()
    if suffix == ".mat":
        return mat_names(path)
    if suffix == ".npz":
        with reading("NPZ file", _SAVEZ):
            archive = zipfile.ZipFile(path)
        with archive:
            members = [m for m in archive.infolist() if m.filename.endswith(".npy")]
            return tuple(m.filename.removesuffix(".npy") for m in members if is_vector(*_header(archive, m)))
    if suffix in (".h5", ".hdf5", ".hdf"):
        return hdf5_names(path)
    with _parquet(path) as file:
        return tuple(field.name for field in file.schema_arrow if _is_number(field.type))


@contextmanager
def _parquet(path: Path) -> Iterator[Any]:
    """The open Parquet file."""
    try:
        from pyarrow import parquet
    except ImportError as error:
        raise InputError(
            "is a Parquet file, which needs pyarrow; install it with pip install 'bristle[parquet]'"
        ) from error
    with reading("Parquet file"):
        file = parquet.ParquetFile(path)
    with file:
        yield file
