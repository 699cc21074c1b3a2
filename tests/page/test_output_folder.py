import contextlib
import errno
import hashlib
import os
import stat
from collections.abc import Mapping
from pathlib import Path

import pytest

from bristle.errors import InputError
from bristle.page import output_folder
from bristle.page.style import new_figure, render

OWN = '{\n "schema": "bristle-results/2"}\n'


def _tree(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def listing(*files: Mapping[str, bytes]) -> bytes:
    """The manifest of these files."""
    lines = {(name, hashlib.sha256(data).hexdigest()) for made in files for name, data in made.items()}
    return "".join(f"{x}  {name}\n" for name, x in sorted(lines)).encode()


OLD = {"index.html": b"old", "figures/a.svg": b"old a", "figures/b.svg": b"old b"}
NEW = {"index.html": b"new", "figures/a.svg": b"new a"}


def test_replaces_what_it_made_and_nothing_else(tmp_path: Path) -> None:
    """What the last call made is replaced or removed; a user's file stays, byte for byte."""
    output_folder.replace_files(tmp_path, OLD)
    (tmp_path / "figures" / "mine.svg").write_bytes(b"mine")
    output_folder.replace_files(tmp_path, NEW)
    manifest = listing(NEW)
    assert _tree(tmp_path) == {**NEW, "figures/mine.svg": b"mine", output_folder.MANIFEST: manifest}


@pytest.mark.parametrize("name", ["index.html", "figures/a.svg"])
def test_refuses_a_file_it_did_not_make(tmp_path: Path, name: str) -> None:
    """A file of the same name that bristle did not make is named and stays; nothing else is written."""
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_bytes(b"mine")
    with pytest.raises(ValueError, match="bristle did not make it"):
        output_folder.replace_files(tmp_path, NEW)
    assert _tree(tmp_path) == {name: b"mine"}


def test_refuses_a_file_in_place_of_a_folder(tmp_path: Path) -> None:
    """A folder that is a file, or whose own subfolder is a file or a link, is refused."""
    (tmp_path / "out").write_bytes(b"mine")
    with pytest.raises(ValueError, match="is a file"):
        output_folder.replace_files(tmp_path / "out", NEW)
    (tmp_path / "report").mkdir()
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "report" / "figures").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(ValueError, match="in the way"):
        output_folder.replace_files(tmp_path / "report", NEW)
    assert list((tmp_path / "elsewhere").iterdir()) == []


def refused(folder: Path, why: str) -> None:
    """A folder is refused before a report is made, and when it is written, for one reason."""
    with pytest.raises(InputError, match=why):
        output_folder.check_folder(folder)
    with pytest.raises(InputError, match=why):
        output_folder.replace_files(folder, NEW)


HASH = hashlib.sha256(b"mine").hexdigest()


@pytest.mark.parametrize(
    ("manifest", "why"),
    [
        (f"{HASH}  ../precious\n", "is no list"), (f"{HASH}  {{here}}/precious\n", "is no list"), (f"{HASH}  a/../../precious\n", "is no list"),
        (f"{HASH}  ./index.html\n", "is no list"), (f"{HASH}  ..\\precious\n", "is no list"), (f"{HASH}  C:precious\n", "is no list"),
        (f"{HASH}  {output_folder.MANIFEST}\n", "is no list"), (f"{HASH}  .\n", "is no list"), (f"{HASH}  \0\n", "is no list"),
        ("index.html\n", "is no list"),
        (f"{HASH[1:]}  index.html\n", "is no list"), (f"{HASH} index.html\n", "is no list"), ("\n", "is no list"), ("\udcff\udcfe\n", "is no list"),
        *((f"{HASH}  {name}\n", "is no list") for name in ("precious", "notes.txt", "figures/a.txt", "figures/a/b.svg", "Index.html")),
        (f"{HASH}  index.html", "is cut off"), ("\0" * 100, "is cut off"), ("\n" * 2_000_000, "is no list"),
    ],
)  # fmt: skip  # a table
def test_a_manifest_that_is_none_is_refused(tmp_path: Path, manifest: str, why: str) -> None:
    """One that is older, forged, binary, cut off or points out of its folder is refused with what to do, and nothing is moved or removed."""
    (tmp_path / "precious").write_bytes(b"mine")
    (tmp_path / "out").mkdir()
    text = manifest.replace("{here}", str(tmp_path))
    (tmp_path / "out" / output_folder.MANIFEST).write_bytes(text.encode("utf-8", "surrogateescape"))
    for name in ("index.html", "precious", "notes.txt"):
        (tmp_path / "out" / name).write_bytes(b"mine")
    before = _tree(tmp_path)
    refused(tmp_path / "out", rf"\.bristle-manifest: {why}.*; move or remove the folder .*, or name another")
    assert _tree(tmp_path) == before


