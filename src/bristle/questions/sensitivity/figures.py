"""Sensitivity as matplotlib figures: derivatives over time, shares, maps over amplitude and frequency, tornado charts, correlations."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator, NullLocator
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.model.parameters import Lugre, unit
from bristle.page.style import WIDTH, new_figure, styled, thinned, title
from bristle.page.wording import axis, number, pretty, shortened, symbol
from bristle.questions.sensitivity.local import Tornado
from bristle.questions.sensitivity.study import Expected, Exploration

COLOUR = dict(zip(Lugre._fields, ("#0072B2", "#56B4E9", "#D55E00", "#009E73", "#E69F00", "#CC79A7"), strict=True))
"""Okabe and Ito's colours, one for each parameter."""
_DARK = {"alpha_0", "alpha_2", "v_s"}
"""On whose colours text is white."""
_ENDS = (("white", "at the interval's lower end"), ("#0072B2", "at its upper end"))
"""How tornado charts show both ends."""
_PERIODS = 2
"""Of the motion, drawn over time."""
_BEYOND = 4.0
"""A derivative at fixed z that is more than so many times the largest total one leaves its panel."""
_MOST = 900
_LEAST = 1e-3
"""Shares below this are drawn as this."""
_SEEN = 1e-5
"""A swing below this share of the output is none."""


@styled
def time_figure(x: Exploration) -> Figure:
    """Velocity, and under it each parameter's derivative of torque over time: total (solid), partial at fixed z (dashed)."""
    near, kind = x.local, x.kind
    shown = np.flatnonzero(near.time <= _PERIODS / x.motion.frequency)
    k = shown[thinned(shown.size, _MOST)]
    figure = new_figure(8.6)
    figure.subplots_adjust(hspace=0.22)
    above, *panels = figure.subplots(7, sharex=True)
    title(above, x.name, x.simulated)
    above.plot(near.time[k], near.velocity[k], color="black", linewidth=1.3)
    above.set_ylabel(f"v ({pretty(unit('velocity', kind))})")
    for ax, name, column in zip(panels, Lugre._fields, range(6), strict=True):
        ax.plot(near.time[k], near.partial[k, column], "--", color="#666666", linewidth=1.2)
        ax.plot(near.time[k], near.total[k, column], "-", color=COLOUR[name], linewidth=1.5)
        ax.set_ylabel(_starred(x, name))
        largest = _BEYOND * float(np.abs(near.total[k, column]).max())
        if 0 < largest < np.abs(near.partial[k, column]).max():
            ax.set_ylim(-largest, largest)
        ax.yaxis.set_major_locator(MaxNLocator(3))
        ax.ticklabel_format(axis="y", scilimits=(-3, 3), useOffset=False)
        ax.yaxis.get_offset_text().set_fontsize(8)
    handles = [panels[0].lines[1], panels[0].lines[0]]
    above.legend(
        handles, ["total", "at fixed z"], loc="lower right", ncols=2, bbox_to_anchor=(1.0, 0.98), frameon=False
    )
    panels[-1].set_xlabel(axis("time", kind))
    figure.supylabel(f"p · dT/dp ({pretty(unit('torque', kind))})", x=0.005, y=0.42, fontsize=10.5)
    figure.align_ylabels()
    return figure


def _starred(x: Exploration, name: str) -> str:
    """A parameter's symbol, with a star where its value is assumed in a direction."""
    return symbol(name) + ("*" if any(own.rstrip("+-") == name for own in x.model.assumed) else "")


@styled
def shares_figure(x: Exploration) -> Figure:
    """RMS of each derivative over the RMS of the friction torque, total and at fixed z, as bars with numbers, the largest total first."""
    total, partial = x.local.shares(), x.local.shares(partial=True)
    order = [Lugre._fields.index(name) for name in x.local.ranking]
    figure = new_figure(3.7)
    ax = figure.subplots()
    title(ax, x.name, x.simulated)
    place = np.arange(len(order), dtype=np.float64)
    for values, shift, colour, hatch, label in (
        (total, -0.2, "#0072B2", "", "total"),
        (partial, 0.2, "#E69F00", "//", "at fixed z"),
    ):
        drawn = np.maximum(values[order], _LEAST / 10)
        ax.barh(
            place + shift, drawn, 0.36, left=0, color=colour, hatch=hatch, edgecolor="white", linewidth=0.4, label=label
        )
        for y, value, end in zip(place + shift, values[order], drawn, strict=True):
            ax.annotate(
                number(float(value), 2), (end, y), (3, 0), textcoords="offset points", va="center", fontsize=8.5
            )
    ax.set_xscale("log")
    ax.set_xlim(_LEAST / 10, 4 * max(1.0, float(total.max()), float(partial.max())))
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.set_yticks(place, [_starred(x, Lugre._fields[k]) for k in order])
    ax.grid(visible=False, axis="y")
    ax.invert_yaxis()
    ax.legend(loc="lower right")
    ax.set_xlabel(f"RMS of p · dT/dp over RMS {'force' if x.kind == 'prismatic' else 'torque'}")
    return figure


