# ruff: noqa: S608  # statements that are ours
import os
import re
import sqlite3
import struct
import sys
import time
from collections.abc import Iterator, Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bristle.data.columns import Key
from bristle.data.ros import bag as ros
from bristle.data.ros.bag import Topic
from bristle.data.ros.definitions import types_of
from bristle.data.text_table import read_table
from bristle.errors import InputError

from ..bags import FORMATS, START, state, wrench, write_bag
from .experiments import assert_refused, refusal

pytest.importorskip("rosbags", reason="the extra `ros` is not installed")

_QUICK = settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
_KEYS = [Key("header.stamp"), Key("position[b]")]
_SUFFIXES = (".db3", ".mcap", ".bag")
_MAGIC = b"\x89MCAP0\r\n\x01"
_SECONDS = 10


def _refusal(path: Path, keys: list[Key] = _KEYS) -> str | None:
    """The sentence with which a file is refused, soon; None where it is read."""
    begun = time.monotonic()
    says = refusal(path, keys)
    assert time.monotonic() - begun < _SECONDS
    return says


def _assert_refused(asked: Sequence[tuple[Path, str]], keys: Sequence[Key] = _KEYS) -> None:
    """Of each bag the columns are refused soon, in a sentence that opens with its path and says so."""
    asks = ((partial(read_table, path, keys), f"^{re.escape(str(path))}.*{re.escape(says)}") for path, says in asked)
    assert_refused(asks, seconds=_SECONDS)


@pytest.fixture(scope="module", params=FORMATS)
def good(request: Any, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, bytes]:
    folder = tmp_path_factory.mktemp("good")
    messages = [
        m
        for k in range(12)
        for m in (state(START + 10**7 * k, ("a", "b"), (k, -k), (0, 0), (1, k)), wrench(START + 10**7 * k, k))
    ]
    bag = write_bag(folder, request.param, messages)
    file = bag if bag.is_file() else next(path for path in bag.iterdir() if path.name != "metadata.yaml")
    return file.suffix, file.read_bytes()


@_QUICK
@given(data=st.data())
def test_bytes_overwritten(tmp_path: Path, good: tuple[str, bytes], data: st.DataObject) -> None:
    """Whatever bytes of a bag are overwritten, there are columns of one length or one sentence, never another exception."""
    suffix, content = good
    broken = bytearray(content)
    for at, byte in data.draw(
        st.lists(st.tuples(st.integers(0, len(content) - 1), st.integers(0, 255)), min_size=1, max_size=12)
    ):
        broken[at] = byte
    path = tmp_path / f"broken{suffix}"
    path.write_bytes(broken)
    _refusal(path, [*_KEYS, Key("/wrench.wrench.torque.z")])
    # a bag that ends early is refused: half a log passes for no whole one
    path = tmp_path / f"cut{suffix}"
    path.write_bytes(content[: data.draw(st.integers(0, len(content) - (4096 if suffix == ".db3" else 1)))])
    assert _refusal(path) is not None


@_QUICK
@given(st.one_of(st.binary(max_size=400), st.binary(max_size=200).map(lambda x: _MAGIC + x + _MAGIC[:-1])))
def test_no_bag_at_all(tmp_path: Path, content: bytes) -> None:
    """Bytes of anything else, whatever the suffix says, are refused."""
    for suffix in _SUFFIXES:
        path = tmp_path / f"none{suffix}"
        path.write_bytes(content)
        assert _refusal(path) is not None


def _database(path: Path, *statements: str) -> Path:
    connection = sqlite3.connect(path)
    for statement in statements:
        connection.execute(statement)
    connection.commit()
    connection.close()
    return path


