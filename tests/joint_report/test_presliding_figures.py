"""The figures of presliding: alignment, curves, axes, and what is left out."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.axes import Axes

from bristle.identification.results import Joint
from bristle.page.wording import METHODS
from bristle.questions.joint_report import presliding as presliding_page

from .conftest import QUANTUM, TABLE_1, closed_cycle, loading, nothing_seen, only, slow_fit


@pytest.mark.parametrize("phase", [0.0, 0.3, 0.95])
def test_loadings_are_moved_to_where_the_joint_rests(phase: float) -> None:
    """The fitted rest position is the true one, wherever in a count that is: the edges then lie on the curve."""
    fit, piece = slow_fit("+"), loading("+", phase, "x.csv")
    start = presliding_page.rest(piece, fit)
    assert start == pytest.approx((phase - 0.5) * QUANTUM, abs=1e-4 * QUANTUM)
    on_curve = presliding_page.displacement(piece.edge_torque, fit.level, TABLE_1["+"].sigma_0)
    np.testing.assert_allclose(piece.edge_displacement - start, on_curve, atol=1e-3 * QUANTUM)


def test_rest_without_edges_and_without_sigma_0() -> None:
    """Where no edge was crossed all samples tell the rest position; without a sigma_0 the loading stays where it began."""
    fit, piece = slow_fit("+"), loading("+", 0.0, "x.csv")
    y = presliding_page.displacement(piece.torque, fit.level, TABLE_1["+"].sigma_0)
    smooth = replace(piece, displacement=y + 0.001, edge_displacement=np.zeros(0), edge_torque=np.zeros(0))
    assert presliding_page.rest(smooth, fit) == pytest.approx(0.001)
    assert presliding_page.rest(piece, nothing_seen()) == 0.0


def test_curve_levels_off_at_g0() -> None:
    """The displacement of the model: at small torque T / sigma_0, beyond all bounds towards g0."""
    y = presliding_page.displacement(np.array([1e-6, 0.5, 1 - 1e-9]), 1.0, 4.0)
    assert y[0] == pytest.approx(2.5e-7, rel=1e-6)
    assert y[1] == pytest.approx(np.log(2.0) / 4)
    assert y[2] > 5.0


def test_a_bounded_g0_is_drawn_where_the_edges_lie() -> None:
    """Where g0 is a lower bound alone, the curve has the g0 with which its sigma_0 passes through the edges, and not the bound."""
    fit = slow_fit("+")
    most = max(float(x.edge_torque.max()) for x in fit.loadings)
    bounded = replace(fit, level=1.001 * most, level_standard_error=float("inf"))
    assert presliding_page.level_drawn(fit) == fit.level
    assert presliding_page.level_drawn(bounded) == pytest.approx(fit.level, rel=0.1)


def panels(joint: Joint) -> list[Axes]:
    """Every panel of both figures."""
    drawn = [presliding_page.presliding_figure(joint), presliding_page.hysteresis_figure(joint)]
    return [ax for figure in drawn if figure is not None for ax in figure.axes]


def test_methods_differ_in_line_as_well_as_in_colour(slow: Joint) -> None:
    """In grey print the three curves can still be told apart; the recommended one is named."""
    lines = {str(x.get_label()): x.get_linestyle() for x in panels(slow)[0].get_lines()}
    named = {label: line for label, line in lines.items() if label.startswith(tuple(METHODS.values()))}
    assert len(named) == len(set(named.values())) == 3
    assert [label for label in named if label.endswith("(use this)")] == ["count edge to count edge (use this)"]


def test_what_does_not_exist_is_not_drawn(slow: Joint) -> None:
    """A fit without sigma_0 shows its loadings alone; an infinite slope is no line."""
    (ax,) = panels(only(slow, fits={"+": nothing_seen()}, loops=()))
    assert not [x for x in ax.get_lines() if str(x.get_label()).startswith(tuple(METHODS.values()))]
    flat = replace(closed_cycle("x.csv"), inverse_slope=None, secant=None)
    (ax,) = panels(only(slow, fits={}, loops=(flat,)))
    assert not {"inverse regression", "secant"} & {x.get_label() for x in ax.get_lines()}


def test_nothing_is_drawn_beyond_what_was_measured(slow: Joint) -> None:
    """No line of a loading's panel reaches beyond its largest displacement from rest, none of a cycle's beyond its ends; but g0's level."""
    assert slow.presliding is not None
    fits, loops = list(slow.presliding.fits.values()), slow.presliding.loops
    shown = panels(slow)
    for ax, fit in zip(shown[: len(fits)], fits, strict=True):
        most = max(float(x.displacement.max()) - presliding_page.rest(x, fit) for x in fit.loadings)
        lines = [np.asarray(x.get_xdata()) for x in ax.get_lines() if not str(x.get_label()).startswith("g")]
        assert len(lines) > 3
        assert max(float(x.max()) for x in lines) <= most * (1 + 1e-9)
    for ax, loop in zip(shown[len(fits) :], loops, strict=False):
        y = loop.position - loop.position.mean()
        for line in ax.get_lines():
            x = np.asarray(line.get_xdata())
            assert y.min() - 1e-12 <= x.min()
            assert x.max() <= y.max() + 1e-12
