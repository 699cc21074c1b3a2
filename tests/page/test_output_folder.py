import contextlib
import errno
import os
import stat
from collections.abc import Mapping
from pathlib import Path

import pytest

from bristle.errors import InputError
from bristle.page import output_folder

OWN = '{\n "schema": "bristle-results/2"}\n'


def _tree(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


OLD = {"index.html": b"old", "figures/a.svg": b"old a", "figures/b.svg": b"old b"}
NEW = {"index.html": b"new", "figures/a.svg": b"new a"}


def marked(files: Mapping[str, bytes]) -> dict[str, bytes]:
    return {**files, output_folder.MARKER: output_folder.marker_of(files)}


def test_replaces_what_it_made_and_nothing_else(tmp_path: Path) -> None:
    """What the last call made is replaced or removed, edited or not; a user's own file stays, byte for byte."""
    output_folder.replace_files(tmp_path, OLD)
    (tmp_path / "figures" / "mine.txt").write_bytes(b"mine")
    (tmp_path / "notes.md").write_bytes(b"mine")
    (tmp_path / "index.html").write_bytes(b"edited")
    (tmp_path / "figures" / "a.svg").unlink()
    output_folder.replace_files(tmp_path, NEW)
    assert _tree(tmp_path) == {**marked(NEW), "figures/mine.txt": b"mine", "notes.md": b"mine"}
    output_folder.replace_files(tmp_path, {"index.html": b"last"})
    assert _tree(tmp_path) == {**marked({"index.html": b"last"}), "figures/mine.txt": b"mine", "notes.md": b"mine"}


def test_refuses_a_folder_that_is_not_its_own(tmp_path: Path) -> None:
    """One that is neither empty nor marked is refused whatever it holds; so is a marked one with a file of the user's under a page's name."""
    for name in ("notes.txt", "index.html", "figures/a.svg", ".hidden"):
        folder = tmp_path / name.strip(".").replace("/", "-")
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(b"mine")
        refused(folder, "is not empty, and bristle did not make it; name a new or an empty folder")
        assert _tree(folder) == {name: b"mine"}
    own = tmp_path / "own"
    output_folder.replace_files(own, OLD)
    (own / "results.json").write_bytes(b"mine")
    refused(own, r"results\.json: is there already, and bristle did not make it; move it")
    (own / "results.json").unlink()
    (own / "tables").mkdir()
    (own / "tables" / "t.csv").write_bytes(b"mine")
    with pytest.raises(InputError, match=r"tables/t\.csv: is there already"):
        output_folder.replace_files(own, {**NEW, "tables/t.csv": b"new"})
    assert _tree(own) == {**marked(OLD), "tables/t.csv": b"mine"}
    (tmp_path / "out").write_bytes(b"mine")
    refused(tmp_path / "out", "is a file")
    # a marker that is forged, binary, cut off or points elsewhere is refused with what to do; nothing is moved or removed
    names = (
        "../precious", f"{tmp_path}/precious", "a/../../precious", "./index.html", "..\\precious", "C:precious", output_folder.MARKER, ".", "\0",
        "", "\udcff\udcfe", "precious", "notes.txt", "figures/a.txt", "figures/a/b.svg", "Index.html", "ledger.json/x",
    )  # fmt: skip  # a list
    for k, text in enumerate([*(f"{name}\n" for name in names), "index.html"]):
        folder = tmp_path / str(k)
        folder.mkdir()
        (folder / output_folder.MARKER).write_bytes(text.encode("utf-8", "surrogateescape"))
        for name in ("index.html", "precious", "notes.txt"):
            (folder / name).write_bytes(b"mine")
        before = _tree(folder)
        refused(folder, r"\.bristle-manifest: is not a list .*; move or remove the folder .*, or name another")
        assert _tree(folder) == before


def refused(folder: Path, why: str) -> None:
    """A folder is refused before a report is made, and when it is written, for one reason."""
    with pytest.raises(InputError, match=why):
        output_folder.check_folder(folder)
    with pytest.raises(InputError, match=why):
        output_folder.replace_files(folder, NEW)


def test_no_page_replaces_that_of_another_question(tmp_path: Path) -> None:
    """A report gives way to a report alone, and a fleet to a fleet: nothing that was identified is lost."""
    report, fleet = {**OLD, "results.json": b"{}"}, tmp_path / "fleet"
    output_folder.replace_files(tmp_path / "report", report)
    output_folder.replace_files(tmp_path / "report", {**NEW, "results.json": b"{}"})
    refused(tmp_path / "report", "holds a report, which another page would replace; name another folder")
    output_folder.claim(fleet, output_folder.FLEET)
    output_folder.replace_files(fleet, OLD, output_folder.FLEET)
    refused(fleet, "holds a fleet, which another page would replace; name another folder")
    for name, page, claims in (("fleet", report, ()), ("report", OLD, output_folder.FLEET)):
        with pytest.raises(InputError, match="which another page would replace"):
            output_folder.replace_files(tmp_path / name, page, claims)
    # a fleet's dataset stays when the page is written; names of the user's cannot be claimed, nor through a link
    (fleet / "tasks").mkdir()
    (fleet / "ledger.json").write_bytes(b"ledger")
    output_folder.replace_files(fleet, NEW, output_folder.FLEET)
    listed = {**NEW, **dict.fromkeys(output_folder.FLEET, b"")}
    assert _tree(fleet) == {**NEW, "ledger.json": b"ledger", output_folder.MARKER: output_folder.marker_of(listed)}
    (fleet / ".lock").symlink_to(tmp_path / "target")
    with pytest.raises(InputError, match=r"\.lock: is a symbolic link"):
        output_folder.claim(fleet, output_folder.FLEET)
    output_folder.replace_files(tmp_path / "another", OLD)
    (tmp_path / "another" / "tasks").mkdir()
    with pytest.raises(InputError, match="tasks: is there already, and bristle did not make it"):
        output_folder.claim(tmp_path / "another", output_folder.FLEET)


@pytest.mark.parametrize("name", [output_folder.MARKER, "index.html", "figures", "figures/a.svg", "figures/b.svg"])
@pytest.mark.parametrize("target", ["same", "none"])
def test_no_link_in_the_folder_is_followed_or_replaced(tmp_path: Path, name: str, target: str) -> None:
    """A link in place of what bristle made, of its manifest or of its subfolder is refused, even to the very same bytes; nothing changes."""
    out = tmp_path / "out"
    output_folder.replace_files(out, OLD)
    (out / name).rename(tmp_path / "same")
    (out / name).symlink_to(tmp_path / target)
    before = _tree(tmp_path)
    refused(out, "in the way" if name == "figures" else "is a symbolic link")
    assert _tree(tmp_path) == before
    assert (out / name).is_symlink()


def test_the_folder_itself_may_be_a_link(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The user named it; the report lands where it points. A link to nothing is refused, and nothing is made there."""
    (tmp_path / "there").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "there")
    output_folder.replace_files(tmp_path / "link", NEW)
    assert _tree(tmp_path / "there") == marked(NEW)
    (tmp_path / "loose").symlink_to(tmp_path / "nothing")
    refused(tmp_path / "loose", "symbolic link to no folder")
    assert not (tmp_path / "nothing").exists()
    # wherever the renames stop, no old front page shows new figures, and the next call puts all in order
    for after in range(8):
        folder = tmp_path / str(after)
        output_folder.replace_files(folder, OLD)
        with monkeypatch.context() as patch:
            rename, count = Path.replace, 0

            def stop(path: Path, target: Path) -> Path:
                nonlocal count
                count += 1
                if count > after:  # noqa: B023  # called in this round
                    raise KeyboardInterrupt
                return rename(path, target)  # noqa: B023  # the same

            patch.setattr(Path, "replace", stop)
            with contextlib.suppress(KeyboardInterrupt):
                output_folder.replace_files(folder, NEW)
        found = _tree(folder)
        assert found.get("index.html") != b"old" or found["figures/a.svg"] == b"old a"
        output_folder.replace_files(folder, OLD)
        assert _tree(folder) == marked(OLD)


def test_what_is_no_file_is_never_replaced(tmp_path: Path) -> None:
    """A pipe, and a link to a file, to nothing or to a pipe, are refused as a file, and stay; a pipe is refused as a folder too."""
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "own.json").write_text(OWN)
    for target in ("own.json", "nothing", "pipe"):
        (tmp_path / f"to {target}").symlink_to(tmp_path / target)
    for name, why in {"pipe": "is a pipe", "to own.json": "link", "to nothing": "link", "to pipe": "link"}.items():
        with pytest.raises(InputError, match=why):
            output_folder.check_file(tmp_path / name)
        with pytest.raises(InputError, match=why):
            output_folder.write_text(tmp_path / name, "new")
    for path in (tmp_path / "pipe", tmp_path / "to own.json"):
        refused(path, "a report needs a folder")
        with pytest.raises(InputError, match="cannot be written"):
            output_folder.check_folder(path / "below")
        with pytest.raises(InputError, match="is not a folder"):
            output_folder.check_file(path / "below")
    assert (tmp_path / "pipe").is_fifo()
    assert (tmp_path / "own.json").read_text() == OWN
    assert not (tmp_path / "nothing").exists()
    # whatever holds other bytes is refused and stays, though it looks like bristle's own; the very same bytes are no change. A folder, and
    # a file in a folder that does not exist, are refused with what to do
    with pytest.raises(InputError, match="is a folder; name a file"):
        output_folder.write_text(tmp_path, "")
    with pytest.raises(InputError, match="does not exist; create it"):
        output_folder.write_text(tmp_path / "no" / "file", "")
    for name, data in {"r.json": OWN.encode(), "log.csv": b"time (s),experiment\n", "empty": b""}.items():
        (tmp_path / name).write_bytes(data)
        before = (tmp_path / name).stat()
        output_folder.write_bytes(tmp_path / name, data)
        for new in (b"new", data[:-1] + b"\0"):
            with pytest.raises(InputError, match=f"{name}: is there already; move it, or name another file"):
                output_folder.write_bytes(tmp_path / name, new)
        assert (tmp_path / name).read_bytes() == data
        assert (tmp_path / name).stat().st_mtime_ns == before.st_mtime_ns
    # what another made while a page was written is not replaced either
    path = tmp_path / "next.csv"
    with pytest.raises(InputError, match="is there by now"), output_folder.staged(path, b"new"):
        path.write_bytes(b"mine")
    assert path.read_bytes() == b"mine"


def test_a_device_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the system says is no regular file is neither opened nor replaced, whoever runs bristle; a report that lists it is refused."""
    output_folder.replace_files(tmp_path / "out", OLD)
    path, look = tmp_path / "out" / "index.html", Path.stat
    kinds = {stat.S_IFCHR: "a device", stat.S_IFBLK: "a device", stat.S_IFSOCK: "a socket", stat.S_IFIFO: "a pipe"}
    for kind, what in kinds.items():

        def told(self: Path, *, follow_symlinks: bool = True, kind: int = kind) -> os.stat_result:
            found = look(self, follow_symlinks=follow_symlinks)
            return os.stat_result((kind | 0o666, *found[1:])) if self == path else found

        with monkeypatch.context() as patch:
            patch.setattr(Path, "stat", told)
            with pytest.raises(InputError, match=f"is {what}; expected a file"):
                output_folder.write_text(path, "new")
            with pytest.raises(InputError, match=f"is {what}; expected a file"):
                output_folder.replace_files(tmp_path / "out", NEW)
        assert path.read_bytes() == b"old"


def _fill_disk(monkeypatch: pytest.MonkeyPatch, after: int) -> None:
    write, count = output_folder._write, 0

    def full(path: Path, data: bytes) -> None:
        nonlocal count
        count += 1
        if count > after:
            path.write_bytes(data[:1])
            raise OSError(errno.ENOSPC, "No space left on device", str(path))
        write(path, data)

    monkeypatch.setattr(output_folder, "_write", full)


def test_a_full_disk_leaves_the_old_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whichever write fails, the folder is as it was: no new file, no temporary one; folders made for a report that failed are removed again."""
    for after in range(4):
        out = tmp_path / str(after)
        output_folder.replace_files(out, OLD)
        before = _tree(tmp_path)
        with monkeypatch.context() as patch:
            _fill_disk(patch, after)
            with pytest.raises(OSError, match="No space left"):
                output_folder.replace_files(out, NEW)
        assert _tree(tmp_path) == before
        assert not [p for p in out.rglob("*") if p.name.startswith(".bristle-") and p.name != output_folder.MARKER]
    _fill_disk(monkeypatch, 1)
    with pytest.raises(OSError, match="No space left"):
        output_folder.replace_files(tmp_path / "a" / "b", NEW)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["0", "1", "2", "3"]


def test_text_is_written_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A failed write leaves nothing; lone surrogates, as in odd file names, do not stop one."""
    path = tmp_path / "results.json"
    output_folder.write_text(path, '"\udc80"')
    assert path.read_bytes() == b'"\\udc80"'
    _fill_disk(monkeypatch, 0)
    with pytest.raises(OSError, match=r"other\.json"):
        output_folder.write_text(tmp_path / "other.json", "new")
    assert _tree(tmp_path) == {"results.json": b'"\\udc80"'}


@pytest.mark.parametrize("part", [".", "tables", "figures"])
def test_a_folder_that_cannot_be_written_is_told_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, part: str
) -> None:
    """A report's folder, or one in it, by the name the user gave: before the report is made, and again before the first move; nothing changes."""
    monkeypatch.chdir(tmp_path)
    new = {**NEW, "tables/t.csv": b"new t"}
    output_folder.replace_files(Path("out"), {**OLD, "tables/t.csv": b"t"})
    before = _tree(tmp_path)
    access = os.access
    monkeypatch.setattr(os, "access", lambda x, mode: access(x, mode) and not x.samefile(tmp_path / "out" / part))
    where = "" if part == "." else f"the folder {Path('out') / part} "
    why = rf"^out: {where}cannot be written; name another folder, or change its permissions$"
    with pytest.raises(InputError, match=why):
        output_folder.check_folder(Path("out"))
    with pytest.raises(InputError, match=why):
        output_folder.replace_files(Path("out"), new)
    with pytest.raises(InputError, match=r"mine\.csv: the folder out.* cannot be written; name another file, or"):
        output_folder.check_file(Path("out") / part / "mine.csv")
    assert _tree(tmp_path) == before


def test_a_name_that_no_report_has_is_our_own_defect(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What could not be known again as bristle's own is never written."""
    with pytest.raises(ValueError, match="is not the name of a report's file") as caught:
        output_folder.replace_files(tmp_path, {"notes.txt": b""})
    assert not isinstance(caught.value, InputError)
    assert not list(tmp_path.iterdir())
    # one rename makes it; where that fails nothing is left, not even the folders above it. It has the permissions of any new folder
    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", lambda *_: (_ for _ in ()).throw(OSError(errno.EIO, "broken")))
        with pytest.raises(OSError, match="broken"):
            output_folder.replace_files(tmp_path / "a" / "b", NEW)
    assert list(tmp_path.iterdir()) == []
    output_folder.replace_files(tmp_path / "a" / "b", NEW)
    (tmp_path / "usual").mkdir()
    assert _tree(tmp_path / "a" / "b") == marked(NEW)
    assert (tmp_path / "a" / "b").stat().st_mode == (tmp_path / "usual").stat().st_mode
