"""Topics of a bag and the columns that they offer: from a name such as `/joint_states.position[elbow]` to a path."""

import re
from collections.abc import Iterator, Mapping
from keyword import iskeyword
from typing import Any, NamedTuple

from bristle.data.columns import Key, reading
from bristle.data.ros.messages import (
    BASE,
    MESSAGE,
    NAMES,
    NamedJoint,
    Path,
    Topic,
    Types,
    is_number,
    is_stamp,
    types_of,
)
from bristle.data.ros.storage import DAMAGED, WHAT, Bag, opened
from bristle.errors import InputError, check_name, short, short_list

JOINT_STATE = "sensor_msgs/msg/JointState"
RECEIVED = "time"  # in place of a field: when a message was received
STAMP = Path(("header", "stamp"), is_stamp=True)
_LONGEST = 1000  # characters of a column's name
_STEP = re.compile(r"([A-Za-z]\w*)(?:\[([^\[\]]*)\])?(\.|$)")
_LISTED = 60  # columns of a topic that are listed


class Target(NamedTuple):
    """What a column is: a path in the messages of a topic, or when they were received (None)."""

    topic: str
    path: Path | None

    @property
    def is_time(self) -> bool:
        """Whether it is a time stamp, in ns."""
        return self.path is None or self.path.is_stamp


def topics_of(bag: Bag) -> dict[str, Topic]:
    """The topics of a bag by name; one with messages of several types has none. Raises InputError where it cannot be read."""
    topics: dict[str, Topic] = {}
    with opened(bag) as reader, reading(WHAT, DAMAGED):
        connections = [
            (c.id, c.topic, c.msgtype, getattr(c.ext, "serialization_format", "ros1"), c.msgdef.data, c.msgdef.format.name == "IDL")
            for c in reader.connections
        ]  # fmt: skip  # a record
    for number, name, kind, *about in connections:
        check_name(name, "the topic")
        check_name(kind, f"the type of {short(name)}")
        own = Topic(name, kind, *about, frozenset([number]), bag)
        old = topics.get(name, own)
        alike = old._replace(numbers=own.numbers) == own
        topics[name] = own._replace(kind=kind if alike else "", numbers=old.numbers | own.numbers)
    return topics


def target_of(key: Key, topics: Mapping[str, Topic]) -> Target:
    """What a column's name means. Raises InputError where there is no such topic or field, or it holds no number."""
    text = key.column
    if not isinstance(text, str) or len(text) > _LONGEST:
        raise InputError(f"column {key} is not a name; expected a topic and a field, as /joint_states.position[elbow]")

    # the topic that the name begins with, or the only one that it can mean, and what follows
    fits = [name for name in topics if text.startswith((f"{name}.", f"{name.removeprefix('/')}."))]
    there = short_list(f"{topic.name} ({topic.kind})" for topic in topics.values())
    states = [name for name, topic in topics.items() if topic.kind == JOINT_STATE]
    if not fits and text.startswith("/"):
        raise InputError(f"column {short(text)} is of no topic of the bag; there are: {there}")
    if not fits and len(states) != 1:
        raise InputError(
            f"column {short(text)} names no topic, which only a bag with exactly one of joint states allows; there are: {there}"
        )
    name = max(fits, key=len) if fits else states[0]
    rest = text.removeprefix("/")[len(name.removeprefix("/")) + 1 :] if fits else text
    topic = topics[name]
    if not topic.kind:
        raise InputError(f"topic {name} has messages of several types; record one, or name another topic")
    if rest == RECEIVED and RECEIVED not in types_of(topic)[topic.kind]:
        return Target(name, None)
    return Target(name, _path(rest, key, topic, types_of(topic)))


def _path(text: str, key: Key, topic: Topic, types: Types) -> Path:
    """The way through a message that a name is, checked against what the message is made of; it ends at a number or at a stamp."""
    part: Any = (MESSAGE, topic.kind)
    steps, at = list[str | int | NamedJoint](), 0
    named = any(name in types[topic.kind] for name in NAMES)
    while at < len(text):
        match = _STEP.match(text, at)
        if match is None:
            raise InputError(
                f"column {key}: {short(text[at:])} is not a field; expected names with dots between, as position[elbow]"
            )
        name, element, _ = match.groups()
        there = types[part[1]] if part[0] == MESSAGE else {}
        if name not in there:
            received = f", or {topic.name}.{RECEIVED}, when messages were received"
            also = received if "header" not in there and name == "header" else ""
            raise InputError(
                f"column {key}: no field {short(name)} in {topic.name}; there are: {short_list(there)}{also}"
            )
        part, at = there[name], match.end()
        steps.append(name + "_" * iskeyword(name))  # as rosbags calls it
        ends = [] if element is None else [(element, named)]
        ends += [(str(key.index), False)] if at == len(text) and key.index is not None else []
        for inner, by_name in ends:
            if part[0] in (BASE, MESSAGE):
                raise InputError(f"column {key}: {name} is not an array; leave [{inner[:60]}] out")
            if not by_name and not (inner.isdecimal() and len(inner) < 10):
                raise InputError(
                    f"column {key}: got [{inner[:60]}]; expected a number from 0, for these messages name no joints"
                )
            steps.append(NamedJoint(inner) if by_name else int(inner))
            part = part[1][0]
    if is_stamp(part) or is_number(part):
        return Path(tuple(steps), is_stamp=is_stamp(part))
    if part[0] == MESSAGE:
        why = f"is not a number but a message with {short_list(types[part[1]])}; name one of these"
    elif part[0] == BASE:
        why = "holds text; name a number"
    else:
        why = f"is an array; say which element, as {topic.name}.position[elbow] for a joint, or [0] for the first"
    raise InputError(f"column {key} {why}")


def columns_of(topic: Topic, joints: tuple[str, ...]) -> list[str]:
    """Names of the columns that a topic offers: stamps and plain numbers, and of joint states those of each joint."""
    types = types_of(topic)

    def leaves(kind: str, name: str, depth: int = 0) -> Iterator[str]:
        for field, part in types[kind].items():
            if is_number(part) or is_stamp(part):
                yield f"{name}.{field}"
            elif part[0] == MESSAGE and depth < 3:
                yield from leaves(part[1], f"{name}.{field}", depth + 1)

    states = ("position", "velocity", "effort") if topic.kind == JOINT_STATE else ()
    fields = list(leaves(topic.kind, topic.name))[:_LISTED]
    return [*fields, *(f"{topic.name}.{name}[{joint}]" for joint in joints for name in states)]
