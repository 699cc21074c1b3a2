"""The task of a fleet's workers: identify a joint of a file."""

import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

from bristle import __version__
from bristle.errors import InputError, reason
from bristle.estimation.levels import changed_levels
from bristle.questions.fleet.survey import Surveyed, without_folder

Row = Mapping[str, Any]  # of the dataset
Identify = Callable[[Path, str], Sequence[Row]]  # from a file and the name of a joint; raises InputError for none
_ONE = threading.Lock()  # CasADi and NumPy's settings are of the process: threads identify one after another


class FleetTask(NamedTuple):
    """A joint of a file to be identified."""

    key: str
    joint: str  # its name in the file
    file: Surveyed
    versions: tuple[tuple[str, str], ...]  # of the client
    levels: Mapping[str, Any] = {}  # that the client changed


class TaskEnd(NamedTuple):
    """How a task ended."""

    rows: Sequence[Row] = ()  # of the dataset; one with a failure, where bristle refuses the file for good
    failure: str = ""  # why nothing was identified; the next run tries again


@cache
def versions() -> tuple[tuple[str, str], ...]:
    """Versions that results depend on: bristle, Python, NumPy, SciPy and CasADi."""
    python = ".".join(map(str, sys.version_info[:2]))
    return ("bristle", __version__), ("Python", python), *((x, version(x)) for x in ("numpy", "scipy", "casadi"))


def version_difference(here: Sequence[tuple[str, str]], there: Sequence[tuple[str, str]], worker: str) -> str:
    """What differs on a worker, in a sentence; nothing where nothing does."""
    other = dict(there)
    found = next(((name, mine, other.get(name, "none")) for name, mine in here if other.get(name) != mine), None)
    if found is None:
        return ""
    name, mine, its = found
    return f"the worker {worker} has {name} {its}, and the client {mine}; install the same versions of {', '.join(x for x, _ in here)} on all"


def identify_task(task: FleetTask, identify: Identify) -> TaskEnd:
    """The rows of a joint of a file, or why there are none."""
    from distributed import get_worker

    worker, path, rows = "here", task.file.path, list[Row]()  # outside Dask
    with suppress(ValueError):
        worker = str(get_worker().address)
    for_good, why = False, version_difference(task.versions, versions(), worker)
    try:
        with _ONE, changed_levels(**task.levels):
            rows += () if why else identify(Path(path), task.joint)
    except InputError as error:
        for_good, why = not _may_pass(error), str(error)
    except OSError as error:
        why = reason(error)
    except MemoryError:
        why = "its worker ran out of memory; give each worker more with --memory"
    except Exception as error:  # noqa: BLE001  # one log of thousands must not end the run, whatever is in it
        why = f"a defect of bristle: {type(error).__name__}: {error}"
    if not task.file.holds():
        for_good, why = False, f"{Path(path).name}: it or a log was changed while the fleet was identified; run again"
    if why and not for_good:
        return TaskEnd(failure=without_folder(why, path))
    own = {"key": task.key, "failure": without_folder(why, path) if why else None}
    return TaskEnd(rows=[{**row, **own} for row in rows or [{}]])


def _may_pass(error: BaseException | None) -> bool:
    """Whether an error may not happen again: a file could not be read, or a package is not installed."""
    while error is not None:
        if isinstance(error, OSError | ImportError | MemoryError):
            return True
        error = error.__cause__
    return False
