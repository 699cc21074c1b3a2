"""Matplotlib figures of a compensation study: Figs 5 to 12 of the paper, and others."""

from collections.abc import Mapping

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from bristle.arrays import Array
from bristle.control.closed_loop import Trajectory
from bristle.model.parameters import unit
from bristle.page.style import ON_DARK, ON_LIGHT, new_figure, panels, styled, thinned, title
from bristle.page.wording import axis, number, pretty, symbol
from bristle.questions.compensation.study import Study
from bristle.simulation.edro import TABLE_2_ADAPTED

MOST = 500  # points of each line drawn over time
_GREY, _BLUE, _VERMILION, _GREEN, _BLACK = "#999999", "#0072B2", "#D55E00", "#009E73", "#000000"
LAWS = {
    "not adapted": (_GREY, (0, (1, 1))), "printed": (_VERMILION, "--"), "partial": (_BLUE, "-"),
    "partial-theta": (_BLACK, ":"), "total": (_GREEN, "-."),
}  # fmt: skip  # colour and line of each adaptation law


def _line(ax: Axes, run: Trajectory, values: Array, colour: str, line: object, label: str) -> None:
    k = thinned(run.time.size, MOST)
    ax.plot(run.time[k], values[k], linestyle=line, color=colour, linewidth=1.3, label=label)


@styled
def courses_figure(study: Study, runs: Mapping[str, Trajectory]) -> Figure:
    """Figs 5 to 7 and 10 to 12: two runs of one reference, by label: position, position error and control vs time."""
    kind = study.loops[0].kind
    figure, (above, middle, below) = panels(0.5 + 3 * 2.2, study.loops[0].name, True, 3, sharex=True)
    looks, last = ((_VERMILION, "--"), (_BLUE, "-")), list(runs.values())[-1]
    _line(above, last, last.reference, _GREY, "-", "reference")
    for (label, run), look in zip(runs.items(), looks, strict=True):
        for ax, values in ((above, run.position[0]), (middle, run.error[0]), (below, run.torque[0])):
            _line(ax, run, values, *look, label)
    above.set_ylabel(axis("position", kind))
    middle.set_ylabel(axis("position", kind, "error of"))
    below.set_ylabel(axis("torque", kind, "control"))
    low, high = above.get_ylim()
    above.set_ylim(low, high + 0.28 * (high - low))  # room for the legend
    above.legend(loc="upper right", ncols=3)
    below.set_xlabel(axis("time", kind))
    return figure


@styled
def errors_figure(study: Study) -> Figure:
    """Fig. 8: RMS errors of each joint without, with and with adaptive compensation, as bars; a panel per frequency."""
    kind = study.loops[0].kind
    rows = [row for row in study.errors if not row.inertia]
    names = list(dict.fromkeys(row.joint for row in rows))
    frequencies = list(dict.fromkeys(row.frequency for row in rows))
    named = names[0] if len(names) == 1 else f"{len(names)} joints"
    figure, axes = panels(0.4 + 3.0 * len(frequencies), named, True, len(frequencies))
    looks = (("without", _GREY, ""), ("identified", _BLUE, "//"), ("adaptive", _GREEN, ".."))
    labels = {"without": "without", "identified": "LuGre feed-forward", "adaptive": "the same, adaptive"}
    for ax, f in zip(axes, frequencies, strict=True):
        own = {row.joint: row for row in rows if row.frequency == f}
        for j, (what, colour, hatch) in enumerate(looks):
            heights = [1e3 * getattr(own[name], what) for name in names]
            x = np.arange(len(names)) + 0.27 * (j - 1)
            ax.bar(x, heights, 0.25, color=colour, hatch=hatch, edgecolor="white", label=labels[what])
            for at, height in zip(x.tolist(), heights, strict=True):
                told = number(height, 3 if height >= 10 else 2)
                ax.annotate(told, (at, height), (0, 2), textcoords="offset points", ha="center", fontsize=8)
        ax.set_xticks(np.arange(len(names)), names)
        ax.set_ylabel(f"RMS error (m{pretty(unit('position', kind))})")
        ax.margins(y=0.18)
        ax.annotate(f"{f:g} Hz", (0.01, 0.78), xycoords="axes fraction", fontsize=9)
        low, high = ax.get_ylim()
        ax.set_ylim(low, high * 1.25)  # room for the legend
    axes[0].legend(loc="upper right", ncols=3)
    return figure


