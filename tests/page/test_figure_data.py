"""The data of a figure: what is drawn stands in its table, by name, and nothing else does."""

import csv
import io
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bristle.page.figure_data import csv_of

Rows = list[tuple[str, str, str, str]]


def series(draw: Callable[[Axes], object]) -> Rows:
    """Series, x, y and value of each row of what a function draws on one panel."""
    figure = Figure()
    ax = figure.subplots()
    draw(ax)
    ax.set_xlabel("time (s)")
    ax.set_ylabel("torque (N·m)")
    head, *rows = csv.reader(io.StringIO(csv_of(figure).decode("utf-8")))
    assert head == ["panel", "series", "x", "y", "value"]
    assert {row[0] for row in rows} <= {"1: torque (N·m) vs time (s)"}
    return [(name, x, y, value) for _, name, x, y, value in rows]


@given(arrays(float, (7, 2), elements=st.floats(-1e9, 1e9, width=32)))
def test_a_line_is_read_back(points: "np.ndarray[tuple[int, int], np.dtype[np.float64]]") -> None:
    """The points of a line, to seven digits, in their order."""
    rows = series(lambda ax: ax.plot(*points.T, label="measured"))
    assert {name for name, *_ in rows} == {"measured"}
    np.testing.assert_allclose([[float(x), float(y)] for _, x, y, _ in rows], points, rtol=1e-6)


@pytest.mark.parametrize(
    ("draw", "expected"),
    [
        (lambda ax: ax.plot([1], [2], label="_hidden"), [("hidden", "1", "2", "")]),
        (lambda ax: ax.plot([1], [2]), [("line 1", "1", "2", "")]),
        (lambda ax: ax.axvline(3.0, label="limit"), [("limit", "3", "", "")]),
        (lambda ax: ax.axhline(3.0, label="level"), [("level", "", "3", "")]),
        (lambda ax: ax.scatter([1], [2], label="points"), [("points", "1", "2", "")]),
        (lambda ax: ax.plot([1, 2], [np.nan, 2], label="gap"), [("gap", "1", "", ""), ("gap", "2", "2", "")]),
        (lambda ax: ax.bar([0, 1], [5, 6], tick_label=["wrist", "elbow"], label="rms"), [("rms", "wrist", "5", ""), ("rms", "elbow", "6", "")]),
        (lambda ax: ax.barh([0, 1], [5, 6], tick_label=["wrist", "elbow"], label="rms"), [("rms", "5", "wrist", ""), ("rms", "6", "elbow", "")]),
        (lambda ax: ax.imshow([[1.5, 2.5]], label="map"), [("map", "0", "0", "1.5"), ("map", "1", "0", "2.5")]),
        (lambda ax: ax.pcolormesh([0, 1, 2], [0, 2], [[1.5, 2.5]], label="map"), [("map", "0.5", "1", "1.5"), ("map", "1.5", "1", "2.5")]),
        (lambda ax: ax.vlines([1], 2, 3, label="edges"), [("edges", "1", "2", ""), ("edges", "1", "3", "")]),
        (lambda ax: ax.plot([1], [2], label='=cmd|" /C calc"!A0'), [('\'=cmd|" /C calc"!A0', "1", "2", "")]),
        (lambda ax: ax.text(0, 0, "a word") and ax.legend(handles=[]), []),
    ],
)  # fmt: skip  # a table
def test_a_mark_is_a_row_for_each_of_its_places(draw: Callable[[Axes], object], expected: Rows) -> None:
    """Lines, points, bars, maps and limits, under their names; words, legends and frames are no data; no name is a formula."""
    assert series(draw) == expected


def test_error_bars_have_the_name_of_their_points() -> None:
    """The ends of a bar stand under the label that the whole was given."""
    rows = series(lambda ax: ax.errorbar([1.0], [2.0], [0.5], capsize=2, label="points"))
    assert {name for name, *_ in rows} == {"points"}
    assert {y for _, _, y, _ in rows} >= {"1.5", "2", "2.5"}


def test_pieces_of_a_series_are_apart() -> None:
    """Two lines of one name would otherwise be joined by whoever draws them anew."""
    rows = series(lambda ax: [ax.plot([k, k + 1], [k, k], label="run") for k in (0, 5)])
    assert rows[2] == ("run", "", "", "")


def test_a_scale_of_colours_is_no_panel() -> None:
    """The numbers of a map stand once, not as its scale too."""
    figure = Figure()
    ax = figure.subplots()
    figure.colorbar(ax.imshow([[1.0, 2.0]]), ax=ax)
    rows = list(csv.reader(io.StringIO(csv_of(figure).decode())))[1:]
    assert [row[0] for row in rows] == ["1: ", "1: "]
