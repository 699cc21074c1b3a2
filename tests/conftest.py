"""Small experiments of velocity-torque points, and the command line run in this process."""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):  # as many workers as cores, a thread each
    os.environ.setdefault(_name, "1")

import contextlib
import gc
import io
import json
import shutil
import signal
import sys
import time
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, TypeVar
from xml.etree import ElementTree

import numpy as np
import pytest
import typer.main
from hypothesis import settings
from matplotlib.figure import Figure

import bristle
from bristle.__main__ import main
from bristle.arrays import Array
from bristle.model.parameters import Lugre
from bristle.page import page, style
from bristle.questions.compensation import ablation, experiments
from bristle.questions.experiment_design import excitation
from bristle.simulation.bench import steady_points

signal.signal(signal.SIGINT, signal.default_int_handler)  # which a run in the background ignores, with all it starts
settings.register_profile("repeatable", deadline=None, max_examples=50, derandomize=True, database=None)
settings.load_profile("repeatable")

TRUTH = Lugre(0.0194, 0.0055, 0.0394, 0.0720, 6.1843, 0.0184)  # Gripper rotation (+) of Table 1
FEW = np.array([0.1, 0.2, -0.1, -0.2])
"""Speeds, rad/s, too few for any fit: read, refused to be fitted, and reported at once."""


T = TypeVar("T")


def present(value: T | None) -> T:
    assert value is not None
    return value


SLOW = pytest.StashKey[tuple[int, int]]()  # how many of the tests that were collected are slow, and how many there are
SKIPPED = pytest.StashKey[set[tuple[str, str]]]()
"""Module and name of each test that another run skipped; without a name the whole module."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """What `.ci/run` asks for once every extra is installed."""
    parser.addoption(
        "--after", metavar="XML", help="run the slow tests, then those that this junit report of a run skipped"
    )


def pytest_configure(config: pytest.Config) -> None:
    """Read what another run skipped: tests, and whole modules, which have no class there."""
    if before := config.getoption("--after"):
        cases = ElementTree.parse(before).iter("testcase")  # noqa: S314  # ours
        left = [(case.get("classname", ""), case.get("name", "")) for case in cases if case.find("skipped") is not None]
        config.stash[SKIPPED] = {(of, name) if of else (name, "") for of, name in left}


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """After another run, a file that holds no slow test, nor one that skipped there, is not imported, which takes long."""
    skipped = config.stash.get(SKIPPED, None)
    if skipped is None or not collection_path.match("test_*.py"):
        return None
    of = ".".join(collection_path.relative_to(config.rootpath).with_suffix("").parts)
    return None if of in {of for of, _ in skipped} or "mark.slow" in collection_path.read_text("utf-8") else True


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Count them before any is left out; after another run, keep what that one left: the slow ones first, which no worker then waits for."""
    slow = [item for item in items if item.get_closest_marker("slow") is not None]
    config.stash[SLOW] = len(slow), len(items)
    if (skipped := config.stash.get(SKIPPED, None)) is not None:

        def is_left(item: pytest.Item) -> bool:
            of = item.nodeid.partition("::")[0].removesuffix(".py").replace("/", ".")
            return not skipped.isdisjoint({(of, ""), (of, item.name)})

        items[:] = slow + [item for item in items if item not in slow and is_left(item)]


def pytest_collection_finish() -> None:
    """What is loaded by now stays: the garbage collector need not look through it again, which is a tenth of all work."""
    gc.collect()
    gc.freeze()


@pytest.fixture(autouse=True)
def _stays_in_its_directory() -> Iterator[None]:
    """A test that leaves the process in another directory fails itself, not those that come after it."""
    here = Path.cwd()
    yield
    try:
        assert Path.cwd() == here
    finally:
        os.chdir(here)


class Ran(NamedTuple):
    """How a command ended, and what it said."""

    code: int
    out: str
    err: str

    @property
    def said(self) -> list[str]:
        return [line for line in self.err.splitlines() if line.strip()]

    @property
    def words(self) -> str:
        """Standard output in one line, wherever its lines were broken."""
        return " ".join(self.out.split())


COMMAND = cache(typer.main.get_command)  # what Typer makes of its commands, once for all that run in this process


def run(*arguments: object, stdout: io.StringIO | None = None) -> Ran:
    """Run `bristle` with these arguments in this process, with a standard output of one's own if need be."""
    out, err = stdout or io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        patch.setattr(sys, "argv", ["bristle", *map(str, arguments)])
        patch.setattr("bristle.cli.cores", lambda: 1)  # tests share the cores among themselves
        patch.setattr("typer.main.get_command", COMMAND)
        with pytest.raises(SystemExit) as stop:
            main()
    assert isinstance(stop.value.code, int)
    return Ran(stop.value.code, out.getvalue(), err.getvalue())


