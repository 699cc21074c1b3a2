"""Layout of a text file, from its first lines; anything may stand above its table, in lines of any width."""

import csv
import re
from collections import Counter
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from bristle.data.units import signal_unit
from bristle.errors import InputError, short

_SAMPLE, _MOST = 2**18, 3 * 2**20
"""Bytes of the sample, and its most where the lines are so long that it holds fewer than `_HEADED` of them."""
_DELIMITERS = (",", ";", "\t", "|", " ")
MAX_COLUMNS = 10_000  # most columns of a text file
MAX_LINE = 2**20  # longest line of a text file, characters
LONGEST = 300  # characters of a number; a longer cell is none
_NUMBER = re.compile(
    r"[+-]?(?:(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?|inf(?:inity)?|nan|n/?a|null)", re.IGNORECASE
)
_STAMP = re.compile(
    r"(?:\d{4}-\d\d-\d\d(?:[T ]\d\d?:\d\d.*)?|\d\d?\.\d\d?\.\d{4}(?: \d\d?:\d\d.*)?|\d\d?:\d\d:\d\d(?:[.,]\d+)?)"
)
_SEPARATOR = re.compile(r"sep=([,;\t|])", re.IGNORECASE)  # what Excel writes above a table
_BRACKETS = re.compile(r"(.*?)[\s_]*[\[(<](.*?)[\])>]\s*")
_HEADED = 3  # lines that a sample has at least, if the file has as many: a header, perhaps units, and numbers
_LOOKED_AT = 200  # lines at the end of a sample by which a delimiter, and the columns of numbers, are told
_RUN = 3  # rows of numbers in a row: fewer, above a line of names, are no table


class Layout(NamedTuple):
    """Layout of a text file."""

    delimiter: str  # one of , ; tab | or a space, which stands for any run of blanks
    names: tuple[str, ...]  # the header; empty where there is none
    width: int  # columns
    skip: int  # lines before the first row of numbers
    decimal: str
    comment: str | None
    encoding: str
    first: tuple[str, ...]  # the first row of numbers, as text; empty where there is none
    units: tuple[str, ...] = ()
    """Unit of each column that the file states, in a row below the names or in brackets behind a name; else empty."""
    blocks: bool = False  # whether each channel has two columns, its time and its value


Rows = Sequence[Sequence[str]]


