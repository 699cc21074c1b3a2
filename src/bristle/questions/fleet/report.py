"""The report of a fleet: joints that changed, units that differ from their type, and data quality."""

from collections.abc import Iterator
from functools import partial
from typing import Any

import pandas as pd

from bristle.page.output_folder import FLEET
from bristle.page.page import Drawing
from bristle.page.plain import columns, pair
from bristle.page.report import Page, Report, Section, Table
from bristle.page.said import Link, Said
from bristle.page.wording import MISSING, PARAMETERS, counted, number, shortened, two_digits
from bristle.questions.fleet import figures, tables
from bristle.questions.fleet.findings import Findings
from bristle.questions.fleet.tables import change, day, label, probability, quantity, rows_of, value_unit

_DRAWN = 30  # most joints with a figure
_LEAST_DRAWN = 3  # least joints with a figure, whether they changed or not
_PANELS = 4  # parameters in a figure
_MOST_CHANGED, _MOST_OUTSIDE, _MOST_CODES = 20, 10, 4  # lines of the terminal


def report(found: Findings) -> Report:
    """The headline, the joints that changed, then pages of units and of data quality; the terminal has short lists."""
    tested, outside = int(found.joints["adjusted_p"].notna().sum()), int(found.units["outside"].sum())
    simulated = ("SIMULATED data.",) if found.simulated else ()
    units = f"{outside} of {counted(len(found.units), 'value')} are outside their type."
    lost = f"{counted(len(found.failures), 'session')} failed."
    warned = f"{counted(len(found.warned), 'warning')} began and stayed."
    joints = Section(
        "Which joints changed",
        text=f"{found.changed} of {tested} joints that could be tested changed. Each joint is compared with its own first sessions, the "
        f"first {found.baseline} at least. A session with the tag baseline, written in the catalog once a change is seen to, begins them "
        f"anew. Joints are ranked by the adjusted p-value, at a false discovery rate of {100 * found.rate:g} % over all joints. "
        "Temperature, load and shifts common to the type are taken off.",
        table=_table("joints", "Joints, by rank", found.joints, tables.in_joints(found.joints)),
        lines=(),
    )
    of_units = (
        Section(
            "Which units differ from their type",
            text=f"{outside} of {len(found.units)} values are outside their type. The shrunken value is the own one drawn to the "
            "type's mean as far as it is uncertain; borrowed: the share of the mean in it. Of a joint that changed, these are its "
            "sessions before the change.",
            table=_table(
                "units", "Values of units, those outside their type first", found.units, tables.in_units(found.units)
            ),
        ),
        Section(
            "Types",
            text="Per type, parameter and direction: the mean of its units; their scatter about it, between units; the scatter of one joint "
            "between sessions; and what temperature and load do, each with its 95 % interval. A common shift, the largest over time, is "
            "taken off all joints of the type.",
            table=_table("types", "Types, parameters and directions", found.types, tables.in_types(found.types)),
        ),
    )
    return Report(
        "Friction of a fleet",
        (
            Section("", findings=(found.headline,), lines=(str(found.headline), *simulated)),
            Section(
                "In short",
                findings=found.notes,
                coded=True,
                facts=(
                    ("Units", (units, Link("Units and types", "units.html"))),
                    ("Data", (warned, lost, Link("Data quality", "quality.html"))),
                ),
                lines=tuple(_lines(found)),
            ),
            joints,
            *_drawn_joints(found),
        ),
        about=f"{counted(len(found.joints), 'joint')} over their sessions.",
        pages=(
            Page("units.html", "Units and types", "which units differ from their type", of_units),
            Page("quality.html", "Data quality", "warnings and failures over time", tuple(_quality_sections(found))),
        ),
        simulated="At least one session was not measured but simulated." if found.simulated else "",
        tables={
            "joints": found.joints, "changes": found.changes, "units": tables.outside_first(found.units), "types": found.types,
            "quality": found.quality, "warned": found.warned, "failures": found.failures,
        },
        beside=FLEET,
    )  # fmt: skip  # a table


def _table(name: str, title: str, whole: pd.DataFrame, printed: pd.DataFrame) -> Table:
    cut = f"This page has the first {tables.MOST} of {counted(len(whole), 'row')}; tables/{name}.csv has all."
    return Table(name, title, part=printed, note=cut * (len(whole) > tables.MOST))


