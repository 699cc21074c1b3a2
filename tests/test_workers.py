import os
import signal
import subprocess
import sys
import time
from functools import partial
from multiprocessing import active_children, forkserver
from pathlib import Path

import pytest

from bristle.progress import shown, step, teller
from bristle.workers import called, cores, sharing, threads

from .conftest import run, speeds, tree, write

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc, and sends signals")
REPORT = ("-m", "bristle", "report")


def running(parent: int) -> list[int]:
    parents = {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rpartition(")")[2].split()
        except OSError:  # it has ended meanwhile
            continue
        if fields[0] != "Z":
            parents[int(path.parent.name)] = int(fields[1])
    found = [parent] if parent in parents else []
    for known in found:  # grows as it goes
        found += [child for child, its in parents.items() if its == known]
    return found


def test_one_worker_is_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fewer than two workers are a plain map."""
    with sharing(1) as share:
        assert share is map
    # parts come back in their order, from other processes with one thread each; the environment is then as it was
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "7")
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    vars(forkserver)["_forkserver"]._stop()  # one that another test began has the environment of then
    with sharing(2, "bristle.model.law") as share:
        assert list(share(called, [partial(int, k) for k in range(20)])) == list(range(20))
        one = (os.getpid, threads, partial(os.getenv, "OMP_NUM_THREADS"), partial(os.getenv, "OPENBLAS_NUM_THREADS"))
        process, *told = share(called, [partial(part) for part in one])
        assert process != os.getpid()
        assert told == [1, "1", "7"]
    assert (os.environ.get("OMP_NUM_THREADS"), os.environ["OPENBLAS_NUM_THREADS"]) == (None, "7")
    assert threads() == cores() >= 1


def test_a_part_that_fails_or_is_killed_ends_the_others() -> None:
    """What a part raises reaches the caller, and no process is left, however long the others would take."""
    others = set(active_children())
    began = time.monotonic()
    with pytest.raises(ValueError, match="the second"), sharing(2) as share:
        list(share(called, [partial(int, "1"), partial(int, "the second"), *[partial(time.sleep, 60)] * 4]))
    assert time.monotonic() - began < 30
    assert set(active_children()) <= others
    # a process that the system ends is told as such, with what to do
    said = "a worker process was killed, perhaps for want of memory; take fewer --workers"
    with pytest.raises(OSError, match=said), sharing(2) as share:
        list(share(called, [partial(signal.raise_signal, signal.SIGKILL)] * 2))


@pytest.mark.usefixtures("raster")
@pytest.mark.slow
def test_the_bytes_do_not_depend_on_workers(tmp_path: Path) -> None:
    """A report by one process and by three is the same in every file."""
    two_joints = [write(tmp_path / "logs", speeds(), joint=name, stem=name) for name in ("wrist", "elbow")]
    one = run("report", *two_joints, "-o", tmp_path / "1", "--workers", 1)
    assert (one.code, one.err) == (0, "")
    three = subprocess.run(  # noqa: S603  # our own command
        [sys.executable, *REPORT, *two_joints, "-o", tmp_path / "3", "--workers", "3"],
        capture_output=True, text=True, check=False, cwd=tmp_path,
    )  # fmt: skip  # a call
    assert (three.returncode, three.stderr) == (0, "")
    assert tree(tmp_path / "1") == tree(tmp_path / "3")


@LINUX
@pytest.mark.parametrize("how", [signal.SIGINT, pytest.param(signal.SIGKILL, marks=pytest.mark.slow)])
def test_nothing_is_left_of_what_is_stopped(tmp_path: Path, how: signal.Signals) -> None:
    """Ctrl-C ends the workers too, with one word and nothing written; so does a signal that leaves no time to say it."""
    # What runs in the background ignores an interrupt, and so do its children.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    process = subprocess.Popen(  # noqa: S603  # our own command
        [sys.executable, *REPORT, "-o", "out", "--workers", "2"],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip  # a call
    signal.signal(signal.SIGINT, before)
    every: list[int] = []
    limit = time.monotonic() + 60
    while len(every) < 4 and time.monotonic() < limit:  # itself, what starts processes, and two of them
        time.sleep(0.2)
        every = running(process.pid)
    assert len(every) >= 4
    time.sleep(1)
    if how is signal.SIGINT:
        os.killpg(process.pid, how)  # as a terminal does
    else:
        process.send_signal(how)
    said = process.communicate(timeout=30)[1]
    if how is signal.SIGINT:
        # Python ends by the signal itself where it stood in an exec of a string.
        assert process.returncode in {130, -how}
        assert said == "interrupted\n"
    limit = time.monotonic() + 30
    while any(Path(f"/proc/{child}").exists() for child in every) and time.monotonic() < limit:
        time.sleep(0.2)
    assert not [child for child in every if Path(f"/proc/{child}").exists()]
    assert not list(tmp_path.iterdir())


def test_steps_are_counted_and_shown(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """A teller tells each step with how many are done; a step of unknown length is told as the only one; without a listener nothing is."""
    told: list[tuple[str, int, int]] = []
    tell = teller(lambda *what: told.append(what), 2)
    tell("a")
    tell("b")
    step(lambda *what: told.append(what), "c")
    step(None, "d")
    assert told == [("a", 0, 2), ("b", 1, 2), ("c", 0, 1)]
    # no terminal: silent; on one, a line from the start on, and then the name of each step
    for terminal in (False, True):
        monkeypatch.setattr("rich.console.Console.is_terminal", terminal)
        with shown() as progress:
            progress("identifying wrist", 0, 3)
        said = capsys.readouterr().err
        assert all((words in said) == terminal for words in ("starting", "identifying wrist (1 of 3)"))
