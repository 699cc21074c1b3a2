"""Files written whole or not at all, and a folder in which only what bristle made is replaced."""

import os
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path, PurePosixPath

from bristle.errors import InputError

MANIFEST = ".bristle-manifest"
"""Lists what the last report made in its folder, one relative path per line."""
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
    check_file(path)
    try:
        with tempfile.TemporaryDirectory(dir=path.parent, prefix=".bristle-") as stage:
            _write(Path(stage) / "file", data)
            (Path(stage) / "file").replace(path)
    except OSError as error:
        raise _about(path, error) from error


def check_file(path: Path) -> None:
    """Whether a file can be written there, as far as can be told before.

    Raises InputError where the path is a folder or lies in none, or holds a file that bristle did not make.
    """
    if path.is_dir():
        raise InputError(f"{path}: is a folder; name a file")
    if not path.parent.is_dir():
        raise InputError(f"{path}: its folder {path.parent} does not exist; create it or name another file")
    if path.is_file():
        with path.open("rb") as file:
            head = file.read(_HEAD)
        if head and not any(mark in head for mark in _OWN):
            raise InputError(f"{path}: is there already, and bristle did not make it; move it, or name another file")


def check_folder(folder: Path) -> None:
    """Whether a report can be written there, as far as can be told before.

    Raises InputError where the folder is a file, or neither it nor the nearest one above it that exists can be written.
    """
    _refuse_foreign(folder, {})
    nearest = next(path for path in (folder.resolve(), *folder.resolve().parents) if path.exists())
    if not nearest.is_dir() or not os.access(nearest, os.W_OK):
        raise InputError(f"{folder}: {nearest} cannot be written; name another folder")


def _write(path: Path, data: bytes) -> None:
    path.write_bytes(data)


def _about(path: Path, error: OSError) -> OSError:
    """The error with the path that the user gave: a full disk names none, and other errors a temporary one."""
    return OSError(error.errno, error.strerror or str(error), str(path))


def replace_files(folder: Path, files: Mapping[str, bytes]) -> None:
    """Put files, by relative POSIX path, into a folder: all of them are written first, and moved to their places only then.

    What the last call made there and this one does not is removed; anything else in the folder stays.

    Raises InputError where the folder is a file or holds files of these names that bristle did not make, and OSError where it cannot be
    written (a full disk, no permission); nothing is changed in either case.
    """
    folder = folder.resolve()
    made = _refuse_foreign(folder, files)
    new_folders = [p for p in (folder, *folder.parents) if not p.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder, prefix=".bristle-") as stage:
            _stage(Path(stage), files, made)
            _move(Path(stage), folder, files, made)
    except OSError as error:
        raise _about(folder, error) from error
    finally:  # also on an interrupt: no empty folder is left behind, and one that holds a report cannot be removed
        for path in new_folders:
            with suppress(OSError):
                path.rmdir()


def _refuse_foreign(folder: Path, files: Mapping[str, bytes]) -> set[str]:
    """What bristle made in the folder before; InputError where something else is in the way."""
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file; a report needs a folder, name another one")
    made = _made(folder / MANIFEST)
    for name in files:
        path = folder / name
        if path.parent != folder and (path.parent.is_symlink() or (path.parent.exists() and not path.parent.is_dir())):
            raise InputError(
                f"{path.parent}: is in the way of the report's own folder; move it, or name another folder"
            )
        if os.path.lexists(path) and (name not in made or path.is_dir()):
            raise InputError(f"{path}: is there already, and bristle did not make it; move it, or name another folder")
    return made


def _made(manifest: Path) -> set[str]:
    """Paths in a manifest; any that could point out of the folder is not believed."""
    if not manifest.is_file():
        return set()
    names = manifest.read_text(encoding="utf-8", errors="replace").splitlines()
    return {
        n
        for n in names
        if n and not PurePosixPath(n).is_absolute() and set(PurePosixPath(n).parts).isdisjoint({"..", ""})
    }


def _stage(stage: Path, files: Mapping[str, bytes], made: set[str]) -> None:
    for name, data in files.items():
        (stage / name).parent.mkdir(exist_ok=True)
        _write(stage / name, data)
    _write(stage / "before", _listing(made | set(files)))
    _write(stage / "after", _listing(set(files)))


def _listing(names: set[str]) -> bytes:
    return "".join(f"{name}\n" for name in sorted(names)).encode()


def _move(stage: Path, folder: Path, files: Mapping[str, bytes], made: set[str]) -> None:
    """Renames only. The manifest first names old and new files, so that an interrupted move is still known to be bristle's."""
    (stage / "before").replace(folder / MANIFEST)
    for name in files:
        (folder / name).parent.mkdir(exist_ok=True)
        (stage / name).replace(folder / name)
    for name in sorted(made - set(files)):
        with suppress(OSError):
            (folder / name).unlink()
            if (folder / name).parent != folder:
                (folder / name).parent.rmdir()
    (stage / "after").replace(folder / MANIFEST)
