"""The dataset of a fleet: its columns, its one order and bytes, and what is read of it."""

import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from bristle.errors import InputError
from bristle.questions.fleet import dataset
from bristle.questions.fleet.sessions import JointSession

pa = pytest.importorskip("pyarrow", reason="needs the extra fleet")
pytest.importorskip("fsspec", reason="needs the extra fleet")


def results(keys: list[str], rows: int = 3) -> Any:
    """So many rows of each key, as tasks give them; one has an open bound."""
    names = [f"p{k}" for k in reversed(range(rows))]
    made = {name: [None] * len(keys) * rows for name in dataset.OF_TASK} | {
        "key": np.repeat(keys, rows).tolist(), "parameter": names * len(keys), "direction": ["+"] * len(keys) * rows,
        "value": [float(k) for k in range(len(keys) * rows)], "upper": [math.inf] * len(keys) * rows, "severity": ["none"] * len(keys) * rows,
    }  # fmt: skip  # a table
    return pa.table(made, schema=dataset.schema_of(dataset.OF_TASK, coded=False))


def sessions(keys: list[str], failures: dict[int, str] | None = None) -> pd.DataFrame:
    """A joint session of each key, from the last to the first."""
    day, why = pd.Timestamp("2026-01-01"), failures or {}
    units = (f"r{len(keys) - k:06d}" for k in range(len(keys)))
    rows = [
        JointSession(unit, "j", "t", day, math.nan, 2.0, "", f"f{k}", f"/f{k}", "j", key, why.get(k, ""))
        for k, (unit, key) in enumerate(zip(units, keys, strict=True))
    ]
    frame = pd.DataFrame(rows, columns=list(JointSession._fields))
    return frame.assign(session=frame["session"].astype("datetime64[us]"))


def test_rows_have_the_columns_and_the_order() -> None:
    """The columns are as documented, the rows sorted; of a failure there is one row, of a key that two sessions share each has its own."""
    table = dataset.assembled(sessions(["a", "b", "a", ""], {3: "no such file"}), results(["a", "b", "c"]))
    frame = table.to_pandas()
    assert tuple(frame.columns) == tuple(dataset.COLUMNS)
    assert frame["unit"].tolist() == ["r000001", *np.repeat(["r000002", "r000003", "r000004"], 3)]
    assert frame["parameter"].tolist()[1:] == 3 * ["p0", "p1", "p2"]
    assert frame["value"].tolist()[1:] == [2, 1, 0, 5, 4, 3, 2, 1, 0]
    assert frame["failure"].tolist()[0] == "no such file"
    assert frame.loc[0, ["direction", "value", "key", "tags", "left_out"]].isna().all()
    assert (frame["upper"][1:] == math.inf).all()
    assert frame["tags"].isna().all()
    assert frame.sort_values(list(dataset.ORDER), kind="stable").index.tolist() == list(range(10))


def test_the_order_of_tasks_does_not_show() -> None:
    """Whatever order catalog and results come in, the dataset has the same bytes."""
    keys = [f"k{k}" for k in range(50)]
    rng = np.random.default_rng(0)
    one = dataset.parquet_of(dataset.assembled(sessions(keys), results(keys)))
    mixed = results(keys).take(rng.permutation(150))
    other = dataset.parquet_of(dataset.assembled(sessions(keys).sample(frac=1, random_state=1), mixed))
    assert one == other


def test_a_dataset_is_read_back(tmp_path: Path) -> None:
    """The last dataset written is the one that is read, also by pandas; of a key that sessions share the results are known once."""
    out, keys = str(tmp_path), [f"k{k}" for k in range(20)]
    for known in (keys, [*keys, "k20"]):
        dataset.write_dataset(out, dataset.assembled(sessions([*known, known[0]]), results(known)))
    assert dataset.read_dataset(out).num_rows == len(pd.read_parquet(tmp_path / "results")) == 66
    found = dataset.known_results(out)
    assert found.num_rows == 63
    assert set(found["key"].to_pylist()) == {*keys, "k20"}


def test_other_files_are_no_dataset(tmp_path: Path) -> None:
    """A file of somebody else's, or a damaged one, is refused in a sentence and stays; other names are left alone."""
    (tmp_path / "results").mkdir()
    path = tmp_path / dataset.DATASET
    pd.DataFrame({"a": [1]}).to_parquet(path)
    pd.DataFrame({"a": [1]}).to_parquet(tmp_path / "results" / "mine.parquet")
    with pytest.raises(InputError, match="is not part of a fleet's dataset"):
        dataset.read_dataset(str(tmp_path))
    path.write_bytes(b"PAR1")
    with pytest.raises(InputError, match="is damaged"):
        dataset.read_dataset(str(tmp_path))
    path.unlink()
    assert dataset.read_dataset(str(tmp_path)).num_rows == 0


def test_a_damaged_task_is_told(tmp_path: Path) -> None:
    """Of tasks whose files cannot be read the keys are told, the others are read."""
    (tmp_path / "tasks").mkdir()
    for key in ("a", "b"):
        Path(dataset.task_file(str(tmp_path), key)).write_bytes(dataset.task_bytes(key, (), "two\nlines"))
    Path(dataset.task_file(str(tmp_path), "b")).write_bytes(b"")
    table, damaged = dataset.read_tasks(str(tmp_path), {"a", "b", "c"})
    assert damaged == {"b", "c"}
    assert table["failure"].to_pylist() == ["two lines"]


@pytest.mark.slow
def test_a_hundred_thousand_sessions_are_read_at_once(tmp_path: Path) -> None:
    """1e5 joint sessions, 1e6 rows, are compacted in a minute and read by pandas in 5 s."""
    keys = [f"{k:032x}" for k in range(100_000)]
    begun = time.perf_counter()
    dataset.write_dataset(str(tmp_path), dataset.assembled(sessions(keys), results(keys, 10)))
    wrote = time.perf_counter()
    frame = pd.read_parquet(tmp_path / "results")
    read = time.perf_counter()
    assert len(frame) == 1_000_000
    assert wrote - begun < 60
    assert read - wrote < 5
