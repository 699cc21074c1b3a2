"""Local and remote files (by fsspec) of a fleet; they are written whole or not at all."""

import hashlib
import secrets
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

from bristle.errors import InputError, check_regular, one_line
from bristle.page.output_folder import MARKER, claim, listed, marker_of

_LOCAL = ("file://", "local://")
_MODIFIED = (
    "mtime", "LastModified", "last_modified", "updated", "modified", "created", "ETag", "etag", "md5", "version",
)  # fmt: skip  # of file systems, by which a file is known to be the same
_WHOLE = frozenset({"s3", "s3a", "gs", "gcs", "abfs", "abfss", "az", "oci", "memory", "github", "http", "https"})
"""Protocols with atomic writes."""


class Stamp(NamedTuple):
    """Size and modification of a file, by which it is known to be the same without being read."""

    size: int
    modified: str  # time of modification, or an equivalent of the file system


def is_remote(name: str) -> bool:
    """Whether a name is a URL of a remote file system."""
    return "://" in name and not name.startswith(_LOCAL)


def local_path(name: str) -> Path:
    """The path of a file of this machine."""
    for prefix in _LOCAL:
        name = name.removeprefix(prefix)
    return Path(name)


def joined_path(folder: str, name: str) -> str:
    """A file by its name relative to a folder; a URL or an absolute path is kept."""
    if is_remote(name) or name.startswith(_LOCAL):
        return name
    if is_remote(folder):
        return f"{folder.rstrip('/')}/{name.lstrip('/')}"
    return str(local_path(folder) / name)


def folder_of(name: str) -> str:
    """The folder of a file."""
    return name.rpartition("/")[0] if is_remote(name) else str(local_path(name).parent)


def name_of(name: str) -> str:
    """The last part of a path or URL."""
    return name.rstrip("/").rpartition("/")[2]


@contextmanager
def _system(name: str) -> Iterator[tuple[Any, str]]:
    """The file system of a name, and its path there. Raises InputError where there is none; other errors as OSError."""
    from fsspec.core import url_to_fs
    from fsspec.implementations.local import LocalFileSystem

    try:
        yield url_to_fs(name) if is_remote(name) else (LocalFileSystem(), str(local_path(name)))
    except (OSError, InputError):
        raise
    except ImportError as error:
        raise InputError(
            f"{name}: {one_line(str(error), 150)}; install it on this machine and on the workers"
        ) from error
    except ValueError as error:
        raise InputError(f"{name}: {one_line(str(error), 150)}; expected a path, or a URL that fsspec knows") from error
    except Exception as error:  # each library has exceptions of its own
        raise OSError(f"{name}: {one_line(str(error), 200)}") from error


def stamp(name: str) -> Stamp:
    """The stamp of a file. Raises OSError where there is none, and InputError where it is no file."""
    if not is_remote(name):
        path = local_path(name)
        check_regular(path)
        found = path.stat()
        return Stamp(found.st_size, str(found.st_mtime_ns))
    with _system(name) as (system, place):
        about = system.info(place)
    if about.get("type") == "directory":
        raise InputError(f"{name}: is a folder; expected a file")
    return Stamp(int(about.get("size") or 0), " ".join(str(about[key]) for key in _MODIFIED if about.get(key)))


def read_bytes(name: str, most: int | None = None) -> bytes:
    """The bytes of a file. Raises OSError where it cannot be read, and InputError where it has more than `most`."""
    if is_remote(name):
        with _system(name) as (system, place):
            data = bytes(system.cat_file(place, end=None if most is None else most + 1))
        if most is None or len(data) <= most:
            return data
    else:
        check_regular(path := local_path(name))
        if most is None or path.stat().st_size <= most:
            return path.read_bytes()
    raise InputError(f"{name}: larger than {most} bytes")


def digest_of(name: str) -> str:
    """SHA-256 of a file, read in pieces. Raises OSError where it cannot be read."""
    if not is_remote(name):
        check_regular(local_path(name))
    with _system(name) as (system, place), system.open(place, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def exists(name: str) -> bool:
    """Whether a file or folder exists."""
    with _system(name) as (system, place):
        return bool(system.exists(place))


def is_folder(name: str) -> bool:
    """Whether a folder exists."""
    with _system(name) as (system, place):
        return bool(system.isdir(place))


def names_in(folder: str) -> list[str]:
    """The names in a folder, sorted; empty without such a folder."""
    with _system(folder) as (system, place):
        system.invalidate_cache()
        try:
            return sorted(name_of(found) for found in system.ls(place, detail=False))
        except (FileNotFoundError, NotADirectoryError):
            return []


def glob_of(pattern: str) -> list[str]:
    """Absolute paths or URLs of the files that match a pattern, sorted; `**` matches any number of folders."""
    with _system(pattern) as (system, path):
        found = sorted(map(str, system.glob(path)))
    inside = path.lstrip("/")
    if not is_remote(pattern):
        return found
    if not pattern.endswith(inside):  # a chain of file systems
        return [str(system.unstrip_protocol(one)) for one in found]
    return [f"{pattern.removesuffix(inside)}{one.lstrip('/')}" for one in found]


def make_folder(folder: str) -> None:
    """Make a folder and its parents. Raises OSError where it cannot be made."""
    with _system(folder) as (system, place), suppress(FileExistsError):
        system.makedirs(place, exist_ok=True)


def claim_folder(folder: str, claims: Collection[str]) -> None:
    """Mark a folder as bristle's, with these names. Raises InputError where others' files are in the way."""
    if not is_remote(folder):
        claim(local_path(folder), claims)
        return
    place, names = joined_path(folder, MARKER), names_in(folder)
    if names and MARKER not in names:
        raise InputError(f"{folder}: is not empty, and bristle did not make it; name a new or an empty folder")
    made = listed(folder, read_bytes(place), names, claims) if names else set()
    make_folder(folder)
    write_whole(place, marker_of({*made, *claims}))


def write_whole(name: str, data: bytes) -> None:
    """Write or replace a file, whole or not at all. Raises OSError where it cannot be written."""
    if is_remote(name):
        with _system(name) as (system, place):
            protocols = {system.protocol} if isinstance(system.protocol, str) else set(system.protocol)
            folder, _, last = place.rpartition("/")
            there = place if protocols & _WHOLE else f"{folder}/.{last}.{secrets.token_hex(4)}"
            system.pipe_file(there, data)
            if there != place:
                system.mv(there, place)
        return
    path = local_path(name)
    aside = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
    try:
        aside.write_bytes(data)
        aside.replace(path)
    except OSError as error:  # names no file, or the temporary one
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error
    finally:
        aside.unlink(missing_ok=True)


def remove(name: str) -> None:
    """Remove a file, if it exists. Raises OSError where it cannot be removed."""
    with _system(name) as (system, place), suppress(FileNotFoundError):
        system.rm_file(place)
