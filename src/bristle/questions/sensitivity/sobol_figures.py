"""Sobol indices as a figure, a table and sentences."""

from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bristle.model.parameters import Kind, unit
from bristle.page.style import new_figure, styled, title
from bristle.page.wording import measured, number, pretty, printable, span, symbol
from bristle.questions.sensitivity.sobol import LEVEL, Global, Indices, Output

if TYPE_CHECKING:
    import pandas as pd

_LOOKS = (
    ("first", "first order: alone", "#0072B2", "", -0.19),
    ("total", "total: with interactions", "#E69F00", "///", 0.19),
)
"""Of each kind of index: label, colour, hatch, and where its bar stands beside the parameter."""
_WIDTH = 0.36
_ROOM = 0.3
"""Above the largest bar of the first panel, for the legend."""
_TICKS = (0.0, 0.25, 0.5, 0.75, 1.0)
_LINE = 68
"""Characters of a line inside a panel."""
_SEEN = 0.05
"""A parameter or an interaction with a smaller share is not named in the sentences."""
_WORDS = {"RMS friction torque": "RMS friction force", "breakaway torque": "breakaway force"}
"""Outputs of a joint that slides."""


@styled
def sobol_figure(found: Global, kind: Kind, *, name: str, simulated: bool) -> Figure:
    """First-order and total index of each parameter with its confidence interval, a panel for each output.

    Args:
        found: what to draw.
        kind: of the joint.
        name: of the joint.
        simulated: whether what is known of the joint comes from simulated data; the loops always are.
    """
    figure = new_figure(0.5 + 2.35 * len(found.outputs))
    figure.subplots_adjust(hspace=0.5)
    axes = figure.subplots(len(found.outputs), squeeze=False)[:, 0]
    title(axes[0], name, simulated)
    for ax, output in zip(axes, found.outputs, strict=True):
        ax.annotate(_caption(output, kind), (0, 1), (0, 4), "axes fraction", "offset points", fontsize=9)
        if output.indices is None:
            _empty(ax, output.reason)
        else:
            ax.set_ylabel("Share of variance")
            _bars(ax, output.indices)
    drawn = [ax for ax, output in zip(axes, found.outputs, strict=True) if output.indices is not None]
    for ax in drawn[:1]:
        low, high = ax.get_ylim()
        ax.set_ylim(low, high + _ROOM)
        ax.legend(loc="upper right", ncols=2)
    return figure


def _bars(ax: Axes, own: Indices) -> None:
    x, ends = np.arange(len(own.effects)), [0.0, 1.0]
    for what, label, colour, hatch, shift in _LOOKS:
        height, half = np.array([(getattr(e, what), getattr(e, f"{what}_half")) for e in own.effects]).T
        ax.bar(x + shift, height, _WIDTH, color=colour, hatch=hatch, edgecolor="black", linewidth=0.6, label=label)
        ax.errorbar(x + shift, height, half, fmt="none", ecolor="black", elinewidth=1.0, capsize=3)
        ends += [*(height - half).tolist(), *(height + half).tolist()]
    ax.set_ylim(min(ends) - 0.05, max(ends) + 0.05)
    ax.axhline(0.0, color="black", linewidth=0.8)
    ax.set_yticks(_TICKS)
    ax.set_xticks(x, [symbol(e.parameter).replace(" (", "\n(") for e in own.effects])
    ax.grid(visible=False, axis="x")


def _empty(ax: Axes, reason: str) -> None:
    """A panel that says why there is nothing in it."""
    ax.set_xticks([])
    ax.set_yticks([])
    ax.annotate(
        fill(printable(reason), _LINE), (0.5, 0.5), xycoords="axes fraction", ha="center", va="center", fontsize=9
    )


def output_name(output: Output, kind: Kind) -> str:
    """What the output is called: a joint that slides has a force."""
    return _WORDS.get(output.name, output.name) if kind == "prismatic" else output.name


def _caption(output: Output, kind: Kind) -> str:
    name = output_name(output, kind)
    start = f"{name[0].upper()}{name[1:]}"
    own = output.indices
    if own is None:
        return start
    of = pretty(unit(output.quantity, kind))
    return f"{start}: {measured(own.mean, own.deviation)} {of}; {own.samples} samples"


def sobol_frame(found: Global, kind: Kind) -> "pd.DataFrame":
    """One row for each output and parameter: the interval drawn from, both indices with the half-widths of their confidence intervals, samples."""
    import pandas as pd

    rows = [
        {
            "output": output_name(output, kind), "parameter": drawn.parameter, "lower": drawn.low, "upper": drawn.high,
            "unit": unit(drawn.parameter.rstrip("+-"), kind), "drawn": "log-uniform" if drawn.logarithmic else "uniform",
            "first": effect.first, "first_half": effect.first_half, "total": effect.total, "total_half": effect.total_half,
            "samples": output.indices.samples, "evaluations": output.indices.evaluations,
        }
        for output in found.outputs if output.indices is not None
        for drawn, effect in zip(found.spans, output.indices.effects, strict=True)
    ]  # fmt: skip  # a list of values
    return pd.DataFrame(rows)


def sobol_sentences(found: Global, kind: Kind) -> tuple[str, ...]:
    """What is to be said of it: each output's parameters by their share, what was drawn and how often, and what is not in it."""
    drawn = ", ".join(
        f"{symbol(s.parameter)} {span((s.low, s.high), 3)}{' (log-uniform)' if s.logarithmic else ''}"
        for s in found.spans
    )
    of = pretty(unit("position", kind))
    return (
        *(_sentence(output, kind) for output in found.outputs),
        f"Drawn uniformly unless said otherwise, and independently, which the parameters of a fit are not: {drawn}. Seed {found.seed}.",
        f"SIMULATED: a sine of {number(found.amplitude, 3)} {of} at {number(found.frequency, 3)} Hz; in the loop the compensator keeps the nominal "
        f"parameters while the plant is drawn. ± of an index is {100 * LEVEL:.0f} % by a bootstrap, wider than these evenly spread samples need.",
    )


def _sentence(output: Output, kind: Kind) -> str:
    own = output.indices
    name = output_name(output, kind)
    start = f"{name[0].upper()}{name[1:]}"
    if own is None:
        return f"{start}: {output.reason}"
    ranked = sorted(own.effects, key=lambda e: -e.total)
    named = [e for k, e in enumerate(ranked) if k == 0 or e.total >= _SEEN]
    listed = ", ".join(f"{symbol(e.parameter)} {e.total:.2f} ± {e.total_half:.2f} ({e.first:.2f} alone)" for e in named)
    joint = 1 - sum(e.first for e in own.effects)
    more = f"; interactions make {joint:.2f}" if joint >= _SEEN else ""
    return f"{start}: total index {listed}{more}; {own.samples} samples, {own.evaluations} evaluations."
