"""What the terminal shows of a fleet, and how a change, a probability and a time are written there and on the page."""

from collections.abc import Iterator, Sequence
from math import floor, isfinite, isnan, log10
from typing import TYPE_CHECKING, Any

import pandas as pd

from bristle.model.parameters import Direction, ParameterName
from bristle.page.plain import columns, pair
from bristle.page.wording import MISSING, counted, number, printable, shortened, two_digits

if TYPE_CHECKING:
    from bristle.questions.fleet.findings import Findings

MOST_CHANGED, MOST_OUTSIDE, MOST_TYPES, MOST_CODES = 20, 10, 6, 4
"""Lines of the terminal."""
_LEAST = 1e-30
"""p-values below this are shown as below it."""
_PER_TYPE = 3
"""Parameters named in a type's line."""


def text(found: "Findings") -> str:
    """The findings as plain text, lines of any length: what changed, what is outside, what a type has in common, and how good the data are."""
    lines = [
        *_changed(found),
        *_outside(found),
        *_types(found.types),
        *_quality(found),
        *_warned(found.warned),
        *_failed(found.failures),
    ]
    lines += [note.coded for note in found.notes]
    if found.notes:
        lines.append("What a code in brackets means: bristle explain CODE")
    simulated = ["SIMULATED data."] if found.simulated else []
    return "\n".join(map(printable, [str(found.headline), *simulated, *lines]))


def change(value: float, low: float, high: float) -> str:
    """A change with its interval, to the second digit of a quarter of its width: +15.2 [12.1, 18.3]; the value alone where it has none."""
    if not isfinite(value):
        return MISSING
    width = high - low
    if not (isfinite(width) and width > 0 and max(abs(low), abs(high)) < 1e6):
        return f"{'+' * (value > 0)}{number(value, 3)}"
    places = min(max(1 - floor(log10(width / 4)), 0), 12)
    return f"{value:+.{places}f} [{low:.{places}f}, {high:.{places}f}]"


def estimate(value: float, low: float, high: float) -> str:
    """The same of what is no change: 3.02 [2.91, 3.14]."""
    return change(value, low, high).removeprefix("+")


def probability(p: float) -> str:
    """A p-value in two digits, or as below the least that is shown."""
    return MISSING if isnan(p) else f"< {_LEAST:g}" if p < _LEAST else number(p, 2)


def day(time: Any) -> str:
    """The day of a session."""
    return MISSING if pd.isna(time) else f"{time:%Y-%m-%d}"


def rows_of(frame: pd.DataFrame) -> Iterator[Any]:
    """The rows of a table, each with its columns by name."""
    yield from frame.itertuples(index=False)


def quantity(row: Any) -> ParameterName | None:
    """The parameter and direction of a row; None where the row is about none."""
    if pd.isna(row.parameter):
        return None
    return ParameterName(str(row.parameter), Direction(str(row.direction)))


def totals(quality: pd.DataFrame) -> pd.DataFrame:
    """Per code over all periods, the most frequent first: code, severity, joint_sessions, of, percent.

    `of` counts the joint-sessions of the periods that have any warning.
    """
    every = int(quality.drop_duplicates("period")["of"].sum())
    whole = quality.groupby(["code", "severity"], observed=True, as_index=False)["joint_sessions"].sum()
    whole = whole.assign(of=every, percent=100 * whole["joint_sessions"] / max(every, 1))
    there: pd.DataFrame = whole[whole["joint_sessions"] > 0]
    return there.sort_values(["joint_sessions", "code"], ascending=[False, True], ignore_index=True)


def of_all(shown: int, whole: int) -> str:
    """How many of a list are shown: nothing where all are."""
    return "" if shown >= whole else f", the first {shown}"


def _changed(found: "Findings") -> Iterator[str]:
    whole = found.joints[found.joints["changed"].astype(bool)]
    rows = whole.head(MOST_CHANGED)
    if len(rows):
        yield f"Joints that changed ({len(whole)}{of_all(len(rows), len(whole))}), with 95 % interval and adjusted p:"
        yield from columns(
            [
                [
                    _name(row),
                    str(quantity(row) or ""),
                    f"{change(row.percent, row.percent_lower, row.percent_upper)} %",
                    f"since {day(row.since)}{' (1 session)' * (row.sessions_after == 1)}",
                    f"p {probability(row.adjusted_p)}",
                    *([f"new warnings: {row.new_warnings}"] if row.new_warnings else []),
                ]
                for row in rows_of(rows)
            ]
        )


