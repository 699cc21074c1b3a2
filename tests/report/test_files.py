import errno
from pathlib import Path

import pytest

from bristle.report import files
from bristle.report.style import new_figure, render

OWN = '{\n "schema": "bristle-results/1"}\n'


def _tree(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


OLD = {"index.html": b"old", "figures/a.svg": b"old a", "figures/b.svg": b"old b"}
NEW = {"index.html": b"new", "figures/a.svg": b"new a"}


def test_replaces_what_it_made_and_nothing_else(tmp_path: Path) -> None:
    """What the last call made is replaced or removed; a user's file stays, byte for byte."""
    files.replace_files(tmp_path, OLD)
    (tmp_path / "figures" / "mine.svg").write_bytes(b"mine")
    files.replace_files(tmp_path, NEW)
    manifest = b"figures/a.svg\nindex.html\n"
    assert _tree(tmp_path) == {**NEW, "figures/mine.svg": b"mine", files.MANIFEST: manifest}


@pytest.mark.parametrize("name", ["index.html", "figures/a.svg"])
def test_refuses_a_file_it_did_not_make(tmp_path: Path, name: str) -> None:
    """A file of the same name that bristle did not make is named and stays; nothing else is written."""
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_bytes(b"mine")
    with pytest.raises(ValueError, match="bristle did not make it"):
        files.replace_files(tmp_path, NEW)
    assert _tree(tmp_path) == {name: b"mine"}


def test_refuses_a_file_in_place_of_a_folder(tmp_path: Path) -> None:
    """A folder that is a file, or whose own subfolder is a file or a link, is refused."""
    (tmp_path / "out").write_bytes(b"mine")
    with pytest.raises(ValueError, match="is a file"):
        files.replace_files(tmp_path / "out", NEW)
    (tmp_path / "report").mkdir()
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "report" / "figures").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(ValueError, match="in the way"):
        files.replace_files(tmp_path / "report", NEW)
    assert list((tmp_path / "elsewhere").iterdir()) == []


def test_a_forged_manifest_removes_nothing_outside(tmp_path: Path) -> None:
    """Paths of a manifest that point out of the folder are not believed."""
    (tmp_path / "precious").write_bytes(b"mine")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / files.MANIFEST).write_text(f"../precious\n{tmp_path / 'precious'}\n", encoding="utf-8")
    files.replace_files(tmp_path / "out", NEW)
    assert (tmp_path / "precious").read_bytes() == b"mine"


def _fill_disk(monkeypatch: pytest.MonkeyPatch, after: int) -> None:
    write, count = files._write, 0

    def full(path: Path, data: bytes) -> None:
        nonlocal count
        count += 1
        if count > after:
            path.write_bytes(data[:1])
            raise OSError(errno.ENOSPC, "No space left on device", str(path))
        write(path, data)

    monkeypatch.setattr(files, "_write", full)


@pytest.mark.parametrize("after", range(4))
def test_a_full_disk_leaves_the_old_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, after: int) -> None:
    """Whichever write fails, the folder is as it was: no new file, no temporary one."""
    files.replace_files(tmp_path, OLD)
    before = _tree(tmp_path)
    _fill_disk(monkeypatch, after)
    with pytest.raises(OSError, match="No space left"):
        files.replace_files(tmp_path, NEW)
    assert _tree(tmp_path) == before
    assert not [p for p in tmp_path.rglob("*") if p.name.startswith(".bristle-") and p.name != files.MANIFEST]


def test_a_full_disk_leaves_no_new_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Folders made for a report that failed are removed again."""
    _fill_disk(monkeypatch, 1)
    with pytest.raises(OSError, match="No space left"):
        files.replace_files(tmp_path / "a" / "b", NEW)
    assert list(tmp_path.iterdir()) == []


def test_text_is_written_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An older file survives a failed write; lone surrogates, as in odd file names, do not stop one."""
    path = tmp_path / "results.json"
    files.write_text(path, '"\udc80"')
    assert path.read_bytes() == b'"\\udc80"'
    path.write_text(OWN)
    _fill_disk(monkeypatch, 0)
    with pytest.raises(OSError, match="No space left"):
        files.write_text(path, "new")
    assert _tree(tmp_path) == {"results.json": OWN.encode()}


def test_only_what_bristle_made_is_replaced(tmp_path: Path) -> None:
    """Results and figures that bristle wrote may be written again; a log, an experiment file or a foreign figure may not."""
    figure = new_figure(2.0)
    figure.subplots().plot([0, 1])
    for name, data in {"r.json": OWN.encode(), "f.png": render(figure)[1], "f.svg": render(figure)[0]}.items():
        (tmp_path / name).write_bytes(data)
        files.write_bytes(tmp_path / name, b"new")
        assert (tmp_path / name).read_bytes() == b"new"
    for name in ("log.csv", "e.yaml", "f.png"):
        (tmp_path / name).write_text("t,q\n0,1 of bristle\n")
        with pytest.raises(ValueError, match="is there already, and bristle did not make it"):
            files.write_text(tmp_path / name, "new")
        assert (tmp_path / name).read_text() == "t,q\n0,1 of bristle\n"


def test_bad_paths_are_refused_in_one_sentence(tmp_path: Path) -> None:
    """A folder, or a file in a folder that does not exist, is refused with what to do."""
    with pytest.raises(ValueError, match="is a folder; name a file"):
        files.write_text(tmp_path, "")
    with pytest.raises(ValueError, match="does not exist; create it"):
        files.write_text(tmp_path / "no" / "file", "")
