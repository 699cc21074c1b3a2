"""The dataset of a fleet in Parquet, with equal bytes for equal results, and the journal of tasks that are not in it yet."""

import io
import json
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bristle.errors import InputError, one_line
from bristle.page.output_folder import RESULTS, TASKS
from bristle.questions.fleet.survey import SCHEMA

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

_TEXT, _NUMBER = "text", "number"
COLUMNS = {
    "unit": _TEXT, "joint": _TEXT, "type": _TEXT, "session": "time", "direction": _TEXT, "parameter": _TEXT, "value": _NUMBER,
    "value_unit": _TEXT, "standard_error": _NUMBER, "lower": _NUMBER, "upper": _NUMBER, "source": _TEXT, "severity": _TEXT,
    "warnings": _TEXT, "use": _TEXT, "kind": _TEXT, "simulated": "truth", "temperature": _NUMBER, "load": _NUMBER, "tags": _TEXT,
    "file": _TEXT, "key": _TEXT, "failure": _TEXT,
}  # fmt: skip  # text (a dictionary), number (float64), time (UTC, microseconds), truth (bool)
_TEXTS = [name for name, holds in COLUMNS.items() if holds == _TEXT]
_OF_CATALOG = ("unit", "joint", "type", "session", "temperature", "load", "tags", "file")
OF_TASK = [name for name in COLUMNS if name not in _OF_CATALOG]
ORDER = ("unit", "joint", "session", "direction", "parameter", "file", "failure")
DATASET = f"{RESULTS}/dataset.parquet"  # in an output
JOURNAL = f"{TASKS}/rows.jsonl"  # the rows of a task a line


def schema() -> "pa.Schema":
    """The Arrow schema of the dataset."""
    import pyarrow as pa

    text = pa.dictionary(pa.int32(), pa.string())
    types = {_TEXT: text, _NUMBER: pa.float64(), "time": pa.timestamp("us"), "truth": pa.bool_()}
    return pa.schema([(name, types[holds]) for name, holds in COLUMNS.items()], metadata={"bristle": SCHEMA})


def journalled(output: Path) -> dict[str, list[dict[str, Any]]]:
    """The rows of each task in the journal, by its key; a line that a killed run left half-written is none."""
    found = {}
    with suppress(FileNotFoundError):
        for line in (output / JOURNAL).read_text(encoding="utf-8").splitlines():
            with suppress(ValueError, LookupError, TypeError):
                rows = json.loads(line)
                found[rows[0]["key"]] = rows
    return found


def journal(output: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Add the rows of a task to the journal. Raises OSError where it cannot be written."""
    path = output / JOURNAL
    try:
        with path.open("a", encoding="utf-8") as file:
            file.write(f"\n{json.dumps(rows)}")  # what a killed run left half-written stays a line of its own
    except OSError as error:  # of a full disk, which names no file
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error


def known_results(output: Path, keys: Collection[str]) -> "pd.DataFrame":
    """The rows with these keys, each once, of the last run's dataset and of the journal, columns `OF_TASK`."""
    import pandas as pd

    table = read_dataset(output).select(OF_TASK).to_pandas().astype(object)
    told = [row for rows in journalled(output).values() for row in rows]
    both = pd.concat([table, pd.DataFrame(told, columns=OF_TASK, dtype=object)], ignore_index=True)
    wanted: pd.DataFrame = both[both["key"].isin(list(keys))]
    return wanted.drop_duplicates(["key", "direction", "parameter", "failure"])


def read_dataset(output: Path) -> "pa.Table":
    """The dataset of an output, perhaps without rows. Raises InputError where the file is damaged or not bristle's."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = output / DATASET
    if not path.exists():
        return schema().empty_table()
    try:
        table = pq.ParquetFile(pa.BufferReader(path.read_bytes())).read()
        known = (table.schema.metadata or {}).get(b"bristle")
        # Results of another version are identified anew.
        rows = table.select(list(COLUMNS)).cast(schema()) if known == SCHEMA.encode() else schema().empty_table()
    except (pa.ArrowException, ValueError, KeyError) as error:
        raise InputError(f"{path}: is damaged ({one_line(str(error), 100)}); remove it, and run again") from error
    if known is None:
        raise InputError(f"{path}: is not part of a fleet's dataset; move it, or name another folder")
    return rows


def assembled(sessions: "pd.DataFrame", results: "pd.DataFrame") -> "pa.Table":
    """The dataset: the rows of each joint session (columns of `JointSession`) by its key, or its failure."""
    import pyarrow as pa

    own = sessions.rename(columns={"failure": "why"})
    own["key"] = own["key"].where(own["why"] == "", None)
    rows = own.merge(results, how="left", on="key")
    rows["failure"] = rows["failure"].where(rows["failure"].notna() | (rows["why"] == ""), rows["why"])
    given = [name for name in _TEXTS if name in _OF_CATALOG]
    rows[given] = rows[given].where(rows[given] != "")
    rows[_TEXTS] = rows[_TEXTS].astype("category")
    table = pa.Table.from_pandas(rows.sort_values(list(ORDER)), schema(), preserve_index=False)
    return table.replace_schema_metadata({"bristle": SCHEMA})


def write_dataset(output: Path, table: "pa.Table") -> None:
    """Write the dataset of an output, and clear the journal. Raises OSError where it cannot be written."""
    import pyarrow.parquet as pq

    sink = io.BytesIO()
    pq.write_table(table, sink, compression="zstd", use_dictionary=_TEXTS)
    (output / RESULTS).mkdir(parents=True, exist_ok=True)
    write_whole(output / DATASET, sink.getvalue())
    (output / JOURNAL).unlink(missing_ok=True)


def write_whole(path: Path, data: bytes) -> None:
    """Write or replace a file, whole or not at all. Raises OSError where it cannot be written."""
    aside = path.with_name(f".{path.name}")
    try:
        aside.write_bytes(data)
        aside.replace(path)
    except OSError as error:  # names no file, or the temporary one
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error
    finally:
        aside.unlink(missing_ok=True)
