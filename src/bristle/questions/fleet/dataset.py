"""The dataset of a fleet: Parquet, a row per unit, joint, session, direction and parameter; written per task, then compacted into parts.

The columns are `COLUMNS`. Equal results give equal bytes: rows have one order, a part is named by its place and content, and
nothing in it tells when it was written.
"""

import hashlib
import io
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

import numpy as np

from bristle.errors import InputError, one_line
from bristle.page.output_folder import RESULTS, TASKS
from bristle.questions.fleet.files import joined_path, make_folder, names_in, read_bytes, remove, write_whole
from bristle.questions.fleet.survey import SCHEMA

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

_TEXT, _NUMBER = "text", "number"
COLUMNS = {
    "unit": _TEXT, "joint": _TEXT, "type": _TEXT, "session": "time", "direction": _TEXT, "parameter": _TEXT, "value": _NUMBER,
    "value_unit": _TEXT, "standard_error": _NUMBER, "lower": _NUMBER, "upper": _NUMBER, "source": _TEXT, "severity": _TEXT,
    "warnings": _TEXT, "use": _TEXT, "kind": _TEXT, "simulated": "truth", "temperature": _NUMBER, "load": _NUMBER, "tags": _TEXT,
    "file": _TEXT, "key": _TEXT, "failure": _TEXT, "left_out": _TEXT,
}  # fmt: skip  # a table
"""Columns of the dataset and what each holds: text (a dictionary), a number (float64), a time (UTC, microseconds), or a truth."""
_TEXTS = [name for name, holds in COLUMNS.items() if holds == _TEXT]
OF_TASK = (
    "direction", "parameter", "value", "value_unit", "standard_error", "lower", "upper", "source", "severity", "warnings", "use", "kind",
    "simulated", "key", "failure",
)  # fmt: skip  # a list
"""Columns that a task gives; the others are the catalog's."""
ORDER = ("unit", "joint", "session", "direction", "parameter", "file", "failure")
PART = re.compile(r"part-\d{5}-[0-9a-f]{8}\.parquet")
ROWS = 200_000  # of a part
_READERS = 16


def schema_of(columns: Sequence[str], *, coded: bool) -> "pa.Schema":
    """The Arrow schema of some columns, text as a dictionary where it is `coded`."""
    import pyarrow as pa

    text = pa.dictionary(pa.int32(), pa.string()) if coded else pa.string()
    types = {_TEXT: text, _NUMBER: pa.float64(), "time": pa.timestamp("us"), "truth": pa.bool_()}
    return pa.schema([(name, types[COLUMNS[name]]) for name in columns], metadata={"bristle": SCHEMA})


def task_bytes(key: str, rows: Sequence[Mapping[str, Any]], failure: str | None = None) -> bytes:
    """The rows of a joint that was identified, each with the other columns of `OF_TASK`, or the one of a failure, as Parquet."""
    import pyarrow as pa

    told = {"key": key, "failure": failure and one_line(failure)}
    whole = [{**row, **told} for row in rows or [dict.fromkeys(OF_TASK)]]
    table = pa.Table.from_pylist(whole, schema=schema_of(OF_TASK, coded=False))
    return parquet_of(table, compression="none", use_dictionary=False, write_statistics=False, store_schema=False)


def parquet_of(table: "pa.Table", **how: Any) -> bytes:
    """A table as the bytes of a Parquet file; `how` as of `pyarrow.parquet.write_table`."""
    import pyarrow.parquet as pq

    sink = io.BytesIO()
    pq.write_table(table, sink, **how)
    return sink.getvalue()


