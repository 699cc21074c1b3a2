"""Messages of a topic to numbers; rosbags parses their definition and deserialises them.

rosbags makes code of a definition. So what it parsed is checked first: plain names, and few of everything; constants
and defaults are left out, and definitions in IDL are not parsed.
"""

import re
from array import array
from collections.abc import Mapping, Sequence
from functools import lru_cache
from keyword import iskeyword
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bristle.data.columns import bounded, reading
from bristle.data.ros.storage import DAMAGED, Bag, messages_of
from bristle.errors import InputError, short

NO_STAMP = np.iinfo(np.int64).min  # in place of a stamp that a message does not have
STAMPS = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
BASE, MESSAGE, ARRAY, SEQUENCE = range(1, 5)  # how rosbags calls what a field is
NAMES = ("name", "joint_names")  # fields that hold the names of joints, in the order of the message's other arrays
_LONGEST, _DEEPEST, _MOST_FIELDS = 500_000, 30, 2000
"""Characters of a definition; messages in messages; fields in all, texts and messages of fixed arrays counted: code is made of each."""
_NO_FIELD = "structure_needs_at_least_one_member"  # of an empty message, which takes a byte in CDR and none in ROS 1
_MOST_ELEMENTS, _MOST_JOINTS = 10**7, 1000  # of an array of any length; joints that are listed
_TYPE = re.compile(r"[A-Za-z]\w{0,99}(/[A-Za-z]\w{0,99}){1,3}", re.ASCII)
_FIELD = re.compile(r"[A-Za-z]\w{0,99}", re.ASCII)


class Topic(NamedTuple):
    """A topic of one bag, with messages of one type."""

    name: str
    kind: str  # type of its messages, as `sensor_msgs/msg/JointState`; empty where there are several
    encoding: str  # `cdr` or `ros1`, else it cannot be read
    definition: str  # text of the message definition; empty: the file has none
    is_idl: bool  # whether the definition is in IDL, which is not parsed
    numbers: frozenset[int]  # of its connections
    bag: Bag


class NamedJoint(NamedTuple):
    """In a path: the element of an array that a joint's name has among the names of the message."""

    name: str


class Path(NamedTuple):
    """The way to one number, or to one stamp, in a message."""

    steps: tuple[str | int | NamedJoint, ...]
    is_stamp: bool = False


class Messages(NamedTuple):
    """All messages of a topic, in the order in which they were received, ns."""

    received: NDArray[np.int64]
    values: Mapping[Path, NDArray[Any]]
    """The numbers at each path, message by message: nan where one has none; stamps in ns, else `NO_STAMP`."""
    joints: tuple[str, ...]
    """Names that were seen, in order."""


Types = Mapping[str, Mapping[str, Any]]
"""Of each type its fields by name: what rosbags describes them by, (form, inner)."""


@lru_cache(maxsize=64)
def types_of(topic: Topic) -> Types:
    """What a topic's messages are made of: as the bag defines it, else as its distribution of ROS 2, or the latest.

    Raises InputError where the definition cannot be parsed, a type is not known, or it could do harm.
    """
    if topic.encoding not in ("cdr", "ros1"):
        raise InputError(
            f"topic {topic.name} has messages in {short(topic.encoding)}; expected cdr or ros1, as ROS writes them"
        )
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    given: Mapping[str, Any] = {}
    if topic.definition and not topic.is_idl:
        if len(topic.definition) > _LONGEST:
            raise InputError(f"topic {topic.name}: its message definition has over {_LONGEST} characters; {DAMAGED}")
        with reading(f"message definition of topic {topic.name}", DAMAGED):
            given = get_types_from_msg(topic.definition, topic.kind)
    known = get_typestore({x.value: x for x in Stores}.get(f"ros2_{topic.bag.distribution}", Stores.LATEST)).fielddefs
    types, sizes = dict[str, dict[str, Any]](), dict[str, int]()

    def size_of(kind: str, depth: int) -> int:
        """How many fields are in a type, which is put among the types."""
        if kind in sizes:
            return sizes[kind]
        if depth > _DEEPEST:
            raise InputError(
                f"topic {topic.name}: its type {short(topic.kind)} nests messages over {_DEEPEST} deep; {DAMAGED}"
            )
        found = known.get(kind) if kind in STAMPS else given.get(kind) or known.get(kind)
        if found is None:
            why = "is defined in IDL, which is not read" if topic.is_idl else "is not defined in the bag"
            raise InputError(
                f"topic {topic.name}: its type {short(kind)} {why}, nor one of ROS 2's own; record with definitions (MCAP)"
            )
        fields, size = dict(found[1]), 1
        odd = [f"the name {short(x)}" for x in fields if not _FIELD.fullmatch(x)]
        odd += [] if _TYPE.fullmatch(kind) else [f"the name {short(kind)}"]
        odd += ["one name twice"] if len(fields) < len(found[1]) else []
        odd += ["an empty message"] if topic.encoding == "ros1" and depth and fields.keys() <= {_NO_FIELD} else []
        if odd:
            raise InputError(f"topic {topic.name}: its message definition has {odd[0]}, which is not read; {DAMAGED}")
        for form, inner in fields.values():
            element, count = inner if form in (ARRAY, SEQUENCE) else ((form, inner), 1)
            several = form == ARRAY and not is_number(element)
            size += (count if several else 1) * (size_of(element[1], depth + 1) if element[0] == MESSAGE else 1)
            if size > _MOST_FIELDS or (form == ARRAY and not 0 < count < 2**31):
                raise InputError(
                    f"topic {topic.name}: its type {short(topic.kind)} has over {_MOST_FIELDS} fields, or an array of none; {DAMAGED}"
                )
        types[kind], sizes[kind] = fields, size
        return size

    size_of(topic.kind, 0)
    return types


