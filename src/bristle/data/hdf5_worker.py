"""Reads columns of an HDF5 file in a process of its own, which imports nothing of ours: the library may crash or hang.

Standard input: one JSON object {path, keys, matlab, most}; keys: null for the names of all columns, else a list of
[column, index]. Standard output: one line of JSON, {"error": sentence}, {"names": [...]} or {"lengths": [...]}, and
after the last the columns as floats of 8 bytes.
"""

import json
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np

_FILTERS = {1: "gzip", 2: "shuffle", 3: "fletcher32", 4: "szip", 5: "nbit", 6: "scaleoffset", 32000: "lzf"}
"""By their number: what HDF5 and h5py bring; no other is loaded."""
_CHUNK = 2**28
"""Largest chunk, bytes: a chunk is unpacked whole."""
_DEEPEST, _HOPS, _MOST_NAMES = 20, 20, 2000
_MATLAB_SCALARS = ("char", "cell", "function_handle")


class Refusal(Exception):  # noqa: N818  # it is a sentence
    """Why a column is not read."""


def _opened(file: Any, name: str, shown: str) -> tuple[Any, str | None]:
    """The dataset that a path leads to, and the field of it that its last part names; no link leaves the file."""
    here, left, hops, field = file, [part for part in name.split("/") if part], 0, None
    if not left or len(left) > 4 * _DEEPEST:
        raise Refusal(f"column {shown} is no path; expected the name of a dataset, as /group/position")
    while left:
        part = left.pop(0)
        if not hasattr(here, "keys"):
            if left or field is not None or part not in (here.dtype.names or ()):
                raise Refusal(f"column {shown}: no field {part[:60]!r}; there are: {_some(here.dtype.names or ())}")
            field = part
            continue
        link = here.get(part, getlink=True)
        if link is None and not left and here.get(part.rpartition(".")[0], getlink=True) is not None:
            left = part.rsplit(".", 1)
            continue
        if link is None:
            raise Refusal(f"column {shown}: nothing is named {part[:60]!r}; there are: {_some(here)}")
        kind = type(link).__name__
        if kind == "SoftLink" and hops < _HOPS:
            hops += 1
            here = file if link.path.startswith("/") else here
            left = [x for x in link.path.split("/") if x not in ("", ".")] + left
        elif kind == "HardLink":
            here = here[part]
        else:
            raise Refusal(
                f"column {shown} is behind a link to another file, or links in a circle; copy the data into the file"
            )
    return here, field


def _some(names: Any) -> str:
    """The first names of a group."""
    found = [str(name)[:60] for _, name in zip(range(12), names, strict=False)]
    return ", ".join(found) or "none"


def _type(dataset: Any, field: str | None, shown: str) -> Any:
    """The type of the numbers of a dataset or of a field of it. Raises Refusal where it is none that is read."""
    import h5py

    if not isinstance(dataset, h5py.Dataset):
        raise Refusal(
            f"column {shown} is a group, with {_some(dataset) if hasattr(dataset, 'keys') else 'nothing'}; name a dataset"
        )
    dtype = dataset.dtype if field is None else dataset.dtype[field]
    if field is None and dtype.names:
        raise Refusal(
            f"column {shown} is a table with the fields {_some(dtype.names)}; name one, as in {shown}.{dtype.names[0]}"
        )
    matlab = dataset.attrs.get("MATLAB_class", b"") if "MATLAB_class" in dataset.attrs else b""
    matlab = matlab.decode() if isinstance(matlab, bytes) else str(matlab)
    if dtype.kind not in "iufb" or matlab in _MATLAB_SCALARS:
        what = matlab or ("text, references or lists" if dtype.kind in "OSU" else f"values of type {dtype}")
        raise Refusal(f"column {shown} holds no plain numbers, but {what[:60]}; expected one real number per sample")
    return dtype


