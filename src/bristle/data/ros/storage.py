"""What every storage of a bag offers: channels and batches of messages, undecoded; and the limits that all keep."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bristle.data.columns import reading
from bristle.errors import InputError

Integers = NDArray[np.int64]
Bytes = NDArray[np.uint8]
MAX_RECORD = 2**28
"""Longest record, message or unpacked chunk, bytes."""
_MOST_UNPACKED, _RATIO = 2**33, 200
"""Bytes that one file unpacks to at most, and how many times its own size, beyond one record."""
DAMAGED = "record it again, or repair it with the tools of ROS (ros2 bag reindex, mcap recover, rosbag reindex)"
"""What to do about a damaged bag."""


class Channel(NamedTuple):
    """Messages of one topic and type in one storage file."""

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

    def of(self, channel: int) -> "MessageBatch":
        """Its messages of one channel."""
        mask = self.channels == channel
        return MessageBatch(self.data, *(x[mask] for x in (self.starts, self.lengths, self.times, self.channels)))


class Budget:
    """Bytes that a file may still unpack to: a small file can claim any number."""

    def __init__(self, size: int) -> None:
        self.left = min(_MOST_UNPACKED, MAX_RECORD + _RATIO * size)

    def take(self, size: int) -> None:
        """Before so many bytes are unpacked. Raises InputError where a chunk or all of them are too many."""
        self.left -= size
        if size > MAX_RECORD or self.left < 0:
            raise InputError(
                f"unpacks to too many bytes (a chunk of {size}, over the limit of {MAX_RECORD} for one, or of {_MOST_UNPACKED} "
                f"and {_RATIO} times the file's size for all); record it in smaller chunks, or cut it"
            )


def unpack(data: bytes, compression: str, size: int) -> bytes:
    """A chunk of `size` bytes, decompressed, never beyond that size. Raises InputError where it is none."""
    if size > MAX_RECORD:
        Budget(0).take(size)
    if compression not in _UNPACKERS:
        raise InputError(
            f"has chunks compressed by {compression[:20]!r}; expected none, lz4, zstd or bz2; convert the bag"
        )
    with reading(f"chunk of {compression or 'a bag'}", DAMAGED):
        raw = _UNPACKERS[compression](data, size)
    if len(raw) != size:
        raise InputError(f"is damaged: a chunk does not unpack to the {size} bytes that it claims; {DAMAGED}")
    return raw


def unpacked(batch: MessageBatch, budget: Budget) -> MessageBatch:
    """The batch with each message decompressed by zstd. Raises InputError where one is no zstd, or all are too long."""
    messages = list[bytes]()
    for start, length in zip(batch.starts.tolist(), batch.lengths.tolist(), strict=True):
        with reading("message compressed by zstd", DAMAGED):
            message = _zstd(batch.data[start : start + length].tobytes(), MAX_RECORD)
        budget.take(len(message))
        messages.append(message)
    lengths = np.fromiter(map(len, messages), np.int64, len(messages))
    data = np.frombuffer(b"".join(messages), np.uint8)
    return MessageBatch(data, np.cumsum(lengths) - lengths, lengths, batch.times, batch.channels)


def _bz2(data: bytes, size: int) -> bytes:
    import bz2

    return bz2.BZ2Decompressor().decompress(data, size + 1)


def _lz4(data: bytes, size: int) -> bytes:
    import lz4.frame

    return _all_of(lz4.frame.LZ4FrameDecompressor(), data, size)


def _zstd(data: bytes, size: int) -> bytes:
    return _all_of(zstd().ZstdDecompressor(), data, size)


def zstd() -> Any:
    """The module that decompresses zstd: the standard library's, or its backport, which rosbags brings."""
    import importlib
    import sys

    return importlib.import_module("compression.zstd" if sys.version_info >= (3, 14) else "backports.zstd")


def _all_of(decompressor: Any, data: bytes, size: int) -> bytes:
    """At most `size` + 1 bytes of a frame, which a decompressor may hand out in pieces."""
    raw = bytes(decompressor.decompress(data, max_length=size + 1))
    while len(raw) <= size and not decompressor.eof:
        piece = decompressor.decompress(b"", max_length=size + 1 - len(raw))
        if not piece:
            break
        raw += piece
    return raw


_UNPACKERS: dict[str, Callable[[bytes, int], bytes]] = {
    "": lambda data, _: data,
    "none": lambda data, _: data,
    "bz2": _bz2,
    "lz4": _lz4,
    "zstd": _zstd,
}


def gather(data: Bytes, starts: Integers, dtype: str) -> NDArray[Any]:
    """Numbers of a type at some offsets of a buffer, shape (offsets,), at any alignment."""
    return rows_of(data, starts, np.dtype(dtype).itemsize).view(dtype)[:, 0]


def rows_of(data: Bytes, starts: Integers, width: int) -> Bytes:
    """`width` bytes from each offset on, shape (offsets, width)."""
    if not starts.size:
        return np.empty((0, width), np.uint8)
    return np.ascontiguousarray(np.lib.stride_tricks.sliding_window_view(data, width)[starts])


@contextmanager
def text_of(path: Path) -> Iterator[None]:
    """Around decoding names in a file. Raises InputError where they are no text in UTF-8."""
    try:
        yield
    except UnicodeDecodeError as error:
        raise InputError(f"is damaged: a name in {path.name} is not text in UTF-8; {DAMAGED}") from error
