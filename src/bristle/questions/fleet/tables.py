"""The tables of a fleet: as CSV files whole, and as the page has them, packed for its script and in print for who has none."""

import shlex
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd

from bristle.page.bokeh_page import packed
from bristle.page.entries import entries
from bristle.page.wording import MISSING, in_print, measured, number, pretty, printable, shortened, slugs, span, symbol
from bristle.questions.fleet.files import joined_path
from bristle.questions.fleet.text import (
    change,
    day,
    estimate,
    outside_first,
    probability,
    quantity,
    rows_of,
    totals,
)

if TYPE_CHECKING:
    from bristle.questions.fleet.findings import Findings

JOINTS, UNITS, TYPES, FAILURES = 1500, 10_000, 2000, 1000
"""Rows of a table on the page, at most."""
PRINTED = 20
"""Rows that stand in the page without its script: those of one page of a table."""
_LONG = 160
"""Characters of a text of a user on the page."""
Name = tuple[str, str]
"""Unit and joint."""


class Column(NamedTuple):
    """One column of a table on the page."""

    heading: str
    kind: str = ""
    """Class of the style sheet: n, a number; name, a user's; text, a sentence."""


HEADINGS: Mapping[str, tuple[Column, ...]] = {
    "joints": (
        Column("Rank", "n"), Column("Unit", "name"), Column("Joint", "name"), Column("Finding", "text"), Column("Change (%) [95 %]", "n"),
        Column("Parameter", "s"), Column("Since", "s"), Column("Adjusted p", "n"), Column("New warnings", "text"), Column("Report", "s"),
        Column("Sessions since", "n"), Column("Type", "name"),
    ),
    "units": (
        Column("Unit", "name"), Column("Joint", "name"), Column("Parameter", "s"), Column("Finding", "s"), Column("Own value", "n"),
        Column("Shrunken value", "n"), Column("Unit of value", "s"), Column("Borrowed (%)", "n"), Column("From type (%)", "n"),
        Column("Adjusted p", "n"), Column("Sessions", "n"), Column("Type", "name"),
    ),
    "types": (
        Column("Type", "name"), Column("Parameter", "s"), Column("Joints", "n"), Column("Mean [95 %]", "n"), Column("Unit of mean", "s"),
        Column("Between units (%)", "n"), Column("Between sessions (%)", "n"), Column("Temperature (%/K)", "n"), Column("Common shift (%)", "n"),
        Column("Load (% per unit)", "n"), Column("Sessions", "n"),
    ),
    "quality": (
        Column("Code", "s"), Column("Severity", "s"), Column("Joint-sessions", "n"), Column("of all (%)", "n"), Column("in the last period (%)", "n"),
        Column("What it says", "text long"),
    ),
    "warned": (
        Column("Unit", "name"), Column("Joint", "name"), Column("Code", "s"), Column("Severity", "s"), Column("Since", "s"),
        Column("Sessions with it", "n"), Column("Sessions since", "n"),
    ),
    "failures": (
        Column("Unit", "name"), Column("Joint", "name"), Column("Session", "s"), Column("What happened", "text long"), Column("File", "name file"),
    ),
}  # fmt: skip  # a table
"""What each table on the page has, from left to right; the script fills the same columns."""


def csv_frames(found: "Findings") -> dict[str, pd.DataFrame]:
    """Every table whole, by the name of its file."""
    return {
        "joints": found.joints,
        "changes": found.changes,
        "units": outside_first(found.units),
        "types": found.types,
        "quality": found.quality,
        "warned": found.warned,
        "failures": found.failures,
    }


def report_folders(joints: pd.DataFrame) -> dict[Name, str]:
    """By unit and joint the folder below `reports/` that a report of its latest session belongs in: a slug with the session's time.

    Joints of a unit that are in one file, as those of a robot, are in one report.
    """
    rows = joints.sort_values(["unit", "joint"], kind="stable")
    names = [(str(row.unit), str(row.joint)) for row in rows_of(rows)]
    files = list(zip(rows["unit"].astype(str), rows["file"].astype(str), rows["latest"], strict=True))
    count = Counter(files)
    asked = [
        unit if file[1] and count[file] > 1 else f"{unit} {joint}"
        for (unit, joint), file in zip(names, files, strict=True)
    ]
    every = list(dict.fromkeys(asked))
    slug = dict(zip(every, slugs(every), strict=True))
    return {
        name: slug[said] if pd.isna(time) else f"{slug[said]}-{time:%Y-%m-%d-%H%M}"
        for name, said, (_, _, time) in zip(names, asked, files, strict=True)
    }


