"""Messages of ROS 1 bags (.bag, version 2.0): records walked in order, chunks unpacked to no more than they claim.

The format: https://wiki.ros.org/Bags/Format/2.0. The index is not trusted, and not needed but for its being there: a
bag without one was not closed.
"""

import struct
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import BinaryIO

import numpy as np

from bristle.data.ros.storage import DAMAGED, MAX_RECORD, Budget, Channel, MessageBatch, text_of, unpack
from bristle.errors import InputError

_MAGIC = b"#ROSBAG V2.0\n"
_MESSAGE, _HEADER, _CHUNK, _CHUNK_INFO, _CONNECTION = 2, 3, 5, 6, 7
_BROKEN = f"is damaged, or no ROS 1 bag of version 2.0; {DAMAGED}"
_MOST = 2**24
"""Bytes of a header."""


def bag1_channels(path: Path) -> list[Channel]:
    """The connections of a ROS 1 bag, from the index at its end. Raises InputError."""
    found, counts = dict[int, Channel](), dict.fromkeys((_CONNECTION, _CHUNK_INFO), 0)
    with path.open("rb") as file, text_of(path):
        start, *expected = _index(file)
        for fields, data in _records(file, start, path.stat().st_size, {_CONNECTION, _CHUNK_INFO}):
            counts[_op(fields)] += 1
            if _op(fields) == _CONNECTION:
                channel = _channel(fields, data)
                if found.setdefault(channel.number, channel) != channel:
                    raise InputError(f"is damaged: two connections have the number {channel.number}; {DAMAGED}")
    if list(counts.values()) != expected:
        raise InputError(f"is cut short inside its index; {DAMAGED}")
    return list(found.values())


def bag1_batches(path: Path, wanted: frozenset[int]) -> Iterator[MessageBatch]:
    """The messages of some connections of a ROS 1 bag, in the order of the file. Raises InputError."""
    budget = Budget(path.stat().st_size)
    with path.open("rb") as file, text_of(path):
        stop, *_ = _index(file)
        for fields, data in _records(file, len(_MAGIC), stop, {_CHUNK}):
            size = _number(fields, b"size", 4)
            budget.take(size)
            batch = _messages(unpack(data, fields.get(b"compression", b"").decode(), size), wanted)
            if batch.starts.size:
                yield batch


def _records(file: BinaryIO, start: int, stop: int, kinds: set[int]) -> Iterator[tuple[dict[bytes, bytes], bytes]]:
    """Fields and data of the records of some kinds between two offsets; all must end there."""
    file.seek(start)
    while (at := file.tell()) < stop:
        fields, start, length = _record(file)
        if start + length > stop:
            raise InputError(f"is cut short inside the record at byte {at}; {DAMAGED}")
        if _op(fields) in kinds:
            yield fields, _read(file, length)
        file.seek(start + length)


def _index(file: BinaryIO) -> tuple[int, int, int]:
    """Where the index starts, and how many connections and chunks it tells of."""
    if file.read(len(_MAGIC)) != _MAGIC:
        raise InputError(_BROKEN)
    fields, *_ = _record(file)
    if _op(fields) != _HEADER:
        raise InputError(_BROKEN)
    if fields.get(b"encryptor"):
        raise InputError("is an encrypted bag; decrypt it with rosbag decrypt")
    index = _number(fields, b"index_pos", 8)
    if index == 0:
        raise InputError(f"has no index: a recording that did not end in order; {DAMAGED}")
    if index > file.seek(0, 2):
        raise InputError(f"is cut short before its index; {DAMAGED}")
    return index, _number(fields, b"conn_count", 4), _number(fields, b"chunk_count", 4)


def _record(file: BinaryIO) -> tuple[dict[bytes, bytes], int, int]:
    """Fields of the record here, where its data start and their length."""
    size = int.from_bytes(_read(file, 4), "little")
    if size > _MOST:
        raise InputError(_BROKEN)
    fields = _fields(_read(file, size))
    length = int.from_bytes(_read(file, 4), "little")
    return fields, file.tell(), length


def _read(file: BinaryIO, size: int) -> bytes:
    """So many bytes. Raises InputError where the file has fewer."""
    if size > MAX_RECORD:
        raise InputError(f"has a record of {size} bytes, over the limit of {MAX_RECORD}; {DAMAGED}")
    data = file.read(size)
    if len(data) < size:
        raise InputError(f"is cut short inside a record; {DAMAGED}")
    return data


def _fields(header: bytes) -> dict[bytes, bytes]:
    """The fields of a header by name."""
    at, fields = 0, dict[bytes, bytes]()
    while at < len(header):
        end = at + 4 + int.from_bytes(header[at : at + 4], "little")
        name, mark, value = header[at + 4 : end].partition(b"=")
        if end > len(header) or not mark:
            raise InputError(_BROKEN)
        fields[name] = value
        at = end
    return fields


def _op(fields: dict[bytes, bytes]) -> int:
    return _number(fields, b"op", 1)


def _number(fields: dict[bytes, bytes], name: bytes, size: int) -> int:
    """An unsigned integer among the fields of a header."""
    value = fields.get(name, b"")
    if len(value) != size:
        raise InputError(_BROKEN)
    return int.from_bytes(value, "little")


def _channel(fields: dict[bytes, bytes], data: bytes) -> Channel:
    """The connection that a record describes; its type is named as ROS 2 does."""
    about = _fields(data)
    topic, kind = fields.get(b"topic", b"").decode(), PurePosixPath(about.get(b"type", b"").decode())
    text = about.get(b"message_definition", b"").decode(errors="replace")
    name = str(kind.parent / "msg" / kind.name)
    return Channel(_number(fields, b"conn", 4), topic, name, "ros1", text)


def _messages(chunk: bytes, wanted: frozenset[int]) -> MessageBatch:
    """The messages of some connections in a chunk."""
    at, found = 0, list[tuple[int, int, int, int]]()
    while at < len(chunk):
        try:
            (size,) = struct.unpack_from("<I", chunk, at)
            (length,) = struct.unpack_from("<I", chunk, at + 4 + size)
        except struct.error as error:
            raise InputError(_BROKEN) from error
        start = at + 8 + size
        if start + length > len(chunk):
            raise InputError(_BROKEN)
        fields = _fields(chunk[at + 4 : at + 4 + size])
        if _op(fields) == _MESSAGE and (number := _number(fields, b"conn", 4)) in wanted:
            stamp = _number(fields, b"time", 8)
            found.append((start, length, (stamp & 0xFFFFFFFF) * 10**9 + (stamp >> 32), number))
        at = start + length
    return MessageBatch(np.frombuffer(chunk, np.uint8), *np.array(found, np.int64).reshape(-1, 4).T)