def text_layout(path: Path) -> Layout:
    """Layout of a text file, from its first lines.

    The delimiter is the one that cuts most lines into the same number of columns, most of them numbers; or the one that
    a first line `sep=;` names. Raises InputError where the file is no text, or a row of numbers would be lost above the
    table.
    """
    with path.open("rb") as file:
        sample = file.read(_SAMPLE)
        while sample.count(b"\n") < _HEADED and len(sample) < _MOST and (line := file.readline(_MOST - len(sample))):
            sample += line
        whole = not file.read(1)
    encoding = "utf-16" if sample[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    if encoding != "utf-16" and b"\0" in sample:
        expected = "CSV text, or an ending that says what it is: .mat, .npz, .json, .parquet, .h5"
        raise InputError(f"is not a text file; expected {expected}")
    try:
        text = sample.decode(encoding)
    except UnicodeDecodeError as error:
        cut = not whole and error.start > len(sample) - 4
        encoding = encoding if cut or encoding == "utf-16" else "latin-1"
        text = sample.decode(encoding, errors="replace")
    lines = re.split(r"\r\n|\r|\n", text)
    if max(map(len, lines)) > MAX_LINE:
        raise InputError(f"has a line longer than {MAX_LINE} bytes; expected one row of numbers per line")
    return _layout(encoding, tuple(lines if whole else lines[:-1])[:2000])  # 2000 lines that are looked at


@lru_cache(maxsize=256)  # a log is opened several times: to draft, to choose, to read
def _layout(encoding: str, lines: tuple[str, ...]) -> Layout:
    comment = next((c for c in ("#", "%", "//") if any(line.lstrip().startswith(c) for line in lines)), None)
    commented = [bool(comment) and line.lstrip().startswith(comment or "") for line in lines]
    rows = [(i, line) for i, line in enumerate(lines) if line.strip() and not commented[i]]
    told = _SEPARATOR.fullmatch(rows[0][1].strip(' "')) if rows else None
    rows = rows[1:] if told else rows
    if not rows:
        raise InputError("holds no row of numbers; expected a log with a row per sample")
    body = [line for _, line in rows[-_LOOKED_AT:]]
    lists = any('"[' in line or '"(' in line for line in body)  # whose blanks are inside a cell
    delimiter = told[1] if told else max(_DELIMITERS[: -1 if lists else None], key=lambda d: _fitness(body, d))
    cells = [split(line, delimiter) for _, line in rows]
    start = _start(cells)
    table = cells[start:]
    first = tuple(table[0]) if table else ()
    width = _width(table or cells)
    skip = rows[start][0] if table else len(lines)
    above, numbers = cells[:start], [i + 1 for i, _ in rows[:start]]
    named, stated = _header(above, width)
    if first:
        _refuse_rows(list(zip(numbers, above, strict=True)), named, width)
    if named is None and comment:
        said = [line for line, is_comment in zip(lines[:skip], commented, strict=False) if is_comment]
        above = [split(line.lstrip().lstrip("#%/").strip(), delimiter) for line in said]
        above = [row for row in above if len(row) == len([c for c in first if c]) > 1]
        named, stated = _header(above, width)
    names = () if named is None else tuple(above[named])
    below = [_stated(cell) if cell else "" for cell in (() if stated is None else above[stated])]
    below += [""] * (len(names) - len(below))
    beside = [_BRACKETS.fullmatch(name) if len(name) <= LONGEST else None for name in names]  # `Torque [Nm]`
    within = [found[2].strip() if found and found[1].strip() else "" for found in beside]

    # a comma in numbers is their decimal sign, but between commas only in quotes, where a thousand may be meant by it
    commas = [cell for row in table for cell in row if "," in cell and cell[0] not in "[(" and not is_stamp(cell)]
    thousands = delimiter == "," and all(re.fullmatch(r"[+-]?\d{1,3}(,\d{3})+", cell) for cell in commas)
    decimal = delimiter != "," or any(is_value(cell) for cell in commas)
    return Layout(
        delimiter,
        names,
        width,
        skip,
        "," if commas and decimal and not thousands else ".",
        # pandas would take one slash for it, and cut a cell that holds one
        comment if comment != "//" else None,
        encoding,
        first,
        tuple(unit or signal_unit(text) for unit, text in zip(below, within, strict=False)),
        named is not None and _keyed(names).startswith("name"),
    )


def _start(cells: Rows) -> int:
    """The first row of the table.

    Rows like `Range,1,2` above a line of names are not part of it, unless they have a line of names above them, too.
    """
    # columns that hold a value in most rows that hold mostly values, far from the file's beginning
    last = cells[-_LOOKED_AT:]
    rows = [row for row in last if _values(row) > 0.5] or [row for row in last if _values(row) > 0]
    usual = _usual([len(row) for row in rows]) if rows else 0
    rows = [row for row in rows if len(row) == usual]
    counts = [sum(is_value(row[k]) for row in rows) for k in range(usual)]
    columns = [k for k, n in enumerate(counts) if n > len(rows) / 2] or [k for k, n in enumerate(counts) if n]

    first = next((k for k, row in enumerate(cells) if _is_row(row, columns)), len(cells))
    if first == len(cells):
        return first
    width = len(cells[first])
    runs = (k for k in range(first, len(cells) - _RUN + 1) if all(_is_row(row, columns) for row in cells[k : k + _RUN]))
    later = next(runs, first)
    between = [row for row in cells[first:later] if _is_names(row, width)]
    named = first > 0 and _is_names(cells[first - 1], width)
    return later if between and not named else first


def _is_row(row: Sequence[str], columns: Sequence[int]) -> bool:
    """Whether a row holds values in the columns of the table, its first column included."""
    cells = [row[k] for k in columns if k < len(row) and row[k]]
    return bool(cells) and is_value(cells[0]) and _values(cells) > 0.5


def _is_names(row: Sequence[str], width: int) -> bool:
    return abs(len(row) - width) <= 1 and any(row) and not any(is_value(cell) for cell in row if cell)


def _header(rows: Rows, width: int) -> tuple[int | None, int | None]:
    """The rows of names and of units.

    They stand right above the numbers or, where each channel has a block, begin with `Name` and `Unit`.
    """
    fitting = [k for k, row in enumerate(rows) if abs(len(row) - width) <= 1 and (len(row) > 1 or width == 1)]
    fitting = fitting or [k for k, row in enumerate(rows) if abs(len(row) - width) <= 1]
    block = [k for k in fitting if _keyed(rows[k]).startswith("name")]
    if block:
        return block[0], next((k for k in fitting if _keyed(rows[k]).startswith("unit")), None)
    places = set(fitting)
    for k in reversed(fitting):
        filled = [cell for cell in rows[k] if cell and cell not in {"1", "-"}]
        below = k - 1 in places and any(rows[k - 1]) and filled  # of what may be names
        if below and all(_stated(cell) or re.fullmatch(r"[\s_]*[\[(<].*[\])>]\s*", cell) for cell in filled):
            return k - 1, k
        if _is_names(rows[k], width):
            return k, None
    return (fitting[0] if fitting else None), None


def _keyed(row: Sequence[str]) -> str:
    """The word, in small letters, at the beginning of each channel's block in a row; empty where there is none."""
    keys = {cell.casefold() for cell in row[::2] if cell}
    return keys.pop() if len(keys) == 1 and len(row) >= 4 and any(row[1::2]) else ""


def _stated(cell: str) -> str:
    """The unit of a signal in a cell, in brackets or not; empty where it is none."""
    match = _BRACKETS.fullmatch(cell)
    return signal_unit(match[2].strip() if match and not match[1].strip() else cell)


def _refuse_rows(cells: Sequence[tuple[int, Sequence[str]]], named: int | None, width: int) -> None:
    """Raise InputError where a line below the names, and above the numbers, begins with a number: it was logged."""
    for line, row in cells[len(cells) if named is None else named + 1 :]:
        begins = next((is_value(cell) for cell in row if cell), False)
        if len(row) == width and begins and any(is_value(cell) and cell != "1" for cell in row if cell):
            why = f"line {line} stands between names and numbers, and is neither: {short(', '.join(row))}"
            raise InputError(f"{why}; correct or remove it")


def split(line: str, delimiter: str) -> list[str]:
    """The cells of a line, without quotes and blanks around them. Raises InputError where it is no CSV."""
    if '"' not in line and delimiter != " ":
        return [cell.strip() for cell in line.split(delimiter)]
    if delimiter == " ":
        return [cell.strip("\"'") for cell in line.split()]
    before = csv.field_size_limit()
    csv.field_size_limit(max(len(line), before))  # a line, which is no longer than `MAX_LINE`, may be one cell
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])]
    except csv.Error as error:
        raise InputError(f"is not a table of numbers ({error})") from error
    finally:
        csv.field_size_limit(before)


