"""Columns of numbers from data files; a cell that is no number is an error that says where it is."""

import hashlib
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.data.binary_tables import READERS, read_binary
from bristle.data.columns import Key, reading, seconds_of_stamps
from bristle.data.ros.bag import is_bag
from bristle.data.ros.read import read_bag
from bristle.data.text_layout import LONGEST, Layout, is_stamp, text_layout
from bristle.errors import InputError, check_regular, short, short_list, unreadable
from bristle.findings import CAUTION, Finding

if TYPE_CHECKING:
    import pandas as pd


MAX_BYTES = 2**29  # largest data file, bytes
_GROUPED = re.compile(r"[+-]?\d{1,3}([.,' \u00a0\u202f])\d{3}(\1\d{3})*([.,]\d*)?")  # a number with separated thousands


@dataclass(frozen=True, slots=True, kw_only=True)
class RawTable:
    """Columns of one file, each of shape (rows,), as logged: unscaled, and possibly not finite."""

    columns: Mapping[Key, Array]
    rows: int
    sha256: str
    notes: tuple[Finding, ...] = ()
    header: int | None = None  # lines of a text file before its first row of numbers; None where lines are not rows
    units: Mapping[Key, str] = field(default_factory=dict)  # that a text file states
    origins: Mapping[Key, int] = field(default_factory=dict)  # first of a column of dates, ns since 1970 or midnight
    time: Array | None = None  # time of each row, s, (rows,), where more than the column of time tells it
    origin: int = 0  # of `time`, ns
    numbers: NDArray[np.intp] | None = None
    """Line, or number in the file, from 1, of each row, (rows,); None: from the first on."""

    @property
    def lines(self) -> NDArray[np.intp]:
        """Line, or number in the file, from 1, of each row, (rows,)."""
        return np.arange(1, self.rows + 1) + (self.header or 0) if self.numbers is None else self.numbers


def read_table(path: Path, keys: Sequence[Key], shown: str | None = None) -> RawTable:
    """The columns `keys` of a file; its suffix says which format, one of `READERS`, and text for any other.

    A ROS bag (.mcap, .db3, .bag, or a folder with metadata.yaml) is read by topic and field; the digest of a folder is
    that of its storage files, one after another.

    Raises InputError in one sentence, opening with `shown` (or the path), where the file or a column cannot be read as
    numbers.
    """
    name = shown or str(path)
    with naming(name):
        if is_bag(path):
            columns, digest, notes = read_bag(path, keys)
            table = RawTable(columns=columns, rows=0, sha256=digest, notes=notes)
        else:
            if path.is_dir():
                expected = "a file, or a ROS 2 bag: ros2 bag reindex writes it"
                raise InputError(f"is a folder without metadata.yaml; expected {expected}")
            check_regular(path, name)
            if (size := path.stat().st_size) > MAX_BYTES:
                raise InputError(f"is {size} bytes long, over the limit of {MAX_BYTES}; cut it into several runs")
            if size == 0:
                raise InputError("the file is empty; expected a log with a row per sample")
            with path.open("rb") as file:
                digest = hashlib.file_digest(file, "sha256").hexdigest()
            stamps = next((key for key in keys if key.stamps), None)
            if is_text(path):
                table = _read_text(path, keys, digest)
            elif stamps is None:
                table = RawTable(columns=read_binary(path, keys), rows=0, sha256=digest)
            else:
                raise InputError(f"column {stamps}: unit iso is for text; expected a unit such as s, ms or ns")
    lengths = {key: column.size for key, column in table.columns.items()}
    if len(set(lengths.values())) > 1:
        sizes = short_list(f"{key} has {n} rows" for key, n in lengths.items())
        raise InputError(f"{name}: columns differ in length: {sizes}; name columns of one length")
    rows = next(iter(lengths.values()), 0)
    if rows == 0 and keys:
        raise InputError(f"{name}: holds no row of numbers; expected a log with a row per sample")
    return replace(table, rows=rows)


Reader = Callable[[Path, Sequence[Key], str | None], RawTable]  # the type of `read_table`


def is_text(path: Path) -> bool:
    """Whether a data file is read as text."""
    return path.suffix.lower() not in READERS and not is_bag(path)


@contextmanager
def naming(name: str) -> Iterator[None]:
    """Begin the sentence of an error with the name of the file. Raises InputError."""
    try:
        yield
    except OSError as error:
        raise InputError(unreadable(name, error)) from error
    except MemoryError as error:
        raise InputError(f"{name}: does not fit into memory; cut it into several runs") from error
    except InputError as error:
        raise InputError(f"{name}: {str(error).removeprefix(f'{name}: ')}") from error


