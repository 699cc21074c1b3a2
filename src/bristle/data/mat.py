"""Columns from MATLAB files of version 4 to 7, by variable or dotted path.

A file is checked first to lead from element to element: SciPy may follow a damaged one for ever, or end the process.
"""

import re
import struct
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bristle.arrays import Array
from bristle.data.columns import MAX_VALUES, Key, bounded, is_vector, numeric, reading
from bristle.data.hdf5 import mat_7_3_names, read_mat_7_3
from bristle.errors import InputError, short, short_list

_LONGEST = 1000
"""Characters of a dotted path."""
_PART = re.compile(r"[A-Za-z]\w*|\{[0-9]{1,9}\}|\([0-9]{1,9}\)")
_PATH = re.compile(r"[A-Za-z]\w*(?:\.[A-Za-z]\w*|\{[0-9]{1,9}\}|\([0-9]{1,9}\))*")
_SIZES = (8, 4, 4, 2, 2, 1)
"""Bytes of a number in a file of version 4, by the digit of its type that says its precision."""
_SPARSE = 2
"""The last digit of the type of a sparse variable there."""
_TYPES = 5000
"""A type is less; one that seems larger has its bytes in the other order."""
_HEAD = 128
"""Bytes before the first element of a file of version 5."""
_NUMBERS, _TEXTS, _MATRIX, _COMPRESSED = {1, 2, 3, 4, 5, 6, 7, 9, 12, 13}, {16, 17, 18}, 14, 15
"""Types of an element of version 5."""
_CELL, _STRUCT, _OBJECT, _TEXT, _SPARSE_CLASS, _FUNCTION, _OPAQUE = 1, 2, 3, 4, 5, 16, 17
_LEAD = {
    _CELL: 3,
    _STRUCT: 5,
    _OBJECT: 6,
    _TEXT: 4,
    **dict.fromkeys(range(6, 16), 4),
    _SPARSE_CLASS: 6,
    _FUNCTION: 3,
    _OPAQUE: 4,
}
"""Parts of an array by its class, before those that are arrays: class, lengths, name, numbers or names of fields."""
_PLAIN = range(5, 16)
_COMPLEX = 0x800
"""In the flags: there are imaginary parts as well."""
_DIMENSIONS = 32
_DEEPEST = 50
"""Nesting of structs and cells."""
_DAMAGED = "is damaged, or no MAT-file of version 4 to 7; save it again"


def mat_names(path: Path) -> tuple[str, ...]:
    """Dotted paths of the vectors of numbers that a file holds. Raises InputError where it cannot be read."""
    if is_version_7_3(path):
        return mat_7_3_names(path)
    return tuple(n for name, value in _load_mat(path, None).items() for n in _vectors(name, value))


def read_mat(path: Path, keys: Sequence[Key]) -> dict[Key, Array]:
    """Columns of a MATLAB file, by variable or dotted path; version 7.3 needs the extra `hdf5`.

    `q`, `data.q`, `data.run{2}.q`, `runs(3).q`. Braces and parentheses count from 1, as MATLAB writes them. Raises
    InputError.
    """
    if is_version_7_3(path):
        return read_mat_7_3(path, keys)
    variables = _load_mat(path, sorted({_root(key) for key in keys}))
    return {key: numeric(_walk(variables, str(key.column)), key) for key in keys}


def _load_mat(path: Path, names: Sequence[str] | None) -> dict[str, Any]:
    """Variables of a MAT-file by name; None: all of them but objects, which SciPy leaves without a name."""
    import scipy.io

    _check_version(path)
    with reading("MAT-file", "save it again"):
        found = scipy.io.loadmat(path, variable_names=None if names is None else list(names))
    variables = {name: value for name, value in found.items() if not name.startswith("__") and name != "None"}
    for name in names or ():
        if name not in variables:
            raise InputError(f"no variable {short(name)}; there are: {short_list(sorted(_load_mat(path, None)))}")
    bounded(sum(float(getattr(value, "size", 0)) for value in variables.values()))
    return variables


def is_version_7_3(path: Path) -> bool:
    """Whether a file is one of MATLAB's that is HDF5."""
    with path.open("rb") as file:
        head = file.read(520)
    return b"MATLAB 7.3" in head[:128] or b"\x89HDF" in (head[:4], head[512:516])


def _check_version(path: Path) -> None:
    """Refuse what would hang or crash SciPy."""
    from scipy.io.matlab import matfile_version

    with reading("MAT-file of version 4 to 7", "in MATLAB save it with save(file, '-v7', ...)"):
        major, _ = matfile_version(path)
    (check_version_4 if major == 0 else check_version_5)(path)


