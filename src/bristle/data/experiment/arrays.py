"""Arrays in place of files: their experiment and its run."""

import hashlib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bristle.arrays import Array, as_floats
from bristle.data.columns import Key
from bristle.data.experiment.load import Experiment, Run, run_of_table
from bristle.data.experiment.schema import JointDescription, RunKind
from bristle.data.experiment.signals import Context
from bristle.data.experiment.yaml_file import validate
from bristle.data.text_table import RawTable
from bristle.errors import InputError, short
from bristle.model.parameters import Kind, unit

_HERE = Path("arrays")  # in place of the experiment file, in results
_CALLED: dict[RunKind, str] = {"points": "points", "ramp": "holds", "presliding": "slow loading", "tracking": "motion"}


def run_of_arrays(
    what: RunKind,
    signals: Mapping[str, Any],
    units: Mapping[str, str],
    kind: Kind,
    options: Mapping[str, Any],
    **more: Any,
) -> tuple[Experiment, Run]:
    """The experiment of one run whose signals are arrays, and the run.

    Signals are anything that NumPy takes for n numbers, None where not measured, with units such as `deg/s` of those
    that are not in SI; options are as under `fit` in an experiment file, and `more` other keys of it, where a number is
    in SI.

    Raises InputError where a signal is not n finite numbers, or a unit, the kind or an option is unknown.
    """
    joint = {"name": "joint", "kind": kind}
    validate(JointDescription, joint, "joint", None)  # before units are asked of its kind
    if not isinstance(units, Mapping):
        raise InputError(f"units: got {short(units)}; expected units by signal, as {{'velocity': 'deg/s'}}")
    columns = {name: _column(name, values) for name, values in signals.items() if values is not None}
    if unknown := set(units) - set(columns):
        raise InputError(f"units: got {short(min(unknown))}; expected one of {', '.join(columns)}")
    sizes = {name: x.size for name, x in columns.items()}
    if len(set(sizes.values())) > 1:
        raise InputError(f"arrays differ in length: {', '.join(f'{name} has {n}' for name, n in sizes.items())}")
    si = {name: "s" if name == "time" else unit(name, kind) for name in columns}
    declared = {name: {"column": name, "unit": units.get(name, si[name])} for name in columns}
    data = {
        "path": _HERE,
        "joint": joint,
        "signals": declared,
        "runs": [{"files": _CALLED[what], "experiment": what}],
        "cleaning": {"non_finite": "refuse"},
        "fit": dict(options),
        **{
            name: f"{float(x)!r} {unit(name, kind)}" if isinstance(x, int | float) and x is not True else x
            for name, x in more.items()
        },
    }
    experiment = validate(Experiment, data, str(_HERE), Context(kind=kind))
    table = RawTable(
        columns={Key(name): x for name, x in columns.items()},
        rows=next(iter(sizes.values()), 0),
        sha256=hashlib.sha256(b"".join(x.tobytes() for x in columns.values())).hexdigest(),
    )
    return experiment, run_of_table(experiment, table, _CALLED[what])


def together(
    first: tuple[Experiment, tuple[Run, ...]], *others: tuple[Experiment, tuple[Run, ...]]
) -> tuple[Experiment, tuple[Run, ...]]:
    """The runs of several experiments as one, with the options and joint of the first; each run and each name once."""
    files, runs, names = list[Any](), list[Run](), set[str]()
    for experiment, own in (first, *others):
        for entry, run in zip(experiment.runs, own, strict=True):
            if any(run.record.sha256 == x.record.sha256 and run.kind == x.kind for x in runs):
                continue
            name, count = run.record.file, 2
            while name in names:
                name, count = f"{run.record.file} {count}", count + 1
            names.add(name)
            files.append(entry.model_copy(update={"files": name, "signals": experiment.signals_of(entry)}))
            runs.append(replace(run, record=replace(run.record, file=name)))
    return first[0].model_copy(update={"runs": tuple(files)}), tuple(runs)


def seconds(index: Any) -> Any:
    """The index of a series as time, from the first date; None where it counts rows or there is none."""
    index = getattr(index, "index", None)
    return None if callable(index) or type(index).__name__ == "RangeIndex" else _in_seconds(index)


def _in_seconds(values: Any) -> Any:
    """Dates and durations as s from the first one; other values unchanged."""
    if not hasattr(values, "dtype"):
        return values
    if getattr(values.dtype, "tz", None) is not None:  # instants, which NumPy knows without zones alone
        values = getattr(values, "dt", values).tz_convert("UTC")
        values = getattr(values, "dt", values).tz_localize(None)
    if values.dtype.kind not in "mM":
        return values
    array = np.asanyarray(values)
    return (array - array[:1]) / np.timedelta64(1, "s") if array.dtype.kind == "M" else array / np.timedelta64(1, "s")


def _column(name: str, values: Any) -> Array:
    values = _in_seconds(values) if name == "time" else values
    if getattr(getattr(values, "dtype", None), "kind", "-") in "cmM":
        raise InputError(f"{name}: got numbers of type {values.dtype}; expected n real numbers")
    try:
        column = as_floats(values)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} is not an array of numbers ({error}); expected n numbers") from error
    if column.ndim != 1:
        expected = f"expected (n,), as of one column of a data frame, frame[{name!r}]"
        raise InputError(f"{name} has shape {column.shape}; {expected}")
    missing = np.flatnonzero(~np.isfinite(column))
    if missing.size:
        rows = f"{missing.size} of {column.size} rows, first in row {missing[0]} (from 0)"
        raise InputError(f"{name} is missing or not finite in {rows}; leave these rows out")
    return column