_TOPICS = "CREATE TABLE topics(id INTEGER, name TEXT, type TEXT, serialization_format TEXT)"
_TOPIC = "INSERT INTO topics VALUES(1, '/joint_states', 'sensor_msgs/msg/JointState', 'cdr')"
_MESSAGES = "CREATE TABLE messages(id INTEGER, topic_id INTEGER, timestamp INTEGER, data BLOB)"
_ENDLESS = "WITH RECURSIVE n(k) AS (SELECT 1 UNION ALL SELECT k + 1 FROM n)"
_WITH = [_TOPICS, _TOPIC, _MESSAGES]
_DATABASES = [
    (["CREATE TABLE logs(t REAL)"], "missing tables"),
    ([_TOPICS, "CREATE TABLE messages(topic_id INTEGER, data BLOB)"], "no such column"),
    ([_TOPICS, _TOPIC, f"CREATE VIEW messages AS {_ENDLESS} SELECT 1 AS topic_id, k AS timestamp, x'00' AS data FROM n"], "missing tables"),
    (_WITH, "holds no message of topic /joint_states"),
    ([_TOPICS, _MESSAGES], "of no topic of the bag, or names none"),
    ([*_WITH, "INSERT INTO messages VALUES(1, 1, 'noon', x'0001')"], "is damaged, or no ROS bag"),
    ([*_WITH, "INSERT INTO messages VALUES(1, 1, 5, x'0001000000000000')"], "Could not deserialize"),
    ([_TOPICS, _TOPIC.replace("cdr", "cbor"), _MESSAGES], "has messages in 'cbor'; expected cdr or ros1"),
    ([_TOPICS, _TOPIC.replace("JointState", "Unheard"), _MESSAGES], "of no topic of the bag, or names none"),
]  # fmt: skip  # a table


def test_bags_that_are_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Other tables, views that compute without end, values of other types: refused, and none is run."""
    _assert_refused([(_database(tmp_path / f"{k}.db3", *made), says) for k, (made, says) in enumerate(_DATABASES)])
    path = _database(tmp_path / "x.db3", _TOPICS, _TOPIC, _MESSAGES)
    (tmp_path / "x.db3-wal").write_bytes(b"x")  # read-only, its last messages would go missing unsaid
    assert "has messages in x.db3-wal that are not in it yet" in str(_refusal(path))
    # metadata.yaml that names files elsewhere or a pipe, blows up, or is none: refused; so is a folder without one
    (tmp_path / "folder.mcap").mkdir()
    none = "is a folder without metadata.yaml; expected a file"
    asked = [(tmp_path, none), (tmp_path / "folder.mcap", none)]
    for k, text in enumerate(_METADATA):
        bag = tmp_path / f"bag{k}"
        bag.mkdir()
        (bag / "metadata.yaml").write_text(text)
        if "pipe" in text:
            os.mkfifo(bag / "pipe.db3")
        asked.append((bag, "pipe.db3: is a pipe" if "pipe" in text else ""))
    _assert_refused(asked)
    # a text, names or positions of 2^31 elements in a message of 20 bytes, and other encodings, are refused at once
    _assert_refused(
        [
            (_mcap(tmp_path / f"{k}.mcap", _CHANNEL, _message(content)), says)
            for k, (content, says) in enumerate(_CLAIMS)
        ],
        [Key("position[0]")],
    )
    # definitions that do not parse, name each other in circles, or claim fields without end are refused, soon; none is run as code
    _assert_refused(
        [
            (_mcap(tmp_path / f"{k}.mcap", *_defined(text, encoding)), says)
            for k, (text, encoding, says) in enumerate(_GARBAGE)
        ],
        [Key("/a.x")],
    )
    # in a message of another type, of either order of bytes, a joint's number is found where the names come after the numbers
    schema, channel, _ = _defined("float64[] position\nstring[] name\nint16 x")
    for order, head in (("<", b"\0\1\0\0"), (">", bytes(4))):
        content = struct.pack(f"{order}I4x2d2I4sI2sh", 2, 1.5, 2.5, 2, 2, b"a", 2, b"b", 7)
        bag = _mcap(tmp_path / "x.mcap", schema, channel, _message(head + content))
        table = read_table(bag, [Key("/a.position[b]"), Key("/a.x")])
        assert [column.tolist() for column in table.columns.values()] == [[2.5], [7.0]]
    # the name of a type that is no plain one is refused; constants and defaults, whatever they hold, are left out
    for kind in ('a_msgs/msg/A"""\nimport os', "a_msgs/msg/A\n", "a_msgs/msg/" + "A" * 200):
        path = _mcap(tmp_path / "x.mcap", *_defined("float64 x", kind=kind))
        assert re.search("has an odd name|holds U\\+", str(_refusal(path, [Key("/a.x")])))
    text = f"string EVIL='+__import__(0).abort()+'\nfloat64 x {'9' * 300}\nfloat64 from\nint8 len"
    schema, channel, _ = _defined(text)
    bag = _mcap(tmp_path / "x.mcap", schema, channel, _message(b"\0\1\0\0" + struct.pack("<ddb", 1.5, 2.5, 3)))
    columns = read_table(bag, [Key("/a.x"), Key("/a.from"), Key("/a.len")]).columns
    assert [column.tolist() for column in columns.values()] == [[1.5], [2.5], [3.0]]
    # chunks that are not what they claim, and records that end nowhere: each refused, soon, in one sentence
    read = [name for name, records in _broken() if _refusal(_mcap(tmp_path / "x.mcap", *records)) is None]
    assert not read
    # many messages are read no further than the file's size explains; a bag over the limit is refused unread
    monkeypatch.setattr(ros, "_BYTES", 2**16)
    message = _message(b"\0\1\0\0" + bytes(8) + _text("x" * (2**16 - 1) + "\0") + bytes(16))
    chunk = _chunk(_packed(message, "zstd"), "zstd", len(message))
    path = _mcap(tmp_path / "x.mcap", _CHANNEL, *[chunk] * 500)
    assert "far more bytes than the size of the file explains" in str(_refusal(path))
    monkeypatch.setattr(ros, "MAX_BYTES", 1000)
    assert "over the limit of 1000" in str(_refusal(path))


