"""Messages to numbers: each is gone through field by field, as far as the last one that is wanted."""

import struct
from array import array
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from bristle.data.ros.definitions import ArrayField, Field, MessageField, NumberField, TextField
from bristle.data.ros.storage import DAMAGED
from bristle.errors import InputError

NAMES = ("name", "joint_names")  # fields that hold the names of joints, in the order of the message's other arrays
NO_STAMP = np.iinfo(np.int64).min  # in place of a stamp that a message does not have
_MOST_NAMES, _MOST_ELEMENTS = 1000, 10_000
"""Joints that are listed, and texts or messages in an array: they are gone through one by one."""
_NOTHING: Mapping[Any, Any] = {}


class NamedJoint(NamedTuple):
    """In a path: the element of an array that a joint's name has among the names of the message."""

    name: str


Step = str | int | NamedJoint


class Path(NamedTuple):
    """The way to one number, or to one stamp, in a message."""

    steps: tuple[Step, ...]
    is_stamp: bool = False


class Decoder:
    """Numbers of one topic's messages at some paths: each message is gone through as far as its last field that is wanted."""

    def __init__(self, message: MessageField, paths: Sequence[Path], *, is_cdr: bool) -> None:
        self.is_cdr = is_cdr
        self.columns: list[array[Any]] = [array("q" if path.is_stamp else "d") for path in paths]
        """The numbers at each path, message by message: nan where one has none; stamps in ns, else `NO_STAMP`."""
        self.joints: dict[str, None] = {}
        """Names that were seen, in order."""
        self.places: dict[Any, int] = dict.fromkeys(
            (x for p in paths for x in p.steps if isinstance(x, NamedJoint)), -1
        )
        """Which element each joint of a path is, in the message at hand; -1 where it is not there."""
        self.wanted: dict[Any, Any] = {}
        """The paths by their steps, one in the other, and at None the number of each that ends there."""
        for k, path in enumerate(paths):
            within = self.wanted
            for step in path.steps:
                within = within.setdefault(step, {})
            within.setdefault(None, []).append(k)
        lists = [x for name in NAMES if isinstance(x := message.fields.get(name), ArrayField) and x.size is None]
        self.names = next((x for x in lists if isinstance(x.element, TextField)), None)
        order = [name for name, x in message.fields.items() if name in self.wanted or (self.places and x is self.names)]
        fields = list(message.fields)[: list(message.fields).index(order[-1]) + 1] if order else []
        parts = {name: message.fields[name] for name in fields}
        self.part = MessageField(message.kind, parts, sum(part.least for part in parts.values()))
        named = [p.steps[0] for p in paths if any(isinstance(x, NamedJoint) for x in p.steps)]
        behind = next((k for k, x in enumerate(parts.values()) if x is self.names), 0)
        self.rounds = 2 if any(str(name) in fields[:behind] for name in named) else 1
        """Twice where the names stand behind what they name."""
        self.raw, self.at, self.order, self.values = b"", 0, "<", list[float]()
        self.texts, self.seen = list[bytes](), list[bytes]()
        self._place(())

    def decode(self, raw: bytes) -> None:
        """Add the numbers of a message. Raises InputError where it does not fit its definition."""
        if self.is_cdr and (len(raw) < 4 or raw[0] or raw[1] > 1):
            raise InputError(f"is damaged: a message is not in CDR of version 1; {DAMAGED}")
        self.raw, self.order = raw, ">" if self.is_cdr and not raw[1] else "<"
        self.values = [NO_STAMP if column.typecode == "q" else np.nan for column in self.columns]
        try:
            for _ in range(self.rounds):
                self.at = 4 * self.is_cdr
                self._expect(self.part.least)
                self._visit(self.part, self.wanted)
            self._expect(0)
        except struct.error as error:
            raise InputError(f"is damaged: a message ends inside one of its fields; {DAMAGED}") from error
        for column, value in zip(self.columns, self.values, strict=True):
            column.append(value)

    def _expect(self, size: int) -> None:
        if self.at + size > len(self.raw):
            raise struct.error

    def _number(self, code: str, size: int) -> Any:
        """The next number, which in CDR stands at a multiple of its size, behind the head."""
        if self.is_cdr:
            self.at += (4 - self.at) % size
        self.at += size
        return struct.unpack_from(self.order + code, self.raw, self.at - size)[0]

    def _visit(self, part: Field, wanted: Mapping[Any, Any]) -> None:
        """Go over a field, and take the numbers in it that are wanted."""
        if isinstance(part, TextField):
            size = self._number("I", 4)
            self.texts.append(self.raw[self.at : self.at + size])
            self.at += size
        elif isinstance(part, NumberField):
            if not part.code:
                raise InputError(
                    f"holds messages with a field of type {part.kind}, which is not read; name other topics"
                )
            value = self._number(part.code, part.least)
            for path in wanted.get(None, ()):
                self.values[path] = value
        elif isinstance(part, MessageField):
            begun = self.at
            for path in wanted.get(None, ()):  # a stamp; of ROS 1 without a sign
                seconds = self._number("i" if self.is_cdr else "I", 4)
                self.values[path], self.at = seconds * 10**9 + self._number("I", 4), begun
            for name, inside in part.fields.items():
                self.texts = []
                self._visit(inside, wanted.get(name, _NOTHING))
                if inside is self.names and self.texts != self.seen:
                    self.seen = self.texts
                    self._place([text.rstrip(b"\0").decode(errors="replace") for text in self.texts])
        else:
            self._array(part.element, self._number("I", 4) if part.size is None else part.size, wanted)

    def _array(self, element: Field, count: int, wanted: Mapping[Any, Any]) -> None:
        if not element.least or not count:
            return
        self._expect(count * element.least)
        inner = [(self.places.get(step, step), within) for step, within in wanted.items()]
        if isinstance(element, NumberField) and element.code:
            begun = self.at + ((4 - self.at) % element.least if self.is_cdr else 0)
            for place, within in inner:
                if 0 <= place < count:
                    self.at = begun + place * element.least
                    self._visit(element, within)
            self.at = begun + count * element.least
            return
        if count > _MOST_ELEMENTS:
            raise InputError(
                f"holds messages with {count} texts or messages in one array, over the limit of {_MOST_ELEMENTS}; name other topics"
            )
        for k in range(count):
            begun = self.at
            self._visit(element, _NOTHING)
            for place, within in inner:
                if place == k:
                    self.at = begun
                    self._visit(element, within)

    def _place(self, names: Sequence[str]) -> None:
        """Which element each joint, by its name, or by a number where no joint is named by one, stands for."""
        numbered = any(map(str.isdecimal, names))
        for joint in self.places:
            number = int(joint.name) if joint.name.isdecimal() and len(joint.name) < 10 and not numbered else -1
            self.places[joint] = names.index(joint.name) if joint.name in names else number
        if len(self.joints) < _MOST_NAMES:
            self.joints |= dict.fromkeys(names)
