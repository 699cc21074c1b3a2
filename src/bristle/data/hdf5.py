"""Columns from HDF5 files, and from MATLAB files of version 7.3, which are such.

The HDF5 library can crash or hang at a damaged file. So it runs in a process of its own (`hdf5_worker`), which ends
with the file, and is ended where it takes longer than the size of the file explains.
"""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import IO, Any

import numpy as np

from bristle.arrays import Array
from bristle.data import hdf5_worker
from bristle.data.columns import MAX_VALUES, Key, bounded
from bristle.errors import InputError

SECONDS, _BYTES_PER_SECOND = 15.0, 5e6
"""How long a file may take, beside what its size explains."""
_LONGEST = 1000
"""Characters of a path."""
_ADVICE = "write it again, or repair it with h5repack"
MATLAB_ADVICE = "in MATLAB save it again, or for less than 2 GB with save(file, '-v7', ...)"
"""What to do about a MAT-file of version 7.3 that is not read."""


def read_hdf5(path: Path, keys: Sequence[Key]) -> dict[Key, Array]:
    """Columns of an HDF5 file, each by the path of its dataset, as `/group/position`, `index` picking one of a matrix.

    A field of a table is the last part of the path: `/log.position` or `/log/position`. Data outside the file (external
    links and storage, virtual datasets), text, references, lists of any length and filters that h5py does not bring are
    refused. Raises InputError; needs the extra `hdf5`.
    """
    return _read(path, keys, matlab=False)


def hdf5_names(path: Path) -> tuple[str, ...]:
    """Paths of the vectors of numbers in an HDF5 file. Raises InputError; needs the extra `hdf5`."""
    return tuple(_ask(path, None, matlab=False)[0]["names"])


def read_mat_7_3(path: Path, keys: Sequence[Key]) -> dict[Key, Array]:
    """Columns of a MATLAB file of version 7.3, by variable or dotted path through structs (`data.q`).

    Cells and arrays of structs are not read. Raises InputError; needs the extra `hdf5`.
    """
    for key in keys:
        if isinstance(key.column, str) and set(key.column) & set("{}()"):
            raise InputError(
                f"column {key} is in a cell or an array of structs, which of version 7.3 is not read; {MATLAB_ADVICE}"
            )
    return _read(path, keys, matlab=True)


def mat_7_3_names(path: Path) -> tuple[str, ...]:
    """Dotted paths of the vectors of numbers in a MATLAB file of version 7.3. Raises InputError; needs the extra `hdf5`."""
    return tuple(_ask(path, None, matlab=True)[0]["names"])


def _read(path: Path, keys: Sequence[Key], *, matlab: bool) -> dict[Key, Array]:
    for key in keys:
        if not isinstance(key.column, str) or len(key.column) > _LONGEST:
            raise InputError(f"column {key} is no path; expected the name of a dataset, as /group/position")
    if not keys:
        _ask(path, None, matlab=matlab)
        return {}
    answer, values = _ask(path, [[key.column, key.index] for key in keys], matlab=matlab)
    ends = np.cumsum(answer["lengths"])
    return {key: part.astype(float) for key, part in zip(keys, np.split(values, ends[:-1]), strict=True)}


def _ask(path: Path, keys: list[Any] | None, *, matlab: bool) -> tuple[dict[str, Any], Array]:
    """What the worker answers: a header, and the columns after one another. Raises InputError."""
    _check_installed(matlab=matlab)
    asked = {"path": str(path.absolute()), "keys": keys, "matlab": matlab, "most": MAX_VALUES}
    with tempfile.TemporaryFile() as out:
        _run(asked, out, SECONDS + path.stat().st_size / _BYTES_PER_SECOND)
        out.seek(0)
        answer = json.loads(out.readline() or b'{"damaged": "no answer"}')
        if "error" in answer:
            raise InputError(answer["error"])
        if "damaged" in answer:
            what = "MAT-file of version 7.3" if matlab else "HDF5 file"
            raise InputError(f"is damaged, or no {what} ({answer['damaged']}); {MATLAB_ADVICE if matlab else _ADVICE}")
        bounded(sum(answer.get("lengths", ())))
        return answer, np.frombuffer(out.read(), "<f8")


def _run(asked: dict[str, Any], out: IO[bytes], seconds: float) -> None:
    """Run the worker to its end. Raises InputError where it crashes, or takes too long."""
    command = [sys.executable, "-I", hdf5_worker.__file__]
    environment = {**os.environ, "HDF5_PLUGIN_PRELOAD": "::"}  # no filters from elsewhere
    try:
        ran = subprocess.run(  # noqa: S603  # our own worker
            command, input=json.dumps(asked).encode(), stdout=out, stderr=subprocess.DEVNULL, timeout=seconds, env=environment, check=False,
        )  # fmt: skip  # one call
    except subprocess.TimeoutExpired as error:
        raise InputError(
            f"is damaged, or on a slow disk: the HDF5 library took over {seconds:.0f} s; {_ADVICE}"
        ) from error
    if ran.returncode:
        raise InputError(f"is damaged: the HDF5 library crashed at it (exit code {ran.returncode}); {_ADVICE}")


def _check_installed(*, matlab: bool) -> None:
    if sys.modules.get("h5py", "") is None or find_spec("h5py") is None:
        what, also = ("a MAT-file of version 7.3 (HDF5)", f", or {MATLAB_ADVICE}") if matlab else ("an HDF5 file", "")
        raise InputError(f"is {what}, which needs h5py; install it with pip install 'bristle[hdf5]'{also}")
