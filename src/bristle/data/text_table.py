"""Files to columns of numbers, text here: nothing is guessed about what a column means, and what is no number is an error that says where."""

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
from bristle.data.ros.read import read_bag
from bristle.data.ros.storage import is_bag
from bristle.data.text_layout import LONGEST, Layout, is_stamp, text_layout
from bristle.errors import InputError, check_regular, short, short_list, unreadable
from bristle.findings import CAUTION, Finding

if TYPE_CHECKING:
    import pandas as pd


MAX_BYTES = 2**29  # largest data file, bytes
_GROUPED = re.compile(r"[+-]?\d{1,3}([.,' \u00a0\u202f])\d{3}(\1\d{3})*([.,]\d*)?")
"""A number with its thousands set apart."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RawTable:
    """Columns of one file, each of shape (rows,), as logged: unscaled, and possibly not finite."""

    columns: Mapping[Key, Array]
    rows: int
    sha256: str
    notes: tuple[Finding, ...] = ()
    header: int | None = None
    """Lines of a text file before its first row of numbers; None where rows and lines do not go together."""
    units: Mapping[Key, str] = field(default_factory=dict)
    """What a text file states as the units of columns; of those of which it states none, nothing."""
    origins: Mapping[Key, int] = field(default_factory=dict)
    """Of columns of dates the first date, ns since 1970 or midnight."""
    time: Array | None = None
    """Time of each row, s, (rows,), where it is known otherwise than by the column of time alone."""
    origin: int = 0  # since when `time` counts, ns
    numbers: NDArray[np.intp] | None = None
    """Of each row its line, or its number in the file, from 1, (rows,); None: from the first on."""


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
                raise InputError(
                    "is a folder without metadata.yaml; expected a file, or a ROS 2 bag: ros2 bag reindex writes it"
                )
            check_regular(path, name)
            text = is_text(path)
            digest = _digest(path)
            if not text and (stamps := next((key for key in keys if key.stamps), None)):
                raise InputError(
                    f"column {stamps}: unit iso is for text; expected a time in a unit such as s, ms or ns"
                )
            columns = {} if text else read_binary(path, keys)
            table = _read_text(path, keys, digest) if text else RawTable(columns=columns, rows=0, sha256=digest)
    lengths = {key: column.size for key, column in table.columns.items()}
    if len(set(lengths.values())) > 1:
        raise InputError(
            f"{name}: columns differ in length: {short_list(f'{k} has {n} rows' for k, n in lengths.items())}; name columns of one length"
        )
    rows = next(iter(lengths.values()), 0)
    if rows == 0 and keys:
        raise InputError(f"{name}: holds no row of numbers; expected a log with a row per sample")
    return replace(table, rows=rows)


Reader = Callable[[Path, Sequence[Key], str | None], RawTable]
"""What reads columns of a file: `read_table`, or what remembers."""


def is_text(path: Path) -> bool:
    """Whether a data file is read as text, as its suffix says."""
    return path.suffix.lower() not in READERS and not is_bag(path)


@contextmanager
def naming(name: str) -> Iterator[None]:
    """Around what reads a file: the sentence why it cannot be read begins with its name. Raises InputError."""
    try:
        yield
    except OSError as error:
        raise InputError(unreadable(name, error)) from error
    except MemoryError as error:
        raise InputError(f"{name}: does not fit into memory; cut it into several runs") from error
    except InputError as error:
        raise InputError(f"{name}: {str(error).removeprefix(f'{name}: ')}") from error


def _digest(path: Path) -> str:
    """SHA-256 of a file; one that is too large, or empty, is refused."""
    size = path.stat().st_size
    if size > MAX_BYTES:
        raise InputError(f"is {size} bytes long, over the limit of {MAX_BYTES}; cut it into several runs")
    if size == 0:
        raise InputError("the file is empty; expected a log with a row per sample")
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _read_text(path: Path, keys: Sequence[Key], digest: str) -> RawTable:
    import pandas as pd

    layout = text_layout(path)
    places = {key: _place(key, layout) for key in keys}
    if not layout.first:
        raise InputError("has a header and no row of numbers; expected a log with a row per sample")
    with path.open(encoding=layout.encoding, errors="replace") as file:
        for _ in range(layout.skip):  # as lines: a quote in the header opens nothing
            file.readline()
        with reading(
            f"table of numbers with {layout.width} columns in every row", "expected one row of numbers per line"
        ):
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
            raise InputError(
                f"column {key} has a time of its own, column {place - 1}, which is not that of column {times[0]}; "
                f"add time: {place - 1} to the signal"
            )
    comma = Finding("decimal-comma", CAUTION, "Numbers have a decimal comma.") if layout.decimal == "," else None
    stamps = {key: seconds_of_stamps(frame[place], str(key)) for key, place in places.items() if key.stamps}
    numbers = {
        key: _numbers(_picked(frame[place], key) if place in _of_lists(layout) else frame[place], key)
        for key, place in places.items()
        if not key.stamps
    }

    # lines and rows go together where each line after the header is one row, in a file that is short enough to look
    header = None
    if path.stat().st_size <= 2**26:
        with path.open(encoding=layout.encoding, errors="replace") as file:
            lines = [line.strip() for line in file]
        while lines and not lines[-1]:
            lines.pop()
        header = layout.skip if len(lines) - layout.skip == len(frame) and all(lines[layout.skip :]) else None
    return RawTable(
        columns={**numbers, **{key: seconds for key, (seconds, _) in stamps.items()}},
        rows=len(frame),
        sha256=digest,
        notes=tuple(filter(None, (layout.note, comma))),
        header=header,
        units={key: unit for key, place in places.items() if (unit := "".join(layout.units[place : place + 1]))},
        origins={key: origin for key, (_, origin) in stamps.items()},
    )


def _place(key: Key, layout: Layout) -> int:
    """Which column of the file a key names, from 0."""
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
        raise InputError(
            f"several columns named {key}, columns {short_list(found)}, counted from 0; write a number, as in column: {found[1]}, "
            f"or {short(f'{layout.names[found[1]]}#2')} for the second"
        )
    if not found:
        advice = "; a column number is written without quotes" if column.isdigit() else ""
        raise InputError(f"no column named {key}; there are: {there}{advice}")
    if found[0] >= layout.width:
        raise InputError(
            f"the header names {short(column)} as column {found[0] + 1}, but its rows have {layout.width} columns; "
            "expected a number in every column of every row"
        )
    return found[0]


def _named(column: str, index: int | None, layout: Layout) -> list[int]:
    """Columns that a name means, by the row of names, or else by another row above the numbers that has it once; `q#2` means the second q."""
    wanted = {column} if index is None else {f"{column}[{index}]", f"{column}_{index}", f"{column}.{index}"}
    found = [k for k, name in enumerate(layout.names) if name in wanted]
    other = (
        k for row in layout.other_names if sum(x in wanted for x in row) == 1 for k, x in enumerate(row) if x in wanted
    )
    found = found or [k for k in (next(other, None),) if k is not None]
    stem, _, number = column.rpartition("#")
    if found or index is not None or not (number.isdecimal() and len(number) < 6):
        return found
    every = [k for k, name in enumerate(layout.names) if name == stem]
    return every[int(number) - 1 : int(number)] if int(number) else []


def _of_lists(layout: Layout) -> set[int]:
    return {k for k, x in enumerate(layout.first) if x.startswith(("[", "("))}


def _picked(column: "pd.Series[Any]", key: Key) -> "pd.Series[Any]":
    """One of the numbers of lists, each in a cell, as `[1.5, 2.5]`. Raises InputError where there is none."""
    which = (key.inside() or key).index
    if which is None:
        raise InputError(
            f"column {key} holds lists, as {short(column.iloc[0])}; say which of its numbers, as in {key.column}[0]"
        )
    lists = column.astype(str).str.strip("[]() ").str.split(r"[,;\s]+", regex=True)
    picked = lists.map(lambda x: x[which] if which < len(x) else None)
    if (missing := np.flatnonzero(picked.isna())).size:
        raise InputError(
            f"row {missing[0] + 1} of column {key} holds {short(column.iloc[missing[0]])}; expected a list with a number {which}, from 0"
        )
    return picked


def _numbers(column: "pd.Series[Any]", key: Key) -> Array:
    """The numbers of a column; one that no float could hold is none."""
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
        raise InputError(
            f"row {bad[0] + 1} of column {key} holds {short(held)}; expected a number{advice} (rows count from 1, after the header)"
        )
    return np.asarray(numbers, dtype=float)
