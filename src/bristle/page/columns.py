"""A table as the page shows it, and as CSV: the one way in which bristle writes one, safe to open in a spreadsheet."""

import csv
import io
import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd

_FORMULA = re.compile(r"[=+\-@\t\r\n]")
"""How a text begins that a spreadsheet may run as a formula."""
_HARMLESS = re.compile(r"[+-]|[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
"""A direction, or a number."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Columns, and rows of what stands in them."""

    columns: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...]


def shown(frame: "pd.DataFrame") -> Table:
    """A frame, without the joint's name and without columns that say nothing in any row."""
    telling = [frame.empty or any(x not in ("", ()) for x in frame[c].dropna()) for c in frame]
    frame = frame.loc[:, telling].drop(columns="joint", errors="ignore")
    rows = frame.astype(object).itertuples(index=False, name=None)
    return Table(columns=tuple(map(str, frame.columns)), rows=tuple(rows))


def to_csv(frame: "pd.DataFrame", float_format: str | None = None) -> str:
    """A table as CSV.

    A text that a spreadsheet could take for a formula gets an apostrophe before it; numbers and the directions + and -
    stay.
    """
    safe = frame.rename(columns=plain)
    for k in (k for k, kind in enumerate(frame.dtypes) if getattr(kind, "kind", "O") not in "biufc"):  # no numbers
        safe.isetitem(k, [plain(x) for x in frame.iloc[:, k]])
    text: str = safe.to_csv(index=False, lineterminator="\n", float_format=float_format)
    return text


def cells(texts: Iterable[str]) -> str:
    """Texts side by side as a row of CSV has them, each as in `to_csv`; without the end of the line."""
    row = io.StringIO()
    csv.writer(row, lineterminator="").writerow(map(plain, texts))
    return row.getvalue()


def plain(value: Any) -> Any:
    """A cell that no spreadsheet runs, and whose lines end as the writer knows to quote; what is no text stays."""
    if not isinstance(value, str):
        return value
    formula = _FORMULA.match(value) and not _HARMLESS.fullmatch(value)
    return "'" * bool(formula) + value.replace("\r\n", "\n").replace("\r", "\n")
