"""Sections and figures on moving runs: both fits, hold-out runs, bias by encoder counts."""

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from bristle.identification.fits import TrackingFit
from bristle.identification.known_joint import moving_fits
from bristle.identification.load_levels import friction_rise
from bristle.identification.results import Joint
from bristle.model.functions import steady_torque_function
from bristle.model.parameters import of_load, unit
from bristle.model.vectorize import evaluate
from bristle.page.page import Drawing
from bristle.page.report import Section, Table
from bristle.page.said import Said
from bristle.page.style import panels, styled, thinned
from bristle.page.wording import FITS, MISSING, axis, counted, in_print, number, pretty, sentence, span, symbol
from bristle.questions.joint_report import static_sections
from bristle.questions.joint_report.sentences import biased, pair, reached

SPAN = 3.0  # longest piece of a run drawn over time, s
MOST = 400  # points of each kind drawn
_BANDS, _MARKERS, _LINES = ("#0072B2", "#D55E00", "#000000"), ("o", "s", "^"), ("-", "--", ":")
_LOADS = {"link_load": "gravity and link", "motor_load": "motor", "gear_load": "gear"}  # torques of each load
_GREY, _BLUE, _VERMILION = "#999999", "#0072B2", "#D55E00"


def course(joint: Joint, figures: Mapping[str, Drawing]) -> Drawing | None:
    """The run vs time about its hardest reversal; None without a fit."""
    fit = joint.moving
    if fit is None or not fit.time.size:
        return None
    part, count = window(fit), len(fit.starts_of_runs)
    start, end = (number(float(fit.time[k]), 3) for k in (part.start, part.stop - 1))
    stretch = 1 + sum(part.start >= begin for begin in fit.starts_of_runs[1:])
    where = f"segment {stretch} of {count}" if count > 1 else "the run"
    caption = (
        f"{_left(joint, fit)} Measured torque (wide grey line) and predicted by the {_name(joint)} (thin "
        f"line), from {start} to {end} s of {where}, about the hardest reversal. Below: measured minus predicted."
    )
    return figures["tracking"]._replace(caption=caption)


def _name(joint: Joint) -> str:
    return FITS["tracking" if joint.joint_fit is None else "joint"]


def _left(joint: Joint, fit: TrackingFit) -> str:
    """The error of the fit in a sentence."""
    rms = f"{number(fit.rms, 2)} {pretty(unit('torque', joint.kind))}"
    return sentence(f"the model leaves {rms} RMS, {number(fit.relative_error, 2)} % of the torque")


def moving(joint: Joint, figures: Mapping[str, Drawing]) -> list[Section]:
    """The sections; empty without moving runs."""
    if joint.tracking is None:
        return []
    fits = moving_fits(joint)
    how = "the measured velocity drives the model, and its torque is compared with the measured one."
    priors = " The joint fit adds the estimates of the other stages, with their uncertainty."
    shared = "± one standard error; parameters shared by both directions have no sign."
    rows = []
    for name in dict.fromkeys(name for fit in fits.values() for name in fit.parameters):
        estimates = [fit.parameters.get(name) for fit in fits.values()]
        row = {"parameter": str(name), "unit": next(e.unit for e in estimates if e is not None)}
        for kind, e in zip(fits, estimates, strict=True):
            row[FITS[kind]] = MISSING if e is None else pair(e)
            row[f"{FITS[kind]}, 95 %"] = MISSING if e is None else span(e.interval)
        rows.append(row)
    sections = [
        Section(
            "All parameters at once",
            text=f"From runs that move and reverse: {how}{priors if joint.joint_fit is not None else ''}",
            facts=tuple((FITS[kind].capitalize(), _said(joint, fit)) for kind, fit in fits.items()),
            table=Table("tracking", "Parameters from the moving runs", part=pd.DataFrame(rows), note=shared),
            form="part",
        )
    ]
    sections += static_sections.hold_out(joint, fits)
    last = joint.joint_fit or joint.tracking
    if last.time.size:
        thinned = f" Evenly thinned to {MOST} points." if last.time.size > MOST else ""
        caption = (
            f"{_left(joint, last)} Measured torque (circles) and what the {_name(joint)} predicts (dots) vs "
            f"velocity, inertia and other regressors included. Below: measured minus predicted.{thinned}"
        )
        load = (
            "Measured friction along the motion vs the load that it rises with, in three bands of speed (the slowest "
            "quarter left out), each with the model's line in steady sliding at its median speed."
        )
        drawn = figures["tracking-velocity"]._replace(caption=caption), figures["tracking-load"]._replace(caption=load)
        sections.append(Section("", figures=drawn, form="part"))
    return sections


def _said(joint: Joint, fit: TrackingFit) -> tuple[Said, ...]:
    rms = f"{number(fit.rms, 3)} {pretty(unit('torque', joint.kind))}"
    said: list[Said] = [
        f"{in_print(fit.outcome)} Relative error {number(fit.relative_error, 3)} %, rms residual {rms}, {fit.n} "
        f"samples, {counted(len(fit.starts_of_runs), 'segment')}. {reached(fit)}",
        f"Condition number of the scaled Jacobian: {number(fit.condition, 2)}.",
    ]
    added = [f"{symbol(name)} {pretty(text)}" for name, text in biased(fit).items()]
    if added:
        said.append(f"Bias by encoder counts, subtracted: {'; '.join(added)}.")
    elif fit.count_bias:
        said.append("Encoder counts bias every parameter by less than a tenth of a standard error.")
    return tuple(said)


