"""Files of a run, and their columns on one time."""

import glob
import hashlib
import os
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BeforeValidator, Field, PlainValidator, StrictBool

from bristle.arrays import Array
from bristle.data import units
from bristle.data.columns import ISO, Key, brought_to
from bristle.data.experiment.schema import Label, RunKind, read_rows
from bristle.data.experiment.signals import Context, Position, Signal, Signals, TimeColumn, quantity
from bristle.data.experiment.yaml_file import StrictModel
from bristle.data.text_table import RawTable, Reader, naming, read_table
from bristle.errors import InputError, check_name, short
from bristle.estimation import levels
from bristle.findings import NOTE, Finding

_VARIABLE = re.compile(r"\$\{(\w+)\}")
_MOST, _LONGEST = 1000, 4096  # patterns of an entry, and characters of one


class TimeRange(StrictModel):
    """A part of a run by its time as logged; an end that is not given is the run's."""

    start: Annotated[float, quantity("s")] | None = Field(default=None, alias="from")
    to: Annotated[float, quantity("s")] | None = None

    def _problems(self) -> Iterator[str]:
        if self.start is None and self.to is None:
            yield "expected one end at least, as in {from: 2 s, to: 30 s}"
        if self.start is not None and self.to is not None and not self.start < self.to:
            yield f"got {self.start:g} s to {self.to:g} s; expected the earlier time first"


def _read_files(value: object) -> str | tuple[str, ...]:
    """Paths or globs, one or several."""
    several = tuple(value) if isinstance(value, list | tuple) else (value,)
    if not 1 <= len(several) <= _MOST or not all(isinstance(x, str) and 1 <= len(x) <= _LONGEST for x in several):
        expected = f"a path or glob of at most {_LONGEST} characters, or a list of at most {_MOST} of them"
        raise InputError(f"got {short(value)}; expected {expected}")
    return str(value) if isinstance(value, str) else tuple(map(str, several))


class RunFiles(StrictModel):
    """One entry under runs: a file or several, and what they hold."""

    # paths or globs, relative to the experiment file; ${NAME} is an environment variable
    files: Annotated[str | tuple[str, ...], PlainValidator(_read_files)]
    joined: StrictBool = False  # whether the files are parts of one run, in this order; else each is a run of its own
    # part of each run that is used, in the lines or rows that `bristle inspect` prints, from 1
    rows: Annotated[tuple[int, int], BeforeValidator(read_rows)] | None = None
    time: TimeRange | None = None  # the same by time
    experiment: RunKind
    hold_out: StrictBool = False
    temperature: Label | None = None
    load: Label | None = None
    signals: Signals | None = None  # signals that differ from the experiment's

    @property
    def patterns(self) -> tuple[str, ...]:
        """The paths or globs."""
        return (self.files,) if isinstance(self.files, str) else self.files

    def _problems(self) -> Iterator[str]:
        if self.rows is not None and self.time is not None:
            yield "got rows and time; expected one of them"
        if self.time is not None and self.experiment == "points":
            yield "time: points have no time; give rows, as in rows: 2-40"


def sources_of(run: RunFiles, experiment: Path) -> list[list[tuple[Path, str]]]:
    """The files of each run of an entry, each with the name that results show: one file a run, or all, if joined.

    Raises InputError where a pattern matches none, or a file is named twice in a joined run.
    """
    found = [match for pattern in run.patterns for match in matches(pattern, experiment)]
    twice = [shown for shown, count in Counter(shown for _, shown in found).items() if count > 1]
    if twice:
        raise InputError(f"{experiment}: runs: files name {short(twice[0])} twice; name each file once")
    return [found] if run.joined else [[source] for source in found]


