"""What messages are made of: the text of a definition, by the parser of rosbags, as fields to walk.

rosbags would make Python classes of a definition and run them; here only its parser is used, and no code is made of
what a file says. Definitions in IDL are not parsed; types that come with ROS 2 are known without.
"""

from collections.abc import Mapping
from functools import cache
from struct import calcsize
from typing import Any, NamedTuple

from bristle.data.columns import reading
from bristle.data.ros.storage import DAMAGED, Channel
from bristle.errors import InputError, short

_LONGEST = 500_000  # characters of a definition
_DEEPEST = 30  # messages in messages
_CODES = {
    **dict.fromkeys(("bool", "byte", "char", "octet"), "B"),
    **{f"{sign}int{8 * calcsize(f'={code}')}": code for sign, codes in (("", "bhiq"), ("u", "BHIQ")) for code in codes},
    "float32": "f",
    "float64": "d",
}
"""Of each number what the module `struct` calls it."""
_STAMPS = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")


class NumberField(NamedTuple):
    """One number, or (without a code) one that is not read: wide text, numbers of 16 bytes."""

    kind: str
    code: str
    least: int  # bytes; in CDR it is aligned to as many


class TextField(NamedTuple):
    """A length, and as many bytes."""

    least: int = 4


class ArrayField(NamedTuple):
    """Elements in a row: so many, or as many as a length before them says (size None)."""

    element: "Field"
    size: int | None

    @property
    def least(self) -> int:
        """Fewest bytes that it takes."""
        return 4 if self.size is None else self.size * self.element.least


class MessageField(NamedTuple):
    """Named fields in a row."""

    kind: str
    fields: Mapping[str, "Field"]
    least: int

    @property
    def is_stamp(self) -> bool:
        """Whether it is a time: seconds and nanoseconds, of four bytes each."""
        return self.kind in _STAMPS


Field = NumberField | TextField | ArrayField | MessageField


def message_of(channel: Channel, distribution: str | None = None) -> MessageField:
    """The fields of a channel's messages: as the bag defines them, else as a distribution of ROS 2 (or the latest) does.

    Raises InputError where the definition cannot be parsed, or a type is not known.
    """
    if channel.encoding not in ("cdr", "ros1"):
        raise InputError(
            f"topic {channel.topic} has messages in {short(channel.encoding)}; expected cdr or ros1, as ROS writes them"
        )
    from rosbags.typesys import Stores, get_typestore

    types: Mapping[str, Any] = {}
    if channel.definition and not channel.is_idl:
        if len(channel.definition) > _LONGEST:
            raise InputError(f"topic {channel.topic}: its message definition has over {_LONGEST} characters; {DAMAGED}")
        types = _parsed(channel.definition, channel.kind, channel.topic)
    store = {x.value: x for x in Stores}.get(f"ros2_{distribution}", Stores.LATEST)
    built: dict[
        str, MessageField
    ] = {}  # each once: a type that names another twice, and that one too, is no larger for it
    return _message(channel.kind, {**get_typestore(store).fielddefs, **types}, built, channel, 0)


@cache
def _parsed(text: str, kind: str, topic: str) -> Mapping[str, Any]:
    from rosbags.typesys import get_types_from_msg

    with reading(f"message definition of topic {topic}", DAMAGED):
        types: Mapping[str, Any] = get_types_from_msg(text, kind)
    return types


def _message(
    kind: str, types: Mapping[str, Any], built: dict[str, MessageField], channel: Channel, depth: int
) -> MessageField:
    """The fields of a type; Time and Duration are no types of their own in ROS 1, and have other signs there."""
    if kind in built:
        return built[kind]
    if depth > _DEEPEST:
        raise InputError(
            f"topic {channel.topic}: its type {short(channel.kind)} nests messages over {_DEEPEST} deep; {DAMAGED}"
        )
    if kind not in types and kind not in _STAMPS:
        why = "is defined in IDL, which is not read" if channel.is_idl else "is not defined in the bag"
        raise InputError(
            f"topic {channel.topic}: its type {short(kind)} {why}, nor one of ROS 2's own; record with definitions (MCAP)"
        )

    def of(description: Any) -> Field:
        """The field that rosbags describes by a number for its form, and what it is of."""
        form, inner = int(description[0]), description[1]
        if form == 2:
            return _message(inner, types, built, channel, depth + 1)
        if form in (3, 4):
            return ArrayField(of(inner[0]), min(int(inner[1]), 2**32) if form == 3 else None)
        code = _CODES.get(inner[0], "")
        return TextField() if inner[0] == "string" else NumberField(inner[0], code, calcsize(f"={code}") or 1)

    if kind in _STAMPS:
        old = channel.encoding == "ros1"
        signs = "Ii" if old and kind == _STAMPS[0] else "ii" if old else "iI"
        fields: dict[str, Field] = {
            name: NumberField(kind, code, 4) for name, code in zip(("sec", "nanosec"), signs, strict=True)
        }
    else:
        fields = {name: of(description) for name, description in types[kind][1]}
    if not fields and channel.encoding == "cdr":
        fields = {"structure_needs_at_least_one_member": NumberField("uint8", "B", 1)}
    built[kind] = MessageField(kind, fields, sum(part.least for part in fields.values()))
    return built[kind]