@styled
def gains_figure(study: Study) -> Figure:
    """Fig. 9: the adapted parameters vs time by each law, with the paper's final values as horizontal lines."""
    parameters = study.adapting.adaptation.parameters
    count = len(parameters)
    figure, axes = panels(0.5 + 2.6 * count, study.loops[0].name, True, count, sharex=True)
    own = "the true value" if study.paper else "the identified value"
    for k, (ax, name) in enumerate(zip(axes, parameters, strict=True)):
        begun = study.adapting.start.get(name, 1.0)
        for law, run in study.adapted.runs.items():
            if law != "not adapted":
                _line(ax, run, begun * run.theta[0, k], *LAWS[law], law)
        if study.paper and name in TABLE_2_ADAPTED:
            told = f"the paper's {TABLE_2_ADAPTED[name]:g}"
            line = ax.axhline(TABLE_2_ADAPTED[name], color="#666666", linewidth=0.8, label=told)
            ax.legend(handles=[line], loc="center right")
        ax.set_ylabel(f"{symbol(name)}, ratio to\n{own}")
    axes[-1].set_xlabel(axis("time", study.loops[0].kind))
    axes[-1].legend(loc="lower right", ncols=2)
    return figure


@styled
def adaptation_map_figure(study: Study) -> Figure:
    """Final values of the adapted parameters as heat maps with numbers: rate and amplitude, vs frequency."""
    m, kind = study.adaptation_map, study.loops[0].kind
    parameters = study.adapting.adaptation.parameters
    figure = new_figure(0.8 + 2.7 * len(parameters), width=6.6)
    axes = figure.subplots(len(parameters), 2, squeeze=False)
    figure.subplots_adjust(hspace=0.55, wspace=0.35)
    title(axes[0, 0], study.loops[0].name, True)
    amplitude = f"Amplitude ({pretty(unit('position', kind))})"
    columns = ((m.gammas, "Learning rate", m.by_gamma), (m.amplitudes, amplitude, m.by_amplitude))
    for k, name in enumerate(parameters):
        for ax, (rows, label, values) in zip(axes[k], columns, strict=True):
            norm, told = LogNorm(0.25, 4.0, clip=True), f"{symbol(name)}, final ratio"
            ax.imshow(values[k], origin="lower", aspect="auto", cmap="RdBu_r", norm=norm, label=f"_{told}")
            ax.grid(visible=False)
            ax.set_xticks(np.arange(m.frequencies.size), [number(float(x), 2) for x in m.frequencies])
            ax.set_yticks(np.arange(rows.size), [number(float(x), 2) for x in rows])
            for (row, column), value in np.ndenumerate(values[k]):
                _in_cell(ax, column, row, number(float(value), 2), 8.5, on_light=bool(0.4 < value < 2.5))
            ax.set_xlabel("Frequency (Hz)")
            ax.set_ylabel(label)
            _above(ax, told, 3, 9)
    return figure


def _in_cell(ax: Axes, column: int, row: int, text: str, size: float, *, on_light: bool) -> None:
    ax.text(column, row, text, ha="center", va="center", fontsize=size, color=ON_LIGHT if on_light else ON_DARK)


def _above(ax: Axes, text: str, by: int, size: int) -> None:
    """A heading, this many points above the left end of the axes."""
    ax.annotate(text, (0.0, 1.0), (0, by), xycoords="axes fraction", textcoords="offset points", fontsize=size)


