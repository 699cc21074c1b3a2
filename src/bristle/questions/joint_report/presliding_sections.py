"""Sections and figures on presliding runs: sigma_0 by both methods, breakaway and hysteresis."""

from collections.abc import Iterator, Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from bristle.arrays import Array
from bristle.data.slow_loading import Loading
from bristle.identification.fits import Presliding, PreslidingFit
from bristle.identification.results import Joint
from bristle.model.functions import loading_displacement_function
from bristle.model.parameters import unit
from bristle.model.vectorize import evaluate
from bristle.page import wording
from bristle.page.page import Drawing
from bristle.page.report import Section, Table
from bristle.page.said import Said
from bristle.page.style import MOST_POINTS, panels, styled, thinned
from bristle.page.wording import METHODS, axis, direction, in_print, measured, number, pretty, span
from bristle.questions.joint_report import tables
from bristle.questions.joint_report.sentences import choice, level, methods, pair

MOST_LOOPS = 3  # closed cycles drawn
_GREY = "#999999"
_CURVES = {"printed": (":", "#D55E00"), "samples": ("--", "#0072B2"), "edges": ("-", "#000000")}  # methods drawn
_ABOVE = 1 + np.geomspace(1e-3, 20.0, 80)  # values of g0 that are tried where none is known, over the largest torque


def presliding(joint: Joint, figures: Mapping[str, Drawing]) -> list[Section]:
    """The sections; empty without presliding runs."""
    slow = joint.presliding
    if slow is None:
        return []
    return [
        _stiffness(joint, slow),
        Section("", figures=tuple(_figures(slow, figures)), form="part"),
        *_breakaway_and_cycles(joint, slow),
        Section("As a whole" if slow.warnings else "", findings=slow.warnings, form="part"),
    ]


def _stiffness(joint: Joint, slow: Presliding) -> Section:
    frame = tables.presliding([joint])
    notes = [
        "± one standard error. Count edge to count edge, σ₀ comes from encoder transitions and is insensitive to where "
        "inside a count the joint rests."
    ]
    if joint.truth:
        notes.append("True: the value that was simulated. Error: (value − true) / true.")
    facts: list[tuple[str, tuple[Said, ...]]] = []
    for fit in slow.fits.values():
        prior, counts = fit.sigma_1, wording.counted(fit.counts, "count edge")
        damping = "none" if prior.value is None else f"{pair(prior)} {pretty(prior.unit)}"
        said = (
            f"{in_print(choice(fit))} {wording.counted(len(fit.loadings), 'loading')} and {counts} crossed.",
            f"g₀ = {pretty(level(fit, joint.kind))}, from {in_print(fit.level_source)}.",
            f"σ₁ of an assumed damping ratio: {damping}.",
        )
        facts.append((direction(fit.direction), (*said, *prior.warnings)))
    return Section(
        "Stiffness", text="" if slow.fits else "No σ₀: see below for what is missing.", facts=tuple(facts),
        table=Table("presliding", "Stiffness by both methods", part=tables.rounded(frame), note=" ".join(notes)),
        form="part",
    )  # fmt: skip  # a list of values


def _figures(slow: Presliding, figures: Mapping[str, Drawing]) -> Iterator[Drawing]:
    found = "; ".join(
        f"{direction(d)}: σ₀ = {measured(fit.sigma_0.value, fit.sigma_0.standard_error)} {pretty(fit.sigma_0.unit)}"
        for d, fit in slow.fits.items()
        if fit.sigma_0.value is not None
    )
    how = (
        "Torque vs displacement of each loading (grey), shifted so that its fitted rest position is at zero; circles: "
        "count edges, evenly thinned where there are many. Lines: T = g₀ (1 − exp(−σ₀ y / g₀)) with the σ₀ of both "
        "methods; they level off at g₀ (where it is a lower bound alone, at the one above it with which σ₀ fits the "
        "edges best), and end with the displacement that was measured."
    )
    yield figures["presliding"]._replace(caption=wording.sentence(found), how=how)
    losses = [x.loss for x in slow.loops]
    if not losses:
        return
    least, most = number(min(losses), 2), number(max(losses), 2)
    lost = f"{least if least == most else f'{least} to {most}'} {wording.WORK} lost in {wording.counted(len(losses), 'closed cycle')}."
    how = (
        "Closed cycles of torque vs displacement, from one peak of the torque to the next of the same sign. The area is the "
        "energy dissipated."
    )
    left_out = len(losses) - MOST_LOOPS
    rest = f" The first {MOST_LOOPS} are drawn; {left_out} more are in the table." if left_out > 0 else ""
    yield figures["hysteresis"]._replace(caption=f"{lost}{rest}", how=how, data="hysteresis")


