"""The catalog of a fleet, a table or a pattern of paths: the file of each session of each unit.

A catalog with wrong columns or without rows is refused. A row that cannot be used is a failure of that row alone.
"""

import csv
import difflib
import io
import math
import re
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, cast

from bristle.errors import InputError, check_name, one_line, short
from bristle.questions.fleet.files import folder_of, glob_of, is_remote, joined_path, name_of, read_bytes

if TYPE_CHECKING:
    import pandas as pd

REQUIRED = ("file", "unit", "session")
CATALOG = (*REQUIRED, "joint", "type", "temperature", "load", "tags")  # columns of a catalog
LONGEST_TEXT = 400  # characters of an entry
MOST_ROWS = 2_000_000
_MOST_BYTES = 2**30
_SEPARATORS = (",", ";", "\t")
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", re.ASCII)
_COLDEST, _HOTTEST = -273.15, 5000.0  # deg C
_MOST_LOAD = 1e9  # in any unit, so that squares stay finite
_FIELD = re.compile(r"\{([^{}]*)\}")
_YEARS = (1900, 2200)


class CatalogRow(NamedTuple):
    """A row of a catalog; missing text is empty, a missing number nan."""

    file: str  # as written
    path: str  # absolute path or URL
    unit: str
    session: datetime | None  # UTC, without zone
    joint: str
    type: str
    temperature: float  # deg C
    load: float
    tags: str
    failure: str  # why it cannot be used, or empty


class _Texts(NamedTuple):
    """A catalog as text."""

    rows: list[tuple[str, ...]]  # each of the columns of `CATALOG`
    base: str  # the folder that files are relative to
    wrong: Mapping[int, str]  # rows that cannot be read, with the reason


def read_catalog(catalog: "str | Path | pd.DataFrame") -> list[CatalogRow]:
    """The rows of a catalog, equal ones once.

    A catalog is a CSV file (with comma, semicolon or tab), a Parquet file, a DataFrame, or a pattern such as
    `logs/{unit}/{session}/{type}.yaml`, whose fields match inside one part of a path; `*` and `**` as in globs. Files and
    patterns may be URLs of fsspec. Raises InputError where it cannot be read, or has wrong columns or no row.
    """
    texts, shown = _texts(catalog), str(catalog) if isinstance(catalog, str | Path) else "catalog"
    if not texts.rows:
        raise InputError(f"{shown}: holds no row; expected a row for each file of a unit's session")
    if len(texts.rows) > MOST_ROWS:
        raise InputError(f"{shown}: got {len(texts.rows)} rows; expected at most {MOST_ROWS}")
    seen, rows = set[tuple[str, ...]](), []
    for k, row in enumerate(texts.rows):
        if row not in seen or k in texts.wrong:
            seen.add(row)
            rows.append(_row(dict(zip(CATALOG, row, strict=True)), texts.base, texts.wrong.get(k, "")))
    return rows


def _texts(catalog: "str | Path | pd.DataFrame") -> _Texts:
    if not isinstance(catalog, str | Path):
        return _of_frame(catalog, "catalog", str(Path.cwd()))
    name = str(catalog)
    if is_pattern(name):
        return _of_pattern(name)
    base = folder_of(name) if is_remote(name) else str(Path(name).absolute().parent)
    try:
        data = read_bytes(name, _MOST_BYTES)
    except OSError as error:
        raise InputError(
            f"{name}: {error.strerror or error}; expected a catalog: a CSV or Parquet file, or a pattern with {{unit}} and {{session}}"
        ) from error
    if not name.lower().endswith((".parquet", ".pq")):
        return _of_csv(data, name, base)
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        frame: pd.DataFrame = pq.read_table(io.BytesIO(data)).to_pandas(ignore_metadata=True)
    except (pa.ArrowException, ValueError, OSError) as error:
        raise InputError(f"{name}: is not a readable Parquet file ({one_line(str(error), 120)})") from error
    return _of_frame(frame, name, base)


