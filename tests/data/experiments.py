"""What several tests of this room begin with: an experiment file, a log, and what is surely there."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar

import pytest
import yaml

from bristle.data.columns import Key
from bristle.data.experiment.load import Experiment, load_experiment, read_runs
from bristle.data.record import Record
from bristle.data.text_table import read_table
from bristle.errors import InputError

T = TypeVar("T")
SIGNALS = {
    "time": {"column": "t", "unit": "s"},
    "position": {"column": "q", "unit": "rad"},
    "torque": {"column": "tau", "unit": "N*m"},
}


def present(value: T | None) -> T:
    """A signal of a record, say, that it has."""
    assert value is not None
    return value


def signals_with(**changes: Any) -> dict[str, Any]:
    """`SIGNALS` with some changed, and without those that are None."""
    return {name: s for name, s in (SIGNALS | changes).items() if s is not None}


def experiment(folder: Path, **changes: Any) -> Experiment:
    """The experiment of one tracking run of log.csv, with some keys changed."""
    base = {"joint": {"name": "wrist"}, "signals": SIGNALS, "runs": [{"files": "log.csv", "experiment": "tracking"}]}
    path = folder / "experiment.yaml"
    path.write_text(yaml.safe_dump(base | changes, allow_unicode=True), encoding="utf-8")
    return load_experiment(path)


def first_record(folder: Path, **changes: Any) -> Record:
    """What its first run measured."""
    return read_runs(experiment(folder, **changes))[0].record


def refusal(path: Path, keys: Sequence[Key]) -> str | None:
    """The sentence with which columns of a file are refused, one line that opens with its path; None where they are read."""
    try:
        table = read_table(path, keys)
    except InputError as error:
        assert str(error).startswith(str(path))  # noqa: PT017  # either is right
        assert "\n" not in str(error)  # noqa: PT017
        return str(error)
    assert {column.shape for column in table.columns.values()} == {(table.rows,)}
    return None


def measured(*parts: str) -> Path:
    """A measured file; skips where there are none."""
    folder = os.environ.get("BRISTLE_DATA")
    if not folder:
        pytest.skip("BRISTLE_DATA is not set: the measured logs are not part of the project")
    return Path(folder, *parts)
