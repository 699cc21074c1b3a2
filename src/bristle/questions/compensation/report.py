"""The report of a compensation study."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from bristle.estimation import levels
from bristle.findings import CAUTION, NOTE, Finding
from bristle.page.page import Drawing, begun
from bristle.page.report import Report, Section, Table
from bristle.page.wording import in_print, number, symbol
from bristle.questions.compensation import experiments, figures
from bristle.questions.compensation.study import Study, adverse, outcomes_of, thousandths
from bristle.simulation.drawn_joints import SEED
from bristle.workers import Share

_MOST_REPLAYS = 6  # replays drawn; the table has all
_Draw = Callable[[Study], Figure | None]
_Show = Callable[..., Section]  # `show` of `sections`


def report(study: Study) -> Report:
    """The whole study; the terminal has each error, each final adapted parameter and each replay's verdict."""
    names = [loop.name for loop in study.loops]
    return Report(
        f"Friction compensation of {names[0] if len(names) == 1 else f'{len(names)} joints'}",
        sections(study), about="LuGre feed-forward and its adaptation.",
        simulated="The joint was not measured but simulated." if study.loops[0].simulated else "",
        seed=SEED, tables=study.tables(),
    )  # fmt: skip  # a list of values


def sections(study: Study, share: Share | None = None) -> tuple[Section, ...]:
    """The sections of its page; with `share` the figures begin to be drawn at once."""

    def show(title: str, draw: _Draw, kind: str, caption: str, table: Table | None = None, **more: Any) -> Section:
        """A section with a figure, SIMULATED unless said otherwise."""
        label, more = f"{kind} of {study.loops[0].name}, compensated", {"simulated": True, **more}
        made = Drawing(partial(draw, study), f"compensation-{kind}", label, caption, **more)
        return Section(title, figure=begun(made, share) if share else made, table=table)

    # The comparison of compensators comes first, because its figure takes longest.
    rows = study.ablation
    cycling, diverging = (sum(getattr(x, failure) for x in rows) for failure in ("limit_cycle", "diverges"))
    caption = (
        f"{cycling} of {len(rows)} cases end in a limit cycle, {diverging} diverge. RMS error in percent of that without compensation, moving back "
        "and forth by the amplitude; encoders with 2^bits counts in 2π amplitudes, delays in control periods. ~: a limit cycle when held at rest; "
        "×: the loop diverges. Measured velocity is differentiated from the counts."
    )
    title = "Compensators with different encoders and delays"
    ablation = show(title, figures.ablation_figure, "ablation", caption, data="ablation")
    frames = study.tables()
    heading, *parts = *_opening(study), *_replays(study, frames, show), *_errors(study, show)
    parts += [*_adaptation(study, frames, show), ablation]
    if (band := study.band) is not None:
        q, simulated, span = thousandths(study), study.loops[0].simulated, band.rms_systematic
        (low, middle, high), actual = (f"{1e3 * x:.3g}" for x in band.rms), f"{1e3 * band.rms_actual:.3g}"
        ends = " to ".join(f"{1e3 * x:.3g}" for x in span or ())
        alone = f", of which the errors of constants alone make {ends} {q}" if span else ""
        caption = (
            f"RMS position error {middle} {q} with the identified model, in 95 % of cases from {low} to {high} {q}, on {band.joints} joints "
            f"drawn from the identified covariance of friction and inertia{' and the errors of constants' * bool(span)} (seed {SEED}){alone}; "
            f"on {'the true joint' if simulated else 'the joint as identified'} {actual} {q}."
        )
        title = "Effect of the parameters' uncertainty on the tracking error"
        parts.append(show(title, figures.band_figure, "band", caption))
    return (heading, *(replace(x, form="part") for x in parts))


def _opening(study: Study) -> Iterator[Section]:
    """The worth of compensation, the cases against it, and the assumptions."""
    first = study.loops[0]
    yield Section(
        f"Compensation of {first.name}",
        about=f"all SIMULATED{', the joint as well' if first.simulated else ', except the replays' * bool(study.replays)}",
        text="The friction that the identified model predicts for the reference motion is added to the PID's output (section 4), and its "
        "parameters are adapted on line (3.3).",
        lines=tuple(map(str, outcomes_of(study))),
        id="compensation",
    )
    yield Section("", findings=(_worth(study),), lines=())
    # The steady curve compensates as well as LuGre where the motion shows little of the bristle.
    best, against = (max(row.encoder_bits for row in study.ablation), 0, 1.0), [*adverse(study)]
    tried = [x for x in study.ablation if (x.encoder_bits, x.delay, x.share) == best and not x.diverges]
    rms = {row.compensator: row.rms_error for row in tried}
    stribeck, lugre = (rms.get(f"{name}, reference velocity") for name in ("Stribeck", "LuGre"))
    if stribeck and lugre and stribeck <= levels.WORSE_LOOP * lugre:
        message = (
            f"The Stribeck curve compensates {first.name} as well as LuGre does on this motion: RMS error {1e3 * stribeck:.3g} and "
            f"{1e3 * lugre:.3g} {thousandths(study)}, both driven by the reference velocity, with the finest encoder and no delay."
        )
        numbers = {"joint": first.name, "stribeck": 1e3 * stribeck, "lugre": 1e3 * lugre}
        against.append(Finding("stribeck-as-good", NOTE, message, numbers))
    if against:
        yield Section("Where less does as well", findings=tuple(against), coded=True, lines=())
    assumed = f"Assumed, not measured{', and not in the paper' * study.paper}"
    yield Section(assumed, findings=tuple(first.assumptions), lines=())


