"""Columns of a ROS bag, each at the time stamps of one topic."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.data.columns import Key, bounded, brought_to
from bristle.data.ros.messages import NO_STAMP, Messages, NamedJoint, numbers_of, types_of
from bristle.data.ros.messages import Path as FieldPath
from bristle.data.ros.storage import digest_of, open_bag
from bristle.data.ros.topics import JOINT_STATE, RECEIVED, STAMP, Target, Topic, columns_of, target_of, topics_of
from bristle.errors import InputError, check_name, short, short_list
from bristle.findings import NOTE, Finding

_GAP = 5  # median intervals: across a longer one nothing is interpolated, as the default of `cleaning.gap` is


def read_bag(path: Path, keys: Sequence[Key]) -> tuple[dict[Key, Array], str, tuple[Finding, ...]]:
    """Columns of a bag, (messages of the topic of the time,), with its SHA-256 and notes.

    A column is a topic and the path of a field, as `/joint_states.position[elbow]` or `/wrench.wrench.torque.z`.

    Times are in s from the first one on. Columns of other topics than that of the time are interpolated linearly at
    its stamps: nan before their first message, after their last, and across gaps longer than five median intervals.
    Raises InputError; needs the extra `ros`.
    """
    bag = open_bag(path)
    topics = topics_of(bag)
    targets = {key: target_of(key, topics) for key in keys}
    if not targets:
        return {}, digest_of(bag), ()
    names = list(dict.fromkeys(target.topic for target in targets.values()))
    times = list(dict.fromkeys(target for target in targets.values() if target.is_time))
    if len(names) > 1 and len(times) != 1:
        got = f"the times of {short_list(t.topic for t in times)}" if times else "no stamp"
        raise InputError(
            f"signals come from the topics {short_list(names)}, with {got}; expected one time for all, as "
            f"time: {{column: {names[0]}.header.stamp, unit: s}}"
        )
    base = next(iter([*times, *targets.values()]))

    # where there are several topics, the stamps at which the messages of each stand: those in its header, if the time is one
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

    # what is said of how times were told, and of topics that were interpolated
    notes, clocked = list[Finding](), [*((t.topic, t.path) for t in targets.values()), *clocks.items()]
    if received := sorted({name for name, path in clocked if path is None}):
        message = f"Times of {', '.join(received)} are those at which messages were received, not those of a header."
        notes.append(Finding("time-received", NOTE, message))
    if others := sorted(clocks.keys() - {base.topic}):
        without = np.any([np.isnan(columns[key]) for key, t in targets.items() if t.topic in others], axis=0)
        rows = int(without.sum())
        message = (
            f"{', '.join(others)} interpolated linearly at the stamps of {base.topic}; {rows} row{'' if rows == 1 else 's'} outside them, or in "
            f"gaps longer than {_GAP} intervals, left empty."
        )
        notes.append(Finding("topics-interpolated", NOTE, message, {"rows": rows}))
    return columns, digest_of(bag), tuple(notes)


def _seconds(stamps: NDArray[np.int64], origin: int) -> Array:
    """Stamps in ns as s since one of them, nan where there is none."""
    return np.where(stamps == NO_STAMP, np.nan, (stamps - origin) / 1e9)


def _stamps(time: Target, messages: Messages) -> NDArray[np.int64]:
    """Times in ns, `NO_STAMP` where there is none. Raises InputError where all are zero, and so were never set."""
    if time.path is None:
        return messages.received
    stamps: NDArray[np.int64] = messages.values[time.path]
    if not stamps.any():
        raise InputError(
            f"the stamps of {time.topic} are all zero; name the time as {time.topic}.{RECEIVED}, when its messages were received"
        )
    return stamps


def _refuse_empty(key: Key, target: Target, messages: Messages) -> None:
    """Raise InputError where no message has what a column names."""
    found = messages.received if target.path is None else messages.values[target.path]
    if not ((found == NO_STAMP) if target.is_time else np.isnan(found)).all():
        return
    joint = next((x.name for x in (target.path.steps if target.path else ()) if isinstance(x, NamedJoint)), "")
    if joint and joint not in messages.joints and not joint.isdecimal():
        raise InputError(
            f"column {key}: no joint {short(joint)} in {target.topic}; there are: {short_list(messages.joints)}"
        )
    raise InputError(
        f"column {key} is empty in all {found.size} messages of {target.topic}; leave it out, or name what was logged"
    )


def bag_joints(path: Path, topic: str) -> tuple[str, ...]:
    """Names of the joints in a topic of joint states, in the order in which they are first seen; needs the extra `ros`."""
    return _joints(topics_of(open_bag(path))[topic])


def state_topic(topics: dict[str, Topic]) -> str:
    """The topic of the joint states. Raises InputError where there is none, or several."""
    states = [name for name, t in topics.items() if t.kind == JOINT_STATE]
    if len(states) != 1:
        there = short_list(f"{t.name} ({t.kind})" for t in topics.values())
        raise InputError(
            f"has {'several topics' if states else 'no topic'} of joint states; name each column with its topic, as in "
            f"--column position=/joint_states.position[elbow] (there are: {there})"
        )
    return states[0]


def _joints(topic: Topic) -> tuple[str, ...]:
    return tuple(check_name(name, "the joint") for name in numbers_of(topic, []).joints)


def bag_columns(path: Path) -> tuple[str, ...]:
    """Names of the columns that a bag offers. Raises InputError; needs the extra `ros`."""
    names = list[str]()
    for topic in topics_of(open_bag(path)).values():
        try:
            names += columns_of(topic, _joints(topic) if topic.kind == JOINT_STATE else ())
        except InputError:  # of a topic that is not read, and may not be wanted
            continue
    return tuple(names)
