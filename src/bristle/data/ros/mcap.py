"""Messages of MCAP files: records walked in runs of one length, chunks unpacked to no more than they claim.

The format: https://mcap.dev/spec. Indexes are not trusted, they are not needed: every record of the data is walked.
"""

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from bristle.data.ros.storage import (
    DAMAGED,
    MAX_RECORD,
    Budget,
    Channel,
    Integers,
    MessageBatch,
    gather,
    text_of,
    unpack,
)
from bristle.errors import InputError

_MAGIC = b"\x89MCAP0\r\n"
_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _DATA_END = 3, 4, 5, 6, 15
_FOOTER = 9 + 20 + 8
"""Bytes of the footer's record and the magic after it."""
_HEAD = 9
"""Bytes of an opcode and a length."""
_FIXED = 22
"""Bytes of a message record before the message."""
_WINDOW = 2**24
"""Bytes of a file that are looked at together."""
_BROKEN = f"is damaged, or no MCAP file; {DAMAGED}"
_CUT = f"is cut short: a recording that did not end in order; {DAMAGED}"


class _Names:
    """Schemas and channels, as they come."""

    def __init__(self) -> None:
        self.schemas: dict[int, tuple[str, str, str]] = {}
        self.channels: dict[int, Channel] = {}

    def add(self, kind: int, content: bytes) -> None:
        """A record of a schema or a channel."""
        number = int.from_bytes(content[:2], "little")
        if kind == _SCHEMA:
            name, at = _text(content, 2)
            encoding, at = _text(content, at)
            self.schemas[number] = (name, encoding, _text(content, at)[0])
            return
        name, encoding, text = self.schemas.get(int.from_bytes(content[2:4], "little"), ("", "", ""))
        topic, at = _text(content, 4)
        idl = encoding not in ("ros2msg", "ros1msg", "")
        channel = Channel(number, topic, name, _text(content, at)[0], text, idl)
        if self.channels.setdefault(number, channel)[1:4] != channel[1:4]:
            raise InputError(f"is damaged: two channels have the number {number}; {DAMAGED}")


def mcap_channels(path: Path) -> list[Channel]:
    """The channels of an MCAP file, from its summary, or where that names none from all of its data. Raises InputError."""
    size, summary = _ends(path)
    names, found = _Names(), False
    with text_of(path):
        if summary:
            for _ in _walk(path, summary, size - _FOOTER, names, None):
                pass
            found = bool(names.channels)
        if not found:
            names = _Names()
            for _ in _walk(path, len(_MAGIC), summary or size - _FOOTER, names, Budget(size)):
                pass
    return list(names.channels.values())


def mcap_batches(path: Path, wanted: frozenset[int]) -> Iterator[MessageBatch]:
    """The messages of some channels of an MCAP file, in the order of the file. Raises InputError."""
    size, summary = _ends(path)
    with text_of(path):
        for batch in _walk(path, len(_MAGIC), summary or size - _FOOTER, _Names(), Budget(size)):
            mask = np.isin(batch.channels, list(wanted))
            if mask.any():
                yield MessageBatch(batch.data, *(x[mask] for x in batch[1:]))


def _ends(path: Path) -> tuple[int, int]:
    """Size of a file, and where its summary starts (0: it has none)."""
    size = path.stat().st_size
    with path.open("rb") as file:
        if file.read(len(_MAGIC)) != _MAGIC:
            raise InputError(_BROKEN)
        if size < 2 * len(_MAGIC) + _FOOTER:
            raise InputError(_CUT)
        file.seek(size - _FOOTER)
        footer = file.read(_FOOTER)
    if footer[-len(_MAGIC) :] != _MAGIC or footer[:_HEAD] != b"\x02\x14" + bytes(7):
        raise InputError(_CUT)
    (summary,) = struct.unpack_from("<Q", footer, _HEAD)
    if summary and not len(_MAGIC) <= summary <= size - _FOOTER:
        raise InputError(_BROKEN)
    return size, summary


def _walk(path: Path, start: int, stop: int, names: _Names, budget: Budget | None) -> Iterator[MessageBatch]:
    """Messages between two offsets, those in chunks too, in batches; schemas and channels are added to `names`.

    No budget: chunks are passed over.
    """
    for data, starts in _windows(path, start, stop):
        yield from _messages(data, starts, names)
        kinds = np.frombuffer(data, np.uint8)[starts]
        if budget is not None:
            for at in starts[kinds == _CHUNK].tolist():
                chunk = _unpacked(data, at, budget)
                inside, end = _records(chunk)
                if end < len(chunk) or (np.frombuffer(chunk, np.uint8)[inside] == _CHUNK).any():
                    raise InputError(_BROKEN)
                yield from _messages(chunk, inside, names)
        if (kinds == _DATA_END).any() and budget is not None:
            return


