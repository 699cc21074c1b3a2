import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Annotation

from bristle.data.record import Record
from bristle.identification.curve import band
from bristle.identification.results import Joint
from bristle.model.functions import steady_jacobian_function
from bristle.model.vectorize import evaluate
from bristle.page.style import MOST_POINTS, decimal_log, new_figure, render_as, styled, thinned
from bristle.page.wording import METHODS
from bristle.questions.joint_report import moving_sections, presliding_sections, static_figures
from bristle.questions.joint_report.figures import DRAW

from .conftest import HOSTILE, QUANTUM, TABLE_1, closed_cycle, loading, nothing_seen, only, slow_fit
from .moving import REVERSAL, STRETCH, moving, tracked

UNIT = re.compile(r"\([^()]+\)|\(\([^()]+\)²\)$")
STATIC = ["curve", "profile", "residuals"]
SLOW = ["presliding", "hysteresis"]
MOVING = ["tracking", "tracking-velocity"]


def drawn(joint: Joint) -> dict[str, Figure]:
    """The figures of a joint, but for the small one, whose words stand beside it."""
    found = {kind: draw(joint) for kind, draw in DRAW.items() if kind != "small"}
    return {kind: figure for kind, figure in found.items() if figure is not None}


def test_axes_have_units_and_nothing_else_is_drawn(record: Record, joint: Joint, slow: Joint, slide: Joint) -> None:
    """Each label of each figure ends in a unit; a joint that slides has neither N·m nor rad."""
    every = moving()
    for kind in ("revolute", "prismatic"):
        figures = drawn(replace(every, kind=kind))
        assert [*figures] == [*STATIC, *SLOW, *MOVING]
        loops = len(figures["hysteresis"].axes)
        assert loops == presliding_sections.MOST_LOOPS
        more = (static_figures.stribeck_figure(), static_figures.inspect_figure([record], every.segments, kind))
        axes = [ax for figure in (*figures.values(), *more) for ax in figure.axes]
        assert len(axes) == 2 + 2 + 3 + 2 + loops + 2 * 2 + 1 + 2
        labels = [label for ax in axes for label in (ax.get_xlabel(), ax.get_ylabel())]
        assert [label for label in labels if not UNIT.search(label)] == [""] * 2  # above residuals over the same axis
        own = [label for f in figures.values() for ax in f.axes for label in (ax.get_xlabel(), ax.get_ylabel())]
        assert any("N·m" in label or "rad" in label for label in own) == (kind == "revolute")
    assert static_figures.inspect_figure([], [], "prismatic").axes
    # in each SVG, which may travel alone, markup is escaped, a dollar sign starts no formula, and simulated data are called so
    every = moving(HOSTILE, HOSTILE)
    for kind, figure in drawn(every).items():
        svg = render_as(figure, "svg")
        assert ET.fromstring(svg).tag.endswith("svg")  # noqa: S314 # our own file
        assert b"SIMULATED" in svg, kind
        assert b"<script" not in svg, kind
        assert kind != "residuals" or (b"&lt;script&gt;" in svg and b'"$x$"' in svg)
    assert b"SIMULATED" not in render_as(static_figures.curve_figure(replace(every, simulated=False)), "svg")
    # at most MOST_POINTS of many points are drawn, the first and last among them; few points all are
    many = thinned(100_000)
    assert (many.size, many[0], many[-1]) == (MOST_POINTS, 0, 99_999)
    np.testing.assert_array_equal(thinned(7), np.arange(7))
    assert thinned(0).size == 0
    # without a profile, residuals, runs of a kind, their fits, loops or equations there is no such figure
    empty = np.zeros(0)
    none = tracked(time=empty, velocity=empty, measured=empty, residuals=empty, starts_of_runs=(0,))
    assert [*drawn(joint)] == [*drawn(replace(joint, tracking=none))] == STATIC
    assert [*drawn(only(slow, fits={}, loops=()))] == STATIC
    assert [*drawn(slide)] == ["curve"]
    # the band's half-width at one speed is Student's t times the root of j C j', with j CasADi's derivative there
    fit = joint.static["+"]
    p = fit.values()
    half = band(np.array([0.05]), fit)
    assert p is not None
    assert half is not None
    j = np.array(evaluate(steady_jacobian_function(), np.array([0.05]), *p[:4]))[:, 0]
    assert half[0] == pytest.approx(2.2281388519649385 * np.sqrt(j @ fit.covariance @ j), rel=1e-9)  # t(0.975; 10)
    # an extra regressor does not widen the friction curve; an infinite covariance gives no band
    wide = np.full((5, 5), 7.0)
    wide[:4, :4] = fit.covariance
    v = np.array([0.03, 0.3])
    alone, beside = band(v, fit), band(v, replace(fit, names=(*fit.names, "offset"), covariance=wide))
    assert alone is not None
    assert beside is not None
    np.testing.assert_allclose(beside, alone)
    assert band(v, replace(fit, covariance=fit.covariance * np.inf)) is None


