"""The report of a sensitivity study."""

from functools import partial

import numpy as np
import pandas as pd

from bristle.model.parameters import effort, in_direction, unit
from bristle.page.page import Drawing
from bristle.page.report import Report, Section, Table
from bristle.page.wording import in_percent, in_print, measured, number, pretty, symbol
from bristle.questions.sensitivity import figures
from bristle.questions.sensitivity.local import CLAIMED, ranked
from bristle.questions.sensitivity.sobol import Global
from bristle.questions.sensitivity.study import Expected, SensitivityStudy, findings, sobol_sentences
from bristle.simulation.fisher import names_of, values_of


def report(study: SensitivityStudy) -> Report:
    """The most important parameters, then each part of the study; the terminal has the shares before other findings."""
    found, map_ = findings(study), study.map
    amplitude, frequency = (x.ravel() for x in np.meshgrid(map_.amplitudes, map_.frequencies, indexing="ij"))
    shares = map_.shares.reshape(-1, len(map_.names))
    by_name = dict(zip(map_.names, shares.T, strict=True))
    over_map = pd.DataFrame({"amplitude": amplitude, "frequency": frequency, **by_name})
    over_map["first"] = [ranked(row, map_.names)[0] for row in shares]
    over_map["claim"] = map_.claim.ravel()
    sections = [
        Section("", findings=found[:1], turn=-2),
        Section("In short", findings=found[1:]),
        _assumed(study),
        *_along_motion(study),
        *_over_map(study),
        Section(
            "What a measurement would tell",
            text="Fisher information F = JᵀJ / noise², with J the exact derivative of the torque with respect to all "
            "parameters; its inverse gives the smallest standard errors that any unbiased fit can have.",
        ),
    ]
    information = pd.concat([e.to_frame(study.kind) for e in study.expected], ignore_index=True)
    sections += [_measurement(study, expected, k, information) for k, expected in enumerate(study.expected, 1)]
    if study.sobol is not None:
        sections += _indices(study, study.sobol)
    if study.formulas is not None:
        frame, title = pd.DataFrame(study.formulas.rows()), "The derivatives as formulas"
        text = Table("formulas", "Derivatives", frame, frame[["what", "with_g"]].rename(columns={"with_g": "formula"}))
        latex = Table("formulas", "Derivatives in LaTeX", frame, frame[["what", "latex"]])
        sections.append(Section(title, findings=study.formulas.sentences(), table=text, lines=()))
        sections.append(Section("As LaTeX", table=latex, form="folded"))
    return Report(
        f"What matters in the friction of {study.name}, and when", tuple(sections),
        about="Sensitivity of LuGre's torque to its parameters.",
        simulated="The joint was not measured but simulated." if study.simulated else "",
        seed=None if study.sobol is None else study.seed, tables={"map": over_map, "information": information},
    )  # fmt: skip  # a list of values


def _assumed(study: SensitivityStudy) -> Section:
    at, rows = study.motion, []
    for name, value in zip(names_of(study.model.p), values_of(study.model.p).tolist(), strict=True):
        lower, upper = in_direction(study.box, *name) or (None, None)
        numbers = {"value": value, "unit": unit(name.name, study.kind), "lower": lower, "upper": upper}
        rows.append({"parameter": str(name), **numbers, "assumed": name in study.model.assumed})
    frame = pd.DataFrame(rows).astype({"lower": object, "upper": object})
    assumed = "\n\nAssumed, or left out:" if study.assumptions else ""
    return Section(
        "Motion, parameters and assumptions",
        text=f"The motion is {at.amplitude:.3g} {pretty(unit('position', study.kind))} · sin(2π · {at.frequency:.3g} Hz · t) "
        f"for {at.duration:.3g} s, sampled every {at.period:.3g} s, starting with an undeflected bristle. All derivatives are "
        "exact for the model (CasADi). Only the parameters come from measurements"
        f"{'' if study.simulated else '; everything else is computed'}.{assumed}",
        findings=study.assumptions,
        table=Table("parameters", f"Parameters of {study.name}", frame, frame.rename(columns={"assumed": "assumed?"})),
        turn=1,
        form="part",
    )


