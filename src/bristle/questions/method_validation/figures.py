"""Matplotlib figures of a validation: cost vs v_s, and each method's v_s."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from bristle.identification.static.grid import PLAIN_GRID
from bristle.model.parameters import Kind
from bristle.page.style import Look, decimal_log, new_figure, panels, styled, title
from bristle.page.wording import axis
from bristle.questions.method_validation.results import CaseResult
from bristle.questions.method_validation.run import PLAIN_GRIDS, REFINED

SOLVERS = {
    "IPOPT": Look("#0072B2", "o", "-"),
    "SciPy TRF": Look("#D55E00", "s", "--"),
    "lmfit": Look("#009E73", "^", ":"),
}
_LARGE = 3.0  # ratios beyond this are drawn on a logarithmic axis


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
