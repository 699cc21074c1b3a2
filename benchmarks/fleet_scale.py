"""What a fleet costs: `python benchmarks/fleet_scale.py [logs] [rows] [scheduler]`, all three by default.

logs       40 robots of 2 joints in 4 sessions, identified from logs by one and by two worker processes, in turn, three times; the workers are
           warm, with one thread each; from the first task sent to the last result. Then again with nothing new, and with one new session.
rows       datasets of 1e4 and 1e5 joint sessions, simulated estimates: seconds, bytes, memory of the findings, size of the page.
scheduler  1e4 and 1e5 tasks that give such rows, through the cluster of this machine: seconds a task, memory of the process with the scheduler.
"""

import resource
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import TypeVar

import numpy as np
import pandas as pd
import psutil  # which distributed needs, too
import pyarrow as pa
from distributed import Client

import datasets_path  # noqa: F401
from bristle.api.fleets import fleet, identified_joint
from bristle.questions.fleet.catalog import read_catalog
from bristle.questions.fleet.cluster import local_client, spread
from bristle.questions.fleet.dataset import COLUMNS, journal, schema, write_dataset
from bristle.questions.fleet.findings import findings
from bristle.questions.fleet.report import report
from bristle.workers import pin
from simulated_fleet import FleetDesign, fleet_estimates, fleet_truth

T = TypeVar("T")
ROBOTS = {"1e4": 208, "1e5": 2083}
"""Of six joints and eight sessions each: 9984 and 99 984 joint sessions."""


@contextmanager
def cluster(workers: int, folder: Path) -> Iterator[Client]:
    """Worker processes of one thread each, which have identified a joint already."""
    with local_client(workers) as client:
        first = next(row for row in read_catalog(folder / "catalog.csv"))
        client.run(lambda: identified_joint(Path(first.path), "J1") and None)
        yield client


class Clock:
    """When the first task of a run was sent, and when the last result came."""

    def __init__(self) -> None:
        self.begun = self.ended = float("nan")

    def __call__(self, what: str, done: int, _: int) -> None:
        """Progress of a run."""
        if what.startswith("identifying"):
            if not done:
                self.begun = perf_counter()
            self.ended = perf_counter()

    @property
    def seconds(self) -> float:
        """From the one to the other."""
        return self.ended - self.begun


def contents(output: Path) -> dict[str, bytes]:
    """The files of a dataset."""
    return {path.name: path.read_bytes() for path in (output / "results").iterdir()}


def logs(folder: Path) -> None:
    """Print how fast logs are identified."""
    import make  # the script of datasets/fleet

    made = folder / "fleet"
    make.write_fleet(made, FleetDesign(robots=40, joints=2, sessions=4), 0)
    catalog = pd.read_csv(made / "catalog.csv")
    print(f"{len(catalog)} joint sessions from logs", flush=True)
    seconds: dict[int, list[float]] = {1: [], 2: []}
    datasets = []
    for k in range(3):
        for workers in (1, 2):
            output = folder / f"out-{workers}-{k}"
            with cluster(workers, made) as client:
                clock = Clock()
                fleet(made / "catalog.csv", output, client=client, progress=clock)
            seconds[workers].append(clock.seconds)
            datasets.append(contents(output))
            print(
                f"  {workers} worker(s): {clock.seconds:6.1f} s, {clock.seconds * workers / len(catalog):.3f} s a task",
                flush=True,
            )
    print(f"  two workers: {median(seconds[1]) / median(seconds[2]):.2f} times as fast as one (medians)")
    print(f"  the datasets of all six runs are the same bytes: {all(x == datasets[0] for x in datasets)}")
    again(made, folder, catalog)


