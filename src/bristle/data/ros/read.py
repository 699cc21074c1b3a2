"""Columns of a ROS bag, by names such as `/joint_states.position[elbow]`."""

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from keyword import iskeyword
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.data.columns import Key, bounded, brought_to, reading
from bristle.data.ros import bag as ros
from bristle.data.ros.bag import NO_STAMP, Bag, FieldPath, Messages, NamedJoint, Topic, Types, numbers_of, types_of
from bristle.errors import InputError, check_name, short, short_list
from bristle.findings import NOTE, Finding

JOINT_STATE = "sensor_msgs/msg/JointState"
RECEIVED = "time"  # in place of a field: when a message was received
STAMP = FieldPath(("header", "stamp"), is_stamp=True)
_LONGEST = 1000  # characters of a column's name
_STEP = re.compile(r"([A-Za-z]\w*)(?:\[([^\[\]]*)\])?(\.|$)")
_LISTED = 60  # columns of a topic that are listed
_GAP = 5  # median intervals: nothing is interpolated across a longer one, as `cleaning.gap` has it by default


class Target(NamedTuple):
    """What a column is: a path in the messages of a topic, or when they were received (None)."""

    topic: str
    path: FieldPath | None

    @property
    def is_time(self) -> bool:
        """Whether it is a time stamp, in ns."""
        return self.path is None or self.path.is_stamp


def topics_of(bag: Bag) -> dict[str, Topic]:
    """The topics of a bag by name; the kind is empty where there are several. Raises InputError where it cannot be read."""
    topics: dict[str, Topic] = {}
    with ros.opened(bag) as reader, reading(ros.WHAT, ros.DAMAGED):
        connections = list(reader.connections)
    for c in connections:
        name = check_name(c.topic, "the topic")
        kind = check_name(c.msgtype, f"the type of {short(name)}")
        encoding, is_idl = getattr(c.ext, "serialization_format", "ros1"), c.msgdef.format.name == "IDL"
        own = Topic(name, kind, encoding, c.msgdef.data, is_idl, frozenset([c.id]), bag)
        old = topics.get(name, own)
        alike = old._replace(numbers=own.numbers) == own
        topics[name] = own._replace(kind=kind if alike else "", numbers=old.numbers | own.numbers)
    return topics


def _listed(topics: Mapping[str, Topic]) -> str:
    return short_list(f"{topic.name} ({topic.kind})" for topic in topics.values())


def target_of(key: Key, topics: Mapping[str, Topic]) -> Target:
    """What a column's name means. Raises InputError where there is no such topic or field, or it holds no number."""
    text = key.column
    if not isinstance(text, str) or len(text) > _LONGEST:
        raise InputError(f"column {key} is not a name; expected a topic and a field, as /joint_states.position[elbow]")

    # the topic at the beginning of the name, or the only joint states, and the rest of the name
    fits = [name for name in topics if text.startswith((f"{name}.", f"{name.removeprefix('/')}."))]
    states = [name for name, topic in topics.items() if topic.kind == JOINT_STATE]
    if not fits and text.startswith("/"):
        raise InputError(f"column {short(text)} is of no topic of the bag; there are: {_listed(topics)}")
    if not fits and len(states) != 1:
        why = "names no topic, which only a bag with exactly one of joint states allows"
        raise InputError(f"column {short(text)} {why}; there are: {_listed(topics)}")
    name = max(fits, key=len) if fits else states[0]
    rest = text.removeprefix("/")[len(name.removeprefix("/")) + 1 :] if fits else text
    topic = topics[name]
    if not topic.kind:
        raise InputError(f"topic {name} has messages of several types; record one, or name another topic")
    types = types_of(topic)
    received = rest == RECEIVED and RECEIVED not in types[topic.kind]
    return Target(name, None if received else _path(rest, key, topic, types))


