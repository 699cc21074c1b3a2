"""Files to columns of numbers: CSV here, MAT, NPZ and Parquet in `containers`.

Nothing is guessed about what a column means; whatever cannot be read as numbers is an error that says where.
"""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bristle.arrays import Array
from bristle.data import binary_tables
from bristle.data.columns import Key, reading
from bristle.data.layout import LONGEST, Layout, text_layout
from bristle.diagnostics import Diagnostic, Kind
from bristle.errors import InputError, check_regular, short, short_list, unreadable

if TYPE_CHECKING:
    import pandas as pd

MAX_BYTES = 2**29
"""Largest data file, bytes."""
MAX_LINE = 2**20
"""Longest line of a text file, bytes."""
_BITS = 1023
"""Of an integer; a longer one is no float."""
BINARY = {
    ".mat": binary_tables.read_mat,
    ".npz": binary_tables.read_npz,
    ".parquet": binary_tables.read_parquet,
    ".pq": binary_tables.read_parquet,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class RawTable:
    """Columns of one file, each of shape (rows,), as logged: unscaled, and possibly not finite."""

    columns: Mapping[Key, Array]
    rows: int
    sha256: str
    notes: tuple[Diagnostic, ...] = ()


def read_table(path: Path, keys: Sequence[Key], shown: str | None = None) -> RawTable:
    """The columns `keys` of a file; its suffix says which format: .mat, .npz, .parquet, and text for any other.

    Raises InputError in one sentence, opening with `shown` (or the path), where the file or a column cannot be read as numbers.
    """
    name = shown or str(path)
    notes: tuple[Diagnostic, ...] = ()
    with naming(name):
        check_regular(path, name)
        binary = path.suffix.lower() in BINARY
        digest = _digest(path, text=not binary)
        if binary:
            columns: Mapping[Key, Array] = BINARY[path.suffix.lower()](path, keys)
        else:
            columns, notes = _read_text(path, keys)
    lengths = {key: column.size for key, column in columns.items()}
    if len(set(lengths.values())) > 1:
        raise InputError(
            f"{name}: columns differ in length: {short_list(f'{k} has {n} rows' for k, n in lengths.items())}; name columns of one length"
        )
    rows = next(iter(lengths.values()), 0)
    if rows == 0 and keys:
        raise InputError(f"{name}: holds no row of numbers; expected a log with a row per sample")
    return RawTable(columns=columns, rows=rows, sha256=digest, notes=notes)


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


def _digest(path: Path, *, text: bool) -> str:
    """SHA-256 of a file, which is read once, in pieces; refuses what is too large, empty, or (as text) binary or one long line."""
    size = path.stat().st_size
    if size > MAX_BYTES:
        raise InputError(f"is {size} bytes long, over the limit of {MAX_BYTES}; cut it into several runs")
    digest, open_line = hashlib.sha256(), 0
    with path.open("rb") as file:
        for piece in iter(lambda: file.read(2**20), b""):
            digest.update(piece)
            lines = piece.replace(b"\r", b"\n").split(b"\n") if text else []
            if text and max(open_line + len(lines[0]), *map(len, lines)) > MAX_LINE:
                raise InputError(f"has a line longer than {MAX_LINE} bytes; expected one row of numbers per line")
            open_line = len(lines[-1]) + (open_line if len(lines) == 1 else 0) if text else 0
    if size == 0:
        raise InputError("the file is empty; expected a log with a row per sample")
    return digest.hexdigest()


def _read_text(path: Path, keys: Sequence[Key]) -> tuple[dict[Key, Array], tuple[Diagnostic, ...]]:
    import pandas as pd

    layout = text_layout(path)
    where = {key: _place(key, layout) for key in keys}
    if not layout.first:
        raise InputError("has a header and no row of numbers; expected a log with a row per sample")
    with path.open(encoding=layout.encoding, errors="replace") as file:
        for _ in range(layout.skip):  # as lines: a quote in the header opens nothing
            file.readline()
        with reading("table of numbers", "expected one row of numbers per line"):
            try:
                frame = pd.read_csv(
                    file,
                    sep=r"\s+" if layout.delimiter == " " else layout.delimiter,
                    header=None,
                    names=list(range(layout.width)),
                    index_col=False,
                    comment=layout.comment,
                    decimal=layout.decimal,
                    skipinitialspace=True,
                    low_memory=False,
                )
            except pd.errors.ParserError as error:
                raise InputError(
                    f"its rows differ in width: {error}; expected {layout.width} columns in every row"
                ) from error
    notes = (
        *([layout.note] if layout.note else []),
        *([Kind.DECIMAL_COMMA()] if layout.decimal == "," else []),
    )
    return {key: _numbers(frame[place], key) for key, place in where.items()}, notes


def _place(key: Key, layout: Layout) -> int:
    """Which column of the file a key names, from 0."""
    column, there = key.column, short_list(layout.names) or f"0 to {layout.width - 1}, without a header"
    if key.index is not None:
        raise InputError(
            f"column {short(column)} has an index, which only a matrix in a MAT or NPZ file needs; leave it out"
        )
    if isinstance(column, int):
        if column >= layout.width:
            raise InputError(f"no column {short(column)}; columns count from 0, and there are: {there}")
        return column
    if layout.names.count(column) != 1:
        problem = "several columns" if column in layout.names else "no column"
        advice = "; a column number is written without quotes" if column.isdigit() else ""
        raise InputError(f"{problem} named {short(column)}; there are: {there}{advice}")
    return layout.names.index(column)


def _cell(cell: object) -> object:
    """The cell; None where it is no number that a float could hold."""
    long = (isinstance(cell, str) and len(cell) > LONGEST) or (isinstance(cell, int) and cell.bit_length() > _BITS)
    return None if isinstance(cell, bool) or long else cell


def _numbers(column: "pd.Series[float]", key: Key) -> Array:
    import pandas as pd

    if column.dtype.kind in "iuf":
        return np.asarray(column, dtype=float)
    text = column.astype(object)
    numbers = pd.to_numeric(text.map(_cell), errors="coerce")
    bad = np.flatnonzero(numbers.isna() & text.notna())
    if bad.size:
        raise InputError(
            f"row {bad[0] + 1} of column {key} holds {short(text.iloc[bad[0]])}; expected a number (rows count from 1, after the header)"
        )
    return np.asarray(numbers, dtype=float)
