"""Sections on intervals by covariance, profile and bootstrap, and on the scatter of the runs."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import groupby
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from bristle.identification.known_joint import moving_fits
from bristle.identification.results import Joint
from bristle.model.parameters import Direction, ParameterName
from bristle.page.page import Drawing
from bristle.page.report import Section, Table
from bristle.page.style import LINES, decimal_log, new_figure, styled, title
from bristle.page.wording import FITS, counted, direction, in_print, number, pretty, span, symbol
from bristle.questions.joint_report.tables import WAYS, IntervalRow, interval_rows, scatter

INTRO = (
    "Each 95 % interval by the covariance of the exact Jacobian, by the profile of the cost (the parameter held, all "
    "others re-optimised), and by the bootstrap (fits of resampled data). Use the interval by profile; for fits of "
    "moving runs that by covariance. Where the bounds differ by more than 1.5x, the last column says why."
)
_COLOURS = dict(zip(WAYS, ("#000000", "#0072B2", "#D55E00"), strict=True))
_TOP = 2.4  # height of the drawn profile, thresholds
_FEW = 20  # points of a profile below which each is drawn


def intervals(joint: Joint, figures: Mapping[str, Drawing]) -> list[Section]:
    """A table per fit, the scatter of the runs, and a figure per fit."""
    every, sections = list(interval_rows(joint)), list[Section]()
    for fit, rows in groupby(every, key=lambda row: row.fit):
        cells = [
            (
                x.name, x.estimate.value, *(span(getattr(x.three, way)) for way in WAYS), x.estimate.unit,
                " ".join(map(in_print, x.three.warnings)),
            )
            for x in rows
        ]  # fmt: skip  # one row
        frame = pd.DataFrame(cells, columns=["parameter", "value", *WAYS, "unit", "warnings"])
        sections.append(
            Section("", table=Table("uncertainty", FITS.get(fit, fit).capitalize(), part=frame), form="part")
        )
    missing = [FITS[kind] for kind, fit in moving_fits(joint).items() if not fit.uncertainty]
    if missing and every:
        add = "Their profiles and bootstrap take time: bristle report … --uncertainty adds them."
        sections.append(Section("", text=f"Not included: {' and '.join(missing)}. {add}", form="part"))

    scattered = [
        (
            FITS.get(kind, kind), str(ParameterName(name, Direction(d))), number(x.before, 3), f"{x.widened:.3g}",
            ", ".join(number(value) for value in x.by_run.values()),
        )
        for kind, d, name, x in scatter(joint)
    ]  # fmt: skip  # one row, one line
    if scattered:
        how = (
            "How far the runs' estimates scatter beside their own standard errors: √(χ² / (k − 1)) over k runs, 1 "
            "where chance alone tells them apart. Where that is significant at 1 %, standard errors and intervals are "
            "widened by it."
        )
        frame = pd.DataFrame(scattered, columns=["fit", "parameter", "scatter", "error times", "each run"])
        table = Table("repeats", "Scatter over the runs", part=frame)
        sections.append(Section("Each run fitted apart", text=how, table=table, form="folded"))

    apart = sum(any(w.code == "intervals-differ" for w in x.three.warnings) for x in every)
    of = f"Of {counted(len(every), 'parameter')} of this joint {apart or 'none'}"
    caption = f"{of} {'has' if apart <= 1 else 'have'} bounds that differ by more than 1.5x."
    how = (
        "Per parameter: change of cost with all others re-optimised, 0 at the minimum and 1 at the 95 % threshold "
        "(dotted); bootstrap samples (grey); below, the intervals by covariance (top), profile and bootstrap (bottom); "
        "dashed: the estimate."
    )
    if held := " and ".join(own.symbol for own in joint.law.peak.own):
        caption += f" The drawn cost holds {held} at its estimate; the profile intervals are over all that the data allow of it."
    drawn = [x for kind, x in figures.items() if kind.startswith("uncertainty-")]
    if drawn:
        own = tuple(x._replace(caption=caption, how=how, data="uncertainty") for x in drawn)
        sections.append(Section("", figures=own, form="part"))
    return sections


def figures(joint: Joint) -> dict[str, Callable[[], Figure]]:
    """Functions that draw each fit's parameters, by name of the file."""
    found: dict[str, list[IntervalRow]] = {}
    for row in interval_rows(joint):
        side = {"+": "-positive", "-": "-negative"}.get(row.direction, f"-{row.direction}")
        found.setdefault(f"{row.fit}{'' if row.fit == 'presliding' else side}", []).append(row)
    return {name: partial(uncertainty_figure, joint, own) for name, own in found.items()}


