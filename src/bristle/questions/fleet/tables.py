"""The tables of a fleet's page."""

from collections.abc import Iterator, Mapping
from math import floor, isfinite, isnan, log10
from typing import Any

import pandas as pd

from bristle.model.parameters import Direction, ParameterName
from bristle.page.said import Link, entries
from bristle.page.wording import MISSING, in_print, measured, number, pretty, shortened, span, symbol

MOST = 2000  # rows of a table on a page
_LONG = 160  # characters of a user's text on the page
_LEAST = 1e-30  # least p-value that is shown


def change(value: float, low: float, high: float) -> str:
    """A change with its interval, to the second digit of a quarter of its width: +15.2 [12.1, 18.3]."""
    if not isfinite(value):
        return MISSING
    width = high - low
    if not (isfinite(width) and width > 0 and max(abs(low), abs(high)) < 1e6):
        return f"{'+' * (value > 0)}{number(value, 3)}"
    places = min(max(1 - floor(log10(width / 4)), 0), 12)
    return f"{value:+.{places}f} [{low:.{places}f}, {high:.{places}f}]"


def estimate(value: float, low: float, high: float) -> str:
    """A value with its interval, as `change`, without a sign: 3.02 [2.91, 3.14]."""
    return change(value, low, high).removeprefix("+")


def probability(p: float) -> str:
    """A p-value in two digits, or as below `_LEAST`."""
    return MISSING if isnan(p) else f"< {_LEAST:g}" if p < _LEAST else number(p, 2)


def day(time: Any) -> str:
    """The day of a session."""
    return MISSING if pd.isna(time) else f"{time:%Y-%m-%d}"


def rows_of(frame: pd.DataFrame) -> Iterator[Any]:
    """The rows of a table, with the columns as attributes."""
    yield from frame.itertuples(index=False)


def quantity(row: Any) -> ParameterName | None:
    """The parameter and direction of a row, if it has one."""
    if pd.isna(row.parameter):
        return None
    return ParameterName(str(row.parameter), Direction(str(row.direction)))


def label(row: Any) -> str:
    """The symbol of a row's parameter, with its direction."""
    name = quantity(row)
    return MISSING if name is None else symbol(name)


def value_unit(row: Any) -> str:
    """The unit of a row's values in print."""
    return "" if row.value_unit == "1" else pretty(str(row.value_unit))


def totals(quality: pd.DataFrame) -> pd.DataFrame:
    """Warnings over all periods, the most frequent first: code, severity, joint_sessions, of, percent."""
    every = int(quality.drop_duplicates("period")["of"].sum())
    whole = quality.groupby(["code", "severity"], observed=True, as_index=False)["joint_sessions"].sum()
    whole = whole.assign(of=every, percent=100 * whole["joint_sessions"] / max(every, 1))
    there: pd.DataFrame = whole[whole["joint_sessions"] > 0]
    return there.sort_values(["joint_sessions", "code"], ascending=[False, True], ignore_index=True)


def outside_first(units: pd.DataFrame) -> pd.DataFrame:
    """The units' rows, those outside their type first, and then by distance from the type's mean."""
    far = units.assign(far=-units["z"].astype(float).abs(), within=~units["outside"].astype(bool))
    order = ["within", "far", "unit", "joint", "parameter", "direction"]
    return far.sort_values(order, kind="stable", ignore_index=True).drop(columns=["far", "within"])


def code_link(code: str) -> str | Link:
    """A code as a link to its entry, where it has one."""
    return Link(code, f"#warning-{code}") if code in entries() else code


def in_joints(joints: pd.DataFrame) -> pd.DataFrame:
    """The ranked joints."""
    return _printed({
        "Rank": row.rank, "Unit": _user(row.unit), "Joint": _user(row.joint),
        "Finding": f"{'changed' if row.changed else f'not tested: {row.untested}' if row.untested else 'no change found'}"
        + "; outside its type" * bool(row.outside),
        "Change (%) [95 %]": _whole(change(row.percent, row.percent_lower, row.percent_upper)), "Parameter": _whole(label(row)),
        "Since": day(row.since), "Adjusted p": _p(row.adjusted_p), "New warnings": tuple(map(code_link, str(row.new_warnings).split())),
        "Sessions since": None if pd.isna(row.sessions_after) else int(row.sessions_after), "Type": _user(row.type),
        "File of the latest session": _user(row.file),
    } for row in rows_of(joints.head(MOST)))  # fmt: skip  # a table


