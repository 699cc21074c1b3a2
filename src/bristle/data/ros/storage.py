"""Messages of bags, undecoded, by the readers of rosbags; nothing that a file says becomes code.

rosbags unpacks a chunk whole, whatever size it claims: a bag of strangers can take all memory that the process may have.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import islice
from operator import index
from pathlib import Path
from typing import Any, NamedTuple

from bristle.data.columns import reading
from bristle.errors import InputError

DAMAGED = "record it again, or repair it with the tools of ROS (ros2 bag reindex, mcap recover, rosbag reindex)"
"""What to do about a damaged bag."""
_WHAT = "ROS bag that ended in order"
_MOST, _RATIO, _BYTES = 2**33, 200, 2**23
"""Bytes of messages that are read of one bag: so many, or so many times its size beyond the last."""


class Bag(NamedTuple):
    """One file, or a folder with metadata.yaml."""

    path: Path
    files: tuple[Path, ...]
    """Its storage files."""
    distribution: str | None = None
    """Of ROS 2, where metadata.yaml names it."""


class Channel(NamedTuple):
    """Messages of one topic and type in one bag."""

    number: int
    """By which its messages are marked."""
    topic: str
    kind: str
    """Type of its messages, as `sensor_msgs/msg/JointState`."""
    encoding: str
    """`cdr` or `ros1`, else it cannot be read."""
    definition: str = ""
    """Text of the message definition; empty: the file has none."""
    is_idl: bool = False
    """Whether the definition is in IDL, which is not parsed."""


@contextmanager
def _opened(bag: Bag) -> Iterator[Any]:
    """The reader of rosbags for a bag."""
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
