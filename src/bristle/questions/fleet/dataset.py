"""The dataset of a fleet: Parquet, a row per unit, joint, session, direction and parameter; written per task, then compacted into parts.

The columns are `COLUMNS`. Equal results give equal bytes: rows have one order, a part is named by its place and content, and
nothing in it tells when it was written.
"""

import hashlib
import io
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
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
OF_TASK = (
    "direction", "parameter", "value", "value_unit", "standard_error", "lower", "upper", "source", "severity", "warnings", "use", "kind",
    "simulated", "key", "failure",
)  # fmt: skip  # a list
"""Columns that a task gives; the others are the catalog's."""
ORDER = ("unit", "joint", "session", "direction", "parameter", "file", "failure")
PART = re.compile(r"part-\d{5}-[0-9a-f]{8}\.parquet")
ROWS = 200_000
"""Of a part."""
_READERS = 16


def schema_of(columns: Sequence[str], *, coded: bool) -> "pa.Schema":
    """The Arrow schema of some columns, text as a dictionary where it is `coded`."""
    import pyarrow as pa

    text = pa.dictionary(pa.int32(), pa.string()) if coded else pa.string()
    types = {_TEXT: text, _NUMBER: pa.float64(), "time": pa.timestamp("us"), "truth": pa.bool_()}
    return pa.schema([(name, types[COLUMNS[name]]) for name in columns], metadata={"bristle": SCHEMA})


def task_bytes(key: str, rows: Iterable[Mapping[str, Any]]) -> bytes:
    """The rows of a joint that was identified, each with the other columns of `OF_TASK`, as Parquet."""
    return _written([{**row, "key": key, "failure": None} for row in rows])


def failure_bytes(key: str, failure: str) -> bytes:
    """The row of a joint session that cannot be identified, as Parquet."""
    return _written([{**dict.fromkeys(OF_TASK), "key": key, "failure": one_line(failure)}])


def _written(rows: list[dict[str, Any]]) -> bytes:
    import pyarrow as pa

    table = pa.Table.from_pylist(rows, schema=schema_of(OF_TASK, coded=False))
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
        raise InputError(f"{name}: is no part of a fleet's dataset; move it, or name another folder")
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
    import pandas as pd
    import pyarrow as pa
    import pyarrow.compute as pc

    results = results.cast(schema_of(OF_TASK, coded=True)).unify_dictionaries()
    wanted = pa.array(sessions["key"].where(sessions["failure"] == "", None).astype(object), pa.string())
    keys = results["key"].cast(pa.string()).combine_chunks()
    codes = (pc.fill_null(pc.index_in(x, keys.unique()), -1).to_numpy(zero_copy_only=False) for x in (wanted, keys))
    sought, known = (pd.DataFrame({"key": x, "row": np.arange(x.size)}) for x in codes)
    pairs = sought.merge(known, how="left", on="key", suffixes=("", "_of_key"))  # a failure is a row of its own
    owner, rows = pairs["row"].to_numpy(), pa.array(pairs["row_of_key"].astype("Int64"), pa.int64())
    columns = {name: results[name].take(rows) for name in OF_TASK}
    for name in (
        x for x in COLUMNS if x not in OF_TASK
    ):  # those of the catalog, each joint session as often as it has rows
        if COLUMNS[name] == _TEXT:  # what is empty is null
            text = pa.array(sessions[name].astype(object), pa.string())
            column = pc.if_else(pc.equal(text, ""), None, text).dictionary_encode()
        else:
            column = pa.array(sessions[name].to_numpy(), from_pandas=True)
        columns[name] = pa.chunked_array([column.take(owner)])
    own = pa.array(
        sessions["failure"].to_numpy(object)[owner], pa.string(), mask=pairs["row_of_key"].notna().to_numpy()
    )
    failure = pc.coalesce(columns["failure"].cast(pa.string()).combine_chunks(), own)
    table = pa.table({name: (pa.chunked_array([failure]) if name == "failure" else columns[name]) for name in COLUMNS})
    coded = _coded(table)  # text is in the order of its dictionary; what is missing comes last
    order = coded.select(ORDER).to_pandas().sort_values(list(ORDER)).index
    return coded.take(order.to_numpy())


def _coded(table: "pa.Table") -> "pa.Table":
    """The table whose text has dictionaries of its own words alone, sorted."""
    import pyarrow as pa
    import pyarrow.compute as pc

    columns = []
    for name, holds in COLUMNS.items():
        column = table[name].combine_chunks()
        if holds == _TEXT:
            whole = column.cast(pa.string()).dictionary_encode()
            order = pc.sort_indices(whole.dictionary)
            rank = np.empty(len(order), np.int32)
            rank[order.to_numpy()] = np.arange(len(order), dtype=np.int32)
            column = pa.DictionaryArray.from_arrays(pa.array(rank).take(whole.indices), whole.dictionary.take(order))
        columns.append(column)
    return pa.table(columns, schema=schema_of(tuple(COLUMNS), coded=True))


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
    text = [name for name, holds in COLUMNS.items() if holds == _TEXT]
    for k, start in enumerate(range(0, max(len(table), 1), ROWS)):
        data = parquet_of(_coded(table.slice(start, ROWS)), compression="zstd", use_dictionary=text)
        yield f"part-{k:05d}-{hashlib.sha256(data).hexdigest()[:8]}.parquet", data
