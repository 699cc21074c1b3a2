"""Files of ROS bags, and messages of their topics as numbers, read by rosbags.

rosbags makes code of a message definition. So what it parsed is checked first: plain names and few fields; constants
and defaults are left out, and definitions in IDL are not parsed. It unpacks a chunk whole, whatever size it claims: a
bag from an untrusted source can fill the memory.
"""

import hashlib
import re
from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import lru_cache
from itertools import islice
from operator import index
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bristle.data.columns import bounded, reading
from bristle.data.experiment.yaml_file import parse, read_text
from bristle.errors import InputError, check_regular, short

DAMAGED = "record the bag again, or repair it with the tools of ROS (ros2 bag reindex, mcap recover, rosbag reindex)"
WHAT = "ROS bag that ended in order"
METADATA = "metadata.yaml"
MAX_BYTES = 2**34  # largest bag, bytes: it may hold much that is not read
_MOST, _RATIO, _BYTES = 2**33, 200, 2**23  # bytes of messages that are read: _MOST, or _BYTES + _RATIO times the bag's
_SUFFIXES = (".mcap", ".db3", ".bag")
NO_STAMP = np.iinfo(np.int64).min  # in place of a stamp that a message does not have
STAMPS = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
BASE, MESSAGE, ARRAY, SEQUENCE = range(1, 5)  # kinds of fields, as in rosbags
NAMES = ("name", "joint_names")  # fields with the names of joints, in the order of the message's other arrays
_LONGEST, _MOST_FIELDS = 500_000, 2000  # characters of a definition; fields, with texts and messages of fixed arrays
_NO_FIELD = "structure_needs_at_least_one_member"  # of an empty message, which takes a byte in CDR and none in ROS 1
_MOST_ELEMENTS, _MOST_JOINTS = 10**7, 1000  # of an array of any length; joints that are listed
_TYPE = re.compile(r"[A-Za-z]\w{0,99}(/[A-Za-z]\w{0,99}){1,3}", re.ASCII)


class Bag(NamedTuple):
    """One file, or a folder with metadata.yaml."""

    path: Path
    files: tuple[Path, ...]  # storage files
    distribution: str | None = None  # of ROS 2, where metadata.yaml names it


def is_bag(path: Path) -> bool:
    """Whether a path is a bag: .mcap, .db3, .bag, or a folder with metadata.yaml."""
    return path.suffix.lower() in _SUFFIXES if not path.is_dir() else (path / METADATA).exists()


def open_bag(path: Path) -> Bag:
    """The files of a bag, together at most `MAX_BYTES`. Raises InputError and OSError."""
    bag = _of_folder(path) if path.is_dir() else Bag(path, (path,))
    try:
        import rosbags.typesys  # noqa: F401
    except ImportError as error:
        raise InputError("is a ROS bag, which needs rosbags; install it with pip install 'bristle[ros]'") from error
    for file in bag.files:
        check_regular(file, file.name)
        log = file.with_name(f"{file.name}-wal")
        if log.exists() and log.stat().st_size:
            why = f"has messages in {log.name} that are not in it yet"
            raise InputError(f"{why}; close what writes it, or open it once with sqlite3")
    size = sum(file.stat().st_size for file in bag.files)
    if size > MAX_BYTES:
        raise InputError(f"is {size} bytes long, over the limit of {MAX_BYTES}; cut the bag into several runs")
    if size == 0:
        raise InputError("the file is empty; expected a bag with messages")
    return bag


def _of_folder(folder: Path) -> Bag:
    """The bag of a folder. Raises InputError where metadata.yaml names no file in it, or a link out of it."""
    about = parse(read_text(folder / METADATA), METADATA).get("rosbag2_bagfile_information")
    names = about.get("relative_file_paths") if isinstance(about, dict) else None
    if not isinstance(about, dict) or not isinstance(names, list) or not names:
        raise InputError(f"{METADATA}: got relative_file_paths {short(names)}; expected the files of a ROS 2 bag")
    files = tuple(dict.fromkeys(folder / Path(str(name)).name for name in names))  # rosbags takes the last part as well
    for file in files:
        if not file.exists() or file.resolve().parent != folder.resolve():
            why = "is a link out of" if file.exists() else "is not in"
            raise InputError(f"{METADATA}: file {short(file.name)} {why} the folder of the bag; copy it there")
    return Bag(folder, files, str(about.get("ros_distro")))


def digest_of(bag: Bag) -> str:
    """SHA-256 of a bag's storage files, one after another, in the order of metadata.yaml."""
    digest = hashlib.sha256()
    for path in bag.files:
        with path.open("rb") as file:
            hashlib.file_digest(file, lambda: digest)
    return digest.hexdigest()


@contextmanager
def opened(bag: Bag) -> Iterator[Any]:
    """The rosbags reader of a bag. Raises InputError where it cannot be read."""
    from rosbags import rosbag1, rosbag2

    suffix, readers = bag.path.suffix.lower(), rosbag2.Reader.STORAGE_PLUGINS
    with reading(WHAT, DAMAGED):
        reader = (rosbag1.Reader if suffix == ".bag" else readers["dir" if bag.path.is_dir() else suffix])(bag.path)
        reader.open()
    try:
        yield reader
    finally:
        reader.close()


