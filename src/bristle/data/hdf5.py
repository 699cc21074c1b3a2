"""Columns of HDF5 files, and of MATLAB files of version 7.3, by the path of a dataset."""

import sys
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from bristle.arrays import Array
from bristle.data.columns import Key, bounded, offered, picked, reading
from bristle.data.isolated import ask
from bristle.errors import InputError, short_list

_DEEPEST, _LONGEST = 20, 1000  # groups in groups; characters of a path
_MATLAB_ADVICE = "in MATLAB save it again, or for less than 2 GB with save(file, '-v7', ...)"


def read_hdf5(path: Path, keys: Sequence[Key] | None) -> list[Any]:
    """Columns of an HDF5 file or, by its suffix, a MATLAB file of version 7.3; None: the names of its numeric vectors.

    A column is the path of its dataset, as `/group/position`, `index` picking one of a matrix; a field of a table is
    the last part of the path, `/log.position` or `/log/position`. In a MATLAB file it is a dotted path through structs
    (`data.q`); cells and arrays of structs are not read. Data outside the file (external links and storage, virtual
    datasets), text, references and lists of any length are refused. Raises InputError; needs the extra `hdf5`.
    """
    matlab = path.suffix.lower() == ".mat"
    if sys.modules.get("h5py", "") is None or find_spec("h5py") is None:
        what, also = ("a MAT-file of version 7.3 (HDF5)", f", or {_MATLAB_ADVICE}") if matlab else ("an HDF5 file", "")
        raise InputError(f"is {what}, which needs h5py; install it with pip install 'bristle[hdf5]'{also}")
    what = "MAT-file of version 7.3" if matlab else "HDF5 file"
    advice = _MATLAB_ADVICE if matlab else "write it again, or repair it with h5repack"
    return ask(columns_of, path, keys, "the HDF5 library", what, advice)


def columns_of(path: Path, keys: Sequence[Key] | None) -> Iterator[Any]:
    """The columns of keys, or (None) the names of all vectors of numbers."""
    import h5py

    matlab = path.suffix.lower() == ".mat"
    with h5py.File(path, "r") as file:
        names = _names(file, "" if matlab else "/", 0, matlab=matlab)
        yield from names if keys is None else (_column(file, key, matlab=matlab) for key in keys)


def _column(file: Any, key: Key, *, matlab: bool) -> Array:
    """One column as floats; the matrices of MATLAB are transposed."""
    if matlab and isinstance(key.column, str) and set(key.column) & set("{}()"):
        why = "is in a cell or an array of structs, which of version 7.3 is not read"
        raise InputError(f"column {key} {why}; {_MATLAB_ADVICE}")
    dataset, field = _opened(file, key, "." if matlab else "/")
    for fault in _faults(dataset, field, key):
        raise InputError(f"column {key} {fault}")
    bounded(float(np.prod(dataset.shape or (0,), dtype=float)), f"column {key} ")
    return picked(dataset if field is None else dataset.fields(field), dataset.shape, key, rows_last=matlab)


def _faults(dataset: Any, field: str | None, key: Key) -> Iterator[str]:
    """Reasons why a dataset is no column: no numbers, or stored elsewhere."""
    import h5py

    if not isinstance(dataset, h5py.Dataset):
        yield f"is a group, with {short_list(dataset) if hasattr(dataset, 'keys') else 'nothing'}; name a dataset"
    names, dtype = dataset.dtype.names, dataset.dtype if field is None else dataset.dtype[field]
    if field is None and names:
        yield f"is a table with the fields {short_list(names)}; name one, as in {key}.{names[0]}"
    kind = _class(dataset)
    if dtype.kind not in "iufb" or kind in ("char", "cell", "function_handle"):
        what = kind or ("text, references or lists" if dtype.kind in "OSU" else f"values of type {dtype}")
        yield f"holds no plain numbers, but {what[:60]}; expected one real number per sample"
    if dataset.is_virtual or dataset.external:
        yield "is stored in other files; copy the data into the file"


def _opened(file: Any, key: Key, between: str) -> tuple[Any, str | None]:
    """The dataset of a path, and the field that its last part names. Raises InputError where it is in another file."""
    name = key.column if isinstance(key.column, str) and len(key.column) <= _LONGEST else ""
    here, left = file, [part for part in name.replace(between, "/").split("/") if part]
    if not left or len(left) > 4 * _DEEPEST:
        raise InputError(f"column {key} is not a path; expected the name of a dataset, as /group/position")
    while left and hasattr(here, "keys"):
        part = left.pop(0)
        if part in here:
            with reading("HDF5 file", "copy the data into the file"):  # links may lead round in a circle
                here = here[part]
        elif not left and (stem := part.rpartition(".")[0]) in here and stem:
            left = part.rsplit(".", 1)
        else:
            raise InputError(f"column {key}: nothing is named {part[:60]!r}; there are: {short_list(here)}")
    if here.file.filename != file.filename:
        raise InputError(f"column {key} is behind a link to another file; copy the data into the file")
    fields = getattr(here.dtype, "names", None) or () if left else ()
    if left and (len(left) > 1 or left[0] not in fields):
        raise InputError(f"column {key}: no field {left[0][:60]!r}; there are: {short_list(fields)}")
    return here, next(iter(left), None)


def _class(dataset: Any) -> str:
    """MATLAB's name of the kind of a variable; empty where it wrote none."""
    kind = dataset.attrs.get("MATLAB_class", b"")
    return kind.decode() if isinstance(kind, bytes) else str(kind)


def _names(group: Any, before: str, depth: int, *, matlab: bool) -> Iterator[str]:
    """Paths of the columns of numbers in a group, through no links."""
    import h5py

    for name in group:
        if type(group.get(name, getlink=True)).__name__ != "HardLink" or (matlab and name.startswith("#")):
            continue
        here, path = group[name], f"{before}{name}"
        if isinstance(here, h5py.Dataset):
            parts = [(f"{path}.{part}", here.dtype[part]) for part in here.dtype.names or ()] or [(path, here.dtype)]
            shown = not matlab or _class(here) != "char"
            shape = (here.shape or ())[:: -1 if matlab else 1]
            yield from (x for part, dtype in parts if shown for x in offered(part, shape, dtype))
        elif isinstance(here, h5py.Group) and depth < _DEEPEST:
            yield from _names(here, f"{path}{'.' if matlab else '/'}", depth + 1, matlab=matlab)
