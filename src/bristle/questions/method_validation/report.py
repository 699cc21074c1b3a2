"""The report of a validation: the claim, each case, the resolution that a plain grid needs, and coverage."""

from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from bristle.estimation import levels
from bristle.identification.static.grid import PLAIN_GRID
from bristle.model.parameters import Kind, unit
from bristle.page.page import Drawing
from bristle.page.report import Report, Section, Table
from bristle.page.style import Look, decimal_log, new_figure, panels, styled, title
from bristle.page.wording import axis, counted, in_percent, number, pretty, slugs
from bristle.questions.method_validation.results import CaseResult, Validation
from bristle.questions.method_validation.run import BOOTSTRAP_SETS, INTERVAL_SETS, LOCAL_SETS, PLAIN_GRIDS, REFINED
from bristle.questions.method_validation.solvers import LMFIT
from bristle.questions.method_validation.verdict import overall, verdict

FEW = 6  # most cases of which each has a verdict in the text and a section on the page
_WORDS = {
    " elsewhere": ", other minimum", "declined": "no estimate returned", "lower_beyond": "lower outside the range",
    "ipopt_lead": "IPOPT below the grid (relative)", f"plain_{PLAIN_GRID}_error": f"error of the plain grid of {PLAIN_GRID}",
}  # fmt: skip  # parts of columns, as the page calls them
SOLVERS = {
    "IPOPT": Look("#0072B2", "o", "-"),
    "SciPy TRF": Look("#D55E00", "s", "--"),
    "lmfit": Look("#009E73", "^", ":"),
}
_LARGE = 3.0  # ratios beyond this are drawn on a logarithmic axis


def report(validation: Validation) -> Report:
    """The claim, each case, or of many those of the first set, then resolution and coverage."""
    case_set, claims, drawn = validation.case_set, overall(validation), validation.cases
    few = len(drawn) <= FEW
    if not few:  # at its highest noise
        first = [x for x in drawn if x.case.label == drawn[0].case.label]
        drawn = tuple(x for x in first if x.case.noise == max(y.case.noise for y in first))
    local = min(LOCAL_SETS, validation.repetitions)
    how = (
        f"{validation.repetitions} repetitions; local solvers fit the first {local} of them, each from one random start, and the "
        f"first data set also from {validation.starts} random starts; starts are drawn within the grid's bounds. Seed "
        f"{validation.seed}.{'' if LMFIT else ' lmfit is not installed and was not compared.'}"
    )
    sections = [Section("", findings=claims[:1]), Section("Verdict", text=how, findings=claims[1:], id="verdict")]
    if skipped := tuple(case_set.skipped.items()):
        lines = tuple(f"{case_set.title} {direction}: {why.coded}" for direction, why in skipped)
        sections.append(Section("Not validated", facts=skipped, lines=lines, form="part"))
    sections.append(Section("Assumed", findings=case_set.assumptions, lines=(), form="part"))
    names = slugs([f"{x.case.label} {x.case.design}".replace("(+)", "plus").replace("(-)", "minus") for x in drawn])
    for name, x in zip(names, drawn, strict=True):
        case, said, torque = x.case, verdict(x), unit("torque", case_set.kind)
        line = f"{case.label}, SIMULATED, {case.design}, noise {case.noise:.2g} {torque}:"
        sections.append(Section(
            case.label, about=f"{case.design}; noise {case.noise:.2g} {pretty(torque)}", findings=said,
            figures=drawings(x, case_set.kind, name), lines=(line, *(f"  {one.flagged}" for one in said)) if few else (),
            id=f"{name}--case",
        ))  # fmt: skip  # a list of values
    if drawn:
        covered, bootstrapped = (min(sets, validation.repetitions) for sets in (INTERVAL_SETS, BOOTSTRAP_SETS))
        shown = "91 to 98 %" if covered >= 200 else "a less precise figure"
        cases = Table(
            "cases", "Solvers and plain grids by case", part=_rounded(validation.to_frame().rename(columns=_heading)),
            note="Noise in percent of α₀. No estimate returned: bristle reports vₛ as not identifiable, or gives it no finite interval. "
            f"Other minimum: of {validation.starts} random starts. Lower outside the range: with vₛ free, they find a lower cost outside "
            "the grid's range. IPOPT below the grid: by how much its cost is below the refined grid's within the range. Error of the "
            f"plain grid of {PLAIN_GRID}: of vₛ, relative to its standard error; values needed: for an error of a tenth, of the grids tried.",
        )  # fmt: skip  # a list of values
        covers = Table(
            "coverage",
            "Coverage of the 95 % intervals",
            part=_rounded(coverage(validation).rename(columns=_heading)),
            note=f"Covariance and profile over {covered} data sets, bootstrap-t over {bootstrapped}, where vₛ is identifiable. With so many "
            f"data sets, a true coverage of 95 % shows as {shown} in nineteen tables of twenty.",
        )
        sections += [
            Section("How fine must a plain grid be?", text=resolution_said(validation), lines=(), id="all"),
            Section("All cases", table=cases),
            Section("Do the 95 % intervals cover the truth?", table=covers),
        ]
    return Report(
        f"Validation of the grid search: {case_set.title}", tuple(sections),
        about="Grids against full nonlinear fits.",
        simulated="Validation needs true values: all torques here are simulated from the models named below.",
        seed=validation.seed, tables={"cases": validation.to_frame(), "coverage": coverage(validation)},
    )  # fmt: skip  # a list of values


