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

from ..conftest import present
from .conftest import HOSTILE, QUANTUM, TABLE_1, loading, nothing_seen, only, slow_fit
from .moving import REVERSAL, STRETCH, moving, tracked

UNIT = re.compile(r"\([^()]+\)|\(\([^()]+\)²\)$")
STATIC = ["curve", "residuals"]
SLOW = ["presliding", "hysteresis"]
MOVING = ["tracking", "tracking-velocity"]


def drawn(joint: Joint) -> dict[str, Figure]:
    """The figures of a joint, but for the small one, whose words stand beside it."""
    found = {kind: draw(joint) for kind, draw in DRAW.items() if kind != "small"}
    return {kind: figure for kind, figure in found.items() if figure is not None}


def test_axes_have_units_and_nothing_else_is_drawn(record: Record, joint: Joint, slow: Joint, slide: Joint) -> None:
    """Each label of each figure ends in a unit; a joint that slides has neither N·m nor rad."""
    # in each SVG, which may travel alone, markup is escaped, a dollar sign starts no formula, and simulated data are called so
    for kind in ("revolute", "prismatic"):
        every = replace(moving(HOSTILE, HOSTILE), kind=kind)
        figures = drawn(every)
        assert [*figures] == [*STATIC, *SLOW, *MOVING]
        more = (static_figures.stribeck_figure(), static_figures.inspect_figure([record], every.segments, kind))
        axes = [ax for figure in (*figures.values(), *more) for ax in figure.axes]
        labels = [label for ax in axes for label in (ax.get_xlabel(), ax.get_ylabel())]
        assert [label for label in labels if not UNIT.search(label)] == [""] * 2  # above residuals over the same axis
        own = [label for f in figures.values() for ax in f.axes for label in (ax.get_xlabel(), ax.get_ylabel())]
        assert any("N·m" in label or "rad" in label for label in own) == (kind == "revolute")
        for name, figure in figures.items() if kind == "revolute" else ():
            svg = render_as(figure, "svg")
            assert ET.fromstring(svg).tag.endswith("svg")  # noqa: S314 # our own file
            assert b"SIMULATED" in svg, name
            assert b"<script" not in svg, name
            assert name != "residuals" or (b"&lt;script&gt;" in svg and b'"$x$"' in svg)
    assert b"SIMULATED" not in render_as(static_figures.curve_figure(replace(every, simulated=False)), "svg")
    assert static_figures.inspect_figure([], [], "prismatic").axes
    # at most MOST_POINTS of many points are drawn, the first and last among them; few points all are
    many = thinned(100_000)
    assert (many.size, many[0], many[-1], thinned(0).size) == (MOST_POINTS, 0, 99_999, 0)
    np.testing.assert_array_equal(thinned(7), np.arange(7))
    # without residuals, runs of a kind, their fits, loops or equations there is no such figure
    empty = np.zeros(0)
    none = tracked(time=empty, velocity=empty, measured=empty, residuals=empty, starts_of_runs=(0,))
    for bare in (joint, replace(joint, tracking=none), only(slow, fits={}, loops=())):
        assert [*drawn(bare)] == STATIC
    assert [*drawn(slide)] == ["curve"]
    # the band's half-width at one speed is Student's t times the root of j C j', with j CasADi's derivative there
    fit = joint.static["+"]
    p, v = present(fit.values()), np.array([0.05])
    by_name = dict(zip(p._fields, evaluate(steady_jacobian_function(), v, *p[:4]), strict=False))
    j = np.array([by_name[str(name)][0] for name in fit.names])
    half = present(band(v, fit))
    assert half[0] == pytest.approx(2.2281388519649385 * np.sqrt(j @ fit.covariance @ j), rel=1e-9)  # t(0.975; 10)
    # an extra regressor does not widen the friction curve; an infinite covariance gives no band
    wide = np.full((5, 5), 7.0)
    wide[:4, :4] = fit.covariance
    np.testing.assert_allclose(present(band(v, replace(fit, names=(*fit.names, "offset"), covariance=wide))), half)
    assert band(v, replace(fit, covariance=fit.covariance * np.inf)) is None


