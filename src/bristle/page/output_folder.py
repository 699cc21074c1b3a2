"""Files written whole or not at all, replacing no other, and a folder in which only what bristle made is replaced."""

import errno
import io
import os
import re
import tempfile
import zipfile
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from bristle.errors import InputError, check_regular

MARKER = ".bristle-manifest"  # in a folder of bristle's: what bristle made in it, a relative path a line
# names of a page and its files
_PAGE = re.compile(r"[a-z]+\.html|report\.zip|results\.json|figures/[a-z0-9_-]+\.(svg|png|csv)|tables/[a-z0-9_-]+\.csv")
# the dataset of a fleet: a marker may list nothing else than these and the files of a page
RESULTS, TASKS, LEDGER, LOCK = FLEET = ("results", "tasks", "ledger.json", ".lock")
# files of a folder that no page of another question may replace
_WHOLE = {"results.json": "a report", "ledger.json": "a fleet"}
_FILES = ("index.html", "results.json", "report.zip")  # files that most pages have


def write_text(path: Path, text: str) -> None:
    """Write a new text file in UTF-8 under a temporary name, then rename it.

    Raises InputError as `check_file` does, and where a file with other bytes is there, and OSError where it cannot be
    written.
    """
    write_bytes(path, text.encode("utf-8", "backslashreplace"))


def write_bytes(path: Path, data: bytes) -> None:
    """`write_text` for bytes."""
    with staged(path, data):
        pass


@contextmanager
def staged(path: Path, data: bytes) -> Iterator[None]:
    """Write a file under a temporary name, and rename it once the body is done; not at all where that fails.

    One that holds these very bytes stays as it is. Raises as `write_text` does.
    """
    check_file(path)
    with _named(path, "file"):
        same = path.is_file() and path.stat().st_size == len(data) and path.read_bytes() == data
    if same:
        yield
        return
    check_absent(path)
    with _named(path, "file"):
        folder = tempfile.TemporaryDirectory(dir=path.parent, prefix=".bristle-")
    with folder as stage:
        with _named(path, "file"):
            _write(Path(stage) / "file", data)
        yield
        if os.path.lexists(path):
            raise InputError(f"{path}: is there by now; move it, or name another file")
        with _named(path, "file"):
            (Path(stage) / "file").replace(path)


def check_file(path: Path) -> None:
    """Raise InputError where a file cannot be written, as far as can be told before its bytes are known.

    A path that is a folder, a link, a device or a pipe, or lies in no folder or in one that cannot be written.
    """
    with _named(path, "file"):
        if path.is_dir():
            raise InputError(f"{path}: is a folder; name a file")
        if not path.parent.is_dir():
            there, folder = os.path.lexists(path.parent), path.parent
            why = f"{folder} is not a folder;" if there else f"its folder {folder} does not exist; create it or"
            raise InputError(f"{path}: {why} name another file")
        _is_there(path, "name another file")
        _check_writable(path.parent, path, "file")


def check_absent(path: Path) -> None:
    """Raise InputError as `check_file` does, and where a file is there already."""
    check_file(path)
    if os.path.lexists(path):
        raise InputError(f"{path}: is there already; move it, or name another file")


