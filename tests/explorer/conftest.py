"""What the tests of the explorer share: the embedded set's page, that of a joint with hostile names, and a process of Node."""

import json
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import bristle
from bristle.questions.explorer.page import Explorer

from ..conftest import experiment, speeds, table

HOSTILE = "</script><img src=x onerror=\"document.title='run'\"><!-- {{ 7*7 }} \\u003c"
"""A joint's name that ends a script, loads an image and opens a comment."""
HOSTILE_FILE = "<img src=x onerror=document.title='run'>.csv"


class Explored(NamedTuple):
    """What was identified, and its page."""

    results: bristle.Results
    page: Explorer


@pytest.fixture(scope="session")
def edro(edro_results: Path) -> Explored:
    """The embedded set's, as its report has it."""
    results = bristle.read_results(edro_results)
    return Explored(results, bristle.explore(results))


@pytest.fixture(scope="session")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Explored:
    """A joint of points; its name, and that of its data file, are hostile."""
    folder = tmp_path_factory.mktemp("hostile")
    (folder / HOSTILE_FILE).write_text(table(speeds()), encoding="utf-8")
    path = folder / "wrist.yaml"
    path.write_text(experiment(joint=HOSTILE, data=HOSTILE_FILE), encoding="utf-8")
    results = bristle.identify(path)
    return Explored(results, bristle.explore(results))


HARNESS = """
const kept = (names, x) => (names.length ? Object.fromEntries(names.map((name) => [name, x[name]])) : x);
const answer = ({ module, keep, calls }) =>
  Promise.all(calls.map(async ([name, ...rest]) => kept(keep, await require(module)[name](...rest))));
const plain = (key, x) =>
  typeof x === "number" && !Number.isFinite(x) ? String(x) : ArrayBuffer.isView(x) ? Array.from(x) : x;
require("readline").createInterface({ input: process.stdin }).on("line", async (line) => {
  process.stdout.write(JSON.stringify(await answer(JSON.parse(line)), plain) + "\\n");
});
"""


class Node:
    """One Node process, which calls functions of modules."""

    def __init__(self, program: str, folder: Path) -> None:
        self._folder = folder
        pipe = subprocess.PIPE
        self._process = subprocess.Popen([program, "-e", HARNESS], stdin=pipe, stdout=pipe, text=True)  # noqa: S603  # ours

    def module(self, text: str) -> str:
        """A module of this text; its path."""
        path = self._folder / f"module{len(list(self._folder.iterdir()))}.js"
        path.write_text(text, encoding="utf-8")
        return str(path)

    def call(self, module: str, calls: Sequence[Sequence[object]], keep: Sequence[str] = ()) -> list[Any]:
        """What these calls of a module's functions, (name, *arguments), return; of an object only these keys, if any."""
        assert self._process.stdin
        assert self._process.stdout
        request = {"module": module, "keep": keep, "calls": calls}
        self._process.stdin.write(json.dumps(request, default=np.ndarray.tolist) + "\n")
        self._process.stdin.flush()
        answers: list[Any] = json.loads(self._process.stdout.readline())
        return answers

    def close(self) -> None:
        self._process.communicate()


@pytest.fixture(scope="session")
def node(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Node]:
    program = shutil.which("node")
    if program is None:
        pytest.skip("needs Node: no `node` is on the path")
    one = Node(program, tmp_path_factory.mktemp("node"))
    yield one
    one.close()