def report_commands(joints: pd.DataFrame, output: str, base: str = "") -> dict[Name, str]:
    """By unit and joint the command that makes the report of its latest session, for a POSIX shell, below a fleet's output folder.

    There is none of a file behind a URL, which a report does not read; a name that begins with a hyphen gets ./ before it.

    Args:
        joints: of the findings.
        output: the folder of the page.
        base: the folder that the catalog's files are relative to.
    """
    folders, below = report_folders(joints), output.rstrip("/")
    files = {(str(row.unit), str(row.joint)): joined_path(base, str(row.file)) for row in rows_of(joints) if row.file}
    return {
        name: f"bristle report {shlex.quote(_no_option(file))} -o {shlex.quote(f'{_no_option(below)}/reports/{folders[name]}')}"
        for name, file in files.items()
        if "://" not in file
    }


def _no_option(path: str) -> str:
    return f"./{path}" if path.startswith("-") else path


def quantities_of(*frames: pd.DataFrame) -> pd.DataFrame:
    """Every parameter, direction and unit of values in these tables once, sorted: parameter, direction, value_unit."""
    names = ["parameter", "direction", "value_unit"]
    parts = [frame[names].drop_duplicates().astype(str) for frame in frames]
    return pd.concat(parts).drop_duplicates().sort_values(names, ignore_index=True)


def codes_in(frame: pd.DataFrame, known: pd.DataFrame) -> "np.ndarray[tuple[int], np.dtype[np.intp]]":
    """Which of `quantities_of` each row of a table is about, from 0; -1: none."""
    names = ["parameter", "direction", "value_unit"]
    rows = pd.MultiIndex.from_frame(frame[names].astype(object).where(frame[names].notna(), "").astype(str))
    return pd.MultiIndex.from_frame(known[names].astype(str)).get_indexer(rows).astype(np.intp)


def label(row: Any) -> str:
    """A row's parameter as the paper writes it, with its direction; a dash where the row is about none."""
    name = quantity(row)
    return MISSING if name is None else symbol(name)


def packed_joints(
    joints: pd.DataFrame, reports: Collection[Name], commands: Mapping[Name, str]
) -> dict[str, dict[str, Any]]:
    """The ranked joints as the page's script has them, the first of them."""
    rows = joints.head(JOINTS)
    names = [(str(unit), str(joint)) for unit, joint in zip(rows["unit"], rows["joint"], strict=True)]
    made, folders = set(reports), report_folders(joints)
    columns = {
        **{name: _texts(rows[name]) for name in ("unit", "joint", "type", "untested")},
        **{
            name: rows[name].astype(float)
            for name in (
                "rank",
                "sessions",
                "adjusted_p",
                "percent",
                "percent_lower",
                "percent_upper",
                "sessions_after",
            )
        },
        "changed": rows["changed"].astype(bool),
        "outside": rows["outside"].astype(bool),
        "label": _of([label(row) for row in rows_of(rows)]),
        "since": rows["since"].astype("datetime64[us]"),
        "first": rows["first"].astype("datetime64[us]"),
        "latest": rows["latest"].astype("datetime64[us]"),
        "warned": rows["new_warnings"],
        "link": _of([f"reports/{folders[name]}/index.html" if name in made else "" for name in names]),
        "command": _of([printable(commands.get(name, "")) for name in names]),
    }
    return {name: packed(column) for name, column in columns.items()}


def packed_units(units: pd.DataFrame, known: pd.DataFrame) -> dict[str, dict[str, Any]]:
    """The units' values, those outside first, as the page's script has them."""
    rows = outside_first(units).head(UNITS)
    numbers = (
        "sessions",
        "value",
        "standard_error",
        "percent",
        "adjusted_p",
        "shrunken",
        "shrunken_error",
        "borrowed_percent",
    )
    columns = {
        **{name: _texts(rows[name]) for name in ("unit", "joint", "type")},
        **{name: rows[name].astype(float) for name in numbers},
        "outside": rows["outside"].astype(bool),
        "quantity": pd.Series(codes_in(rows, known).astype(float)),
    }
    return {name: packed(column) for name, column in columns.items()}


def _of(values: Sequence[Any]) -> pd.Series:
    return pd.Series(values, dtype=object)


def _texts(column: pd.Series, most: int = _LONG) -> pd.Series:
    """Texts of users without control characters, and not too long for a cell."""
    return _of([shortened(str(x), most) for x in column.astype(object).where(column.notna(), "")])


