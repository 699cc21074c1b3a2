"""What was found of a joint's sensitivity, in sentences and as the text that the command line prints."""

import re

import numpy as np

from bristle.arrays import Array
from bristle.diagnostics import Diagnostic
from bristle.model.parameters import Kind, Lugre, unit
from bristle.page.wording import number, pretty, span, symbol
from bristle.questions.sensitivity.local import claimed, ranked
from bristle.questions.sensitivity.sobol import LEVEL, Global, Output
from bristle.questions.sensitivity.study import Expected, SensitivityStudy

_NAMED = 3
"""Parameters whose shares a sentence names."""
_NAMES = re.compile(rf"\b(?:{'|'.join(Lugre._fields)})\b[+-]?")
_SMALL_INDEX = 0.05
"""A parameter or an interaction with a smaller share of an output's variance is not named."""


def study_text(study: SensitivityStudy) -> str:
    """The shares as a table, what was found in sentences, and what is assumed; a line each."""
    simulated = " (SIMULATED data)" if study.simulated else ""
    lines = [
        f"{study.name}{simulated}: RMS of p dT/dp relative to the RMS of T, by parameter",
        f"  {'':<8} {'total':>9} {'fixed z':>9} {'last period':>12}",
    ]
    columns = np.column_stack([study.local.shares(), study.local.shares(partial=True), study.settled])
    for name in study.local.ranking:
        shares = columns[Lugre._fields.index(name)]
        lines.append(f"  {name:<8} " + "{:>9.2g} {:>9.2g} {:>12.2g}".format(*shares))
    found = findings(study)
    if study.sobol is not None:
        found += sobol_sentences(study.sobol, study.kind)
    return "\n".join([*lines, *map(_with_names, found), *map(str, study.assumptions)])


def _with_names(sentence: str) -> str:
    """A sentence of the page for a terminal: parameters by their names."""
    for name in (f"{bare}{d}" for d in ("+", "-", "") for bare in Lugre._fields):
        sentence = sentence.replace(symbol(name), name)
    return sentence


def findings(study: SensitivityStudy) -> list[str]:
    """Whether the paper's claim holds, along the motion and over the map, and what each measurement would tell."""
    total, fixed_z = study.local.shares(), study.local.shares(partial=True)
    order = ranked(total)[:_NAMED]
    amplitude = f"{number(study.motion.amplitude, 3)} {pretty(unit('position', study.kind))}"
    holds = "holds" if claimed(total) else "does not hold"
    claim = (
        f"The paper's claim that α₀ and α₂ matter most {holds} for {amplitude} at "
        f"{number(study.motion.frequency, 3)} Hz: RMS of p · dT/dp relative to that of T: {_largest(total)} (total)."
    )
    if ranked(study.settled)[:_NAMED] != order:
        claim += f" In its last period, after the bristle's first deflection: {_largest(study.settled)}."
    sentences = [claim]
    if (order_at_fixed_z := ranked(fixed_z)[:_NAMED]) != order:
        listed = ", ".join(map(symbol, order_at_fixed_z))
        sentences.append(f"At fixed z the order would be {listed}: the bristle's response to a parameter matters.")
    return [*sentences, _claim_over_map(study), *map(_told_by, study.expected)]


def _largest(shares: Array) -> str:
    """The largest of the shares (6,), each after its parameter's symbol."""
    by_name = dict(zip(Lugre._fields, shares.tolist(), strict=True))
    return ", ".join(f"{symbol(name)} {number(by_name[name], 2)}" for name in ranked(shares)[:_NAMED])


def _claim_over_map(study: SensitivityStudy) -> str:
    """Where on the map the claim holds: at the lowest, the motion's own and the highest frequency."""
    claim, amplitudes, frequencies = study.map.claim, study.map.amplitudes, study.map.frequencies
    position_unit = pretty(unit("position", study.kind))
    parts = []
    for j in dict.fromkeys((0, int(np.argmin(np.abs(frequencies - study.motion.frequency))), frequencies.size - 1)):
        broken = np.flatnonzero(~claim[:, j])
        at = f"at {number(float(frequencies[j]), 2)} Hz"
        if broken.size == 0:
            parts.append(f"{at} at every amplitude")
        elif broken[-1] + 1 == amplitudes.size:
            parts.append(f"{at} not at the largest amplitude")
        else:
            parts.append(f"{at} from {number(float(amplitudes[broken[-1] + 1]), 2)} {position_unit} up")
    first = ", ".join(symbol(Lugre._fields[k]) for k in np.unique(study.map.first))
    holds = f"Of {claim.size} motions on the map it holds for {int(claim.sum())}: {', '.join(parts)}."
    return f"{holds} Parameters that rank first somewhere: {first}."


def _told_by(expected: Expected) -> str:
    """Which parameters a measurement identifies, and which combinations it hardly does."""
    names = expected.information.names
    lost = [symbol(name) for name, seen in zip(names, expected.seen, strict=True) if not seen]
    tells = f"all of {', '.join(map(symbol, names))} are identifiable."
    if lost:
        tells = f"{', '.join(lost)} would not be identifiable (standard error over half the value)."
    return " ".join([f"From {expected.what} alone {tells}", *map(with_symbols, expected.information.unseen)])


def with_symbols(sentence: Diagnostic) -> str:
    """The sentence of a diagnostic with the parameters' names as their symbols, and its units in print."""
    return pretty(_NAMES.sub(lambda name: symbol(name[0]), str(sentence)))


def output_name(name: str, kind: Kind) -> str:
    """What an output is called: a joint that slides has a force."""
    return name.replace("torque", "force") if kind == "prismatic" else name


def heading(name: str, kind: Kind) -> str:
    """The same at the beginning of a line."""
    name = output_name(name, kind)
    return f"{name[0].upper()}{name[1:]}"


def sobol_sentences(sobol: Global, kind: Kind) -> tuple[str, ...]:
    """Each output's parameters by their share of its variance, then what was drawn and what is not in it."""
    drawn = ", ".join(
        f"{symbol(s.parameter)} {span((s.low, s.high), 3)}{' (log-uniform)' if s.logarithmic else ''}"
        for s in sobol.spans
    )
    reference = f"{number(sobol.amplitude, 3)} {pretty(unit('position', kind))} at {number(sobol.frequency, 3)} Hz"
    return (
        *(_variance_shares(output, kind) for output in sobol.outputs),
        "Parameters are drawn uniformly unless stated otherwise, and independently, although those of a fit are "
        f"correlated: {drawn}. Seed {sobol.seed}.",
        f"SIMULATED: a sine of {reference}; in the loop the compensator keeps the nominal parameters while the plant "
        f"is drawn. ± of an index is its {100 * LEVEL:.0f} % bootstrap interval, which is conservative for these samples.",
    )


def _variance_shares(output: Output, kind: Kind) -> str:
    """An output's parameters by their share of its variance, the largest first, or why there are none."""
    start, indices = heading(output.name, kind), output.indices
    if indices is None:
        return f"{start}: {output.reason}"
    largest_first = sorted(indices.effects, key=lambda e: -e.total)
    named = [e for k, e in enumerate(largest_first) if k == 0 or e.total >= _SMALL_INDEX]
    listed = ", ".join(f"{symbol(e.parameter)} {e.total:.2f} ± {e.total_half:.2f} ({e.first:.2f} alone)" for e in named)
    interactions = 1 - sum(e.first for e in indices.effects)
    more = f"; interactions account for {interactions:.2f}" if interactions >= _SMALL_INDEX else ""
    return f"{start}: total index {listed}{more}; {indices.samples} samples, {indices.evaluations} evaluations."
