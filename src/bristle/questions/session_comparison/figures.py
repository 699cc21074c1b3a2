"""The comparison of two sessions as figures: both intervals of each parameter, relative to the first session's value."""

import numpy as np
from matplotlib.figure import Figure

from bristle.identification.fits import Estimate
from bristle.page.style import DIRECTION, new_figure, styled, title
from bristle.page.wording import shortened, symbol
from bristle.questions.session_comparison.results import Change, Comparison

_ROW = 0.34
"""Height of a parameter, inches."""
_APART = 0.17
"""The sessions stand this far above and below a parameter's line, rows."""
_MOST = 40
"""Parameters drawn; the table has all."""
_BEYOND = 8.0
"""The axis reaches this many times as far as the median of the rows."""


@styled
def forest_figure(compared: Comparison, joint: str) -> Figure | None:
    """Forest plot of one joint: value and 95 % interval of each comparable parameter in both sessions, percent from the first session's value.

    What changed is marked; where an interval reaches beyond the axis, an arrow says so. None where nothing can be drawn.
    """
    rows = [c for c in compared.changes if c.joint == joint and c.changed is not None and c.first and c.first.value]
    rows = rows[:_MOST]
    if not rows:
        return None
    figure = new_figure(1.3 + _ROW * len(rows))
    figure.subplots_adjust(left=0.19, right=0.87, top=1 - 0.66 / figure.get_figheight())
    ax = figure.subplots()
    # Half of the axis, percent: all differences are on it, and intervals unless they are far wider than the others.
    wide = np.array([max(abs(x) for e in (row.first, row.second) for x in _span(row, e)) for row in rows])
    far = max(abs(_span(row, row.second)[1]) for row in rows)
    reach = 1.12 * max(min(float(wide.max()), _BEYOND * float(np.median(wide))), far, 1e-6)
    for session, look, side in (("first", DIRECTION["+"], -_APART), ("second", DIRECTION["-"], _APART)):
        for k, row in enumerate(rows):
            low, value, high = _span(row, getattr(row, session))
            y, label = k + side, f"{session} session" if k == 0 else None
            ax.plot([max(low, -reach), min(high, reach)], [y, y], color=look.colour, linestyle=look.line, linewidth=1.8)
            ax.plot([value], [y], color=look.colour, marker=look.marker, markersize=5.5, linestyle="none", label=label)
            for end, edge, arrow in ((low, -reach, "<"), (high, reach, ">")):
                if abs(end) > reach and end * edge > 0:
                    ax.plot([edge], [y], marker=arrow, color=look.colour, markersize=7, clip_on=False)
    for k, row in enumerate(rows):
        if row.changed:
            ax.axhspan(k - 0.5, k + 0.5, color="#f0e442", alpha=0.35, linewidth=0)
            ax.annotate("changed", (1.015, k), xycoords=("axes fraction", "data"), va="center", fontsize=9)
    ax.axvline(0, color="#444444", linewidth=0.8)
    ax.set(
        xlim=(-reach, reach),
        ylim=(len(rows) - 0.5, -0.5),
        xlabel="From the first session's value (%), with 95 % intervals",
    )
    ax.set_yticks(range(len(rows)), [shortened(symbol(row.parameter), 18) for row in rows])
    ax.grid(visible=False, axis="y")
    ax.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=2, frameon=False, borderaxespad=0.1)
    title(ax, shortened(joint, 30), compared.simulated)
    ax.set_title(ax.get_title(loc="left"), loc="left", pad=25)  # above the legend
    return figure


def _span(row: Change, e: Estimate | None) -> tuple[float, float, float]:
    """Lower end, value and upper end of one session, percent from the first session's value."""
    base = (row.first.value if row.first else None) or 1.0
    low, high = (e.interval if e else None) or (base, base)
    value = (e.value if e else None) or 0.0
    ends = sorted(100 * (x - base) / abs(base) for x in (low, high))
    return ends[0], 100 * (value - base) / abs(base), ends[1]
