"""What holds of every figure of a joint: units on its axes, names that stay text, and nothing drawn where nothing is known."""

import re
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure

from bristle.data.record import Record
from bristle.identification.results import Joint
from bristle.page.style import MOST_POINTS, render_as, thinned
from bristle.questions.joint_report import presliding as presliding_page
from bristle.questions.joint_report import static_figures
from bristle.questions.joint_report.figures import DRAW

from .conftest import HOSTILE, only
from .moving import moving, tracked

UNIT = re.compile(r"\([^()]+\)|\(\([^()]+\)²\)$")
STATIC = ["curve", "profile", "residuals"]
SLOW = ["presliding", "hysteresis"]
MOVING = ["tracking", "tracking-velocity"]


def drawn(joint: Joint) -> dict[str, Figure]:
    """The figures of a joint, but for the small one, whose words stand beside it."""
    found = {kind: draw(joint) for kind, draw in DRAW.items() if kind != "small"}
    return {kind: figure for kind, figure in found.items() if figure is not None}


def test_every_axis_has_a_quantity_and_a_unit(record: Record) -> None:
    """Each label of each figure ends in a unit; a joint that slides has neither N·m nor rad."""
    joint = moving()
    for kind in ("revolute", "prismatic"):
        figures = drawn(replace(joint, kind=kind))
        assert [*figures] == [*STATIC, *SLOW, *MOVING]
        loops = len(figures["hysteresis"].axes)
        assert loops == presliding_page.MOST_LOOPS
        more = (static_figures.stribeck_figure(), static_figures.inspect_figure([record], joint.segments, kind))
        axes = [ax for figure in (*figures.values(), *more) for ax in figure.axes]
        assert len(axes) == 2 + 2 + 3 + 2 + loops + 2 * 2 + 1 + 2
        labels = [label for ax in axes for label in (ax.get_xlabel(), ax.get_ylabel())]
        assert [label for label in labels if not UNIT.search(label)] == [""] * 2  # above residuals over the same axis
        own = [label for f in figures.values() for ax in f.axes for label in (ax.get_xlabel(), ax.get_ylabel())]
        assert any("N·m" in label or "rad" in label for label in own) == (kind == "revolute")
    assert static_figures.inspect_figure([], [], "prismatic").axes


def test_names_are_text_and_simulated_data_say_so() -> None:
    """In each SVG, which may travel alone, markup is escaped, a dollar sign starts no formula, and simulated data are called so."""
    joint = moving(HOSTILE, HOSTILE)
    for kind, figure in drawn(joint).items():
        svg = render_as(figure, "svg")
        assert ET.fromstring(svg).tag.endswith("svg")  # noqa: S314 # our own file
        assert b"SIMULATED" in svg, kind
        assert b"<script" not in svg, kind
        assert kind != "residuals" or (b"&lt;script&gt;" in svg and b'"$x$"' in svg)
    assert b"SIMULATED" not in render_as(static_figures.curve_figure(replace(joint, simulated=False)), "svg")


def test_what_does_not_exist_is_not_drawn(joint: Joint, slow: Joint, slide: Joint) -> None:
    """Without a profile, residuals, runs of a kind, their fits, loops or equations there is no such figure."""
    empty = np.zeros(0)
    none = tracked(time=empty, velocity=empty, measured=empty, residuals=empty, starts_of_runs=(0,))
    assert [*drawn(joint)] == [*drawn(replace(joint, tracking=none))] == STATIC
    assert [*drawn(only(slow, fits={}, loops=()))] == STATIC
    assert [*drawn(slide)] == ["curve"]


def test_dense_data_are_thinned() -> None:
    """At most MOST_POINTS of many points are drawn, the first and last among them; few points all are."""
    many = thinned(100_000)
    assert (many.size, many[0], many[-1]) == (MOST_POINTS, 0, 99_999)
    np.testing.assert_array_equal(thinned(7), np.arange(7))
    assert thinned(0).size == 0
