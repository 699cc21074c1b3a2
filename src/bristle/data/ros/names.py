"""The numbers of a bag's topics, by names such as `/joint_states.position[elbow]`."""

import re
from array import array
from collections.abc import Mapping, Sequence
from keyword import iskeyword
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bristle.data.columns import Key, bounded
from bristle.data.ros.bag import Topic, messages_of, topics_of
from bristle.data.ros.definitions import SEQUENCE, decoder_of, fields_of, types_of
from bristle.errors import InputError, check_name, short, short_list

JOINT_STATE = "sensor_msgs/msg/JointState"
STAMP, RECEIVED = "header.stamp", "time"  # the field with the time; in place of a field: when a message was received
_NAMES = ("name", "joint_names")  # fields with the names of joints, in the order of the message's other arrays
_LONGEST, _MOST_JOINTS = 1000, 1000  # characters of a name; joints of a topic
NO_STAMP = np.iinfo(np.int64).min  # in place of a stamp that a message does not have


class FieldPath(NamedTuple):
    """The way to one number, or to one time, in the messages of a topic; without steps, to when they were received."""

    topic: str
    steps: tuple[str, ...] = ()  # names of fields, and `[name]` of an element: a joint's, or a number from 0
    is_time: bool = False

    def of(self, message: Any, names: Sequence[str]) -> Any:
        """What a message, with these names of joints, has there; None where it has no such element."""
        found = message
        for step in self.steps:
            if step[0] != "[":
                found = getattr(found, step)
                continue
            element, place = step[1:-1], len(found)
            if element in names:
                place = names.index(element)
            elif element.isdecimal() and not any(map(str.isdecimal, names)):  # else numbers are names
                place = int(element)
            if place >= len(found):
                return None
            found = found[place]
        return found


def listed(topics: Mapping[str, Topic]) -> str:
    """Topics with their types, as quoted in a sentence."""
    return short_list(f"{topic.name} ({topic.kind})" for topic in topics.values())


def path_of(key: Key, topics: Mapping[str, Topic]) -> FieldPath:
    """What a column's name means. Raises InputError where there is no such topic or field, or it holds no number."""
    text = key.column
    if not isinstance(text, str) or len(text) > _LONGEST:
        raise InputError(f"column {key} is not a name; expected a topic and a field, as /joint_states.position[elbow]")

    # the topic at the beginning of the name, or the only joint states, and the rest of the name
    fits = [name for name in topics if text.startswith((f"{name}.", f"{name.removeprefix('/')}."))]
    states = [name for name, topic in topics.items() if topic.kind == JOINT_STATE]
    if not fits and (text.startswith("/") or len(states) != 1):
        why = "is of no topic of the bag, or names none, which only a bag with exactly one of joint states allows"
        raise InputError(f"column {short(text)} {why}; there are: {listed(topics)}")
    name = max(fits, key=len) if fits else states[0]
    rest = text.removeprefix("/")[len(name.removeprefix("/")) + 1 :] if fits else text
    rest += "" if key.index is None else f"[{key.index}]"
    found = fields_of(topics[name])
    field = re.sub(r"\[[^\]]*\]", "[]", rest)
    if field in found:
        steps = re.findall(r"\[[^\]]*\]|\w+", rest)
        return FieldPath(name, tuple(x + "_" * iskeyword(x) for x in steps), found[field])  # as rosbags calls them
    if rest == RECEIVED:
        return FieldPath(name, is_time=True)
    there = short_list([*found, f"{RECEIVED}, when messages were received"])
    raise InputError(f"column {key}: no number {short(rest)} in {name}; there are: {there}")


def time_column(path: Path, column: str) -> str:
    """The time of a column's topic: its stamps, or its receive times where it has none. Raises InputError."""
    topics = topics_of(path)
    topic = path_of(Key(column), topics).topic
    return f"{topic}.{STAMP if STAMP in fields_of(topics[topic]) else RECEIVED}"


def numbers_of(topic: Topic, paths: Sequence[FieldPath]) -> tuple[dict[FieldPath, NDArray[Any]], tuple[str, ...]]:
    """Numbers of a topic at some paths in the order of receipt, and its joints as they are first seen.

    A number is nan, a time (in ns) `NO_STAMP`, where a message has none. Raises InputError where there is no message,
    or one is not as defined.
    """
    own, received, joints = types_of(topic)[topic.kind], array("q"), dict[str, None]()
    lists = (name for name in _NAMES if name in own and own[name][0] == SEQUENCE)
    named = next((name for name in lists if own[name][1][0][1][0] == "string"), "")
    columns: dict[FieldPath, array[Any]] = {x: array("q" if x.is_time else "d") for x in paths if x.steps}
    for time, message in messages_of(topic, decoder_of(topic)):
        received.append(time)
        bounded(len(received) * (len(columns) + 1))
        names = getattr(message, named, ())
        joints |= dict.fromkeys(names if len(joints) < _MOST_JOINTS else ())
        for path, column in columns.items():
            found = path.of(message, names)
            if path.is_time:
                column.append(NO_STAMP if found is None else found.sec * 10**9 + found.nanosec)
            else:
                column.append(np.nan if found is None else found)
    if not received:
        raise InputError(f"holds no message of topic {topic.name}; name another")
    order = np.argsort(received, kind="stable")
    values = {path: np.array(column)[order] for path, column in columns.items()}
    values[FieldPath(topic.name, is_time=True)] = np.array(received)[order]
    return values, tuple(check_name(joint, "the joint") for joint in joints)
