"""The grid method on trial as figures: cost over v_s, error over resolution, success over start, and each method's v_s."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.identification.static.grid import PLAIN_GRID
from bristle.model.parameters import Kind
from bristle.page.style import LINES, Look, decimal_log, new_figure, styled, title
from bristle.page.wording import axis, shortened
from bristle.questions.method_validation.results import ENOUGH, FREE, Starts, Trial, Tried
from bristle.questions.method_validation.run import REFINED

SOLVERS = {
    "IPOPT": Look("#0072B2", "o", "-"),
    "SciPy TRF": Look("#D55E00", "s", "--"),
    "lmfit": Look("#009E73", "^", ":"),
}
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
_MARKERS = ("o", "s", "^", "D", "v", "P")
_PLAIN = (16, 125, PLAIN_GRID)
"""Plain grids whose answers are drawn."""
_BINS = 6
_MOST_FAILED = 0.2
"""A method that fails more often than this does not stretch the axis."""
_LARGE = 3.0
"""Ratios beyond this are drawn on a logarithmic axis."""
_NARROW = 0.1
"""An axis of v_s reaches at least this share to both sides of the best."""
_WIDE = 500.0
"""An axis that spans more than this has labels at powers of ten alone."""


@styled
def landscape_figure(tried: Tried, kind: Kind) -> Figure:
    """Cost over v_s, minimised over all else, over its least: where the refined grid and each solver's starts end; beneath, plain grids near it."""
    figure = new_figure(6.4)
    figure.subplots_adjust(top=0.80, hspace=0.3)
    ax, near = figure.subplots(2, height_ratios=(3, 2))
    scape, many = tried.landscape, tried.starts
    _titled(ax, tried.case.label, rows=5)
    lowest, limit = many.best_cost, scape.threshold / many.best_cost
    for part, label in ((ax, "cost (least over all else)"), (near, None)):
        part.plot(scape.v_s, scape.cost / lowest, "-", color="#000000", label=label)
        part.axhline(limit, color="#666666", linestyle="--", linewidth=1, label="95 % region, below" if label else None)
    for name, look in _solvers(tried):
        x, y = many.ended[name][3], np.maximum(many.cost[name] / lowest, 1.0)
        ax.plot(x, y, look.marker, color=look.colour, mfc="none", alpha=0.75, label=f"{name}, from random starts")
    for count, marker in zip(_PLAIN, ("v", "x", "+"), strict=True):
        at = scape.plain[count]
        height = np.interp(at, scape.v_s, scape.cost) / lowest
        for part, label in ((ax, f"plain grid of {count}"), (near, None)):
            part.plot(at, height, marker, color="#CC79A7", markersize=9, mew=2, mfc="none", label=label)
    for part, label in ((ax, "refined grid"), (near, None)):
        part.plot(many.best[3], 1.0, "*", color="#E69F00", mec="#000000", markersize=12, label=label, zorder=1.5)
    allowed = scape.v_s[scape.cost <= scape.threshold]
    near.set_xlim(*_widened(allowed.min(initial=many.best[3]), allowed.max(initial=many.best[3])))
    near.set_ylim(1 - 0.12 * (limit - 1), 1 + 1.15 * (limit - 1))
    decimal_log(ax)
    _ratio_axis(ax)
    near.set_xlabel(axis("velocity", kind, "Stribeck"))
    for part in (ax, near):
        part.set_ylabel("Cost over the\nrefined grid's")
    _above(ax, columns=2)
    return figure


def _widened(low: float, high: float) -> tuple[float, float]:
    """A little more than an interval."""
    margin = 0.15 * (high - low) or 0.05 * high
    return low - margin, high + margin