def check_folder(folder: Path, claims: Collection[str] = ()) -> set[str]:
    """What bristle made in a folder that it may write to, by relative POSIX path; asked before anything is computed.

    `claims` are the names in it that are to be written, as far as they are known. Raises InputError where it is no
    folder, is neither empty nor marked as bristle's, has an invalid marker, holds a report or a fleet that is not to be
    written anew, a file under a name to be written that the marker does not list, or a link in place of one; and where
    it, a folder in it that a page writes to, or the nearest existing one above cannot be written.
    """
    if os.path.lexists(folder) and not folder.is_dir():
        what = (
            "a symbolic link to no folder" if folder.is_symlink() else "a file" if folder.is_file() else "not a folder"
        )
        raise InputError(f"{folder}: is {what}; a report needs a folder, name another one")
    made = set[str]()
    with _named(folder, "folder"):
        if folder.is_dir() and any(folder.iterdir()):
            if not _is_there(folder / MARKER, f"move or remove the folder {folder}, or name another one"):
                raise InputError(f"{folder}: is not empty, and bristle did not make it; name a new or an empty folder")
            for path in (folder / "figures", folder / "tables"):
                if path.is_symlink() or (path.exists() and not path.is_dir()):
                    why = "is in the way of the report's own folder"
                    raise InputError(f"{path}: {why}; move it, or name another folder")
            found = [path for part in (".", "figures", "tables") for path in (folder / part).glob("*")]
            names = {path.relative_to(folder).as_posix(): path for path in found}
            made = listed(str(folder), (folder / MARKER).read_bytes(), names, claims)
            for name in names.keys() & made:
                if _PAGE.fullmatch(name) or names[name].is_symlink() or not names[name].is_dir():
                    _is_there(names[name], "move it, or name another folder")
        real = resolved(folder)
        nearest = next(path for path in (real, *real.parents) if path.exists())
        shown = next((path for path in (folder, *folder.parents) if resolved(path) == nearest), nearest)
        if not nearest.is_dir():
            raise InputError(f"{folder}: {shown} cannot be written, because it is not a folder; name another one")
        for path in (shown, *filter(Path.exists, (folder / "figures", folder / "tables"))):
            _check_writable(path, folder, "folder")
    return made


def listed(folder: str, marker: bytes, names: Iterable[str], claims: Collection[str]) -> set[str]:
    """The names that a marker lists.

    Raises InputError where it is no marker, does not list an existing name that is to be written, or is of a report or
    a fleet that is not to be.
    """
    lines = marker.decode("utf-8", "replace").split("\n")
    if lines[-1] or not all(_PAGE.fullmatch(line) or line in FLEET for line in lines[:-1]):
        instead = f"move or remove the folder {folder}, or name another one"
        raise InputError(f"{folder}/{MARKER}: is not a list of files that bristle wrote; {instead}")
    if foreign := [x for x in sorted(names) if x in {*_FILES, *claims} and x not in lines]:
        why = "is there already, and bristle did not make it; move it, or name another folder"
        raise InputError(f"{folder}/{foreign[0]}: {why}")
    if others := [what for name, what in _WHOLE.items() if name in lines and name not in claims]:
        raise InputError(f"{folder}: holds {others[0]}, which another page would replace; name another folder")
    return set(lines[:-1])


def marker_of(names: Iterable[str]) -> bytes:
    """The marker that lists these names."""
    return "".join(f"{name}\n" for name in sorted(names)).encode()


def claim(folder: Path, claims: Collection[str]) -> None:
    """Mark a folder, made where needed, as bristle's, with these names in it. Raises as `check_folder`, and OSError."""
    made = check_folder(folder, claims)
    with _named(folder, "folder"):
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder, prefix=".bristle-") as stage:
            _write(Path(stage) / MARKER, marker_of({*made, *claims}))
            (Path(stage) / MARKER).replace(folder / MARKER)


def check_apart(file: Path, folder: Path) -> None:
    """Raise InputError where a file would be in the way of a page's folder, or has a name that the page takes."""
    at, real = resolved(file), resolved(folder)
    if at in (real, *real.parents):
        raise InputError(f"{file}: is in the way of the page in {folder}; name another file or folder")
    if real in at.parents and at.relative_to(real).parts[0].lower() in {MARKER, *_FILES, "figures", "tables"}:
        raise InputError(f"{file}: is where the page in {folder} puts its own files; name another file or folder")


def resolved(path: Path) -> Path:
    """The path without links. Raises InputError where links lead round in a circle."""
    try:
        found = path.resolve()
        with suppress(FileNotFoundError, NotADirectoryError, PermissionError):
            path.stat()  # from Python 3.13 on, what is resolved may be a circle
        return found
    except (OSError, RuntimeError) as error:
        raise InputError(f"{path}: its symbolic links lead round in a circle; name another path") from error


