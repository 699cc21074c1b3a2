import logging
import operator
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from tests.conftest import tree
from tests.fleet.logs import write_fleet_logs

import bristle
from bristle.api import fleets
from bristle.errors import InputError
from bristle.questions.fleet import cluster, dataset, engine
from bristle.questions.fleet.catalog import read_catalog
from bristle.questions.fleet.cluster import local_client

pytest.importorskip("distributed", reason="needs the extra fleet")
pytest.importorskip("pyarrow", reason="needs the extra fleet")
LINUX = pytest.mark.skipif(sys.platform != "linux", reason="sends signals")
Tree = dict[str, bytes | None]
ENOUGH = 120.0  # seconds after which a process is stuck


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a fleet of two units, two joints and two sessions."""
    folder: Path = tmp_path_factory.mktemp("fleet")
    write_fleet_logs(folder, units=2, sessions=2)
    return folder


@pytest.fixture(scope="module")
def alone(logs: Path, client: Any) -> Tree:
    done = bristle.fleet(logs / "catalog.csv", logs / "alone", client=client)
    assert done.identified == 8
    return tree(logs / "alone" / "results")


def test_calls_sizes_and_schedulers(client: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the scheduler waits for a worker that does not come, as for one that died with what it held, the others end and so does that call."""
    monkeypatch.setattr(cluster, "_WAIT", 1.0)
    submit, asked = client.submit, list[int]()

    def astray(function: Any, number: int, **options: Any) -> Any:
        asked.append(number)
        where = {"workers": ["tcp://127.0.0.1:1"]} if len(asked) == 1 else {}
        return submit(function, number, **options, **where)

    monkeypatch.setattr(client, "submit", astray)
    calls = [(k,) for k in range(4)]
    assert sorted(x for _, x in cluster.spread(client, "negative", operator.neg, calls, 3)) == [-3, -2, -1, 0]
    assert asked.count(0) == 2
    monkeypatch.undo()
    # certificates make the connection one of TLS alone
    security = cluster._security({"ca": "a.pem", "cert": "b.pem", "key": "c.pem"})
    assert security.require_encryption
    assert (security.tls_ca_file, security.tls_client_cert, security.tls_client_key) == ("a.pem", "b.pem", "c.pem")
    assert cluster._security({}) is None
    # inside `quiet` no logger of Dask, Tornado or Bokeh says anything, whatever level it had; afterwards each has that level again
    names = "distributed distributed.client distributed.comm.tcp tornado.application tornado.general bokeh"
    loggers = [logging.getLogger(name) for name in names.split()]
    before = [one.level for one in loggers]
    with cluster.quiet():
        assert not any(one.isEnabledFor(logging.CRITICAL) for one in loggers)
        assert logging.getLogger("bristle").isEnabledFor(logging.CRITICAL)
    assert [one.level for one in loggers] == before
    # a port that takes the call and never answers ends in one sentence, in time
    monkeypatch.setattr(cluster, "_WAIT", 4.0)
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        one.listen()
        address = f"tcp://127.0.0.1:{one.getsockname()[1]}"
        with pytest.raises(InputError, match="no Dask scheduler answers"), cluster.remote_client(address):
            pass


@contextmanager
def process(*arguments: str, **options: Any) -> Iterator["subprocess.Popen[str]"]:
    with subprocess.Popen([sys.executable, *arguments], text=True, **options) as one:  # noqa: S603  # ourselves
        try:
            yield one
        finally:
            one.kill()


def until(what: Callable[[], bool]) -> None:
    end = time.monotonic() + ENOUGH
    while not what():
        assert time.monotonic() < end
        time.sleep(0.05)


@contextmanager
def separate(folder: Path) -> Iterator[tuple[str, Any, list[Any]]]:
    """A scheduler and two workers, each a process of its own, on loopback."""
    silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    told = ("--scheduler-file", str(folder / "scheduler.json"))
    local = ("--host", "127.0.0.1", "--port", "0", "--no-dashboard")
    options = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory", str(folder))
    with ExitStack() as stack:

        def begun(what: str, *more: str) -> Any:
            return stack.enter_context(process("-m", f"distributed.cli.dask_{what}", *told, *more, **silent))

        scheduler = begun("scheduler", *local)
        until(Path(told[1]).exists)
        workers = [begun("worker", *options) for _ in range(2)]
        yield str(pd.read_json(told[1], typ="series")["address"]), scheduler, workers


def finished(output: Path) -> int:
    return len(dataset.journalled(output))