def _text(text: str) -> bytes:
    return struct.pack("<I", len(text)) + text.encode()


def _record(kind: int, content: bytes, claims: int | None = None) -> bytes:
    return struct.pack("<BQ", kind, len(content) if claims is None else claims) + content


def _chunk(packed: bytes, compression: str, claims: int) -> bytes:
    return _record(
        6, struct.pack("<QQQI", 0, 0, claims, 0) + _text(compression) + struct.pack("<Q", len(packed)) + packed
    )


_CHANNEL = _record(
    3, struct.pack("<H", 1) + _text("sensor_msgs/msg/JointState") + _text("ros2msg") + _text("")
) + _record(4, struct.pack("<HH", 1, 1) + _text("/joint_states") + _text("cdr") + struct.pack("<I", 0))


def _mcap(path: Path, *records: bytes) -> Path:
    magic = _MAGIC[:-1]
    path.write_bytes(magic + _record(1, _text("ros2") + _text("")) + b"".join(records) + _record(2, bytes(20)) + magic)
    return path


def _packed(data: bytes, compression: str) -> bytes:
    if compression == "lz4":
        lz4 = pytest.importorskip("lz4.frame")
        return bytes(lz4.compress(data))
    zstd = import_module("compression.zstd" if sys.version_info >= (3, 14) else "backports.zstd")
    return bytes(zstd.compress(data))


def _broken() -> Iterator[tuple[str, list[bytes]]]:
    for compression in ("zstd", "lz4"):
        packed = _packed(bytes(2**25), compression)
        yield f"{compression}, more than it claims", [_chunk(packed, compression, 1000)]
        yield f"{compression}, claims 2^62", [_chunk(packed, compression, 2**62)]
    yield "unknown compression", [_chunk(b"", "rar", 0)]
    yield "a record of 2^63", [_record(5, b"", 2**63)]
    yield "a message without a head", [_CHANNEL, _record(5, bytes(4))]
    yield "a name that is no text", [_record(4, struct.pack("<HHI", 1, 1, 1) + b"\xff" + _text("") + bytes(4))]
    yield "no channel", []
    yield "messages of no channel", [_record(5, bytes(30))] * 9


def _message(content: bytes) -> bytes:
    return _record(5, struct.pack("<HIQQ", 1, 0, 7, 7) + content)