def _along_motion(study: SensitivityStudy) -> list[Section]:
    """Derivatives vs time, and their shares of the torque."""
    local, torque, word = study.local, pretty(unit("torque", study.kind)), effort(study.kind)

    drawn = figures.in_view(study)
    total = np.abs(local.total[drawn])
    sample, which = np.unravel_index(total.argmax(), total.shape)
    most = f"{number(total[sample, which], 2)} {torque} at {number(local.time[drawn][sample], 3)} s"
    time = Drawing(
        partial(figures.time_figure, study), "time", f"derivatives over time of {study.name}",
        f"To first order, doubling {symbol(local.names[which])} changes the {word} most, by up to {most}. "
        f"Velocity, and p · dT/dp in {torque} during the first two periods: the change of torque if the parameter doubled, "
        "to first order. Solid: total, including the bristle's response. Dashed: at fixed z, as in the paper's adaptation "
        "law. Where only one line is visible they coincide; a dashed line more than four times as large leaves its panel."
        f"{' A star marks a parameter that is assumed.' if study.model.assumed else ''}",
    )  # fmt: skip  # a list of values

    frame = study.to_frame()
    directions = "Where each direction has its own parameters, a parameter changes by the same percentage in both."
    table = Table(
        "shares", f"Shares of the RMS {word}", frame,
        frame.rename(columns={"partial": "at fixed z", "settled": "total, last period"}),
        "The whole motion includes the bristle's first deflection; the last period does not."
        f"{f' {directions}' if word == 'torque' else ''}",
    )  # fmt: skip  # a list of values
    lines = (
        f"{study.name}{' (SIMULATED data)' if study.simulated else ''}: RMS of p dT/dp relative to the RMS of T, by parameter",
        f"  {'':<8} {'total':>9} {'fixed z':>9} {'last period':>12}",
        *(f"  {x.parameter:<8} {x.total:>9.2g} {x.partial:>9.2g} {x.settled:>12.2g}" for x in frame.itertuples()),
    )
    return [
        Section("Along the motion", figure=time),
        Section("Shares of the torque", table=table, lines=lines, turn=-1, form="part"),
    ]


def _over_map(study: SensitivityStudy) -> list[Section]:
    """The parameter with the largest share at each amplitude and frequency, and all shares."""
    claim, shares = study.map.claim, study.map.shares
    first = Drawing(
        partial(figures.first_figure, study), "first", f"first parameter vs amplitude and frequency of {study.name}",
        f"{' and '.join(map(symbol, sorted(CLAIMED)))} have the two largest shares in {in_percent(float(claim.mean()))} of the "
        f"map, {claim.sum()} of {claim.size} motions. The parameter with the largest total share in steady periodic motion, "
        "and its share. Inside the black line α₀ and α₂ rank first and second, as the paper claims. Star: the motion above.",
    )  # fmt: skip  # a list of values
    low, high = (end(shares, axis=(0, 1)) for end in (np.min, np.max))
    k = int((high - low).argmax())
    least = f"less than {in_percent(figures.LEAST)}" if low[k] < figures.LEAST else in_percent(low[k])
    each = Drawing(
        partial(figures.map_figure, study), "map", f"shares vs amplitude and frequency of {study.name}",
        f"The share of {symbol(study.map.names[k])} varies most over the map, from {least} to {in_percent(high[k])}. Total "
        "share of each parameter on one logarithmic scale; shares below 0.001 are drawn as 0.001.",
    )  # fmt: skip  # a list of values
    return [Section("Amplitude and frequency", figure=first), Section("Each share", figure=each, form="part")]


def _measurement(study: SensitivityStudy, expected: Expected, k: int, information: pd.DataFrame) -> Section:
    """Standard errors and correlations that one measurement would give."""
    info = expected.information
    seen = np.isfinite(info.standard_errors)
    between = np.abs(np.triu(np.where(np.outer(seen, seen), info.correlation, 0.0), 1))
    i, j = np.unravel_index(between.argmax(), between.shape)
    strongest = f"{symbol(info.names[i])} and {symbol(info.names[j])}, {figures.correlated(info.correlation[i, j])}"
    found = f"The strongest correlation is that of {strongest}" if between.any() else "No two parameters are correlated"
    unseen = f"; {np.count_nonzero(~seen)} of {seen.size} parameters cannot be estimated (×)" * (not seen.all())
    columns = {
        "standard_error": "expected standard error", "percent": "of the value (%)", "own_standard_error": "standard error of the joint's fit",
        "seen": "identifiable?",
    }  # fmt: skip  # a table of words
    part = expected.to_frame(study.kind).drop(columns="measurement").rename(columns=columns)
    return Section(
        f"From {expected.what}", text=" ".join(map(in_print, expected.noise)), findings=info.unseen,
        figure=Drawing(
            partial(figures.correlation_figure, study, expected),
            f"correlation-{k}",
            f"correlation of estimates from {expected.what}",
            f"{found}{unseen}. Correlation of the estimates from {expected.what}; ×: not identifiable.",
        ),
        table=Table("information", f"Standard errors expected from {expected.what}", information, part),
        lines=(), form="part",  # the findings of the study tell it
    )  # fmt: skip  # a list of values


def _indices(study: SensitivityStudy, sobol: Global) -> list[Section]:
    indices = [(effect, x) for x in sobol.outputs for effect in x.effects]
    effect, output = max(indices, key=lambda x: x[0].total, default=(None, None))
    caption = "No output can be analysed"
    if effect is not None and output is not None:
        index = measured(effect.total, effect.total_half)
        caption = f"{symbol(effect.parameter)} has the largest total index, {index} for the {output.called(study.kind)}"
    figure = Drawing(
        partial(figures.sobol_figure, sobol, study.kind, name=study.name, simulated=study.simulated),
        "sobol",
        f"Sobol indices of {study.name}",
        f"{caption}. First-order and total Sobol indices with 95 % confidence intervals.",
    )
    said, table = sobol_sentences(sobol, study.kind), Table("sobol", "Sobol indices", sobol.to_frame(study.kind))
    return [Section("Sobol indices over the intervals", findings=said, figure=figure, table=table)]
