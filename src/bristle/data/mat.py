"""Columns from MATLAB files of version 4 to 7, by variable or dotted path."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bristle.arrays import Array
from bristle.data.columns import Key, bounded, is_vector, numeric, reading
from bristle.data.mat_check import check_version_4, check_version_5
from bristle.errors import InputError, short, short_list

_LONGEST = 1000
"""Characters of a dotted path."""
_PART = re.compile(r"[A-Za-z]\w*|\{[0-9]{1,9}\}|\([0-9]{1,9}\)")
_PATH = re.compile(r"[A-Za-z]\w*(?:\.[A-Za-z]\w*|\{[0-9]{1,9}\}|\([0-9]{1,9}\))*")


def mat_names(path: Path) -> tuple[str, ...]:
    """Dotted paths of the vectors of numbers that a file holds. Raises InputError where it cannot be read."""
    variables = _load_mat(path, None)
    return tuple(n for name, value in variables.items() if not name.startswith("__") for n in _vectors(name, value))


def read_mat(path: Path, keys: Sequence[Key]) -> dict[Key, Array]:
    """Columns of a MATLAB file of version 4 to 7, by variable or dotted path: `q`, `data.q`, `data.run{2}.q`, `runs(3).q`.

    Braces and parentheses count from 1, as MATLAB writes them. Raises InputError.
    """
    variables = _load_mat(path, sorted({_root(key) for key in keys}))
    return {key: numeric(_walk(variables, str(key.column)), key) for key in keys}


def _load_mat(path: Path, names: Sequence[str] | None) -> dict[str, Any]:
    """Variables of a MAT-file by name; None: all of them."""
    import scipy.io

    _check_version(path)
    with reading("MAT-file", "save it again"):
        listed = scipy.io.whosmat(path)
    shapes = {name: shape for name, shape, _ in listed}
    for name in shapes if names is None else names:
        if name not in shapes:
            raise InputError(f"no variable {short(name)}; there are: {short_list(sorted(shapes))}")
    bounded(sum(float(np.prod(shapes[name], dtype=float)) for name in (shapes if names is None else names)))
    with reading("MAT-file", "save it again"):
        return dict(scipy.io.loadmat(path, variable_names=list(shapes if names is None else names)))


def _check_version(path: Path) -> None:
    """Refuse version 7.3, and what would hang or crash SciPy."""
    from scipy.io.matlab import matfile_version

    with path.open("rb") as file:
        head = file.read(520)
    if b"MATLAB 7.3" in head[:128] or b"\x89HDF" in (head[:4], head[512:516]):
        raise InputError(
            "is a MAT-file of version 7.3 (HDF5), which is not read; in MATLAB save it again with save(file, '-v7', ...)"
        )
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
