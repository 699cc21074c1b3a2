"""Files whose library may crash or hang at damage, read in a process that ends with the file."""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from importlib import import_module
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from bristle.arrays import Array
from bristle.data.columns import Key, bounded
from bristle.errors import InputError

SECONDS, _BYTES_PER_SECOND = 60.0, 5e6  # that a file may take: on a busy machine SciPy alone takes some to load
_MEMORY, _MOST_NAMES = 2**33, 2000  # bytes that the process may take, and columns that are listed
# of the process: the modules of this one, wherever it is started
CODE = "import json, sys; asked = json.load(sys.stdin); sys.path[:] = asked['path']; from bristle.data import isolated; isolated.answer(asked)"
Columns = Callable[[Path, Sequence[Key] | None], Iterable[Any]]
"""Type of a reader of columns or, of no keys, of the names of all."""


def ask(read: Columns, path: Path, keys: Sequence[Key] | None, library: str, what: str, advice: str) -> list[Any]:
    """Columns, as floats, or names that a function of a module reads from a file in another process.

    `library` and `what` name the reader and the format, and `advice` is what to do about a damaged file. Raises
    InputError where `read` does, or fails, crashes, or takes too long.
    """
    asked = {
        "path": [str(folder) for folder in sys.path],
        "read": [read.__module__, read.__name__],
        "file": str(path.absolute()),
        "keys": None if keys is None else [[key.column, key.index] for key in keys],
    }
    seconds = SECONDS + path.stat().st_size / _BYTES_PER_SECOND
    environment = {**os.environ, "HDF5_PLUGIN_PRELOAD": "::"}  # no filters from elsewhere
    with tempfile.TemporaryFile() as out:
        try:
            ran = subprocess.run(  # noqa: S603  # our own code
                [sys.executable, "-I", "-c", CODE], input=json.dumps(asked).encode(), stdout=out, stderr=subprocess.DEVNULL,
                timeout=seconds, env=environment, check=False,
            )  # fmt: skip  # one call
        except subprocess.TimeoutExpired as error:
            raise InputError(f"is damaged, or on a slow disk: {library} took over {seconds:.0f} s; {advice}") from error
        if ran.returncode:
            raise InputError(f"is damaged: {library} crashed at it (exit code {ran.returncode}); {advice}")
        out.seek(0)
        answer = json.loads(out.readline() or b'{"damaged": "no answer"}')
        values = np.frombuffer(out.read(), "<f8").astype(float)
    if "error" in answer:
        raise InputError(answer["error"])
    if "damaged" in answer:
        raise InputError(f"is damaged, or no {what} ({answer['damaged']}); {advice}")
    return list(answer["names"] if keys is None else np.split(values, np.cumsum(answer["lengths"], dtype=int))[:-1])


def answer(asked: dict[str, Any]) -> None:
    """Write the answer: a line of JSON with "error", "damaged", "names" or "lengths", then the columns."""
    with suppress(ImportError, ValueError):  # Windows knows no such limit, and a lower one stays
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    said, columns = dict[str, Any](), list[Array]()
    (module, name), file = asked["read"], Path(asked["file"])
    try:
        read = getattr(import_module(module), name)
        if asked["keys"] is None:
            said["names"] = list(islice(read(file, None), _MOST_NAMES))
        else:
            for column in read(file, [Key(*key) for key in asked["keys"]]):
                columns.append(column)
                bounded(sum(x.size for x in columns))
            said["lengths"] = [column.size for column in columns]
    except InputError as error:
        said["error"] = str(error)
    except MemoryError:
        if file.stat().st_size < _MEMORY / 1032:  # zlib packs no tighter
            said["damaged"] = "claims more than it can hold"
        else:
            said["error"] = "does not fit into memory; cut it into several runs"
    except Exception as error:  # noqa: BLE001  # a library raises nearly anything at a damaged file
        said["damaged"] = str(error)
    sys.stdout.buffer.write(json.dumps(said).encode() + b"\n")
    for column in columns if "lengths" in said else ():
        sys.stdout.buffer.write(column.astype("<f8").tobytes())