@pytest.mark.parametrize("name", ["index.html", "figures/a.svg", "figures/b.svg"])
def test_what_was_changed_since_is_neither_replaced_nor_removed(tmp_path: Path, name: str) -> None:
    """A file that the manifest lists, but with another hash, was edited: it is named and stays, and so does all else. One that is gone is none."""
    output_folder.replace_files(tmp_path, OLD)
    (tmp_path / name).write_bytes(b"mine")
    before = _tree(tmp_path)
    refused(tmp_path, f"{name}: was changed since bristle made it; move it")
    assert _tree(tmp_path) == before
    (tmp_path / name).unlink()
    output_folder.replace_files(tmp_path, NEW)
    assert _tree(tmp_path) == {**NEW, output_folder.MANIFEST: listing(NEW)}


def test_other_seconds_are_no_change(tmp_path: Path) -> None:
    """The manifest of one result is one, however long it took; a change of timings.json that is no number is one."""
    lists = []
    for seconds in ("0.5", "1e-05"):
        output_folder.replace_files(
            tmp_path, {"timings.json": f'{{\n "fit 2: 3": {seconds},\n "b": 1.0\n}}\n'.encode()}
        )
        lists.append((tmp_path / output_folder.MANIFEST).read_bytes())
    assert lists[0] == lists[1]
    (tmp_path / "timings.json").write_bytes(b'{\n "mine": 1.0\n}\n')
    with pytest.raises(InputError, match="was changed"):
        output_folder.replace_files(tmp_path, NEW)


@pytest.mark.parametrize("after", range(8))
def test_an_interrupted_move_is_still_known(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, after: int) -> None:
    """Wherever the renames stop, the next call knows old and new files as bristle's, and replaces them."""
    output_folder.replace_files(tmp_path, OLD)
    with monkeypatch.context() as patch:
        rename, count = Path.replace, 0

        def stop(path: Path, target: Path) -> Path:
            nonlocal count
            count += 1
            if count > after:
                raise KeyboardInterrupt
            return rename(path, target)

        patch.setattr(Path, "replace", stop)
        with contextlib.suppress(KeyboardInterrupt):
            output_folder.replace_files(tmp_path, NEW)
    output_folder.replace_files(tmp_path, OLD)
    assert _tree(tmp_path) == {**OLD, output_folder.MANIFEST: listing(OLD)}


@pytest.mark.parametrize("name", [output_folder.MANIFEST, "index.html", "figures", "figures/a.svg", "figures/b.svg"])
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


def test_the_folder_itself_may_be_a_link(tmp_path: Path) -> None:
    """The user named it; the report lands where it points. A link to nothing is refused, and nothing is made there."""
    (tmp_path / "there").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "there")
    output_folder.replace_files(tmp_path / "link", NEW)
    assert _tree(tmp_path / "there") == {**NEW, output_folder.MANIFEST: listing(NEW)}
    (tmp_path / "loose").symlink_to(tmp_path / "nothing")
    refused(tmp_path / "loose", "symbolic link to no folder")
    assert not (tmp_path / "nothing").exists()


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
        with pytest.raises(InputError, match="a report needs a folder"):
            output_folder.replace_files(path, NEW)
        with pytest.raises(InputError, match="a report needs a folder"):
            output_folder.check_folder(path)
        with pytest.raises(InputError, match="cannot be written"):
            output_folder.check_folder(path / "below")
        with pytest.raises(InputError, match="is no folder"):
            output_folder.check_file(path / "below")
    assert (tmp_path / "pipe").is_fifo()
    assert (tmp_path / "own.json").read_text() == OWN
    assert not (tmp_path / "nothing").exists()


