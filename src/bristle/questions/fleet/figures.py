"""The charts of a fleet as Bokeh models, empty, and the numbers that the page's script fills them with.

No text of a user goes into a model. A source's name is its renderer's; the script finds figures and sources by them.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.page.bokeh_page import GREY, bare_plot, packed_numbers, plain_axes
from bristle.page.style import DIRECTION
from bristle.questions.fleet.tables import JOINTS, codes_in
from bristle.questions.fleet.text import rows_of, totals

if TYPE_CHECKING:
    from bokeh.models import Plot

BLUE, VERMILION = DIRECTION["+"].colour, DIRECTION["-"].colour
POINTS = 120_000
"""Of charts over time on a page, at most: the joints ranked first have theirs."""
_STEPS = 65534
"""A point is told in so many steps of its chart's range, which no screen tells apart; one more is no number."""
_BEYOND = 20.0
"""Ends of intervals and limits are told no farther from the values than so many times their range."""
COLUMNS = ("value", "lower", "upper", "adjusted", "limit_low", "limit_high")
CODES = 5
"""Kinds of warnings drawn over time, at most, beside failed sessions."""


class CodeLook(NamedTuple):
    """How a kind of warning is drawn: told apart without colours too."""

    colour: str
    marker: str
    dash: str


LOOKS = (
    CodeLook(BLUE, "circle", "solid"), CodeLook(VERMILION, "square", "dashed"), CodeLook("#009E73", "triangle", "dotted"),
    CodeLook("#CC79A7", "diamond", "dashdot"), CodeLook("#997700", "inverted_triangle", "solid"), CodeLook(GREY, "x", "dashed"),
)  # fmt: skip  # a table
"""Of the most frequent codes, and last that of failed sessions; 3:1 on white and on near black."""


def fleet_plots() -> dict[str, "Plot"]:
    """Every chart, empty, by its name."""
    return {"time": _time(), "units": _units(), "quality": _quality()}


def _time() -> Any:
    """One parameter of one joint: values with intervals, adjusted, the limits for one more session, and the step."""
    from bokeh.models import HoverTool
    from bokeh.models.annotations.geometry import Span

    plot = bare_plot("time", 340, "datetime", x_range=(0, 1), y_range=(0, 1))
    source = _source("points", ("x", *COLUMNS))
    plot.varea("x", "y1", "y2", source=_source("limits", ("x", "y1", "y2")), color=GREY, alpha=0.18)
    for name in ("before", "after"):
        plot.line("x", "y", source=_source(name, ("x", "y")), color=VERMILION, line_width=2.5, line_dash="dashed")
    plot.segment("x", "lower", "x", "upper", source=source, color=BLUE, line_width=1.5)
    adjusted = plot.scatter(
        "x", "adjusted", source=source, size=10, marker="diamond", line_color=GREY, fill_color=None, line_width=1.5
    )
    value = plot.scatter("x", "value", source=source, size=7, color=BLUE)
    plot.add_layout(Span(name="begun", dimension="height", line_color=GREY, line_width=2, visible=False))
    plot.add_layout(
        Span(name="step", dimension="height", line_color=VERMILION, line_width=2, line_dash="dotted", visible=False)
    )
    tips = [
        ("session", "@x{%F %H:%M} UTC"),
        ("value", "@value{0.00000}"),
        ("95 %", "@lower{0.00000} to @upper{0.00000}"),
    ]
    tips += [("adjusted", "@adjusted{0.00000}"), ("limits", "@limit_low{0.00000} to @limit_high{0.00000}")]
    plot.add_tools(
        HoverTool(
            renderers=[value, adjusted], tooltips=tips, formatters={"@x": "datetime"}, point_policy="snap_to_data"
        )
    )
    plain_axes(plot)
    return plot


def _units() -> Any:
    """The units of one type, ordered by value: own values with intervals, shrunken ones beside, the type's mean and spread."""
    from bokeh.models import HoverTool
    from bokeh.models.annotations.geometry import BoxAnnotation, Span

    plot = bare_plot("units", 340, x_range=(0, 1), y_range=(0, 1))
    names = ("x", "value", "lower", "upper", "beside", "shrunken", "row")
    plot.add_layout(BoxAnnotation(name="spread", fill_color=GREY, fill_alpha=0.2, line_color=None, bottom=0, top=0))
    plot.add_layout(Span(name="mean", dimension="width", line_color=GREY, line_width=2, line_dash="dashed", location=0))
    told = []
    for name, colour, marker in (("within", BLUE, "circle"), ("outside", VERMILION, "square")):
        source = _source(name, names)
        plot.segment("x", "lower", "x", "upper", source=source, color=colour, line_width=1.2)
        plot.scatter(
            "beside",
            "shrunken",
            source=source,
            size=7,
            marker="diamond",
            line_color=GREY,
            fill_color=None,
            line_width=1.5,
        )
        told.append(plot.scatter("x", "value", source=source, size=6, marker=marker, color=colour))
    here = {"marker": "circle", "fill_color": None, "line_color": GREY, "line_width": 3, "size": 16}
    plot.scatter("x", "value", source=_source("here", ("x", "value")), **here)
    plot.add_tools(HoverTool(renderers=told, tooltips=None, mode="mouse"))  # the script says whose value it is
    plain_axes(plot)
    plot.xaxis.ticker.min_interval = 1
    return plot


