"""A run of a fleet on Dask: new and changed joint sessions are identified, and the dataset of the output is updated.

The rows of each finished task stay in the output, however the run ends, and the next run continues from them.
"""

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from datetime import timedelta
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, NamedTuple

from pydantic import TypeAdapter

from bristle import __version__
from bristle.errors import InputError, one_line, short
from bristle.estimation import levels
from bristle.page.output_folder import FLEET, LEDGER, LOCK, TASKS, claim
from bristle.page.wording import counted
from bristle.progress import Progress, step
from bristle.questions.fleet import cluster, dataset
from bristle.questions.fleet.catalog import CatalogRow
from bristle.questions.fleet.sessions import joint_sessions
from bristle.questions.fleet.survey import Surveyed, survey
from bristle.questions.fleet.tasks import FleetTask, Identify, TaskEnd, identify_task, versions

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

LEAST_WINDOW, WINDOW = 200, 20  # least tasks under way, and tasks per thread
_MEMORY = "its worker died {times}, perhaps for want of memory; give each worker more with --memory"
_LEDGER = TypeAdapter(tuple[str, dict[str, Surveyed]])  # version of bristle, and what it found of each file


class FleetRun(NamedTuple):
    """Result of a run."""

    table: "pa.Table"  # the dataset
    identified: int  # tasks of this run with rows
    unchanged: int  # joint sessions with known results
    failed: int  # joint sessions without a result


def _telling(progress: Progress | None, what: str, total: int) -> Callable[[int], None]:
    """A function that reports how many of `total` are done, the rate and the remaining time."""
    begun = monotonic()

    def tell(done: int) -> None:
        if progress and total:
            rate = done / max(monotonic() - begun, 1e-3)
            pace = f", {rate:.3g}/s, {timedelta(seconds=round((total - done) / rate))} left" if done else ""
            progress(f"{what}{pace}", done, total)

    return tell


def run_fleet(
    rows: Sequence[CatalogRow],
    output: Path,
    client: cluster.Client,
    identify: Identify,
    *,
    verify: bool = False,
    progress: Progress | None = None,
) -> FleetRun:
    """Identify new and changed joint sessions, and update the dataset in the folder `output`, which is `held`.

    `identify`, which can be pickled, identifies a joint of a file; with `verify` every input is hashed anew. Raises
    InputError where the workers cannot be used, or nothing is identified, and OSError where the output is full or the
    scheduler is lost. Finished tasks stay.
    """
    step(progress, "checking the workers")
    before = len(dataset.journalled(output))
    try:
        with cluster.told_where_lost(client):
            cluster.check_workers(client, versions())
        surveys = _survey(client, rows, output, progress, verify=verify)
        sessions = joint_sessions(rows, surveys)
        wanted = sessions[sessions["failure"] == ""].drop_duplicates("key").set_index("key")
        known = dataset.known_results(output, wanted.index)
        todo = wanted[~wanted.index.isin(known["key"])]
        failures = _identified(client, todo, surveys, output, identify, progress)
    except cluster.SchedulerLostError as error:
        stay = counted(len(dataset.journalled(output)) - before, "joint session")
        raise OSError(f"{error}; what is finished stays ({stay} of this run); run again to go on") from error

    step(progress, "writing the dataset")
    results = dataset.known_results(output, wanted.index)
    refused = set(results.loc[results["failure"].notna(), "key"])
    failed = sessions["key"].isin(list(failures))
    sessions.loc[failed, "failure"] = sessions.loc[failed, "key"].map(failures)
    unchanged = sessions["key"].isin(set(known["key"]) - refused).sum()
    table = dataset.assembled(sessions, results)
    lost = table["failure"].length() - table["failure"].null_count
    if lost == len(table):  # the old dataset stays
        file, reason = table["file"][0].as_py(), table["failure"][0].as_py()
        many = counted(len(table), "joint session")
        raise InputError(f"none of {many} could be identified; the first is {short(file)}: {reason}")
    dataset.write_dataset(output, table)
    return FleetRun(table, len(set(todo.index) - refused - set(failures)), int(unchanged), lost)


@contextmanager
def held(output: Path) -> Iterator[None]:
    """Mark the folder as bristle's and lock it for this run.

    Raises InputError where the folder is neither empty nor marked as bristle's, or another run writes there.
    """
    claim(output, FLEET)
    (output / TASKS).mkdir(exist_ok=True)
    # An existing lock file is neither emptied nor followed as a link.
    opened = os.open(output / LOCK, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o644)
    with os.fdopen(opened, "wb") as file:
        with suppress(ImportError):  # a system without advisory locks
            import fcntl

            try:
                fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise InputError(
                    f"{output}: another run writes there; wait until it has ended, or name another folder"
                ) from error
            except OSError:  # a file system without them
                pass
        yield


def _survey(
    client: cluster.Client, rows: Iterable[CatalogRow], output: Path, progress: Progress | None, *, verify: bool
) -> dict[str, Surveyed]:
    """The survey of each file of the catalog, by workers where it is not that of the last run."""
    last = dict[str, Surveyed]()
    with suppress(OSError, ValueError):
        version, kept = _LEDGER.validate_json((output / LEDGER).read_bytes())
        last = kept if version == __version__ and not verify else {}
    paths = list(dict.fromkeys(row.path for row in rows if not row.failure))
    tell, found = _telling(progress, "looking at files", len(paths)), dict[str, Surveyed]()
    for path in paths:
        if path in last and not last[path].failure and last[path].holds():
            found[path] = last[path]
            tell(len(found))
    calls = ((path, last[path].inputs if path in last else ()) for path in paths if path not in found)
    for (path, _), end in cluster.spread(client, "bristle-survey", survey, calls, _window(client)):
        found[path] = Surveyed(path, failure=_of_worker(end)) if isinstance(end, BaseException) else end
        tell(len(found))
    dataset.write_whole(output / LEDGER, _LEDGER.dump_json((__version__, {path: found[path] for path in paths})))
    return found


def _window(client: cluster.Client) -> int:
    return max(LEAST_WINDOW, WINDOW * cluster.threads_of(client))


def _of_worker(error: BaseException) -> str:
    """Why a task ended without a result."""
    from distributed import KilledWorker

    if isinstance(error, KilledWorker):
        return _MEMORY.format(times=counted(getattr(error, "allowed_failures", 3) + 1, "time"))
    return one_line(f"a defect of bristle: {type(error).__name__}: {error}")


def _identified(
    client: cluster.Client,
    todo: "pd.DataFrame",
    surveys: Mapping[str, Surveyed],
    output: Path,
    identify: Identify,
    progress: Progress | None,
) -> dict[str, str]:
    """Identify the joints of `todo` and journal their rows; why others are to be tried again, by key."""
    calls = (
        (FleetTask(str(key), joint, surveys[path], versions(), levels.changed()), identify)
        for key, path, joint in zip(todo.index, todo["path"], todo["name"], strict=True)
    )
    tell, failures = _telling(progress, "identifying", len(todo)), dict[str, str]()
    tell(0)
    ends = cluster.spread(client, "bristle-identify", identify_task, calls, _window(client))
    for done, ((task, _), end) in enumerate(ends, 1):
        how = TaskEnd(failure=_of_worker(end)) if isinstance(end, BaseException) else end
        if how.failure:
            failures[task.key] = how.failure
        else:
            dataset.journal(output, how.rows)
        tell(done)
    return failures
