"""Messages to columns: where the layout of many is the same, all of them at once, as one array.

A layout is found by walking one message: the bytes that say lengths and names, and where the wanted numbers then are.
Every other message that is as long and has the same bytes in those places has its numbers there, and needs no walk.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from struct import unpack_from
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bristle.data.ros.definitions import ArrayField, Field, MessageField, NumberField, TextField, UnreadableField
from bristle.data.ros.storage import DAMAGED, Bytes, Integers, MessageBatch, gather, rows_of
from bristle.errors import InputError

NAMES = ("name", "joint_names")
"""Fields that hold the names of joints, in the order of the message's other arrays."""
NO_STAMP = np.iinfo(np.int64).min
"""In place of a stamp that a message does not have."""
_LAYOUTS, _KNOWN = 64, 20_000
"""Layouts that are looked for in all messages at once; where there are more, each message is looked at by itself."""
_APART = 8
"""Bytes between lengths that are compared as well: padding, and small numbers between them cost a walk at most."""
_MOST_NAMES = 1000
_FORMS = {"u1": "B", "i1": "b", "u2": "H", "i2": "h", "u4": "I", "i4": "i", "u8": "Q", "i8": "q", "f4": "f", "f8": "d"}
"""Types of numbers in the letters of `struct`."""


class NamedJoint(NamedTuple):
    """In a path: the element of an array that a joint's name has among the names of the message."""

    name: str


Step = str | int | NamedJoint


class Path(NamedTuple):
    """The way to one number, or to one stamp, in a message."""

    steps: tuple[Step, ...]
    is_stamp: bool = False


@dataclass(slots=True)
class Wanted:
    """What is wanted of a field: itself, by which paths, and what is inside, by name or number."""

    ends: list[int] = field(default_factory=list)
    inside: dict[str | int, "Wanted"] = field(default_factory=dict)


_NOTHING = Wanted()


Found = Mapping[int, tuple[int, str]]
"""Offset and type of the number at each path."""
Ranges = tuple[tuple[int, int], ...]
"""Where the bytes are that decide on the others."""


@dataclass(slots=True)
class _Walk:
    """One message, from field to field."""

    data: bytes
    is_cdr: bool
    at: int = 0
    order: str = "<"
    marks: list[tuple[int, int]] = field(default_factory=list)
    """From and to: bytes that decide where the others are."""
    found: dict[int, tuple[int, str]] = field(default_factory=dict)
    """Offset and type of each wanted number."""

    def __post_init__(self) -> None:
        if self.is_cdr:
            if len(self.data) < 4 or self.data[:2] not in (b"\0\0", b"\0\1"):
                raise InputError(f"is damaged: a message is not in CDR of version 1; {DAMAGED}")
            self.order, self.at = "<>"[self.data[1] == 0], 4
            self.marks.append((0, 2))

    def align(self, size: int) -> None:
        """Go on to where a number of so many bytes may stand."""
        if self.is_cdr:
            self.at += (4 - self.at) % size

    def skip(self, size: int) -> int:
        """Go so many bytes on; returns where they began. Raises InputError where the message ends before."""
        begun = self.at
        self.at += size
        if self.at > len(self.data):
            raise InputError(f"is damaged: a message ends inside one of its fields; {DAMAGED}")
        return begun

    def length(self) -> int:
        """The number of elements or letters that follow."""
        self.align(4)
        begun = self.skip(4)
        self.marks.append((begun, self.at))
        return int.from_bytes(self.data[begun : self.at], "little" if self.order == "<" else "big")

    def note(self, wanted: Wanted, at: int, dtype: str) -> None:
        """Note where a wanted number is."""
        for path in wanted.ends:
            self.found[path] = (at, self.order + dtype)

    def visit(self, part: Field, wanted: Wanted = _NOTHING) -> None:
        """Go over a field, and note where the wanted numbers in it are."""
        if self.at + part.least > len(self.data):
            self.skip(part.least)
        match part:
            case NumberField():
                self.align(part.size)
                self.note(wanted, self.skip(part.size), part.dtype)
            case TextField():
                self.skip(self.length())
            case MessageField():
                self._message(part, wanted)
            case ArrayField():
                self._array(part, wanted)
            case UnreadableField():
                raise InputError(
                    f"holds messages with a field of type {part.name}, which is not read; name other topics"
                )

    def _message(self, part: MessageField, wanted: Wanted) -> None:
        if wanted.ends:  # a stamp, whose numbers have four bytes each
            self.align(4)
            self.note(wanted, self.at, "i4")
        for name, inside in part.fields.items():
            if inside.least:
                self.visit(inside, wanted.inside.get(name, _NOTHING))

    def _array(self, part: ArrayField, wanted: Wanted) -> None:
        count, element = self.length() if part.count is None else part.count, part.element
        if not count or not element.least:
            return
        if count * element.least > len(self.data) - self.at:
            self.skip(count * element.least)
        if isinstance(element, NumberField):
            self.align(element.size)
            begun = self.skip(count * element.size)
            for k, inside in wanted.inside.items():
                if isinstance(k, int) and k < count:
                    self.note(inside, begun + k * element.size, element.dtype)
            return
        for k in range(count):
            self.visit(element, wanted.inside.get(k, _NOTHING))