def read_parquet(name: str, **how: Any) -> "pa.Table":
    """The table of a Parquet file; `how` as of `pyarrow.parquet.ParquetFile.read`. Raises what Arrow does, ValueError or OSError."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    return pq.ParquetFile(pa.BufferReader(read_bytes(name))).read(**how)


def task_file(folder: str, key: str) -> str:
    """Where the rows of a task lie."""
    return joined_path(folder, f"{TASKS}/{key}.parquet")


def task_keys(folder: str) -> set[str]:
    """The keys of the tasks whose rows lie in an output."""
    names = names_in(joined_path(folder, TASKS))
    return {name.removesuffix(".parquet") for name in names if name.endswith(".parquet") and not name.startswith(".")}


def read_tasks(folder: str, keys: Collection[str]) -> tuple["pa.Table", set[str]]:
    """The rows of some tasks, and the keys of those whose file is damaged or gone."""
    import pyarrow as pa

    def read(key: str) -> "pa.Table | None":
        try:
            return read_parquet(task_file(folder, key), use_threads=False).cast(schema_of(OF_TASK, coded=False))
        except (pa.ArrowException, ValueError, OSError):
            return None

    ordered = sorted(keys)
    with ThreadPoolExecutor(_READERS) as pool:
        tables = list(pool.map(read, ordered))
    good = [table for table in tables if table is not None]
    empty = schema_of(OF_TASK, coded=False).empty_table()
    return pa.concat_tables([empty, *good]), {key for key, table in zip(ordered, tables, strict=True) if table is None}


def parts_of(folder: str) -> list[str]:
    """The part files of an output, sorted."""
    return [name for name in names_in(joined_path(folder, RESULTS)) if PART.fullmatch(name)]


def read_parts(folder: str) -> "pa.Table":
    """The dataset of an output; rows that an interrupted run left twice are there once.

    Raises InputError where a part is damaged, or none of bristle's.
    """
    import pyarrow as pa

    with ThreadPoolExecutor(4) as pool:
        tables = list(pool.map(lambda name: _part(joined_path(folder, f"{RESULTS}/{name}")), parts_of(folder)))
    table = pa.concat_tables([schema_of(tuple(COLUMNS), coded=True).empty_table(), *tables]).unify_dictionaries()
    return table if len(tables) < 2 else _once(table, ORDER)


def _part(name: str) -> "pa.Table":
    import pyarrow as pa

    try:
        table = read_parquet(name)
        known = (table.schema.metadata or {}).get(b"bristle")
        schema = schema_of(tuple(COLUMNS), coded=True)
        # Another version's results are identified anew; a column that only it has is left out.
        rows = table.select(schema.names).cast(schema) if known == SCHEMA.encode() else schema.empty_table()
    except (pa.ArrowException, ValueError, KeyError) as error:
        raise InputError(f"{name}: is damaged ({one_line(str(error), 100)}); remove it, and run again") from error
    if known is None:
        raise InputError(f"{name}: is not part of a fleet's dataset; move it, or name another folder")
    return rows


def _once(table: "pa.Table", columns: Sequence[str]) -> "pa.Table":
    """The first of rows that are equal in some columns."""
    kept = np.flatnonzero(~table.select(columns).to_pandas().duplicated().to_numpy())
    return table if kept.size == len(table) else table.take(kept)


def known_results(folder: str) -> "pa.Table":
    """What the dataset of the last run knows by key, as the tasks gave it, each once."""
    import pyarrow.compute as pc

    table = read_parts(folder)
    table = table.filter(pc.is_valid(table["key"])).select(OF_TASK)
    return _once(table, ("key", "direction", "parameter", "failure"))


def assembled(sessions: "pd.DataFrame", results: "pa.Table") -> "pa.Table":
    """The dataset: to each joint session (columns of `JointSession`) the rows of its key, or its failure; in the order of `ORDER`."""
    known = results.cast(schema_of(OF_TASK, coded=False)).to_pandas()
    own = sessions.rename(columns={"failure": "why"})
    own["key"] = own["key"].where(own["why"] == "", None)  # a failure is a row of its own
    rows = own.merge(known, how="left", on="key")
    rows["failure"] = rows["failure"].where(rows["failure"].notna() | (rows["why"] == ""), rows["why"])
    empty = [name for name in _TEXTS if name not in OF_TASK]
    rows[empty] = rows[empty].where(rows[empty] != "")
    rows[_TEXTS] = rows[_TEXTS].astype("category")  # text is in the order of its dictionary; what is missing comes last
    return _coded(rows.sort_values(list(ORDER)))


def _coded(rows: "pd.DataFrame") -> "pa.Table":
    """The rows, whose text has dictionaries of its own words alone, sorted."""
    import pyarrow as pa

    own = rows.assign(**{name: rows[name].cat.remove_unused_categories() for name in _TEXTS})
    table = pa.Table.from_pandas(own, schema_of(tuple(COLUMNS), coded=True), preserve_index=False)
    return table.replace_schema_metadata({"bristle": SCHEMA})


def write_parts(folder: str, table: "pa.Table", before: Sequence[str]) -> None:
    """Write the dataset of an output in parts; then those of before are removed. Raises OSError where a part cannot be written."""
    make_folder(joined_path(folder, RESULTS))
    names = []
    for name, data in part_files(table):
        names.append(name)
        if name not in before:
            write_whole(joined_path(folder, f"{RESULTS}/{name}"), data)
    for name in set(before) - set(names):
        remove(joined_path(folder, f"{RESULTS}/{name}"))


def part_files(table: "pa.Table") -> Iterator[tuple[str, bytes]]:
    """The parts of a dataset, each with its name."""
    for k, start in enumerate(range(0, max(len(table), 1), ROWS)):
        part = _coded(table.slice(start, ROWS).to_pandas())
        data = parquet_of(part, compression="zstd", use_dictionary=_TEXTS)
        yield f"part-{k:05d}-{hashlib.sha256(data).hexdigest()[:8]}.parquet", data
