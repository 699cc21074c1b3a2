"""The dataset of a fleet in Parquet, with equal bytes for equal results, and the files of its tasks."""

import io
from collections.abc import Collection, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

from bristle.errors import InputError, one_line
from bristle.page.output_folder import RESULTS, TASKS
from bristle.questions.fleet.files import joined_path, make_folder, names_in, read_bytes, write_whole
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
}  # fmt: skip  # text (a dictionary), number (float64), time (UTC, microseconds), truth (bool)
_TEXTS = [name for name, holds in COLUMNS.items() if holds == _TEXT]
OF_TASK = (
    "direction", "parameter", "value", "value_unit", "standard_error", "lower", "upper", "source", "severity", "warnings", "use", "kind",
    "simulated", "key", "failure",
)  # fmt: skip  # columns of a task; the others are the catalog's
ORDER = ("unit", "joint", "session", "direction", "parameter", "file", "failure")
DATASET = f"{RESULTS}/dataset.parquet"  # in an output
_READERS = 16


def schema_of(columns: Sequence[str], *, coded: bool) -> "pa.Schema":
    """The Arrow schema of some columns; `coded`: text as a dictionary."""
    import pyarrow as pa

    text = pa.dictionary(pa.int32(), pa.string()) if coded else pa.string()
    types = {_TEXT: text, _NUMBER: pa.float64(), "time": pa.timestamp("us"), "truth": pa.bool_()}
    return pa.schema([(name, types[COLUMNS[name]]) for name in columns], metadata={"bristle": SCHEMA})


def task_bytes(key: str, rows: Sequence[Mapping[str, Any]], failure: str | None = None) -> bytes:
    """The rows of an identified joint, or one row of a failure, as Parquet with the columns `OF_TASK`."""
    import pyarrow as pa

    common = {"key": key, "failure": failure and one_line(failure)}
    whole = [{**row, **common} for row in rows or [dict.fromkeys(OF_TASK)]]
    table = pa.Table.from_pylist(whole, schema=schema_of(OF_TASK, coded=False))
    return parquet_of(table, compression="none", use_dictionary=False, write_statistics=False, store_schema=False)


def parquet_of(table: "pa.Table", **how: Any) -> bytes:
    """A table as Parquet; `how` as of `pyarrow.parquet.write_table`."""
    import pyarrow.parquet as pq

    sink = io.BytesIO()
    pq.write_table(table, sink, **how)
    return sink.getvalue()


def read_parquet(name: str, **how: Any) -> "pa.Table":
    """The table of a Parquet file; `how` and errors as of `pyarrow.parquet.ParquetFile.read`."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    return pq.ParquetFile(pa.BufferReader(read_bytes(name))).read(**how)


def task_file(folder: str, key: str) -> str:
    """Path of the rows of a task."""
    return joined_path(folder, f"{TASKS}/{key}.parquet")


def task_keys(folder: str) -> set[str]:
    """Keys of the tasks whose rows are in an output."""
    names = names_in(joined_path(folder, TASKS))
    return {name.removesuffix(".parquet") for name in names if name.endswith(".parquet") and not name.startswith(".")}


def read_tasks(folder: str, keys: Collection[str]) -> tuple["pa.Table", set[str]]:
    """The rows of some tasks, and the keys of those whose file is damaged or missing."""
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


def read_dataset(folder: str) -> "pa.Table":
    """The dataset of an output, perhaps without rows. Raises InputError where the file is damaged or not bristle's."""
    import pyarrow as pa

    name, schema = joined_path(folder, DATASET), schema_of(tuple(COLUMNS), coded=True)
    try:
        table = read_parquet(name)
        known = (table.schema.metadata or {}).get(b"bristle")
        # Results of another version are identified anew.
        rows = table.select(schema.names).cast(schema) if known == SCHEMA.encode() else schema.empty_table()
    except FileNotFoundError:
        return schema.empty_table()
    except (pa.ArrowException, ValueError, KeyError) as error:
        raise InputError(f"{name}: is damaged ({one_line(str(error), 100)}); remove it, and run again") from error
    if known is None:
        raise InputError(f"{name}: is not part of a fleet's dataset; move it, or name another folder")
    return rows


def known_results(folder: str) -> "pa.Table":
    """The rows of the tasks in the dataset of the last run, each once."""
    import pyarrow.compute as pc

    table = read_dataset(folder)
    table = table.filter(pc.is_valid(table["key"])).select(OF_TASK)
    once = ~table.select(("key", "direction", "parameter", "failure")).to_pandas().duplicated()
    return table.filter(once.to_numpy())


def assembled(sessions: "pd.DataFrame", results: "pa.Table") -> "pa.Table":
    """The dataset: the rows of each joint session (columns of `JointSession`) by its key, or its failure."""
    import pyarrow as pa

    known = results.cast(schema_of(OF_TASK, coded=False)).to_pandas()
    own = sessions.rename(columns={"failure": "why"})
    own["key"] = own["key"].where(own["why"] == "", None)
    rows = own.merge(known, how="left", on="key")
    rows["failure"] = rows["failure"].where(rows["failure"].notna() | (rows["why"] == ""), rows["why"])
    empty = [name for name in _TEXTS if name not in OF_TASK]
    rows[empty] = rows[empty].where(rows[empty] != "")
    rows[_TEXTS] = rows[_TEXTS].astype("category")
    ordered = rows.sort_values(list(ORDER))
    table = pa.Table.from_pandas(ordered, schema_of(tuple(COLUMNS), coded=True), preserve_index=False)
    return table.replace_schema_metadata({"bristle": SCHEMA})


def write_dataset(folder: str, table: "pa.Table") -> None:
    """Write the dataset of an output. Raises OSError where it cannot be written."""
    make_folder(joined_path(folder, RESULTS))
    write_whole(joined_path(folder, DATASET), parquet_of(table, compression="zstd", use_dictionary=_TEXTS))