def test_what_the_curve_shows(joint: Joint, slide: Joint) -> None:
    """The frame follows what was fitted, not the rejected segment at 30 rad/s."""
    low, high = static_figures.curve_figure(joint).axes[0].get_xlim()
    assert -1.0 < low < high < 1.0
    # a point is known by its file and rows, not by its speed: held out at the nominal speed of a fitted one, it still has its diamond
    twin = replace(joint.segments[0], file="held.csv")
    ax = static_figures.curve_figure(replace(joint, segments=(*joint.segments, twin))).axes[0]
    (held,) = (line for line in ax.lines if line.get_label() == "held out")
    assert np.asarray(held.get_xydata()).tolist() == [[twin.velocity, twin.torque]]
    assert not [line for line in static_figures.curve_figure(joint).axes[0].lines if line.get_label() == "held out"]
    # the largest speed and torque that were fitted, with units, each at its place on an axis; of one direction too, and of nothing none
    for one in (joint, replace(joint, static={"-": joint.static["-"]})):
        v, torque = (
            max(abs(x).max() for x in own)
            for own in zip(*((f.velocity, f.torque) for f in one.static.values()), strict=True)
        )
        (ax,) = static_figures.small_figure(one).axes
        told = {text.get_text(): text.xy for text in ax.texts if isinstance(text, Annotation)}
        assert told == {f"{v:.2g} rad/s": (v, 0), f"{torque:.2g} N·m": (0, torque)}
        assert ax.get_xlim()[1] > v
        assert ax.get_ylim()[1] > torque
    assert not static_figures.small_figure(slide).axes[0].texts
    # each point that is named as a stray is ringed in both panels, and the legend says so once; without one there is no ring
    strays = {
        d: replace(joint.segments[0], velocity=sign * 0.2, torque=sign * 0.05) for d, sign in (("+", 1.0), ("-", -1.0))
    }
    static = {d: replace(fit, strays=(strays[d],)) for d, fit in joint.static.items()}
    axes = static_figures.curve_figure(replace(joint, static=static)).axes
    rings = [
        [np.asarray(line.get_xydata()).tolist() for line in ax.lines if line.get_markersize() == 11] for ax in axes
    ]
    assert rings == [[[[0.2, 0.05], [-0.2, -0.05]]], [[[0.2, 0.05], [0.2, 0.05]]]]
    assert axes[0].get_legend_handles_labels()[1].count("stray, named") == 1
    assert "stray, named" not in static_figures.curve_figure(joint).axes[0].get_legend_handles_labels()[1]


@pytest.mark.parametrize("ends", [(0.06, 0.075), (0.011, 0.045), (0.06, 0.19), (0.005, 1.2), (1e-3, 5.0), (1e-7, 1e4)])
@styled
def test_labels_of_a_logarithmic_axis_leave_room(ends: tuple[float, float]) -> None:
    """However narrow or wide the range, there are two labels or more, and none touches the next."""
    figure = new_figure(2.0)
    ax = figure.subplots()
    decimal_log(ax)
    ax.set_xlim(*ends)
    figure.draw_without_rendering()
    low, high = sorted(ends)
    boxes = [
        label.get_window_extent()
        for label, place in zip(ax.get_xticklabels(), ax.get_xticks(), strict=True)
        if low <= place <= high
    ]
    assert len(boxes) >= 2
    assert all(one.x1 < two.x0 for one, two in pairwise(boxes))


