"""Matplotlib figures of a sensitivity study: derivatives vs time, shares, maps, correlations, Sobol indices."""

from itertools import cycle, islice
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import ListedColormap, LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator, NullLocator
from numpy.typing import NDArray

from bristle.model.parameters import Kind, Lugre, unit
from bristle.page.style import ON_DARK, ON_LIGHT, WIDTH, new_figure, panels, styled, thinned, title
from bristle.page.wording import axis, measured, number, pretty, printable, symbol
from bristle.questions.sensitivity.sobol import Global
from bristle.questions.sensitivity.study import Expected, SensitivityStudy

_COLOURS = ("#0072B2", "#56B4E9", "#D55E00", "#009E73", "#E69F00", "#CC79A7")  # Okabe and Ito's, one per `Lugre` field
_MORE_COLOURS = ("#332288", "#882255", "#000000")  # darker ones, in turn, for further parameters of another law
_DARK = {_COLOURS[0], _COLOURS[2], _COLOURS[3], *_MORE_COLOURS}  # on which text is white
_PARAMETERS = len(Lugre._fields)  # of a figure of its usual height
_STAR: dict[str, Any] = {"marker": "*", "linestyle": "", "color": "white", "markeredgecolor": "black", "markersize": 9}
LEAST = 1e-3  # smallest share that is drawn


@styled
def time_figure(study: SensitivityStudy) -> Figure:
    """Velocity, and below each parameter's derivative of torque vs time: total (solid), at fixed z (dashed)."""
    seen = in_view(study)
    k = seen[thinned(seen.size, 900)]
    time, velocity = study.local.time[k], study.local.velocity[k]
    names = study.local.names
    height, count = 8.6 + 1.15 * (len(names) - _PARAMETERS), 1 + len(names)
    figure, (above, *below) = panels(height, study.name, study.simulated, count, sharex=True)
    figure.subplots_adjust(hspace=0.32)
    above.plot(time, velocity, color="black", linewidth=1.3)
    above.set_ylabel(f"v ({pretty(unit('velocity', study.kind))})")
    of_parameters = (names, colours(len(names)), study.local.partial[k].T, study.local.total[k].T)
    for ax, name, colour, partial, total in zip(below, *of_parameters, strict=True):
        ax.plot(time, partial, "--", color="#666666", linewidth=1.2)
        ax.plot(time, total, "-", color=colour, linewidth=1.5)
        ax.set_ylabel(_starred(study, name))
        limit = 4 * float(np.abs(total).max())  # a larger derivative at fixed z leaves its panel
        if 0 < limit < np.abs(partial).max():
            ax.set_ylim(-limit, limit)
        ax.yaxis.set_major_locator(MaxNLocator(3))
        ax.yaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}".replace("-", "−")))  # no exponent floats above
    handles = [below[0].lines[1], below[0].lines[0]]
    above.legend(handles, ["total", "at fixed z"], loc="lower right", ncols=2, bbox_to_anchor=(1, 0.98), frameon=False)
    below[-1].set_xlabel(axis("time", study.kind))
    of_each = f"p · dT/dp ({pretty(unit('torque', study.kind))}), each parameter p"
    below[0].set_title(of_each, loc="left", pad=4, fontsize=9.5)
    figure.align_ylabels()
    return figure


def colours(count: int) -> list[str]:
    """Colours of a law's parameters, in order."""
    return [*_COLOURS, *islice(cycle(_MORE_COLOURS), count - len(_COLOURS))]


def in_view(study: SensitivityStudy) -> NDArray[np.intp]:
    """Indices of the samples of the motion's first two periods, which are drawn vs time."""
    return np.flatnonzero(study.local.time <= 2 / study.motion.frequency)


def _starred(study: SensitivityStudy, name: str) -> str:
    """A parameter's symbol, with a star where its value is assumed."""
    return symbol(name) + ("*" if any(assumed.name == name for assumed in study.model.assumed) else "")


