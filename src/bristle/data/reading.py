"""Files to columns of numbers: CSV here, MAT, NPZ and Parquet in `containers`.

Nothing is guessed about what a column means; whatever cannot be read as numbers is an error that says where.
"""

import csv
import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, NamedTuple

import numpy as np

from bristle.data import containers
from bristle.data.containers import Key
from bristle.data.document import check_regular, short, unreadable
from bristle.errors import InputError
from bristle.model.arrays import Array

if TYPE_CHECKING:
    import pandas as pd

MAX_BYTES = 2**29
"""Largest data file, bytes."""
MAX_LINE = 2**20
"""Longest line of a text file, bytes."""
_SAMPLE = 2**18
_DELIMITERS = (",", ";", "\t", "|", " ")
BINARY = {
    ".mat": containers.read_mat,
    ".npz": containers.read_npz,
    ".parquet": containers.read_parquet,
    ".pq": containers.read_parquet,
}
_NUMBER = re.compile(r"[+-]?(?:(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|inf(?:inity)?|nan|n/?a|null)", re.IGNORECASE)


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Columns of one file, each of shape (rows,), as logged: unscaled, and possibly not finite."""

    columns: Mapping[Key, Array]
    rows: int
    sha256: str
    notes: tuple[str, ...] = ()


class Layout(NamedTuple):
    """How a text file is laid out."""

    delimiter: str
    """One of , ; tab | or a space, which stands for any run of blanks."""
    names: tuple[str, ...]
    """The header; empty where there is none."""
    width: int
    """Columns."""
    skip: int
    """Lines before the first row of numbers."""
    decimal: str
    comment: str | None
    encoding: str
    first: tuple[str, ...]
    """The first row of numbers, as text; empty where there is none."""


def read_table(path: Path, keys: Sequence[Key], shown: str | None = None) -> Table:
    """The columns `keys` of a file; its suffix says which format: .mat, .npz, .parquet, and text for any other.

    Raises InputError in one sentence, opening with `shown` (or the path), where the file or a column cannot be read as numbers.
    """
    name = shown or str(path)
    try:
        check_regular(path, name)
        binary = path.suffix.lower() in BINARY
        digest = _digest(path, text=not binary)
        notes: tuple[str, ...] = ()
        if binary:
            columns: Mapping[Key, Array] = BINARY[path.suffix.lower()](path, keys)
        else:
            columns, notes = _read_text(path, keys)
    except OSError as error:
        raise InputError(unreadable(name, error)) from error
    except MemoryError as error:
        raise InputError(f"{name}: does not fit into memory; cut it into several runs") from error
    except ValueError as error:
        raise InputError(f"{name}: {' '.join(str(error).removeprefix(f'{name}: ').split())}") from error
    lengths = {key: column.size for key, column in columns.items()}
    if len(set(lengths.values())) > 1:
        raise InputError(
            f"{name}: columns differ in length: {', '.join(f'{k} has {n} rows' for k, n in lengths.items())}; name columns of one length"
        )
    rows = next(iter(lengths.values()), 0)
    if rows == 0 and keys:
        raise InputError(f"{name}: holds no row of numbers; expected a log with a row per sample")
    return Table(columns=columns, rows=rows, sha256=digest, notes=notes)


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


def text_layout(path: Path) -> Layout:
    """Delimiter, header, decimal sign and comments of a text file, from its first lines.

    The delimiter is the one that cuts most lines into the same number of columns, most of them numbers. Raises InputError where the file is no text.
    """
    with path.open("rb") as file:
        encoding, lines = _decode(file)
    comment = next((c for c in ("#", "%", "//") if any(line.lstrip().startswith(c) for line in lines)), None)
    rows = [
        (i, line)
        for i, line in enumerate(lines)
        if line.strip() and not (comment and line.lstrip().startswith(comment))
    ]
    if not rows:
        raise InputError("holds no row of numbers; expected a log with a row per sample")
    body = [line for _, line in rows[-200:]]
    delimiter = max(_DELIMITERS, key=lambda d: _fitness(body, d))
    cells = [(i, split(line, delimiter)) for i, line in rows]
    start = next((k for k, (_, row) in enumerate(cells) if _numeric(row) > 0.5), len(cells))
    first = tuple(cells[start][1]) if start < len(cells) else ()
    width = _width([row for _, row in cells[start:] or cells])
    skip = cells[start][0] if start < len(cells) else len(lines)
    decimal = "," if delimiter != "," and any("," in cell for _, row in cells[start:] for cell in row) else "."
    names = next((row for _, row in cells[:start] if abs(len(row) - width) <= 1), None)
    if names is None and comment:
        said = (
            split(line.lstrip().lstrip("#%/").strip(), delimiter)
            for line in reversed(lines[:skip])
            if line.lstrip().startswith(comment)
        )
        names = next((row for row in said if len(row) == len([c for c in first if c]) > 1), None)
    return Layout(delimiter, tuple(names or ()), width, skip, decimal, comment and comment[0], encoding, first)


def split(line: str, delimiter: str) -> list[str]:
    """The cells of a line, without quotes and blanks around them."""
    if delimiter == " ":
        return [cell.strip("\"'") for cell in line.split()]
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])]
    except csv.Error as error:
        raise InputError(f"is not a table of numbers ({error})") from error


def _decode(file: IO[bytes]) -> tuple[str, list[str]]:
    sample = file.read(_SAMPLE)
    whole = len(sample) < _SAMPLE
    encoding = "utf-16" if sample[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    if encoding != "utf-16" and b"\0" in sample:
        raise InputError("is not a text file; expected CSV text, or a .mat, .npz or .parquet file")
    try:
        text = sample.decode(encoding)
    except UnicodeDecodeError as error:
        cut = not whole and error.start > len(sample) - 4
        encoding = encoding if cut or encoding == "utf-16" else "latin-1"
        text = sample.decode(encoding, errors="replace")
    lines = re.split(r"\r\n|\r|\n", text)
    return encoding, lines if whole else lines[:-1]


def _fitness(lines: Sequence[str], delimiter: str) -> tuple[float, int]:
    """How well a delimiter explains lines: numbers in lines of the commonest width, as a share; then that width."""
    rows = [split(line, delimiter) for line in lines]
    widths = [len(row) for row in rows]
    usual = _usual(widths)
    numbers = sum(_numeric(row) for row in rows if len(row) == usual)
    return round(numbers / len(rows), 6), usual if usual > 1 else 0


def _usual(widths: Sequence[int]) -> int:
    return max(set(widths), key=lambda width: (widths.count(width), width))


def _width(rows: Sequence[Sequence[str]]) -> int:
    """Columns, counting empty ones that a delimiter at the end of a line makes; refuses a row with more than the others."""
    usual = _usual([len(row) for row in rows])
    wide = next((k for k, row in enumerate(rows) if any(row[usual:])), None)
    if wide is not None:
        raise InputError(
            f"its rows differ in width: row {wide + 1} has {len(rows[wide])} columns; expected {usual} as in the others"
        )
    return max(map(len, rows))


def _numeric(row: Sequence[str]) -> float:
    """Share of a row's cells that are numbers, with decimal point or comma; empty cells do not count."""
    filled = [cell for cell in row if cell]
    return sum(bool(_NUMBER.fullmatch(cell.replace(",", ".", 1))) for cell in filled) / len(filled) if filled else 0.0


