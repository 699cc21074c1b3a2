"""A run of a fleet on Dask: new and changed joint sessions are identified, and the dataset of the output is updated.

The rows of each finished task stay in the output, however the run ends, and the next run continues from them.
"""

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from datetime import timedelta
from time import monotonic
from typing import TYPE_CHECKING, NamedTuple

from bristle.errors import InputError, one_line, short
from bristle.page.output_folder import FLEET, LEDGER, LOCK, MARKER, TASKS
from bristle.page.wording import counted
from bristle.progress import Progress, step
from bristle.questions.fleet import cluster, dataset, files
from bristle.questions.fleet.catalog import CatalogRow
from bristle.questions.fleet.sessions import joint_sessions
from bristle.questions.fleet.survey import Surveyed, surveyed_of
from bristle.questions.fleet.tasks import FleetTask, Identify, TaskEnd, identify_task, survey_files, versions

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

BATCH = 50  # files per task of the survey
LEAST_WINDOW, WINDOW = 200, 20  # least tasks under way, and tasks per thread
SENT_WINDOW = 2  # tasks per thread where logs are sent with them
_MEMORY = "its worker died {times}, perhaps for want of memory; give each worker more with --memory"


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
    output: str,
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
    import pyarrow as pa
    import pyarrow.compute as pc

    step(progress, "checking the workers")
    written = dataset.task_keys(output)
    try:
        with cluster.told_where_lost(client):
            cluster.check_workers(client)
            # Workers reach the inputs if they read the first file of each file system.
            samples: dict[str, str] = {}
            for row in rows:
                system = row.path.partition("://")[0] if files.is_remote(row.path) else ""
                if system not in samples and not row.failure:
                    with suppress(OSError, InputError):
                        if files.exists(row.path):
                            samples[system] = row.path
            reached = cluster.reached(client, list(samples.values()))
        surveys = _survey(client, rows, output, progress, verify=verify, reached=reached)
        rows_of_files = [{"path": path, "found": surveys[path].written()} for path in sorted(surveys)]
        ledger = pa.Table.from_pylist(rows_of_files, schema=pa.schema({"path": pa.string(), "found": pa.string()}))
        data = dataset.parquet_of(ledger, compression="zstd", use_dictionary=False)
        files.write_whole(files.joined_path(output, LEDGER), data)
        sessions, known = joint_sessions(rows, surveys), dataset.known_results(output)
        good = sessions[sessions["failure"] == ""]
        wanted = good.drop_duplicates("key").set_index("key")
        cached = set(known["key"].to_pylist()) & set(wanted.index)
        todo = wanted[~wanted.index.isin(list(cached | written))]
        identified, untold = _identified(client, todo, surveys, output, identify, progress, sent=not reached)
    except cluster.SchedulerLostError as error:
        stay = len(dataset.task_keys(output) - written)
        raise OSError(
            f"{error}; what is finished stays ({counted(stay, 'joint session')} of this run); run again to go on"
        ) from error

    step(progress, "writing the dataset")
    read, damaged = dataset.read_tasks(output, set(wanted.index) - cached - set(untold))
    failures = untold | dict.fromkeys(damaged, "its rows in the output are damaged; run again")
    for key in damaged:
        files.remove(dataset.task_file(output, key))
    failed = sessions["key"].isin(list(failures)) & (sessions["failure"] == "")
    sessions.loc[failed, "failure"] = sessions.loc[failed, "key"].map(failures)
    sessions.loc[sessions["failure"] != "", "key"] = ""

    # The files of tasks are removed once the dataset is written. Where nothing is identified, the old dataset stays.
    table = dataset.assembled(sessions, pa.concat_tables([known.cast(read.schema), read]))
    ended = [dataset.task_file(output, key) for key in dataset.task_keys(output)]
    some = table["failure"].null_count > 0
    if some:
        dataset.write_dataset(output, table)
    for path in ended:
        files.remove(path)
    if not some:
        file, reason = table["file"][0].as_py(), table["failure"][0].as_py()
        many = counted(len(table), "joint session")
        raise InputError(f"none of {many} could be identified; the first is {short(file)}: {reason}")

    refused = set(table.filter(pc.is_valid(table["failure"]))["key"].to_pylist())
    unchanged = int(good["key"].isin(list((cached | written) - refused)).sum())
    lost = table["failure"].length() - table["failure"].null_count
    return FleetRun(table, len(identified - refused - damaged), unchanged, lost)


