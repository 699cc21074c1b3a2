"""Small ROS bags for tests, written by rosbags: ROS 2 as sqlite3 and MCAP, and ROS 1."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

STATE, WRENCH = "sensor_msgs/msg/JointState", "geometry_msgs/msg/WrenchStamped"
START = 1_700_000_000 * 10**9  # ns
FORMATS = ("sqlite3", "mcap", "bag")


class Message(NamedTuple):
    """One message: topic, type, receive time, ns, and what it holds."""

    topic: str
    kind: str
    received: int
    values: Mapping[str, Any]


def state(
    stamp: int,
    names: Sequence[str],
    position: Sequence[float] = (),
    velocity: Sequence[float] = (),
    effort: Sequence[float] = (),
    *,
    frame: str = "base",
    topic: str = "/joint_states",
    late: int = 1_000_000,
) -> Message:
    """Joint states with a stamp, ns, received a little later."""
    arrays = {"position": position, "velocity": velocity, "effort": effort}
    values = {name: np.array(array, float) for name, array in arrays.items()}
    return Message(topic, STATE, stamp + late, {"header": (stamp, frame), "name": list(names), **values})


def wrench(stamp: int, torque: float, topic: str = "/wrench") -> Message:
    return Message(topic, WRENCH, stamp + 500, {"header": (stamp, "tool"), "wrench": torque})


def number(received: int, value: float, topic: str = "/load") -> Message:
    """A number without a header."""
    return Message(topic, "std_msgs/msg/Float64", received, {"data": value})


def store_of(form: str) -> Any:
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS1_NOETIC if form == "bag" else Stores.ROS2_HUMBLE)


def write_bag(folder: Path, form: str, messages: Sequence[Message], **options: Any) -> Path:
    """A bag of these messages: a folder, or a .bag file."""
    store = store_of(form)
    writer, serialize = _writer(folder, form, store, **options)
    with writer:
        topics: dict[str, Any] = {}
        for topic, kind, received, values in messages:
            if topic not in topics:
                topics[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(topics[topic], received, serialize(_built(store, kind, values), kind))
    return folder / ("log.bag" if form == "bag" else form)


def _writer(
    folder: Path, form: str, store: Any, compression: str | None = None, version: Literal[8, 9] = 9
) -> tuple[Any, Callable[[Any, str], bytes]]:
    if form == "bag":
        from rosbags.rosbag1 import Writer as Writer1

        old = Writer1(folder / "log.bag")
        if compression:
            old.set_compression(Writer1.CompressionFormat[compression.upper()])
        return old, lambda message, kind: bytes(store.serialize_ros1(message, kind))
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2

    new = Writer2(folder / form, version=version, storage_plugin=StoragePlugin[form.upper()])
    if compression:
        new.set_compression(CompressionMode[compression.upper()], CompressionFormat.ZSTD)
    return new, lambda message, kind: bytes(store.serialize_cdr(message, kind))


def _built(store: Any, kind: str, values: Mapping[str, Any]) -> Any:
    types = store.types
    parts = dict(values)
    if "header" in parts:
        stamp, frame = parts["header"]
        time = types["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9)
        seq = {"seq": 0} if "seq" in types["std_msgs/msg/Header"].__annotations__ else {}
        parts["header"] = types["std_msgs/msg/Header"](stamp=time, frame_id=frame, **seq)
    if kind == WRENCH:
        Vector, Wrench = (types[f"geometry_msgs/msg/{name}"] for name in ("Vector3", "Wrench"))
        parts["wrench"] = Wrench(force=Vector(1.0, 2.0, 3.0), torque=Vector(4.0, 5.0, parts["wrench"]))
    return types[kind](**parts)


def plain_loop(bag: Path, topic: str, read: Callable[[Any], list[float]]) -> np.ndarray:
    """What a function reads off each message that rosbags deserialises, in the order of rosbags; shape (messages, numbers)."""
    from rosbags.highlevel import AnyReader

    with AnyReader([bag]) as reader:
        wanted = [c for c in reader.connections if c.topic == topic]
        return np.array([read(reader.deserialize(raw, c.msgtype)) for c, _, raw in reader.messages(connections=wanted)])


def held(message: Any, field: str, joint: str) -> float:
    """The number of a joint in joint states, nan where there is none."""
    array = getattr(message, field)
    k = message.name.index(joint) if joint in message.name else len(array)
    return float(array[k]) if k < len(array) else float("nan")