def _worth(study: Study) -> Finding:
    """The effect of LuGre feed-forward on the RMS error at the slow reference, without inertia feed-forward."""
    row, q = study.errors[0], thousandths(study)
    without, identified, percent = 1e3 * row.without, 1e3 * row.identified, 100 * row.identified / row.without
    numbers = {"joint": row.joint, "frequency": row.frequency, "without": without, "identified": identified}
    change = f"the RMS error of {row.joint} at {row.frequency:g} Hz from {without:.3g} {q} to {identified:.3g} {q} ({percent:.2g} %)."
    if row.identified < row.without:
        return Finding("error-reduced", NOTE, f"LuGre feed-forward reduces {change}", numbers)
    return Finding("error-increased", CAUTION, f"LuGre feed-forward increases {change}", numbers)


def _replays(study: Study, frames: Mapping[str, pd.DataFrame], show: _Show) -> Iterator[Section]:
    """The final gains on each measured run, and whether to switch the adaptation on."""
    if not study.replays:
        return
    frame = frames["replay"]  # with parameters as symbols; names of files stay as they are
    table = Table(
        "replay",
        "Replays of measured runs",
        part=frame.assign(**{name: frame[name].map(in_print) for name in ("shares", "verdict")}),
        note="Friction torque (measured, without inertia, gravity and offset) left unexplained in the second half of the run, at every "
        "sample, percent. It is not the relative error of bristle identify, which is smaller: that is of the whole torque, after decimation, "
        "or of the position where that is predicted. Here with gains of 1 and adapted; final ratios to the identified values.",
    )
    yield Section(
        "Would adaptation help? Replays of the measured runs",
        text="The measured velocity drives the model; the gains adapt to the error of its torque divided by K_p, as in the loop. The table "
        f"shows where they end, and how much of the friction torque is then unexplained.\n\nThe row of the {study.adapting.adaptation.law} law "
        "answers whether to switch it on. To see which parameter changed, read the row of the total law: the gradients of α₀ and α₂ by the "
        "partial law are nearly proportional, so it corrects the torque but divides a change between the two.",
        table=table,
        lines=tuple(f"{x.file}, {x.adaptation.law} law: {x.verdict}" for x in study.replays),
        id="replays",
    )
    for k, x in enumerate(study.replays[:_MOST_REPLAYS], 1):
        caption = (
            f"{x.file}, by the {x.adaptation.law} law. {in_print(x.verdict)} Above: measured friction torque "
            "(wide grey line), predicted with gains of 1 (dashed) and adapted (solid); below: ratios to the identified values."
        )
        replayed, simulated = partial(figures.replay_figure, at=k - 1), study.loops[0].simulated
        yield show("", replayed, f"replay-{k}", caption, simulated=simulated)


def _errors(study: Study, show: _Show) -> Iterator[Section]:
    """Figs 5 to 8: a sinusoidal reference vs time, and the RMS errors."""
    worth, q, paper = in_print(_worth(study)), thousandths(study), "Figs 5 to 7" * study.paper
    followed = (
        f"{worth} Reference and position, position error, and control, without friction compensation (dashed) and with LuGre feed-forward of "
        "the identified model (solid)."
    )
    title = f"{paper or 'With and without'}: a sinusoidal reference"
    runs = {"without": study.followed["without"], "with compensation": study.followed["with"]}
    yield show(title, partial(figures.courses_figure, runs=runs), "followed", followed, paper=paper)
    errors = (
        f"{worth} RMS position error from 10 s to 30 s, no inertia feed-forward. A large error left at a fast reference comes from the "
        "inertia, not from friction: the table has both."
    )
    paper, file = "Fig. 8" * study.paper, "compensation_errors"
    shown = study.to_frame().drop(columns="true_share")
    note = (
        f"RMS errors in {q}. True: LuGre feed-forward with the plant's own parameters; identified: with the identified ones; adaptive: "
        "initialised at the identified ones."
    )
    table = Table(file, "RMS errors", part=_part(study, shown.rename(columns={"frequency": "f (Hz)"})), note=note)
    title = f"{paper or 'Errors'}: RMS error without, with, and with adaptive compensation"
    yield show(title, figures.errors_figure, "errors", errors, table, data=file, paper=paper)


