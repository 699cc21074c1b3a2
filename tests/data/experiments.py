"""What several tests of this room begin with: an experiment file, a log, and what is surely there."""

import re
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
import yaml

from bristle.data.columns import Key
from bristle.data.experiment.load import Experiment, load_experiment, read_runs
from bristle.data.record import Record
from bristle.data.text_table import read_table
from bristle.errors import InputError

SIGNALS = {
    "time": {"column": "t", "unit": "s"},
    "position": {"column": "q", "unit": "rad"},
    "torque": {"column": "tau", "unit": "N*m"},
}


def signals_with(**changes: Any) -> dict[str, Any]:
    """`SIGNALS` with some changed, and without those that are None."""
    return {name: s for name, s in (SIGNALS | changes).items() if s is not None}


def write_log(folder: Path, name: str = "log.csv", **columns: Any) -> Path:
    path = folder / name
    pd.DataFrame(columns).to_csv(path, index=False)
    return path


def experiment(folder: Path, **changes: Any) -> Experiment:
    """The experiment of one tracking run of log.csv, with some keys changed."""
    base = {"joint": {"name": "wrist"}, "signals": SIGNALS, "runs": [{"files": "log.csv", "experiment": "tracking"}]}
    path = folder / "experiment.yaml"
    path.write_text(yaml.safe_dump(base | changes, allow_unicode=True), encoding="utf-8")
    return load_experiment(path)


def first_record(folder: Path, **changes: Any) -> Record:
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


def assert_refused(asks: Iterable[tuple[Callable[[], object], str]], opens: str = "", seconds: float = 5.0) -> None:
    """Each call is refused in one short line that opens so and matches its pattern; those that are not are named, with what they did."""
    # each within so many seconds of the clock on the wall, so that a process that is waited for counts as well
    faults = []
    for ask, says in asks:
        begun, said = time.monotonic(), ""
        try:
            ask()
        except InputError as error:
            said = str(error)
        took = time.monotonic() - begun
        right = said.startswith(opens) and re.search(says, said) and 0 < len(said) < 500
        if not right or "\n" in said or took >= seconds:
            faults.append(f"expected {says}; got {said[:600] or 'a result'}, after {took:.1f} s")
    assert not faults, "\n".join(faults)