def _drawn_joints(found: Findings) -> Iterator[Section]:
    """The joints that changed, which are ranked first, each with its figure."""
    chosen = found.joints.head(min(max(found.changed, _LEAST_DRAWN), _DRAWN))
    series, changes = (
        frame[frame["unit"].isin(chosen["unit"]) & frame["joint"].isin(chosen["joint"])]
        for frame in (found.series, found.changes)
    )
    for row in rows_of(chosen):
        own, steps = (x[(x["unit"] == row.unit) & (x["joint"] == row.joint)] for x in (series, changes))
        yield _joint(found, row, own, steps)
    if found.changed > _DRAWN:
        text = f"Figures show the first {_DRAWN} of the {found.changed} joints that changed; tables/changes.csv and the dataset have all."
        yield Section("Further joints", text=text, form="part", lines=())


def _joint(found: Findings, row: Any, series: pd.DataFrame, steps: pd.DataFrame) -> Section:
    """One joint: its finding, its clearest parameters over its sessions, and the steps of all."""
    own_type = "" if row.type == row.joint else f" of type {row.type}"
    anew = len(series) and series["session"].min() < row.first
    sessions = counted(int(row.sessions), "session")
    sessions += f" since its baseline began anew on {day(row.first)}" if anew else ""
    size = f"{label(row)} by {change(row.percent, row.percent_lower, row.percent_upper)} % since {day(row.since)}"
    if row.untested:
        said = f"{sessions}. Not tested for a change: {row.untested}."
    elif row.changed:
        said = f"{sessions}, {number(row.sessions_after)} of them since the change. Changed: {size}, adjusted p {probability(row.adjusted_p)}."
    else:
        likely = f"the most likely step is {size}, adjusted p {probability(row.adjusted_p)}"
        said = f"{sessions}. No change is named; {likely}."
    text: tuple[Said, ...] = (said,)
    if row.new_warnings:
        codes = map(tables.code_link, str(row.new_warnings).split())
        wear = "They point at the log, its sensors or its sampling, and not at wear"
        text = (said, "Warnings that begin with the step:", *codes, "–", f"{wear}: look at the session's report first.")
    name = shortened(f"{row.unit} {row.joint}")
    return Section(
        f"{shortened(str(row.unit))}, joint {shortened(str(row.joint))}{shortened(own_type)}",
        text=text,
        facts=((f"File of its latest session, {day(row.latest)}", shortened(str(row.file))),) if row.file else (),
        figure=_course(found, row, series, steps) if len(series) else None,
        table=Table("changes", f"All parameters of {name}: the most likely step of each", part=tables.in_steps(steps)),
        form="part" if row.changed else "folded",
        lines=(),
    )


def _course(found: Findings, row: Any, series: pd.DataFrame, steps: pd.DataFrame) -> Drawing:
    """The figure of one joint: the parameters that changed, or the one with the clearest step."""
    tested = {(str(x.parameter), str(x.direction)): x for x in rows_of(steps.sort_values("p", kind="stable"))}
    of_quantity = {
        (str(key[0]), str(key[1])): rows.sort_values("session", kind="stable")
        for key, rows in series.groupby(["parameter", "direction"], observed=True)
    }
    ranked = [key for key in tested if key in of_quantity] or list(of_quantity)[:1]
    shown = [key for key in ranked if key in tested and tested[key].changed][:_PANELS] or ranked[:1]
    drawn = [(of_quantity[key], tested.get(key)) for key in shown]
    courses = []
    for rows, step in drawn:
        one = next(rows_of(rows))
        axis = f"{label(one)} ({value_unit(one)})" if value_unit(one) else label(one)
        courses.append(
            figures.Course("\n".join((*filter(None, (PARAMETERS.get(str(one.parameter)),)), axis)), rows, step)
        )
    name, first = f"{row.unit} {row.joint}", tested.get(shown[0])
    if first is None:
        finding = f"{label(next(rows_of(of_quantity[shown[0]])))}: not tested for a change."
    else:
        size = change(first.percent, first.percent_lower, first.percent_upper)
        single, verdict = probability(first.p), "changed" if first.changed else "no change found"
        finding = f"{label(first)}: the most likely step is {size} % since {day(first.since)}, p {single} of this test alone: {verdict}."
    count = series["session"].nunique()
    thinned = f" Of {count} sessions {figures.POINTS} are drawn." if count > figures.POINTS else ""
    return Drawing(
        partial(figures.joint_figure, name, row.first, courses, simulated=found.simulated),
        f"joint-{row.rank}", f"{shortened(name)} over {counted(int(row.sessions), 'session')}", f"{finding}{thinned}",
        "Circles: values with 95 % intervals; diamonds: adjusted for temperature, load and common shift; shaded: the 95 % limits for one "
        "more session, from the sessions before the change; dashed: the level before and after the step; dotted line: the step; solid "
        "line: where its baseline began anew.",
        data="changes", simulated=found.simulated,
    )  # fmt: skip  # a list of values