@LINUX
def test_what_is_killed_half_way_loses_nothing(logs: Path, alone: Tree, tmp_path: Path, client: Any) -> None:
    """A worker killed half-way: the same result. The scheduler: exit 2, what is finished stays, and a rerun goes on to the same result."""
    # another client, of which no task had begun, is told the same, with nothing finished

    def killed(one: Any, output: Path) -> tuple[int, str]:
        """How a run ends of which this process is killed half-way, and what it says."""
        command = ("-m", "bristle", "fleet", "catalog.csv", "-o", str(output), "--scheduler", address)
        with process(*command, cwd=logs, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as run:
            until(lambda: finished(output) > 1 or run.poll() is not None)
            one.kill()
            _, said = run.communicate(timeout=ENOUGH)
            return run.returncode, said

    out = tmp_path / "out"
    with separate(tmp_path) as (address, scheduler, workers):
        assert killed(workers[0], tmp_path / "first") == (0, "")
        assert tree(tmp_path / "first" / "results") == alone
        with cluster.remote_client(address) as idle:
            code, said = killed(scheduler, out)
            until(lambda: idle.status != "running")
            lost = r"the scheduler .*was lost; what is finished stays \(0 joint sessions of this run\)"
            with pytest.raises(OSError, match=lost):
                bristle.fleet(logs / "catalog.csv", tmp_path / "none", client=idle)
    assert code == 2
    assert said.startswith(f"bristle: the scheduler {address} was lost; ")
    assert re.search(r"what is finished stays \([1-7] joint sessions? of this run\); run again to go on\n$", said)
    again = bristle.fleet(logs / "catalog.csv", out, client=client)
    assert again.identified < 8
    assert again.identified + again.unchanged == 8
    assert tree(out / "results") == alone


@LINUX
def test_an_interrupt_leaves_what_is_finished(logs: Path, tmp_path: Path) -> None:
    """Ctrl-C, which all processes of a terminal get: exit 130 and one word; finished tasks stay, and no process is left."""
    out, rows = tmp_path / "out", pd.read_csv(logs / "catalog.csv")
    long = pd.concat([rows.assign(unit=rows["unit"] + f"-{k}") for k in range(20)])
    long.to_csv(logs / "long.csv", index=False)  # the run must not end by itself before the signal
    command = ("-m", "bristle", "fleet", "long.csv", "-o", str(out), "--workers", "2")
    with process(*command, cwd=logs, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True) as run:
        until(lambda: finished(out) > 0 or run.poll() is not None)
        os.killpg(run.pid, signal.SIGINT)
        _, said = run.communicate(timeout=ENOUGH)
    assert (run.returncode, said) == (130, "interrupted\n")
    assert finished(out) > 0
    assert not (out / "results").exists()
    until(lambda: not alive(run.pid))


def alive(group: int) -> bool:
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


@LINUX
def test_a_script_without_a_guard_says_so(logs: Path, tmp_path: Path) -> None:
    """A script that calls `bristle.fleet` at its top ends with a sentence that says what to write, and nothing is identified."""
    script = tmp_path / "watch.py"
    script.write_text(
        f"import bristle\nbristle.fleet({str(logs / 'catalog.csv')!r}, {str(tmp_path / 'out')!r}, workers=1)\n",
        encoding="utf-8",
    )
    ended = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=ENOUGH, check=False)  # noqa: S603  # ours
    assert ended.returncode
    last = ended.stderr.strip().splitlines()[-1]
    assert last.startswith("bristle.errors.InputError: the worker processes did not start")
    assert 'if __name__ == "__main__"' in last


@pytest.fixture(scope="module")
def two() -> Iterator[Any]:
    """A cluster of two processes of this machine, which gives a call up once two workers died of it."""
    with local_client(2) as client:
        client.cluster.scheduler.allowed_failures = 1
        yield client


def test_processes_make_the_same_bytes(logs: Path, alone: Tree, two: Any) -> None:
    """Two processes make the bytes of threads."""
    assert "127.0.0.1" in cluster.dashboard_of(two)
    assert two.scheduler.address.startswith("tcp://127.0.0.1:")
    assert cluster.threads_of(two) == 2
    bristle.fleet(logs / "catalog.csv", logs / "two", client=two)
    assert tree(logs / "two" / "results") == alone


def test_a_worker_that_dies_of_one_log_is_a_failure_of_that_log(logs: Path, two: Any, tmp_path: Path) -> None:
    """Where a log ends its worker's process each time it is tried, its row says so, and it is tried again in the next run."""

    def deadly(path: Path, joint: str) -> Any:  # sent by value
        import os

        from bristle.api.fleets import identified_joint

        if "r0/2026-01-01/elbow" in str(path):
            os._exit(1)
        return identified_joint(path, joint)

    rows = read_catalog(logs / "catalog.csv")[:4]
    with cluster.quiet(), engine.held(tmp_path / "out"):
        ended = engine.run_fleet(rows, tmp_path / "out", two, deadly)
        again = engine.run_fleet(rows, tmp_path / "out", two, fleets.identified_joint)
    (failure,) = ended.table.to_pandas()["failure"].dropna()
    assert failure == "its worker died 2 times, perhaps for want of memory; give each worker more with --memory"
    assert (ended.identified, ended.failed, again.identified, again.failed) == (3, 1, 1, 0)
