"""What was found of a joint's sensitivity, as findings."""

from collections.abc import Sequence

import numpy as np

from bristle.arrays import Array
from bristle.findings import CAUTION, NOTE, Finding
from bristle.model.parameters import Kind as JointKind
from bristle.model.parameters import unit
from bristle.questions.sensitivity.local import claimed, ranked
from bristle.questions.sensitivity.sobol import LEVEL, Global
from bristle.questions.sensitivity.study import SensitivityStudy

_NAMED = 3
"""Parameters whose shares a sentence names."""
_SMALL_INDEX = 0.05
"""A parameter or an interaction with a smaller share of an output's variance is not named."""


def findings(study: SensitivityStudy) -> tuple[Finding, ...]:
    """Whether the paper's claim holds, along the motion and over the map, and what each measurement would tell."""
    total, at_fixed_z, names = study.local.shares(), study.local.shares(partial=True), study.local.names
    holds, largest, settled = claimed(total, names), _largest(total, names), _largest(study.settled, names)
    later = f" In its last period, after the bristle's first deflection: {_listed(settled)}."
    message = (
        f"The paper's claim that alpha_0 and alpha_2 matter most {'holds' if holds else 'does not hold'} for "
        f"{study.motion.amplitude:.3g} {unit('position', study.kind)} at {study.motion.frequency:.3g} Hz: "
        f"RMS of p dT/dp relative to that of T: {_listed(largest)} (total).{later if list(settled) != list(largest) else ''}"
    )
    motion = {"amplitude": study.motion.amplitude, "frequency": study.motion.frequency}
    numbers = {**motion, "largest": tuple(largest.items())}
    found = [Finding("claim-holds" if holds else "claim-fails", NOTE, message, numbers)]
    first = ranked(at_fixed_z, names)[:_NAMED]
    if first != tuple(largest):
        message = f"At fixed z the order would be {', '.join(first)}: the bristle's response to a parameter matters."
        found.append(Finding("other-at-fixed-z", NOTE, message, {"names": first}))

    # Where on the map the claim holds: at the lowest, the motion's own and the highest frequency.
    claim, amplitudes, frequencies = study.map.claim, study.map.amplitudes, study.map.frequencies
    where = []
    for j in dict.fromkeys((0, int(np.argmin(np.abs(frequencies - study.motion.frequency))), frequencies.size - 1)):
        broken, at = np.flatnonzero(~claim[:, j]), f"at {frequencies[j]:.2g} Hz"
        if broken.size == 0:
            where.append(f"{at} at every amplitude")
        elif broken[-1] + 1 == amplitudes.size:
            where.append(f"{at} not at the largest amplitude")
        else:
            where.append(f"{at} from {amplitudes[broken[-1] + 1]:.2g} {unit('position', study.kind)} up")
    leading, held = tuple(names[k] for k in np.unique(study.map.first)), int(claim.sum())
    message = (
        f"Of {claim.size} motions on the map it holds for {held}: {', '.join(where)}. "
        f"Parameters that rank first somewhere: {', '.join(leading)}."
    )
    found.append(Finding("claim-on-map", NOTE, message, {"motions": claim.size, "held": held, "first": leading}))

    # Which parameters each measurement identifies, and which combinations it hardly does.
    for expected in study.expected:
        all_of, more = expected.information.names, "".join(f" {x.message}" for x in expected.information.unseen)
        lost = tuple(name for name, seen in zip(all_of, expected.seen, strict=True) if not seen)
        if lost:
            message = (
                f"From {expected.what} alone {', '.join(map(str, lost))} would not be identifiable "
                f"(standard error over half the value).{more}"
            )
            found.append(Finding("not-told", CAUTION, message, {"names": lost}))
        else:
            message = f"From {expected.what} alone all of {', '.join(map(str, all_of))} are identifiable.{more}"
            found.append(Finding("all-told", NOTE, message, {"names": all_of}))
    return tuple(found)


def _largest(shares: Array, names: Sequence[str]) -> dict[str, float]:
    """The largest of the shares, (6,), by the parameter's name, in their order."""
    by_name = dict(zip(names, shares.tolist(), strict=True))
    return {name: by_name[name] for name in ranked(shares, names)[:_NAMED]}


def _listed(shares: dict[str, float]) -> str:
    return ", ".join(f"{name} {share:.2g}" for name, share in shares.items())


def sobol_sentences(sobol: Global, kind: JointKind) -> tuple[Finding, ...]:
    """Each output's parameters by their share of its variance, then what was drawn and what is not in it."""
    spans = ", ".join(
        f"{s.parameter} [{s.low:.3g}, {s.high:.3g}]{' (log-uniform)' if s.logarithmic else ''}" for s in sobol.spans
    )
    drawn = (
        "Parameters are drawn uniformly unless stated otherwise, and independently, although those of a fit are "
        f"correlated: {spans}. Seed {sobol.seed}."
    )
    simulated = (
        f"SIMULATED: a sine of {sobol.amplitude:.3g} {unit('position', kind)} at {sobol.frequency:.3g} Hz; in the loop the "
        "compensator keeps the nominal parameters while the plant is drawn. ± of an index is its "
        f"{100 * LEVEL:.0f} % bootstrap interval, which is conservative for these samples."
    )
    found = []
    for output in sobol.outputs:
        start, indices = output.heading(kind), output.indices
        if indices is None:
            found.append(Finding("no-indices", NOTE, f"{start}: {output.reason}"))
            continue
        first, *others = sorted(indices.effects, key=lambda e: -e.total)
        named = [first, *(e for e in others if e.total >= _SMALL_INDEX)]
        listed = ", ".join(f"{e.parameter} {e.total:.2f} ± {e.total_half:.2f} ({e.first:.2f} alone)" for e in named)
        share = 1 - sum(e.first for e in indices.effects)
        more = f"; interactions account for {share:.2f}" if share >= _SMALL_INDEX else ""
        message = f"{start}: total index {listed}{more}; {indices.samples} samples, {indices.evaluations} evaluations."
        total = tuple((e.parameter, e.total) for e in (first, *others))
        numbers = {"total": total, "samples": indices.samples, "evaluations": indices.evaluations}
        found.append(Finding("sobol-indices", NOTE, message, numbers))
    return (
        *found,
        Finding("drawn-from", NOTE, drawn, {"spans": tuple(map(tuple, sobol.spans)), "seed": sobol.seed}),
        Finding("indices-simulated", NOTE, simulated, {"amplitude": sobol.amplitude, "frequency": sobol.frequency}),
    )
