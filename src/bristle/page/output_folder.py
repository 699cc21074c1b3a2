"""Files written whole or not at all, and a folder in which only what bristle made is replaced."""

import hashlib
import os
import re
import tempfile
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path, PurePosixPath

from bristle.errors import InputError, check_regular

MANIFEST = ".bristle-manifest"
"""Lists what the last report made in its folder: SHA-256 and relative path, two spaces between; of an interrupted one, old and new."""
_LONGEST = 1_000_000
"""Bytes that a manifest may have."""
_LINE = re.compile(r"([0-9a-f]{64})  (.+)")
_SECONDS = re.compile(rb"(?m)(?<=: )[-+.e0-9]+(?=,?$)")
"""Numbers of timings.json."""
Made = Mapping[str, Collection[str]]
"""Hashes that a file may have, by its path in the folder."""
_OWN = (
    b'"schema": "bristle-results/',
    b"Software\0bristle",
    b"<dc:title>bristle</dc:title>",
    b"time (s),experiment,run,position reference (",
)
"""By which a file that bristle wrote is known, near its beginning: results, a PNG, an SVG, a plan's references."""
_HEAD = 4096


def write_text(path: Path, text: str) -> None:
    """Write a text file in UTF-8 under a temporary name, then rename it; an older file stays whole until then.

    Raises InputError as `check_file` does, and OSError where it cannot be written.
    """
    write_bytes(path, text.encode("utf-8", "backslashreplace"))


def write_bytes(path: Path, data: bytes) -> None:
    """`write_text` for bytes."""
    with staged(path, data):
        pass


@contextmanager
def staged(path: Path, data: bytes) -> Iterator[None]:
    """Write a file under a temporary name, and rename it to its place once the body is done: not at all where that fails.

    Raises as `write_text` does.
    """
    check_file(path)
    with _named(path):
        folder = tempfile.TemporaryDirectory(dir=path.parent, prefix=".bristle-")
    with folder as stage:
        with _named(path):
            _write(Path(stage) / "file", data)
        yield
        with _named(path):
            (Path(stage) / "file").replace(path)


def check_file(path: Path) -> None:
    """Whether a file can be written there, as far as can be told before.

    Raises InputError where the path is a folder or lies in none, is a link, a device or a pipe, or holds a file that bristle did not make.
    """
    if path.is_dir():
        raise InputError(f"{path}: is a folder; name a file")
    if path.parent.exists() and not path.parent.is_dir():
        raise InputError(f"{path}: {path.parent} is no folder; name another file")
    if not path.parent.is_dir():
        raise InputError(f"{path}: its folder {path.parent} does not exist; create it or name another file")
    if _is_there(path, "name another file"):
        with path.open("rb") as file:
            head = file.read(_HEAD)
        if head and not any(mark in head for mark in _OWN):
            raise InputError(f"{path}: is there already, and bristle did not make it; move it, or name another file")


def check_folder(folder: Path) -> None:
    """Whether a report can be written there, as far as can be told before.

    Raises InputError where the folder is none, holds files of the last report that were changed, or neither it nor the nearest one above it that
    exists can be written.
    """
    _refuse_foreign(folder, {})
    nearest = next(path for path in (folder.resolve(), *folder.resolve().parents) if path.exists())
    if not nearest.is_dir() or not os.access(nearest, os.W_OK):
        raise InputError(f"{folder}: {nearest} cannot be written; name another folder")


def _is_there(path: Path, instead: str) -> bool:
    """Whether a regular file is there. InputError where anything else is, a link too: bristle neither follows nor replaces one."""
    if path.is_symlink():
        raise InputError(f"{path}: is a symbolic link, which bristle neither follows nor replaces; {instead}")
    if not os.path.lexists(path):
        return False
    check_regular(path)
    return True