@pytest.mark.parametrize("phase", [0.0, 0.3, 0.95])
def test_loadings_are_moved_to_where_the_joint_rests(phase: float) -> None:
    """The fitted rest position is the true one, wherever in a count that is: the edges then lie on the curve."""
    fit, piece = slow_fit("+"), loading("+", phase, "x.csv")
    start = presliding_sections.rest(piece, fit)
    assert start == pytest.approx((phase - 0.5) * QUANTUM, abs=1e-4 * QUANTUM)
    on_curve = presliding_sections.displacement(piece.edge_torque, fit.level, TABLE_1["+"].sigma_0)
    np.testing.assert_allclose(piece.edge_displacement - start, on_curve, atol=1e-3 * QUANTUM)


def test_what_slow_loading_shows(slow: Joint) -> None:
    """Where no edge was crossed all samples tell the rest position; without a sigma_0 the loading stays where it began."""
    fit, piece = slow_fit("+"), loading("+", 0.0, "x.csv")
    y = presliding_sections.displacement(piece.torque, fit.level, TABLE_1["+"].sigma_0)
    smooth = replace(piece, displacement=y + 0.001, edge_displacement=np.zeros(0), edge_torque=np.zeros(0))
    assert presliding_sections.rest(smooth, fit) == pytest.approx(0.001)
    assert presliding_sections.rest(piece, nothing_seen()) == 0.0
    # the displacement of the model: at small torque T / sigma_0, beyond all bounds towards g0
    y = presliding_sections.displacement(np.array([1e-6, 0.5, 1 - 1e-9]), 1.0, 4.0)
    assert y[0] == pytest.approx(2.5e-7, rel=1e-6)
    assert y[1] == pytest.approx(np.log(2.0) / 4)
    assert y[2] > 5.0
    # where g0 is a lower bound alone, the curve has the g0 with which its sigma_0 passes through the edges, and not the bound
    fit = slow_fit("+")
    most = max(float(x.edge_torque.max()) for x in fit.loadings)
    bounded = replace(fit, level=1.001 * most, level_standard_error=float("inf"))
    assert presliding_sections.level_drawn(fit) == fit.level
    assert presliding_sections.level_drawn(bounded) == pytest.approx(fit.level, rel=0.1)
    # in grey print both curves can still be told apart; the one to use is named
    lines = {str(x.get_label()): x.get_linestyle() for x in panels(slow)[0].get_lines()}
    named = {label: line for label, line in lines.items() if label.startswith(tuple(METHODS.values()))}
    assert len(named) == len(set(named.values())) == 2
    assert [label for label in named if label.endswith("(use this)")] == ["count edge to count edge (use this)"]
    # a fit without sigma_0 shows its loadings alone; an infinite slope is no line
    (ax,) = panels(only(slow, fits={"+": nothing_seen()}, loops=()))
    assert not [x for x in ax.get_lines() if str(x.get_label()).startswith(tuple(METHODS.values()))]
    flat = replace(closed_cycle("x.csv"), inverse_slope=None, secant=None)
    (ax,) = panels(only(slow, fits={}, loops=(flat,)))
    assert not {"inverse regression", "secant"} & {x.get_label() for x in ax.get_lines()}
    # no line of a loading's panel reaches beyond its largest displacement from rest, none of a cycle's beyond its ends; but g0's level
    assert slow.presliding is not None
    fits, loops = list(slow.presliding.fits.values()), slow.presliding.loops
    shown = panels(slow)
    for ax, fit in zip(shown[: len(fits)], fits, strict=True):
        most = max(float(x.displacement.max()) - presliding_sections.rest(x, fit) for x in fit.loadings)
        lines = [np.asarray(x.get_xdata()) for x in ax.get_lines() if not str(x.get_label()).startswith("g")]
        assert len(lines) > 3
        assert max(float(x.max()) for x in lines) <= most * (1 + 1e-9)
    for ax, loop in zip(shown[len(fits) :], loops, strict=False):
        y = loop.position - loop.position.mean()
        for line in ax.get_lines():
            x = np.asarray(line.get_xdata())
            assert y.min() - 1e-12 <= x.min()
            assert x.max() <= y.max() + 1e-12