def _quality() -> Any:
    """Percent of the joint-sessions of each period that have a kind of warning."""
    plot = bare_plot("quality", 300, "datetime", x_range=(0, 1), y_range=(0, 1))
    for k, look in enumerate(LOOKS):
        source = _source(f"quality{k}", ("x", "y"))
        plot.line("x", "y", source=source, color=look.colour, line_width=1.8, line_dash=look.dash)
        plot.scatter("x", "y", source=source, color=look.colour, size=7, marker=look.marker)
    plain_axes(plot)
    return plot


def _source(name: str, columns: Sequence[str]) -> Any:
    from bokeh.models import ColumnDataSource

    return ColumnDataSource(name=name, data={column: [] for column in columns})


class Grid(NamedTuple):
    """Where each value of a page's series lies: a block per joint and quantity, with a place for every session of the joint."""

    joint: NDArray[np.intp]
    """Of each block, (b,)."""
    quantity: NDArray[np.intp]
    """(b,)."""
    begin: NDArray[np.intp]
    """(b,)."""
    size: int
    sessions: NDArray[np.int64]
    """Of all joints, one after another, ms since 1970."""
    counts: NDArray[np.intp]
    """Sessions of each joint, (joints,)."""
    place: NDArray[np.intp]
    """Of each row of the series, (rows,)."""


def packed_series(
    series: pd.DataFrame, changes: pd.DataFrame, joints: pd.DataFrame, known: pd.DataFrame
) -> tuple[dict[str, Any], int]:
    """The charts over time of the joints ranked first, for the page's script, and of how many joints they are.

    Args:
        series: of the findings, as the next two.
        changes: the tests of a step.
        joints: ranked.
        known: what `quantities_of` gave.
    """
    number = _ranks(series, joints)
    points = np.bincount(number[number >= 0], minlength=len(joints)).cumsum()
    most = min(JOINTS, int(np.searchsorted(points, POINTS, side="right")))
    rows = series[(number >= 0) & (number < most)]
    grid = _grid(number[(number >= 0) & (number < most)], codes_in(rows, known), rows["session"], most)
    low, step, codes = _quantised(rows, grid)
    data = {
        "joint": packed_numbers(grid.joint, "u2"), "quantity": packed_numbers(grid.quantity, "u2"), "counts": packed_numbers(grid.counts, "u2"),
        "sessions": packed_numbers(grid.sessions, "f8"), "low": packed_numbers(low, "f8"), "step": packed_numbers(step),
        **{name: packed_numbers(codes[k], "u2") for k, name in enumerate(COLUMNS)},
        "steps": _packed_steps(changes, joints, known, grid),
    }  # fmt: skip  # a table
    return data, most


def _ranks(frame: pd.DataFrame, joints: pd.DataFrame) -> NDArray[np.intp]:
    """Which of the ranked joints each row is about, from 0; -1: none of them."""
    if frame.empty or joints.empty:
        return np.full(len(frame), -1, dtype=np.intp)
    pairs = pd.MultiIndex.from_frame(joints[["unit", "joint"]].astype(str))
    return pairs.get_indexer(pd.MultiIndex.from_frame(frame[["unit", "joint"]].astype(str))).astype(np.intp)


def _grid(number: NDArray[np.intp], quantity: NDArray[np.intp], session: pd.Series, joints: int) -> Grid:
    ms = session.to_numpy("datetime64[ms]").astype(np.int64)
    visits, visit = np.unique(np.stack([number, ms]), axis=1, return_inverse=True)
    counts = np.bincount(visits[0], minlength=joints).astype(np.intp)
    blocks, block = np.unique(np.stack([number, quantity]), axis=1, return_inverse=True)
    length = counts[blocks[0]]
    begin = (length.cumsum() - length).astype(np.intp)
    first = counts.cumsum() - counts
    place = begin[block.ravel()] + visit.ravel() - first[number]
    return Grid(blocks[0], blocks[1], begin, int(length.sum()), visits[1], counts, place)


