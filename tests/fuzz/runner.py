"""Cases run by `server`, drawn from one seed until there are enough or time is up, and what must hold of any, whatever is in it."""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

from hypothesis import HealthCheck, given, seed, settings

from ..conftest import present
from ..pages import Elements, page_text
from .inputs import Case, cases
from .server import BYTES, SECONDS

ROOT = Path(__file__).parents[2]
LONGEST = 600  # characters of a sentence at the most


@dataclass
class Server:
    """The process that runs cases, and what it has seen."""

    process: subprocess.Popen[str]
    folder: Path
    results: str
    """A results file of its own joint."""
    codes: Counter[int] = field(default_factory=Counter)
    slowest: float = 0.0
    largest: float = 0.0

    @property
    def runs(self) -> int:
        return sum(self.codes.values())

    def check(self, case: Case) -> None:
        """Run a case; AssertionError where something does not hold of it."""
        folder = self.folder / "case"
        for path in self.folder.glob("case*"):
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        folder.mkdir()
        for name, data in case.files.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(data)
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps({"folder": str(folder), "arguments": case.arguments}) + "\n")
        self.process.stdin.flush()
        answer = json.loads(present(self.process.stdout).readline())
        self.codes[answer["code"]] += 1
        self.slowest, self.largest = max(self.slowest, answer["seconds"]), max(self.largest, answer["bytes"])
        _hold(case, folder, answer)

    def __str__(self) -> str:
        codes = ", ".join(f"{code}: {count}" for code, count in sorted(self.codes.items()))
        return f"{self.runs} inputs; exit codes {codes}; slowest {self.slowest:.1f} s, largest {self.largest / 2**20:.0f} MiB"


@contextmanager
def server() -> Iterator[Server]:
    """A server, and a folder of its own, which are gone afterwards."""
    # A forked command ends without what Python does at exit, so that the tracker of its own workers would complain.
    threads = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "ARROW_NUM_THREADS": "1"}
    threads |= {"PYTHONWARNINGS": "ignore:resource_tracker:UserWarning"}
    command = [sys.executable, "-m", "tests.fuzz.server"]
    with (
        tempfile.TemporaryDirectory(prefix="bristle-fuzz-") as folder,
        subprocess.Popen(  # noqa: S603  # our own command
            command, cwd=ROOT, env=os.environ | threads, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        ) as process,
    ):
        try:
            yield Server(process, Path(folder), json.loads(present(process.stdout).readline()))
        finally:
            process.terminate()


class OutOfTimeError(BaseException):
    """Ends the drawing of cases, which takes long, where none is tried any more; it is no failure that Hypothesis would make small."""


def fuzz(running: Server, end: float, *, first: int, least: int) -> None:
    """Try at most 400 cases of one seed, until `end` (by time.monotonic) and at least so many; Hypothesis makes small what fails."""
    failed = False

    @seed(first)
    @settings(max_examples=400, deadline=None, database=None, suppress_health_check=list(HealthCheck))
    @given(cases(running.results))
    def tried(case: Case) -> None:
        nonlocal failed
        # what failed is made small even when time is up
        if not failed and time.monotonic() >= end and running.runs >= least:
            raise OutOfTimeError
        try:
            running.check(case)
        except AssertionError:
            failed = True
            raise

    with suppress(OutOfTimeError):
        tried()


def _hold(case: Case, folder: Path, answer: Mapping[str, float]) -> None:
    err = Path(f"{folder}.err").read_text(encoding="utf-8", errors="replace")
    code, made = answer["code"], {p.name for p in folder.iterdir()} - {name.partition("/")[0] for name in case.files}
    assert code in {0, 2, 3}, f"exit code {code}: {err[-3000:]}"
    assert answer["seconds"] <= SECONDS, f"{answer['seconds']:.1f} s"
    assert answer["bytes"] <= BYTES, f"{answer['bytes'] / 2**20:.0f} MiB"
    assert "Traceback" not in err, err[-3000:]
    assert "Warning" not in err, err[-3000:]
    for name, data in case.files.items():
        assert (folder / name).read_bytes() == data, f"{name} was changed"
    if code == 2:
        sentences = [line for line in err.splitlines() if line.strip()]
        assert len(sentences) == 1, err[-3000:]
        assert sentences[0].startswith("bristle: "), err
        assert len(sentences[0]) <= LONGEST, err
        assert not made, f"left behind: {made}"
    elif (
        "-o" in case.arguments and case.arguments[0] != "validate"
    ):  # which makes no page where there is nothing to simulate
        assert made == {case.arguments[case.arguments.index("-o") + 1]}, made
    for path in (folder / "out").glob("*.html"):
        if path.stem != "explore":  # which has scripts, and tests of its own for what is hostile
            page = Elements(page_text(path))
            assert not page.runs | page.tags & {"object", "embed"}
            assert [x for x, count in Counter(page.ids).items() if count > 1] == []