def is_number(part: Any) -> bool:
    """Whether a part of a message is one number."""
    return bool(part[0] == BASE and part[1][0] != "string")


def is_stamp(part: Any) -> bool:
    """Whether a part of a message is a time: seconds and nanoseconds."""
    return part[0] == MESSAGE and part[1] in STAMPS


def names_in(fields: Mapping[str, Any]) -> str | None:
    """The field that holds the names of joints; None where there is none."""
    lists = (name for name in NAMES if name in fields and fields[name][0] == SEQUENCE)
    return next((name for name in lists if fields[name][1][0][1][0] == "string"), None)


def numbers_of(topic: Topic, paths: Sequence[Path]) -> Messages:
    """The numbers of a topic at some paths. Raises InputError where there is no message, or one does not fit its definition."""
    from rosbags.typesys.store import Typestore

    types, received = types_of(topic), array("q")
    store = Typestore(max_sequence_length=_MOST_ELEMENTS)
    with reading(f"message definition of topic {topic.name}", DAMAGED):
        store.register({kind: ([], list(fields.items())) for kind, fields in types.items()})
        store.get_msgdef(topic.kind)
    decode = store.deserialize_cdr if topic.encoding == "cdr" else store.deserialize_ros1
    columns: dict[Path, array[Any]] = {path: array("q" if path.is_stamp else "d") for path in paths}
    names, seen, joints = names_in(types[topic.kind]), list[str](), dict[str, None]()
    asked = {step for path in columns for step in path.steps if isinstance(step, NamedJoint)}
    places = {joint: _place(joint.name, seen) for joint in asked}
    for time, message in messages_of(topic.bag, topic.numbers, lambda raw: decode(raw, topic.kind)):
        received.append(time)
        bounded(len(received) * (len(columns) + 1))
        if names is not None and (now := getattr(message, names)) != seen:
            seen, places = now, {joint: _place(joint.name, now) for joint in asked}
            joints |= dict.fromkeys(now if len(joints) < _MOST_JOINTS else ())
        for path, column in columns.items():
            found: Any = message
            for step in path.steps:
                if isinstance(step, str):
                    found = getattr(found, step + "_" * iskeyword(step))
                    continue
                place = places[step] if isinstance(step, NamedJoint) else step
                found = found[place] if 0 <= place < len(found) else None
                if found is None:
                    break
            if path.is_stamp:
                column.append(NO_STAMP if found is None else found.sec * 10**9 + found.nanosec)
            else:
                column.append(np.nan if found is None else found)
    if not received:
        raise InputError(f"holds no message of topic {topic.name}; name another")
    order = np.argsort(received, kind="stable")
    values = {path: np.array(column)[order] for path, column in columns.items()}
    return Messages(np.array(received)[order], values, tuple(joints))


def _place(joint: str, names: Sequence[str]) -> int:
    """Which element a joint is, by its name, or by its number where no joint is named by one; -1 where it is not there."""
    if joint in names:
        return names.index(joint)
    return int(joint) if joint.isdecimal() and len(joint) < 10 and not any(map(str.isdecimal, names)) else -1
