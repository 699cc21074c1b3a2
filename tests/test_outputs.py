import os
import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import bristle
from bristle.page.output_folder import MARKER, replace_files
from bristle.page.wording import slugs

from .conftest import FEW, experiment, run, speeds, table, tree, write

PLAN = ("plan", "e.yaml", "--page", "pg", "-o")


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
          for name in ("Index.HTML", MARKER, "tables/mine.csv")),
        (("inspect", "e.yaml", "-o", ".svg"), ".svg: has no name before its .svg; name a file"),
        (("inspect", "e.yaml", "-o", "data.csv"), "data.csv: figures are written as .svg or .png"),
        *(((*command, ""), "got an empty path; name a") for command in (
            ("report", "e.yaml", "-o"), ("identify", "e.yaml", "-o"), ("inspect", "e.yaml", "-o"), ("validate", "-o"), ("adapt", "-o"),
            ("compare", "a", "b", "-o"), ("sensitivity", "-o"), PLAN, ("plan", "e.yaml", "--page"), ("new", "data.csv", "-o"))),
        (("report", "e.yaml", "-o", "loop/out"), "loop/out: its symbolic links lead round in a circle"),
        (("compare", "loop", "data.csv", "-o", "out"), "loop: cannot be read (Too many levels of symbolic links)"),
    ],
)  # fmt: skip  # a table
def test_an_output_that_cannot_be_is_refused_first(folder: Path, command: Sequence[str], named: str) -> None:
    """Before anything is fitted or printed: a page's own names, a figure without a name, an empty path, links in a circle."""
    refused(folder, command, named)


@pytest.mark.parametrize(
    "command", [("identify", "e.yaml", "-o", "r.json"), ("inspect", "e.yaml", "-o", "r.svg"), ("new", "data.csv", "-o", "r.yaml")]
)  # fmt: skip  # a table
def test_a_file_is_never_replaced(folder: Path, command: Sequence[str]) -> None:
    """Once edited, what bristle wrote is the user's."""
    # the very same figure is no change; a result or draft that is there is refused before anything is computed
    path, drawn = folder / command[-1], command[0] == "inspect"
    assert run(*command).code == 0
    made = path.read_bytes()
    if drawn:
        assert run(*command).code == 0
    path.write_bytes(made + b"mine\n")
    refused(folder, command, f"{path.name}: is there already; ", printed=drawn)


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
