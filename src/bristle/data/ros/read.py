"""Columns of a ROS bag, by names such as `/joint_states.position[elbow]`."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.data.columns import Key, brought_to
from bristle.data.ros.bag import digest_of, topics_of
from bristle.data.ros.definitions import fields_of
from bristle.data.ros.names import JOINT_STATE, NO_STAMP, RECEIVED, STAMP, FieldPath, listed, numbers_of, path_of
from bristle.errors import InputError, short_list
from bristle.estimation import levels
from bristle.findings import NOTE, Finding

_LISTED = 60  # columns of a topic that are listed


def read_bag(path: Path, keys: Sequence[Key]) -> tuple[dict[Key, Array], str, tuple[Finding, ...]]:
    """Columns of a bag, (messages of the topic of the time,), with its SHA-256 and notes.

    Times are in s from the first one. Columns of other topics than that of the time are interpolated linearly at its
    stamps: nan before their first message, after their last, and across gaps longer than five median intervals. Raises
    InputError; needs the extra `ros`.
    """
    topics = topics_of(path)
    paths = {key: path_of(key, topics) for key in keys}
    names = list(dict.fromkeys(p.topic for p in paths.values()))
    times = list(dict.fromkeys(p for p in paths.values() if p.is_time))
    if len(names) > 1 and len(times) != 1:
        got = f"the times of {short_list(t.topic for t in times)}" if times else "no time"
        expected = f"one time for all, as time: {{column: {names[0]}.header.stamp, unit: s}}"
        raise InputError(f"signals come from the topics {short_list(names)}, with {got}; expected {expected}")

    # the clock of each of several topics: the stamps in its header, if the time is a stamp, else the receive times
    base = next(iter([*times, *paths.values()]), FieldPath(""))
    clocks = dict[str, FieldPath]()
    for name in names if len(names) > 1 else ():
        stamped = bool(base.steps) and STAMP in fields_of(topics[name])
        clocks[name] = base if name == base.topic else FieldPath(name, tuple(STAMP.split(".")) * stamped, True)
    asked = [*paths.values(), *clocks.values()]
    read = {name: numbers_of(topics[name], [p for p in asked if p.topic == name]) for name in names}

    columns = dict[Key, Array]()
    for key, p in paths.items():
        values, joints = read[p.topic]
        if ((values[p] == NO_STAMP) if p.is_time else np.isnan(values[p])).all():
            there = f" (joints: {short_list(joints)})" if joints else ""
            remedy = f"leave it out, or name a field that was logged{there}"
            raise InputError(f"column {key} is empty in all {values[p].size} messages of {p.topic}; {remedy}")
        if p.is_time:
            stamps = _stamps(values, p)
            columns[key] = _seconds(stamps, int(stamps[stamps != NO_STAMP][0]))
            continue
        columns[key] = values[p]
        if p.topic != base.topic:
            at, own = _stamps(read[base.topic][0], base), _stamps(values, clocks[p.topic])
            origin, order = int(at.max()), np.argsort(own, kind="stable")
            try:
                columns[key] = brought_to(
                    _seconds(at, origin), _seconds(own[order], origin), values[p][order], levels.GAP
                )
            except InputError as error:
                raise InputError(f"{p.topic}: {error}") from error

    notes = list[Finding]()
    if received := sorted({p.topic for p in asked if not p.steps}):
        message = f"Times of {', '.join(received)} are those at which messages were received, not those of a header."
        notes.append(Finding("time-received", NOTE, message))
    if others := sorted(clocks.keys() - {base.topic}):
        rows = int(np.any([np.isnan(columns[key]) for key, p in paths.items() if p.topic in others], axis=0).sum())
        message = f"{', '.join(others)} interpolated at the stamps of {base.topic}; {rows} rows outside or in gaps left empty."
        notes.append(Finding("topics-interpolated", NOTE, message, {"rows": rows}))
    return columns, digest_of(path), tuple(notes)


def _seconds(stamps: NDArray[np.int64], origin: int) -> Array:
    """Stamps, ns, as s since one of them; nan where there is none."""
    return np.where(stamps == NO_STAMP, np.nan, (stamps - origin) / 1e9)


def _stamps(values: Mapping[FieldPath, NDArray[Any]], time: FieldPath) -> NDArray[np.int64]:
    """Times in ns. Raises InputError where all are zero, and so were never set."""
    if not values[time].any():
        remedy = f"name the time as {time.topic}.{RECEIVED}, when its messages were received"
        raise InputError(f"the stamps of {time.topic} are all zero; {remedy}")
    return values[time]


def joint_states(path: Path) -> tuple[str, tuple[str, ...]]:
    """The topic of a bag's joint states, and their joints in the order in which they are first seen.

    Raises InputError where there is no such topic, or there are several; needs the extra `ros`.
    """
    topics = topics_of(path)
    states = [topic for topic in topics.values() if topic.kind == JOINT_STATE]
    if len(states) != 1:
        raise InputError(
            f"has {'several topics' if states else 'no topic'} of joint states; name each column with its topic, as in "
            f"--column position=/joint_states.position[elbow] (there are: {listed(topics)})"
        )
    return states[0].name, numbers_of(states[0], [])[1]


def bag_columns(path: Path) -> tuple[str, ...]:
    """The columns that a bag offers: stamps, plain numbers, and the joints of joint states; needs the extra `ros`."""
    names = list[str]()
    for topic in topics_of(path).values():
        with suppress(InputError):  # of a topic that cannot be read, and may not be wanted
            names += [f"{topic.name}.{name}" for name in fields_of(topic) if "[]" not in name][:_LISTED]
            joints = numbers_of(topic, [])[1] if topic.kind == JOINT_STATE else ()
            names += [f"{topic.name}.{x}[{joint}]" for joint in joints for x in ("position", "velocity", "effort")]
    return tuple(names)
