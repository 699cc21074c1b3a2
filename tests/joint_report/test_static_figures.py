from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.text import Annotation

from bristle.identification.curve import band
from bristle.identification.fits import Stray
from bristle.identification.results import Joint
from bristle.model.functions import steady_jacobian_function
from bristle.model.vectorize import evaluate
from bristle.page.style import decimal_log, new_figure, styled
from bristle.questions.joint_report import static_figures


def test_band_is_the_delta_method(joint: Joint) -> None:
    """The band's half-width at one speed is Student's t times the root of j C j', with j CasADi's derivative there."""
    fit = joint.static["+"]
    p = fit.values()
    half = band(np.array([0.05]), fit)
    assert p is not None
    assert half is not None
    j = np.array(evaluate(steady_jacobian_function(), np.array([0.05]), *p[:4]))[:, 0]
    assert half[0] == pytest.approx(2.2281388519649385 * np.sqrt(j @ fit.covariance @ j), rel=1e-9)  # t(0.975; 10)


def test_band_ignores_regressors_and_refuses_a_covariance_that_is_not_finite(joint: Joint) -> None:
    """An extra regressor does not widen the friction curve; an infinite covariance gives no band."""
    fit = joint.static["+"]
    wide = np.full((5, 5), 7.0)
    wide[:4, :4] = fit.covariance
    v = np.array([0.03, 0.3])
    alone, beside = band(v, fit), band(v, replace(fit, names=(*fit.names, "offset"), covariance=wide))
    assert alone is not None
    assert beside is not None
    np.testing.assert_allclose(beside, alone)
    assert band(v, replace(fit, covariance=fit.covariance * np.inf)) is None


def test_a_wild_rejected_segment_does_not_flatten_the_curve(joint: Joint) -> None:
    """The frame follows what was fitted, not the rejected segment at 30 rad/s."""
    low, high = static_figures.curve_figure(joint).axes[0].get_xlim()
    assert -1.0 < low < high < 1.0


def test_a_held_out_point_at_a_fitted_speed_is_drawn(joint: Joint) -> None:
    """A point is known by its file and rows, not by its speed: held out at the nominal speed of a fitted one, it still has its diamond."""
    twin = replace(joint.segments[0], file="held.csv")
    ax = static_figures.curve_figure(replace(joint, segments=(*joint.segments, twin))).axes[0]
    (held,) = (line for line in ax.lines if line.get_label() == "held out")
    assert np.asarray(held.get_xydata()).tolist() == [[twin.velocity, twin.torque]]
    assert not [line for line in static_figures.curve_figure(joint).axes[0].lines if line.get_label() == "held out"]


def test_a_small_curve_has_its_scales(joint: Joint, slide: Joint) -> None:
    """The largest speed and torque that were fitted, with units, each at its place on an axis; of one direction too, and of nothing none."""
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


def test_a_stray_has_a_ring_of_its_own(joint: Joint) -> None:
    """Each point that is named as a stray is ringed in both panels, and the legend says so once; without one there is no ring."""
    strays = {
        d: Stray(file="x.csv", where="line 3", velocity=sign * 0.2, torque=sign * 0.05, deviations=9.0, without={})
        for d, sign in (("+", 1.0), ("-", -1.0))
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