def _of_csv(data: bytes, name: str, base: str) -> _Texts:
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{name}: not text in UTF-8 (byte {error.start}); expected a catalog as CSV") from error
    head = text.partition("\n")[0]
    lines = csv.reader(io.StringIO(text, newline=""), delimiter=max(_SEPARATORS, key=head.count))
    try:
        header = [column.strip() for column in next(lines, [])]
        places = _places(header, name)
        rows, wrong = list[tuple[str, ...]](), dict[int, str]()
        for fields in lines:
            if not any(map(str.strip, fields)):
                continue
            if len(fields) > len(header):
                wrong[len(rows)] = f"got {len(fields)} fields in line {lines.line_num}; expected {len(header)}"
            rows.append(tuple(fields[k].strip() if 0 <= k < len(fields) else "" for k in places))
    except csv.Error as error:
        raise InputError(f"{name}: line {lines.line_num} cannot be read as CSV ({error})") from error
    return _Texts(rows, base, wrong)


def _places(header: Sequence[object], name: str) -> list[int]:
    """Index of each column of a catalog in a table, or -1. Raises InputError where a column is wrong."""
    columns = [str(column) for column in header]
    for column in columns:
        if column not in CATALOG:
            near = difflib.get_close_matches(column.lower()[:60], CATALOG, 1)
            hint = f"did you mean {near[0]!r}? " if near else ""
            raise InputError(f"{name}: got the column {short(column)}; {hint}expected {', '.join(CATALOG)}")
        if columns.count(column) > 1:
            raise InputError(f"{name}: got the column {short(column)} twice; expected each once")
    missing = [column for column in REQUIRED if column not in columns]
    if missing:
        raise InputError(
            f"{name}: has no column {missing[0]}; expected file, unit and session, and if they are known {', '.join(CATALOG[3:])}"
        )
    return [columns.index(column) if column in columns else -1 for column in CATALOG]


def _of_frame(frame: "pd.DataFrame", name: str, base: str) -> _Texts:
    import pandas as pd

    if not isinstance(frame, pd.DataFrame):
        raise InputError(f"catalog: got {short(frame)}; expected a path, a pattern or a DataFrame")
    places = _places(list(frame.columns), name)
    columns = [[""] * len(frame) if k < 0 else list(map(_text, frame.iloc[:, k].tolist())) for k in places]
    return _Texts(list(zip(*columns, strict=True)), base, {})


def _text(value: object) -> str:
    """An entry as text, empty where it is missing."""
    if value is None or type(value).__name__ in ("NAType", "NaTType") or value != value:  # noqa: PLR0124  # nan
        return ""
    return cast("datetime", value).isoformat() if hasattr(value, "isoformat") else str(value).strip()


def is_pattern(catalog: str) -> bool:
    """Whether a catalog is a pattern: it has braces."""
    return bool(_FIELD.search(catalog))


def _of_pattern(pattern: str) -> _Texts:
    fields = _FIELD.findall(pattern)
    odd = [field for field in fields if field not in CATALOG[1:]]
    lacking = [field for field in REQUIRED[1:] if field not in fields]
    if odd:
        near = difflib.get_close_matches(odd[0].lower()[:60], CATALOG[1:], 1)
        hint = f"did you mean {{{near[0]}}}? " if near else ""
        raise InputError(f"{pattern}: got {{{odd[0]}}}; {hint}expected {', '.join(f'{{{x}}}' for x in CATALOG[1:])}")
    if lacking:
        raise InputError(
            f"{pattern}: has no {{{lacking[0]}}}; expected a pattern such as logs/{{unit}}/{{session}}.yaml"
        )
    whole = pattern if is_remote(pattern) else str(Path(pattern).absolute())
    # As a regular expression, in which equal fields must agree.
    parts, seen = list[str](), set[str]()
    known = {"**/": "(?:.*/)?", "**": ".*", "*": "[^/]*", "?": "[^/]"}
    for token in re.split(r"(\{[^{}]*\}|\*\*/?|\*|\?)", whole):
        if token.startswith("{"):
            field = token[1:-1]
            parts.append(f"(?P={field})" if field in seen else f"(?P<{field}>[^/]+)")
            seen.add(field)
        else:
            parts.append(known.get(token, re.escape(token)))
    matching = re.compile("".join(parts))
    try:
        found = glob_of(_FIELD.sub("*", whole).replace("[", "?"))
    except OSError as error:
        raise InputError(f"{pattern}: the file search failed ({error.strerror or error}); check the path") from error
    rows = []
    before = whole.removesuffix(pattern) if whole.endswith(pattern) else ""
    for path in found:
        if match := matching.fullmatch(path):
            of = match.groupdict()
            rows.append((path.removeprefix(before), *(of.get(x, "") for x in CATALOG[1:])))
    if not rows:
        raise InputError(
            f"{pattern}: matches no file; expected a path from where you are, with {{unit}} and {{session}}"
        )
    return _Texts(rows, str(Path.cwd()), {})