def _read_text(path: Path, keys: Sequence[Key]) -> tuple[dict[Key, Array], tuple[str, ...]]:
    import pandas as pd

    layout = text_layout(path)
    where = {key: _place(key, layout) for key in keys}
    if not layout.first:
        raise InputError("has a header and no row of numbers; expected a log with a row per sample")
    try:
        frame = pd.read_csv(
            path,
            sep=r"\s+" if layout.delimiter == " " else layout.delimiter,
            header=None,
            names=list(range(layout.width)),
            index_col=False,
            skiprows=layout.skip,
            comment=layout.comment,
            decimal=layout.decimal,
            encoding=layout.encoding,
            encoding_errors="replace",
            skipinitialspace=True,
            low_memory=False,
        )
    except pd.errors.ParserError as error:
        raise InputError(f"its rows differ in width: {error}; expected {layout.width} columns in every row") from error
    notes = ("Numbers have a decimal comma.",) if layout.decimal == "," else ()
    return {key: _numbers(frame[place], key) for key, place in where.items()}, notes


def _place(key: Key, layout: Layout) -> int:
    """Which column of the file a key names, from 0."""
    column, there = key.column, ", ".join(layout.names) or f"0 to {layout.width - 1}, without a header"
    if key.index is not None:
        raise InputError(
            f"column {column!r} has an index, which only a matrix in a MAT or NPZ file needs; leave it out"
        )
    if isinstance(column, int):
        if column >= layout.width:
            raise InputError(f"no column {column}; columns count from 0, and there are: {short_list(there)}")
        return column
    if layout.names.count(column) != 1:
        problem = "several columns" if column in layout.names else "no column"
        advice = "; a column number is written without quotes" if column.isdigit() else ""
        raise InputError(f"{problem} named {column!r}; there are: {short_list(there)}{advice}")
    return layout.names.index(column)


def short_list(text: str) -> str:
    """A list as it is quoted in a sentence."""
    return text if len(text) <= 300 else text[:297] + "..."


def _numbers(column: "pd.Series[float]", key: Key) -> Array:
    import pandas as pd

    if column.dtype.kind in "iuf":
        return np.asarray(column, dtype=float)
    text = column.astype(object)
    numbers = pd.to_numeric(text.map(lambda cell: None if isinstance(cell, bool) else cell), errors="coerce")
    bad = np.flatnonzero(numbers.isna() & text.notna())
    if bad.size:
        raise InputError(
            f"row {bad[0] + 1} of column {key} holds {short(text.iloc[bad[0]])}; expected a number (rows count from 1, after the header)"
        )
    return np.asarray(numbers, dtype=float)
