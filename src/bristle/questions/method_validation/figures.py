"""A validation as figures: cost vs v_s, error vs resolution, success vs start, and each method's v_s."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator

from bristle.identification.static.grid import PLAIN_GRID
from bristle.model.parameters import Kind
from bristle.page.style import LINES, Look, decimal_log, new_figure, panels, styled, title
from bristle.page.wording import axis, shortened
from bristle.questions.method_validation.results import FINE_ENOUGH, CaseResult, Validation
from bristle.questions.method_validation.run import PLAIN_GRIDS, REFINED

SOLVERS = {
    "IPOPT": Look("#0072B2", "o", "-"),
    "SciPy TRF": Look("#D55E00", "s", "--"),
    "lmfit": Look("#009E73", "^", ":"),
}
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
_MARKERS = ("o", "s", "^", "D", "v", "P")
_LARGE = 3.0  # ratios beyond this are drawn on a logarithmic axis


@styled
def cost_figure(result: CaseResult, kind: Kind) -> Figure:
    """Cost vs v_s, all else re-optimised, over its minimum, and where each method ends; beneath, plain grids near it."""
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
        _decimal(ax)
        ax.set_ylim(top**-0.06, top**1.05)
    else:
        ax.set_ylim(1 - 0.06 * (top - 1), top)
    near.set_xlabel(axis("velocity", kind, "Stribeck"))
    for part in (ax, near):
        part.set_ylabel("Cost relative to\nthe refined grid")
    _headed(ax, result.case.label, rows=5, columns=2)
    return figure


@styled
def starts_figure(result: CaseResult, kind: Kind) -> Figure:
    """Where each random start ends vs where it begins; beneath, the share that ends in the best minimum."""
    figure = new_figure(5.2)
    figure.subplots_adjust(left=0.19, hspace=0.12)
    ax, below = figure.subplots(2, height_ratios=(3, 2), sharex=True)
    starts = result.starts
    edges = np.geomspace(*result.case.v_s_range, 7)
    for name in starts.solvers:
        look = SOLVERS[name]
        other, final = starts.in_other_minimum(name), starts.final[name][-1]
        for chosen, fill in ((~other, look.colour), (other, "none")):
            style: dict[str, Any] = {"color": look.colour, "markerfacecolor": fill, "markersize": 5, "alpha": 0.8}
            ax.plot(starts.initial_v_s[chosen], final[chosen], look.marker, **style)
        ax.plot([], [], look.marker, color=look.colour, label=name)
        every, good = (np.histogram(v_s, edges)[0] for v_s in (starts.initial_v_s, starts.initial_v_s[~other]))
        share = np.divide(good, every, out=np.full(every.size, np.nan), where=every > 0)  # nan in an empty bin
        below.plot(np.sqrt(edges[1:] * edges[:-1]), 100 * share, look.marker + look.line, color=look.colour, label=name)
    ax.plot([], [], "o", color="#444444", markerfacecolor="none", label="hollow: another minimum")
    ax.axhline(starts.best[-1], color="#000000", linewidth=1, label="refined grid")
    decimal_log(below)
    # Final v_s is logarithmic where it differs by a factor, else plain, and reaches a tenth to both sides of the best.
    ends = np.concatenate([starts.best[-1:], *(starts.final[name][-1] for name in starts.solvers)])
    low, high, best = float(ends.min()), float(ends.max()), starts.best[-1]
    if high > _LARGE * low:
        _decimal(ax)
    else:
        ax.set_ylim(min(low * 0.98, 0.9 * best), max(high * 1.02, 1.1 * best))
        ax.yaxis.set_major_locator(MaxNLocator(5))
        ax.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:.3g}"))
    below.set_ylim(-5, 105)
    ax.set_ylabel(axis("velocity", kind, "final Stribeck").replace("Stribeck ", "Stribeck\n"))
    below.set_xlabel(axis("velocity", kind, "Stribeck velocity of the start:").replace(": velocity", ""))
    below.set_ylabel("Ends in the best\nminimum (%)")
    _headed(ax, result.case.label, 1, 5, handletextpad=0.3, columnspacing=0.7, handlelength=1.6)
    return figure


@styled
def resolution_figure(validation: Validation) -> Figure | None:
    """Error of v_s by a plain grid over the statistical one, vs the number of its values; None where v_s can be known nowhere."""
    knowable = validation.resolvable
    if not knowable:
        return None
    many = len({x.case.label for x in knowable}) < len(knowable)
    figure = new_figure(5.4 if many else 4.2)
    figure.subplots_adjust(top=0.66 if many else 0.78)
    ax = figure.subplots()
    groups = list(dict.fromkeys(_group(x, many=many) for x in knowable))
    for result in knowable:
        r, label = result.resolution, _group(result, many=many)
        k = groups.index(label)
        named = label if label not in ax.get_legend_handles_labels()[1] else None
        style: dict[str, Any] = {"color": _COLOURS[k % 6], "marker": _MARKERS[k % 6], "linestyle": LINES[k % 3]}
        ax.plot(r.counts, r.error / r.floor, markersize=4, linewidth=0.9 if many else 1.5, label=named, **style)
    ax.axhline(1.0, color="#000000", linewidth=1.4, label="statistical floor: the standard error of vₛ")
    ax.axhline(FINE_ENOUGH, color="#666666", linewidth=1, linestyle="--", label="a tenth of it")
    decimal_log(ax)
    _decimal(ax)
    ax.set_xticks(knowable[0].resolution.counts, [str(n) for n in knowable[0].resolution.counts])
    ax.set_xlabel("Values of vₛ in the plain grid")
    ax.set_ylabel("Grid error of vₛ /\nits standard error")
    rows = 2 + 2 * len({x.case.design for x in knowable}) if many else 2
    _headed(ax, validation.case_set.title, rows, columns=1 if many else 2)
    return figure


@styled
def methods_figure(result: CaseResult) -> Figure:
    """Median error and spread of v_s by each method, relative to the truth."""
    figure, (ax,) = panels(5.0, result.case.label, True)
    figure.subplots_adjust(left=0.34)
    rows, v_s = list(result.methods.values()), result.case.truth.v_s
    # A method that fails in more than a fifth of the sets does not widen the axis.
    reach = 100 * max(abs(m.bias[-1]) + m.spread[-1] for m in rows if m.failed <= 0.2) / v_s
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


def _group(result: CaseResult, *, many: bool) -> str:
    if not many:
        return shortened(result.case.label, 40)
    return f"{result.case.design}, noise {100 * result.case.noise / result.case.truth.alpha_0:.2g} %"


def _decimal(ax: Axes) -> None:
    """A logarithmic y axis with plain decimal labels: where it is wide, at powers of ten alone."""
    wide = ax.dataLim.y1 > 500 * max(ax.dataLim.y0, 1e-300)
    ax.set_yscale("log")
    ax.yaxis.set_major_locator(LogLocator(subs=(1.0,) if wide else (1.0, 2.0, 5.0), numticks=12))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g}"))
    ax.yaxis.set_minor_locator(NullLocator())


def _headed(ax: Axes, label: str, rows: int, columns: int, **look: Any) -> None:
    """The title, and between it and the axes the legend of so many rows."""
    title(ax, label, simulated=True)
    ax.set_title(ax.get_title(loc="left"), loc="left", pad=8 + 13.5 * rows)
    look |= {"ncols": columns, "frameon": False, "borderaxespad": 0.2, "fontsize": 8.5}
    ax.legend(loc="lower left", bbox_to_anchor=(0, 1.0), **look)