def drawings(result: CaseResult, kind: Kind, file: str) -> tuple[Drawing, ...]:
    """The figures of a case, cost and methods; `file` begins the names of their files."""
    starts, truth, label = result.starts, result.case.truth.v_s, result.case.label
    count = starts.initial_v_s.size
    ends = ", ".join(f"{name} from {count - int(starts.in_other_minimum(name).sum())}" for name in starts.solvers)
    grid = result.methods[REFINED]
    failed = max(result.methods[f"{name}, random start"].failed for name in starts.solvers)
    cost = (
        f"The refined grid ends at vₛ = {number(starts.best[-1], 3)} {pretty(unit('v_s', kind))}; of {counted(count, 'random start')} "
        f"end at the lowest cost: {ends}. Cost of the first data set vs vₛ, all other parameters re-optimised, relative to the refined "
        "grid. Dashed: the 95 % threshold; the data allow any vₛ below it. Markers: three plain grids, the refined grid, and the final "
        "values of the random starts of each solver."
    )
    by_method = (
        f"The median error of vₛ by the refined grid is {in_percent(abs(float(grid.bias[-1])) / truth)}; it fails in "
        f"{in_percent(grid.failed)} of the data sets, a solver in up to {in_percent(failed)}. Median error of vₛ with the width of the "
        "middle 68 % over the repetitions; right: how often each fails, that is, ends at a cost at which even the true model would be "
        "rejected."
    )
    return (
        Drawing(partial(cost_figure, result, kind), f"{file}-cost", f"cost vs v_s of {label}", cost, simulated=True),
        Drawing(
            partial(methods_figure, result),
            f"{file}-methods",
            f"v_s by each method of {label}",
            by_method,
            simulated=True,
        ),
    )


def resolution_said(validation: Validation) -> str:
    """The number of values that a plain grid needs, in a sentence."""
    needed = [x.resolution.enough for x in validation.resolvable]
    if not needed:
        return "vₛ is not identifiable in any case, so the resolution does not matter."
    known = [n for n in needed if n is not None]
    values = f"{min(known)} to {max(known)} values" if known else "more values than were tried"
    more = f"; in {needed.count(None)} of {counted(len(needed), 'case')} no grid tried has enough" * (None in needed)
    return f"A plain grid needs {values} for an error of vₛ below a tenth of its standard error{more}."


def _heading(column: str) -> str:
    for name, words in _WORDS.items():
        column = column.replace(name, words)
    return column.replace("_percent", " (%)").replace("_", " ")


def _rounded(frame: pd.DataFrame) -> pd.DataFrame:
    """A frame with numbers of three digits, and None for missing ones."""
    columns = frame.select_dtypes("float").columns
    frame[columns] = frame[columns].map(lambda x: float(f"{x:.3g}"))
    return frame.astype(object).where(frame.notna(), None)


def coverage(validation: Validation) -> pd.DataFrame:
    """One row per case and kind of interval: how often it covers, percent, by parameter."""
    rows = [
        {**result.which, "interval": coverage.kind, "repetitions": coverage.repetitions}
        | {f"{name}_percent": 100 * float(x) for name, x in zip(result.case.names, coverage.share, strict=True)}
        for result in validation.cases
        for coverage in result.coverage
    ]
    return pd.DataFrame(rows)