def _breakaway_and_cycles(joint: Joint, slow: Presliding) -> Iterator[Section]:
    """Each breakaway, and closed cycles, likewise narrow: rows in one column, amplitudes as half of a range."""
    torque, position = (pretty(unit(name, joint.kind)) for name in ("torque", "position"))
    frame = tables.breakaway([joint])
    if not frame.empty:
        medians = []
        for d, e in slow.breakaway.items():
            ends = "" if e.interval is None else f", 95 %: {span(e.interval)}"
            medians.append((direction(d), in_print(f"the median breakaway torque is {pair(e)} {e.unit}{ends}.")))
        yield Section("", facts=tuple(medians), form="part")
        headings = {"breakaway": f"torque ({torque})", "start": "first sample"}
        table = Table("breakaway", "Breakaway", part=frame.rename(columns=headings))
        yield Section("Each breakaway", table=table, form="folded")
    if not slow.loops:
        return
    frame = tables.hysteresis([joint])
    frame["samples"] = [f"{start}\u2013{stop}" for start, stop in zip(frame["start"], frame["stop"], strict=True)]
    columns = {
        "file": "file", "samples": "samples", "counts": "counts", "torque_amplitude": f"± torque ({torque})",
        "displacement_amplitude": f"± displacement ({position})", "loss": f"loss per cycle ({wording.WORK})",
    }  # fmt: skip  # a table of words
    part = frame[[*columns]].rename(columns=columns)
    table = Table("hysteresis", "Cycles", part=part, note="Amplitudes are half of the range.")
    yield Section("Each cycle", table=table, form="folded")


def displacement(T: Array, g0: float, sigma_0: float) -> Array:
    """Displacement of slow loading from rest to torque T (N*m, below g0), rad, shape of T."""
    return evaluate(loading_displacement_function(), T, g0, sigma_0)[0]


def level_drawn(fit: PreslidingFit) -> float:
    """g0 of the curves, N*m; for a lower bound the value with which sigma_0 fits the count edges best."""
    sigma_0 = fit.sigma_0.value
    if np.isfinite(fit.level_standard_error) or not sigma_0 or sigma_0 <= 0:
        return fit.level

    def cost(g0: float) -> float:
        """Squared distance of the edges from the curve, each loading shifted to it."""
        off = [x.edge_displacement - displacement(x.edge_torque, g0, sigma_0) for x in fit.loadings]
        return float(sum(np.sum((y - y.mean()) ** 2) for y in off if y.size))

    most = max((float(x.edge_torque.max(initial=0.0)) for x in fit.loadings), default=0.0)
    tried: list[float] = (max(most, fit.level) * _ABOVE).tolist()
    return min(tried, key=cost)


def rest(loading: Loading, fit: PreslidingFit) -> float:
    """Rest position of the joint by sigma_0, rad from the start of the loading; 0 without a sigma_0.

    Mean over the count edges, or samples without any, of displacement less that of the model, weighted by (1 - T / g0)**2.
    """
    sigma_0, level = fit.sigma_0.value, level_drawn(fit)
    for y, T in ((loading.edge_displacement, loading.edge_torque), (loading.displacement, loading.torque)):
        below = level > T
        if sigma_0 and sigma_0 > 0 and below.any():
            off = y[below] - displacement(T[below], level, sigma_0)
            return float(np.average(off, weights=(1 - T[below] / level) ** 2))
    return 0.0


