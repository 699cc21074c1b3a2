"""Which columns of a ROS bag are which signals: those of its only joint, or of the topics that were told."""

from collections.abc import Mapping
from pathlib import Path

from bristle.data.columns import Key
from bristle.data.experiment.column_names import ColumnGuess
from bristle.data.ros.files import open_bag
from bristle.data.ros.read import bag_joints, read_bag, state_topic
from bristle.data.ros.topics import RECEIVED, Topic, target_of, topics_of
from bristle.errors import InputError, short_list

_STATE = {"position": "position", "velocity": "velocity", "torque": "effort"}
"""Fields of joint states, by signal."""
_DRIVES = ("torque", "current", "voltage")


def bag_guesses(path: Path, told: Mapping[str, str]) -> dict[str, ColumnGuess]:
    """The columns of a bag by signal, where `told` names some: the stamps of their topic, and those told are the rest.

    Nothing told: the joint states of the only joint. Raises InputError where there are several, with their names.
    """
    topics = topics_of(open_bag(path))
    enough = any(name in told for name in _DRIVES) and ("position" in told or "velocity" in told)
    if enough:
        first = next(told[name] for name in ("position", "velocity") if name in told)
        return _time(path, topics[target_of(Key(first), topics).topic])
    topic = topics[state_topic(topics)]
    joints = bag_joints(path, topic.name)
    if len(joints) != 1:
        raise InputError(
            f"has joint states of {len(joints)} joints: {short_list(joints)}; name the columns of one, as in "
            f"--column position={topic.name}.position[{next(iter(joints), 'JOINT')}] --column torque={topic.name}.effort[...]"
        )
    fields = {signal: f"{topic.name}.{field}[{joints[0]}]" for signal, field in _STATE.items()}
    there = {signal: ColumnGuess(name, None) for signal, name in fields.items() if _is_there(path, name)}
    return _time(path, topic) | there


def _time(path: Path, topic: Topic) -> dict[str, ColumnGuess]:
    """The stamps of a topic, or when its messages were received, where they have none."""
    names = (f"{topic.name}.header.stamp", f"{topic.name}.{RECEIVED}")
    return {"time": ColumnGuess(next((name for name in names if _is_there(path, name)), names[1]), "s")}


def _is_there(path: Path, name: str) -> bool:
    """Whether a column of a bag, which was read before, holds anything."""
    try:
        read_bag(path, [Key(name)])
    except InputError:
        return False
    return True