def _adaptation(study: Study, frames: Mapping[str, pd.DataFrame], show: _Show) -> Iterator[Section]:
    """Table 2 and Figs 9 to 12: adaptation from wrong parameters; then maps and drift."""
    loop, settled = study.adapting, experiments.SETTLE
    a, q = loop.adaptation, thousandths(study)
    initial = " and ".join(f"{share} {symbol(name)}" for name, share in loop.start.items())
    laws = (
        "four laws with dθ/dt = −γ G e" if a.step == "gradient" else f"the laws, their gradient G e by {a.step} steps"
    )
    own = "Ratios to the identified values. A gain that does not end at 1 compensates for what the model lacks, such as inertia."
    paper = "Ratios to the true values. The paper reports 0.84 and 1.05: the law with the right derivative converges to both, the printed one cannot."
    yield Section(
        f"{'Table 2 and Figs 9 to 12' if study.paper else 'Adaptation'}: from wrong parameters",
        text=f"Initialised at {initial}, adapted by {laws}, e = y − y_ref, γ = {', '.join(number(g, 3) for g in a.gamma)}.",
        facts=(
            ("printed", "(19)–(20) as typeset: its first line is ∂T/∂α₁, not the ∂T/∂α₀ that it is said to be, and hardly moves α₀."),
            ("partial", "the derivative that (19) names, at fixed z"),
            ("partial-theta", "the same by θ, its rates divided by the parameters so that it moves equally"),
            ("total", "lets z depend on the parameter as well"),
        ),
        table=Table("table_2", "Table 2: adapted factors", part=frames["table_2"], note=paper if study.paper else own),
    )  # fmt: skip  # a table
    ends = " and ".join(f"{x.final:.3f}" for x in study.adapted.factors if x.law == a.law)
    gains = (
        f"Adapted factors {'converge to' if study.paper else 'end at'} {ends}{', the paper’s 0.84 and 1.05' * study.paper}, by the {a.law} "
        "law. Adapted factors vs time, by each law."
    )
    yield show("", figures.gains_figure, "gains", gains, data="table_2", paper="Fig. 9" * study.paper)
    runs = {"wrong model": study.adapted.runs["not adapted"], f"adapted ({a.law})": study.adapted.runs[a.law]}
    before, after = (1e3 * float(run.rms_error(settled)[0]) for run in runs.values())
    adapted = (
        f"RMS position error after {settled:g} s: {number(before, 3)} {q} not adapted, {number(after, 3)} {q} adapted by the {a.law} law. "
        f"Position, position error and control with the wrong model, not adapted (dashed) and adapted by the {a.law} law (solid)."
    )
    figure = partial(figures.courses_figure, runs=runs)
    yield show("", figure, "adapted", adapted, paper="Figs 10 to 12" * study.paper)

    m, spans = study.adaptation_map, []
    for k, name in enumerate(a.parameters):  # over the loops that do not diverge
        finite = [x for x in (*m.by_gamma[k].flat, *m.by_amplitude[k].flat) if np.isfinite(x)]
        ends = f"from {number(min(finite), 2)} to {number(max(finite), 2)}" if finite else "not finite"
        spans.append(f"{symbol(name)} {ends}")
    landings = (
        f"Final ratios to the identified values: {', '.join(spans)}. By the {a.law} law, vs learning rate"
        f"{' (that of the first parameter)' * (len(a.gamma) > 1)} and frequency, and vs amplitude and frequency. White is 1. At fast references "
        "the gains absorb the error caused by inertia."
    )
    title = "Adapted values vs rate, amplitude and frequency"
    yield show(title, figures.adaptation_map_figure, "landings", landings, data="adaptation_map")
    yield Section(
        "Friction that drifts",
        text="α₀ and α₂ of the plant rise by half over 30 s. Known: the model drifts with the plant, the best that adaptation can reach. "
        "Without limits the gains run away where inertia dominates the error; limits bound them, and a normalised gradient slows them. "
        "Largest gain: the largest factor from 1.",
        table=Table("drift", "Friction that drifts", part=_part(study, frames["drift"])),
    )


def _part(study: Study, frame: pd.DataFrame) -> pd.DataFrame:
    """A table of the page, with its headings; errors in thousandths."""
    q = thousandths(study)
    small = {
        "without": f"without ({q})", "true_model": f"true ({q})", "identified_model": f"identified ({q})", "adaptive": f"adaptive ({q})",
        "rms_error": f"RMS error ({q})",
    }  # fmt: skip  # a table of words
    others = {
        "joint": "of", "frequency": "frequency (Hz)", "identified_share": "identified / without", "adaptive_share": "adaptive / without",
        "over_known": "ratio to the known model", "largest_gain": "largest gain", "way": "scheme",
    }  # fmt: skip  # a table of words
    found = [column for column in small if column in frame]
    frame = frame.astype(dict.fromkeys(found, float))
    frame[found] *= 1e3
    return frame.rename(columns=small | others)
