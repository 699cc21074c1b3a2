import os
import re
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import bristle
from bristle.page.output_folder import MARKER, replace_files
from bristle.page.wording import slugs

from .conftest import FEW, experiment, run, speeds, table, tree, write

PLAN = ("plan", "e.yaml", "--page", "pg", "-o")
HEADER = "time (s),experiment,run,position reference (rad),measured\n0,ramp,1,0,0\n"
"""Of a log that was measured with a plan's references."""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the commands run: a good experiment, a page in pg, a link to it, and links in a circle."""
    (tmp_path / "e.yaml").write_text(experiment(), encoding="utf-8")
    (tmp_path / "data.csv").write_text(table(FEW), encoding="utf-8")
    replace_files(tmp_path / "pg", dict.fromkeys(("index.html", "figures/a.svg", "tables/a.csv"), b"page"))
    (tmp_path / "link").symlink_to("pg")
    (tmp_path / "loop").symlink_to("pool")
    (tmp_path / "pool").symlink_to("loop")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def refused(folder: Path, command: Sequence[str], named: str, *, printed: bool = False) -> None:
    """Exit code 2, one sentence with these words, nothing on the disk changed, and nothing printed before."""
    before = tree(folder)
    ran = run(*command)
    assert ran.code == 2
    assert len(ran.said) == 1
    assert named in ran.said[0]
    assert bool(ran.out) == printed
    assert tree(folder) == before


@pytest.mark.parametrize(
    ("command", "named"),
    [
        *(((*PLAN, f"{at}/{name}"), f"{at}/{name}: is where the page in pg puts its own files") for at in ("pg", "link")
          for name in ("index.html", "Index.HTML", MARKER, "figures/mine.svg", "tables/mine.csv")),
        ((*PLAN, "pg/tables/../index.html"), "is where the page in pg"),
        (("inspect", "e.yaml", "-o", ".svg"), ".svg: has no name before its .svg; name a file"),
        (("inspect", "e.yaml", "-o", "pg/.PNG"), ".PNG: has no name"),
        (("inspect", "e.yaml", "-o", "data.csv"), "data.csv: figures are written as .svg or .png"),
        *(((*command, ""), "got an empty path; name a") for command in (
            ("report", "e.yaml", "-o"), ("identify", "e.yaml", "-o"), ("inspect", "e.yaml", "-o"), ("validate", "-o"), ("adapt", "-o"),
            ("compare", "a", "b", "-o"), ("sensitivity", "-o"), PLAN, ("plan", "e.yaml", "--page"), ("new", "data.csv", "-o"))),
        (("report", "e.yaml", "-o", "loop/out"), "loop/out: its symbolic links lead round in a circle"),
        (("report", "e.yaml", "-o", "loop"), "loop: is a symbolic link to no folder"),
        (("plan", "e.yaml", "--page", "loop/a/b"), "in a circle"),
        (("compare", "loop", "data.csv", "-o", "out"), "loop: cannot be read (Too many levels of symbolic links)"),
        (("identify", "e.yaml", "-o", "loop/r.json"), "loop is not a folder; name another file"),
    ],
)  # fmt: skip  # a table
def test_an_output_that_cannot_be_is_refused_first(folder: Path, command: Sequence[str], named: str) -> None:
    """Before anything is fitted or printed: a page's own names, a figure without a name, an empty path, links in a circle."""
    refused(folder, command, named)


@pytest.mark.parametrize(
    "command", [("identify", "e.yaml", "-o", "r.json"), ("inspect", "e.yaml", "-o", "r.svg"), ("new", "data.csv", "-o", "r.yaml")]
)  # fmt: skip  # a table
def test_a_file_is_never_replaced(folder: Path, command: Sequence[str]) -> None:
    """Once edited, what bristle wrote is the user's, and so is whatever only looks like it."""
    # the very same figure is no change; a result or draft that is there is refused before anything is computed
    path, drawn = folder / command[-1], command[0] == "inspect"
    assert run(*command).code == 0
    made = path.read_bytes()
    if drawn:
        assert run(*command).code == 0
    path.write_bytes(made + b"mine\n")
    refused(folder, command, f"{path.name}: is there already; ", printed=drawn)
    for mine in (HEADER, '"schema": "bristle-results/2" is what I wrote', "<dc:title>bristle</dc:title>"):
        path.write_text(mine, encoding="utf-8")
        refused(folder, command, f"{path.name}: is there already; ", printed=drawn)