@np.errstate(invalid="ignore")  # an open interval has no width, and a block without values no range
def _quantised(rows: pd.DataFrame, grid: Grid) -> tuple[Array, Array, NDArray[np.int64]]:
    """Of each block the least value told and the step, and every column in steps."""
    values = np.full((len(COLUMNS), grid.size), np.nan)
    values[:, grid.place] = rows[list(COLUMNS)].to_numpy(float).T
    if not grid.begin.size:
        return np.zeros(0), np.zeros(0), np.zeros((len(COLUMNS), 0), dtype=np.int64)
    block = np.repeat(np.arange(grid.begin.size), np.diff([*grid.begin, grid.size]))
    core = values[[0, 3]]
    least, most = (_over(way, core, empty, grid.begin) for way, empty in ((np.minimum, np.inf), (np.maximum, -np.inf)))
    bars = np.where(np.isfinite(values[2] - values[1]), values[2] - values[1], 0.0)
    wide = np.maximum.reduceat(np.maximum(most - least, 0)[block] + bars, grid.begin) + 1e-9 * np.maximum(
        abs(least), abs(most)
    )
    wide = np.where(np.isfinite(wide), wide, 0.0)
    told = np.clip(values, (least - _BEYOND * wide)[block], (most + _BEYOND * wide)[block])
    low, high = (_over(way, told, empty, grid.begin) for way, empty in ((np.minimum, np.inf), (np.maximum, -np.inf)))
    low, step = np.where(np.isfinite(low), low, 0.0), np.where(high > low, (high - low) / _STEPS, 1.0)
    steps = np.round((told - low[block]) / step[block])
    return low, step, np.where(np.isfinite(steps), steps, _STEPS + 1).astype(np.int64)


def _over(way: np.ufunc, values: Array, empty: float, begin: NDArray[np.intp]) -> Array:
    """The least or the largest finite number of each block."""
    flat: Array = way.reduceat(way.reduce(np.where(np.isnan(values), empty, values), axis=0), begin)
    return flat


def _packed_steps(changes: pd.DataFrame, joints: pd.DataFrame, known: pd.DataFrame, grid: Grid) -> dict[str, Any]:
    """The tested step of each block, nan where it was not tested."""
    number, quantity = _ranks(changes, joints), codes_in(changes, known)
    place = pd.MultiIndex.from_arrays([grid.joint, grid.quantity]).get_indexer(
        pd.MultiIndex.from_arrays([number, quantity])
    )
    names = ("before", "after", "percent", "percent_lower", "percent_upper", "p")
    own = changes[place >= 0].assign(since=changes["since"].astype("datetime64[us]"))
    found = {name: np.full(grid.begin.size, np.nan) for name in (*names, "since", "changed")}
    for name in (*names, "changed"):
        found[name][place[place >= 0]] = own[name].to_numpy(float)
    ms = own["since"].to_numpy("datetime64[ms]")
    found["since"][place[place >= 0]] = np.where(np.isnat(ms), np.nan, ms.astype(float))
    return {name: packed_numbers(x, "f8" if name == "since" else "f4") for name, x in found.items()}


def spreads(types: pd.DataFrame, units: pd.DataFrame, known: pd.DataFrame) -> list[dict[str, Any]]:
    """Of each type and quantity, in order: its mean with interval, the band in which 95 % of the units are, and how many units have a value."""
    pairs = pd.MultiIndex.from_arrays([units["type"].astype(str), codes_in(units, known)])
    counts = pairs.value_counts() if len(units) else pd.Series(dtype=int)
    level = pd.Series(units["value"].to_numpy(float), index=pairs)
    found = []
    for row, code in zip(rows_of(types), codes_in(types, known).tolist(), strict=True):
        key = (str(row.type), code)
        if key not in counts.index:
            continue
        # By logarithms where every value is positive, as the spread was estimated; else in parts of the median size.
        mean, reach = float(row.mean), 1.96 * float(row.spread_percent) / 100
        values = level.loc[[key]].to_numpy(float)
        size = reach * float(np.median(np.abs(values)))
        low, high = mean - size, mean + size
        if (values > 0).all():
            low, high = mean * float(np.exp(-reach)), mean * float(np.exp(reach))
        found.append(
            {
                "type": key[0], "quantity": code, "mean": row.mean, "low": low, "high": high, "count": int(counts.loc[key]),
                "spread": row.spread_percent,
            }
        )  # fmt: skip  # a table
    return found


def quality_over_time(quality: pd.DataFrame) -> dict[str, Any]:
    """The most frequent cautions and critical warnings, and failed sessions, in percent of each period's joint-sessions."""
    if quality.empty:
        return {"periods": [], "of": [], "codes": []}
    periods = quality.drop_duplicates("period").sort_values("period")
    ms = periods["period"].to_numpy("datetime64[ms]").astype(np.int64)
    whole = totals(quality)
    grave = whole[whole["severity"].isin(["caution", "critical"]) & (whole["joint_sessions"] > 0)]["code"].astype(str)
    chosen = [code for code in grave if code != "failed"][:CODES]
    looks = dict(zip(chosen, range(CODES), strict=False)) | ({"failed": CODES} if "failed" in set(grave) else {})
    percent = quality.assign(code=quality["code"].astype(str)).pivot_table(
        index="period", columns="code", values="percent", aggfunc="max"
    )
    percent = percent.reindex(periods["period"])
    return {
        "periods": ms.tolist(), "of": periods["of"].tolist(),
        "codes": [{"code": code, "look": k, "percent": percent[code].fillna(0.0).round(3).tolist()} for code, k in looks.items()],
    }  # fmt: skip  # a table