@styled
def first_figure(x: Exploration) -> Figure:
    """Which parameter ranks first for each amplitude and frequency, by colour and symbol; a line around where the paper's claim holds."""
    figure = new_figure(5.4)
    figure.subplots_adjust(left=0.16, top=0.86)
    ax = figure.subplots()
    title(ax, x.name, x.simulated)
    ax.set_title(ax.get_title(loc="left"), loc="left", pad=32)
    first, claim = x.map.first, x.map.claim
    present = [name for k, name in enumerate(Lugre._fields) if (first == k).any()]
    colours = ListedColormap(list(COLOUR.values()))
    ax.pcolormesh(
        *_edges(first), first, cmap=colours, vmin=-0.5, vmax=len(COLOUR) - 0.5, edgecolors="face", linewidth=0.3
    )
    for (i, j), k in np.ndenumerate(first):
        name = Lugre._fields[k]
        ink = "white" if name in _DARK else "black"
        ax.text(j, i + 0.13, symbol(name), ha="center", va="center", fontsize=9, color=ink)
        ax.text(j, i - 0.26, f"{x.map.shares[i, j, k]:.2f}", ha="center", va="center", fontsize=6.5, color=ink)
    _border(ax, claim)
    own = (
        int(np.argmin(np.abs(x.map.frequencies - x.motion.frequency))),
        int(np.argmin(np.abs(x.map.amplitudes - x.motion.amplitude))),
    )
    ax.plot([own[0] + 0.36], [own[1] + 0.3], "*", color="white", markeredgecolor="black", markersize=9)
    _ticks(ax, x)
    handles = [ax.plot([], [], "s", color=COLOUR[name], markersize=9, label=symbol(name))[0] for name in present]
    handles.append(ax.plot([], [], "-", color="black", linewidth=2.5, label="α₀, α₂ first two")[0])
    handles.append(ax.plot([], [], "*", color="white", markeredgecolor="black", markersize=9, label="the motion")[0])
    ax.legend(
        handles=handles,
        loc="lower left",
        bbox_to_anchor=(-0.02, 0.99),
        ncols=8,
        frameon=False,
        fontsize=8.5,
        columnspacing=0.9,
        handletextpad=0.5,
    )
    return figure


def _border(ax: Axes, inside: NDArray[np.bool_]) -> None:
    """A line around the cells that are inside."""
    padded = np.pad(inside.astype(int), 1)
    for i, j in np.argwhere(np.diff(padded, axis=0)):
        ax.plot([j - 1.5, j - 0.5], [i - 0.5, i - 0.5], "-", color="black", linewidth=2.5, solid_capstyle="round")
    for i, j in np.argwhere(np.diff(padded, axis=1)):
        ax.plot([j - 0.5, j - 0.5], [i - 1.5, i - 0.5], "-", color="black", linewidth=2.5, solid_capstyle="round")


def _ticks(ax: Axes, x: Exploration, every: int = 1) -> None:
    frequencies, amplitudes = x.map.frequencies, x.map.amplitudes
    ax.set_xticks(range(0, frequencies.size, every), [number(float(f), 2) for f in frequencies[::every]])
    ax.set_yticks(range(0, amplitudes.size, every), [number(float(a), 2) for a in amplitudes[::every]])
    ax.set_xlim(-0.5, frequencies.size - 0.5)
    ax.set_ylim(-0.5, amplitudes.size - 0.5)
    ax.grid(visible=False)
    ax.set_xlabel("Frequency (Hz)")
    ax.set_ylabel(f"Amplitude ({pretty(unit('position', x.kind))})")


@styled
def map_figure(x: Exploration) -> Figure:
    """Each parameter's total share over amplitude and frequency, one panel each, in one logarithmic grey-safe scale."""
    figure = new_figure(6.6)
    figure.subplots_adjust(left=0.16, right=0.86, top=0.9, hspace=0.28, wspace=0.12)
    axes = figure.subplots(3, 2, sharex=True, sharey=True).ravel()
    title(axes[0], x.name, x.simulated)
    norm = LogNorm(_LEAST, 1.0)
    for ax, name, k in zip(axes, Lugre._fields, range(6), strict=True):
        shares = np.clip(x.map.shares[:, :, k], _LEAST, 1.0)
        image = ax.pcolormesh(*_edges(shares), shares, cmap="cividis", norm=norm, edgecolors="face", linewidth=0.3)
        ax.text(
            0.03,
            0.93,
            symbol(name),
            transform=ax.transAxes,
            va="top",
            fontsize=11,
            bbox={"facecolor": "white", "alpha": 0.85, "linewidth": 0, "pad": 2},
        )
        _ticks(ax, x, 2)
        ax.tick_params(labelsize=8.5)
        ax.set_xlabel("Frequency (Hz)" if ax in axes[4:] else "")
        ax.set_ylabel(f"Amplitude ({pretty(unit('position', x.kind))})" if ax in axes[::2] else "")
    bar = figure.colorbar(image, ax=axes, cax=figure.add_axes((0.885, 0.09, 0.025, 0.81)))
    bar.ax.yaxis.set_major_locator(FixedLocator([1e-3, 1e-2, 0.1, 1.0]))
    bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    bar.ax.yaxis.set_minor_locator(NullLocator())
    bar.ax.set_title("share", fontsize=9, loc="left")
    return figure