def _fitness(lines: Sequence[str], delimiter: str) -> tuple[float, int]:
    """How well a delimiter explains lines: the share of values in lines of the commonest width, and that width."""
    rows = [split(line, delimiter) for line in lines]
    shares = [_values(row) for row in rows]
    usual = _usual([len(row) for row, share in zip(rows, shares, strict=True) if share > 0.5] or [*map(len, rows)])
    numbers = sum(share for row, share in zip(rows, shares, strict=True) if len(row) == usual)
    return round(numbers / len(rows), 6), usual if usual > 1 else 0


def _usual(widths: Sequence[int]) -> int:
    return max(Counter(widths).items(), key=lambda item: (item[1], item[0]))[0]


def _width(rows: Rows) -> int:
    """Number of columns, with those that a delimiter at the end of a line makes.

    Raises InputError where a row has more than the others.
    """
    usual = _usual([len(row) for row in rows])
    wide = next((k for k, row in enumerate(rows) if any(row[usual:])), None)
    if wide is not None:
        got = f"row {wide + 1} has {len(rows[wide])} columns"
        raise InputError(f"its rows differ in width: {got}; expected {usual} as in the others")
    width = max(map(len, rows))
    if width > MAX_COLUMNS:
        expected = "one row per sample, and a column per signal"
        raise InputError(f"has {width} columns, over the limit of {MAX_COLUMNS}; expected {expected}")
    return width


def is_value(cell: str) -> bool:
    """Whether a cell is a number, with decimal point or comma, a date or a time of day."""
    if not 0 < len(cell) <= LONGEST:
        return False
    return bool(_NUMBER.fullmatch(cell.replace(",", ".", 1))) or is_stamp(cell)


def is_stamp(cell: str) -> bool:
    """Whether a cell looks like a date, a time of day, or both."""
    return bool(_STAMP.fullmatch(cell))


def _values(row: Sequence[str]) -> float:
    """Share of a row's cells that are values; empty cells do not count."""
    filled = [cell for cell in row if cell]
    return sum(map(is_value, filled)) / len(filled) if filled else 0.0
