"""Messages of sqlite3 storage files (.db3), read by the standard library, read-only.

A hostile database can hold views, virtual tables and computed columns, which run without end: only plain tables are
read. What SQLite does is counted, and stopped where it is more than the size of the file explains.
"""

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import accumulate
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from bristle.data.columns import reading
from bristle.data.ros.storage import DAMAGED, MAX_RECORD, Channel, MessageBatch
from bristle.errors import InputError, short, short_list

_WHAT = "sqlite3 file of a ROS 2 bag"
_ROWS, _BYTES = 8192, 2**23
"""Messages that are read together, and about how many bytes of them."""
_TABLES = {"topics": ("id", "name", "type", "serialization_format"), "messages": ("topic_id", "timestamp", "data")}
_DEFINITIONS = ("topic_type", "encoding", "encoded_message_definition")
_STEPS = 10_000
"""Of SQLite's machine, between two looks at how many there were."""
_MAX_TOPICS = 10_000


def sqlite_channels(path: Path) -> list[Channel]:
    """The topics of a sqlite3 file. Raises InputError."""
    with _opened(path) as database:
        texts = dict[str, tuple[str, str]]()
        if _columns(database, "message_definitions", _DEFINITIONS):
            rows = _few(database, "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions")
            texts = {str(kind): (str(text), str(encoding)) for kind, encoding, text in rows}
        topics = _few(database, "SELECT id, name, type, serialization_format FROM topics")
    channels = []
    for number, name, kind, encoding in topics:
        if not (isinstance(number, int) and isinstance(name, str) and isinstance(kind, str)):
            raise InputError(f"is damaged: its topics are {short((number, name, kind))}; {DAMAGED}")
        text, format_ = texts.get(kind, ("", "ros2msg"))
        channels.append(Channel(number, name, kind, str(encoding), text, format_ != "ros2msg"))
    return channels


def sqlite_batches(path: Path, wanted: frozenset[int]) -> Iterator[MessageBatch]:
    """The messages of some topics of a sqlite3 file, in the order of the file. Raises InputError."""
    size = path.stat().st_size
    marks = ", ".join("?" * len(wanted))
    query = f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({marks})"  # noqa: S608  # only marks
    with _opened(path) as database:
        with reading(_WHAT, DAMAGED):
            cursor = database.execute(query, tuple(wanted))
        left, rows = size, 64
        while some := _fetched(cursor, rows):
            batch = _batch(*zip(*some, strict=True))
            left -= batch.data.size
            if left < 0:
                raise InputError(f"is damaged: its messages are longer than the file; {DAMAGED}")
            rows = int(np.clip(_BYTES * batch.lengths.size // max(1, batch.data.size), 1, _ROWS))
            yield batch


def _fetched(cursor: sqlite3.Cursor, rows: int) -> list[tuple[object, ...]]:
    with reading(_WHAT, DAMAGED):
        return cursor.fetchmany(rows)


def _batch(numbers: tuple[Any, ...], times: tuple[Any, ...], messages: tuple[Any, ...]) -> MessageBatch:
    """Rows of the table of messages. Raises InputError where one holds another type than it must."""
    if not _are(messages, bytes):
        raise InputError(f"is damaged: a message is no blob; {DAMAGED}")
    if not (_are(times, int) and _are(numbers, int)):
        raise InputError(f"is damaged: a time stamp is no integer; {DAMAGED}")
    lengths = np.fromiter(map(len, messages), np.int64, len(messages))
    data = np.frombuffer(b"".join(messages), np.uint8)
    return MessageBatch(
        data, np.cumsum(lengths) - lengths, lengths, np.array(times, np.int64), np.array(numbers, np.int64)
    )


def _are(values: tuple[object, ...], kind: type) -> bool:
    """Whether all values are of a type."""
    return set(map(type, values)) == {kind}


def _few(database: sqlite3.Connection, query: str) -> list[tuple[object, ...]]:
    """The rows of a short table."""
    with reading(_WHAT, DAMAGED):
        rows: list[tuple[object, ...]] = database.execute(query).fetchmany(_MAX_TOPICS + 1)
    if len(rows) > _MAX_TOPICS:
        raise InputError(f"has more than {_MAX_TOPICS} topics or types; cut it")
    return rows


@contextmanager
def _opened(path: Path) -> Iterator[sqlite3.Connection]:
    """The database, with the tables of a bag and nothing that computes."""
    with path.open("rb") as file:
        if file.read(16) != b"SQLite format 3\0":
            raise InputError(f"is damaged, or no {_WHAT}; {DAMAGED}")
    log = path.with_name(f"{path.name}-wal")
    if log.exists() and log.stat().st_size:
        raise InputError(
            f"has messages in {log.name} that are not in it yet; close what writes it, or open it once with sqlite3"
        )
    with reading(_WHAT, DAMAGED):
        database = sqlite3.connect(f"file:{quote(str(path.absolute()))}?mode=ro&immutable=1", uri=True)
    try:
        _confine(database, path.stat().st_size)
        for table, columns in _TABLES.items():
            if not _columns(database, table, columns):
                raise InputError(
                    f"is no {_WHAT}: it lacks the table {table} with {short_list(columns)}; expected a bag"
                )
        yield database
    finally:
        database.close()


def _confine(database: sqlite3.Connection, size: int) -> None:
    """Bound what a database can make SQLite do: steps in proportion to its size, short values, no foreign functions."""
    looks = accumulate(iter(lambda: 1, 0))
    most = (10_000_000 + 20 * size) // _STEPS
    database.set_progress_handler(lambda: int(next(looks) > most), _STEPS)
    database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MAX_RECORD)
    with reading(_WHAT, DAMAGED):
        database.execute("PRAGMA trusted_schema = OFF")
        database.execute("PRAGMA cell_size_check = ON")


def _columns(database: sqlite3.Connection, table: str, columns: tuple[str, ...]) -> bool:
    """Whether a plain table has these columns, none of them computed."""
    with reading(_WHAT, DAMAGED):
        found = database.execute("SELECT type, sql FROM sqlite_master WHERE name = ?", (table,)).fetchmany(2)
        plain = len(found) == 1 and found[0][0] == "table" and "virtual" not in str(found[0][1]).lower()
        there = database.execute(f"PRAGMA table_xinfo({table})").fetchmany(100) if plain else []
    return set(columns) <= {row[1] for row in there if row[6] == 0}
