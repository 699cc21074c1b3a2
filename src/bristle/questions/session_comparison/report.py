"""The report of a comparison of two sessions."""

from functools import partial

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from bristle.identification.fits import Estimate
from bristle.page.page import Drawing
from bristle.page.plain import pair
from bristle.page.report import Report, Section, Table
from bristle.page.style import DIRECTION, new_figure, styled, title
from bristle.page.wording import counted, measured, number, percent, pretty, shortened, slugs, symbol
from bristle.questions.session_comparison.results import Change, Comparison

_NONE = 1e-99  # least p-value that is shown
_LEAST = f"< {_NONE:g}"
_DRAWN = 30  # joints with a figure
_ROW = 0.34  # height of a parameter, inches
_APART = 0.17  # distance of the sessions from a parameter's line, rows
_MOST = 40  # parameters drawn; the table has all
_BEYOND = 8.0  # largest half of the axis, over the median reach of the rows


def report(compared: Comparison) -> Report:
    """The verdict and its limits, then each joint; the terminal has the joints before the limits."""
    joints = list(compared.kinds)
    columns = ["joint", "source", "parameters", "F", "freedom", "p", "adjusted_p", "changed", "names"]
    sets = pd.DataFrame(
        [
            (x.joint, x.source, len(x.names), x.statistic, x.freedom, x.p, x.adjusted, x.changed, ", ".join(map(str, x.names)))
            for x in compared.sets
        ],
        columns=columns,
    )  # fmt: skip  # one row, one line
    tables = {"changes": compared.to_frame(), "sets": sets}
    sections = [Section("", findings=(compared.sentence,), lines=(str(compared.sentence),), turn=-1)]
    if compared.warnings:
        lines = tuple(f"warning: {x.coded}" for x in compared.warnings)
        limits = "What limits the comparison"
        sections.append(Section(limits, findings=compared.warnings, lines=lines, turn=1, form="part"))
    for k, (joint, slug) in enumerate(zip(joints, slugs(joints), strict=True)):
        sections += _of_joint(compared, joint, slug, tables, with_figure=k < _DRAWN)
    drawn = f" Figures show the first {_DRAWN} joints; the tables contain all." if len(joints) > _DRAWN else ""
    return Report(
        f"{joints[0] if len(joints) == 1 else f'{len(joints)} joints'}: two sessions compared",
        tuple(sections),
        about=f"What changed beyond the joint uncertainty.{drawn}",
        simulated="At least one session was not measured but simulated." if compared.simulated else "",
        tables=tables,
    )


def _of_joint(
    compared: Comparison, joint: str, slug: str, tables: dict[str, pd.DataFrame], *, with_figure: bool
) -> list[Section]:
    """The sections of one joint: its changes, its fits as sets, and the parameters that cannot be compared."""
    lines = [f"[[{joint}]] {compared.kinds[joint]}{', SIMULATED data' if compared.simulated else ''}"]
    known, rows = [], []
    for c in (c for c in compared.changes if c.joint == joint):
        name = f"  {shortened(str(c.parameter), 12):<12}"
        if c.changed is None or c.first is None or c.second is None:
            lines.append(f"{name} {c.verdict}")
            continue
        known.append(c)
        a, b = (f"{pair(e.value, e.standard_error)} {c.unit}" for e in (c.first, c.second))
        chance = f"{number(c.z, 3)} standard errors, p {_p(c.adjusted)} (Holm)"
        lines.append(f"{name} {a} -> {b} ({c.source}): {chance}. {c.verdict}")
        both = (measured(e.value, e.standard_error) for e in (c.first, c.second))
        rows.append((*both, None if c.percent is None else round(c.percent, 2)))
    lines += [
        f"  {x.source}, {len(x.names)} parameters as a set: F = {x.statistic:.3g}, p {_p(x.adjusted)} (Holm): "
        f"{'changed' if x.changed else 'no change'}"
        for x in compared.sets
        if x.joint == joint
    ]

    moved, of = [c for c in known if c.changed], counted(len(known), "parameter")
    if moved:
        most = max(moved, key=lambda c: abs(c.percent or 0.0))
        way = "rose" if (most.difference or 0.0) > 0 else "fell"
        if most.first is None or most.percent is None:  # its first value is zero
            size = f"{measured(abs(most.difference or 0.0), most.error)} {pretty(most.unit)}"
        else:
            size = f"{measured(abs(most.percent), percent(most.first.value, most.error))} %"
        found = f"{len(moved)} of {of} changed; the largest change: {symbol(most.parameter)} {way} by {size}."
    else:
        far = number(max((abs(c.z or 0.0) for c in known), default=None), 2)
        found = f"None of {of} changed beyond its joint uncertainty; differences are {far} standard errors at most."
    figure = Drawing(
        partial(forest_figure, compared, joint), f"{slug}-changes", f"both sessions of {joint}",
        f"{found} Each parameter in both sessions with its 95 % interval, as a difference in percent from the first "
        "session's value. Shaded: changed beyond the joint uncertainty. Arrow: the interval extends beyond the axis.",
    )  # fmt: skip  # a list of values

    changes, sets = (frame[frame["joint"] == joint] for frame in tables.values())
    comparable = changes[changes["source"] != ""]
    columns = ("first session", "second session", "difference (%)")
    part = comparable[["parameter", "direction", "unit", "source"]].join(
        pd.DataFrame(rows, columns=columns, index=comparable.index, dtype=object)
    )
    part = part.join(comparable[["z", "adjusted_p", "changed"]]).round({"z": 2})
    note = (
        "The sessions are assumed independent, so their variances add. vₛ and σ₀ are compared by their logarithm. "
        "z: the difference in joint standard errors; p: the probability of at least such a difference by chance, "
        "Holm-corrected for all parameters on this page; changed: below 0.05."
    )
    table = Table("changes", f"Changes of {joint}", tables["changes"], _few_digits(part), note)
    sections = [Section(joint, figure=figure if with_figure else None, table=table, lines=tuple(lines))]
    if len(sets):
        note = (
            "F: dᵀ (C₁ + C₂)⁻¹ d / number of parameters, with d the differences and C the covariances. A set can "
            "change although no single parameter does; the page cannot say then which one changed."
        )
        part = _few_digits(sets.drop(columns=["names", "p"]))
        table = Table("sets", f"Fits of {joint} as sets", tables["sets"], part, note)
        sections.append(Section("All parameters of a fit at once", table=table, form="part"))
    if len(rest := changes[changes["source"] == ""]):
        part = rest[["parameter", "direction", "verdict"]]
        table = Table("changes", f"Parameters of {joint} without a comparison", tables["changes"], part)
        sections.append(Section("Not comparable", table=table, form="part"))
    return sections


