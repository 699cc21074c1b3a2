"""Columns of a ROS bag, each at the time stamps of one topic."""

from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.data.columns import Key, between_samples, bounded
from bristle.data.ros.messages import NO_STAMP, Decoder, NamedJoint
from bristle.data.ros.messages import Path as FieldPath
from bristle.data.ros.storage import digest_of, messages_of, open_bag
from bristle.data.ros.topics import JOINT_STATE, RECEIVED, STAMP, Target, Topic, columns_of, target_of, topics_of
from bristle.errors import InputError, check_name, short, short_list
from bristle.findings import NOTE, Finding

Integers = NDArray[np.int64]
_GAP = 5  # median intervals: across a longer one nothing is interpolated, as the default of `cleaning.gap` is


@dataclass(frozen=True, slots=True)
class _Messages:
    """All messages of a topic, in the order in which they were received, ns."""

    topic: str
    received: Integers
    values: Mapping[FieldPath, NDArray[Any]]
    joints: tuple[str, ...]

    def stamps(self, path: FieldPath | None) -> Integers:
        """Times in ns, `NO_STAMP` where there is none. Raises InputError where all are zero, and so were never set."""
        stamps: Integers = self.received if path is None else self.values[path]
        if path is not None and stamps.size and not stamps.any():
            raise InputError(
                f"the stamps of {self.topic} are all zero; name the time as {self.topic}.{RECEIVED}, when its messages were received"
            )
        return stamps


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
        header = topics[name].message().fields.get("header")
        stamped = base.path is not None and "stamp" in getattr(header, "fields", {})
        clocks[name] = base.path if name == base.topic else STAMP if stamped else None

    read = dict[str, _Messages]()
    for name in names:
        paths = [*(t.path for t in targets.values() if t.topic == name), clocks.get(name)]
        read[name] = _read(topics[name], [path for path in paths if path])
    bounded(sum(messages.received.size for messages in read.values()) * len(keys))
    columns = {key: _column(key, target, read, base.topic, clocks) for key, target in targets.items()}
    return columns, digest_of(bag), tuple(_notes(targets, columns, base, clocks))


def _read(topic: Topic, paths: Sequence[FieldPath]) -> _Messages:
    """The numbers of a topic at some paths, in the order in which messages were received."""
    paths, received = list(dict.fromkeys(paths)), array("q")
    decoder = Decoder(topic.message(), paths, is_cdr=topic.channels[0].encoding == "cdr")
    for _, time, raw in messages_of(topic.bag, frozenset(channel.number for channel in topic.channels)):
        received.append(time)
        bounded(len(received) * (len(paths) + 1))
        decoder.decode(raw)
    if not received:
        raise InputError(f"holds no message of topic {topic.name}; name another")
    order = np.argsort(received, kind="stable")
    values = {path: np.array(column)[order] for path, column in zip(paths, decoder.columns, strict=True)}
    return _Messages(topic.name, np.array(received)[order], values, tuple(decoder.joints))


def _column(
    key: Key, target: Target, read: Mapping[str, _Messages], base: str, clocks: Mapping[str, FieldPath | None]
) -> Array:
    """One column: a time in s from the first, or values, interpolated where they are of another topic than the time."""
    messages, path = read[target.topic], target.path
    found: NDArray[Any] = messages.received if path is None else messages.values[path]
    if ((found == NO_STAMP) if target.is_time else np.isnan(found)).all():
        joint = next((step.name for step in (path.steps if path else ()) if isinstance(step, NamedJoint)), None)
        if joint is not None and joint not in messages.joints and not joint.isdecimal():
            raise InputError(
                f"column {key}: no joint {short(joint)} in {target.topic}; there are: {short_list(messages.joints)}"
            )
        raise InputError(
            f"column {key} is empty in all {found.size} messages of {target.topic}; leave it out, or name what was logged"
        )
    if target.is_time:
        stamps = messages.stamps(target.path)
        known = stamps != NO_STAMP
        first = stamps[known][0]
        return np.where(known, (stamps - first) / 1e9, np.nan)
    if target.topic == base:
        return found
    stamps, at, topic = messages.stamps(clocks[target.topic]), read[base].stamps(clocks[base]), target.topic
    known = stamps != NO_STAMP
    order = np.argsort(stamps[known], kind="stable")
    stamps, values = stamps[known][order], found[known][order]
    lasts = np.append(np.diff(stamps) > 0, True)  # of those with one stamp the last
    stamps, values = stamps[lasts], values[lasts]
    if stamps.size < 2 or at.max() < stamps[0] or at[at != NO_STAMP].min() > stamps[-1]:
        raise InputError(
            f"the messages of {topic} are at other times than those of the time's topic; name topics that were logged together"
        )
    since = np.where(at == NO_STAMP, np.nan, (at - stamps[0]).astype(float))
    return between_samples(
        since, (stamps - stamps[0]).astype(float), values, _GAP
    )  # nan where there is nothing on both sides


def _notes(
    targets: Mapping[Key, Target],
    columns: Mapping[Key, Array],
    base: Target,
    clocks: Mapping[str, FieldPath | None],
) -> list[Finding]:
    """What is said of how times were told, and of topics that were interpolated."""
    received = [*((t.topic, t.path) for t in targets.values()), *clocks.items()]
    times, notes = sorted({name for name, path in received if path is None}), list[Finding]()
    if times:
        message = f"Times of {', '.join(times)} are those at which messages were received, not those of a header."
        notes.append(Finding("time-received", NOTE, message))
    others = sorted(clocks.keys() - {base.topic})
    if others:
        without = np.any([np.isnan(columns[key]) for key, t in targets.items() if t.topic in others], axis=0)
        rows = int(without.sum())
        message = (
            f"{', '.join(others)} interpolated linearly at the stamps of {base.topic}; {rows} row{'' if rows == 1 else 's'} outside them, or in "
            f"gaps longer than {_GAP} intervals, left empty."
        )
        notes.append(Finding("topics-interpolated", NOTE, message, {"rows": rows}))
    return notes


def bag_joints(path: Path, topic: str) -> tuple[str, ...]:
    """Names of the joints in a topic of joint states, in the order in which they are first seen; needs the extra `ros`."""
    return _joints(topics_of(open_bag(path))[topic])


def state_topic(topics: Mapping[str, Topic]) -> str:
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
    messages = _read(topic, [FieldPath(("position", NamedJoint("")))])
    return tuple(check_name(name, "the joint") for name in messages.joints)


def bag_columns(path: Path) -> tuple[str, ...]:
    """Names of the columns that a bag offers. Raises InputError; needs the extra `ros`."""
    names = list[str]()
    for topic in topics_of(open_bag(path)).values():
        try:
            names += columns_of(topic, _joints(topic) if topic.kind == JOINT_STATE else ())
        except InputError:  # of a topic that is not read, and may not be wanted
            continue
    return tuple(names)
