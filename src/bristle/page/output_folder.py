"""Files written whole or not at all, in place of no other, and a folder in which only what bristle made is replaced."""

import errno
import hashlib
import io
import os
import re
import tempfile
import zipfile
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
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
_NAME = re.compile(
    r"[a-z]+\.html|report\.zip|(results|timings)\.json|figures/[a-z0-9_-]+\.(svg|png|csv)|tables/[a-z0-9_-]+\.csv"
)
"""What a report writes in its folder, and nothing else may a manifest list: only that is ever replaced or removed."""
_TAKEN = frozenset({MANIFEST, "index.html", "results.json", "timings.json", "report.zip", "figures", "tables"})
"""Files and folders of a report."""
_ASIDE = "aside"
"""What was replaced or removed, until all is moved."""
_FORBIDDEN = frozenset({errno.EACCES, errno.EPERM, errno.EROFS})


def write_text(path: Path, text: str) -> None:
    """Write a text file in UTF-8 under a temporary name, then rename it; an older file is never replaced.

    Raises InputError as `check_file` does, and where a file with other bytes is there, and OSError where it cannot be written.
    """
    write_bytes(path, text.encode("utf-8", "backslashreplace"))


def write_bytes(path: Path, data: bytes) -> None:
    """`write_text` for bytes."""
    with staged(path, data):
        pass


@contextmanager
def staged(path: Path, data: bytes) -> Iterator[None]:
    """Write a file under a temporary name, and rename it to its place once the body is done: not at all where that fails.

    One that holds these very bytes stays as it is. Raises as `write_text` does.
    """
    check_file(path)
    if _is_there(path, "name another file"):
        with _named(path, "file"):
            same = path.stat().st_size == len(data) and path.read_bytes() == data
        if not same:
            raise InputError(f"{path}: is there already; move it, or name another file")
        yield
        return
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
    """Whether a file can be written there, as far as can be told before its bytes are known.

    Raises InputError where the path is a folder or lies in none or in one that cannot be written, or is a link, a device or a pipe.
    """
    with _named(path, "file"):
        if path.is_dir():
            raise InputError(f"{path}: is a folder; name a file")
        if not path.parent.is_dir() and os.path.lexists(path.parent):
            raise InputError(f"{path}: {path.parent} is no folder; name another file")
        if not path.parent.is_dir():
            raise InputError(f"{path}: its folder {path.parent} does not exist; create it or name another file")
        _is_there(path, "name another file")
        _check_writable(path.parent, path, "file")


def check_absent(path: Path) -> None:
    """Whether a new file can be written there. Raises InputError as `check_file` does, and where a file is there already."""
    check_file(path)
    if os.path.lexists(path):
        raise InputError(f"{path}: is there already; move it, or name another file")


def check_folder(folder: Path, *names: str) -> None:
    """Whether a report can be written there, files of these names in it too, as far as can be told before.

    Raises InputError where the folder is none, holds files of the last report that were changed, or neither it nor the nearest one above it that
    exists can be written, or one in it that a report writes to.
    """
    with _named(folder, "folder"):
        _check_folders(folder, {"figures", "tables", *_folders(_refuse_foreign(folder, dict.fromkeys(names, b"")))})


def check_apart(file: Path, folder: Path) -> None:
    """InputError where a file would be in the way of the folder of a page, or lies in it under a name that the page takes."""
    at, real = resolved(file), resolved(folder)
    if at in (real, *real.parents):
        raise InputError(f"{file}: is in the way of the page in {folder}; name another file or folder")
    if real in at.parents and at.relative_to(real).parts[0].lower() in _TAKEN:
        raise InputError(f"{file}: is where the page in {folder} puts its own files; name another file or folder")


def resolved(path: Path) -> Path:
    """The path without links. InputError where links lead round in a circle."""
    try:
        return path.resolve()
    except (OSError, RuntimeError) as error:
        raise InputError(f"{path}: its symbolic links lead round in a circle; name another path") from error


def _folders(names: Iterable[str]) -> set[str]:
    """Where files of a report lie in its folder."""
    return {str(PurePosixPath(name).parent) for name in names}


def _check_folders(folder: Path, parts: Iterable[str]) -> None:
    """InputError where a folder, or the nearest above it that exists, or one of these in it, cannot be written."""
    real = resolved(folder)
    nearest = next(path for path in (real, *real.parents) if path.exists())
    shown = next((path for path in (folder, *folder.parents) if resolved(path) == nearest), nearest)
    if not nearest.is_dir():
        raise InputError(f"{folder}: {shown} cannot be written, for it is no folder; name another one")
    _check_writable(shown, folder, "folder")
    for path in (folder / part for part in sorted(parts)):
        if path.exists():
            _check_writable(path, folder, "folder")


def _check_writable(folder: Path, given: Path, what: str) -> None:
    if not os.access(folder, os.W_OK | os.X_OK):
        where = "" if folder == given else f"the folder {folder} "
        raise InputError(f"{given}: {where}cannot be written; name another {what}, or change its permissions")


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
def _named(path: Path, what: str) -> Iterator[None]:
    """An OSError of the body names the path that the user gave: a full disk names none, and other errors a temporary one.

    Where permission is missing, an InputError says what to do.
    """
    try:
        yield
    except OSError as error:
        if error.errno in _FORBIDDEN:
            why = f"cannot be read or written ({error.strerror})"
            raise InputError(f"{path}: {why}; name another {what}, or change its permissions") from error
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error