def _check_writable(folder: Path, given: Path, what: str) -> None:
    if not os.access(folder, os.W_OK | os.X_OK):
        where = "" if folder == given else f"the folder {folder} "
        raise InputError(f"{given}: {where}cannot be written; name another {what}, or change its permissions")


def _is_there(path: Path, instead: str) -> bool:
    """Whether a regular file is there. Raises InputError where anything else is: no link is followed or replaced."""
    if path.is_symlink():
        raise InputError(f"{path}: is a symbolic link, which bristle neither follows nor replaces; {instead}")
    if not os.path.lexists(path):
        return False
    check_regular(path)
    return True


def _write(path: Path, data: bytes) -> None:
    path.write_bytes(data)


@contextmanager
def _named(path: Path, what: str) -> Iterator[None]:
    """Name the path that the user gave in an OSError: a full disk names none, other errors a temporary one.

    Where permission is missing, raises an InputError that says what to do.
    """
    try:
        yield
    except OSError as error:
        if error.errno in {errno.EACCES, errno.EPERM, errno.EROFS}:
            why = f"cannot be read or written ({error.strerror})"
            raise InputError(f"{path}: {why}; name another {what}, or change its permissions") from error
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error


def zipped(files: Mapping[str, bytes]) -> bytes:
    """Files, by relative POSIX path, as a reproducible ZIP archive."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in sorted(files):
            entry = zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
            entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            archive.writestr(entry, files[name])
    return buffer.getvalue()


def replace_files(folder: Path, files: Mapping[str, bytes], claims: Collection[str] = ()) -> None:
    """Put files, by relative POSIX path, into a folder: all are written beside their places first, then renamed.

    A folder that is not there appears with all its files in one rename. In one that bristle made, the files of the last
    page are replaced, or removed, and index.html comes last: a run that is killed meanwhile leaves a folder without it,
    which the next run mends. Anything that the marker does not list stays. The folder may be a link to one; in it no
    link is followed or replaced.

    Raises InputError as `check_folder` does, and OSError where a file cannot be written; nothing is changed in either
    case.
    """
    if odd := [name for name in files if not _PAGE.fullmatch(name)]:
        raise ValueError(f"{odd[0]}: is not the name of a report's file")
    made, real = check_folder(folder, {*files, *claims}), resolved(folder)
    absent = [path for path in (real, *real.parents) if not path.exists()]
    try:
        with _named(folder, "folder"):
            (real.parent if absent else real).mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory(dir=real.parent if absent else real, prefix=".bristle-") as stage:
                new, kept = Path(stage) / "new", {name for name in made if not _PAGE.fullmatch(name)}
                for part in (".", "figures", "tables"):
                    if part == "." or any(name.startswith(part) for name in files):
                        (new / part).mkdir(parents=True)
                for name, data in {**files, MARKER: marker_of({*files, *kept})}.items():
                    _write(new / name, data)
                if absent:
                    new.replace(real)
                else:
                    _write(Path(stage) / "both", marker_of({*files, *made}))
                    _move(Path(stage), real, files, made - kept)
    finally:  # also on an interrupt: no empty folder is left behind, and one that holds a report cannot be removed
        _remove_empty(absent)


def _move(stage: Path, folder: Path, files: Iterable[str], made: Iterable[str]) -> None:
    """Renames only. The marker first lists old and new files, so that an interrupted move is known as bristle's."""
    (stage / "both").replace(folder / MARKER)
    (folder / "index.html").unlink(missing_ok=True)
    for name in sorted(files, key=lambda name: (name == "index.html", name)):
        (folder / name).parent.mkdir(exist_ok=True)
        (stage / "new" / name).replace(folder / name)
    for name in {*made} - {*files}:
        (folder / name).unlink(missing_ok=True)
    (stage / "new" / MARKER).replace(folder / MARKER)
    _remove_empty([folder / "figures", folder / "tables"])


def _remove_empty(folders: Iterable[Path]) -> None:
    for path in folders:
        with suppress(OSError):
            path.rmdir()