def _row(texts: Mapping[str, str], base: str, wrong: str) -> CatalogRow:
    """A row, with the first reason why it cannot be used."""
    reasons = [wrong] if wrong else []
    shown = {column: _shown_text(text, column, reasons) for column, text in texts.items()}
    reasons += [f"{column}: got nothing; expected {_EXPECTED[column]}" for column in REQUIRED if not shown[column]]
    numbers = {}
    for column in ("temperature", "load"):
        try:
            numbers[column] = _number(shown[column], column)
        except InputError as error:
            numbers[column] = math.nan
            reasons.append(str(error))
    try:
        session = time_of(shown["session"]) if shown["session"] else None
    except InputError as error:
        session = None
        reasons.append(str(error))
    return CatalogRow(
        file=shown["file"], path=joined_path(base, shown["file"]), unit=shown["unit"], session=session, joint=shown["joint"],
        type=shown["type"], tags=shown["tags"], failure=one_line(next(iter(reasons), "")), **numbers,
    )  # fmt: skip  # a list of values


_EXPECTED = {
    "file": "an experiment file, or a robot's",
    "unit": "the name of the unit that it is of",
    "session": "a date or time, as 2026-05-31 or 2026-05-31T14:30+02:00",
}


def _shown_text(text: str, column: str, reasons: list[str]) -> str:
    """An entry that can be shown; what was wrong with it is added to the reasons."""
    if len(text) <= LONGEST_TEXT and text.isprintable():
        return text
    if len(text) > LONGEST_TEXT:
        reasons.append(f"{column}: got {len(text)} characters; expected at most {LONGEST_TEXT}")
    else:
        try:
            return check_name(text, f"{column}:")
        except InputError as error:
            reasons.append(str(error))
    return one_line(text, LONGEST_TEXT)


def _number(text: str, column: str) -> float:
    if not text or text.lower() in ("nan", "null", "none", "na"):
        return math.nan
    value = float(text) if _NUMBER.fullmatch(text) else math.nan
    if not math.isfinite(value):
        raise InputError(
            f"{column}: got {short(text)}; expected a number{', deg C' if column == 'temperature' else ''}, with a point"
        )
    if column == "temperature" and not _COLDEST <= value <= _HOTTEST:
        raise InputError(f"temperature: got {value:g}; expected deg C between {_COLDEST:g} and {_HOTTEST:g}")
    if abs(value) > _MOST_LOAD:
        raise InputError(f"{column}: got {value:g}; expected a number between -{_MOST_LOAD:g} and {_MOST_LOAD:g}")
    return value


def time_of(text: str) -> datetime:
    """An ISO date or time, in UTC without zone. Raises InputError where it is none."""
    try:
        when = datetime.fromisoformat(text)
        when = when.astimezone(UTC).replace(tzinfo=None) if when.tzinfo else when
    except (ValueError, OverflowError) as error:
        raise InputError(f"session: got {short(text)}; expected {_EXPECTED['session']}") from error
    if not _YEARS[0] <= when.year <= _YEARS[1]:
        raise InputError(f"session: got {short(text)}; expected a year between {_YEARS[0]} and {_YEARS[1]}")
    return when


def called(catalog: "str | Path | pd.DataFrame") -> str:
    """The name of a catalog: its file's, or the last fixed folder of a pattern."""
    if not isinstance(catalog, str | Path):
        return "catalog"
    name = str(catalog)
    if not is_pattern(name):
        return Path(name_of(name)).stem or "catalog"
    fixed = re.split(r"[{*?]", name.partition("://")[2] or name)[0].rpartition("/")[0]
    return (Path(fixed) if fixed else Path.cwd()).name or "catalog"