def _root(key: Key) -> str:
    if not isinstance(key.column, str) or len(key.column) > _LONGEST or not _PATH.fullmatch(key.column):
        raise InputError(
            f"column {key} is no variable of a MAT-file; expected a name or a dotted path such as data.q or data.run{{2}}.q"
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
        raise InputError(f"{seen} is no struct, so it has no field {short(name)}; name {seen} itself, or a struct")
    if name not in names:
        raise InputError(f"{seen} has no field {short(name)}; there are: {short_list(names)}")
    if isinstance(value, np.ndarray) and value.size != 1:
        raise InputError(f"{seen} is an array of {value.size} structs; say which, as in {seen}(1).{name}")
    return value.flat[0][name] if isinstance(value, np.ndarray) else value[name]  # type: ignore[index]  # a np.void here


def _vectors(name: str, value: object) -> list[str]:
    if isinstance(value, np.ndarray) and value.dtype.names and value.size == 1:
        return [n for field in value.dtype.names for n in _vectors(f"{name}.{field}", value.flat[0][field])]
    if isinstance(value, np.ndarray) and value.dtype == object:
        return [n for k, item in enumerate(value.ravel(order="F")) for n in _vectors(f"{name}{{{k + 1}}}", item)]
    return [name] if isinstance(value, np.ndarray) and is_vector(value.shape, value.dtype) else []


def check_version_4(path: Path) -> None:
    """Raises InputError unless each variable of a file of version 4 ends inside it."""
    size, at = path.stat().st_size, 0
    with path.open("rb") as file:
        order = "<" if 0 <= int.from_bytes(file.read(4), "little", signed=True) <= _TYPES else ">"
        while at < size:
            file.seek(at)
            kind, rows, columns, imaginary, name = struct.unpack(f"{order}5i", file.read(20).ljust(20, b"\xff"))
            precision = kind // 10 % 10
            if min(kind, rows, columns, name - 1) < 0 or precision >= len(_SIZES):
                raise InputError(_DAMAGED)
            parts = 1 if kind % 10 == _SPARSE or not imaginary else 2
            at += 20 + name + rows * columns * _SIZES[precision] * parts
    if at > size:
        raise InputError("is damaged: it ends inside a variable; save it again")


def check_version_5(path: Path) -> None:
    """Raises InputError unless each element of a file of version 5 to 7 is known and ends inside the one around it."""
    content = memoryview(path.read_bytes())
    order = ">" if bytes(content[_HEAD - 2 : _HEAD]) == b"MI" else "<"
    at = _HEAD
    while at < len(content):
        kind, start, at, _ = _element(content, at, order)  # which are not padded out here
        data = content[start:at]
        if kind == _COMPRESSED:
            with reading("MAT-file", "save it again"):
                data = memoryview(zlib.decompressobj().decompress(data, 8 * MAX_VALUES))
            kind, start, stop, _ = _element(data, 0, order)
            data = data[start:stop]
        if kind != _MATRIX:
            raise InputError(_DAMAGED)
        _check_matrix(data, order, 0)


def _check_matrix(data: memoryview, order: str, depth: int) -> None:
    """Refuse an array that is larger than its parts, or lacks some: SciPy would go on in what comes after.

    An empty one has none.
    """
    if depth > _DEEPEST:
        raise InputError(f"nests structs and cells more than {_DEEPEST} deep; expected a log")
    at, parts, kinds = 0, [], []
    while at < len(data):
        kind, start, stop, at = _element(data, at, order)
        parts.append(data[start:stop])
        kinds.append(kind)
        if kind == _MATRIX:
            _check_matrix(parts[-1], order, depth + 1)
    if parts and not _is_whole(parts, kinds, order, len(data)):
        raise InputError(_DAMAGED)


def _is_whole(parts: Sequence[memoryview], kinds: Sequence[int], order: str, size: int) -> bool:
    """Whether an array of so many bytes has the parts that its class demands, of the types that they have."""
    flags = struct.unpack_from(f"{order}I", parts[0])[0] if len(parts[0]) == 8 else 0
    kind = flags % 256
    if kind not in _LEAD:
        return False
    lead = _LEAD[kind] + (kind in (_TEXT, *_PLAIN) and bool(flags & _COMPLEX))
    numbers = set(kinds[3 if kind in _PLAIN else lead : lead])  # the others may be text
    known = numbers <= _NUMBERS and set(kinds[:lead]) <= _NUMBERS | _TEXTS and set(kinds[lead:]) <= {_MATRIX}
    if len(parts) < lead or not known:
        return False
    if kind in (_FUNCTION, _OPAQUE):
        return len(parts) > lead
    lengths = _integers(parts[1], order)
    count = float(np.prod(lengths, dtype=float))
    fits = lengths.size <= _DIMENSIONS and lengths.min(initial=0) >= 0 and (kind == _SPARSE_CLASS or count <= size)
    return bool(fits and len(parts) - lead >= count * _fields(parts[:lead], kind, order))


def _fields(parts: Sequence[memoryview], kind: int, order: str) -> int:
    """How many arrays an element of a cell, struct or object holds."""
    if kind not in (_STRUCT, _OBJECT):
        return int(kind == _CELL)
    each = int(_integers(parts[-2], order).max(initial=0))
    return len(parts[-1]) // each if each > 0 else 0


def _integers(part: memoryview, order: str) -> "np.ndarray[Any, np.dtype[np.int32]]":
    return np.frombuffer(part[: len(part) // 4 * 4], dtype=f"{order}i4")


def _element(data: memoryview, at: int, order: str) -> tuple[int, int, int, int]:
    """Type of the element at a byte, where its data start and stop, and where the next begins.

    Raises InputError where it ends outside.
    """
    if at + 8 > len(data):
        raise InputError(_DAMAGED)
    kind, size = struct.unpack_from(f"{order}2I", data, at)
    short = kind > 0xFFFF  # with its data in the tag
    start = at + (4 if short else 8)
    stop = start + (kind >> 16 if short else size)
    after = at + 8 if short else start + -(-size // 8) * 8
    if stop > min(len(data), after):
        raise InputError(_DAMAGED)
    return kind & 0xFFFF, start, stop, after