def matches(files: str, experiment: Path) -> list[tuple[Path, str]]:
    """Paths that a pattern matches, sorted by name, each with the name that results show, variables not filled in.

    Raises InputError where there is none.
    """
    folder, variables = experiment.parent, {}
    where = f"{experiment}: runs: files {short(files)}"
    for name in _VARIABLE.findall(files):
        if not os.environ.get(name):
            raise InputError(f"{where} needs the environment variable {name}, which is not set; set it to a folder")
        variables[name] = os.environ[name]
    pattern = _VARIABLE.sub(lambda match: variables[match[1]], files)
    if pattern.count("**") > 1:  # each may stand for any number of folders: together they search for ever
        raise InputError(f"{where} has ** more than once; expected a glob such as logs/**/ramp*.csv")
    try:
        if (folder / pattern).exists():
            found = [pattern]
        elif "**" not in pattern:
            found = sorted(glob.glob(pattern, root_dir=folder))  # noqa: PTH207  # Path.glob takes no absolute pattern
        else:  # glob.glob follows links, in circles where they go so
            root = Path(pattern).anchor
            base = Path(root) if root else folder
            below = (path.relative_to(base) for path in base.glob(pattern.removeprefix(root)))
            found = sorted(f"{root}{x}" for x in below if not any(p.startswith(".") and p != ".." for p in x.parts))
    except OSError as error:
        raise InputError(f"{where}: the file search failed ({error.strerror}); check the path") from error
    if not found:
        what = "matches no file" if glob.has_magic(pattern) else "is not a file"
        raise InputError(f"{where} {what}; expected a path or glob relative to the folder of the experiment file")
    sources = []
    for match in found:
        name = os.path.relpath(match, folder) if Path(match).is_absolute() else match
        filled = next(((key, value) for key, value in variables.items() if value in match), None)
        if filled is not None:  # the variable stands for its folder
            name = match.replace(filled[1], f"${{{filled[0]}}}", 1)
        shown = check_name(Path(name).as_posix(), f"{experiment}: runs: files: the file name")
        sources.append((folder / match, shown))
    return sources


Source = tuple[Path, str]  # a file, and how it is called
_APART = 100  # gaps between a file and one whose time begins anew after it: what the joint did meanwhile is unknown


def keys_of(signals: Signals) -> dict[str, Key]:
    """The column of each signal; none for a time that is given by its rate."""
    keys = {} if signals.time is None or signals.time.column is None else {"time": signals.time.columns()[0]}
    return keys | {name: Key(s.column, s.index, file=s.file) for name, s in signals if isinstance(s, Signal)}


def read_columns(
    signals: Signals, source: Source, cleaning_gap: float, context: Context, find: Callable[[str], Source], read: Reader
) -> RawTable:
    """The columns of a file, and those of signals with a time of their own, on the time of the run.

    `find` gives the file that a signal names; across more than `cleaning_gap` median intervals nothing is interpolated.
    Raises InputError where a file cannot be read, or a signal has no time in common with the others.
    """
    apart, keys = signals.apart(), keys_of(signals)
    common = [key for name, key in keys.items() if name not in apart]
    more = signals.time.columns()[1:] if signals.time else ()
    table = read(source[0], [*common, *more], source[1])
    time, origin = (None, 0) if signals.time is None else _seconds(table, signals.time)
    table = replace(table, time=time, origin=origin)
    if keys.keys() - apart.keys() > {"time"}:
        own = {name: key for name, key in keys.items() if name not in apart}
        with naming(source[1]):
            table = _on_rows_of_slowest(table, signals, own, cleaning_gap, context)
    for name, signal in apart.items():
        if signals.time is None:
            raise InputError(f"{source[1]}: {name} has a time of its own, and the run has none; give signals.time")
        other = source if signal.file is None else find(signal.file)
        table = _with_signal(table, name, signal, signals.time, other, cleaning_gap, context)
    return table