@styled
def cost_figure(result: CaseResult, kind: Kind) -> Figure:
    """Cost vs v_s, all else re-optimised, with the final values of each method; below, plain grids near the minimum."""
    figure = new_figure(6.4)
    figure.subplots_adjust(top=0.80, hspace=0.3)
    ax, near = figure.subplots(2, height_ratios=(3, 2))
    curve, starts = result.cost_curve, result.starts
    lowest, limit = starts.best_cost, curve.threshold / starts.best_cost
    for part, label in ((ax, "cost (all else re-optimised)"), (near, None)):
        part.plot(curve.v_s, curve.cost / lowest, "-", color="#000000", label=label)
        part.axhline(limit, color="#666666", linestyle="--", linewidth=1, label="95 % region, below" if label else None)
    for name in starts.solvers:
        look = SOLVERS[name]
        x, y = starts.final[name][-1], np.maximum(starts.cost[name] / lowest, 1.0)
        ax.plot(x, y, look.marker, color=look.colour, mfc="none", alpha=0.75, label=f"{name}, from random starts")
    for count, marker in {16: "v", 125: "x", PLAIN_GRID: "+"}.items():
        at = curve.plain[count]
        height = np.interp(at, curve.v_s, curve.cost) / lowest
        for part, label in ((ax, f"plain grid of {count}"), (near, None)):
            part.plot(at, height, marker, color="#CC79A7", markersize=9, mew=2, mfc="none", label=label)
    for part, label in ((ax, "refined grid"), (near, None)):
        part.plot(starts.best[-1], 1.0, "*", color="#E69F00", mec="#000000", markersize=12, label=label, zorder=1.5)
    allowed = curve.v_s[curve.cost <= curve.threshold]
    low, high = allowed.min(initial=starts.best[-1]), allowed.max(initial=starts.best[-1])
    margin = 0.15 * (high - low) or 0.05 * high
    near.set_xlim(low - margin, high + margin)
    near.set_ylim(1 - 0.12 * (limit - 1), 1 + 1.15 * (limit - 1))
    decimal_log(ax)
    top = ax.get_ylim()[1]
    if top > _LARGE:
        ax.set_yscale("log")
        wide = ax.dataLim.y1 > 500 * max(ax.dataLim.y0, 1e-300)  # with labels at powers of ten alone
        ax.yaxis.set_major_locator(LogLocator(subs=(1.0,) if wide else (1.0, 2.0, 5.0), numticks=12))
        ax.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g}"))
        ax.yaxis.set_minor_locator(NullLocator())
        ax.set_ylim(top**-0.06, top**1.05)
    else:
        ax.set_ylim(1 - 0.06 * (top - 1), top)
    near.set_xlabel(axis("velocity", kind, "Stribeck"))
    for part in (ax, near):
        part.set_ylabel("Cost relative to\nthe refined grid")
    title(ax, result.case.label, simulated=True)
    ax.set_title(ax.get_title(loc="left"), loc="left", pad=8 + 13.5 * 5)  # above the five rows of the legend
    ax.legend(loc="lower left", bbox_to_anchor=(0, 1.0), ncols=2, frameon=False, borderaxespad=0.2, fontsize=8.5)
    return figure


@styled
def methods_figure(result: CaseResult) -> Figure:
    """Median error and spread of v_s by each method, relative to the truth."""
    figure, (ax,) = panels(5.0, result.case.label, True)
    figure.subplots_adjust(left=0.34)
    rows, v_s = list(result.methods.values()), result.case.truth.v_s
    # A method that fails in more than a fifth of the sets does not widen the axis.
    reach = 100 * max(abs(m.bias[-1]) + m.spread[-1] for m in rows if m.failed <= levels.MOST_FAILED) / v_s
    edge: dict[str, Any] = {"xycoords": ("axes fraction", "data"), "va": "center", "fontsize": 9}
    for k, m in enumerate(rows):
        colour = "#D55E00" if m.name == REFINED else "#666666" if m.name in PLAIN_GRIDS.values() else "#0072B2"
        centre, half = 100 * m.bias[-1] / v_s, 100 * m.spread[-1] / v_s
        if abs(centre) + half <= 1.1 * reach:
            marker = "s" if m.name == REFINED else "o"
            ax.errorbar(centre, k, xerr=half, fmt=marker, color=colour, capsize=3, markersize=5)
        else:
            x, side = (0.87, "right") if centre > 0 else (0.02, "left")
            ax.annotate(f"off by {centre:.3g} %", (x, k), ha=side, color=colour, **edge)
        ax.annotate(f"{100 * m.failed:.3g} %", (1.0, k), ha="right", **edge)
    ax.annotate("fails", (1.0, -0.9), ha="right", **edge)
    ax.axvline(0.0, color="#000000", linewidth=0.8)
    ax.set_ylim(len(rows) - 0.5, -1.4)
    ax.set_xlim(-1.1 * reach, 1.4 * reach)
    ax.set_yticks(range(len(rows)), [m.name for m in rows])
    ax.set_xlabel("Error of vₛ: median and spread (% of the truth)")
    return figure