@styled
def first_figure(study: SensitivityStudy) -> Figure:
    """The parameter with the largest share at each amplitude and frequency; a line around where the claim holds."""
    figure, (ax,) = panels(5.4, study.name, study.simulated)
    figure.subplots_adjust(left=0.16, top=0.86)
    ax.set_title(ax.get_title(loc="left"), loc="left", pad=32)
    first, names, shades = study.map.first, study.map.names, colours(len(study.map.names))
    _cells(ax, first, cmap=ListedColormap(shades), vmin=-0.5, vmax=len(shades) - 0.5)
    for (i, j), k in np.ndenumerate(first):
        ink = ON_DARK if shades[k] in _DARK else ON_LIGHT
        ax.text(j, i + 0.13, symbol(names[k]), ha="center", va="center", fontsize=9, color=ink)
        ax.text(j, i - 0.26, f"{study.map.shares[i, j, k]:.2f}", ha="center", va="center", fontsize=6.5, color=ink)
    padded = np.pad(study.map.claim.astype(int), 1)
    for along, (across, up) in enumerate([(1, 0), (0, 1)]):  # a line around the cells where the claim holds
        for i, j in np.argwhere(np.diff(padded, axis=along)):
            x, y = (j - 0.5 - across, j - 0.5), (i - 0.5 - up, i - 0.5)
            ax.plot(x, y, "-", color="black", linewidth=2.5, solid_capstyle="round")
    column = int(np.argmin(np.abs(study.map.frequencies - study.motion.frequency)))
    row = int(np.argmin(np.abs(study.map.amplitudes - study.motion.amplitude)))
    ax.plot([column + 0.36], [row + 0.3], **_STAR)
    _map_axes(ax, study)
    handles = [
        ax.plot([], [], "s", color=shades[k], markersize=9, label=symbol(name))[0]
        for k, name in enumerate(names)
        if (first == k).any()
    ]
    handles.append(ax.plot([], [], "-", color="black", linewidth=2.5, label="α₀, α₂ first two")[0])
    handles.append(ax.plot([], [], label="the motion", **_STAR)[0])
    ax.legend(
        handles=handles, loc="lower left", bbox_to_anchor=(-0.02, 0.99), ncols=8, frameon=False, fontsize=8.5,
        columnspacing=0.9, handletextpad=0.5,
    )  # fmt: skip  # a list of values
    return figure


def _map_axes(ax: Axes, study: SensitivityStudy, every: int = 1) -> None:
    """Axes of a map, with a label at every `every`-th cell."""
    frequencies, amplitudes = study.map.frequencies, study.map.amplitudes
    ax.set_xticks(range(0, frequencies.size, every), [number(float(f), 2) for f in frequencies[::every]])
    ax.set_yticks(range(0, amplitudes.size, every), [number(float(a), 2) for a in amplitudes[::every]])
    ax.set_xlim(-0.5, frequencies.size - 0.5)
    ax.set_ylim(-0.5, amplitudes.size - 0.5)
    ax.grid(visible=False)
    ax.set_xlabel("Frequency (Hz)")
    ax.set_ylabel(f"Amplitude ({pretty(unit('position', study.kind))})")