def test_what_the_curve_shows(joint: Joint, slide: Joint) -> None:
    """The frame follows what was fitted, not the rejected segment at 30 rad/s."""
    whole, _ = static_figures.curve_figure(joint).axes
    assert -1.0 < whole.get_xlim()[0] < whole.get_xlim()[1] < 1.0
    # a point is known by its file and rows, not by its speed: held out at the nominal speed of a fitted one, it still has its diamond. Each
    # point that is named as a stray is ringed in both panels, and the legend says so once; without one there is no ring, and no diamond
    first = joint.segments[0]
    twin = replace(first, file="held.csv")
    strays = {d: replace(first, velocity=sign * 0.2, torque=sign * 0.05) for d, sign in (("+", 1.0), ("-", -1.0))}
    static = {d: replace(fit, strays=(strays[d],)) for d, fit in joint.static.items()}
    axes = static_figures.curve_figure(replace(joint, static=static, segments=(*joint.segments, twin))).axes
    (held,) = (line for line in axes[0].lines if line.get_label() == "held out")
    assert np.asarray(held.get_xydata()).tolist() == [[twin.velocity, twin.torque]]
    rings = [
        [np.asarray(line.get_xydata()).tolist() for line in ax.lines if line.get_markersize() == 11] for ax in axes
    ]
    assert rings == [[[[0.2, 0.05], [-0.2, -0.05]]], [[[0.2, 0.05], [0.2, 0.05]]]]
    assert axes[0].get_legend_handles_labels()[1].count("stray, named") == 1
    assert not {"stray, named", "held out"} & {*whole.get_legend_handles_labels()[1]}
    # the largest speed and torque that were fitted, with units, each at its place on an axis; of one direction too, and of nothing none
    for one in (joint, replace(joint, static={"-": joint.static["-"]})):
        fits = one.static.values()
        v, torque = max(abs(f.velocity).max() for f in fits), max(abs(f.torque).max() for f in fits)
        (ax,) = static_figures.small_figure(one).axes
        told = {text.get_text(): text.xy for text in ax.texts if isinstance(text, Annotation)}
        assert told == {f"{v:.2g} rad/s": (v, 0), f"{torque:.2g} N·m": (0, torque)}
        assert ax.get_xlim()[1] > v
        assert ax.get_ylim()[1] > torque
    assert not static_figures.small_figure(slide).axes[0].texts


@styled
def test_labels_of_a_logarithmic_axis_leave_room() -> None:
    """However narrow or wide the range, there are two labels or more, and none touches the next."""
    faults = []
    for low, high in ((0.06, 0.075), (0.011, 0.045), (0.06, 0.19), (0.005, 1.2), (1e-3, 5.0), (1e-7, 1e4)):
        figure = new_figure(2.0)
        ax = figure.subplots()
        decimal_log(ax)
        ax.set_xlim(low, high)
        figure.draw_without_rendering()
        seen = [x for x, at in zip(ax.get_xticklabels(), ax.get_xticks(), strict=True) if low <= at <= high]
        boxes = [label.get_window_extent() for label in seen]
        if len(boxes) < 2 or any(one.x1 >= two.x0 for one, two in pairwise(boxes)):
            faults.append((low, high))
    assert faults == []


def test_loadings_are_moved_to_where_the_joint_rests() -> None:
    """The fitted rest position is the true one, wherever in a count that is: the edges then lie on the curve."""
    fit = slow_fit("+")
    for phase in (0.0, 0.3, 0.95):
        piece = loading("+", phase, "x.csv")
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
    # a fit without sigma_0 shows its loadings alone
    (ax,) = panels(only(slow, fits={"+": nothing_seen()}, loops=()))
    assert not [x for x in ax.get_lines() if str(x.get_label()).startswith(tuple(METHODS.values()))]
    # no line of a loading's panel reaches beyond its largest displacement from rest; but g0's level
    assert slow.presliding is not None
    for ax, fit in zip(panels(slow), slow.presliding.fits.values(), strict=False):
        most = max(float(x.displacement.max()) - presliding_sections.rest(x, fit) for x in fit.loadings)
        lines = [np.asarray(x.get_xdata()) for x in ax.get_lines() if not str(x.get_label()).startswith("g")]
        assert len(lines) > 3
        assert max(float(x.max()) for x in lines) <= most * (1 + 1e-9)


def panels(joint: Joint) -> list[Axes]:
    return present(presliding_sections.presliding_figure(joint)).axes


def both(joint: Joint) -> tuple[Figure, Figure]:
    return present(moving_sections.course_figure(joint)), present(moving_sections.velocity_figure(joint))


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
    # both curves come from the joint fit where there is one, else from the moving runs alone; residuals lie beneath on the same axis,
    # time rises along every line, and over velocity there are points only (the line of zero aside)
    joint, marked = moving(), tracked(residuals=np.full(tracked().time.size, 0.125))
    for own_fits in (replace(joint, joint_fit=marked), replace(joint, joint_fit=None, tracking=marked)):
        for figure, label in zip(both(own_fits), ("Time (s)", "Velocity (rad/s)"), strict=True):
            above, below = figure.axes
            measured, predicted = (np.asarray(line.get_ydata()) for line in above.get_lines())
            np.testing.assert_allclose(measured - predicted, 0.125)
            assert (above.get_xlabel(), below.get_xlabel(), below.get_ylabel()) == ("", label, "Residual torque (N·m)")
            assert above.get_xlim() == below.get_xlim()
    course, velocity = both(joint)
    assert all((np.diff(line.get_xdata()) >= 0).all() for ax in course.axes for line in ax.get_lines())
    lines = [line for ax in velocity.axes for line in ax.get_lines() if len(np.asarray(line.get_xdata())) > 2]
    assert {line.get_linestyle() for line in lines} == {"None"}
    # a run of a million samples gives a file no larger than a short one's: at most MOST points of each kind
    t = np.arange(1_000_000) / 1e6
    fit = tracked(
        time=t, velocity=np.cos(40 * t), measured=np.cos(40 * t), residuals=1e-3 * np.sin(t), starts_of_runs=(0,)
    )
    for figure in both(replace(moving(), joint_fit=fit)):
        sizes = [len(np.asarray(line.get_xdata())) for ax in figure.axes for line in ax.get_lines()]
        assert max(sizes) <= moving_sections.MOST
        assert len(render_as(figure, "svg")) < 200_000