@styled
def uncertainty_figure(joint: Joint, own: Sequence[IntervalRow]) -> Figure:
    """A panel per parameter: profile with threshold, bootstrap draws, and the three intervals as bars below."""
    count = (len(own) + 1) // 2
    height = 1.1 + 2.6 * count
    figure = new_figure(height)
    figure.subplots_adjust(hspace=0.42, wspace=0.14, left=0.105, right=0.945, bottom=1.15 / height)
    axes = figure.subplots(count, 2, squeeze=False)
    for ax in axes.ravel()[len(own) :]:
        ax.set_axis_off()
    for ax, row in zip(axes.ravel(), own, strict=False):
        _panel(ax, row)
    for ax in axes[:, 0]:
        ax.set_ylabel("Change of cost (thresholds)")
    title(axes[0, 0], f"{joint.name}, {FITS.get(own[0].fit, own[0].fit)}", joint.simulated)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=3, bbox_to_anchor=(0.5, 0.0))
    return figure


def _panel(ax: Axes, row: IntervalRow) -> None:
    three, value = row.three, row.estimate.value
    # The panel holds the finite ends of the intervals and the estimate, with a margin.
    ends = [end for way in WAYS for end in getattr(three, way) or () if np.isfinite(end)]
    ends += [value] if value is not None else []
    low, high = min(ends, default=0.0), max(ends, default=1.0)
    margin = 0.35 * (high - low) or 0.1 * abs(high) or 1.0
    low, high = max(low - margin, 0.0) if low >= 0 else low - margin, high + margin
    ax.set_xlim(low, high)
    if low > 0 and high > 8 * low:
        decimal_log(ax)
    else:
        ax.xaxis.set_major_locator(MaxNLocator(3, prune="both"))
    if three.draws.size and high - low > 1e-12 * abs(high):  # data without noise have less
        inside = three.draws[(three.draws >= low) & (three.draws <= high)]
        counts, edges = np.histogram(inside, 24, (low, high))
        ax.stairs(1.9 * counts / max(counts.max(), 1), edges, fill=True, color="#cccccc", label="bootstrap draws")
    line, order = ".-" if three.curve.shape[1] < _FEW else "-", np.argsort(three.curve[0])
    cost: dict[str, Any] = {"color": _COLOURS["profile"], "linewidth": 1.4, "label": "cost (1: threshold)"}
    ax.plot(*three.curve[:, order], line, **cost)
    ax.axhline(1.0, color="#666666", linestyle=":", linewidth=1, label="_95 % threshold")
    for k, way in enumerate(WAYS):
        interval = getattr(three, way)
        if interval is not None:
            ax.plot(
                np.clip(interval, low, high),
                [-0.3 - 0.28 * k] * 2,
                LINES[k],
                marker="|",
                color=_COLOURS[way],
                linewidth=2,
                label=way,
            )
    if value is not None:
        ax.axvline(value, color="black", linewidth=0.8, linestyle="--", label="_estimate")
    ax.set_ylim(-1.15, _TOP)
    ax.set_yticks([0.0, 1.0, 2.0])
    where = "" if row.direction in {"both", "shared"} else f" {direction(row.direction)}"
    ax.set_xlabel(f"{symbol(row.parameter)}{where} ({pretty(row.estimate.unit)})")