@pytest.mark.parametrize(
    ("kind", "what"),
    [(stat.S_IFCHR, "a device"), (stat.S_IFBLK, "a device"), (stat.S_IFSOCK, "a socket"), (stat.S_IFIFO, "a pipe")],
)
def test_a_device_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: int, what: str) -> None:
    """Whatever the system says is no regular file is neither opened nor replaced, whoever runs bristle; a report that lists it is refused."""
    output_folder.replace_files(tmp_path / "out", OLD)
    path, look = tmp_path / "out" / "index.html", Path.stat

    def told(self: Path, *, follow_symlinks: bool = True) -> os.stat_result:
        found = look(self, follow_symlinks=follow_symlinks)
        return os.stat_result((kind | 0o666, *found[1:])) if self == path else found

    monkeypatch.setattr(Path, "stat", told)
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


@pytest.mark.parametrize("after", range(5))
def test_a_full_disk_leaves_the_old_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, after: int) -> None:
    """Whichever write fails, the folder is as it was: no new file, no temporary one."""
    output_folder.replace_files(tmp_path, OLD)
    before = _tree(tmp_path)
    _fill_disk(monkeypatch, after)
    with pytest.raises(OSError, match="No space left"):
        output_folder.replace_files(tmp_path, NEW)
    assert _tree(tmp_path) == before
    assert not [p for p in tmp_path.rglob("*") if p.name.startswith(".bristle-") and p.name != output_folder.MANIFEST]


def test_a_full_disk_leaves_no_new_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Folders made for a report that failed are removed again."""
    _fill_disk(monkeypatch, 1)
    with pytest.raises(OSError, match="No space left"):
        output_folder.replace_files(tmp_path / "a" / "b", NEW)
    assert list(tmp_path.iterdir()) == []


def test_text_is_written_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A failed write leaves nothing; lone surrogates, as in odd file names, do not stop one."""
    path = tmp_path / "results.json"
    output_folder.write_text(path, '"\udc80"')
    assert path.read_bytes() == b'"\\udc80"'
    _fill_disk(monkeypatch, 0)
    with pytest.raises(OSError, match=r"other\.json"):
        output_folder.write_text(tmp_path / "other.json", "new")
    assert _tree(tmp_path) == {"results.json": b'"\\udc80"'}


def test_no_file_is_replaced(tmp_path: Path) -> None:
    """Whatever holds other bytes is refused and stays, though it looks like bristle's own; the very same bytes are no change."""
    figure = new_figure(2.0)
    figure.subplots().plot([0, 1])
    svg, png = render(figure)
    header = b"time (s),experiment,run,position reference (rad),measured\n"
    for name, data in {"r.json": OWN.encode(), "f.png": png, "f.svg": svg, "log.csv": header, "empty": b""}.items():
        (tmp_path / name).write_bytes(data)
        before = (tmp_path / name).stat()
        output_folder.write_bytes(tmp_path / name, data)
        for new in (b"new", data[:-1] + b"\0"):
            with pytest.raises(InputError, match=f"{name}: is there already; move it, or name another file"):
                output_folder.write_bytes(tmp_path / name, new)
        assert (tmp_path / name).read_bytes() == data
        assert (tmp_path / name).stat().st_mtime_ns == before.st_mtime_ns


def test_a_file_that_came_meanwhile_stays(tmp_path: Path) -> None:
    """What another made while a page was written is not replaced either."""
    path = tmp_path / "next.csv"
    with pytest.raises(InputError, match="is there by now"), output_folder.staged(path, b"new"):
        path.write_bytes(b"mine")
    assert _tree(tmp_path) == {"next.csv": b"mine"}


def _forbid(monkeypatch: pytest.MonkeyPatch, *folders: Path) -> None:
    """These folders cannot be written, whoever runs the tests."""
    access = os.access

    def told(path: Path, mode: int) -> bool:
        return access(path, mode) and not any(path.samefile(folder) for folder in folders)

    monkeypatch.setattr(os, "access", told)