def messages_of(bag: Bag, numbers: frozenset[int], decoded: Callable[[bytes], Any]) -> Iterator[tuple[int, Any]]:
    """Receive time, ns, and decoded message, of each message of some connections.

    Raises InputError where it cannot be read, or the messages are far longer than the bag's files.
    """
    left = min(_MOST, _BYTES + _RATIO * sum(file.stat().st_size for file in bag.files))
    with opened(bag) as reader:
        messages = reader.messages([c for c in reader.connections if c.id in numbers])
        while True:
            with reading(WHAT, DAMAGED):  # a few at a time; a time that is no number is damage as well
                some = [(index(time), decoded(raw), len(raw)) for _, time, raw in islice(messages, 64)]
            left -= sum(size for *_, size in some)
            if left < 0:
                raise InputError(f"holds messages of far more bytes than the size of the file explains; {DAMAGED}")
            if not some:
                return
            yield from ((time, message) for time, message, _ in some)


class Topic(NamedTuple):
    """A topic of one bag."""

    name: str
    kind: str  # type of its messages, as `sensor_msgs/msg/JointState`; empty where there are several
    encoding: str  # `cdr` or `ros1`, else it cannot be read
    definition: str  # text of the message definition; empty where the file has none
    is_idl: bool  # whether the definition is in IDL, which is not parsed
    numbers: frozenset[int]  # of its connections
    bag: Bag


class NamedJoint(NamedTuple):
    """In a path: the array element of a joint, by its place among the names of the message."""

    name: str


class FieldPath(NamedTuple):
    """The way to one number, or to one stamp, in a message."""

    steps: tuple[str | int | NamedJoint, ...]
    is_stamp: bool = False


class Messages(NamedTuple):
    """All messages of a topic, in the order in which they were received."""

    received: NDArray[np.int64]  # ns
    values: Mapping[FieldPath, NDArray[Any]]  # numbers, nan where missing; stamps in ns, `NO_STAMP` where missing
    joints: tuple[str, ...]  # names, in the order in which they are first seen


Types = Mapping[str, Mapping[str, Any]]  # the fields of each type by name, each as (form, inner) of rosbags


@lru_cache(maxsize=64)
def types_of(topic: Topic) -> Types:
    """The types in a topic's messages: as the bag defines them, else as its distribution of ROS 2, or the latest, does.

    Raises InputError where the definition cannot be parsed, a type is not known, or it could do harm.
    """
    if topic.encoding not in ("cdr", "ros1"):
        got = f"topic {topic.name} has messages in {short(topic.encoding)}"
        raise InputError(f"{got}; expected cdr or ros1, as ROS writes them")
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    def refused(why: str) -> InputError:
        return InputError(f"topic {topic.name}: its message definition {why}; {DAMAGED}")

    given: Mapping[str, Any] = {}
    if topic.definition and not topic.is_idl:
        if len(topic.definition) > _LONGEST:
            raise refused(f"has over {_LONGEST} characters")
        with reading(f"message definition of topic {topic.name}", DAMAGED):
            given = get_types_from_msg(topic.definition, topic.kind)
    known = get_typestore({x.value: x for x in Stores}.get(f"ros2_{topic.bag.distribution}", Stores.LATEST)).fielddefs
    types, size, ahead = dict[str, dict[str, Any]](), 0, [topic.kind]
    while ahead:
        kind = ahead.pop()
        found = known.get(kind) if kind in STAMPS else given.get(kind) or known.get(kind)
        if found is None:
            why = "is defined in IDL, which is not read" if topic.is_idl else "is not defined in the bag"
            own = "nor one of ROS 2's own; record with definitions (MCAP)"
            raise InputError(f"topic {topic.name}: its type {short(kind)} {why}, {own}")
        types[kind] = fields = dict(found[1])
        empty = topic.encoding == "ros1" and kind != topic.kind and fields.keys() <= {_NO_FIELD}
        if not _TYPE.fullmatch(kind) or len(fields) < len(found[1]) or empty:
            raise refused(f"has an odd name, one name twice, or no field, in {short(kind)}")
        for form, inner in fields.values():
            element, count = inner if form in (ARRAY, SEQUENCE) else ((form, inner), 1)
            size += count if form == ARRAY and not is_number(element) else 1
            ahead += [element[1]] if element[0] == MESSAGE and element[1] not in types else []
        if size > _MOST_FIELDS:
            raise refused(f"has over {_MOST_FIELDS} fields")
    return types


def is_number(part: Any) -> bool:
    """Whether a field is one number."""
    return bool(part[0] == BASE and part[1][0] != "string")


def is_stamp(part: Any) -> bool:
    """Whether a field is a time: seconds and nanoseconds."""
    return part[0] == MESSAGE and part[1] in STAMPS


def numbers_of(topic: Topic, paths: Sequence[FieldPath]) -> Messages:
    """The numbers of a topic at some paths. Raises InputError where it has no message, or one is not as defined."""
    from rosbags.typesys.store import Typestore

    types, received = types_of(topic), array("q")
    store = Typestore(max_sequence_length=_MOST_ELEMENTS)
    with reading(f"message definition of topic {topic.name}", DAMAGED):
        store.register({kind: ([], list(fields.items())) for kind, fields in types.items()})
        store.get_msgdef(topic.kind)
    decode = store.deserialize_cdr if topic.encoding == "cdr" else store.deserialize_ros1
    columns: dict[FieldPath, array[Any]] = {path: array("q" if path.is_stamp else "d") for path in paths}
    own = types[topic.kind]
    lists = (name for name in NAMES if name in own and own[name][0] == SEQUENCE)
    names = next((name for name in lists if own[name][1][0][1][0] == "string"), None)
    seen, joints = list[str](), dict[str, None]()
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
                    found = getattr(found, step)
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
    """The element of a joint, by its name, or by its number where no name is one; -1 where there is none."""
    if joint in names:
        return names.index(joint)
    return int(joint) if joint.isdecimal() and len(joint) < 10 and not any(map(str.isdecimal, names)) else -1
