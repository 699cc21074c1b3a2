"""Plain text: 80 columns for a terminal, in which no number is broken or parted from its unit, and CSV for a spreadsheet."""

import csv
import io
import re
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

from bristle.page.wording import SYMBOLS, measured, span

if TYPE_CHECKING:
    import pandas as pd

WIDTH = 80  # columns of a terminal that nobody has made wider
_SIGNS = str.maketrans({"±": "+/-", "∞": "inf", "−": "-", "·": "*", "²": "**2", "–": "-", "\N{NO-BREAK SPACE}": " "})
_INTERVAL = re.compile(r"\[[^\[\]]{1,60}\]")
_NUMBER = re.compile(  # blanks inside a number: about its error, after a comparison, before its unit
    r"(?<=[\d.]) (?=\+/-)|(?<=\+/-) (?=[\d.])|(?<=[=<>~]) (?=[-\d.])"
    r"|(?<=[\d.\])]) (?=%|1/|(?:N|A|V|J|C|s|m|ms|mm|Hz|kHz|rad|mrad|deg|kg|ohm|counts?)(?![\w-]))"
)


def pair(value: float | None, error: float | None) -> str:
    """Value +/- standard error as `measured` rounds them: 0.01942 +/- 0.00016; `none` where there is no value."""
    return "none" if value is None else measured(value, error).translate(_SIGNS)


def interval(ends: tuple[float, float] | None) -> str:
    """A 95 % interval: [0.01910, 0.01974], [12.5, inf]."""
    return "none" if ends is None else span(ends).translate(_SIGNS)


def typed(text: str) -> str:
    """Text of a page in a terminal's letters: α₀ as alpha_0, N·m as N*m, ± as +/-."""
    for name, symbol in SYMBOLS.items():
        text = text.replace(symbol, name)
    return text.translate(_SIGNS)


def in_unit(value: str, si: str) -> str:
    """A number in print with its unit, where it has one."""
    return value if si == "1" else f"{value} {si}"


def wrapped(lines: Iterable[str], width: int = WIDTH) -> Iterator[str]:
    """Lines broken at 80 columns, never inside a number, an interval or a word.

    Continued lines are indented by two more columns; a word that is longer than a line, as a path, stays whole.
    """
    for given in lines:
        line = given.replace("±", "+/-")
        if len(line) <= width:
            yield line
            continue
        held = _NUMBER.sub("\N{NO-BREAK SPACE}", line)
        held = _INTERVAL.sub(lambda found: found[0].replace(" ", "\N{NO-BREAK SPACE}"), held)
        further = " " * (len(line) - len(line.lstrip()) + 2)
        parts = textwrap.wrap(
            held, width, subsequent_indent=further, break_long_words=False, break_on_hyphens=False, expand_tabs=False
        )
        yield from (part.replace("\N{NO-BREAK SPACE}", " ") for part in parts)


def columns(rows: Sequence[Sequence[str]], indent: int = 2, width: int = WIDTH) -> Iterator[str]:
    """Rows of cells in columns, two blanks apart; cells that do not fit into the width stand whole on their own line.

    A row may have fewer cells than others.
    """
    widths = [max(map(len, cells)) for cells in zip_longest(*rows, fillvalue="")]
    for row in rows:
        line = " " * indent
        for cell, wide in zip(row, widths, strict=False):
            if len(line) + len(cell) > width and line.strip():
                yield line.rstrip()
                line = " " * (2 * indent + 2)
            line += f"{cell:<{wide}}  "
        yield line.rstrip()


_FORMULA = re.compile(r"[=+\-@\t\r\n]")  # how a text begins that a spreadsheet may run as a formula
_HARMLESS = re.compile(r"[+-]|[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")  # a direction, or a number


def to_csv(frame: "pd.DataFrame", float_format: str | None = None) -> str:
    """A table as CSV.

    A text that a spreadsheet could take for a formula gets an apostrophe before it; numbers and the directions + and -
    stay.
    """
    safe = frame.rename(columns=_harmless)
    for k in (k for k, kind in enumerate(frame.dtypes) if getattr(kind, "kind", "O") not in "biufc"):  # no numbers
        safe.isetitem(k, [_harmless(x) for x in frame.iloc[:, k]])
    text: str = safe.to_csv(index=False, lineterminator="\n", float_format=float_format)
    return text


def cells(texts: Iterable[str]) -> str:
    """A row of CSV of texts, each as in `to_csv`, without the end of the line."""
    row = io.StringIO()
    csv.writer(row, lineterminator="").writerow(map(_harmless, texts))
    return row.getvalue()


def _harmless(value: Any) -> Any:
    """A cell that no spreadsheet runs, with plain ends of lines; what is no text is returned as it is."""
    if not isinstance(value, str):
        return value
    formula = _FORMULA.match(value) and not _HARMLESS.fullmatch(value)
    return "'" * bool(formula) + value.replace("\r\n", "\n").replace("\r", "\n")
