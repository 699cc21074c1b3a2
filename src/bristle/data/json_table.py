"""Columns from JSON: a list of records, or an object of columns; a column of lists is a matrix."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bristle.data.columns import Key, bounded, is_vector, numeric, place_of, reading
from bristle.errors import InputError

_WHAT, _HOW = 'JSON of records, as [{"t": 0, "q": 1}, ...], or of columns', "expected as many numbers in each"
SCHEMA = "schema"
"""A key of every JSON file that bristle writes."""


def is_json_log(path: Path) -> bool:
    """Whether a JSON file holds a log, and no results of bristle; what is no such file, or cannot be read, does not."""
    if path.suffix.lower() != ".json" or not path.is_file():
        return False
    try:
        data = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(data, list) or (isinstance(data, dict) and SCHEMA not in data)


def read_json(path: Path, keys: Sequence[Key] | None) -> Iterator[Any]:
    """Columns by name or by number from 0, or of no keys the names of all that are vectors of numbers.

    Raises InputError where the file is no such JSON, or a column is not there or holds no numbers.
    """
    import pandas as pd

    with reading(_WHAT, _HOW):
        data = json.loads(path.read_bytes())
        if not isinstance(data, list | dict):
            raise InputError(f"is no {_WHAT}; {_HOW}")
        frame = pd.DataFrame(data)
    bounded(frame.size)
    names = [str(name) for name in frame.columns]
    columns = [_array(frame.iloc[:, k]) for k in range(len(names))]
    if keys is None:
        yield from (name for name, x in zip(names, columns, strict=True) if is_vector(x.shape, x.dtype))
        return
    for key in keys:
        yield numeric(columns[place_of(key, names)], key)


def _array(column: Any) -> np.ndarray[Any, np.dtype[Any]]:
    """The values of a column, (n,), or of one of lists of one length, (n, k); null is nan."""
    if column.dtype.kind == "O":
        plain = column.map(lambda x: x is None or isinstance(x, int | float)).all()
        lists = column.map(lambda x: len(x) if isinstance(x, list) else -1)
        if plain or (lists.iloc[0] >= 0 and (lists == lists.iloc[0]).all()):
            with reading(_WHAT, _HOW):
                return np.array(column.tolist(), dtype=float if plain else None)
    return np.asarray(column)
