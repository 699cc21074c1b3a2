"""The catalog of a fleet, a table or a pattern of paths: the file of each session of each unit.

A catalog with wrong columns or without rows is refused. A row that cannot be used is a failure of that row alone.
"""

import difflib
import glob
import io
import math
import re
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, cast

from bristle.errors import InputError, check_name, one_line, read_at_most, short

if TYPE_CHECKING:
    import pandas as pd

REQUIRED = ("file", "unit", "session")
CATALOG = (*REQUIRED, "joint", "type", "temperature", "load", "tags")  # columns of a catalog
LONGEST_TEXT = 400  # characters of an entry
_MOST_BYTES = 2**30
_SEPARATORS = (",", ";", "\t")
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", re.ASCII)
_WITHIN = {"temperature": (-273.15, 5000.0), "load": (-1e9, 1e9)}  # deg C; in any unit, so that squares stay finite
_FIELD = re.compile(r"\{([^{}]*)\}")
_YEARS = (2001, 2200)  # clocks that were reset show 1970, 1980 or 2000


class CatalogRow(NamedTuple):
    """A row of a catalog; missing text is empty, a missing number nan."""

    file: str  # as written
    path: str  # absolute
    unit: str
    session: datetime | None  # UTC, without zone
    joint: str
    type: str
    temperature: float  # deg C
    load: float
    tags: str
    failure: str  # why it cannot be used, or empty


def read_catalog(catalog: "str | Path | pd.DataFrame") -> list[CatalogRow]:
    """The rows of a catalog, equal ones once.

    A catalog is a CSV file (with comma, semicolon or tab), a Parquet file, a DataFrame, or a pattern such as
    `logs/{unit}/{session}/{type}.yaml`, whose fields match inside one part of a path; `*` and `**` as in globs. Raises
    InputError where it cannot be read, or has wrong columns or no row.
    """
    import pandas as pd

    base = Path.cwd()
    if isinstance(catalog, pd.DataFrame):
        name, frame = "catalog", catalog
    elif not isinstance(catalog, str | Path):
        raise InputError(f"catalog: got {short(catalog)}; expected a path, a pattern or a DataFrame")
    elif _FIELD.search(name := str(catalog)):
        frame = _of_pattern(name)
    else:
        frame, base = _of_file(Path(catalog)), Path(catalog).absolute().parent
    whole = _with_columns(frame, name).map(_text)
    whole = whole[(whole != "").any(axis=1)].drop_duplicates()
    if whole.empty:
        raise InputError(f"{name}: holds no row; expected a row for each file of a unit's session")
    return [_row(dict(zip(CATALOG, row, strict=True)), base) for row in whole.itertuples(index=False)]


def _of_file(path: Path) -> "pd.DataFrame":
    import pandas as pd

    data = read_at_most(path, _MOST_BYTES, "a catalog: a CSV or Parquet file, or a pattern with {unit} and {session}")
    parquet = path.suffix.lower() in (".parquet", ".pq")
    try:
        if parquet:
            import pyarrow.parquet as pq

            return cast("pd.DataFrame", pq.read_table(io.BytesIO(data)).to_pandas(ignore_metadata=True))
        head = data.partition(b"\n")[0].decode("utf-8-sig")
        rows = pd.read_csv(
            io.BytesIO(data), sep=max(_SEPARATORS, key=head.count), header=None, dtype=str, keep_default_na=False,
            encoding="utf-8-sig",
        )  # fmt: skip  # a list of values
    except (ValueError, OSError) as error:  # of Arrow, too
        kind = "Parquet file" if parquet else "CSV in UTF-8"
        raise InputError(f"{path}: is not readable as {kind} ({one_line(str(error), 120)})") from error
    return rows.iloc[1:].set_axis(rows.iloc[0].to_numpy(), axis=1)


