"""Columns from MAT, NPZ and Parquet files, which hold named arrays."""

import re
import struct
import zipfile
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bristle.errors import InputError
from bristle.model.arrays import Array

MAX_VALUES = 200_000_000
"""Most numbers that are read from one file: a small compressed file can hold very many."""
_PART = re.compile(r"[A-Za-z]\w*|\{\d+\}|\(\d+\)")
_PATH = re.compile(r"[A-Za-z]\w*(?:\.[A-Za-z]\w*|\{\d+\}|\(\d+\))*")
_BROKEN = (
    AttributeError,
    EOFError,
    LookupError,
    NameError,
    NotImplementedError,
    OverflowError,
    TypeError,
    struct.error,
    zlib.error,
)
"""What the readers raise on a damaged file, beside ValueError and OSError, as seen."""


@dataclass(frozen=True, slots=True)
class Key:
    """Which column: a name, a dotted path or a number; `index` picks a column of a matrix, from 0."""

    column: int | str
    index: int | None = None

    def __str__(self) -> str:
        return repr(self.column) + ("" if self.index is None else f" index {self.index}")


def read_mat(path: Path, keys: Sequence[Key]) -> dict[Key, Array]:
    """Columns of a MATLAB file of version 5 to 7, by variable or dotted path: `q`, `data.q`, `data.run{2}.q`, `runs(3).q`.

    Braces and parentheses count from 1, as MATLAB writes them. Raises InputError.
    """
    variables = _load_mat(path, sorted({_root(key) for key in keys}))
    return {key: _numeric(_walk(variables, str(key.column)), key) for key in keys}


def _load_mat(path: Path, names: Sequence[str]) -> dict[str, Any]:
    import scipy.io
    from scipy.io.matlab import MatReadError

    with path.open("rb") as file:
        head = file.read(520)
    if b"MATLAB 7.3" in head[:128] or b"\x89HDF" in (head[:4], head[512:516]):
        raise InputError(
            "is a MAT-file of version 7.3 (HDF5), which is not read; in MATLAB save it again with save(file, '-v7', ...)"
        )
    if head[126:128] not in (b"IM", b"MI"):
        raise InputError("is no MAT-file of version 5 to 7; in MATLAB save it with save(file, '-v7', ...)")
    try:
        shapes = {name: shape for name, shape, _ in scipy.io.whosmat(path)}
        for name in names:
            if name not in shapes:
                raise InputError(f"no variable {name!r}; there are: {', '.join(sorted(shapes))}")
            _bounded(np.prod(shapes[name], dtype=float))
        return dict(scipy.io.loadmat(path, variable_names=list(names)))
    except (*_BROKEN, MatReadError, UnicodeDecodeError) as error:
        raise InputError(f"is damaged, or no MAT-file ({error}); save it again") from error


def _root(key: Key) -> str:
    if not isinstance(key.column, str) or not _PATH.fullmatch(key.column):
        raise InputError(
            f"column {key.column!r} is no variable of a MAT-file; expected a name or a dotted path such as data.q or data.run{{2}}.q"
        )
    return str(_PART.findall(key.column)[0])


def _walk(variables: dict[str, Any], path: str) -> object:
    root, *parts = _PART.findall(path)
    value, seen = variables[root], root
    for part in parts:
        counted = part[0] in "{("
        value = _item(value, int(part[1:-1]), seen) if counted else _field(value, part, seen)
        seen += part if counted else f".{part}"
    return value


def _item(value: object, number: int, seen: str) -> object:
    items = value.ravel(order="F") if isinstance(value, np.ndarray) else np.array([value], dtype=object)
    if not 1 <= number <= items.size:
        raise InputError(f"{seen} has {items.size} elements; element {number} is not among them (they count from 1)")
    return items[number - 1]


def _field(value: object, name: str, seen: str) -> object:
    while isinstance(value, np.ndarray) and value.size == 1 and value.dtype == object:
        value = value.flat[0]
    names = getattr(getattr(value, "dtype", None), "names", None)
    if not names:
        raise InputError(f"{seen} is no struct, so it has no field {name!r}; name {seen} itself, or a struct")
    if name not in names:
        raise InputError(f"{seen} has no field {name!r}; there are: {', '.join(names)}")
    if isinstance(value, np.ndarray) and value.size != 1:
        raise InputError(f"{seen} is an array of {value.size} structs; say which, as in {seen}(1).{name}")
    return value.flat[0][name] if isinstance(value, np.ndarray) else value[name]  # type: ignore[index]  # a np.void here


