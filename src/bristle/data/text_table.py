"""Files to columns of numbers: text here, MAT, NPZ and Parquet in `binary_tables`.

How a text file is laid out (delimiter, header, decimal sign, comments) is read off its first lines. Nothing is guessed
about what a column means; whatever cannot be read as numbers is an error that says where.
"""

import csv
import hashlib
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, NamedTuple

import numpy as np

from bristle.arrays import Array
from bristle.data import binary_tables
from bristle.data.columns import Key, reading
from bristle.data.ros.files import is_bag
from bristle.data.ros.read import read_bag
from bristle.diagnostics import Diagnostic, Kind
from bristle.errors import InputError, check_regular, short, short_list, unreadable

if TYPE_CHECKING:
    import pandas as pd


_SAMPLE, _MOST, _LOOKED_THROUGH = 2**18, 3 * 2**20, 2**26
"""Bytes that are looked at, and where the lines are so long that these hold fewer than `_HEADED` of them."""
_DELIMITERS = (",", ";", "\t", "|", " ")
MAX_COLUMNS = 10_000
"""Most columns of a text file."""
LONGEST = 300
"""Characters of a number; a longer cell is none."""
_NUMBER = re.compile(
    r"[+-]?(?:(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?|inf(?:inity)?|nan|n/?a|null)", re.IGNORECASE
)
_HEADED = 3
"""Lines that a sample has at least, if the file has as many: a header, perhaps units, and numbers."""
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
    **dict.fromkeys((".h5", ".hdf5", ".hdf"), binary_tables.read_hdf5),
}


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
    note: Diagnostic | None = None
    """What is said of a header that is more than one line of names."""


def text_layout(path: Path) -> Layout:
    """Delimiter, header, decimal sign and comments of a text file, from its first lines.

    The delimiter is the one that cuts most lines into the same number of columns, most of them numbers. Raises
    InputError where the file is no text.
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
    fitting = [k for k, (_, row) in enumerate(cells[:start]) if abs(len(row) - width) <= 1]
    named = next((k for k in fitting if len(cells[k][1]) > 1), fitting[0] if fitting else None)
    names = None if named is None else cells[named][1]
    note = _header_note(cells[:start], named, width) if start < len(cells) else None
    if names is None and comment:
        commented = (
            split(line.lstrip().lstrip("#%/").strip(), delimiter)
            for line in reversed(lines[:skip])
            if line.lstrip().startswith(comment)
        )
        names = next((row for row in commented if len(row) == len([c for c in first if c]) > 1), None)
    ends_rows = (
        comment if comment != "//" else None
    )  # pandas would take one slash for it, and cut a cell that holds one
    return Layout(delimiter, tuple(names or ()), width, skip, decimal, ends_rows, encoding, first, note)


def _header_note(cells: Sequence[tuple[int, Sequence[str]]], named: int | None, width: int) -> Diagnostic | None:
    """What is said of lines before the first row of numbers that are more than one line of names.

    Refuses a row of data among them. Below the names nothing but units is expected, `1` among them: another number
    there is one that was logged.
    """
    for line, row in cells[len(cells) if named is None else named + 1 :]:
        if len(row) == width and any(_numeric([cell]) and cell != "1" for cell in row if cell):
            raise InputError(
                f"line {line + 1} stands between names and numbers, and is neither: {short(', '.join(row))}; correct or remove it"
            )
    if len(cells) < 2 and not any(_numeric([cell]) for _, row in cells for cell in row if cell):
        return None
    lines = tuple(Kind.HEADER_LINE(line=line + 1, text=short(", ".join(row))) for line, row in cells[:3])
    more = Kind.MORE_LINES(count=len(cells) - 3) if len(cells) > 3 else ""
    return Kind.HEADER_LINES(count=len(cells), lines=lines, more=more)


def split(line: str, delimiter: str) -> list[str]:
    """The cells of a line, without quotes and blanks around them."""
    if '"' not in line and delimiter != " ":
        return [cell.strip() for cell in line.split(delimiter)]
    if delimiter == " ":
        return [cell.strip("\"'") for cell in line.split()]
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])]
    except csv.Error as error:
        raise InputError(f"is not a table of numbers ({error})") from error


def _decode(file: IO[bytes]) -> tuple[str, list[str]]:
    sample = file.read(_SAMPLE)
    while sample.count(b"\n") < _HEADED and len(sample) < _MOST and (line := file.readline(_MOST - len(sample))):
        sample += line
    whole = not file.read(1)
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
    return max(Counter(widths).items(), key=lambda item: (item[1], item[0]))[0]


def _width(rows: Sequence[Sequence[str]]) -> int:
    """Columns, counting empty ones that a delimiter at the end of a line makes.

    Refuses a row with more than the others.
    """
    usual = _usual([len(row) for row in rows])
    wide = next((k for k, row in enumerate(rows) if any(row[usual:])), None)
    if wide is not None:
        raise InputError(
            f"its rows differ in width: row {wide + 1} has {len(rows[wide])} columns; expected {usual} as in the others"
        )
    width = max(map(len, rows))
    if width > MAX_COLUMNS:
        raise InputError(
            f"has {width} columns, over the limit of {MAX_COLUMNS}; expected one row per sample, and a column per signal"
        )
    return width


def _numeric(row: Sequence[str]) -> float:
    """Share of a row's cells that are numbers, with decimal point or comma; empty cells do not count."""
    filled = [cell for cell in row if cell]
    numbers = sum(len(cell) <= LONGEST and bool(_NUMBER.fullmatch(cell.replace(",", ".", 1))) for cell in filled)
    return numbers / len(filled) if filled else 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class RawTable:
    """Columns of one file, each of shape (rows,), as logged: unscaled, and possibly not finite."""

    columns: Mapping[Key, Array]
    rows: int
    sha256: str
    notes: tuple[Diagnostic, ...] = ()
    header: int | None = None
    """Lines of a text file before its first row of numbers; None where rows and lines do not go together."""