class _Layout(NamedTuple):
    """Where the numbers are in messages of one length that have these bytes in these places."""

    length: int
    marks: tuple[tuple[int, Bytes], ...]
    found: Found

    def matches(self, batch: MessageBatch, which: Integers) -> Integers:
        """Those of some messages that have it."""
        which = which[batch.lengths[which] == self.length]
        for begun, wanted in self.marks:
            if which.size:
                rows = rows_of(batch.data, batch.starts[which] + begun, wanted.size)
                which = which[(rows == wanted).all(axis=1)]
        return which


class Decoder:
    """Numbers of one channel's messages at some paths."""

    def __init__(self, message: MessageField, paths: Sequence[Path], *, is_cdr: bool) -> None:
        self.message, self.paths, self.is_cdr = message, paths, is_cdr
        self.names_field = next((name for name in NAMES if _is_names(message.fields.get(name))), None)
        tops = {str(path.steps[0]) for path in paths}
        if any(isinstance(step, NamedJoint) for path in paths for step in path.steps) and self.names_field:
            tops.add(self.names_field)
        order = list(message.fields)
        self.fields = list(message.fields.items())[: max((order.index(top) for top in tops), default=-1) + 1]
        self.trees: dict[tuple[str, ...], Wanted] = {}
        self.by_name = self.names_field in tops
        self.layouts: list[_Layout] = []
        self.ranges: dict[Ranges, None] = {}
        self.known: dict[tuple[int, Ranges, tuple[bytes, ...]], Found] = {}
        self.joints: dict[str, None] = {}
        """Names that were seen, in order."""

    def decode(self, batch: MessageBatch) -> list[NDArray[Any]]:
        """The numbers at each path, shape (messages,): nan where a message has none; stamps in ns, else `NO_STAMP`.

        Raises InputError where a message does not fit its definition.
        """
        count = batch.starts.size
        out: list[NDArray[Any]] = [
            np.full(count, NO_STAMP, np.int64) if path.is_stamp else np.full(count, np.nan) for path in self.paths
        ]
        left = np.ones(count, dtype=bool)
        for layout in self.layouts:
            which = layout.matches(batch, np.flatnonzero(left))
            self._take(batch, which, layout, out)
            left[which] = False
            if not left.any():
                return out
        while left.any() and len(self.layouts) < _LAYOUTS:
            layout = self._layout(batch, int(left.argmax()))
            self.layouts.append(layout)
            which = layout.matches(batch, np.flatnonzero(left))
            self._take(batch, which, layout, out)
            left[which] = False
        for k in np.flatnonzero(left).tolist():
            self._take_one(batch, k, out)
        return out

    def _take(self, batch: MessageBatch, which: Integers, layout: _Layout, out: list[NDArray[Any]]) -> None:
        """The numbers of messages that have a layout."""
        if not which.size:
            return
        for path, (offset, dtype) in layout.found.items():
            starts = batch.starts[which] + offset
            if self.paths[path].is_stamp:
                seconds = gather(batch.data, starts, dtype).astype(np.int64)
                out[path][which] = self._stamp(seconds, gather(batch.data, starts + 4, dtype[0] + "u4"))
            else:
                with np.errstate(invalid="ignore"):  # of numbers that are none
                    out[path][which] = gather(batch.data, starts, dtype).astype(float)

    def _take_one(self, batch: MessageBatch, k: int, out: list[NDArray[Any]]) -> None:
        """The numbers of one message, by itself."""
        data = _bytes(batch, k)
        for path, (offset, dtype) in self._found(data).items():
            form = dtype[0] + _FORMS[dtype[1:]]
            if self.paths[path].is_stamp:
                out[path][k] = self._stamp(*unpack_from(f"{form}I", data, offset))
            else:
                out[path][k] = unpack_from(form, data, offset)[0]

    def _found(self, data: bytes) -> Found:
        """Where the wanted numbers of one message are: as in one before with the same marks, else by a walk."""
        for ranges in self.ranges:
            known = self.known.get((len(data), ranges, tuple(data[a:b] for a, b in ranges)))
            if known is not None:
                return known
        walk = self._walked(data)
        ranges = tuple(_merged(walk.marks))
        if len(self.known) < _KNOWN and (ranges in self.ranges or len(self.ranges) < _LAYOUTS):
            self.ranges[ranges] = None
            self.known[len(data), ranges, tuple(data[a:b] for a, b in ranges)] = walk.found
        return walk.found

    def _stamp(self, seconds: Any, nanoseconds: Any) -> Any:
        """A stamp in ns; the seconds of ROS 1 have no sign."""
        return (seconds if self.is_cdr else seconds & 0xFFFFFFFF) * 10**9 + nanoseconds

    def _layout(self, batch: MessageBatch, k: int) -> _Layout:
        """The layout of one message."""
        data = _bytes(batch, k)
        walk, raw = self._walked(data), np.frombuffer(data, np.uint8)
        return _Layout(len(data), tuple((a, raw[a:b]) for a, b in _merged(walk.marks)), walk.found)

    def _walked(self, data: bytes) -> _Walk:
        """A walk through a message, as far as anything is wanted."""
        walk = _Walk(data, self.is_cdr)
        wanted = self._tree(self._names(data) if self.by_name else ())
        for name, part in self.fields:
            begun = walk.at
            walk.visit(part, wanted.inside.get(name, _NOTHING))
            if name == self.names_field and self.by_name:
                walk.marks.append((begun, walk.at))
        return walk

    def _tree(self, names: tuple[str, ...]) -> Wanted:
        """What is wanted in a message with these names."""
        if names not in self.trees:
            if len(self.trees) > _MOST_NAMES:
                self.trees.clear()
            self.trees[names] = _tree(self.paths, names)
        return self.trees[names]

    def _names(self, data: bytes) -> tuple[str, ...]:
        """The names of the joints in a message."""
        walk = _Walk(data, self.is_cdr)
        for name, part in self.message.fields.items():
            if name == self.names_field:
                break
            walk.visit(part)
        names = list[str]()
        for _ in range(walk.length()):
            size = walk.length()
            begun = walk.skip(size)
            names.append(data[begun : walk.at].rstrip(b"\0").decode(errors="replace"))
        if len(self.joints) < _MOST_NAMES:
            self.joints |= dict.fromkeys(names)
        return tuple(names)


