"""The figures of a joint."""

from collections.abc import Callable
from functools import partial

from matplotlib.figure import Figure

from bristle.identification.curve import friction_points
from bristle.identification.results import Joint
from bristle.page.page import Drawing, begun
from bristle.questions.joint_report import interval_sections, moving_sections, presliding_sections, static_figures
from bristle.workers import Share

DRAW: dict[str, Callable[[Joint], Figure | None]] = {
    "small": static_figures.small_figure,
    "curve": static_figures.curve_figure,
    "residuals": static_figures.residuals_figure,
    "presliding": presliding_sections.presliding_figure,
    "hysteresis": presliding_sections.hysteresis_figure,
    "tracking": moving_sections.course_figure,
    "tracking-velocity": moving_sections.velocity_figure,
    "tracking-load": moving_sections.load_figure,
}
_LABELS = {"small": "small curve", "tracking-velocity": "tracking over velocity", "tracking-load": "tracking over load"}


def drawings(joint: Joint, share: Share = map) -> dict[str, Drawing]:
    """The figures by kind, without captions; they begin to be drawn by `share`."""
    found = {
        kind: Drawing(partial(draw, joint), kind, f"{_LABELS.get(kind, kind)} of {joint.name}")
        for kind, draw in DRAW.items()
        if friction_points(joint)
        or kind not in ("small", "curve")  # others draw nothing where there is nothing to draw
    }
    for fit, draw_intervals in interval_sections.figures(joint).items():
        kind = f"uncertainty-{fit}"
        found[kind] = Drawing(draw_intervals, kind, f"intervals of {joint.name}, {fit}")
    return {kind: begun(x._replace(simulated=joint.simulated), share) for kind, x in found.items()}