def panels(joint: Joint) -> list[Axes]:
    drawn = [presliding_sections.presliding_figure(joint), presliding_sections.hysteresis_figure(joint)]
    return [ax for figure in drawn if figure is not None for ax in figure.axes]


def both(joint: Joint) -> list[Figure]:
    drawn = (moving_sections.course_figure(joint), moving_sections.velocity_figure(joint))
    return [figure for figure in drawn if figure is not None]


def test_windows_and_points_of_moving_runs() -> None:
    """The piece holds the reversal with the largest acceleration, lasts no longer than SPAN, and crosses no boundary."""
    fit = tracked()
    own = moving_sections.window(fit)
    assert own.start >= STRETCH
    assert fit.time[own.start] < REVERSAL < fit.time[own.stop - 1]
    assert fit.time[own.stop - 1] - fit.time[own.start] <= moving_sections.SPAN + 1e-9
    # a joint that never turns, and a stretch shorter than SPAN, are shown from their start; a reversal at the end with what came before
    for seconds, turn in ((0.5, np.inf), (2.0, np.inf), (30.0, np.inf), (10.0, 9.9)):
        t = np.linspace(0.0, seconds, 1001)
        fit = tracked(time=t, velocity=np.where(t < turn, 1.0, -1.0), measured=t, residuals=0 * t, starts_of_runs=(0,))
        own = moving_sections.window(fit)
        assert (own.start == 0) == (turn > seconds)
        assert turn > seconds or own.stop == t.size
        length = t[own.stop - 1] - t[own.start]
        assert length == pytest.approx(min(seconds, moving_sections.SPAN), abs=1.1 * seconds / 1000)
    # every equation belongs to one stretch, and none is in two; an empty one is left out
    fit = tracked()
    assert moving_sections.stretches(fit) == [slice(0, STRETCH), slice(STRETCH, fit.time.size)]
    assert moving_sections.stretches(tracked(starts_of_runs=(0, 0, STRETCH)))[0] == slice(0, STRETCH)
    # time rises along every line; over velocity there are points only (the line of zero aside)
    course, velocity = both(moving())
    for ax in course.axes:
        for line in ax.get_lines():
            assert (np.diff(np.asarray(line.get_xdata(), dtype=float)) >= 0).all()
    lines = [line for ax in velocity.axes for line in ax.get_lines() if len(np.asarray(line.get_xdata())) > 2]
    assert {line.get_linestyle() for line in lines} == {"None"}
    # both curves come from the joint fit where there is one, else from the moving runs alone
    joint = moving()
    marked = tracked(residuals=np.full(tracked().time.size, 0.125))
    for own in (replace(joint, joint_fit=marked), replace(joint, joint_fit=None, tracking=marked)):
        for figure in both(own):
            measured, predicted = (np.asarray(line.get_ydata()) for line in figure.axes[0].get_lines())
            np.testing.assert_allclose(measured - predicted, 0.125)
    # residuals lie beneath on the same axis, which they alone name
    for figure, label in zip(both(moving()), ("Time (s)", "Velocity (rad/s)"), strict=True):
        above, below = figure.axes
        assert (above.get_xlabel(), below.get_xlabel()) == ("", label)
        assert above.get_xlim() == below.get_xlim()
        assert below.get_ylabel() == "Residual torque (N·m)"
    # in grey print a wide line is not a thin one, and a circle is not a dot
    wide, thin = course.axes[0].get_lines()
    assert wide.get_linewidth() > 2 * thin.get_linewidth()
    circle, dot = velocity.axes[0].get_lines()
    assert (circle.get_marker(), circle.get_markerfacecolor(), dot.get_marker()) == ("o", "none", ".")
    # a run of a million samples gives a file no larger than a short one's: at most MOST points of each kind
    n = 1_000_000
    t = np.arange(n) / 1e6
    fit = tracked(
        time=t, velocity=np.cos(40 * t), measured=np.cos(40 * t), residuals=1e-3 * np.sin(t), starts_of_runs=(0,)
    )
    for figure in both(replace(moving(), joint_fit=fit)):
        sizes = [len(np.asarray(line.get_xdata())) for ax in figure.axes for line in ax.get_lines()]
        assert max(sizes) <= moving_sections.MOST
        assert len(render_as(figure, "svg")) < 200_000
