"""Files of ROS bags, their topics, and the messages of these, read by rosbags.

AnyReader makes code of every definition as it opens a bag; its readers make none. They unpack a chunk whole, whatever
size it claims: a bag from an untrusted source can fill the memory.
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
from bristle.errors import InputError, check_name, check_regular, short

DAMAGED = "record the bag again, or repair it with the tools of ROS (ros2 bag reindex, mcap recover, rosbag reindex)"
_WHAT = "ROS bag that ended in order"
_METADATA = "metadata.yaml"
MAX_BYTES = 2**34  # largest bag, bytes: it may hold much that is not read
_MOST, _RATIO, _BYTES = 2**33, 200, 2**23  # bytes of messages that are read: _MOST, or _BYTES + _RATIO times the bag's
_SUFFIXES = (".mcap", ".db3", ".bag")


class Topic(NamedTuple):
    """A topic of one bag."""

    bag: Path
    name: str
    kind: str  # type of its messages, as `sensor_msgs/msg/JointState`; empty where there are several
    encoding: str  # `cdr` or `ros1`, else it cannot be read
    definition: str  # text of the message definition; empty where the file has none
    is_idl: bool  # whether the definition is in IDL, which is not parsed
    numbers: frozenset[int]  # of its connections


def is_bag(path: Path) -> bool:
    """Whether a path is a bag: .mcap, .db3, .bag, or a folder with metadata.yaml."""
    return path.suffix.lower() in _SUFFIXES if not path.is_dir() else (path / _METADATA).exists()


def files_of(path: Path) -> tuple[Path, ...]:
    """The storage files of a bag, by name, together at most `MAX_BYTES`. Raises InputError and OSError."""
    within = path.iterdir() if path.is_dir() else (path,)
    files = tuple(sorted(x for x in within if x.name != _METADATA and not x.is_dir()))
    for file in files:
        check_regular(file, file.name)
        if (log := file.with_name(f"{file.name}-wal")).exists() and log.stat().st_size:
            why = f"has messages in {log.name} that are not in it yet"
            raise InputError(f"{why}; close what writes it, or open it once with sqlite3")
    size = sum(file.stat().st_size for file in files)
    if size > MAX_BYTES:
        raise InputError(f"is {size} bytes long, over the limit of {MAX_BYTES}; cut the bag into several runs")
    return files


def digest_of(path: Path) -> str:
    """SHA-256 of a bag's storage files, one after another, by name."""
    digest = hashlib.sha256()
    for part in files_of(path):
        with part.open("rb") as file:
            hashlib.file_digest(file, lambda: digest)
    return digest.hexdigest()


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """The rosbags reader of a bag. Raises InputError where it cannot be read."""
    files_of(path)
    if path.is_dir():
        parse(read_text(path / _METADATA), _METADATA)  # which refuses what would blow up
    try:
        from rosbags import rosbag1, rosbag2
    except ImportError as error:
        raise InputError("is a ROS bag, which needs rosbags; install it with pip install 'bristle[ros]'") from error
    suffix = "dir" if path.is_dir() else path.suffix.lower()
    with reading(_WHAT, DAMAGED):
        reader = (rosbag1.Reader if suffix == ".bag" else rosbag2.Reader.STORAGE_PLUGINS[suffix])(path)
        reader.open()
    try:
        yield reader
    finally:
        reader.close()


def topics_of(path: Path) -> dict[str, Topic]:
    """The topics of a bag by name. Raises InputError where it cannot be read; needs the extra `ros`."""
    topics: dict[str, Topic] = {}
    with _opened(path) as reader, reading(_WHAT, DAMAGED):
        connections = list(reader.connections)
    for c in connections:
        name = check_name(c.topic, "the topic")
        kind = check_name(c.msgtype, f"the type of {short(name)}")
        encoding, is_idl = getattr(c.ext, "serialization_format", "ros1"), c.msgdef.format.name == "IDL"
        own = Topic(path, name, kind, encoding, c.msgdef.data, is_idl, frozenset([c.id]))
        old = topics.get(name, own)
        alike = old._replace(numbers=own.numbers) == own
        topics[name] = own._replace(kind=kind if alike else "", numbers=old.numbers | own.numbers)
    return topics


def messages_of(topic: Topic, decoded: Callable[[bytes], Any]) -> Iterator[tuple[int, Any]]:
    """Receive time, ns, and decoded message, of each message of a topic.

    Raises InputError where it cannot be read, or the messages are far longer than the bag's files.
    """
    left = min(_MOST, _BYTES + _RATIO * sum(file.stat().st_size for file in files_of(topic.bag)))
    with _opened(topic.bag) as reader:
        messages = reader.messages([c for c in reader.connections if c.id in topic.numbers])
        while True:
            with reading(_WHAT, DAMAGED):  # a few at a time; a time that is no number is damage as well
                some = [(index(time), decoded(raw), len(raw)) for _, time, raw in islice(messages, 64)]
            left -= sum(size for *_, size in some)
            if left < 0:
                raise InputError(f"holds messages of far more bytes than the size of the file explains; {DAMAGED}")
            if not some:
                return
            yield from ((time, message) for time, message, _ in some)