def _on_rows_of_slowest(
    table: RawTable, signals: Signals, keys: Mapping[str, Key], gap: float, context: Context
) -> RawTable:
    """A table of several topics, each with rows of its own, on the rows of the slowest, the others interpolated.

    In such a table less than half as many rows are whole as the signal with the fewest has.
    """
    seen = {name: np.isfinite(table.columns[key]) for name, key in keys.items() if name != "time"}
    fewest = min(int(rows.sum()) for rows in seen.values())
    if table.time is None or np.logical_and.reduce(list(seen.values())).sum() >= fewest / 2:
        return table
    # of those that are about as slow the motion, whose derivatives interpolation would bend
    slow = [name for name, rows in seen.items() if rows.sum() <= levels.AS_SLOW * fewest]
    base = next((name for name in ("position", "velocity") if name in slow), slow[0])
    rows = seen[base] & np.isfinite(table.time)
    columns, notes = {key: values[rows] for key, values in table.columns.items()}, list(table.notes)
    for name in (name for name in seen if (seen[name] & rows).sum() < fewest / 2):
        with naming(name):
            values = _unwrapped(table.columns[keys[name]], getattr(signals, name), context)
            columns[keys[name]] = brought_to(table.time[rows], table.time, values, gap)
        notes.append(_own_time(name, values, columns[keys[name]]))
    return replace(
        table, columns=columns, rows=int(rows.sum()), time=table.time[rows], numbers=table.lines[rows],
        notes=tuple(notes),
    )  # fmt: skip  # a list


def _unwrapped(values: Array, signal: Signal, context: Context) -> Array:
    """Values of a signal as logged, (n,), without the wraps of a position, which are not to be interpolated across."""
    if not isinstance(signal, Position) or (period := signal.period(context)) is None:
        return values
    seen, whole = np.isfinite(values), values.copy()
    whole[seen] = np.unwrap(values[seen], period=period / abs(signal.factor("position", context)))
    return whole


def _own_time(name: str, values: Array, onto: Array) -> Finding:
    """The note on a signal with samples of its own, (m,), brought to the rows of a run, (n,)."""
    samples, outside = int(np.isfinite(values).sum()), int(np.isnan(onto).sum())
    message = f"{name.capitalize()} has a time of its own, with {samples} samples: interpolated, and missing in {outside} rows."
    return Finding("own-time", NOTE, message, {"samples": samples, "outside": outside})


def _seconds(table: RawTable, clock: TimeColumn) -> tuple[Array, int]:
    """Time of each row, s, and its origin, ns; from a rate where there is no column."""
    keys = clock.columns()
    if not keys:
        return np.arange(table.rows) / getattr(clock, "rate", 1.0), 0
    times = table.columns[keys[0]]
    if clock.unit == ISO:
        return times, table.origins.get(keys[0], 0)
    by = units.factor(clock.unit or "s", "s")
    if clock.plus is None:
        return times * by, 0
    seen = times[np.isfinite(times)]
    first = float(seen[0]) if seen.size else 0.0
    origin = round(min(max(first * by, -9e9), 9e9)) * 10**9  # whole seconds, so that the digits of the rest stay
    added = table.columns[keys[1]] * units.factor(clock.plus.unit, "s")
    return (times - first) * by + (first * by - origin / 1e9) + added, origin


def _with_signal(
    table: RawTable, name: str, signal: Signal, common: TimeColumn, source: Source, gap: float, context: Context
) -> RawTable:
    """The table with a signal of its own time, interpolated linearly; nan where it does not reach."""
    own = signal.time or common
    own = own if own.unit else own.model_copy(update={"unit": common.unit or "s"})
    key = Key(signal.column, signal.index)
    read = read_table(source[0], [key, *own.columns()], source[1])
    if (own.unit == ISO) != (common.unit == ISO):
        why = "one time is of unit iso and the other is not, so that nothing tells how they go together"
        raise InputError(f"{source[1]}: {name}: {why}; give both alike")
    time, origin = _seconds(read, own)
    values = _unwrapped(read.columns[key], signal, context)
    with naming(f"{source[1]}: {name}"):
        onto = brought_to(np.asarray(table.time), time + (origin - table.origin) / 1e9, values, gap)
    note = _own_time(name, values, onto)
    notes = (*table.notes, note, *(n for n in read.notes if signal.file is not None and n not in table.notes))
    kept = Key(signal.column, signal.index, file=signal.file)
    digest = table.sha256 if signal.file is None else _together([table.sha256, read.sha256])
    stated = {kept: read.units[key]} if key in read.units else {}
    return replace(
        table, columns={**table.columns, kept: onto}, notes=notes, sha256=digest, units={**table.units, **stated}
    )