@styled
def starts_figure(tried: Tried, kind: Kind) -> Figure:
    """Where each random start ends, over where it begins; beneath, the share that ends in the best minimum."""
    figure = new_figure(5.2)
    figure.subplots_adjust(left=0.19, hspace=0.12)
    ax, below = figure.subplots(2, height_ratios=(3, 2), sharex=True)
    many = tried.starts
    _titled(ax, tried.case.label, rows=1)
    edges = np.geomspace(*tried.case.v_s_range, _BINS + 1)
    for name, look in _solvers(tried):
        away, end = many.elsewhere(name), many.ended[name][3]
        for chosen, fill in ((~away, look.colour), (away, "none")):
            ax.plot(
                many.begun[chosen],
                end[chosen],
                look.marker,
                color=look.colour,
                markerfacecolor=fill,
                markersize=5,
                alpha=0.8,
            )
        ax.plot([], [], look.marker, color=look.colour, label=name)
        share = _shares(many.begun, ~away, edges)
        below.plot(np.sqrt(edges[1:] * edges[:-1]), 100 * share, look.marker + look.line, color=look.colour, label=name)
    ax.plot([], [], "o", color="#444444", markerfacecolor="none", label="hollow: elsewhere")
    ax.axhline(many.best[3], color="#000000", linewidth=1, label="refined grid")
    decimal_log(below)
    _final(ax, many)
    below.set_ylim(-5, 105)
    ax.set_ylabel(axis("velocity", kind, "final Stribeck").replace("Stribeck ", "Stribeck\n"))
    below.set_xlabel(axis("velocity", kind, "Stribeck velocity of the start:").replace(": velocity", ""))
    below.set_ylabel("Ends in the best\nminimum (%)")
    _above(ax, columns=5, small=True)
    return figure


@styled
def resolution_figure(trial: Trial) -> Figure | None:
    """Error of v_s by a plain grid, over the statistical one, over the number of its values; None where v_s can be known nowhere."""
    known = [tried for tried in trial.cases if not tried.blind and tried.resolution.floor > 0]
    if not known:
        return None
    many = len({tried.case.label for tried in known}) < len(known)
    figure = new_figure(5.4 if many else 4.2)
    figure.subplots_adjust(top=0.66 if many else 0.78)
    ax = figure.subplots()
    _titled(ax, trial.subject.title, rows=2 + len({tried.case.design for tried in known}) * 2 if many else 2)
    groups = list(dict.fromkeys(_group(tried, many=many) for tried in known))
    for tried in known:
        r, label = tried.resolution, _group(tried, many=many)
        k = groups.index(label)
        named = label if label not in ax.get_legend_handles_labels()[1] else None
        style: dict[str, Any] = {"color": _COLOURS[k % 6], "marker": _MARKERS[k % 6], "linestyle": LINES[k % 3]}
        ax.plot(r.counts, r.error / r.floor, markersize=4, linewidth=0.9 if many else 1.5, label=named, **style)
    ax.axhline(1.0, color="#000000", linewidth=1.4, label="statistical floor: the standard error of vₛ")
    ax.axhline(ENOUGH, color="#666666", linewidth=1, linestyle="--", label="a tenth of it")
    decimal_log(ax)
    _decimal(ax)
    ax.set_xticks(known[0].resolution.counts, [str(n) for n in known[0].resolution.counts])
    ax.set_xlabel("Values in the plain grid over vₛ")
    ax.set_ylabel("Grid error of vₛ\nover its standard error")
    _above(ax, columns=1 if many else 2)
    return figure


@styled
def methods_figure(tried: Tried) -> Figure:
    """Median error and spread of v_s by each method, relative to the truth."""
    figure = new_figure(5.0)
    figure.subplots_adjust(left=0.34)
    ax = figure.subplots()
    title(ax, tried.case.label, simulated=True)
    rows, v_s = list(tried.methods.values()), tried.case.truth.v_s
    reach = 100 * max(abs(m.bias[3]) + m.spread[3] for m in rows if m.failed <= _MOST_FAILED) / v_s
    edge: dict[str, Any] = {"xycoords": ("axes fraction", "data"), "va": "center", "fontsize": 9}
    for k, m in enumerate(rows):
        own = "#D55E00" if m.name == REFINED else "#666666" if m.name.startswith("plain") else "#0072B2"
        centre, half = 100 * m.bias[3] / v_s, 100 * m.spread[3] / v_s
        if abs(centre) + half <= 1.1 * reach:
            ax.errorbar(centre, k, xerr=half, fmt="s" if m.name == REFINED else "o", color=own, capsize=3, markersize=5)
        else:
            x, side = (0.87, "right") if centre > 0 else (0.02, "left")
            ax.annotate(f"off by {centre:.3g} %", (x, k), ha=side, color=own, **edge)
        ax.annotate(f"{100 * m.failed:.3g} %", (1.0, k), ha="right", **edge)
    ax.annotate("fails", (1.0, -0.9), ha="right", **edge)
    ax.axvline(0.0, color="#000000", linewidth=0.8)
    ax.set_ylim(len(rows) - 0.5, -1.4)
    ax.set_xlim(-1.1 * reach, 1.4 * reach)
    ax.set_yticks(range(len(rows)), [m.name for m in rows])
    ax.set_xlabel("Error of vₛ: median and spread (% of the truth)")
    return figure