def _few_digits(frame: pd.DataFrame) -> pd.DataFrame:
    """The frame with its p-values in two digits, and None for missing values."""
    few = [_LEAST if p < _NONE else float(f"{p:.2g}") for p in frame["adjusted_p"]]
    frame = frame.assign(adjusted_p=pd.Series(few, index=frame.index, dtype=object))
    shown = frame.astype(object).where(frame.notna(), None)
    return shown.rename(columns={"adjusted_p": "p (Holm)", "changed": "changed?"})


def _p(p: float | None) -> str:
    """A p-value with its sign of comparison."""
    return _LEAST if p is not None and p < _NONE else f"= {number(p, 2)}"


@styled
def forest_figure(compared: Comparison, joint: str) -> Figure | None:
    """Values and 95 % intervals of one joint in both sessions, percent from the first's value; None without any."""
    rows = [c for c in compared.changes if c.joint == joint and c.changed is not None and c.first and c.first.value]
    rows = rows[:_MOST]
    if not rows:
        return None
    figure = new_figure(1.3 + _ROW * len(rows))
    figure.subplots_adjust(left=0.19, right=0.87, top=1 - 0.66 / figure.get_figheight())
    ax = figure.subplots()
    # Half of the axis, percent: it holds all differences, and intervals unless they are far wider than the others.
    wide = np.array([max(abs(x) for e in (row.first, row.second) for x in _span(row, e)) for row in rows])
    far = max(abs(_span(row, row.second)[1]) for row in rows)
    reach = 1.12 * max(min(float(wide.max()), _BEYOND * float(np.median(wide))), far, 1e-6)
    for session, look, side in (("first", DIRECTION["+"], -_APART), ("second", DIRECTION["-"], _APART)):
        for k, row in enumerate(rows):
            low, value, high = _span(row, getattr(row, session))
            y, label = k + side, f"{session} session" if k == 0 else None
            ax.plot([max(low, -reach), min(high, reach)], [y, y], color=look.colour, linestyle=look.line, linewidth=1.8)
            ax.plot([value], [y], color=look.colour, marker=look.marker, markersize=5.5, linestyle="none", label=label)
            for end, edge, arrow in ((low, -reach, "<"), (high, reach, ">")):
                if abs(end) > reach and end * edge > 0:
                    ax.plot([edge], [y], marker=arrow, color=look.colour, markersize=7, clip_on=False)
    for k, row in enumerate(rows):
        if row.changed:
            ax.axhspan(k - 0.5, k + 0.5, color="#f0e442", alpha=0.35, linewidth=0)
            ax.annotate("changed", (1.015, k), xycoords=("axes fraction", "data"), va="center", fontsize=9)
    ax.axvline(0, color="#444444", linewidth=0.8)
    label = "From the first session's value (%), with 95 % intervals"
    ax.set(xlim=(-reach, reach), ylim=(len(rows) - 0.5, -0.5), xlabel=label)
    ax.set_yticks(range(len(rows)), [shortened(symbol(row.parameter), 18) for row in rows])
    ax.grid(visible=False, axis="y")
    ax.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=2, frameon=False, borderaxespad=0.1)
    title(ax, shortened(joint, 30), compared.simulated)
    ax.set_title(ax.get_title(loc="left"), loc="left", pad=25)  # above the legend
    return figure


def _span(row: Change, e: Estimate | None) -> tuple[float, float, float]:
    """Lower end, value and upper end of one session, percent from the first session's value."""
    base = (row.first.value if row.first else None) or 1.0
    low, high = (e.interval if e else None) or (base, base)
    value = (e.value if e else None) or 0.0
    ends = sorted(100 * (x - base) / abs(base) for x in (low, high))
    return ends[0], 100 * (value - base) / abs(base), ends[1]