def _windows(path: Path, start: int, stop: int) -> Iterator[tuple[bytes, Integers]]:
    """Bytes between two offsets, and where the whole records in them start; a long one not needed is passed over."""
    with path.open("rb") as file:
        file.seek(start)
        at, data = start, b""
        while at < stop:
            need = _HEAD + (_size(data, 0) if len(data) >= _HEAD else 0)
            if at + need > stop:
                raise InputError(_CUT)
            if need > MAX_RECORD:
                if data[0] in (_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK):
                    raise InputError(f"has a record of {need} bytes, over the limit of {MAX_RECORD}; {DAMAGED}")
                at, data = file.seek(at + need), b""
                continue
            data += file.read(max(0, min(max(_WINDOW, need), stop - at) - len(data)))
            if len(data) < need:
                raise InputError(_CUT)
            starts, end = _records(data)
            if end:
                yield data, starts
            at, data = at + end, data[end:]


def _size(data: bytes, at: int) -> int:
    """Length of the content of a record."""
    return int.from_bytes(data[at + 1 : at + _HEAD], "little")


def _records(data: bytes) -> tuple[Integers, int]:
    """Where the whole records of a buffer start, and where the last of them ends.

    Runs of records of one kind and length are found together, so that the loop is one over runs.
    """
    buffer = np.frombuffer(data, np.uint8)
    at, pieces, single = 0, list[Integers](), list[int]()
    while at + _HEAD <= len(data):
        step = _HEAD + _size(data, at)
        if at + step > len(data):
            break
        head = data[at : at + _HEAD]
        if data[at + step : at + step + _HEAD] != head:
            single.append(at)
            at += step
            continue
        count = _run(buffer[at:], step, head)
        pieces += [np.array(single, np.int64), at + step * np.arange(count, dtype=np.int64)]
        single.clear()
        at += step * count
    return np.concatenate([*pieces, np.array(single, np.int64)]), at


def _run(buffer: "np.ndarray[tuple[int], np.dtype[np.uint8]]", step: int, head: bytes) -> int:
    """How many records from here on are whole and have this head."""
    most, done, look = buffer.size // step, 0, 64
    wanted = np.frombuffer(head, np.uint8)
    while done < most:
        some = buffer[done * step : min(most, done + look) * step].reshape(-1, step)[:, :_HEAD]
        same = (some == wanted).all(axis=1)
        if not same.all():
            return done + int(same.argmin())
        done, look = done + some.shape[0], 4 * look
    return done


def _messages(data: bytes, starts: Integers, names: _Names) -> Iterator[MessageBatch]:
    """The messages among some records; schemas and channels among them are added to `names`."""
    buffer = np.frombuffer(data, np.uint8)
    kinds = buffer[starts]
    for kind in (_SCHEMA, _CHANNEL):
        for at in starts[kinds == kind].tolist():
            names.add(kind, data[at + _HEAD : at + _HEAD + _size(data, at)])
    starts = starts[kinds == _MESSAGE]
    if not starts.size:
        return
    lengths = gather(buffer, starts + 1, "<u8").astype(np.int64) - _FIXED
    if lengths.min() < 0:
        raise InputError(_BROKEN)
    starts = starts + _HEAD
    times = gather(buffer, starts + 6, "<u8").astype(np.int64)
    yield MessageBatch(buffer, starts + _FIXED, lengths, times, gather(buffer, starts, "<u2").astype(np.int64))


def _unpacked(data: bytes, at: int, budget: Budget) -> bytes:
    """The records of the chunk whose record starts here."""
    content = memoryview(data)[at + _HEAD : at + _HEAD + _size(data, at)]
    if len(content) < 40:
        raise InputError(_BROKEN)
    size, check = struct.unpack_from("<QI", content, 16)
    compression, start = _text(bytes(content[: 28 + 64]), 28)
    length = int.from_bytes(content[start : start + 8], "little")
    if start + 8 + length > len(content):
        raise InputError(_BROKEN)
    budget.take(size)
    chunk = unpack(bytes(content[start + 8 : start + 8 + length]), compression, size)
    if check and zlib.crc32(chunk) != check:
        raise InputError(f"is damaged: a chunk has another checksum than it claims; {DAMAGED}")
    return chunk


def _text(content: bytes, at: int) -> tuple[str, int]:
    """The text at an offset, and where it ends."""
    end = at + 4 + int.from_bytes(content[at : at + 4], "little")
    if end > len(content) or at + 4 > len(content):
        raise InputError(_BROKEN)
    return content[at + 4 : end].decode(), end