@styled
def presliding_figure(joint: Joint) -> Figure | None:
    """The loadings of each direction from their rest positions, with count edges and curves; None without a fit."""
    fits = list(joint.presliding.fits.values()) if joint.presliding else []
    if not fits:
        return None
    figure, axes = _panels(joint, len(fits), 1.1 + 2.9 * len(fits), "displacement from rest")
    for ax, fit in zip(axes, fits, strict=True):
        _loadings(ax, fit)
        # y(T) of the methods up to the measured displacement, and the level g0.
        measured = max((float(x.displacement.max(initial=0.0)) - rest(x, fit) for x in fit.loadings), default=0.0)
        level = level_drawn(fit)
        T = level * (1 - np.geomspace(1.0, 1e-3, 200))
        for name, e in methods(fit).items():
            (line, colour), sigma_0 = _CURVES[name], e.value
            if sigma_0 is not None and sigma_0 > 0:
                chosen = "" if e is fit.printed else " (use this)"
                y = displacement(T, level, sigma_0)
                inside = y <= measured
                ax.plot(y[inside], T[inside], line, color=colour, linewidth=1.6, label=f"{METHODS[name]}{chosen}")
        label = "g₀, at least" if np.isinf(fit.level_standard_error) else "g₀"
        ax.axhline(fit.level, color="black", linestyle=(0, (8, 3, 1, 3)), linewidth=0.8, label=label)
        ax.text(0.98, 0.06, direction(fit.direction), transform=ax.transAxes, ha="right")
    # A legend below all panels in two columns, and room on the right for a tick label.
    named = {label: handle for ax in axes for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)}
    width, height = figure.get_size_inches()
    figure.subplots_adjust(right=1 - 0.35 / width, hspace=0.46, bottom=(0.65 + 0.24 * 3) / height)
    figure.legend(named.values(), named.keys(), loc="lower center", ncols=2, frameon=False)
    return figure


def _panels(joint: Joint, count: int, height: float, along: str) -> tuple[Figure, list[Axes]]:
    """A figure of this height, inches, with panels of torque vs displacement."""
    figure, axes = panels(height, joint.name, joint.simulated, count)
    for ax in axes:
        ax.set(xlabel=axis(along, joint.kind), ylabel=axis("torque", joint.kind))
        ax.xaxis.set_major_locator(MaxNLocator(6))
    return figure, axes


def _loadings(ax: Axes, fit: PreslidingFit) -> None:
    """The loadings from their rest positions, with count edges."""
    edges = [np.zeros((2, 0))]
    for k, loading in enumerate(fit.loadings):
        start = rest(loading, fit)
        kept = thinned(loading.torque.size, max(MOST_POINTS // len(fit.loadings), 60))
        label = "_loadings" if k else "loadings"
        ax.plot(loading.displacement[kept] - start, loading.torque[kept], "-", color=_GREY, linewidth=0.7, label=label)
        shown = thinned(loading.edge_torque.size, max(90 // len(fit.loadings), 4))
        edges.append(np.array([loading.edge_displacement[shown] - start, loading.edge_torque[shown]]))
    y, T = np.concatenate(edges, axis=1)
    if y.size:
        ax.plot(y, T, "o", color="#009E73", markerfacecolor="white", markersize=4, label="count edges")


@styled
def hysteresis_figure(joint: Joint) -> Figure | None:
    """Closed cycles of torque vs displacement; None without any."""
    loops = joint.presliding.loops[:MOST_LOOPS] if joint.presliding else ()
    if not loops:
        return None
    figure, axes = _panels(joint, len(loops), 0.9 + 2.5 * len(loops), "displacement")
    for ax, loop in zip(axes, loops, strict=True):
        kept = thinned(loop.position.size)
        ax.plot(
            loop.position[kept] - loop.position.mean(),
            loop.torque[kept],
            "-",
            color=_GREY,
            linewidth=0.9,
            label="_cycle",
        )
        name = f"{wording.shortened(loop.file, 32, end=True)}\nsamples {loop.start}-{loop.stop}"
        ax.text(0.02, 0.96, name, transform=ax.transAxes, va="top", fontsize=9)
    figure.subplots_adjust(hspace=0.46)
    return figure