def _check_storage(dataset: Any, shown: str, most: int) -> None:
    """Raises Refusal where a dataset is stored elsewhere, packed in an unknown way, or too large, before it is read."""
    import h5py

    if dataset.is_virtual or dataset.external:
        raise Refusal(f"column {shown} is stored in other files; copy the data into the file")
    plan = dataset.id.get_create_plist()
    numbers = [plan.get_filter(k)[0] for k in range(plan.get_nfilters())]
    foreign = [number for number in numbers if number not in _FILTERS]
    if foreign:
        raise Refusal(
            f"column {shown} is packed by filter {foreign[0]}; expected one of {', '.join(_FILTERS.values())}; repack it with h5repack"
        )
    if plan.get_layout() == h5py.h5d.CHUNKED and np.prod(dataset.chunks, dtype=float) * dataset.dtype.itemsize > _CHUNK:
        raise Refusal(f"column {shown} has chunks of over {_CHUNK} bytes; repack it with h5repack")
    if np.prod(dataset.shape or (0,), dtype=float) > most:
        raise Refusal(
            f"column {shown} holds {np.prod(dataset.shape, dtype=float):.3g} numbers, over the limit of {most}; cut it into several runs"
        )


def _column(file: Any, name: str, index: int | None, most: int, *, matlab: bool) -> Any:
    """One column as floats; MATLAB's matrices stand with their rows last."""
    shown = repr(name[:100]) + ("" if index is None else f" index {index}")
    dataset, field = _opened(file, name.replace(".", "/") if matlab else name, shown)
    _type(dataset, field, shown)
    _check_storage(dataset, shown, most)
    shape = tuple(reversed(dataset.shape)) if matlab else tuple(dataset.shape)
    source = dataset if field is None else dataset.fields(field)
    if not shape:
        raise Refusal(f"column {shown} holds a single number; expected one per sample")
    if index is not None:
        if len(shape) != 2 or index >= shape[1]:
            raise Refusal(f"column {shown}: the array has shape {shape}; index counts the columns of a matrix from 0")
        values = source[index, :] if matlab else source[:, index]
    elif np.prod(shape) != max(shape):
        raise Refusal(f"column {shown} is a matrix of shape {shape}; say which column with index: 0 to {shape[-1] - 1}")
    else:
        values = source[()]
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(values).astype("<f8").ravel()


def _names(group: Any, before: str, depth: int, *, matlab: bool) -> Iterator[str]:
    """Paths of the vectors of numbers below a group, through no links."""
    import h5py

    for name in group:
        if type(group.get(name, getlink=True)).__name__ != "HardLink" or (matlab and name.startswith("#")):
            continue
        here, path = group[name], f"{before}{name}"
        if isinstance(here, h5py.Dataset):
            sizes = here.shape or ()
            if np.prod(sizes, dtype=float) == max(sizes, default=0) > 1:
                fields = here.dtype.names
                parts = (
                    [(path, here.dtype)] if not fields else [(f"{path}.{part}", here.dtype[part]) for part in fields]
                )
                is_text = matlab and bytes(here.attrs.get("MATLAB_class", b"")) == b"char"
                yield from (part for part, dtype in parts if dtype.kind in "iufb" and not is_text)
        elif isinstance(here, h5py.Group) and depth < _DEEPEST:
            yield from _names(here, f"{path}{'.' if matlab else '/'}", depth + 1, matlab=matlab)


def _answer(asked: dict[str, Any]) -> tuple[dict[str, Any], list[Any]]:
    """What is written: the line of JSON, and the columns."""
    import h5py

    with h5py.File(asked["path"], "r") as file:
        matlab, keys = asked["matlab"], asked["keys"]
        if keys is None:
            found = _names(file, "" if matlab else "/", 0, matlab=matlab)
            return {"names": [name for _, name in zip(range(_MOST_NAMES), found, strict=False)]}, []
        columns = list[Any]()
        for name, index in keys:
            left = asked["most"] - sum(column.size for column in columns)
            columns.append(_column(file, name, index, left, matlab=matlab))
    return {"lengths": [column.size for column in columns]}, columns


def main() -> None:
    """Answer what standard input asks, once."""
    columns: list[Any] = []
    try:
        answer, columns = _answer(json.load(sys.stdin))
    except Refusal as refusal:
        answer = {"error": str(refusal)}
    except MemoryError:
        answer = {"error": "does not fit into memory; cut it into several runs"}
    except Exception as error:  # noqa: BLE001  # the library raises nearly anything at a damaged file
        answer = {"damaged": str(error)}
    sys.stdout.buffer.write(json.dumps(answer).encode() + b"\n")
    for column in columns:
        sys.stdout.buffer.write(column.tobytes())


if __name__ == "__main__":
    main()
