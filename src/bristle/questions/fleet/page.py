"""The page of a fleet: one HTML file with Bokeh, its tables and its charts' numbers in it, and the tables whole as CSV beside it.

The page loads nothing, and no text of a user meets HTML or Bokeh other than as text; what must be said is read without its
script, too. Tables and charts on it are capped, so that it opens at once; the page says where.
"""

from collections.abc import Collection, Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bristle.model.parameters import Direction, ParameterName
from bristle.page.bokeh_page import bokeh_script, json_block, numbered_document, policy, script_elements
from bristle.page.entries import entries
from bristle.page.output_folder import FLEET, replace_files
from bristle.page.page import encoded, html, tables_of, versions
from bristle.page.wording import PARAMETERS, counted, pretty, symbol
from bristle.questions.fleet.figures import (
    LOOKS,
    fleet_plots,
    packed_series,
    quality_over_time,
    spreads,
)
from bristle.questions.fleet.tables import (
    FAILURES,
    HEADINGS,
    JOINTS,
    PRINTED,
    TYPES,
    UNITS,
    Name,
    csv_frames,
    failure_cells,
    joint_cells,
    packed_joints,
    packed_units,
    quality_cells,
    quantities_of,
    report_commands,
    report_folders,
    type_cells,
    unit_cells,
    warned_cells,
)
from bristle.questions.fleet.text import rows_of

if TYPE_CHECKING:
    import pandas as pd

    from bristle.questions.fleet.findings import Findings

_HERE = Path(__file__).parent
_SCRIPTS = ("fleet", "paged", "charts", "joints", "units", "quality", "start")
"""The page's own, in this order."""
_NONE: Mapping[Name, str] = {}


def write_fleet(
    found: "Findings",
    folder: Path,
    *,
    base: str = "",
    reports: Collection[Name] | None = None,
    commands: Mapping[Name, str] | None = None,
) -> Path:
    """Write `fleet_files` into a folder; returns the path of index.html. Only what bristle made there before is replaced.

    Args:
        found: the findings.
        folder: made where it does not exist.
        base: the folder that the catalog's files are relative to, for the commands that make reports.
        reports: as for `fleet_files`; None: those that are there.
        commands: as for `fleet_files`; None: those for this folder.

    Raises InputError where the folder is a file, or holds files in the way that bristle did not make, and OSError where it
    cannot be written; nothing in it is then changed.
    """
    if reports is None:
        made = report_folders(found.joints).items()
        reports = [name for name, slug in made if (folder / "reports" / slug / "index.html").is_file()]
    if commands is None:
        commands = report_commands(found.joints, str(folder), base)
    replace_files(folder, fleet_files(found, reports=reports, commands=commands), FLEET)
    return folder / "index.html"


def fleet_files(
    found: "Findings", *, reports: Collection[Name] = (), commands: Mapping[Name, str] = _NONE
) -> dict[str, bytes]:
    """index.html and tables/*.csv, by relative POSIX path. Equal arguments give equal bytes.

    Args:
        found: the findings.
        reports: unit and joint of those whose report stands below the page already, in `reports/` and the folder that
            `tables.report_folders` names; the page links to it.
        commands: by unit and joint, what makes the report of its latest session, as `tables.report_commands` gives it.
    """
    page = html("bristle.questions.fleet", "fleet.html", _context(found, reports, commands))
    return {"index.html": encoded(page), **tables_of(csv_frames(found))}


@cache
def _drawing() -> tuple[dict[str, Any], dict[str, str]]:
    """The charts, empty, as Bokeh has them, and their ids by name: the same on every page."""
    return numbered_document(fleet_plots())


def _context(found: "Findings", reports: Collection[Name], commands: Mapping[Name, str]) -> dict[str, Any]:
    """What the template names."""
    texts = {name: (_HERE / f"{name}.js").read_text(encoding="utf-8") for name in _SCRIPTS}
    scripts = script_elements({"bokeh": bokeh_script(), **texts})
    document, roots = _drawing()
    known = quantities_of(found.series, found.units)
    series, charted = packed_series(found.series, found.changes, found.joints, known)
    cells = {
        "joints": joint_cells(found.joints, commands),
        "units": unit_cells(found.units),
        "types": type_cells(found.types),
        "quality": quality_cells(found.quality),
        "warned": warned_cells(found.warned),
        "failures": failure_cells(found.failures),
    }
    counts = {
        "joints": len(found.joints),
        "tested": int(found.joints["adjusted_p"].notna().sum()),
        "changed": found.changed,
        "outside": int(found.units["outside"].astype(bool).sum()),
        **{name: len(getattr(found, name)) for name in ("units", "types", "quality", "warned", "failures")},
    }
    over_time, explained = quality_over_time(found.quality), _explained(found)
    data = {
        "document": document, "roots": roots, "quantities": _quantities(known),
        "joints": packed_joints(found.joints, reports, commands), "series": series, "charted": charted,
        "units": packed_units(found.units, known), "spreads": spreads(found.types, found.units, known),
        "quality": over_time, "looks": [look._asdict() for look in LOOKS],
        "tables": {name: cells[name] for name in ("types", "quality", "warned", "failures")}, "explained": explained,
    }  # fmt: skip  # a list of values
    return {
        **versions(None), "found": found, "data": json_block(data), "scripts": scripts, "policy": policy(scripts.values()),
        "headings": HEADINGS, "cells": {name: rows[:PRINTED] for name, rows in cells.items()}, "capped": _capped(found, charted),
        "counts": counts, "codes": [*explained], "over_time": over_time,
    }  # fmt: skip  # a list of values


def _quantities(known: "pd.DataFrame") -> list[dict[str, str]]:
    """How each parameter in a direction is called on the page, and its unit."""
    return [
        {
            "label": symbol(ParameterName(str(row.parameter), Direction(str(row.direction)))),
            "words": PARAMETERS.get(str(row.parameter), ""),
            "unit": "" if row.value_unit == "1" else pretty(str(row.value_unit)),
        }
        for row in rows_of(known)
    ]


def _explained(found: "Findings") -> dict[str, str]:
    """The severity of every code on the page that has an entry."""
    codes = {code for listed in found.joints["new_warnings"] for code in str(listed).split()}
    codes |= {*found.quality["code"].astype(str), *found.warned["code"].astype(str)}
    return {code: x.severity for code, x in entries().items() if code in codes}


def _capped(found: "Findings", charted: int) -> dict[str, str]:
    """What is said where a table or the charts on the page hold a part only."""
    rows = {"joints": JOINTS, "units": UNITS, "types": TYPES, "warned": FAILURES, "failures": FAILURES}
    said = {
        name: f"This page has the first {most} of {counted(len(getattr(found, name)), 'row')}; tables/{name}.csv has all."
        for name, most in rows.items()
        if len(getattr(found, name)) > most
    }
    if charted < len(found.joints):
        said["time"] = (
            f"Charts over time are on this page for the {charted} joints ranked first of {len(found.joints)}; "
            "tables/changes.csv and the dataset, results/, have all."
        )
    return said