def joined(tables: Sequence[RawTable], names: Sequence[str], gap: float) -> RawTable:
    """The tables of consecutive files as one. A file whose time begins anew follows after a gap.

    Raises InputError where a file begins before the one before it ends.
    """
    times, restarts = list[Array](), 0
    for k, table in enumerate(tables):
        time = np.arange(table.rows, dtype=float) if table.time is None else table.time
        time = time + (table.origin - tables[0].origin) / 1e9
        begun = time[np.isfinite(time)]
        ended = times[-1][np.isfinite(times[-1])] if k and table.time is not None else np.zeros(0)
        if ended.size and begun.size and begun[0] <= ended[-1]:  # it is late, for it begins anew
            own, other = (x[np.isfinite(x)] for x in (np.asarray(table.time), np.asarray(tables[k - 1].time)))
            step = float(np.median(np.diff(begun))) if begun.size > 1 else 1.0
            if table.origin != tables[k - 1].origin or own[0] > other[0] + step or own[-1] < other[0]:
                why = "the second begins before the first ends, and not anew"
                raise InputError(f"{names[k - 1]}, {names[k]}: {why}; give the files in the order of time, each once")
            time, restarts = time + float(ended[-1] - begun[0] + _APART * gap * step), restarts + 1
        times.append(time)
    notes = dict.fromkeys(note for table in tables for note in table.notes)
    anew = f"Times that begin anew, and then follow after a gap: {restarts}."
    message = f"One run of {', '.join(names)}, in this order. {anew}"
    return RawTable(
        columns={key: np.concatenate([table.columns[key] for table in tables]) for key in tables[0].columns},
        rows=sum(table.rows for table in tables),
        sha256=_together([table.sha256 for table in tables]),
        notes=(*notes, Finding("files-joined", NOTE, message, {"files": tuple(names), "restarts": restarts})),
        units=tables[0].units,
        time=None if tables[0].time is None else np.concatenate(times),
        origin=tables[0].origin,
    )


def _together(digests: Sequence[str]) -> str:
    """The SHA-256 of several digests, one after another."""
    return hashlib.sha256("".join(digests).encode()).hexdigest()


def part_of(table: RawTable, run: RunFiles, name: str) -> tuple[RawTable, str]:
    """The rows of a table that a run takes, all where it names none, and the name of that part.

    Raises InputError where there is none.
    """
    number = table.lines
    if run.rows is not None:
        word, (first, last) = "rows" if table.header is None else "lines", run.rows
        if last > number[-1]:
            expected = f"{word} between {number[0]} and {number[-1]}, as bristle inspect prints them"
            raise InputError(f"{name}: rows: got {first}-{last}; expected {expected}")
        inside, part = (number >= first) & (number <= last), f"{word} {first}-{last}"
    elif run.time is not None and table.time is not None:
        start, to = run.time.start, run.time.to
        inside = (table.time >= (-np.inf if start is None else start)) & (table.time <= (np.inf if to is None else to))
        part = " ".join(f"{word} {end:g} s" for word, end in (("from", start), ("to", to)) if end is not None)
    else:
        return table, name
    rows = int(inside.sum())
    if not rows:
        seen = np.zeros(0) if table.time is None else table.time[np.isfinite(table.time)]
        there = f", whose time goes from {seen.min():.6g} s to {seen.max():.6g} s" if seen.size else ""
        raise InputError(f"{name}: no row lies in the part {part} of the file{there}; give another range")
    message = f"Of {table.rows} rows {rows} are taken: {part}."
    note = Finding("part-taken", NOTE, message, {"rows": rows, "total": table.rows})
    cut = replace(
        table,
        columns={key: values[inside] for key, values in table.columns.items()},
        rows=rows,
        notes=(*table.notes, note),
        time=None if table.time is None else table.time[inside],
        numbers=number[inside],
    )
    return cut, f"{name} ({part})"
