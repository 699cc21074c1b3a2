"""Which files a bag is: one file, or a folder with metadata.yaml and the storage files that it names."""

import hashlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from bristle.data.experiment.yaml_file import parse, read_text
from bristle.data.ros.bag1 import bag1_batches, bag1_channels
from bristle.data.ros.mcap import mcap_batches, mcap_channels
from bristle.data.ros.sqlite import sqlite_batches, sqlite_channels
from bristle.data.ros.storage import Budget, Channel, MessageBatch, unpacked
from bristle.errors import InputError, check_regular, short

METADATA = "metadata.yaml"
MAX_BYTES = 2**34
"""Largest bag, bytes: it may hold much that is not read."""
_MOST_FILES = 1000
_HEAD = "rosbag2_bagfile_information"


class _Storage(NamedTuple):
    """How a storage file is read."""

    channels: Callable[[Path], list[Channel]]
    batches: Callable[[Path, frozenset[int]], Iterator[MessageBatch]]


_STORAGES = {
    ".mcap": _Storage(mcap_channels, mcap_batches),
    ".db3": _Storage(sqlite_channels, sqlite_batches),
    ".bag": _Storage(bag1_channels, bag1_batches),
}


_ROS2 = (".mcap", ".db3")


class Bag(NamedTuple):
    """The files of a bag."""

    files: tuple[Path, ...]
    distribution: str | None = None
    """Of ROS 2, where metadata.yaml names it."""
    packed: bool = False
    """Whether each message is compressed by zstd, as metadata.yaml says."""


def is_bag(path: Path) -> bool:
    """Whether a path is that of a bag: .mcap, .db3, .bag, or a folder with metadata.yaml."""
    return path.suffix.lower() in _STORAGES if not path.is_dir() else (path / METADATA).exists()


def open_bag(path: Path) -> Bag:
    """The files of a bag, each regular and, together, of at most `MAX_BYTES`. Raises InputError and OSError."""
    bag = _of_folder(path) if path.is_dir() else Bag((path,))
    _check_installed()
    size = 0
    for file in bag.files:
        check_regular(file, file.name)
        size += file.stat().st_size
    if size > MAX_BYTES:
        raise InputError(f"is {size} bytes long, over the limit of {MAX_BYTES}; cut the bag into several runs")
    if size == 0:
        raise InputError("the file is empty; expected a bag with messages")
    return bag


def channels_of(file: Path) -> list[Channel]:
    """The channels of a storage file. Raises InputError."""
    return _STORAGES[file.suffix.lower()].channels(file)


def batches_of(file: Path, wanted: frozenset[int], *, packed: bool = False) -> Iterator[MessageBatch]:
    """The messages of some channels of a storage file, each unpacked where they are packed. Raises InputError."""
    batches, budget = _STORAGES[file.suffix.lower()].batches(file, wanted), Budget(file.stat().st_size)
    return (unpacked(batch, budget) for batch in batches) if packed else batches


def _check_installed() -> None:
    try:
        import rosbags.typesys  # noqa: F401
    except ImportError as error:
        raise InputError("is a ROS bag, which needs rosbags; install it with pip install 'bristle[ros]'") from error


def digest_of(bag: Bag) -> str:
    """SHA-256 of a bag's file; of a folder over its storage files, one after another, in the order of metadata.yaml."""
    digest = hashlib.sha256()
    for path in bag.files:
        with path.open("rb") as file:
            for piece in iter(lambda: file.read(2**20), b""):
                digest.update(piece)
    return digest.hexdigest()


def _of_folder(folder: Path) -> Bag:
    """The storage files that metadata.yaml names, all inside the folder. Raises InputError."""
    text = read_text(folder / METADATA)
    about = parse(text, METADATA).get(_HEAD)
    if not isinstance(about, dict):
        raise InputError(f"{METADATA} holds no {_HEAD}; expected the folder of a ROS 2 bag")
    mode, form = (str(about.get(f"compression_{name}") or "none").lower() for name in ("mode", "format"))
    if mode not in ("none", "message") or (mode == "message" and form != "zstd"):
        raise InputError(
            f"{METADATA}: compression_mode {short(mode)} by {short(form)} is not read; convert the bag with ros2 bag convert, "
            "uncompressed or as MCAP with compressed chunks"
        )
    names = about.get("relative_file_paths")
    if not isinstance(names, list) or not 0 < len(names) <= _MOST_FILES:
        raise InputError(f"{METADATA}: got relative_file_paths {short(names)}; expected the names of the storage files")
    distribution = about.get("ros_distro")
    files = tuple(dict.fromkeys(_inside(folder, name) for name in names))
    return Bag(files, distribution if isinstance(distribution, str) else None, mode == "message")


def _inside(folder: Path, name: Any) -> Path:
    """A storage file by its name, which leads nowhere else, through no link either.

    The oldest bags name their own folder before it, as it was called then.
    """
    path = Path(name) if isinstance(name, str) and "\0" not in name else Path()
    if not 0 < len(path.parts) < 3 or path.is_absolute() or ".." in path.parts or path.suffix.lower() not in _ROS2:
        raise InputError(
            f"{METADATA}: got the file {short(name)}; expected the name of a .mcap or .db3 file in the folder of the bag"
        )
    file = folder / path.name
    if not file.exists():
        raise InputError(f"{METADATA}: file {short(path.name)} is not in the folder of the bag; copy it there")
    if file.resolve().parent != folder.resolve():
        raise InputError(f"{METADATA}: file {short(path.name)} is a link out of the folder of the bag; copy it there")
    return file
