from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from bristle.identification.results import Joint
from bristle.page.style import render_as
from bristle.questions.joint_report import moving as moving_page

from .moving import REVERSAL, STRETCH, moving, tracked


def both(joint: Joint) -> list[Figure]:
    """Both figures of a joint."""
    drawn = (moving_page.course_figure(joint), moving_page.velocity_figure(joint))
    return [figure for figure in drawn if figure is not None]


def test_window_lies_about_the_hardest_reversal_within_one_stretch() -> None:
    """The piece holds the reversal with the largest acceleration, lasts no longer than SPAN, and crosses no boundary."""
    fit = tracked()
    own = moving_page.window(fit)
    assert own.start >= STRETCH
    assert fit.time[own.start] < REVERSAL < fit.time[own.stop - 1]
    assert fit.time[own.stop - 1] - fit.time[own.start] <= moving_page.SPAN + 1e-9


def test_window_has_its_length_where_it_can() -> None:
    """A joint that never turns, and a stretch shorter than SPAN, are shown from their start; a reversal at the end with what came before."""
    for seconds, turn in ((0.5, np.inf), (2.0, np.inf), (30.0, np.inf), (10.0, 9.9)):
        t = np.linspace(0.0, seconds, 1001)
        fit = tracked(time=t, velocity=np.where(t < turn, 1.0, -1.0), measured=t, residuals=0 * t, starts_of_runs=(0,))
        own = moving_page.window(fit)
        assert (own.start == 0) == (turn > seconds)
        assert turn > seconds or own.stop == t.size
        length = t[own.stop - 1] - t[own.start]
        assert length == pytest.approx(min(seconds, moving_page.SPAN), abs=1.1 * seconds / 1000)


def test_stretches_are_told_apart() -> None:
    """Every equation belongs to one stretch, and none is in two; an empty one is left out."""
    fit = tracked()
    assert moving_page.stretches(fit) == [slice(0, STRETCH), slice(STRETCH, fit.time.size)]
    assert moving_page.stretches(tracked(starts_of_runs=(0, 0, STRETCH)))[0] == slice(0, STRETCH)


def test_no_line_crosses_a_boundary() -> None:
    """Time rises along every line; over velocity there are points only (the line of zero aside)."""
    course, velocity = both(moving())
    for ax in course.axes:
        for line in ax.get_lines():
            assert (np.diff(np.asarray(line.get_xdata(), dtype=float)) >= 0).all()
    lines = [line for ax in velocity.axes for line in ax.get_lines() if len(np.asarray(line.get_xdata())) > 2]
    assert {line.get_linestyle() for line in lines} == {"None"}


def test_predicted_is_measured_less_the_residual_of_the_joint_fit() -> None:
    """Both curves come from the joint fit where there is one, else from the moving runs alone."""
    joint = moving()
    marked = tracked(residuals=np.full(tracked().time.size, 0.125))
    for own in (replace(joint, joint_fit=marked), replace(joint, joint_fit=None, tracking=marked)):
        for figure in both(own):
            measured, predicted = (np.asarray(line.get_ydata()) for line in figure.axes[0].get_lines())
            np.testing.assert_allclose(measured - predicted, 0.125)


def test_panels_share_their_axis() -> None:
    """Residuals lie beneath on the same axis, which they alone name."""
    for figure, label in zip(both(moving()), ("Time (s)", "Velocity (rad/s)"), strict=True):
        above, below = figure.axes
        assert (above.get_xlabel(), below.get_xlabel()) == ("", label)
        assert above.get_xlim() == below.get_xlim()
        assert below.get_ylabel() == "Residual torque (N·m)"


def test_measured_and_predicted_differ_in_more_than_colour() -> None:
    """In grey print a wide line is not a thin one, and a circle is not a dot."""
    course, velocity = both(moving())
    wide, thin = course.axes[0].get_lines()
    assert wide.get_linewidth() > 2 * thin.get_linewidth()
    circle, dot = velocity.axes[0].get_lines()
    assert (circle.get_marker(), circle.get_markerfacecolor(), dot.get_marker()) == ("o", "none", ".")


def test_few_points_are_drawn_of_many() -> None:
    """A run of a million samples gives a file no larger than a short one's: at most MOST points of each kind."""
    n = 1_000_000
    t = np.arange(n) / 1e6
    fit = tracked(
        time=t, velocity=np.cos(40 * t), measured=np.cos(40 * t), residuals=1e-3 * np.sin(t), starts_of_runs=(0,)
    )
    for figure in both(replace(moving(), joint_fit=fit)):
        sizes = [len(np.asarray(line.get_xdata())) for ax in figure.axes for line in ax.get_lines()]
        assert max(sizes) <= moving_page.MOST
        assert len(render_as(figure, "svg")) < 200_000
