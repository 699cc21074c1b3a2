"""What the pages show of moving runs: both fits side by side, hold-out runs, and what counts added."""

from collections.abc import Mapping

import pandas as pd

from bristle.identification.fits import TrackingFit
from bristle.identification.known_joint import moving_fits
from bristle.identification.results import Joint
from bristle.model.parameters import unit
from bristle.page.page import Drawing
from bristle.page.report import Section, Table
from bristle.page.said import Said
from bristle.page.wording import FITS, MISSING, counted, in_print, number, pretty, sentence, span, symbol
from bristle.questions.joint_report import tables
from bristle.questions.joint_report.dynamic_figures import MOST, window
from bristle.questions.joint_report.sentences import biased, pair, reached


def course(joint: Joint, figures: Mapping[str, Drawing]) -> Drawing | None:
    """The run over time, where its reversals are strongest; None where nothing was fitted."""
    fit = joint.moving
    if fit is None or not fit.time.size:
        return None
    part, count = window(fit), len(fit.starts_of_runs)
    start, end = (number(float(fit.time[k]), 3) for k in (part.start, part.stop - 1))
    stretch = 1 + sum(part.start >= begin for begin in fit.starts_of_runs[1:])
    where = f"segment {stretch} of {count}" if count > 1 else "the run"
    caption = (
        f"{_left(joint, fit)} Measured {fit.quantity} (wide grey line) and predicted by the {_name(joint)} (thin "
        f"line), from {start} to {end} s of {where}, where the reversals are strongest. Below: measured minus "
        "predicted."
    )
    return figures["tracking"]._replace(caption=caption)


def _name(joint: Joint) -> str:
    """Of the fit to use."""
    return FITS["tracking" if joint.joint_fit is None else "joint"]


def _left(joint: Joint, fit: TrackingFit) -> str:
    """What the fit leaves."""
    rms = f"{number(fit.rms, 2)} {pretty(unit(fit.quantity, joint.kind))}"
    return sentence(f"the model leaves {rms} RMS, {number(fit.relative_error, 2)} % of the {fit.quantity}")


def moving(joint: Joint, figures: Mapping[str, Drawing]) -> list[Section]:
    """All of it; empty without moving runs."""
    if joint.tracking is None:
        return []
    fits, torque = moving_fits(joint), joint.tracking.quantity == "torque"
    how = "the measured velocity drives the model, and its torque is compared with the measured one."
    if not torque:
        how = (
            "the motor is simulated, and its position is compared with the measured one, in windows with separate "
            "initial values; no velocity is needed."
        )
    priors = " The joint fit adds the estimates of the other stages, with their uncertainty."
    shared = "± one standard error; parameters shared by both directions have no sign."
    rows = []  # of each fit the value with its standard error, and the interval
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
    held = tables.tracking_hold_out([joint])
    if len(held):
        relative = "Relative error: 100 · ‖measured − predicted‖ / ‖measured‖ on runs that were not fitted"
        windows = "; position relative to the mean of its window, of which only the initial values were fitted"
        table = Table("tracking_hold_out", "Held-out runs", part=held, note=f"{relative}{'' if torque else windows}.")
        sections.append(Section("", table=table, form="part"))
    last = joint.joint_fit or joint.tracking
    if last.time.size:
        terms = ", inertia and other regressors included" if last.quantity == "torque" else ""
        thinned = f" Evenly thinned to {MOST} points." if last.time.size > MOST else ""
        caption = (
            f"{_left(joint, last)} Measured {last.quantity} (circles) and what the {_name(joint)} predicts (dots) vs "
            f"velocity{terms}. Below: measured minus predicted.{thinned}"
        )
        load = (
            "Measured friction along the motion vs the load that it rises with, in three bands of speed (the slowest "
            "quarter left out), each with the model's line in steady sliding at its median speed."
        )
        drawn = figures["tracking-velocity"]._replace(caption=caption), figures["tracking-load"]._replace(caption=load)
        sections.append(Section("", figures=drawn, form="part"))
    return sections


def _said(joint: Joint, fit: TrackingFit) -> tuple[Said, ...]:
    """One fit in words."""
    rms = f"{number(fit.rms, 3)} {pretty(unit(fit.quantity, joint.kind))}"
    windows = f", simulated in {fit.windows} windows" if fit.windows else ""
    said: list[Said] = [
        f"{in_print(fit.outcome)} Relative error {number(fit.relative_error, 3)} %, rms residual {rms}, {fit.n} "
        f"samples, {counted(len(fit.starts_of_runs), 'segment')}{windows}. {reached(fit)}",
        f"Condition number of the scaled Jacobian: {number(fit.condition, 2)}.",
    ]
    added = [f"{symbol(name)} {pretty(text)}" for name, text in biased(fit).items()]
    if added:
        said.append(f"Bias by encoder counts, subtracted: {'; '.join(added)}.")
    elif fit.count_bias:
        said.append("Encoder counts bias every parameter by less than a tenth of a standard error.")
    if fit.crosscheck:
        said += ["Cross-check:", in_print(fit.crosscheck.verdict)]
    return tuple(said)
