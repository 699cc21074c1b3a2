"""What Windows does otherwise, held on every system: names of files, encodings of logs and terminals, spawned workers."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import bristle
from bristle.page.wording import slugs

from .conftest import experiment, run, speeds, table, write

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
        """As the command prints them."""
        log.write_bytes(text.replace("\n", end).encode(log_as))
        file.write_bytes(asked.replace("\n", end).encode(file_as))
        ran = run("identify", file)
        assert (ran.code, ran.err) == (0, ""), (log_as, file_as, end)
        return ran.out

    plain = values("utf-8", "utf-8", "\n")
    as_written = [("utf-8", "utf-8"), ("utf-8-sig", "utf-8-sig"), ("utf-16", "utf-8-sig"), ("cp1252", "utf-8")]
    assert [x for x in as_written if values(*x, "\r\n") != plain] == []


def test_terminals_of_a_code_page(tmp_path: Path) -> None:
    """What a code page lacks is escaped: a result with its exit code, and no traceback; a file is in UTF-8 all the same."""
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
