"""Topics of a bag and the columns that they offer: from a name such as `/joint_states.position[elbow]` to a path."""

import re
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from bristle.data.columns import Key
from bristle.data.ros.definitions import ArrayField, Field, MessageField, NumberField, TextField, message_of
from bristle.data.ros.messages import NAMES, NamedJoint, Step
from bristle.data.ros.messages import Path as FieldPath
from bristle.data.ros.storage import Bag, Channel, channels_of
from bristle.errors import InputError, check_name, short, short_list

JOINT_STATE = "sensor_msgs/msg/JointState"
RECEIVED = "time"  # in place of a field: when a message was received
STAMP = FieldPath(("header", "stamp"), is_stamp=True)
_LONGEST = 1000  # characters of a column's name
_STEP = re.compile(r"([A-Za-z]\w*)(?:\[([^\[\]]*)\])?(\.|$)")
_LISTED = 60  # columns of a topic that are listed


class Topic(NamedTuple):
    """A topic: the channels that its messages are in, of one type."""

    name: str
    kind: str
    channels: tuple[Channel, ...]
    bag: Bag

    def message(self) -> MessageField:
        """The fields of its messages. Raises InputError where they are not known."""
        return message_of(self.channels[0], self.bag.distribution)


class Target(NamedTuple):
    """What a column is: a path in the messages of a topic, or when they were received (None)."""

    topic: str
    path: FieldPath | None

    @property
    def is_time(self) -> bool:
        """Whether it is a time stamp, in ns."""
        return self.path is None or self.path.is_stamp


def topics_of(bag: Bag) -> dict[str, Topic]:
    """The topics of a bag by name. Raises InputError where it cannot be read, or a topic has messages of two types."""
    topics: dict[str, Topic] = {}
    for channel in channels_of(bag):
        check_name(channel.topic, "the topic")
        old = topics.get(channel.topic)
        if old is not None and (old.kind != channel.kind or old.channels[0][3:] != channel[3:]):
            topics[channel.topic] = old._replace(kind="")
            continue
        before = () if old is None else old.channels
        topics[channel.topic] = Topic(channel.topic, channel.kind, (*before, channel), bag)
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
    if not topics[name].kind:
        raise InputError(f"topic {name} has messages of several types; record one, or name another topic")
    message = topics[name].message()
    if rest == RECEIVED and RECEIVED not in message.fields:
        return Target(name, None)
    return Target(name, _path(rest, key, name, message))


def _path(text: str, key: Key, topic: str, message: MessageField) -> FieldPath:
    """The way through a message that a name is, checked against what the message is made of; it ends at a number or at a stamp."""
    part: Field = message
    steps, at = list[Step](), 0
    while at < len(text):
        match = _STEP.match(text, at)
        if match is None:
            raise InputError(
                f"column {key}: {short(text[at:])} is not a field; expected names with dots between, as position[elbow]"
            )
        name, element, _ = match.groups()
        there = part.fields if isinstance(part, MessageField) else {}
        if name not in there:
            received = f", or {topic}.{RECEIVED}, when messages were received"
            also = received if "header" not in there and name == "header" else ""
            raise InputError(f"column {key}: no field {short(name)} in {topic}; there are: {short_list(there)}{also}")
        part = there[name]
        steps.append(name)
        if element is not None:
            part = _element(part, element, key, message, steps)
        at = match.end()
    if key.index is not None:
        part = _element(part, str(key.index), Key(key.column), message, steps)
        steps[-1] = key.index
    match part:
        case MessageField(is_stamp=True):
            return FieldPath(tuple(steps), is_stamp=True)
        case NumberField(code=code) if code:
            return FieldPath(tuple(steps))
        case MessageField():
            why = f"is not a number but a message with {short_list(part.fields)}; name one of these"
        case ArrayField():
            why = f"is an array; say which element, as {topic}.position[elbow] for a joint, or [0] for the first"
        case _:
            why = f"holds {'text' if isinstance(part, TextField) else 'what is not read'}; name a number"
    raise InputError(f"column {key} {why}")


def _element(part: Field, element: str, key: Key, message: MessageField, steps: list[Step]) -> Field:
    """What an array holds; its element is added to the steps, by number or by the name of a joint."""
    if not isinstance(part, ArrayField):
        raise InputError(f"column {key}: {steps[-1]} is not an array; leave [{element[:60]}] out")
    named = any(name in message.fields for name in NAMES)
    if not named and not (element.isdecimal() and len(element) < 10):
        raise InputError(
            f"column {key}: got [{element[:60]}]; expected a number from 0, for these messages name no joints"
        )
    steps.append(NamedJoint(element) if named else int(element))
    return part.element


def columns_of(topic: Topic, joints: tuple[str, ...]) -> list[str]:
    """Names of the columns that a topic offers: stamps and plain numbers, and of joint states those of each joint."""
    message = topic.message()
    fields = list(_leaves(message, topic.name))[:_LISTED]
    states = ("position", "velocity", "effort") if topic.kind == JOINT_STATE else ()
    return [*fields, *(f"{topic.name}.{name}[{joint}]" for joint in joints for name in states)]


def _leaves(part: MessageField, name: str, depth: int = 0) -> Iterator[str]:
    for field, inside in part.fields.items():
        if (isinstance(inside, NumberField) and inside.code) or (isinstance(inside, MessageField) and inside.is_stamp):
            yield f"{name}.{field}"
        elif isinstance(inside, MessageField) and depth < 3:
            yield from _leaves(inside, f"{name}.{field}", depth + 1)
