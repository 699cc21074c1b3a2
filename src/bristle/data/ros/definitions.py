"""What messages are made of: the text of a definition, by the parser of rosbags, as fields to walk.

rosbags would make Python classes of a definition and run them; here only its parser is used, and no code is made of
what a file says. Definitions in IDL are not parsed; types that come with ROS 2 are known without.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from bristle.data.columns import reading
from bristle.data.ros.storage import DAMAGED, Channel
from bristle.errors import InputError, short

_LONGEST = 500_000
"""Characters of a definition."""
_DEEPEST = 30
"""Messages in messages."""
_DTYPES = {
    "bool": "u1",
    "byte": "u1",
    "char": "u1",
    "octet": "u1",
    **{f"{sign}int{bits}": f"{sign[:1] or 'i'}{bits // 8}" for sign in ("", "u") for bits in (8, 16, 32, 64)},
    "float32": "f4",
    "float64": "f8",
}
_STAMPS = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")


@dataclass(frozen=True, slots=True)
class NumberField:
    """One number."""

    dtype: str
    """NumPy's, without the order of bytes."""
    least: int
    """Bytes; in CDR it is aligned to as many."""


@dataclass(frozen=True, slots=True)
class TextField:
    """A length, and as many bytes."""

    least: int = 4


@dataclass(frozen=True, slots=True)
class UnreadableField:
    """What is not read: wide text, numbers of 16 bytes."""

    name: str
    least: int = 1


@dataclass(frozen=True, slots=True)
class ArrayField:
    """Elements in a row: so many, or as many as a length before them says (count None)."""

    element: "Field"
    count: int | None

    @property
    def least(self) -> int:
        """Fewest bytes that it takes."""
        return 4 if self.count is None else self.count * self.element.least


@dataclass(frozen=True, slots=True)
class MessageField:
    """Named fields in a row."""

    kind: str
    fields: Mapping[str, "Field"] = field(compare=False)
    least: int
    """Fewest bytes that they take."""

    @property
    def is_stamp(self) -> bool:
        """Whether it is a time: seconds and nanoseconds, of four bytes each."""
        return self.kind in _STAMPS


Field = NumberField | TextField | UnreadableField | ArrayField | MessageField


def message_of(channel: Channel, distribution: str | None = None) -> MessageField:
    """The fields of a channel's messages: as the bag defines them, else as a distribution of ROS 2 does.

    Raises InputError where the definition cannot be parsed, or a type is not known.
    """
    if channel.encoding not in ("cdr", "ros1"):
        raise InputError(
            f"topic {channel.topic} has messages in {short(channel.encoding)}; expected cdr or ros1, as ROS writes them"
        )
    own: Mapping[str, Any] = {}
    if channel.definition and not channel.is_idl:
        if len(channel.definition) > _LONGEST:
            raise InputError(f"topic {channel.topic}: its message definition has over {_LONGEST} characters; {DAMAGED}")
        own = _parsed(channel.definition, channel.kind, channel.topic)
    return _Builder(own, _store(distribution), channel).message(channel.kind)


@cache
def _parsed(text: str, kind: str, topic: str) -> Mapping[str, Any]:
    from rosbags.typesys import get_types_from_msg

    with reading(f"message definition of topic {topic}", DAMAGED):
        types: Mapping[str, Any] = get_types_from_msg(text, kind)
    return types


def _store(distribution: str | None) -> Mapping[str, Any]:
    """The types that come with a distribution of ROS 2, or the latest where there is no such."""
    from rosbags.typesys import Stores, get_typestore

    known = {store.value: store for store in Stores}
    types: Mapping[str, Any] = get_typestore(known.get(f"ros2_{distribution}", Stores.LATEST)).fielddefs
    return types


class _Builder:
    """Fields by type, each built once: a type that names another twice, and that one too, is no larger for it."""

    def __init__(self, own: Mapping[str, Any], store: Mapping[str, Any], channel: Channel) -> None:
        self.own, self.store, self.channel = own, store, channel
        self.built: dict[str, MessageField] = {}
        self.depth = 0

    def message(self, kind: str) -> MessageField:
        """The fields of a type."""
        if kind in self.built:
            return self.built[kind]
        if self.depth > _DEEPEST:
            raise InputError(
                f"topic {self.channel.topic}: its type {short(self.channel.kind)} nests messages over {_DEEPEST} deep; {DAMAGED}"
            )
        self.depth += 1
        fields = {name: self.field(description) for name, description in self.described(kind)}
        self.depth -= 1
        if not fields and self.channel.encoding == "cdr":
            fields = {"structure_needs_at_least_one_member": NumberField("u1", 1)}
        self.built[kind] = MessageField(kind, fields, sum(part.least for part in fields.values()))
        return self.built[kind]

    def described(self, kind: str) -> list[tuple[str, Any]]:
        """Names and descriptions of the fields of a type, as rosbags has them."""
        if kind in _STAMPS:  # which is no type of its own in ROS 1
            signed = "uint32" if self.channel.encoding == "ros1" and kind == _STAMPS[0] else "int32"
            last = "int32" if self.channel.encoding == "ros1" and kind == _STAMPS[1] else "uint32"
            return [("sec", (1, (signed, 0))), ("nanosec", (1, (last, 0)))]
        entry = self.own.get(kind) or self.store.get(kind)
        if entry is None:
            why = "is defined in IDL, which is not read" if self.channel.is_idl else "is not defined in the bag"
            raise InputError(
                f"topic {self.channel.topic}: its type {short(kind)} {why}, nor one of ROS 2's own; record with definitions (MCAP)"
            )
        fields: list[tuple[str, Any]] = entry[1]
        return fields

    def field(self, description: Any) -> Field:
        """The field that rosbags describes by a number for its form, and what it is of."""
        form, of = int(description[0]), description[1]
        if form == 2:
            return self.message(of)
        if form in (3, 4):
            return ArrayField(self.field(of[0]), min(int(of[1]), 2**32) if form == 3 else None)
        if of[0] == "string":
            return TextField()
        dtype = _DTYPES.get(of[0])
        return UnreadableField(of[0]) if dtype is None else NumberField(dtype, int(dtype[1:]))