def in_steps(changes: pd.DataFrame) -> pd.DataFrame:
    """The most likely step of each parameter of a joint."""
    return _printed({
        "Parameter": _whole(label(row)), "Before": number(row.before), "After": number(row.after), "Unit of value": value_unit(row),
        "Change (%) [95 %]": _whole(change(row.percent, row.percent_lower, row.percent_upper)), "Since": day(row.since), "p": _p(row.p),
        "Changed?": bool(row.changed),
    } for row in rows_of(changes.sort_values(["parameter", "direction"])))  # fmt: skip  # a table


def in_units(units: pd.DataFrame) -> pd.DataFrame:
    """The units' values, those outside their type first."""
    return _printed({
        "Unit": _user(row.unit), "Joint": _user(row.joint), "Parameter": _whole(label(row)), "Finding": "outside" if row.outside else "not outside",
        "Own value": _whole(measured(row.value, row.standard_error)), "Shrunken value": _whole(measured(row.shrunken, row.shrunken_error)),
        "Unit of value": value_unit(row), "Borrowed (%)": number(row.borrowed_percent, 3), "From type (%)": f"{row.percent:+.3g}",
        "Adjusted p": _p(row.adjusted_p), "Sessions": row.sessions, "Type": _user(row.type),
    } for row in rows_of(outside_first(units).head(MOST)))  # fmt: skip  # a table


def in_types(types: pd.DataFrame) -> pd.DataFrame:
    """A row per type, parameter and direction."""
    return _printed({
        "Type": _user(row.type), "Parameter": _whole(label(row)), "Joints": row.joints,
        "Mean [95 %]": _whole(estimate(row.mean, row.mean_lower, row.mean_upper)), "Unit of mean": value_unit(row),
        "Between units (%)": _percent(row, "spread"), "Between sessions (%)": _percent(row, "scatter"),
        "Temperature (%/K)": _percent(row, "temperature"),
        "Common shift (%)": MISSING if pd.isna(row.shift_percent) else f"{number(row.shift_percent, 2)} (p {probability(row.shift_p)})",
        "Load (% per unit)": _percent(row, "load"), "Sessions": row.sessions,
    } for row in rows_of(types.head(MOST)))  # fmt: skip  # a table


def _percent(row: Any, name: str) -> str:
    value, low, high = (getattr(row, f"{name}_{part}") for part in ("percent", "lower", "upper"))
    write = estimate if name in {"spread", "scatter"} else change
    text = write(value, low, high)
    return _whole(text if text == MISSING or "[" in text or pd.isna(low) else f"{text} {span((low, high))}")


def in_quality(quality: pd.DataFrame) -> pd.DataFrame:
    """All warnings over all periods, the most frequent first."""
    last = quality[quality["period"] == quality["period"].max()]
    late = dict(zip(last["code"].astype(str), last["percent"], strict=True))
    meanings = {code: in_print(x.meaning) for code, x in entries().items()}
    meanings["failed"] = "The session was not identified; the reasons are listed below."
    return _printed({
        "Code": code_link(str(row.code)), "Severity": str(row.severity), "Joint-sessions": row.joint_sessions,
        "of all (%)": number(row.percent, 2), "in the last period (%)": number(late.get(str(row.code), 0.0), 2),
        "What it says": meanings.get(str(row.code), ""),
    } for row in rows_of(totals(quality)))  # fmt: skip  # a table


def in_warned(begun: pd.DataFrame) -> pd.DataFrame:
    """Warnings that began and stayed."""
    return _printed({
        "Unit": _user(row.unit), "Joint": _user(row.joint), "Code": code_link(str(row.code)), "Severity": str(row.severity),
        "Since": day(row.since), "Sessions with it": int(row.sessions), "Sessions since": int(row.of),
    } for row in rows_of(begun.head(MOST)))  # fmt: skip  # a table


def in_failures(failures: pd.DataFrame) -> pd.DataFrame:
    """Sessions without a result."""
    return _printed({
        "Unit": _user(row.unit), "Joint": _user(row.joint),
        "Session": MISSING if pd.isna(row.session) else f"{row.session:%Y-%m-%d %H:%M}",
        "What happened": shortened(str(row.failure), 2 * _LONG), "File": _user(row.file),
    } for row in rows_of(failures.head(MOST)))  # fmt: skip  # a table


def _printed(rows: Iterator[Mapping[str, Any]]) -> pd.DataFrame:
    return pd.DataFrame(list(rows), dtype=object)


def _user(text: Any) -> str:
    """A user's text without control characters, at most `_LONG` characters long."""
    return MISSING if pd.isna(text) else shortened(str(text), _LONG)


def _whole(text: str) -> str:
    """A cell without line breaks."""
    return text.replace(" ", "\N{NO-BREAK SPACE}")


def _p(p: float) -> float | str | None:
    """A p-value as a number of two digits, or as below `_LEAST`."""
    return None if isnan(p) else probability(p) if p < _LEAST else float(f"{p:.2g}")