def _read_text(path: Path, keys: Sequence[Key], digest: str) -> RawTable:
    import pandas as pd

    layout = text_layout(path)
    places = {key: _place(key, layout) for key in keys}
    if not layout.first:
        raise InputError("has a header and no row of numbers; expected a log with a row per sample")
    with path.open(encoding=layout.encoding, errors="replace") as file:
        for _ in range(layout.skip):  # as lines: a quote in the header opens nothing
            file.readline()
        what = f"table of numbers with {layout.width} columns in every row"
        with reading(what, "expected one row of numbers per line"):
            frame = pd.read_csv(
                file,
                sep=r"\s+" if layout.delimiter == " " else layout.delimiter,
                header=None,
                names=list(range(layout.width)),
                index_col=False,
                comment=layout.comment,
                decimal=layout.decimal,
                dtype=dict.fromkeys((place for key, place in places.items() if key.stamps), str),
                skipinitialspace=True,
                low_memory=False,
            )
    times = [place for place in places.values() if place % 2 == 0] if layout.blocks else []
    for key, place in places.items():  # channels of a time and a value each have one time
        if len(times) == 1 and place % 2 and place - 1 != times[0] and not frame[place - 1].equals(frame[times[0]]):
            why = f"has a time of its own, column {place - 1}, which is not that of column {times[0]}"
            raise InputError(f"column {key} {why}; add time: {place - 1} to the signal")
    comma = [Finding("decimal-comma", CAUTION, "Numbers have a decimal comma.")] if layout.decimal == "," else []
    stamps = {key: seconds_of_stamps(frame[place], str(key)) for key, place in places.items() if key.stamps}
    numbers = {
        key: _numbers(_picked(frame[place], key) if place in _of_lists(layout) else frame[place], key)
        for key, place in places.items()
        if not key.stamps
    }

    # lines and rows go together where each line after the header is one row, in a file that is short enough to look
    header = None
    if path.stat().st_size <= 2**26:
        lines = path.read_text(encoding=layout.encoding, errors="replace").rstrip().split("\n")[layout.skip :]
        header = layout.skip if len(lines) == len(frame) and all(map(str.strip, lines)) else None
    return RawTable(
        columns={**numbers, **{key: seconds for key, (seconds, _) in stamps.items()}},
        rows=len(frame),
        sha256=digest,
        notes=tuple(comma),
        header=header,
        units={key: unit for key, place in places.items() if (unit := "".join(layout.units[place : place + 1]))},
        origins={key: origin for key, (_, origin) in stamps.items()},
    )


def _place(key: Key, layout: Layout) -> int:
    """The column of the file that a key names, from 0."""
    there = short_list(layout.names) or f"0 to {layout.width - 1}, without a header"
    if (inside := key.inside()) is not None and key.column not in layout.names:
        key = inside
    column = key.column
    if isinstance(column, int):
        if column >= layout.width or key.index is not None:
            why = "an index needs the name of an array" if column < layout.width else "columns count from 0"
            raise InputError(f"no column {key}; {why}, and there are: {there}")
        return column
    found = _named(column, key.index, layout)
    if not found and key.index is not None:
        found = [k for k in _named(column, None, layout) if k in _of_lists(layout)]
    if len(found) > 1:
        several = f"several columns named {key}, columns {short_list(found)}, counted from 0"
        raise InputError(f"{several}; write a number, as in column: {found[1]}")
    if not found:
        advice = "; a column number is written without quotes" if column.isdigit() else ""
        raise InputError(f"no column named {key}; there are: {there}{advice}")
    if found[0] >= layout.width:
        why = f"the header names {short(column)} as column {found[0] + 1}, but its rows have {layout.width} columns"
        raise InputError(f"{why}; expected a number in every column of every row")
    return found[0]


def _named(column: str, index: int | None, layout: Layout) -> list[int]:
    """The columns of a name."""
    wanted = {column} if index is None else {f"{column}[{index}]", f"{column}_{index}", f"{column}.{index}"}
    return [k for k, name in enumerate(layout.names) if name in wanted]


def _of_lists(layout: Layout) -> set[int]:
    return {k for k, x in enumerate(layout.first) if x.startswith(("[", "("))}


def _picked(column: "pd.Series[Any]", key: Key) -> "pd.Series[Any]":
    """One number of the lists in cells such as `[1.5, 2.5]`. Raises InputError where there is none."""
    which = (key.inside() or key).index
    if which is None:
        remedy = f"say which of its numbers, as in {key.column}[0]"
        raise InputError(f"column {key} holds lists, as {short(column.iloc[0])}; {remedy}")
    lists = column.astype(str).str.strip("[]() ").str.split(r"[,;\s]+", regex=True)
    picked = lists.map(lambda x: x[which] if which < len(x) else None)
    if (missing := np.flatnonzero(picked.isna())).size:
        got = f"row {missing[0] + 1} of column {key} holds {short(column.iloc[missing[0]])}"
        raise InputError(f"{got}; expected a list with a number {which}, from 0")
    return picked


def _numbers(column: "pd.Series[Any]", key: Key) -> Array:
    """The numbers of a column. Raises InputError where a cell is none, or too large for a float."""
    import pandas as pd

    if column.dtype.kind in "iuf":
        return np.asarray(column, dtype=float)
    text = column.astype(object)
    # 1023 of an integer; a longer one is no float
    long = (len(x) > LONGEST if isinstance(x, str) else isinstance(x, int) and x.bit_length() > 1023 for x in text)
    none = np.fromiter((is_long or isinstance(x, bool) for is_long, x in zip(long, text, strict=True)), bool, text.size)
    numbers = pd.to_numeric(text.mask(none), errors="coerce")
    bad = np.flatnonzero(numbers.isna() & text.notna())
    if bad.size:
        held, advice = text.iloc[bad[0]], ""
        if isinstance(held, str) and len(held) <= LONGEST:  # it is nearly a number
            if _GROUPED.fullmatch(held):
                advice = " without separators of thousands, which the log is exported with"
            elif is_stamp(held):
                advice = ", and a column of dates or times of day has unit: iso"
        got = f"row {bad[0] + 1} of column {key} holds {short(held)}"
        raise InputError(f"{got}; expected a number{advice} (rows count from 1, after the header)")
    return np.asarray(numbers, dtype=float)