def window(fit: TrackingFit) -> slice:
    """The piece of one stretch, at most SPAN long, about the reversal with the largest |dv/dt|; without any, its beginning."""
    t, v = fit.time, fit.velocity
    ends = (*fit.starts_of_runs[1:], t.size)
    stretch = np.repeat(np.arange(len(ends)), np.diff((0, *ends)))
    turns = np.flatnonzero((np.signbit(v[1:]) != np.signbit(v[:-1])) & (np.diff(stretch) == 0))
    k = turns[np.argmax(np.abs(np.diff(v)[turns] / np.diff(t)[turns]))] if turns.size else 0
    own = np.flatnonzero(stretch == stretch[k])
    begin = np.clip(t[k] - SPAN / 2, t[own[0]], max(t[own[0]], t[own[-1]] - SPAN)) if turns.size else t[own[0]]
    start, stop = np.searchsorted(t[own], begin), np.searchsorted(t[own], begin + SPAN, side="right")
    return slice(int(own[0] + start), int(own[0] + stop))


@styled
def course_figure(joint: Joint) -> Figure | None:
    """Measured and predicted torque (or position) vs time about the hardest reversal; None without a fit."""
    fit = joint.moving
    if fit is None or not fit.time.size:
        return None
    own = window(fit)
    measured, predicted = {"linestyle": "-", "linewidth": 3.5}, {"linestyle": "-", "linewidth": 1.2}
    looks = measured, predicted, {"linestyle": "-", "linewidth": 0.9}
    return _compared(joint, fit, "time", own.start + thinned(own.stop - own.start, MOST), looks)


@styled
def velocity_figure(joint: Joint) -> Figure | None:
    """Measured and predicted torque (or position) of moving runs vs velocity, and residuals; None without a fit."""
    fit = joint.moving
    if fit is None or not fit.time.size:
        return None
    dot = {"marker": ".", "linestyle": ""}
    measured = {"marker": "o", "linestyle": "", "markerfacecolor": "none", "markersize": 5}
    looks = measured, {**dot, "markersize": 3.5}, {**dot, "markersize": 3}
    return _compared(joint, fit, "velocity", thinned(fit.time.size, MOST), looks)


def _compared(joint: Joint, fit: TrackingFit, over: str, k: Any, looks: tuple[dict[str, Any], ...]) -> Figure:
    """Measured and predicted values of the equations k above, residuals below; `looks`: of the three."""
    figure, (above, below) = panels(5.2, joint.name, joint.simulated, 2, sharex=True, height_ratios=(5, 4))
    below.axhline(0.0, color="#666666", linewidth=0.8, label="_zero")
    x, torque, residual = getattr(fit, over)[k], fit.measured[k], fit.residuals[k]
    above.plot(x, torque, color=_GREY, label="measured", **looks[0])
    above.plot(x, torque - residual, color=_BLUE, label="predicted", **looks[1])
    below.plot(x, residual, color=_VERMILION, label="_residual", **looks[2])
    above.set_ylabel(axis("torque", joint.kind))
    below.set_ylabel(axis("torque", joint.kind, "residual"))
    below.set_xlabel(axis(over, joint.kind))
    low, high = above.get_ylim()
    above.set_ylim(low, high + 0.2 * (high - low))  # room for the legend
    above.legend(loc="upper right", ncols=2)
    figure.subplots_adjust(hspace=0.14, left=1.1 / figure.get_size_inches()[0])  # residuals have long numbers
    return figure


@styled
def load_figure(joint: Joint) -> Figure | None:
    """Friction vs load in three bands of speed, each with the model's line; None without a load."""
    fit = joint.moving
    if fit is None or not fit.load.size:
        return None
    figure, (ax,) = panels(3.6, joint.name, joint.simulated)
    # The model in steady sliding, of the positive or the only direction, and its rise with load.
    p = next((p for d in ("both", "+", "-") if (p := fit.values(d)) is not None), None)
    rise = {name.name: x for name, x in fit.known.items() if of_load(name.name)}
    # Three bands of speed with equal numbers of the faster three quarters of the equations.
    ends: list[float] = np.quantile(np.abs(fit.velocity), [0.25, 0.5, 0.75, 1.0]).tolist()
    for (low, high), colour, marker, line in zip(pairwise(ends), _BANDS, _MARKERS, _LINES, strict=True):
        inside = (np.abs(fit.velocity) >= low) & (np.abs(fit.velocity) <= high)
        k = np.flatnonzero(inside)[thinned(int(inside.sum()), MOST // 2)]
        along = np.sign(fit.velocity[k])
        told = f"{low:.2g} to {high:.2g} {pretty(unit('velocity', joint.kind))}"
        style: dict[str, Any] = {"markerfacecolor": "none", "markersize": 3.5, "alpha": 0.6}
        ax.plot(fit.load[k], fit.friction[k] * along, marker, color=colour, label=told, **style)
        speed, reach = np.median(np.abs(fit.velocity[inside])), np.linspace(0, float(fit.load.max()), 30)
        own = 0.0 if p is None else float(evaluate(steady_torque_function(p.law), np.array([speed]), *p.stribeck)[0][0])
        ax.plot(reach, own + friction_rise(rise, reach), line, color=colour, linewidth=1.6, label="_model")
    ax.set_xlabel(axis("torque", joint.kind, _LOADS[next(n for n in _LOADS if n in {x.name for x in fit.parameters})]))
    ax.set_ylabel(axis("torque", joint.kind, "friction"))
    ax.legend(loc="upper left", fontsize="small")
    return figure
