"""The files of bags, by the readers of rosbags: one file, or a folder with metadata.yaml and the storage files that it names.

rosbags unpacks a chunk whole, whatever size it claims: a bag of strangers can take all memory that the process may have.
"""

import hashlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import islice
from operator import index
from pathlib import Path
from typing import Any, NamedTuple

from bristle.data.columns import reading
from bristle.data.experiment.yaml_file import parse, read_text
from bristle.errors import InputError, check_regular, short

DAMAGED = "record it again, or repair it with the tools of ROS (ros2 bag reindex, mcap recover, rosbag reindex)"
"""What to do about a damaged bag."""
WHAT = "ROS bag that ended in order"
_MOST, _RATIO, _BYTES = 2**33, 200, 2**23
"""Bytes of messages that are read of one bag: so many, or so many times its size beyond the last."""
METADATA = "metadata.yaml"
MAX_BYTES = 2**34  # largest bag, bytes: it may hold much that is not read
_SUFFIXES = (".mcap", ".db3", ".bag")
_MOST_FILES = 1000
_HEAD = "rosbag2_bagfile_information"


class Bag(NamedTuple):
    """One file, or a folder with metadata.yaml."""

    path: Path
    files: tuple[Path, ...]  # its storage files
    distribution: str | None = None  # of ROS 2, where metadata.yaml names it


def is_bag(path: Path) -> bool:
    """Whether a path is that of a bag: .mcap, .db3, .bag, or a folder with metadata.yaml."""
    return path.suffix.lower() in _SUFFIXES if not path.is_dir() else (path / METADATA).exists()


def open_bag(path: Path) -> Bag:
    """The files of a bag, each regular and, together, of at most `MAX_BYTES`. Raises InputError and OSError."""
    bag = _of_folder(path) if path.is_dir() else Bag(path, (path,))
    try:
        import rosbags.typesys  # noqa: F401
    except ImportError as error:
        raise InputError("is a ROS bag, which needs rosbags; install it with pip install 'bristle[ros]'") from error
    size = 0
    for file in bag.files:
        check_regular(file, file.name)
        size += file.stat().st_size
        log = file.with_name(f"{file.name}-wal")
        if log.exists() and log.stat().st_size:
            raise InputError(
                f"has messages in {log.name} that are not in it yet; close what writes it, or open it once with sqlite3"
            )
    if size > MAX_BYTES:
        raise InputError(f"is {size} bytes long, over the limit of {MAX_BYTES}; cut the bag into several runs")
    if size == 0:
        raise InputError("the file is empty; expected a bag with messages")
    return bag


def digest_of(bag: Bag) -> str:
    """SHA-256 of a bag's file; of a folder over its storage files, one after another, in the order of metadata.yaml."""
    digest = hashlib.sha256()
    for path in bag.files:
        with path.open("rb") as file:
            hashlib.file_digest(file, lambda: digest)
    return digest.hexdigest()


def _of_folder(folder: Path) -> Bag:
    """The storage files that metadata.yaml names, all inside the folder, through no link either. Raises InputError.

    The oldest bags name their own folder before a file, as it was called then.
    """
    about = parse(read_text(folder / METADATA), METADATA).get(_HEAD)
    if not isinstance(about, dict):
        raise InputError(f"{METADATA} holds no {_HEAD}; expected the folder of a ROS 2 bag")
    names, distribution = about.get("relative_file_paths"), about.get("ros_distro")
    if not isinstance(names, list) or not 0 < len(names) <= _MOST_FILES:
        raise InputError(f"{METADATA}: got relative_file_paths {short(names)}; expected the names of the storage files")
    files = dict[Path, None]()
    for name in names:
        path = Path(name) if isinstance(name, str) and "\0" not in name else Path()
        known = not {*path.suffixes}.isdisjoint(_SUFFIXES[:2])
        if not 0 < len(path.parts) < 3 or path.is_absolute() or ".." in path.parts or not known:
            raise InputError(
                f"{METADATA}: got the file {short(name)}; expected the name of a .mcap or .db3 file in the folder of the bag"
            )
        file = folder / path.name
        if not file.exists() or file.resolve().parent != folder.resolve():
            why = "is a link out of" if file.exists() else "is not in"
            raise InputError(f"{METADATA}: file {short(path.name)} {why} the folder of the bag; copy it there")
        files[file] = None
    return Bag(folder, tuple(files), distribution if isinstance(distribution, str) else None)


@contextmanager
def opened(bag: Bag) -> Iterator[Any]:
    """A reader of rosbags with the connections and the messages of a bag. Raises InputError where it cannot be read."""
    from rosbags import rosbag1, rosbag2

    suffix, readers = bag.path.suffix.lower(), rosbag2.Reader.STORAGE_PLUGINS
    with reading(WHAT, DAMAGED):
        reader = (rosbag1.Reader if suffix == ".bag" else readers["dir" if bag.path.is_dir() else suffix])(bag.path)
        reader.open()
    try:
        yield reader
    finally:
        reader.close()


def messages_of(bag: Bag, numbers: frozenset[int], decoded: Callable[[bytes], Any]) -> Iterator[tuple[int, Any]]:
    """Receive time, ns, and what `decoded` makes of each message of some connections, by their numbers.

    Raises InputError where it cannot be read, or the messages are far longer than its files.
    """
    left = min(_MOST, _BYTES + _RATIO * sum(file.stat().st_size for file in bag.files))
    with opened(bag) as reader:
        messages = reader.messages([c for c in reader.connections if c.id in numbers])
        while True:
            with reading(WHAT, DAMAGED):  # some at a time, and times that are none are damage
                some = [(index(time), decoded(raw), len(raw)) for _, time, raw in islice(messages, 64)]
            left -= sum(size for *_, size in some)
            if left < 0:
                raise InputError(f"holds messages of far more bytes than the file explains; {DAMAGED}")
            if not some:
                return
            yield from ((time, message) for time, message, _ in some)