@pytest.mark.parametrize(
    ("command", "named"),
    [
        (("report", "e.yaml", "-o", "out"), "out: cannot be written; name another folder, or change its permissions"),
        (("report", "e.yaml", "-o", "out/a/b"), "out/a/b: the folder out cannot be written; name another folder, or"),
        (("identify", "e.yaml", "-o", "out/r.json"), "out/r.json: the folder out cannot be written; name another file, or"),
    ],
)  # fmt: skip  # a table
def test_a_folder_that_cannot_be_written_is_told_before_the_fit(
    folder: Path, monkeypatch: pytest.MonkeyPatch, command: Sequence[str], named: str
) -> None:
    """With what to do, and by the name that was given."""
    (folder / "out").mkdir()
    monkeypatch.setattr(os, "access", lambda path, _: not path.samefile(folder / "out"))
    refused(folder, command, named)


def test_a_folder_of_the_user_s_is_refused_first(folder: Path) -> None:
    """By every command that writes one, before anything is computed or printed, and without a change."""
    (folder / "mine").mkdir()
    (folder / "mine" / "log.csv").write_bytes(b"mine")
    (folder / "catalog.csv").write_text("file,unit,session\ne.yaml,u,2026-05-04\n", encoding="utf-8")
    commands = (
        ("report", "e.yaml"), ("validate", "e.yaml"), ("adapt", "e.yaml"), ("sensitivity", "e.yaml"), ("compare", "a.json", "b.json"),
        ("fleet", "catalog.csv"),
    )  # fmt: skip  # a list
    for command in (*((*x, "-o", "mine") for x in commands), ("plan", "e.yaml", "--page", "mine")):
        refused(folder, command, "mine: is not empty, and bristle did not make it; name a new or an empty folder")
    # in a report's folder a ledger, tasks or a lock of the user's is refused, also through a link or as a pipe, before a cluster starts
    (folder / "catalog.csv").write_text("file,unit,session\ne.yaml,u,2026-05-04\n", encoding="utf-8")
    (folder / "precious").write_bytes(b"mine")
    made: dict[str, Callable[[Path], object]] = {
        "tasks": Path.mkdir, "results": Path.mkdir, "ledger.json": lambda path: path.write_bytes(b"mine"),
        ".lock": lambda path: path.symlink_to(folder / "precious"), "pipe/.lock": os.mkfifo,
    }  # fmt: skip  # a list of values
    for name, make in made.items():
        out = folder / name.strip(".").replace("/", "-").replace(".", "-")
        replace_files(out, {"index.html": b"page"})
        own = name.removeprefix("pipe/")
        make(out / own)
        refused(folder, ("fleet", "catalog.csv", "-o", out.name), f"{out.name}/{own}: ")


FORBIDDEN = re.compile(r'[<>:"/\\|?*\x00-\x1f]|[. ]$|^(con|prn|aux|nul|(com|lpt)[0-9¹²³])(\.|$)', re.IGNORECASE)
"""No file is called that there, whatever follows a dot."""
NAMES = st.sampled_from(
    ["con", "COM1", "Aux.", "nul", "lpt¹", "A", "a", "a ", "", "é", "..", "a/b", "a\\b", "C:"]
) | st.text(max_size=8)


@given(st.lists(NAMES, max_size=6))
def test_files_of_joints_are_called_so_that_windows_takes_them(names: list[str]) -> None:
    """No device, no forbidden character, no dot or blank at the end, and none that differs from another by its case alone."""
    found = slugs(names)
    assert [x for x in found if FORBIDDEN.search(x)] == []
    assert len({x.casefold() for x in found}) == len(names)


