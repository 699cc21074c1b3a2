"""Tasks of a fleet's workers: survey files of the catalog, and identify a joint of a file."""

import hashlib
import sys
import tempfile
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

from bristle import __version__
from bristle.errors import InputError, reason
from bristle.questions.fleet.dataset import task_bytes
from bristle.questions.fleet.files import is_remote, local_path, name_of, read_bytes, stamp
from bristle.questions.fleet.survey import FleetInput, Surveyed, laid_out, survey, surveyed_of, without_folder


class Identified(NamedTuple):
    """The identified values of a joint."""

    rows: Sequence[Mapping[str, Any]]  # a row of the dataset per value to use
    inputs: Mapping[str, str]  # SHA-256 of each log, by name
    reason: str = ""  # why there is no row


Identify = Callable[[Path, str], Identified]  # from a file and the name of a joint
_ONE = threading.Lock()  # CasADi and NumPy's settings are of the process: threads identify one after another


class FleetTask(NamedTuple):
    """A joint of a file to be identified."""

    key: str
    joint: str  # its name in the file
    file: Surveyed
    sent: dict[str, bytes] | None  # the inputs by name, if the worker does not reach them
    versions: tuple[tuple[str, str], ...]  # of the client


class TaskEnd(NamedTuple):
    """How a task ended."""

    failure: str = ""  # why nothing was identified; the next run tries again
    rows: bytes | None = None  # Parquet to be written
    refused: str = ""  # why this worker cannot be used


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


def survey_files(paths: Sequence[tuple[str, str | None]], verify: bool) -> list[str]:
    """`survey` of some files, each with what the ledger has of it; as the ledger is to have them."""
    return [survey(path, surveyed_of(known) if known else None, verify=verify).written() for path, known in paths]


def identify_task(task: FleetTask, identify: Identify) -> TaskEnd:
    """The rows of a joint of a file, or why there are none."""
    from distributed import get_worker

    worker = "here"  # outside Dask
    with suppress(ValueError):
        worker = str(get_worker().address)
    wrong = version_difference(task.versions, versions(), worker)
    if wrong:
        return TaskEnd(refused=wrong)
    try:
        return TaskEnd(rows=_rows(task, identify))
    except (InputError, OSError) as error:
        return TaskEnd(failure=_sentence(task, error))
    except MemoryError:
        return TaskEnd(failure="its worker ran out of memory; give each worker more with --memory")
    except Exception as error:  # noqa: BLE001  # one log of thousands must not end the run, whatever is in it
        return TaskEnd(failure=_sentence(task, f"a defect of bristle: {type(error).__name__}: {error}"))


def _sentence(task: FleetTask, error: object) -> str:
    """The reason without the folders of this machine."""
    return without_folder(reason(error), task.file.path) or "a defect of bristle: an error without a word"


def _rows(task: FleetTask, identify: Identify) -> bytes:
    """The rows of the joint, or a row with the reason for a file that bristle refuses for good."""
    with ExitStack() as stack:
        folder, path = "", local_path(task.file.path)
        # Inputs that are sent or fetched must be as they were surveyed.
        if task.sent is not None or is_remote(task.file.path):
            folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="bristle-"))
            contents = task.sent or {one.name: read_bytes(one.path) for one in task.file.inputs}
            for one in task.file.inputs:
                if hashlib.sha256(contents[one.name]).hexdigest() != one.sha256:
                    raise _changed_meanwhile(one)
            path = laid_out(Path(folder), name_of(task.file.path), contents)
        try:
            with _ONE:
                found = identify(path, task.joint)
            for one in task.file.inputs:
                if not task.file.apart and found.inputs.get(one.name, one.sha256) != one.sha256:
                    raise _changed_meanwhile(one)
            if _changed(task):
                raise _changed_meanwhile(task.file.inputs[0])
            if not found.rows:
                raise InputError(found.reason)
            return task_bytes(task.key, found.rows)
        except InputError as error:
            sentence = without_folder(str(error), task.file.path, str(path.parent), *([folder] if folder else []))
            if _may_pass(error) or _changed(task):
                raise InputError(sentence) from error
            return task_bytes(task.key, (), sentence)


def _changed_meanwhile(one: FleetInput) -> InputError:
    return InputError(f"{name_of(one.path)}: was changed while the fleet was identified; run again")


def _changed(task: FleetTask) -> bool:
    """Whether an input changed since the survey."""
    if task.sent is not None or is_remote(task.file.path):
        return False
    try:
        return any(stamp(one.path) != one.stamp for one in task.file.inputs)
    except (OSError, InputError):
        return True


def _may_pass(error: BaseException | None) -> bool:
    """Whether an error may not happen again: a file could not be read, or a package is not installed."""
    while error is not None:
        if isinstance(error, OSError | ImportError | MemoryError):
            return True
        error = error.__cause__
    return False
