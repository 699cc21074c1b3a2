"""Progress on a terminal: from the first two seconds, by name of the step; elsewhere nothing."""

import os
import pty
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

import bristle
from bristle.progress import shown, step, teller

from .conftest import experiment, speeds, table


def on_terminal(*arguments: object, folder: Path) -> tuple[float, str]:
    """What a command prints on a terminal, and seconds from its start to the first letter."""
    leader, follower = pty.openpty()
    command = [sys.executable, "-c", "from bristle.__main__ import main; main()", *map(str, arguments)]
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "80"}
    begun, first, text = time.perf_counter(), float("inf"), b""
    process = subprocess.Popen(command, cwd=folder, env=environment, stdin=follower, stdout=follower, stderr=follower)  # noqa: S603
    os.close(follower)
    while True:
        try:
            part = os.read(leader, 65536)
        except OSError:  # the other end is closed
            break
        if not part:
            break
        if re.search(rb"[a-z]{3}", part):
            first = min(first, time.perf_counter() - begun)
        text += part
    os.close(leader)
    assert process.wait() == 0
    return first, text.decode()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """An experiment of points that can be fitted."""
    (tmp_path / "e.yaml").write_text(experiment(), encoding="utf-8")
    (tmp_path / "data.csv").write_text(table(speeds()), encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize(
    ("command", "steps"),
    [
        (("identify", "e.yaml"), ("starting", "identifying wrist", "fitting friction vs velocity")),
        pytest.param(
            ("new", "data.csv", "-o", "n.yaml"), ("starting", "regressors and directions"), marks=pytest.mark.slow
        ),
    ],
)
def test_a_terminal_shows_the_step(folder: Path, command: tuple[str, ...], steps: tuple[str, ...]) -> None:
    """Within seconds of the start a line stands on the terminal, before the libraries are read, and then the name of each step."""
    first, text = on_terminal(*command, folder=folder)
    assert first < 10  # two, on a machine that does nothing else
    assert text.index("starting") < 200
    assert [name for name in steps if name in text] == list(steps)


def test_steps_are_counted(folder: Path) -> None:
    """A teller tells each step with how many are done; a step of unknown length is told as the only one; without a listener nothing is.

    A draft tells its last step, which takes longest.
    """
    told: list[tuple[str, int, int]] = []
    tell = teller(lambda *what: told.append(what), 2)
    tell("a")
    tell("b")
    step(lambda *what: told.append(what), "c")
    step(None, "d")
    assert told == [("a", 0, 2), ("b", 1, 2), ("c", 0, 1)]
    with shown() as progress:  # no terminal: silent
        progress("e", 0, 3)
    bristle.draft(folder / "data.csv", progress=lambda *what: told.append(what))
    assert told[-1][0] == "regressors and directions"