def read_table(path: Path, keys: Sequence[Key], shown: str | None = None) -> RawTable:
    """The columns `keys` of a file; its suffix says which format: .mat, .npz, .parquet, and text for any other.

    A ROS bag (.mcap, .db3, .bag, or a folder with metadata.yaml) is read by topic and field; the digest of a folder is
    that of its storage files, one after another.

    Raises InputError in one sentence, opening with `shown` (or the path), where the file or a column cannot be read as
    numbers.
    """
    name = shown or str(path)
    notes, header = tuple[Diagnostic, ...](), None
    with naming(name):
        columns: Mapping[Key, Array]
        if is_bag(path):
            columns, digest, notes = read_bag(path, keys)
        else:
            check_regular(path, name)
            digest = _digest(path, text=is_text(path))
            if is_text(path):
                columns, notes, header = _read_text(path, keys)
            else:
                columns = BINARY[path.suffix.lower()](path, keys)
    lengths = {key: column.size for key, column in columns.items()}
    if len(set(lengths.values())) > 1:
        raise InputError(
            f"{name}: columns differ in length: {short_list(f'{k} has {n} rows' for k, n in lengths.items())}; name columns of one length"
        )
    rows = next(iter(lengths.values()), 0)
    if rows == 0 and keys:
        raise InputError(f"{name}: holds no row of numbers; expected a log with a row per sample")
    return RawTable(columns=columns, rows=rows, sha256=digest, notes=notes, header=header)


def is_text(path: Path) -> bool:
    """Whether a data file is read as text, as its suffix says."""
    return path.suffix.lower() not in BINARY and not is_bag(path)


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
    """SHA-256 of a file, which is read once, in pieces.

    Refuses what is too large, empty, or (as text) binary or one long line.
    """
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


def _read_text(path: Path, keys: Sequence[Key]) -> tuple[dict[Key, Array], tuple[Diagnostic, ...], int | None]:
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
    columns = {key: _numbers(frame[place], key) for key, place in where.items()}
    return columns, notes, layout.skip if _line_by_line(path, layout, len(frame)) else None


def _line_by_line(path: Path, layout: Layout, rows: int) -> bool:
    """Whether each line after the header is one row of numbers, in a file that is short enough to look."""
    if path.stat().st_size > _LOOKED_THROUGH:
        return False
    with path.open(encoding=layout.encoding, errors="replace") as file:
        lines = [line.strip() for line in file]
    while lines and not lines[-1]:
        lines.pop()
    return len(lines) - layout.skip == rows and all(lines[layout.skip :])


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
    place = layout.names.index(column)
    if place >= layout.width:
        raise InputError(
            f"the header names {short(column)} as column {place + 1}, but its rows have {layout.width} columns; "
            "expected a number in every column of every row"
        )
    return place


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