def _solvers(tried: Tried) -> list[tuple[str, Look]]:
    return [(name, SOLVERS[name]) for name in tried.starts.ended if name != FREE]


def _shares(begun: Array, reached: NDArray[np.bool_], edges: Array) -> Array:
    """Share of the starts in each bin that reached, nan in an empty one."""
    every = np.histogram(begun, edges)[0]
    good = np.histogram(begun[reached], edges)[0]
    share: Array = np.divide(good, every, out=np.full(every.size, np.nan), where=every > 0)
    return share


def _group(tried: Tried, *, many: bool) -> str:
    if not many:
        return shortened(tried.case.label, 40)
    return f"{tried.case.design}, noise {100 * tried.case.noise / tried.case.truth.alpha_0:.2g} %"


def _final(ax: Axes, many: Starts) -> None:
    """The axis of final v_s: logarithmic where they differ by a factor, else plain, and never so narrow that it shows rounding."""
    ends = np.concatenate([[many.best[3]], *(theta[3] for name, theta in many.ended.items() if name != FREE)])
    low, high = float(ends.min()), float(ends.max())
    if high > _LARGE * low:
        _decimal(ax)
        return
    ax.set_ylim(min(low * 0.98, (1 - _NARROW) * many.best[3]), max(high * 1.02, (1 + _NARROW) * many.best[3]))
    ax.yaxis.set_major_locator(MaxNLocator(5))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:.3g}"))


def _ratio_axis(ax: Axes) -> None:
    """Ratios from 1 up, with a little room beneath: a logarithmic axis where they are large."""
    top = ax.get_ylim()[1]
    if top > _LARGE:
        _decimal(ax)
        ax.set_ylim(top**-0.06, top**1.05)
    else:
        ax.set_ylim(1 - 0.06 * (top - 1), top)


def _decimal(ax: Axes) -> None:
    """A logarithmic y axis with plain decimal labels."""
    wide = ax.dataLim.y1 > _WIDE * max(ax.dataLim.y0, 1e-300)
    ax.set_yscale("log")
    ax.yaxis.set_major_locator(LogLocator(subs=(1.0,) if wide else (1.0, 2.0, 5.0), numticks=12))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g}"))
    ax.yaxis.set_minor_locator(NullLocator())


def _titled(ax: Axes, label: str, rows: int) -> None:
    """The title above a legend of so many rows, which stands above the axes."""
    title(ax, label, simulated=True)
    ax.set_title(ax.get_title(loc="left"), loc="left", pad=8 + 13.5 * rows)


def _above(ax: Axes, columns: int, *, small: bool = False) -> None:
    """The legend above the axes."""
    extra: dict[str, Any] = {"handletextpad": 0.3, "columnspacing": 0.7, "handlelength": 1.6} if small else {}
    ax.legend(
        loc="lower left",
        bbox_to_anchor=(0, 1.0),
        ncols=columns,
        frameon=False,
        borderaxespad=0.2,
        fontsize=8.5,
        **extra,
    )


def showcase(trial: Trial, most: int = 6) -> Sequence[Tried]:
    """The cases that are drawn one by one: all of a joint's own, of a sweep the first set at its second noise level."""
    if len(trial.cases) <= most:
        return trial.cases
    first = trial.cases[0].case
    noises = [t.case.noise for t in trial.cases if t.case.label == first.label]
    return [t for t in trial.cases if t.case.label == first.label and t.case.noise == max(noises)]