def _bytes(batch: MessageBatch, k: int) -> bytes:
    """One message."""
    start = int(batch.starts[k])
    return batch.data[start : start + int(batch.lengths[k])].tobytes()


def _is_names(part: Field | None) -> bool:
    return isinstance(part, ArrayField) and isinstance(part.element, TextField) and part.count is None


def _merged(marks: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """The ranges in order, those that are close to each other as one."""
    merged = list[tuple[int, int]]()
    for begun, end in sorted(marks):
        if merged and begun - merged[-1][1] < _APART:
            merged[-1] = (merged[-1][0], max(end, merged[-1][1]))
        elif end > begun:
            merged.append((begun, end))
    return merged


def _tree(paths: Sequence[Path], names: Sequence[str]) -> Wanted:
    """What is wanted in a message whose joints have these names."""
    tree = Wanted()
    for number, path in enumerate(paths):
        inside: Wanted | None = tree
        for step in path.steps:
            known = _element(step, names) if isinstance(step, NamedJoint) else step
            inside = None if inside is None or known is None else inside.inside.setdefault(known, Wanted())
        if inside is not None:
            inside.ends.append(number)
    return tree


def _element(joint: NamedJoint, names: Sequence[str]) -> int | None:
    """Which element a name, or a number where no joint is named by one, stands for."""
    if joint.name in names:
        return names.index(joint.name)
    numbered = any(name.isdecimal() for name in names)
    return int(joint.name) if joint.name.isdecimal() and len(joint.name) < 10 and not numbered else None