def _edges(cells: NDArray[Any]) -> tuple[Array, Array]:
    """Where cells with whole numbers at their middles begin and end, along x and y."""
    return np.arange(cells.shape[1] + 1) - 0.5, np.arange(cells.shape[0] + 1) - 0.5


@styled
def tornado_figure(x: Exploration) -> Figure | None:
    """What each parameter's interval does to each output, percent, from its lower end (open) to its upper end (filled); None without intervals."""
    if not x.tornado:
        return None
    rows = [max(len(_moving(chart)), 1) for chart in x.tornado]
    height = 0.75 + sum(rows) * 0.24 + 0.62 * len(rows)
    figure = new_figure(height)
    figure.subplots_adjust(
        left=0.14, bottom=0.5 / height, top=1 - 0.8 / height, hspace=0.62 * len(rows) / (0.24 * sum(rows))
    )
    axes: Sequence[Axes] = list(figure.subplots(len(rows), squeeze=False, height_ratios=rows)[:, 0])
    for ax, chart in zip(axes, x.tornado, strict=True):
        _tornado(ax, chart, x)
    named = f"{shortened(x.name, 40)}{' (SIMULATED data)' if x.simulated else ''}"
    figure.text(0.14, 1 - 0.2 / height, named, fontsize=10.5, va="center")
    ends = [Patch(facecolor=colour, edgecolor="black", label=label) for colour, label in _ENDS]
    figure.legend(handles=ends, loc="center", bbox_to_anchor=(0.55, 1 - 0.45 / height), ncols=2, frameon=False)
    axes[-1].set_xlabel("Change of the output (%)")
    return figure


def _heading(chart: Tornado, x: Exploration) -> str:
    word = chart.output.replace("torque", "force") if x.kind == "prismatic" else chart.output
    return f"{word[0].upper()}{word[1:]}, {number(chart.value, 3)} {pretty(unit(chart.quantity, x.kind))}"


def _moving(chart: Tornado) -> list[tuple[str, float, float]]:
    """Parameters that move the output, with its change at both ends, percent."""
    return [
        (swing.parameter, 100 * (swing.at_low / chart.value - 1), 100 * (swing.at_high / chart.value - 1))
        for swing in chart.swings
        if swing.width > _SEEN * abs(chart.value)
    ]


def _tornado(ax: Axes, chart: Tornado, x: Exploration) -> None:
    rows = _moving(chart)
    place = np.arange(len(rows))
    for k, (colour, _) in enumerate(_ENDS):
        ax.barh(place, [row[1 + k] for row in rows], 0.62, color=colour, edgecolor="black", linewidth=0.9)
    ax.axvline(0, color="black", linewidth=1)
    ax.set_yticks(place, [symbol(name) for name, *_ in rows])
    ax.set_ylim(max(len(rows), 1) - 0.5, -0.5)
    widest = 1.15 * max((max(abs(low), abs(high)) for _, low, high in rows), default=1.0)
    ax.set_xlim(-widest, widest)
    ax.grid(visible=False, axis="y")
    ax.set_title(_heading(chart, x), loc="left", fontsize=9.5, pad=4)


@styled
def correlation_figure(x: Exploration, expected: Expected) -> Figure:
    """Correlation of the estimates that a measurement would give, by shade and number; a cross where a parameter is not seen."""
    info = expected.information
    seen = np.isfinite(info.standard_errors)
    size = len(info.names)
    side = 0.62 + 0.4 * max(size, 6)
    figure = new_figure(side + 0.5, min(WIDTH, side + 1.6))
    figure.subplots_adjust(left=0.2, bottom=0.16, right=0.97, top=0.88)
    ax = figure.subplots()
    title(ax, x.name, x.simulated)
    shade = np.where(np.outer(seen, seen), info.correlation, 0.0)
    ax.pcolormesh(*_edges(shade), shade, cmap="RdBu_r", vmin=-1, vmax=1, edgecolors="face", linewidth=0.3)
    ax.set_aspect("equal")
    ax.invert_yaxis()
    for i, j in np.ndindex(size, size):
        text = f"{info.correlation[i, j]:.2f}".replace("-0.00", "0.00") if seen[i] and seen[j] else "×"
        ink = "white" if seen[i] and seen[j] and abs(info.correlation[i, j]) > 0.7 else "black"
        ax.text(j, i, text.replace("-", "−"), ha="center", va="center", color=ink, fontsize=8.5 if size < 8 else 6.5)
    labels = [symbol(name).replace("gravity", "grav.") for name in info.names]
    ax.set_xticks(range(size), labels, rotation=90 if any(len(label) > 3 for label in labels) else 0)
    ax.set_yticks(range(size), labels)
    ax.grid(visible=False)
    return figure