_HEAD = b"\0\1\0\0" + bytes(8) + _text("\0") + bytes(3)
_CLAIMS = [
    (b"\0\1\0\0" + bytes(8) + struct.pack("<I", 2**31), "Invalid string length"),
    (_HEAD + struct.pack("<I", 2**31), "Invalid sequence length"),
    (_HEAD + bytes(4) + struct.pack("<I", 2**31), "Invalid sequence length"),
    (_HEAD + struct.pack("<I", 10**5) + bytes(5 * 10**5), "Invalid string length 0"),
]  # fmt: skip  # a table


def _defined(text: str, encoding: str = "ros2msg", kind: str = "a_msgs/msg/A") -> list[bytes]:
    schema = _record(3, struct.pack("<H", 1) + _text(kind) + _text(encoding) + _text(text))
    channel = _record(4, struct.pack("<HH", 1, 1) + _text("/a") + _text("cdr") + struct.pack("<I", 0))
    return [schema, channel, _message(b"\0\1\0\0" + bytes(64))]


_PART = f"\n{'=' * 80}\nMSG: a_msgs/"


_GARBAGE = [
    ("float64 x\nimport os", "ros2msg", "type 'a_msgs/msg/import' is not defined"),
    ("%$!", "ros2msg", "is damaged, or no message definition of topic /a"),
    (f"B b\nfloat64 x{_PART}B\nA a", "ros2msg", "is damaged, or no message definition"),
    ("".join(f"B{k} b\nB{k} c\nfloat64 x{_PART}B{k}\n" for k in range(25)) + "float64 x", "ros2msg", "is damaged"),
    ("float64[1000000000] y\nfloat64 x", "ros2msg", "Could not deserialize"),
    (f"B[2147483647] y\nfloat64 x{_PART}B\n", "ros2msg", "has over 2000 fields"),
    ("float64 x\nint32 x", "ros2msg", "one name twice"),
    ("float64 y", "ros2msg", "no number 'x' in /a; there are: y"),
    ("x" * 600_000, "ros2msg", "has over 500000 characters"),
    ("const long x = " + "(" * 60 + "1" + ")" * 60, "ros2idl", "is defined in IDL, which is not read"),
]  # fmt: skip  # a table


@_QUICK
@given(
    st.one_of(
        st.text(max_size=200),
        st.lists(
            st.sampled_from([*" xy\n[]3=#'A/@", "<=", "float64", "string", "MSG: ", "=" * 80, "b_msgs"]), max_size=60
        ).map("".join),
    )
)
def test_any_text_as_a_definition(text: str) -> None:
    """Whatever text stands as a definition, fields or one sentence come of it."""
    try:
        types_of(Topic(Path(), "/a", "a_msgs/msg/A", "cdr", text, False, frozenset([1])))
    except InputError as error:
        assert "\n" not in str(error)  # noqa: PT017  # or no error at all


def _metadata(names: str) -> str:
    start = "starting_time: {nanoseconds_since_epoch: 0}\n  duration: {nanoseconds: 1}\n  message_count: 0"
    return (
        f"rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: sqlite3\n  relative_file_paths: {names}\n"
        f"  topics_with_message_count: []\n  {start}\n"
    )


_METADATA = [
    "", "- 1", "a: 1", "{", "!!python/object/apply:os.system [true]", "a: " + "[" * 5000, "x" * 1_100_000,
    *map(_metadata, ("[../x.db3]", "[/etc/x.db3]", "[a/../../x.db3]", "[1]", '["a\\0.db3"]', "[..]", "[pipe.db3]")),
]  # fmt: skip  # a table


def test_without_rosbags_the_sentence_says_how_to_install_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A missing rosbags is named, with the command that installs it."""
    for name in ("rosbags", "rosbags.typesys"):
        monkeypatch.setitem(sys.modules, name, None)
    for suffix in _SUFFIXES:
        (tmp_path / f"x{suffix}").write_bytes(b"x")
    says = "is a ROS bag, which needs rosbags; install it with pip install 'bristle[ros]'"
    _assert_refused([(tmp_path / f"x{suffix}", says) for suffix in _SUFFIXES])