def again(made: Path, folder: Path, catalog: pd.DataFrame) -> None:
    """A first run on a cold cluster, a second one with nothing new, and one with a new session of one robot."""
    last = catalog[(catalog["unit"] == "robot-040")].sort_values("session").tail(2)
    early = catalog.drop(last.index)
    early.to_csv(made / "early.csv", index=False)
    output = folder / "again"
    for what, name in (("first run", "early.csv"), ("nothing new", "early.csv"), ("a new session", "catalog.csv")):
        with local_client(2) as client:
            begun = perf_counter()
            found = fleet(made / name, output, client=client)
            found.write(output)
            print(
                f"  {what}, after the start of the cluster, page included: {perf_counter() - begun:6.2f} s; {found.counts}",
                flush=True,
            )


def timed(what: str, work: Callable[[], T]) -> T:
    """Print the seconds of a work; returns what it gives."""
    begun = perf_counter()
    made = work()
    print(f"  {what:<44} {perf_counter() - begun:7.2f} s", flush=True)
    return made


def frame_of(robots: int) -> pd.DataFrame:
    """A simulated dataset."""
    rng, design = np.random.default_rng(0), FleetDesign(robots=robots, swing=10.0)
    frame = fleet_estimates(design, fleet_truth(design, rng), rng)
    key = frame.groupby(["unit", "joint", "session"], observed=True).ngroup()
    return frame.assign(key=pd.Categorical([f"{k:032x}" for k in key]))


def rows(folder: Path) -> None:
    """Print what datasets cost; each size in a process of its own, whose peak memory is its own."""
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    for name in ROBOTS:
        with ProcessPoolExecutor(1, get_context("spawn")) as pool:
            pool.submit(rows_of, name, folder / name).result()


def rows_of(name: str, folder: Path) -> None:
    """Print what one dataset costs."""
    frame = frame_of(ROBOTS[name])
    table = pa.Table.from_pandas(frame[list(COLUMNS)], preserve_index=False).cast(schema())
    sessions = frame["key"].nunique()
    print(f"{name}: {sessions} joint sessions, {len(frame)} rows")
    timed("write the dataset", lambda: write_dataset(folder, table))
    size = sum(len(x) for x in contents(folder).values())
    print(f"  {size / 1e6:.1f} MB, {size / sessions:.0f} bytes a joint session")
    read = timed("pandas.read_parquet", lambda: pd.read_parquet(folder / "results"))
    before = peak()
    found = timed("findings", lambda: findings(read))
    print(f"  peak memory {before:.0f} MB before the findings, {peak():.0f} MB with them")
    timed("page and tables", lambda: report(found).write(folder / "page"))
    pages = " and ".join(f"{x.stat().st_size / 1e6:.2f}" for x in sorted((folder / "page").glob("*.html")))
    print(f"  pages {pages} MB, peak memory {peak():.0f} MB", flush=True)


def peak() -> float:
    """Largest memory of this process so far, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def synthetic(key: str) -> list[dict[str, object]]:
    """What a task does apart from identifying: eight rows."""
    return [{"key": key, "parameter": name, "direction": d, "value": 1.0} for d in "+-" for name in "abcd"]


def scheduler(folder: Path) -> None:
    """Print what tasks cost apart from the identification."""
    for name, robots in ROBOTS.items():
        count, output = robots * 48, folder / f"tasks-{name}"
        (output / "tasks").mkdir(parents=True)
        with local_client(2) as client:
            before, begun = memory(), perf_counter()
            calls = ((f"{k:032x}",) for k in range(count))
            for _, rows in spread(client, "synthetic", synthetic, calls, 200):
                journal(output, rows)
            seconds = perf_counter() - begun
            print(
                f"{name}: {count} tasks, {1e3 * seconds / count:.2f} ms each with two workers; client and scheduler {before:.0f} MB before, "
                f"{memory():.0f} MB after",
                flush=True,
            )
        shutil.rmtree(output)


def memory() -> float:
    """Memory of this process, MB."""
    return float(psutil.Process().memory_info().rss) / 2**20


PARTS = {"logs": logs, "rows": rows, "scheduler": scheduler}

if __name__ == "__main__":
    pin()
    with tempfile.TemporaryDirectory() as place:
        for part in sys.argv[1:] or PARTS:
            PARTS[part](Path(place))