def speeds(*, both: bool = True) -> Array:
    """A design that sees the Stribeck region, rad/s."""
    v = np.geomspace(0.2 * TRUTH.v_s, 0.8, 20)
    return np.concatenate([v, -v]) if both else v


def table(velocity: Array, noise: float = 2e-5) -> str:
    """Steady torques of `TRUTH` at some velocities, with noise, as CSV."""
    (torque,) = steady_points(TRUTH, velocity, noise, np.random.default_rng(0), 1)
    return "v,tau\n" + "".join(f"{v!r},{t!r}\n" for v, t in zip(velocity.tolist(), torque.tolist(), strict=True))


def experiment(*, joint: str = "wrist", data: str = "data.csv") -> str:
    return (
        f"joint: {{name: {json.dumps(joint)}}}\n"
        "signals:\n  velocity: {column: v, unit: rad/s}\n  torque: {column: tau, unit: N*m}\n"
        f"runs:\n  - {{files: {json.dumps(data)}, experiment: points}}\n"
    )


def write(folder: Path, velocity: Array, *, joint: str = "wrist", stem: str = "wrist") -> Path:
    """An experiment of points and its data in a folder; returns the experiment file."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{stem}.csv").write_text(table(velocity), encoding="utf-8")
    path = folder / f"{stem}.yaml"
    path.write_text(experiment(joint=joint, data=f"{stem}.csv"), encoding="utf-8")
    return path


def tree(folder: Path) -> dict[str, bytes | None]:
    """Everything below a folder, hidden files too: bytes of each file, None for each folder or pipe."""
    return {
        p.relative_to(folder).as_posix(): p.read_bytes() if p.is_file() else None for p in sorted(folder.rglob("*"))
    }


@contextlib.contextmanager
def few_motions_tried(steps: int = 12) -> Iterator[None]:
    """Plans try few motions, which is most of their time: for what holds of a plan whatever the number."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(excitation, "TRIES", 3)
        patch.setattr(excitation, "STEPS", steps)
        yield


@pytest.fixture
def few_motions() -> Iterator[None]:
    """Plans of this test try few motions."""
    with few_motions_tried():
        yield


@pytest.fixture(scope="session", autouse=True)
def vector_alone() -> Iterator[None]:
    """The figures of pages are drawn once, as SVG: a PNG takes as long, and the tests that look at it call `render` themselves."""
    with pytest.MonkeyPatch.context() as patch:
        blank = style.render_as(Figure(figsize=(0.1, 0.1)), "png")
        patch.setattr(page, "render", lambda figure: (style.render_as(figure, "svg"), blank))
        yield


@pytest.fixture(scope="session")
def edro_report(tmp_path_factory: pytest.TempPathFactory, vector_alone: None) -> Path:  # noqa: ARG001  # figures drawn once
    """The report of the embedded joints, which the first worker that asks writes for all; what was told of its progress lies beside it."""
    base = tmp_path_factory.getbasetemp()
    shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    folder, ends = shared / "edro", time.monotonic() + 600
    try:
        (shared / "edro.begun").mkdir()
    except FileExistsError:
        while not folder.exists():
            failed = (shared / "edro.failed").exists() or time.monotonic() > ends
            assert not failed, "another worker did not write the report"
            time.sleep(0.1)
        return folder
    told: list[tuple[str, int, int]] = []
    try:
        bristle.report(folder=shared / "edro.part", progress=lambda *step: told.append(step))
    except BaseException:
        (shared / "edro.failed").touch()
        raise
    (shared / "edro.told.json").write_text(json.dumps(told), encoding="utf-8")
    return (shared / "edro.part").rename(folder)


@pytest.fixture(scope="session")
def edro_results(edro_report: Path) -> Path:
    return edro_report / "results.json"


@contextlib.contextmanager
def all_drawn() -> Iterator[None]:
    """Pages have their PNG files, for what looks at them, and once for each kind of page."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(page, "render", style.render)
        yield


@pytest.fixture
def raster() -> Iterator[None]:
    """Pages of this test have their PNG files."""
    with all_drawn():
        yield


@pytest.fixture
def few_studies(monkeypatch: pytest.MonkeyPatch) -> None:
    """Loops of this test are tried under few circumstances, which is most of the time of `adapt`."""
    for name in ("GAMMAS", "AMPLITUDES"):
        monkeypatch.setattr(experiments, name, (1.0,))
    monkeypatch.setattr(ablation, "BITS", (14,))
    monkeypatch.setattr(ablation, "DELAYS", (0,))


@pytest.fixture(scope="session")
def chromium() -> Iterator[Any]:
    """A real browser, one for all tests of a process."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="needs the extra browser")
    names = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
    path = next(filter(None, map(shutil.which, names)), None)
    if path is None:
        pytest.skip("needs an installed Chromium")
    arguments = ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-dev-shm-usage"]
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=arguments)
        yield browser
        browser.close()