def _write(path: Path, data: bytes) -> None:
    path.write_bytes(data)


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """An OSError of the body names the path that the user gave: a full disk names none, and other errors a temporary one."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error


def replace_files(folder: Path, files: Mapping[str, bytes]) -> None:
    """Put files, by relative POSIX path, into a folder: all of them are written first, and moved to their places only then.

    What the last call made there and this one does not is removed; anything else in the folder stays. The folder may be a link to one; in it
    no link is followed or replaced.

    Raises InputError where the folder is none, its manifest cannot be believed, or files of these names, or of the last call, are not as bristle
    made them, and OSError where it cannot be written (a full disk, no permission); nothing is changed in either case.
    """
    made = _refuse_foreign(folder, files)
    folder = folder.resolve()
    new_folders = [p for p in (folder, *folder.parents) if not p.exists()]
    try:
        with _named(folder):
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory(dir=folder, prefix=".bristle-") as stage:
                _stage(Path(stage), files, made)
                _move(Path(stage), folder, files, made)
    finally:  # also on an interrupt: no empty folder is left behind, and one that holds a report cannot be removed
        for path in new_folders:
            with suppress(OSError):
                path.rmdir()


def _refuse_foreign(folder: Path, files: Mapping[str, bytes]) -> Made:
    """What bristle made in the folder before; InputError where something else is in the way, or one of its files was changed."""
    if os.path.lexists(folder) and not folder.is_dir():
        what = "a symbolic link to no folder" if folder.is_symlink() else "a file" if folder.is_file() else "no folder"
        raise InputError(f"{folder}: is {what}; a report needs a folder, name another one")
    made = _made(folder / MANIFEST)
    for name in {**files, **made}:
        _refuse_links(folder, name)
        if not _is_there(path := folder / name, "move it, or name another folder"):
            continue
        if name not in made:
            raise InputError(f"{path}: is there already, and bristle did not make it; move it, or name another folder")
        if _hash(name, path.read_bytes()) not in made[name]:
            raise InputError(f"{path}: was changed since bristle made it; move it, or name another folder")
    return made


def _refuse_links(folder: Path, name: str) -> None:
    """InputError where what lies between a folder and a file of its is no folder, or a link to one."""
    for part in list(PurePosixPath(name).parents)[:-1]:
        path = folder / part
        if path.is_symlink() or (path.exists() and not path.is_dir()):
            raise InputError(f"{path}: is in the way of the report's own folder; move it, or name another folder")


def _made(manifest: Path) -> Made:
    """The files of a manifest with the hashes that each may have; InputError where it is none, or names what is not below its folder."""
    instead = f"move or remove the folder {manifest.parent}, or name another one"
    if not _is_there(manifest, instead):
        return {}
    with manifest.open("rb") as file:
        lines = file.read(_LONGEST + 1).decode("utf-8", "replace").split("\n")
    found = [_LINE.fullmatch(line) for line in lines[:-1]]
    made: dict[str, set[str]] = {}
    for line in found:
        if line is None or not _is_below(line[2]):
            raise InputError(
                f"{manifest}: is no list of files and their SHA-256 that this version of bristle wrote; {instead}"
            )
        made.setdefault(line[2], set()).add(line[1])
    if lines[-1]:
        raise InputError(f"{manifest}: is cut off, or too long; {instead}")
    return made


def _is_below(name: str) -> bool:
    """Whether a path of a manifest is one that bristle may have written: below the folder, not the manifest, in no odd spelling."""
    path = PurePosixPath(name)
    odd = ".." in path.parts or path.is_absolute() or "\\" in name or "\N{REPLACEMENT CHARACTER}" in name or ":" in name
    return not odd and name.isprintable() and str(path) == name and name not in {MANIFEST, "."}


def _hash(name: str, data: bytes) -> str:
    """SHA-256 of a file; of timings.json without its seconds, so that one result has one manifest."""
    return hashlib.sha256(_SECONDS.sub(b"0", data) if name == "timings.json" else data).hexdigest()


def _stage(stage: Path, files: Mapping[str, bytes], made: Made) -> None:
    new = {name: {_hash(name, data)} for name, data in files.items()}
    for name, data in files.items():
        (stage / name).parent.mkdir(exist_ok=True)
        _write(stage / name, data)
    _write(stage / "before", _listing({name: {*made.get(name, ()), *new.get(name, ())} for name in {**made, **new}}))
    _write(stage / "after", _listing(new))


def _listing(made: Made) -> bytes:
    return "".join(f"{x}  {name}\n" for name in sorted(made) for x in sorted(made[name])).encode()


def _move(stage: Path, folder: Path, files: Mapping[str, bytes], made: Made) -> None:
    """Renames only. The manifest first names old and new files, so that an interrupted move is still known to be bristle's."""
    (stage / "before").replace(folder / MANIFEST)
    for name in files:
        (folder / name).parent.mkdir(exist_ok=True)
        (stage / name).replace(folder / name)
    for name in sorted(set(made) - set(files)):
        with suppress(OSError):
            (folder / name).unlink()
            if (folder / name).parent != folder:
                (folder / name).parent.rmdir()
    (stage / "after").replace(folder / MANIFEST)