@styled
def ablation_figure(study: Study) -> Figure:
    """RMS error over that without compensation, by compensator and share; a panel per encoder (rows) and delay."""
    tried = [x for x in study.ablation if x.compensator != "none"]
    rows = list(dict.fromkeys(x.compensator for x in tried))
    bits_of, delays = (list(dict.fromkeys(k)) for k in ((x.encoder_bits for x in tried), (x.delay for x in tried)))
    shares = list(dict.fromkeys(x.share for x in tried))
    found = {(x.compensator, x.encoder_bits, x.delay, x.share): x for x in study.ablation}
    figure = new_figure(1.0 + 2.15 * len(bits_of), width=7.4)
    axes = figure.subplots(len(bits_of), len(delays), sharex=True, sharey=True, squeeze=False)
    figure.subplots_adjust(left=2.05 / 7.4, hspace=0.22, wspace=0.06, bottom=0.5 / (1.0 + 2.15 * len(bits_of)))
    title(axes[0, 0], study.loops[0].name, True)
    cmap = colormaps["cividis"].with_extremes(bad="#fee838")  # a loop that diverges is as bad as any
    for i, bits in enumerate(bits_of):
        for j, delay in enumerate(delays):
            ax = axes[i, j]
            table = [[found[row, bits, delay, share] for share in shares] for row in rows]
            ratio = np.array([[x.over_none for x in line] for line in table])
            label = f"_ratio to uncompensated, {bits} bits, delay {delay}"
            ax.imshow(ratio, aspect="auto", cmap=cmap, norm=LogNorm(0.03, 3.0, clip=True), label=label)
            ax.grid(visible=False)
            ax.set_xticks(np.arange(len(shares)), [f"{100 * s:g}" for s in shares], fontsize=8.5)
            ax.set_yticks(np.arange(len(rows)), rows, fontsize=8.5)
            for (row, column), value in np.ndenumerate(ratio):
                x = table[row][column]
                mark = f"{100 * value:.0f}{'~' * x.limit_cycle}"
                _in_cell(ax, column, row, "×" if x.diverges else mark, 7, on_light=bool(value > 0.35))
            _above(ax, f"{bits} bits, delay {delay}", 2, 8)
    axes[-1, len(delays) // 2].set_xlabel("Compensated part of the identified friction (%)")
    return figure


@styled
def band_figure(study: Study) -> Figure | None:
    """The tracking error on joints drawn from the covariance, and on the plant; None without a covariance."""
    band, kind = study.band, study.loops[0].kind
    if band is None:
        return None
    figure, (ax,) = panels(3.0, study.loops[0].name, True)
    k = thinned(band.time.size, MOST)
    time, lower, upper, actual = band.time[k], *(1e3 * x[k] for x in (band.lower, band.upper, band.actual))
    ax.fill_between(time, lower, upper, color=_BLUE, alpha=0.3, linewidth=0, label="95 % of the joints")
    of = "true joint" if study.loops[0].simulated else "as identified"
    ax.plot(time, actual, "-", color=_BLACK, linewidth=0.9, label=of)
    ax.set_xlabel(axis("time", kind))
    ax.set_ylabel(f"Position error (m{pretty(unit('position', kind))})")
    ax.legend(loc="best")
    return figure


@styled
def replay_figure(study: Study, at: int) -> Figure:
    """A replay: torque measured, predicted with gains of 1 and adapted, and the gains, vs time."""
    replay, loop = study.replays[at], study.loops[0]
    kind = loop.kind
    figure, (above, below) = panels(5.5, loop.name, loop.simulated, 2, sharex=True)
    k = thinned(replay.time.size, 2 * MOST)
    for values, colour, line, width, label in (
        (replay.measured, _GREY, "-", 2.4, "measured"),
        (replay.fixed, _VERMILION, "--", 1.1, "gains of 1"),
        (replay.adapted, _BLUE, "-", 1.1, "adapted"),
    ):
        above.plot(replay.time[k], values[k], linestyle=line, color=colour, linewidth=width, label=label)
    lines = ("-", "--", ":", "-.", "-", "--")
    for name, share, line in zip(replay.adaptation.parameters, replay.theta, lines, strict=False):
        below.plot(replay.time[k], share[k], linestyle=line, color=_BLACK, linewidth=1.2, label=symbol(name))
    low, high = above.get_ylim()
    above.set_ylim(low, high + 0.25 * (high - low))
    above.set_ylabel(axis("torque", kind, "friction"))
    above.legend(loc="upper right", ncols=3)
    below.set_ylabel("Ratio to identified")
    middle, half = float(np.mean(replay.theta)), max(0.55 * float(np.ptp(replay.theta)), 0.02)
    below.set_ylim(min(float(replay.theta.min()), middle - half), max(float(replay.theta.max()), middle + half))
    below.ticklabel_format(axis="y", useOffset=False)
    below.set_xlabel(axis("time", kind))
    below.legend(loc="best")
    return figure