@styled
def map_figure(study: SensitivityStudy) -> Figure:
    """Each parameter's total share over amplitude and frequency, one panel each, on one logarithmic scale."""
    names = study.map.names
    rows = -(-len(names) // 2)
    figure = new_figure(6.6 + 2.2 * (rows - 3))
    figure.subplots_adjust(left=0.16, right=0.86, top=0.9, hspace=0.28, wspace=0.12)
    axes = figure.subplots(rows, 2, sharex=True, sharey=True).ravel()
    title(axes[0], study.name, study.simulated)
    norm = LogNorm(LEAST, 1.0)
    for k, (ax, name) in enumerate(zip(axes, names, strict=False)):
        shares = np.clip(study.map.shares[:, :, k], LEAST, 1.0)
        image = _cells(ax, shares, cmap="cividis", norm=norm)
        box = {"facecolor": "white", "alpha": 0.85, "linewidth": 0, "pad": 2}
        ax.text(0.03, 0.93, symbol(name), transform=ax.transAxes, va="top", fontsize=11, bbox=box)
        _map_axes(ax, study, 2)
        ax.tick_params(labelsize=8.5)
        ax.label_outer(remove_inner_ticks=False)
    if len(names) < axes.size:  # the last but one of its column is its last
        axes[-1].set_visible(False)
        axes[-3].tick_params(labelbottom=True)
        axes[-3].set_xlabel("Frequency (Hz)")
    bar = figure.colorbar(image, ax=axes, cax=figure.add_axes((0.885, 0.09, 0.025, 0.81)))
    bar.ax.yaxis.set_major_locator(FixedLocator([1e-3, 1e-2, 0.1, 1.0]))
    bar.ax.yaxis.set_major_formatter("{x:g}")
    bar.ax.yaxis.set_minor_locator(NullLocator())
    bar.ax.set_title("share", fontsize=9, loc="left")
    return figure


def _cells(ax: Axes, values: NDArray[Any], **look: Any) -> QuadMesh:
    """Cells of values (rows, columns), centred on whole numbers; `look` as of pcolormesh."""
    edges = (np.arange(size + 1) - 0.5 for size in values.shape[::-1])
    return ax.pcolormesh(*edges, values, edgecolors="face", linewidth=0.3, **look)


@styled
def correlation_figure(study: SensitivityStudy, expected: Expected) -> Figure:
    """Correlation of the estimates of a measurement; a cross where a parameter is not identifiable."""
    info = expected.information
    seen = np.isfinite(info.standard_errors)
    size = len(info.names)
    side = 0.62 + 0.4 * max(size, 6)
    figure = new_figure(side + 0.5, min(WIDTH, side + 1.6))
    figure.subplots_adjust(left=0.2, bottom=0.16, right=0.97, top=0.88)
    ax = figure.subplots()
    title(ax, study.name, study.simulated)
    shade = np.where(np.outer(seen, seen), info.correlation, 0.0)
    _cells(ax, shade, cmap="RdBu_r", vmin=-1, vmax=1)
    ax.set_aspect("equal")
    ax.invert_yaxis()
    for i, j in np.ndindex(size, size):
        text = correlated(float(shade[i, j])) if seen[i] and seen[j] else "×"
        ink = ON_DARK if abs(shade[i, j]) > 0.7 else ON_LIGHT
        ax.text(j, i, text, ha="center", va="center", color=ink, fontsize=8.5 if size < 8 else 6.5)
    labels = [symbol(name).replace("gravity", "grav.") for name in info.names]
    ax.set_xticks(range(size), labels, rotation=90 if any(len(label) > 3 for label in labels) else 0)
    ax.set_yticks(range(size), labels)
    ax.grid(visible=False)
    return figure


def correlated(correlation: float) -> str:
    """A correlation in print."""
    return f"{correlation:.2f}".replace("-0.00", "0.00").replace("-", "−")


@styled
def sobol_figure(sobol: Global, kind: Kind, *, name: str, simulated: bool) -> Figure:
    """First-order and total index of each parameter with its interval, a panel per output."""
    figure, axes = panels(0.5 + 2.35 * len(sobol.outputs), name, simulated, len(sobol.outputs))
    figure.subplots_adjust(hspace=0.5)
    for ax, output in zip(axes, sobol.outputs, strict=True):
        heading = output.heading(kind)
        if not output.effects:
            ax.set(xticks=[], yticks=[])
            reason = fill(printable(str(output.reason)), 68)
            ax.annotate(reason, (0.5, 0.5), xycoords="axes fraction", ha="center", va="center", fontsize=9)
        else:
            mean = f"{measured(output.mean, output.deviation)} {pretty(unit(output.quantity, kind))}"
            heading += f": {mean}; {output.samples} samples"
            ax.set_ylabel("Share of variance")
            x, ends = np.arange(len(output.effects)), [0.0, 1.0]
            _, first, first_half, total, total_half = map(np.array, zip(*output.effects, strict=True))
            for height, half, label, colour, hatch, shift in (
                (first, first_half, "first order: alone", "#0072B2", "", -0.19),
                (total, total_half, "total: with interactions", "#E69F00", "///", 0.19),
            ):
                ax.bar(
                    x + shift, height, 0.36, color=colour, hatch=hatch, edgecolor="black", linewidth=0.6, label=label
                )
                ax.errorbar(x + shift, height, half, fmt="none", ecolor="black", elinewidth=1.0, capsize=3)
                ends += [*(height - half).tolist(), *(height + half).tolist()]
            ax.set_ylim(min(ends) - 0.05, max(ends) + 0.05)
            ax.axhline(0.0, color="black", linewidth=0.8)
            ax.set_yticks(np.linspace(0, 1, 5))
            ax.set_xticks(x, [symbol(e.parameter).replace(" (", "\n(") for e in output.effects])
            ax.grid(visible=False, axis="x")
        ax.annotate(heading, (0, 1), (0, 4), "axes fraction", "offset points", fontsize=9)
    if drawn := [ax for ax, output in zip(axes, sobol.outputs, strict=True) if output.effects]:
        low, high = drawn[0].get_ylim()
        drawn[0].set_ylim(low, high + 0.3)  # for the legend
        drawn[0].legend(loc="upper right", ncols=2)
    return figure