def _quality_sections(found: Findings) -> Iterator[Section]:
    whole = tables.totals(found.quality)
    grave = whole[whole["severity"].isin(["caution", "critical"])]["code"].astype(str).tolist()
    codes = [code for code in grave if code != "failed"][: figures.CODES] + [code for code in grave if code == "failed"]
    figure = None
    if codes:
        most = next(rows_of(whole[whole["code"] == grave[0]]))
        figure = Drawing(
            partial(figures.quality_figure, found.quality, codes, simulated=found.simulated),
            "quality", "percent of joint-sessions with a warning, over time",
            f"{grave[0]} is the most frequent: {two_digits(most.percent)} % of {most.of} joint-sessions. Cautions, critical warnings and failed "
            "sessions in percent of each period's joint-sessions.",
            data="quality", simulated=found.simulated,
        )  # fmt: skip  # a list of values
    none = "" if len(whole) else "\n\nNo session has a warning."
    yield Section(
        "Data quality",
        text="How many joint-sessions have each warning. A warning that becomes frequent points at logs and sensors, not at wear."
        + none,
        figure=figure,
        table=_table("quality", "Warnings, the most frequent first", whole, tables.in_quality(found.quality)),
    )
    if len(found.warned):
        yield Section(
            "Warnings that began and stayed",
            text="Joints that had a warning in none of their first sessions and then in most: look at these logs and sensors first.",
            table=_table("warned", "Warnings that began, by joint", found.warned, tables.in_warned(found.warned)),
        )
    lost = found.failures
    yield Section(
        "Sessions that failed",
        text="" if len(lost) else "None: every session was identified.",
        table=_table("failures", "Sessions without a result", lost, tables.in_failures(lost)),
    )


def _lines(found: Findings) -> Iterator[str]:
    """Lines of the terminal below the headline: shortened lists, and the notes."""
    changed = found.joints[found.joints["changed"].astype(bool)]
    yield from _listed(
        "Joints that changed", "with 95 % interval and adjusted p", changed, _MOST_CHANGED,
        lambda row: [
            str(quantity(row) or ""), f"{change(row.percent, row.percent_lower, row.percent_upper)} %",
            f"since {day(row.since)}{' (1 session)' * (row.sessions_after == 1)}", f"p {probability(row.adjusted_p)}",
            *([f"new warnings: {row.new_warnings}"] if row.new_warnings else []),
        ],
    )  # fmt: skip  # a row
    yield from _listed(
        "Values outside their type", "with adjusted p", tables.outside_first(found.units[found.units["outside"].astype(bool)]), _MOST_OUTSIDE,
        lambda row: [
            str(quantity(row) or ""), f"{pair(row.value, row.standard_error)} {row.value_unit}",
            f"{row.percent:+.3g} % from type {shortened(str(row.type), 16)}", f"p {probability(row.adjusted_p)}",
        ],
    )  # fmt: skip  # a row
    whole = tables.totals(found.quality)
    grave = whole[whole["severity"].isin(["caution", "critical"])].head(_MOST_CODES)
    if len(grave):
        told = ", ".join(f"{row.code} {two_digits(row.percent)} %" for row in rows_of(grave))
        yield f"Data quality, percent of {whole['of'].iloc[0]} joint-sessions: {told}."
    yield from _listed(
        "Warnings that began and stayed", "", found.warned, _MOST_OUTSIDE,
        lambda row: [row.code, f"since {day(row.since)}", f"in {row.sessions} of {counted(int(row.of), 'session')}"],
    )  # fmt: skip  # a row
    yield from (note.coded for note in found.notes)
    if found.notes:
        yield "What a code in brackets means: bristle explain CODE"


def _listed(what: str, more: str, whole: pd.DataFrame, most: int, cells: Any) -> Iterator[str]:
    """The title and the first rows of a list that is not empty; `cells`: of a row, beside unit and joint."""
    rows = whole.head(most)
    if len(rows):
        cut = "" if len(rows) == len(whole) else f", the first {len(rows)}"
        yield f"{what} ({len(whole)}{cut}){f', {more}' if more else ''}:"
        yield from columns([[_name(row), *cells(row)] for row in rows_of(rows)])


def _name(row: Any) -> str:
    return " ".join(shortened(str(x), 24) for x in (row.unit, row.joint) if not pd.isna(x)) or MISSING