def _numeric(value: object, key: Key) -> Array:
    """A vector of numbers, or the column `key.index` of a matrix, as floats."""
    while isinstance(value, np.ndarray) and value.dtype == object and value.size == 1:
        value = value.flat[0]
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "iuf":
        raise InputError(f"column {key} holds no plain array of numbers; expected one number per sample")
    _bounded(value.size)
    if key.index is not None:
        if value.ndim != 2 or key.index >= value.shape[1]:
            raise InputError(
                f"column {key}: the array has shape {value.shape}; index counts the columns of a matrix from 0"
            )
        value = value[:, key.index]
    if value.size != max(value.shape, default=0):
        raise InputError(
            f"column {key} is a matrix of shape {value.shape}; say which column with index: 0 to {value.shape[-1] - 1}"
        )
    return np.asarray(value, dtype=float).ravel()


def read_npz(path: Path, keys: Sequence[Key]) -> dict[Key, Array]:
    """Columns of a NumPy archive, by the name of the array. Raises InputError; pickled objects are refused."""
    try:
        with zipfile.ZipFile(path) as archive:
            _bounded(sum(member.file_size for member in archive.infolist()) / 4)
        with np.load(path, allow_pickle=False) as arrays:
            missing = [key for key in keys if key.column not in arrays.files]
            if missing:
                raise InputError(f"no array {missing[0]}; there are: {', '.join(arrays.files)}")
            return {key: _numeric(arrays[str(key.column)], key) for key in keys}
    except (*_BROKEN, zipfile.BadZipFile, RuntimeError, SyntaxError) as error:
        raise InputError(f"is damaged, or no NPZ file ({error}); write it again with numpy.savez") from error


def read_parquet(path: Path, keys: Sequence[Key]) -> dict[Key, Array]:
    """Columns of a Parquet file, by name or by number from 0. Raises InputError; needs the extra `parquet`."""
    parquet, broken = _pyarrow()
    try:
        file = parquet.ParquetFile(path)
        there = list(file.schema_arrow.names)
        for key in keys:
            if key.index is not None or (
                key.column not in there if isinstance(key.column, str) else key.column >= len(there)
            ):
                raise InputError(f"no column {key}; there are: {', '.join(there)}")
        names = {key: key.column if isinstance(key.column, str) else there[key.column] for key in keys}
        _bounded(file.metadata.num_rows * len(names))
        frame = file.read(columns=sorted(set(names.values()))).to_pandas()
    except broken as error:
        raise InputError(f"is damaged, or no Parquet file ({error}); write it again") from error
    return {
        key: _column(
            frame[name].to_numpy(dtype=float, na_value=np.nan) if frame[name].dtype.kind in "iuf" else None, key
        )
        for key, name in names.items()
    }


def _column(values: Array | None, key: Key) -> Array:
    if values is None:
        raise InputError(f"column {key} holds no numbers; expected one number per sample")
    return values


def names_of(path: Path) -> tuple[str, ...]:
    """Names of the one-dimensional numeric columns that a MAT, NPZ or Parquet file offers, structs as dotted paths; a name may repeat.

    Raises InputError where the file cannot be read.
    """
    suffix = path.suffix.lower()
    if suffix == ".mat":
        import scipy.io

        _load_mat(path, ())
        variables = _load_mat(path, [name for name, _, _ in scipy.io.whosmat(path)])
        return tuple(n for name, value in variables.items() if not name.startswith("__") for n in _vectors(name, value))
    if suffix == ".npz":
        read_npz(path, ())
        with np.load(path, allow_pickle=False) as arrays:
            return tuple(arrays.files)
    parquet, broken = _pyarrow()
    try:
        return tuple(parquet.ParquetFile(path).schema_arrow.names)
    except broken as error:
        raise InputError(f"is damaged, or no Parquet file ({error}); write it again") from error


def _vectors(name: str, value: object) -> list[str]:
    if isinstance(value, np.ndarray) and value.dtype.names and value.size == 1:
        return [n for field in value.dtype.names for n in _vectors(f"{name}.{field}", value.flat[0][field])]
    if isinstance(value, np.ndarray) and value.dtype == object:
        return [n for k, item in enumerate(value.ravel(order="F")) for n in _vectors(f"{name}{{{k + 1}}}", item)]
    is_vector = (
        isinstance(value, np.ndarray) and value.dtype.kind in "iuf" and value.size == max(value.shape, default=0) > 1
    )
    return [name] if is_vector else []


def _pyarrow() -> tuple[Any, tuple[type[Exception], ...]]:
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError as error:
        raise InputError(
            "is a Parquet file, which needs pyarrow; install it with pip install 'bristle[parquet]'"
        ) from error
    return parquet, (pyarrow.ArrowException, *_BROKEN)


def _bounded(values: float) -> None:
    if values > MAX_VALUES:
        raise InputError(f"holds {values:.3g} numbers, over the limit of {MAX_VALUES}; cut it into several runs")