def _path(text: str, key: Key, topic: Topic, types: Types) -> FieldPath:
    """The path in a message that a name means, to a number or a stamp, checked against the message's type."""
    part: Any = (ros.MESSAGE, topic.kind)
    steps, at = list[str | int | NamedJoint](), 0
    named = any(name in types[topic.kind] for name in ros.NAMES)
    while at < len(text):
        match = _STEP.match(text, at)
        if match is None:
            expected = "names with dots between, as position[elbow]"
            raise InputError(f"column {key}: {short(text[at:])} is not a field; expected {expected}")
        name, element, _ = match.groups()
        there = types[part[1]] if part[0] == ros.MESSAGE else {}
        if name not in there:
            received = f", or {topic.name}.{RECEIVED}, when messages were received" if name == "header" else ""
            known = f"there are: {short_list(there)}{received}"
            raise InputError(f"column {key}: no field {short(name)} in {topic.name}; {known}")
        part, at = there[name], match.end()
        steps.append(name + "_" * iskeyword(name))  # as rosbags calls it
        ends = [] if element is None else [(element, named)]
        ends += [(str(key.index), False)] if at == len(text) and key.index is not None else []
        for inner, by_name in ends:
            if part[0] in (ros.BASE, ros.MESSAGE):
                raise InputError(f"column {key}: {name} is not an array; leave [{inner[:60]}] out")
            if not by_name and not (inner.isdecimal() and len(inner) < 10):
                expected = "a number from 0, for these messages name no joints"
                raise InputError(f"column {key}: got [{inner[:60]}]; expected {expected}")
            steps.append(NamedJoint(inner) if by_name else int(inner))
            part = part[1][0]
    if ros.is_stamp(part) or ros.is_number(part):
        return FieldPath(tuple(steps), is_stamp=ros.is_stamp(part))
    if part[0] == ros.MESSAGE:
        why = f"is not a number but a message with {short_list(types[part[1]])}; name one of these"
    elif part[0] == ros.BASE:
        why = "holds text; name a number"
    else:
        why = f"is an array; say which element, as {topic.name}.position[elbow] for a joint, or [0] for the first"
    raise InputError(f"column {key} {why}")


def read_bag(path: Path, keys: Sequence[Key]) -> tuple[dict[Key, Array], str, tuple[Finding, ...]]:
    """Columns of a bag, (messages of the topic of the time,), with its SHA-256 and notes.

    A column is a topic and the path of a field, as `/joint_states.position[elbow]` or `/wrench.wrench.torque.z`. Times
    are in s from the first one. Columns of other topics than that of the time are interpolated linearly at its stamps:
    nan before their first message, after their last, and across gaps longer than five median intervals.

    Raises InputError; needs the extra `ros`.
    """
    bag = ros.open_bag(path)
    topics = topics_of(bag)
    targets = {key: target_of(key, topics) for key in keys}
    if not targets:
        return {}, ros.digest_of(bag), ()
    names = list(dict.fromkeys(target.topic for target in targets.values()))
    times = list(dict.fromkeys(target for target in targets.values() if target.is_time))
    if len(names) > 1 and len(times) != 1:
        got = f"the times of {short_list(t.topic for t in times)}" if times else "no stamp"
        expected = f"one time for all, as time: {{column: {names[0]}.header.stamp, unit: s}}"
        raise InputError(f"signals come from the topics {short_list(names)}, with {got}; expected {expected}")
    base = next(iter([*times, *targets.values()]))

    # the clock of each of several topics: the stamps in its header, if the time is a stamp, else the receive times
    clocks: dict[str, FieldPath | None] = {}
    for name in names if len(names) > 1 else ():
        types = types_of(topics[name])
        header = types[topics[name].kind].get("header", ())
        stamped = base.path is not None and "stamp" in types.get(header[-1] if header else "", ())
        clocks[name] = base.path if name == base.topic else STAMP if stamped else None

    read = dict[str, Messages]()
    for name in names:
        paths = [*(t.path for t in targets.values() if t.topic == name), clocks.get(name)]
        read[name] = numbers_of(topics[name], [path for path in paths if path])
    bounded(sum(messages.received.size for messages in read.values()) * len(keys))
    columns = dict[Key, Array]()
    for key, target in targets.items():
        messages = read[target.topic]
        _refuse_empty(key, target, messages)
        if target.is_time:
            stamps = _stamps(target, messages)
            columns[key] = _seconds(stamps, int(stamps[stamps != NO_STAMP][0]))
            continue
        found: Array = messages.values[target.path or STAMP]
        if target.topic != base.topic:
            at = _stamps(Target(base.topic, clocks[base.topic]), read[base.topic])
            own = _stamps(Target(target.topic, clocks[target.topic]), messages)
            origin, order = int(at.max()), np.argsort(own, kind="stable")
            try:
                found = brought_to(_seconds(at, origin), _seconds(own[order], origin), found[order], _GAP)
            except InputError as error:
                raise InputError(f"{target.topic}: {error}") from error
        columns[key] = found

    # notes on receive times and on interpolated topics
    notes, clocked = list[Finding](), [*((t.topic, t.path) for t in targets.values()), *clocks.items()]
    if received := sorted({name for name, path in clocked if path is None}):
        message = f"Times of {', '.join(received)} are those at which messages were received, not those of a header."
        notes.append(Finding("time-received", NOTE, message))
    if others := sorted(clocks.keys() - {base.topic}):
        without = np.any([np.isnan(columns[key]) for key, t in targets.items() if t.topic in others], axis=0)
        rows = int(without.sum())
        message = (
            f"{', '.join(others)} interpolated linearly at the stamps of {base.topic}; {rows} row{'s' * (rows != 1)} "
            f"outside them, or in gaps longer than {_GAP} intervals, left empty."
        )
        notes.append(Finding("topics-interpolated", NOTE, message, {"rows": rows}))
    return columns, ros.digest_of(bag), tuple(notes)


