"""Messages to columns: all messages of a batch are gone through at once, field by field, as arrays of where each has come to."""

from collections.abc import Sequence
from struct import unpack_from
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bristle.data.ros.definitions import ArrayField, Field, MessageField, NumberField, TextField, UnreadableField
from bristle.data.ros.storage import DAMAGED, Integers, MessageBatch, rows_of
from bristle.errors import InputError

NAMES = ("name", "joint_names")
"""Fields that hold the names of joints, in the order of the message's other arrays."""
NO_STAMP = np.iinfo(np.int64).min
"""In place of a stamp that a message does not have."""
_MOST_NAMES, _KNOWN = 1000, 20_000
"""Joints that are listed, and lists of names that are remembered."""
_MOST_ELEMENTS = 10_000
"""Texts or messages in an array: they are gone through one by one."""


class NamedJoint(NamedTuple):
    """In a path: the element of an array that a joint's name has among the names of the message."""

    name: str


Step = str | int | NamedJoint


class Path(NamedTuple):
    """The way to one number, or to one stamp, in a message."""

    steps: tuple[Step, ...]
    is_stamp: bool = False


class _Wanted(NamedTuple):
    """What is wanted of a field: the rest of the way of a path, in some of the messages, (messages,)."""

    path: int
    steps: tuple[Step, ...]
    where: NDArray[np.bool_]


class _Walk:
    """Messages of one byte order, (n,), from field to field; `rows` are those of them that have the field at hand."""

    def __init__(self, batch: MessageBatch, order: str, paths: Sequence[Path], *, is_cdr: bool) -> None:
        self.data, self.order, self.is_cdr = batch.data, order, is_cdr
        self.begun, self.ends = batch.starts + 4 * is_cdr, batch.starts + batch.lengths
        self.at = self.begun.copy()
        self.rows = np.arange(batch.starts.size)
        self.places: dict[NamedJoint, Integers] = {}
        """Which element each joint is, (n,); -1 where it is not there."""
        self.values: list[NDArray[Any]] = [
            np.full(self.at.size, NO_STAMP, np.int64) if path.is_stamp else np.full(self.at.size, np.nan)
            for path in paths
        ]

    def align(self, rows: Integers, size: int) -> None:
        """Go on to where a number of so many bytes may stand."""
        if self.is_cdr:
            self.at[rows] += (self.begun[rows] - self.at[rows]) % size

    def expect(self, rows: Integers, size: Integers | int) -> None:
        """Raises InputError where a message ends before so many bytes."""
        if (self.ends[rows] - self.at[rows] < size).any():
            raise InputError(f"is damaged: a message ends inside one of its fields; {DAMAGED}")

    def skip(self, rows: Integers, size: Integers | int) -> Integers:
        """Go so many bytes on; returns where they began. Raises InputError where a message ends before."""
        self.expect(rows, size)
        begun = self.at[rows]
        self.at[rows] += size
        return begun

    def numbers(self, starts: Integers, dtype: str) -> NDArray[Any]:
        """The numbers of a type at some offsets, at any alignment."""
        return rows_of(self.data, starts, int(dtype[1:])).view(self.order + dtype)[:, 0]

    def lengths(self, rows: Integers) -> Integers:
        """The number of elements or letters that follow."""
        self.align(rows, 4)
        return self.numbers(self.skip(rows, 4), "u4").astype(np.int64)

    def visit(self, part: Field, rows: Integers, wanted: Sequence[_Wanted] = ()) -> None:
        """Go over a field, and take the wanted numbers in it."""
        if not rows.size:
            return
        self.expect(rows, part.least)
        match part:
            case NumberField():
                self.align(rows, part.least)
                self._take(part, rows, self.skip(rows, part.least), wanted)
            case TextField():
                self.skip(rows, self.lengths(rows))
            case MessageField():
                self._message(part, rows, wanted)
            case ArrayField():
                self._array(part, rows, wanted)
            case UnreadableField():
                raise InputError(
                    f"holds messages with a field of type {part.name}, which is not read; name other topics"
                )

    def _take(self, part: NumberField, rows: Integers, starts: Integers, wanted: Sequence[_Wanted]) -> None:
        """The numbers of a field that stand at some offsets."""
        for path, _, where in wanted:
            ours = where[rows]
            self.values[path][rows[ours]] = self.numbers(starts[ours], part.dtype)

    def _message(self, part: MessageField, rows: Integers, wanted: Sequence[_Wanted]) -> None:
        stamps = [want for want in wanted if not want.steps]  # whose numbers have four bytes each
        if stamps:
            self.align(rows, 4)
        begun = self.at[rows]
        for name, inside in part.fields.items():
            if inside.least:
                own = [want._replace(steps=want.steps[1:]) for want in wanted if want.steps[:1] == (name,)]
                self.visit(inside, rows, own)
        for path, _, where in stamps:
            ours = begun[where[rows]]
            seconds = self.numbers(ours, "i4" if self.is_cdr else "u4").astype(np.int64)  # of ROS 1 without a sign
            self.values[path][rows[where[rows]]] = seconds * 10**9 + self.numbers(ours + 4, "u4")

    def _array(self, part: ArrayField, rows: Integers, wanted: Sequence[_Wanted]) -> None:
        element = part.element
        counts = self.lengths(rows) if part.count is None else np.full(rows.size, part.count, np.int64)
        if not element.least:
            return
        self.expect(rows, counts * min(element.least, 2**30))
        rows, counts = rows[counts > 0], counts[counts > 0]
        places = {want.steps[0]: self._places(want.steps[0]) for want in wanted}
        if isinstance(element, NumberField):
            self.align(rows, element.least)
            begun = self.skip(rows, counts * element.least)
            for want in wanted:
                place = places[want.steps[0]]
                there = np.zeros(self.at.size, dtype=bool)
                there[rows] = (place[rows] >= 0) & (place[rows] < counts)
                self._take(
                    element, rows, begun + place[rows] * element.least, [want._replace(where=want.where & there)]
                )
            return
        most = int(counts.max(initial=0))
        if most > _MOST_ELEMENTS:
            raise InputError(
                f"holds messages with {most} texts or messages in one array, over the limit of {_MOST_ELEMENTS}; name other topics"
            )
        for k in range(most):
            own = [
                want._replace(steps=want.steps[1:], where=want.where & (places[want.steps[0]] == k)) for want in wanted
            ]
            self.visit(element, rows[counts > k], [want for want in own if want.where.any()])

    def _places(self, step: Step) -> Integers:
        """Which element a step means in each message."""
        return self.places[step] if isinstance(step, NamedJoint) else np.full(self.at.size, step, np.int64)


