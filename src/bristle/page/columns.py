"""Tables as CSV, safe to open in a spreadsheet."""

import csv
import io
import re
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd

_FORMULA = re.compile(r"[=+\-@\t\r\n]")  # how a text begins that a spreadsheet may run as a formula
_HARMLESS = re.compile(r"[+-]|[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")  # a direction, or a number


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
    """A row of CSV of texts, each as in `to_csv`, without the end of the line."""
    row = io.StringIO()
    csv.writer(row, lineterminator="").writerow(map(plain, texts))
    return row.getvalue()


def plain(value: Any) -> Any:
    """A cell that no spreadsheet runs, with plain ends of lines; what is no text is returned as it is."""
    if not isinstance(value, str):
        return value
    formula = _FORMULA.match(value) and not _HARMLESS.fullmatch(value)
    return "'" * bool(formula) + value.replace("\r\n", "\n").replace("\r", "\n")