def _name(row: Any) -> str:
    return " ".join(shortened(str(x), 24) for x in (row.unit, row.joint) if not pd.isna(x)) or MISSING


def outside_first(units: pd.DataFrame) -> pd.DataFrame:
    """The units' rows, those outside first, and the farthest from their type's mean first."""
    far = units.assign(far=-units["z"].astype(float).abs(), within=~units["outside"].astype(bool))
    order = ["within", "far", "unit", "joint", "parameter", "direction"]
    return far.sort_values(order, kind="stable", ignore_index=True).drop(columns=["far", "within"])


def _outside(found: "Findings") -> Iterator[str]:
    whole = outside_first(found.units[found.units["outside"].astype(bool)])
    rows = whole.head(MOST_OUTSIDE)
    if len(rows):
        yield f"Values outside their type ({len(whole)}{of_all(len(rows), len(whole))}), with adjusted p:"
        yield from columns(
            [
                [
                    _name(row),
                    str(quantity(row) or ""),
                    f"{pair(row.value, row.standard_error)} {row.value_unit}",
                    f"{row.percent:+.3g} % from type {shortened(str(row.type), 16)}",
                    f"p {probability(row.adjusted_p)}",
                ]
                for row in rows_of(rows)
            ]
        )


def _types(types: pd.DataFrame) -> Iterator[str]:
    """A line a type: common shifts, and the temperature coefficients that are not zero."""
    lines = []
    for name, rows in types.groupby("type", sort=True, observed=True):
        shifted = rows[rows["shift_percent"].notna()].sort_values("shift_percent", ascending=False, kind="stable")
        shifts = [f"{quantity(row)} up to {two_digits(row.shift_percent)} %" for row in rows_of(shifted)]
        sure = rows[(rows["temperature_lower"] > 0) | (rows["temperature_upper"] < 0)]
        sure = sure.assign(far=-sure["temperature_percent"].abs()).sort_values("far", kind="stable")
        warm = [
            f"{quantity(row)} {change(row.temperature_percent, row.temperature_lower, row.temperature_upper)} %/K"
            for row in rows_of(sure)
        ]
        parts = [*_listed("common shift", shifts), *_listed("temperature", warm)]
        if parts:
            lines.append(f"Type {shortened(str(name), 24)}: {'; '.join(parts)}.")
    yield from lines[:MOST_TYPES]
    if len(lines) > MOST_TYPES:
        yield f"{counted(len(lines) - MOST_TYPES, 'further type')}: tables/types.csv."


def _listed(what: str, found: Sequence[str]) -> list[str]:
    more = f" and {len(found) - _PER_TYPE} more" if len(found) > _PER_TYPE else ""
    return [f"{what} {', '.join(found[:_PER_TYPE])}{more}"] if found else []


def _quality(found: "Findings") -> Iterator[str]:
    whole = totals(found.quality) if len(found.quality) else found.quality
    counts = whole[whole["severity"].isin(["caution", "critical"])].head(MOST_CODES) if len(whole) else whole
    if len(counts):
        told = ", ".join(f"{row.code} {two_digits(row.percent)} %" for row in rows_of(counts))
        yield f"Data quality, percent of {whole['of'].iloc[0]} joint-sessions: {told}."


def _warned(begun: pd.DataFrame) -> Iterator[str]:
    """Where a warning began and stayed: a log or a sensor to look at."""
    rows = begun.head(MOST_OUTSIDE)
    if len(rows):
        yield f"Warnings that began and stayed ({len(begun)}{of_all(len(rows), len(begun))}):"
        yield from columns(
            [
                [
                    _name(row),
                    row.code,
                    f"since {day(row.since)}",
                    f"in {row.sessions} of {counted(int(row.of), 'session')}",
                ]
                for row in rows_of(rows)
            ]
        )


def _failed(failures: pd.DataFrame) -> Iterator[str]:
    if len(failures):
        first = next(rows_of(failures))
        when = f" of {day(first.session)}" if not pd.isna(first.session) else ""
        yield (
            f"{counted(len(failures), 'session')} failed or left out; the first: {_name(first)}{when}: "
            f"{shortened(str(first.failure), 200)}"
        )