def zipped(files: Mapping[str, bytes]) -> bytes:
    """Files, by relative POSIX path, as one ZIP archive: the same bytes for the same files. timings.json, which differs each time, is left out."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in sorted(files.keys() - {"timings.json"}):
            entry = zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
            entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            archive.writestr(entry, files[name])
    return buffer.getvalue()


def replace_files(folder: Path, files: Mapping[str, bytes]) -> None:
    """Put files, by relative POSIX path, into a folder: all of them are written first, and moved to their places only then.

    What the last call made there and this one does not is removed; anything else in the folder stays. The folder may be a link to one; in it
    no link is followed or replaced.

    Raises InputError where the folder is none, its manifest cannot be believed, or files of these names, or of the last call, are not as bristle
    made them, or it cannot be written, and OSError where that shows on the way (a full disk); nothing is changed in either case.
    """
    if odd := [name for name in files if not _NAME.fullmatch(name)]:
        raise ValueError(f"{odd[0]}: is no name of a report's file")
    with _named(folder, "folder"):
        made = _refuse_foreign(folder, files)
        _check_folders(folder, _folders({**files, **made}))
    real = resolved(folder)
    new_folders = [p for p in (real, *real.parents) if not p.exists()]
    try:
        with _named(folder, "folder"):
            real.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory(dir=real, prefix=".bristle-") as stage:
                _stage(Path(stage), real, files, made)
                _move(Path(stage), real, files, made)
    finally:  # also on an interrupt: no empty folder is left behind, and one that holds a report cannot be removed
        _remove_empty(new_folders)


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
        with _named(path, "folder"):
            data = path.read_bytes()
        if _hash(name, data) not in made[name]:
            raise InputError(f"{path}: was changed since bristle made it; move it, or name another folder")
    return made


def _refuse_links(folder: Path, name: str) -> None:
    """InputError where what lies between a folder and a file of its is no folder, or a link to one."""
    for part in list(PurePosixPath(name).parents)[:-1]:
        path = folder / part
        if path.is_symlink() or (path.exists() and not path.is_dir()):
            raise InputError(f"{path}: is in the way of the report's own folder; move it, or name another folder")


def _made(manifest: Path) -> Made:
    """The files of a manifest with the hashes that each may have; InputError where it is none, or names what no report holds."""
    instead = f"move or remove the folder {manifest.parent}, or name another one"
    if not _is_there(manifest, instead):
        return {}
    with _named(manifest, "folder"), manifest.open("rb") as file:
        lines = file.read(_LONGEST + 1).decode("utf-8", "replace").split("\n")
    found = [_LINE.fullmatch(line) for line in lines[:-1]]
    made: dict[str, set[str]] = {}
    for line in found:
        if line is None or not _NAME.fullmatch(line[2]):
            raise InputError(
                f"{manifest}: is no list of files and their SHA-256 that this version of bristle wrote; {instead}"
            )
        made.setdefault(line[2], set()).add(line[1])
    if lines[-1]:
        raise InputError(f"{manifest}: is cut off, or too long; {instead}")
    return made


def _hash(name: str, data: bytes) -> str:
    """SHA-256 of a file; of timings.json without its seconds, so that one result has one manifest."""
    return hashlib.sha256(_SECONDS.sub(b"0", data) if name == "timings.json" else data).hexdigest()


def _stage(stage: Path, folder: Path, files: Mapping[str, bytes], made: Made) -> None:
    """All that is to be moved, and a copy of the manifest, which is replaced in one step and never gone."""
    new = {name: {_hash(name, data)} for name, data in files.items()}
    for part in _folders({**files, **made}) | {"."}:
        (stage / part).mkdir(exist_ok=True)
        (stage / _ASIDE / part).mkdir(parents=True, exist_ok=True)
    for name, data in files.items():
        _write(stage / name, data)
    if (folder / MANIFEST).exists():
        _write(stage / _ASIDE / MANIFEST, (folder / MANIFEST).read_bytes())
    _write(stage / "before", _listing({name: {*made.get(name, ()), *new.get(name, ())} for name in {**made, **new}}))
    _write(stage / "after", _listing(new))


def _listing(made: Made) -> bytes:
    return "".join(f"{x}  {name}\n" for name in sorted(made) for x in sorted(made[name])).encode()


def _move(stage: Path, folder: Path, files: Mapping[str, bytes], made: Made) -> None:
    """Renames only, and back again where one fails. The manifest first names old and new files: even a move that was killed is known as bristle's."""
    added = [path for part in sorted(_folders(files)) if not (path := folder / part).exists()]
    begun = [(MANIFEST, (folder / MANIFEST).exists())]
    try:
        (stage / "before").replace(folder / MANIFEST)
        for path in added:
            path.mkdir(exist_ok=True)
        for name in sorted({**files, **made}):
            begun.append((name, os.path.lexists(folder / name)))
            if begun[-1][1]:
                (folder / name).replace(stage / _ASIDE / name)
            if name in files:
                (stage / name).replace(folder / name)
        (stage / "after").replace(folder / MANIFEST)
    except BaseException:
        _put_back(stage, folder, begun)
        _remove_empty(added)
        raise
    _remove_empty([folder / part for part in _folders(made) - {"."}])


def _put_back(stage: Path, folder: Path, begun: Sequence[tuple[str, bool]]) -> None:
    """Undo a move, the manifest last: where anything else cannot be put back, it goes on naming old and new files.

    Args:
        stage: which holds what was there, aside.
        folder: of the report.
        begun: what was moved, or was about to be, and whether it was there before.
    """
    whole = True
    for name, there in reversed(begun):
        if name == MANIFEST and not whole:
            return
        try:
            if not there:
                (folder / name).unlink(missing_ok=True)
            elif (stage / _ASIDE / name).exists():
                (stage / _ASIDE / name).replace(folder / name)
        except OSError:
            whole = False


def _remove_empty(folders: Iterable[Path]) -> None:
    for path in folders:
        with suppress(OSError):
            path.rmdir()
