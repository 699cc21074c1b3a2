"""Columns of MATLAB files of version 4 to 7, by variable or dotted path; SciPy reads them."""

import re
from collections.abc import Iterator, Sequence
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np

from bristle.data.columns import Key, bounded, numeric, offered
from bristle.data.hdf5 import read_hdf5
from bristle.data.isolated import ask
from bristle.errors import InputError, short, short_list

_PART = re.compile(r"[A-Za-z]\w*|\{[0-9]{1,9}\}|\([0-9]{1,9}\)")
_PATH = re.compile(r"[A-Za-z]\w*(?:\.[A-Za-z]\w*|\{[0-9]{1,9}\}|\([0-9]{1,9}\))*")


def read_mat(path: Path, keys: Sequence[Key] | None) -> list[Any]:
    """Columns of a MATLAB file, or (None) the names of its vectors of numbers; version 7.3 needs the extra `hdf5`.

    A column is a variable or a dotted path: `q`, `data.q`, `data.run{2}.q`, `runs(3).q`. Braces and parentheses count
    from 1, as MATLAB writes them. Raises InputError.
    """
    with path.open("rb") as file:
        head = file.read(520)
    if b"MATLAB 7.3" in head[:128] or b"\x89HDF" in (head[:4], head[512:516]):
        return read_hdf5(path, keys)
    advice = "in MATLAB save it with save(file, '-v7', ...)"
    return ask(columns_of, path, keys, "SciPy", "MAT-file of version 4 to 7", advice)


def columns_of(path: Path, keys: Sequence[Key] | None) -> Iterator[Any]:
    """The columns of keys, or (None) the names of all vectors of numbers."""
    for key in keys or ():
        if not isinstance(key.column, str) or len(key.column) > 1000 or not _PATH.fullmatch(key.column):
            expected = "expected a name or a dotted path such as data.q or data.run{2}.q"
            raise InputError(f"column {key} is not a variable of a MAT-file; {expected}")
    roots = None if keys is None else sorted({_PART.findall(str(key.column))[0] for key in keys})
    variables = _load(path, roots)
    for name in roots or ():
        if name not in variables:
            raise InputError(f"no variable {short(name)}; there are: {short_list(sorted(_load(path, None)))}")
    bounded(sum(float(getattr(value, "size", 0)) for value in variables.values()))
    if keys is None:
        yield from (n for name, value in variables.items() for n in _vectors(name, value))
    for key in keys or ():
        yield numeric(_walk(variables, str(key.column)), key)


def _load(path: Path, names: list[str] | None) -> dict[str, Any]:
    """Variables by name; None: all of them but objects, which SciPy leaves without a name."""
    import scipy.io

    known = signature(scipy.io.loadmat).parameters.keys()
    sparse: dict[str, Any] = dict.fromkeys(known & {"spmatrix"}, False)  # from SciPy 1.17 on
    found = scipy.io.loadmat(path, variable_names=names, **sparse)
    return {name: value for name, value in found.items() if not name.startswith("__") and name != "None"}


def _walk(variables: dict[str, Any], path: str) -> Any:
    root, *parts = _PART.findall(path)
    value, seen = variables[root], root
    for part in parts:
        if part[0] in "{(":
            items = value.ravel(order="F") if isinstance(value, np.ndarray) else np.array([value], dtype=object)
            number = int(part[1:-1])
            if not 1 <= number <= items.size:
                why = f"{seen} has {items.size} elements, counted from 1"
                raise InputError(f"{why}; element {number} is not among them")
            value, seen = items[number - 1], f"{seen}{part}"
            continue
        while isinstance(value, np.ndarray) and value.size == 1 and value.dtype == object:
            value = value.flat[0]
        names = getattr(getattr(value, "dtype", None), "names", None)
        if not names:
            raise InputError(
                f"{seen} is not a struct, so it has no field {short(part)}; name {seen} itself, or a field of a struct"
            )
        if part not in names:
            raise InputError(f"{seen} has no field {short(part)}; there are: {short_list(names)}")
        if value.size != 1:
            raise InputError(f"{seen} is an array of {value.size} structs; say which, as in {seen}(1).{part}")
        value, seen = np.asarray(value).flat[0][part], f"{seen}.{part}"
    return value


def _vectors(name: str, value: Any) -> Iterator[str]:
    """Dotted paths of the columns of numbers in a variable."""
    if not isinstance(value, np.ndarray):
        return
    if value.dtype.names and value.size == 1:
        for field in value.dtype.names:
            yield from _vectors(f"{name}.{field}", value.flat[0][field])
    elif value.dtype == object:
        for k, item in enumerate(value.ravel(order="F")):
            yield from _vectors(f"{name}{{{k + 1}}}", item)
    else:
        yield from offered(name, value.shape, value.dtype)