@contextmanager
def held(output: str) -> Iterator[None]:
    """Mark the folder as bristle's and lock it for this run; a refused run without results restores a new folder.

    Raises InputError where the folder is neither empty nor marked as bristle's, or another run writes there.
    """
    folder = None if files.is_remote(output) else files.local_path(output)
    absent = folder is not None and not folder.exists()
    new = absent or (folder is not None and folder.is_dir() and not any(folder.iterdir()))
    files.claim_folder(output, FLEET)
    files.make_folder(files.joined_path(output, TASKS))
    if folder is None:
        yield
        return
    # An existing lock file is neither emptied nor followed as a link.
    flags = os.O_RDWR | getattr(os, "O_NOFOLLOW", 0)
    try:
        opened = os.open(folder / LOCK, flags | os.O_CREAT | os.O_EXCL, 0o644)
    except FileExistsError:
        opened = os.open(folder / LOCK, flags)
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
        try:
            yield
        except InputError:
            if new and not dataset.task_keys(output) and not (folder / dataset.DATASET).exists():
                for name in (LEDGER, LOCK, MARKER):
                    (folder / name).unlink(missing_ok=True)
                with suppress(OSError):
                    (folder / TASKS).rmdir()
                    if absent:
                        folder.rmdir()
            raise


def _survey(
    client: cluster.Client,
    rows: Iterable[CatalogRow],
    output: str,
    progress: Progress | None,
    *,
    verify: bool,
    reached: bool,
) -> dict[str, Surveyed]:
    """The survey of each file of the catalog, on the workers if they reach the inputs."""
    import pyarrow as pa

    # The last run's survey of each file, if its ledger can be read.
    ledger: dict[str, str] = {}
    with suppress(OSError, pa.ArrowException, ValueError, KeyError):
        table = dataset.read_parquet(files.joined_path(output, LEDGER), columns=["path", "found"])
        ledger = dict(zip(table["path"].to_pylist(), table["found"].to_pylist(), strict=True))
    paths = list(dict.fromkeys(row.path for row in rows if not row.failure))
    tell, found = _telling(progress, "looking at files", len(paths)), dict[str, Surveyed]()
    batches = [[(path, ledger.get(path)) for path in paths[k : k + BATCH]] for k in range(0, len(paths), BATCH)]
    if reached:
        calls, window = ((batch, verify) for batch in batches), 4 * cluster.threads_of(client)
        ends = ((call[0], end) for call, end in cluster.spread(client, "bristle-survey", survey_files, calls, window))
    else:
        ends = ((batch, survey_files(batch, verify)) for batch in batches)
    for batch, end in ends:
        for k, (path, _) in enumerate(batch):
            failed = Surveyed(path, failure=_of_worker(end)) if isinstance(end, BaseException) else None
            found[path] = failed or surveyed_of(end[k]) or Surveyed(path, failure="its worker has another version")
        tell(len(found))
    return found


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
    output: str,
    identify: Identify,
    progress: Progress | None,
    *,
    sent: bool,
) -> tuple[set[str], dict[str, str]]:
    """Identify the joints of `todo` and write their rows; returns keys done, and failures to retry."""

    def calls() -> Iterator[tuple[FleetTask, Identify]]:
        for key, path, joint in zip(todo.index, todo["path"], todo["name"], strict=True):
            one, logs = surveys[path], None
            if sent:
                with suppress(OSError):  # the worker reports what is missing
                    logs = {x.name: files.read_bytes(x.path) for x in one.inputs}
            yield FleetTask(str(key), joint, one, logs, versions()), identify

    threads = cluster.threads_of(client)
    window = SENT_WINDOW * threads if sent else max(LEAST_WINDOW, WINDOW * threads)
    tell, identified, failures = _telling(progress, "identifying", len(todo)), set[str](), dict[str, str]()
    tell(0)
    ends = cluster.spread(client, "bristle-identify", identify_task, calls(), window)
    for done, ((task, _), end) in enumerate(ends, 1):
        key = task.key
        how = TaskEnd(_of_worker(end)) if isinstance(end, BaseException) else end
        if how.refused:
            raise InputError(how.refused)
        if how.rows is not None:
            files.write_whole(dataset.task_file(output, key), how.rows)
        if how.failure:
            failures[key] = how.failure
        else:
            identified.add(key)
        tell(done)
    return identified, failures
