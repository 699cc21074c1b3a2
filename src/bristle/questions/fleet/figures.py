"""Matplotlib figures of a fleet: a joint over its sessions, and warnings over time."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from bristle.arrays import Array
from bristle.page.style import DIRECTION, panels, styled, thinned
from bristle.page.wording import shortened

_BLUE, _VERMILION, _GREY = DIRECTION["+"].colour, DIRECTION["-"].colour, "#767676"
POINTS = 200  # most sessions drawn in a panel
_BEYOND = 3.0  # largest reach of an axis for intervals and limits, over the range of the values
CODES = 5  # most warnings drawn over time, beside failed sessions
_LOOKS = (
    (_BLUE, "o", "-"), (_VERMILION, "s", "--"), ("#009E73", "^", ":"), ("#CC79A7", "D", "-."), ("#997700", "v", "-"), (_GREY, "x", "--"),
)  # fmt: skip  # colour, marker and line of the most frequent codes, and of failed sessions


class Course(NamedTuple):
    """One parameter of a joint over its sessions."""

    label: str  # with the unit
    rows: pd.DataFrame  # of `Findings.series`, by session
    step: Any  # row of `Findings.changes`; None if it was not tested


@styled
def joint_figure(name: str, first: pd.Timestamp, courses: Sequence[Course], *, simulated: bool) -> Figure:
    """Courses of a joint, whose baseline began at `first`: values, intervals, adjusted values, limits and the step."""
    figure, axes = panels(1.1 + 1.7 * len(courses), name, simulated, len(courses), sharex=True)
    figure.subplots_adjust(left=0.2, hspace=0.16)
    for ax, one in zip(axes, courses, strict=True):
        _course(ax, one, first)
    _dated(axes[-1])
    figure.align_ylabels()
    return figure


def _course(ax: Axes, one: Course, first: pd.Timestamp) -> None:
    rows = one.rows.iloc[thinned(len(one.rows), POINTS)]
    x, sessions = _days(rows["session"]), rows["session"].to_numpy()
    names = ("value", "lower", "upper", "adjusted", "limit_low", "limit_high")
    value, lower, upper, adjusted, low, high = (rows[name].to_numpy(float) for name in names)
    # The level before the step holds from the baseline's first session on.
    begun = int(np.searchsorted(sessions, np.datetime64(first)))
    place = len(x) if one.step is None else int(np.searchsorted(sessions, np.datetime64(one.step.since)))
    levels = [] if one.step is None else [(one.step.before, x[begun:place]), (one.step.after, x[place:])]

    core = np.array([*value, *adjusted, *(level for level, _ in levels)])
    core = core[np.isfinite(core)] if np.isfinite(core).any() else np.array([0.0, 1.0])
    bars = (upper - lower)[np.isfinite(upper - lower)]
    wide = max(np.ptp(core), bars.max(initial=0.0), 1e-9 * abs(core.max()), 1e-300)
    # The axis holds all values, and ends of intervals and limits that are not too far from them.
    ends = np.concatenate([lower, upper, low, high])
    ends = ends[(ends > core.min() - _BEYOND * wide) & (ends < core.max() + _BEYOND * wide)]
    bottom, top = ends.min(initial=core.min()), ends.max(initial=core.max())
    margin = 0.06 * (top - bottom or wide)
    bottom, top = bottom - margin, top + margin

    limits, intervals = (np.clip(x, bottom, top) for x in ((low, high), (lower, upper)))
    ax.fill_between(x, *limits, color=_GREY, alpha=0.18, linewidth=0, label="limits")
    ax.vlines(x, *intervals, color=_BLUE, linewidth=1.5, label="95 % interval")
    ax.plot(x, adjusted, "D", color=_GREY, markerfacecolor="none", markersize=6.5, label="adjusted")
    ax.plot(x, value, "o", color=_BLUE, markersize=5, label="value")
    for (level, held), what in zip(levels, ("before", "after"), strict=False):
        if held.size and np.isfinite(level):
            ax.plot(held[[0, -1]], [level, level], "--", color=_VERMILION, linewidth=2, label=what)
    for at, colour, line, what in ((begun, _GREY, "-", "new baseline"), (place, _VERMILION, ":", "step")):
        if 0 < at < len(x):
            ax.axvline((x[at - 1] + x[at]) / 2, color=colour, linestyle=line, linewidth=1.8, label=what)
    ax.set_ylim(bottom, top)
    ax.set_ylabel(one.label)
    ax.yaxis.set_major_locator(MaxNLocator(4))


def _days(times: pd.Series) -> Array:
    """Times in matplotlib's days since 1970."""
    days: Array = times.to_numpy("datetime64[us]").astype(float) / 86_400e6
    return days


def _dated(ax: Axes) -> None:
    """An axis of times in UTC, at least four days wide."""
    locator = AutoDateLocator(minticks=3, maxticks=7)  # type: ignore[no-untyped-call]
    ax.xaxis.set_major_locator(locator)
    ax.xaxis.set_major_formatter(ConciseDateFormatter(locator))  # type: ignore[no-untyped-call]
    low, high = ax.get_xlim()
    if high - low < 2:
        ax.set_xlim(low - 2, high + 2)
    ax.set_xlabel("Session (UTC)")


@styled
def quality_figure(quality: pd.DataFrame, codes: Sequence[str], *, simulated: bool) -> Figure | None:
    """Percent of the joint-sessions of each period with these codes, `failed` among them; None without codes."""
    if not codes:
        return None
    figure, (ax,) = panels(3.0, "Data quality", simulated)
    percent = quality.pivot_table(index="period", columns="code", values="percent", aggfunc="max", observed=True)
    percent = percent.reindex(np.sort(quality["period"].unique())).fillna(0.0)
    for k, code in enumerate(codes):
        colour, marker, line = _LOOKS[CODES if code == "failed" else k]
        look: dict[str, Any] = {"color": colour, "marker": marker, "linestyle": line}
        ax.plot(_days(percent.index.to_series()), percent[code], markersize=5, label=shortened(code, 30), **look)
    _dated(ax)
    ax.set_ylim(bottom=0)
    ax.set_ylabel("Joint-sessions (%)")
    figure.subplots_adjust(bottom=0.19 + 0.07 * -(-len(codes) // 3))
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=3, frameon=False)
    return figure