def test_an_export_is_called_so_that_windows_takes_it(
    edro_results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By default it is called after its joint, which may be called as a device is."""
    path = tmp_path / "results.json"
    path.write_text(edro_results.read_text("utf-8").replace("gripper rotation", "AUX"), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    for to in ("json", "c", "latex", "mujoco"):
        assert run("export", path, "--joint", "AUX", "--to", to).code == 0
    made = [x.name for x in tmp_path.iterdir() if x != path]
    assert len(made) == 4
    assert [name for name in made if FORBIDDEN.search(name)] == []


def test_logs_and_experiments_as_its_programs_write_them(tmp_path: Path) -> None:
    """Lines that end in CR LF, a mark of the byte order, UTF-16, a code page: the same values."""
    log, file = tmp_path / "data.csv", tmp_path / "e.yaml"
    text, asked = table(speeds()).replace("v,", "v [°],", 1), experiment().replace("column: v", 'column: "v [°]"')

    def values(log_as: str, file_as: str, end: str) -> str:
        log.write_bytes(text.replace("\n", end).encode(log_as))
        file.write_bytes(asked.replace("\n", end).encode(file_as))
        ran = run("identify", file)
        assert (ran.code, ran.err) == (0, ""), (log_as, file_as, end)
        return ran.out

    plain = values("utf-8", "utf-8", "\n")
    as_written = [("utf-8", "utf-8"), ("utf-8-sig", "utf-8-sig"), ("utf-16", "utf-8-sig"), ("cp1252", "utf-8")]
    assert [x for x in as_written if values(*x, "\r\n") != plain] == []
    # what a code page lacks is escaped: a result with its exit code, and no traceback; a file is in UTF-8 all the same
    file = write(tmp_path, speeds(), joint="Kraftgelenk-关节 ±")
    for page in ("cp1252", "cp437", "cp932"):
        out = tmp_path / f"{page}.json"
        command = [sys.executable, "-m", "bristle", "identify", str(file), "-o", str(out)]
        ran = subprocess.run(command, capture_output=True, env=os.environ | {"PYTHONIOENCODING": page}, check=False)  # noqa: S603 # our own command
        assert (ran.returncode, ran.stderr) == (0, b""), page
        assert "Kraftgelenk" in ran.stdout.decode(page)
        assert "关节" in out.read_text(encoding="utf-8")


ELSEWHERE = """
import os, sys, types
sys.modules.update(dict.fromkeys(("fcntl", "resource", "pwd", "grp", "termios", "readline")))
for name in ("sched_getaffinity", "fork", "getuid", "O_NOFOLLOW"):
    vars(os).pop(name, None)
if __name__ == "__main__":
    from bristle import workers
    workers.sys = types.SimpleNamespace(**{**vars(sys), "platform": "win32"})
    from bristle.__main__ import main
    main()
"""


@pytest.mark.slow
def test_without_what_only_posix_has(tmp_path: Path) -> None:
    """The main job in workers that are spawned, without modules of POSIX; every text is opened with its encoding."""
    for k in range(2):
        write(tmp_path, speeds(), joint=f"joint {k}", stem=f"e{k}")
    script = tmp_path / "elsewhere.py"
    script.write_text(ELSEWHERE, encoding="utf-8")
    strict, said = ["-X", "warn_default_encoding", "-W", "error::EncodingWarning:bristle"], {}
    for command in (
        ("report", "e0.yaml", "e1.yaml", "--workers", "2", "-o", "out"),
        ("export", "out/results.json", "--joint", "joint 0", "--to", "json", "-o", "joint.json"),
    ):
        line = [sys.executable, *strict, str(script), *command]
        ran = subprocess.run(line, capture_output=True, text=True, cwd=tmp_path, check=False)  # noqa: S603 # our own command
        said[command[0]] = (ran.returncode, ran.stderr)
    assert {name: code for name, (code, _) in said.items()} == dict.fromkeys(said, 0), said
    assert len(bristle.read_results(tmp_path / "out/results.json").joints) == 2