def _seconds(stamps: NDArray[np.int64], origin: int) -> Array:
    """Stamps, ns, as s since one of them; nan where there is none."""
    return np.where(stamps == NO_STAMP, np.nan, (stamps - origin) / 1e9)


def _stamps(time: Target, messages: Messages) -> NDArray[np.int64]:
    """Times in ns, `NO_STAMP` where there is none. Raises InputError where all are zero, and so were never set."""
    if time.path is None:
        return messages.received
    stamps: NDArray[np.int64] = messages.values[time.path]
    if not stamps.any():
        remedy = f"name the time as {time.topic}.{RECEIVED}, when its messages were received"
        raise InputError(f"the stamps of {time.topic} are all zero; {remedy}")
    return stamps


def _refuse_empty(key: Key, target: Target, messages: Messages) -> None:
    """Raise InputError where no message has what a column names."""
    found = messages.received if target.path is None else messages.values[target.path]
    if not ((found == NO_STAMP) if target.is_time else np.isnan(found)).all():
        return
    joint = next((x.name for x in (target.path.steps if target.path else ()) if isinstance(x, NamedJoint)), "")
    if joint and joint not in messages.joints and not joint.isdecimal():
        there = short_list(messages.joints)
        raise InputError(f"column {key}: no joint {short(joint)} in {target.topic}; there are: {there}")
    remedy = "leave it out, or name a field that was logged"
    raise InputError(f"column {key} is empty in all {found.size} messages of {target.topic}; {remedy}")


def joint_states(path: Path) -> tuple[str, tuple[str, ...]]:
    """The topic of a bag's joint states, and their joints in the order in which they are first seen.

    Raises InputError where there is no such topic, or there are several; needs the extra `ros`.
    """
    topics = topics_of(ros.open_bag(path))
    states = [name for name, t in topics.items() if t.kind == JOINT_STATE]
    if len(states) != 1:
        raise InputError(
            f"has {'several topics' if states else 'no topic'} of joint states; name each column with its topic, as in "
            f"--column position=/joint_states.position[elbow] (there are: {_listed(topics)})"
        )
    return states[0], _joints(topics[states[0]])


def _joints(topic: Topic) -> tuple[str, ...]:
    return tuple(check_name(name, "the joint") for name in numbers_of(topic, []).joints)


def bag_columns(path: Path) -> tuple[str, ...]:
    """The columns that a bag offers: stamps, plain numbers, and the joints of joint states; needs the extra `ros`."""

    def leaves(types: Types, kind: str, name: str, depth: int = 0) -> Iterator[str]:
        for field, part in types[kind].items():
            if ros.is_number(part) or ros.is_stamp(part):
                yield f"{name}.{field}"
            elif part[0] == ros.MESSAGE and depth < 3:
                yield from leaves(types, part[1], f"{name}.{field}", depth + 1)

    names = list[str]()
    for topic in topics_of(ros.open_bag(path)).values():
        with suppress(InputError):  # of a topic that cannot be read, and may not be wanted
            names += list(leaves(types_of(topic), topic.kind, topic.name))[:_LISTED]
            joints = _joints(topic) if topic.kind == JOINT_STATE else ()
            names += [f"{topic.name}.{x}[{joint}]" for joint in joints for x in ("position", "velocity", "effort")]
    return tuple(names)


def time_column(path: Path, column: str) -> str:
    """The time of a column's topic: its stamps, or its receive times where it has none. Raises InputError."""
    topics = topics_of(ros.open_bag(path))
    topic = target_of(Key(column), topics).topic
    with suppress(InputError):
        read_bag(path, [Key(f"{topic}.header.stamp")])
        return f"{topic}.header.stamp"
    return f"{topic}.{RECEIVED}"