@pytest.mark.parametrize("part", [".", "tables", "figures"])
def test_a_folder_that_cannot_be_written_is_told_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, part: str
) -> None:
    """A report's folder, or one in it, by the name the user gave: before the report is made, and again before the first move; nothing changes."""
    monkeypatch.chdir(tmp_path)
    new = {**NEW, "tables/t.csv": b"new t"}
    output_folder.replace_files(Path("out"), {**OLD, "tables/t.csv": b"t"})
    before = _tree(tmp_path)
    _forbid(monkeypatch, tmp_path / "out" / part)
    where = "" if part == "." else f"the folder {Path('out') / part} "
    why = rf"^out: {where}cannot be written; name another folder, or change its permissions$"
    with pytest.raises(InputError, match=why):
        output_folder.check_folder(Path("out"))
    with pytest.raises(InputError, match=why):
        output_folder.replace_files(Path("out"), new)
    with pytest.raises(InputError, match=r"mine\.csv: the folder out.* cannot be written; name another file, or"):
        output_folder.check_file(Path("out") / part / "mine.csv")
    assert _tree(tmp_path) == before


def test_a_folder_that_cannot_be_made_is_told_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The nearest one that exists is named as the user gave it."""
    monkeypatch.chdir(tmp_path)
    Path("above").mkdir()
    Path("link").symlink_to("above")
    _forbid(monkeypatch, tmp_path / "above")
    refused(
        Path("link/a/b"),
        "^link/a/b: the folder link cannot be written; name another folder, or change its permissions$",
    )
    assert not list(Path("above").iterdir())


@pytest.mark.parametrize("old", [{}, OLD], ids=["first", "second"])
@pytest.mark.parametrize("at", range(10))
@pytest.mark.parametrize("error", [errno.EACCES, errno.EIO])
def test_a_rename_that_fails_is_undone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, old: Mapping[str, bytes], at: int, error: int
) -> None:
    """Whichever rename fails, every file and folder is as it was, and the next report lands."""
    out, new = tmp_path / "out", {**NEW, "tables/t.csv": b"new t"}
    if old:
        output_folder.replace_files(out, old)
    before, folders = _tree(tmp_path), sorted(tmp_path.rglob("*"))
    failed = False
    with monkeypatch.context() as patch:
        rename, count = Path.replace, 0

        def fail(path: Path, target: Path) -> Path:
            nonlocal count, failed
            count += 1
            if count == at + 1:
                failed = True
                raise OSError(error, os.strerror(error), str(path))
            return rename(path, target)

        patch.setattr(Path, "replace", fail)
        with contextlib.suppress(InputError, OSError):
            output_folder.replace_files(out, new)
            assert not failed
    if failed:
        assert _tree(tmp_path) == before
        assert sorted(tmp_path.rglob("*")) == folders
    output_folder.replace_files(out, new)
    assert _tree(out) == {**new, output_folder.MANIFEST: listing(new)}
    assert not (out / "aside").exists()


@pytest.mark.parametrize("path", ["loop", "loop/out", "loop/a/out"])
def test_links_in_a_circle_are_one_sentence(tmp_path: Path, path: str) -> None:
    """As a folder, above one, and above a file."""
    (tmp_path / "loop").symlink_to("pool")
    (tmp_path / "pool").symlink_to("loop")
    refused(tmp_path / path, "in a circle|symbolic link to no folder")
    for check in (output_folder.resolved, lambda p: output_folder.check_apart(p, tmp_path)):
        with pytest.raises(InputError, match="in a circle; name another"):
            check(tmp_path / path)
    with pytest.raises(InputError, match=r"symbolic link|is no folder; name another|does not exist"):
        output_folder.check_file(tmp_path / path)


def test_a_name_that_no_report_has_is_our_own_defect(tmp_path: Path) -> None:
    """What could not be known again as bristle's own is never written."""
    with pytest.raises(ValueError, match="is no name of a report's file") as caught:
        output_folder.replace_files(tmp_path, {"notes.txt": b""})
    assert not isinstance(caught.value, InputError)
    assert not list(tmp_path.iterdir())


def test_bad_paths_are_refused_in_one_sentence(tmp_path: Path) -> None:
    """A folder, or a file in a folder that does not exist, is refused with what to do."""
    with pytest.raises(ValueError, match="is a folder; name a file"):
        output_folder.write_text(tmp_path, "")
    with pytest.raises(ValueError, match="does not exist; create it"):
        output_folder.write_text(tmp_path / "no" / "file", "")
