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
_MESSAGE, _HEADER, _CHUNK, _CONNECTION = 2, 3, 5, 7
_BROKEN = f"is damaged, or no ROS 1 bag of version 2.0; {DAMAGED}"
_MOST = 2**24
"""Bytes of a header."""


def bag1_channels(path: Path) -> list[Channel]:
    """The connections of a ROS 1 bag, from the index at its end. Raises InputError."""
    with path.open("rb") as file, text_of(path):
        file.seek(_index(file))
        found = dict[int, Channel]()
        while (record := _record(file)) is not None:
            fields, start, length = record
            if _op(fields) == _CONNECTION:
                file.seek(start)
                channel = _channel(fields, _read(file, length))
                if found.setdefault(channel.number, channel) != channel:
                    raise InputError(f"is damaged: two connections have the number {channel.number}; {DAMAGED}")
            file.seek(start + length)
    return list(found.values())


def bag1_batches(path: Path, wanted: frozenset[int]) -> Iterator[MessageBatch]:
    """The messages of some connections of a ROS 1 bag, in the order of the file. Raises InputError."""
    budget = Budget(path.stat().st_size)
    with path.open("rb") as file, text_of(path):
        stop = _index(file)
        file.seek(len(_MAGIC))
        while file.tell() < stop and (record := _record(file)) is not None:
            fields, start, length = record
            if _op(fields) == _CHUNK:
                file.seek(start)
                size = _number(fields, b"size", 4)
                budget.take(size)
                chunk = unpack(_read(file, length), fields.get(b"compression", b"").decode(), size)
                batch = _messages(chunk, wanted)
                if batch.starts.size:
                    yield batch
            file.seek(start + length)


def _index(file: BinaryIO) -> int:
    """Where the index starts."""
    if file.read(len(_MAGIC)) != _MAGIC:
        raise InputError(_BROKEN)
    record = _record(file)
    if record is None or _op(record[0]) != _HEADER:
        raise InputError(_BROKEN)
    if record[0].get(b"encryptor"):
        raise InputError("is an encrypted bag; decrypt it with rosbag decrypt")
    index = _number(record[0], b"index_pos", 8)
    if index == 0:
        raise InputError(f"has no index: a recording that did not end in order; {DAMAGED}")
    if index > file.seek(0, 2):
        raise InputError(f"is cut short before its index; {DAMAGED}")
    return index


def _record(file: BinaryIO) -> tuple[dict[bytes, bytes], int, int] | None:
    """Fields of the record here, where its data start and their length; None at the end of the file."""
    head = file.read(4)
    if not head:
        return None
    size = int.from_bytes(head, "little")
    if len(head) < 4 or size > _MOST:
        raise InputError(_BROKEN)
    fields = _fields(_read(file, size))
    return fields, file.tell() + 4, int.from_bytes(_read(file, 4), "little")


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
