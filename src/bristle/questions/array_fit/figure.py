"""A fit of arrays as a figure, and in a notebook."""

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from html import escape
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from bristle.identification.curve import band, curve
from bristle.identification.results import Joint
from bristle.model.functions import loading_displacement_function
from bristle.model.vectorize import evaluate
from bristle.page.style import DIRECTION, inline, new_figure, render_as, styled, thinned
from bristle.page.wording import axis, direction
from bristle.questions.array_fit.fit import Stage

if TYPE_CHECKING:
    import pandas as pd


def draw_joint(joint: Joint, ax: Axes | None = None) -> Axes:
    """What was measured and what the fit makes of it: friction vs velocity where it has points, else its moving runs, else its slow loading."""
    points = any(static.velocity.size for static in joint.static.values())
    return draw_stage(joint, "static" if points else "dynamic" if joint.moving else "presliding", ax)


def draw_stage(joint: Joint, stage: Stage, ax: Axes | None = None) -> Axes:
    """The same of one stage of a joint, into `ax` or new axes of pyplot."""
    if ax is None:
        import matplotlib.pyplot as plt

        ax = plt.subplots()[1]
    kind = joint.kind
    {"static": _points, "presliding": _loadings, "dynamic": _motion}[stage](ax, joint)
    across = {"static": axis("velocity", kind), "presliding": axis("displacement", kind), "dynamic": "Time (s)"}
    ax.set_xlabel(across[stage])
    ax.set_ylabel(axis("torque", kind))
    if ax.get_legend_handles_labels()[1]:
        ax.legend()
    return ax


def _points(ax: Axes, joint: Joint) -> None:
    """Points, curve and 95 % band over velocity."""
    for d, static in joint.static.items():
        if d not in DIRECTION:
            continue
        look, law = DIRECTION[d], static.values()
        ax.plot(static.velocity, static.torque, look.marker, color=look.colour, label=f"measured, {direction(d)}")
        for sign in (1.0, -1.0):
            speeds = np.abs(static.velocity[static.velocity * sign > 0])
            if law is None or not speeds.size:
                continue
            v = sign * np.geomspace(speeds.min() / 50, speeds.max(), 200)
            T, half = curve(v, law), band(v, static)
            ax.plot(v, T, look.line, color=look.colour)
            if half is not None:
                ax.fill_between(v, T - half, T + half, color=look.colour, alpha=0.22, linewidth=0)


def _loadings(ax: Axes, joint: Joint) -> None:
    """Torque over displacement of each loading, and LuGre's curve with the sigma_0 that was found."""
    slow = joint.presliding
    for d, one in slow.fits.items() if slow else ():
        look, sigma_0 = DIRECTION[d], one.sigma_0.value
        for k, x in enumerate(one.loadings):
            label = f"measured, {direction(d)}" if k == 0 else None
            ax.plot(x.displacement, x.torque, "-", color=look.colour, linewidth=0.8, label=label)
        if sigma_0 is not None:
            T = np.linspace(0, min(max(x.torque.max(initial=0.0) for x in one.loadings), 0.95 * one.level), 100)
            (y, *_) = evaluate(loading_displacement_function(), T, one.level, sigma_0)
            ax.plot(y, T, "--", color="black", linewidth=1.2, label=f"LuGre, {direction(d)}")


def _motion(ax: Axes, joint: Joint) -> None:
    """Measured and fitted torque over time."""
    moving = joint.moving
    if moving is not None:
        k = thinned(moving.time.size, 4000)
        ax.plot(moving.time[k], moving.measured[k], "-", color=DIRECTION["+"].colour, label="measured")
        fitted = (moving.measured - moving.residuals)[k]
        ax.plot(moving.time[k], fitted, "--", color=DIRECTION["-"].colour, label="fitted")


@styled
def html(heading: str, lines: Iterable[str], frame: "pd.DataFrame", draw: Callable[[Axes], object], name: str) -> str:
    """A fit with its table and its picture, for a notebook; text that may be anybody's is escaped."""
    figure = new_figure(3.4)
    draw(figure.subplots())
    said = "".join(f"<p>{escape(line)}</p>" for line in lines)
    table = frame.to_html(float_format="{:.5g}".format, na_rep="-")
    picture = inline(render_as(figure, "svg"), name, "measured and fitted")
    return f"<h4>{escape(heading)}</h4>{said}{table}<div style='max-width:36rem'>{picture}</div>"


def joints_html(joints: Sequence[Joint], frame: "pd.DataFrame") -> str:
    """Joints with their rows of the table, and their curves."""
    rows = frame.drop(columns="warnings").set_index("joint")
    named = ((x.name, rows.loc[[x.name]], partial(draw_joint, x)) for x in joints)
    return "".join(html(name, (), own, draw, f"joint-{k}") for k, (name, own, draw) in enumerate(named))