def joint_cells(joints: pd.DataFrame, commands: Mapping[Name, str]) -> list[list[str]]:
    """The first rows of the joints in print."""
    return [
        [
            str(row.rank), shortened(str(row.unit), _LONG), shortened(str(row.joint), _LONG), finding(row),
            change(row.percent, row.percent_lower, row.percent_upper), label(row), day(row.since), probability(row.adjusted_p),
            str(row.new_warnings).replace(" ", ", "), printable(commands.get((str(row.unit), str(row.joint)), "")),
            number(row.sessions_after), shortened(str(row.type), _LONG),
        ]
        for row in rows_of(joints.head(PRINTED))
    ]  # fmt: skip  # a table


def finding(row: Any) -> str:
    """What was found of a joint, in a word or two."""
    said = "changed" if row.changed else f"not tested: {row.untested}" if row.untested else "no change found"
    return f"{said}; outside its type" if row.outside else said


def unit_cells(units: pd.DataFrame) -> list[list[str]]:
    """The first rows of the units in print."""
    return [
        [
            shortened(str(row.unit), _LONG), shortened(str(row.joint), _LONG), label(row), "outside" if row.outside else "not outside",
            measured(row.value, row.standard_error), measured(row.shrunken, row.shrunken_error), _unit(row),
            number(row.borrowed_percent, 3), f"{row.percent:+.3g}", probability(row.adjusted_p), str(row.sessions),
            shortened(str(row.type), _LONG),
        ]
        for row in rows_of(outside_first(units).head(PRINTED))
    ]  # fmt: skip  # a table


def type_cells(types: pd.DataFrame) -> list[list[str]]:
    """The types in print, the first of them."""
    return [
        [
            shortened(str(row.type), _LONG), label(row), str(row.joints), estimate(row.mean, row.mean_lower, row.mean_upper), _unit(row),
            *(_percent(row, name) for name in ("spread", "scatter", "temperature")),
            MISSING if pd.isna(row.shift_percent) else f"{number(row.shift_percent, 2)} (p {probability(row.shift_p)})",
            _percent(row, "load"), str(row.sessions),
        ]
        for row in rows_of(types.head(TYPES))
    ]  # fmt: skip  # a table


def _unit(row: Any) -> str:
    return "" if row.value_unit == "1" else pretty(str(row.value_unit))


def _percent(row: Any, name: str) -> str:
    value, low, high = (getattr(row, f"{name}_{part}") for part in ("percent", "lower", "upper"))
    write = estimate if name in {"spread", "scatter"} else change
    text = write(value, low, high)
    return text if text == MISSING or "[" in text or pd.isna(low) else f"{text} {span((low, high))}"


def quality_cells(quality: pd.DataFrame) -> list[list[str]]:
    """Every kind of warning over all periods, the most frequent first, in print."""
    if quality.empty:
        return []
    last = quality[quality["period"] == quality["period"].max()]
    late = dict(zip(last["code"].astype(str), last["percent"], strict=True))
    return [
        [
            str(row.code), str(row.severity), str(row.joint_sessions), number(row.percent, 2), number(late.get(str(row.code), 0.0), 2),
            sentence_of(str(row.code)),
        ]
        for row in rows_of(totals(quality))
    ]  # fmt: skip  # a table


def sentence_of(code: str) -> str:
    """What a code says, with a dash for every number."""
    if code == "failed":
        return "The session was not identified; the reasons are listed below."
    known = entries().get(code)
    return in_print(known.meaning) if known else ""


def warned_cells(begun: pd.DataFrame) -> list[list[str]]:
    """Warnings that began and stayed, in print, the first of them."""
    return [
        [
            shortened(str(row.unit), _LONG), shortened(str(row.joint), _LONG), str(row.code), str(row.severity), day(row.since),
            str(row.sessions), str(row.of),
        ]
        for row in rows_of(begun.head(FAILURES))
    ]  # fmt: skip  # a table


def failure_cells(failures: pd.DataFrame) -> list[list[str]]:
    """The failures in print, the first of them."""
    return [
        [
            *(MISSING if pd.isna(x) else shortened(str(x), _LONG) for x in (row.unit, row.joint)), time(row.session),
            shortened(str(row.failure), 2 * _LONG), shortened(str(row.file), _LONG),
        ]
        for row in rows_of(failures.head(FAILURES))
    ]  # fmt: skip  # a table


def time(session: Any) -> str:
    """When a session was, to the minute."""
    return MISSING if pd.isna(session) else f"{session:%Y-%m-%d %H:%M}"
