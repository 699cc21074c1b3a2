"""The files of bags, and their messages, undecoded, by the readers of rosbags; nothing that a file says becomes code.

A bag is one file, or a folder with metadata.yaml and the storage files that it names.

rosbags unpacks a chunk whole, whatever size it claims: a bag of strangers can take all memory that the process may have.
"""

import hashlib
from collections.abc import Iterator
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
_WHAT = "ROS bag that ended in order"
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


class Channel(NamedTuple):
    """Messages of one topic and type in one bag."""

    number: int  # by which its messages are marked
    topic: str
    kind: str  # type of its messages, as `sensor_msgs/msg/JointState`
    encoding: str  # `cdr` or `ros1`, else it cannot be read
    definition: str = ""  # text of the message definition; empty: the file has none
    is_idl: bool = False  # whether the definition is in IDL, which is not parsed


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
def _opened(bag: Bag) -> Iterator[Any]:
    from rosbags import rosbag1, rosbag2

    suffix, readers = bag.path.suffix.lower(), rosbag2.Reader.STORAGE_PLUGINS
    with reading(_WHAT, DAMAGED):
        reader = (rosbag1.Reader if suffix == ".bag" else readers["dir" if bag.path.is_dir() else suffix])(bag.path)
        reader.open()
    try:
        yield reader
    finally:
        reader.close()


def channels_of(bag: Bag) -> list[Channel]:
    """The channels of a bag. Raises InputError where it cannot be read."""
    with _opened(bag) as reader, reading(_WHAT, DAMAGED):
        return [
            Channel(c.id, c.topic, c.msgtype, getattr(c.ext, "serialization_format", "ros1"), c.msgdef.data, c.msgdef.format.name == "IDL")
            for c in reader.connections
        ]  # fmt: skip  # a record


def messages_of(bag: Bag, wanted: frozenset[int]) -> Iterator[tuple[int, int, bytes]]:
    """Channel number, receive time, ns, and bytes of each message of some channels of a bag.

    Raises InputError where it cannot be read, or the messages are far longer than its files.
    """
    left = min(_MOST, _BYTES + _RATIO * sum(file.stat().st_size for file in bag.files))
    with _opened(bag) as reader:
        messages = reader.messages([c for c in reader.connections if c.id in wanted])
        while True:
            with reading(_WHAT, DAMAGED):  # some at a time, and times that are none are damage
                some = [(c.id, index(time), bytes(raw)) for c, time, raw in islice(messages, 64)]
            left -= sum(len(raw) for *_, raw in some)
            if left < 0:
                raise InputError(f"holds messages of far more bytes than the file explains; {DAMAGED}")
            if not some:
                return
            yield from some
