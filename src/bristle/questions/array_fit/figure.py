"""How a fit of arrays shows itself: as a figure, as text, and in a notebook."""

from collections.abc import Iterator
from html import escape

import numpy as np
from matplotlib.axes import Axes

from bristle.diagnostics import Severity
from bristle.identification.static.curve import band, curve
from bristle.page.style import DIRECTION, inline, new_figure, render_as, styled
from bristle.page.wording import axis, direction
from bristle.questions.array_fit.fit import Fit


def draw(fit: Fit, ax: Axes | None = None) -> Axes:
    """The points, the fitted curve and its 95 % band over velocity, rad/s and N*m, into `ax` or new axes of pyplot."""
    if ax is None:
        import matplotlib.pyplot as plt

        ax = plt.subplots()[1]
    for d, static in fit.joint.static.items():
        if d not in DIRECTION:
            continue
        look, law = DIRECTION[d], static.values()
        ax.plot(
            static.velocity, static.torque, look.marker, color=look.colour, label=f"measured {direction(d)}".rstrip()
        )
        for sign in (1.0, -1.0):
            speeds = np.abs(static.velocity[static.velocity * sign > 0])
            if law is None or not speeds.size:
                continue
            v = sign * np.geomspace(speeds.min() / 50, speeds.max(), 200)
            T, half = curve(v, law), band(v, static)
            ax.plot(v, T, look.line, color=look.colour)
            if half is not None:
                ax.fill_between(v, T - half, T + half, color=look.colour, alpha=0.22, linewidth=0)
    ax.set_xlabel(axis("velocity", fit.joint.kind))
    ax.set_ylabel(axis("torque", fit.joint.kind))
    ax.legend()
    return ax


def text(fit: Fit) -> str:
    """How the fit ended, its parameters, and what to be careful about."""
    frame = fit.to_frame().drop(columns="warnings")
    return "\n".join([*_outcomes(fit), frame.to_string(float_format="{:.5g}".format, na_rep="-"), *_serious(fit)])


@styled
def html(fit: Fit) -> str:
    """The same with the curve, for a notebook; text that may be anybody's is escaped."""
    figure = new_figure(3.6)
    draw(fit, figure.subplots())
    curve_of = inline(render_as(figure, "svg"), "fit", "friction over velocity, measured and fitted")
    paragraphs = "".join(f"<p>{escape(line)}</p>" for line in _outcomes(fit))
    points = "".join(f"<li>{escape(line)}</li>" for line in _serious(fit))
    table = fit.to_frame().drop(columns="warnings").to_html(float_format="{:.5g}".format, na_rep="-")
    return f"<div>{paragraphs}{table}<ul>{points}</ul><div style='max-width:36rem'>{curve_of}</div></div>"


def _outcomes(fit: Fit) -> Iterator[str]:
    for d, static in fit.joint.static.items():
        error = "" if static.relative_error is None else f" Relative error {static.relative_error:.3g} %."
        yield f"{direction(d)} {static.n} points. {static.outcome}{error}".strip()


def _serious(fit: Fit) -> Iterator[str]:
    return (f"{w.severity}: {w}" for w in fit.warnings if w.severity is not Severity.NOTE)