def _of_pattern(pattern: str) -> "pd.DataFrame":
    import pandas as pd

    # As a regular expression, in which equal fields must agree.
    parts, fields = list[str](), dict[str, None]()
    known = {"**/": "(?:.*/)?", "**": ".*", "*": "[^/]*", "?": "[^/]"}
    for token in re.split(r"(\{[^{}]*\}|\*\*/?|\*|\?)", pattern):
        if not token.startswith("{"):
            parts.append(known.get(token, re.escape(token)))
            continue
        field = token[1:-1]
        parts.append(f"(?P={field})" if field in fields else f"(?P<{field}>[^/]+)")
        fields[field] = None
    empty = _with_columns(pd.DataFrame(columns=["file", *fields]), pattern)
    found = sorted(glob.glob(_FIELD.sub("*", pattern.replace("[", "[[]")), recursive=True))  # noqa: PTH207  # as written
    rows = [{"file": path, **match.groupdict()} for path in found if (match := re.fullmatch("".join(parts), path))]
    if not rows:
        raise InputError(
            f"{pattern}: matches no file; expected a path from where you are, with {{unit}} and {{session}}"
        )
    return pd.DataFrame(rows, columns=empty.columns)


def _with_columns(frame: "pd.DataFrame", name: str) -> "pd.DataFrame":
    """A table with all columns of a catalog, in order. Raises InputError where a column is wrong or missing."""
    columns = [str(column).strip() for column in frame.columns]
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
    return frame.set_axis(columns, axis=1).reindex(columns=list(CATALOG))


def _text(value: object) -> str:
    """An entry as text, empty where it is missing."""
    import pandas as pd

    if pd.api.types.is_scalar(value) and pd.isna(value):  # type: ignore[call-overload]  # of any scalar
        return ""
    return cast("datetime", value).isoformat() if hasattr(value, "isoformat") else str(value).strip()


def _row(texts: Mapping[str, str], base: Path) -> CatalogRow:
    """A row, with the first reason why it cannot be used."""
    wrong, shown, numbers = list[str](), dict[str, str](), dict[str, float]()
    session = None
    for column, text in texts.items():
        shown[column] = one_line(text, LONGEST_TEXT)
        try:
            if len(text) > LONGEST_TEXT:
                raise InputError(f"{column}: got {len(text)} characters; expected at most {LONGEST_TEXT}")
            check_name(text, f"{column}:")
            if column in REQUIRED and not text:
                raise InputError(f"{column}: got nothing; expected {_EXPECTED[column]}")
            if column == "session":
                session = time_of(text)
            elif column in _WITHIN:
                numbers[column] = _number(text, column)
        except InputError as error:
            wrong.append(str(error))
    return CatalogRow(
        file=shown["file"], path=str(base / shown["file"]), unit=shown["unit"], session=session, joint=shown["joint"],
        type=shown["type"], tags=shown["tags"], failure=wrong[0] if wrong else "", **{"temperature": math.nan, "load": math.nan} | numbers,
    )  # fmt: skip  # a list of values


_EXPECTED = {
    "file": "an experiment file, or a robot's",
    "unit": "the name of the unit that it is of",
    "session": "a date or time, as 2026-05-31 or 2026-05-31T14:30+02:00",
}


def _number(text: str, column: str) -> float:
    if not text or text.lower() in ("nan", "null", "none", "na"):
        return math.nan
    value = float(text) if _NUMBER.fullmatch(text) else math.nan
    low, high = _WITHIN[column]
    if not low <= value <= high:
        unit = ", deg C," * (column == "temperature")
        raise InputError(
            f"{column}: got {short(text)}; expected a number{unit} between {low:g} and {high:g}, with a point"
        )
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
    fixed, *varying = re.split(r"[{*?]", str(catalog)) if _FIELD.search(str(catalog)) else [str(catalog)]
    path = Path(fixed.rpartition("/")[0]) if varying else Path(fixed).with_suffix("")
    return (path if path.name else Path.cwd()).name or "catalog"