class Decoder:
    """Numbers of one channel's messages at some paths."""

    def __init__(self, message: MessageField, paths: Sequence[Path], *, is_cdr: bool) -> None:
        self.message, self.paths, self.is_cdr = message, paths, is_cdr
        self.named = list(dict.fromkeys(x for path in paths for x in path.steps if isinstance(x, NamedJoint)))
        self.names_field = next((name for name in NAMES if _is_names(message.fields.get(name))), None)
        tops = {str(path.steps[0]) for path in paths}
        order = list(message.fields)
        last = max((order.index(top) for top in tops), default=-1)
        self.part = MessageField(message.kind, dict(list(message.fields.items())[: last + 1]), 0)
        self.known: dict[tuple[str, bytes], list[int]] = {}
        """Which element each of `named` is, by the order and the bytes of the names."""
        self.joints: dict[str, None] = {}
        """Names that were seen, in order."""

    def decode(self, batch: MessageBatch) -> list[NDArray[Any]]:
        """The numbers at each path, shape (messages,): nan where a message has none; stamps in ns, else `NO_STAMP`.

        Raises InputError where a message does not fit its definition.
        """
        big = np.zeros(batch.starts.size, dtype=bool)
        if self.is_cdr:
            whole = (batch.lengths >= 4).all()
            head = rows_of(batch.data, batch.starts, 2) if whole else np.ones((1, 2))
            if head[:, 0].any() or (head[:, 1] > 1).any():
                raise InputError(f"is damaged: a message is not in CDR of version 1; {DAMAGED}")
            big = head[:, 1] == 0
        if not big.any():
            return self._decoded(batch, "<")
        little, order = self._decoded(batch.where(~big), "<"), np.argsort(big, kind="stable")
        both = zip(little, self._decoded(batch.where(big), ">"), strict=True)
        return [np.concatenate(parts)[np.argsort(order)] for parts in both]

    def _decoded(self, batch: MessageBatch, order: str) -> list[NDArray[Any]]:
        walk = _Walk(batch, order, self.paths, is_cdr=self.is_cdr)
        found = self._found(batch, order) if self.named else np.zeros((0, 0), np.int64)
        walk.places = dict(zip(self.named, found.T, strict=True))
        everywhere = np.ones(batch.starts.size, dtype=bool)
        with np.errstate(invalid="ignore"):  # of numbers that are none
            walk.visit(self.part, walk.rows, [_Wanted(k, x.steps, everywhere) for k, x in enumerate(self.paths)])
        return walk.values

    def _found(self, batch: MessageBatch, order: str) -> Integers:
        """Which element each of the named joints is in each message, (messages, joints); -1 where it is not there."""
        if self.names_field is None:
            return np.tile(np.array([_element(x, ()) for x in self.named]), (batch.starts.size, 1))
        walk = _Walk(batch, order, (), is_cdr=self.is_cdr)
        for name, part in self.message.fields.items():
            if name == self.names_field:
                break
            walk.visit(part, walk.rows)
        walk.align(walk.rows, 4)
        begun = walk.at.tolist()
        walk.visit(self.message.fields[self.names_field], walk.rows)
        data, found = batch.data.tobytes(), list[list[int]]()
        for start, stop in zip(begun, walk.at.tolist(), strict=True):
            block = order, data[start:stop]
            if block not in self.known:
                names = _texts(*block, is_cdr=self.is_cdr)
                if len(self.joints) < _MOST_NAMES:
                    self.joints |= dict.fromkeys(names)
                if len(self.known) > _KNOWN:
                    self.known.clear()
                self.known[block] = [_element(x, names) for x in self.named]
            found.append(self.known[block])
        return np.array(found, np.int64).reshape(-1, len(self.named))


def _is_names(part: Field | None) -> bool:
    return isinstance(part, ArrayField) and isinstance(part.element, TextField) and part.count is None


def _texts(order: str, block: bytes, *, is_cdr: bool) -> tuple[str, ...]:
    """The texts of an array, which begins with how many they are."""
    names, at = list[str](), 4
    for _ in range(unpack_from(f"{order}I", block)[0]):
        at += -at % 4 if is_cdr else 0
        at, begun = at + 4 + unpack_from(f"{order}I", block, at)[0], at + 4
        names.append(block[begun:at].rstrip(b"\0").decode(errors="replace"))
    return tuple(names)


def _element(joint: NamedJoint, names: Sequence[str]) -> int:
    """Which element a name, or a number where no joint is named by one, stands for; -1: none."""
    if joint.name in names:
        return names.index(joint.name)
    numbered = any(name.isdecimal() for name in names)
    return int(joint.name) if joint.name.isdecimal() and len(joint.name) < 10 and not numbered else -1
