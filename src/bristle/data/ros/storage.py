"""Messages of bags, undecoded, by the readers of rosbags; nothing that a file says becomes code.

rosbags unpacks a chunk whole, whatever size it claims: a bag of strangers can take all memory that the process may have.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bristle.data.columns import reading
from bristle.errors import InputError

Integers = NDArray[np.int64]
Bytes = NDArray[np.uint8]
DAMAGED = "record it again, or repair it with the tools of ROS (ros2 bag reindex, mcap recover, rosbag reindex)"
"""What to do about a damaged bag."""
_WHAT = "ROS bag that ended in order"
_ROWS, _BYTES = 8192, 2**23
"""Messages that are read together, and about how many bytes of them."""
_MOST, _RATIO = 2**33, 200
"""Bytes of messages that are read of one bag: so many, or so many times its size beyond `_BYTES`."""


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


class MessageBatch(NamedTuple):
    """Some messages, as bytes of one buffer; the arrays have shape (messages,)."""

    data: Bytes
    starts: Integers
    """Offset of each message in `data`; it lies inside, as long as it is."""
    lengths: Integers
    times: Integers
    """Receive time, ns."""
    channels: Integers
    """`Channel.number` of each."""

    def where(self, mask: NDArray[np.bool_]) -> "MessageBatch":
        """Some of its messages."""
        return MessageBatch(self.data, *(x[mask] for x in (self.starts, self.lengths, self.times, self.channels)))


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


def batches_of(bag: Bag, wanted: frozenset[int]) -> Iterator[MessageBatch]:
    """The messages of some channels of a bag. Raises InputError where it cannot be read, or they are far longer than its files."""
    left = min(_MOST, _BYTES + _RATIO * sum(file.stat().st_size for file in bag.files))
    with _opened(bag) as reader:
        messages, rows = reader.messages([c for c in reader.connections if c.id in wanted]), 64
        while True:
            with reading(_WHAT, DAMAGED):
                some = [(c.id, time, bytes(raw)) for c, time, raw in islice(messages, rows)]
                if not some:
                    return
                numbers, times = np.array([x[:2] for x in some], np.int64).T
            lengths = np.fromiter((len(raw) for *_, raw in some), np.int64, len(some))
            left -= int(lengths.sum())
            if left < 0:
                raise InputError(f"holds messages of far more bytes than the file explains; {DAMAGED}")
            data = np.frombuffer(b"".join(raw for *_, raw in some), np.uint8)
            rows = int(np.clip(_BYTES * len(some) // max(1, data.size), 1, _ROWS))
            yield MessageBatch(data, np.cumsum(lengths) - lengths, lengths, times, numbers)


def rows_of(data: Bytes, starts: Integers, width: int) -> Bytes:
    """`width` bytes from each offset on, shape (offsets, width)."""
    if not starts.size:
        return np.empty((0, width), np.uint8)
    return np.ascontiguousarray(np.lib.stride_tricks.sliding_window_view(data, width)[starts])
