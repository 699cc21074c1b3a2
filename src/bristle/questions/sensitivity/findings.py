"""What was found of a joint's sensitivity, as findings."""

from collections.abc import Sequence

import numpy as np

from bristle.arrays import Array
from bristle.diagnostics import Kind
from bristle.findings import Finding
from bristle.model.parameters import Kind as JointKind
from bristle.model.parameters import unit
from bristle.questions.sensitivity.local import claimed, ranked
from bristle.questions.sensitivity.sobol import LEVEL, Global, Output
from bristle.questions.sensitivity.study import Expected, SensitivityStudy

_NAMED = 3
"""Parameters whose shares a sentence names."""
_SMALL_INDEX = 0.05
"""A parameter or an interaction with a smaller share of an output's variance is not named."""


def findings(study: SensitivityStudy) -> tuple[Finding, ...]:
    """Whether the paper's claim holds, along the motion and over the map, and what each measurement would tell."""
    total, settled, names = study.local.shares(), study.settled, study.local.names
    order, at_fixed_z = (ranked(x, names)[:_NAMED] for x in (total, study.local.shares(partial=True)))
    claim = (Kind.CLAIM_HOLDS if claimed(total, names) else Kind.CLAIM_FAILS)(
        amplitude=study.motion.amplitude, unit=unit("position", study.kind), frequency=study.motion.frequency, largest=_largest(total, names),
        settled=Kind.ONCE_SETTLED(largest=_largest(settled, names)) if ranked(settled, names)[:_NAMED] != order else "",
    )  # fmt: skip  # a list of values
    other = (Kind.OTHER_AT_FIXED_Z(names=at_fixed_z),) if at_fixed_z != order else ()
    return (claim, *other, _claim_over_map(study), *map(_told_by, study.expected))


def _largest(shares: Array, names: Sequence[str]) -> tuple[tuple[str, float], ...]:
    """The largest of the shares, (6,), each after its parameter's name."""
    by_name = dict(zip(names, shares.tolist(), strict=True))
    return tuple((name, by_name[name]) for name in ranked(shares, names)[:_NAMED])


def _claim_over_map(study: SensitivityStudy) -> Finding:
    """Where on the map the claim holds: at the lowest, the motion's own and the highest frequency."""
    claim, amplitudes, frequencies = study.map.claim, study.map.amplitudes, study.map.frequencies
    parts = []
    for j in dict.fromkeys((0, int(np.argmin(np.abs(frequencies - study.motion.frequency))), frequencies.size - 1)):
        broken, f = np.flatnonzero(~claim[:, j]), frequencies[j]
        if broken.size == 0:
            parts.append(Kind.AT_EVERY_AMPLITUDE(frequency=f))
        elif broken[-1] + 1 == amplitudes.size:
            parts.append(Kind.NOT_AT_THE_LARGEST(frequency=f))
        else:
            least = amplitudes[broken[-1] + 1]
            parts.append(Kind.FROM_AMPLITUDE(frequency=f, amplitude=least, unit=unit("position", study.kind)))
    first = tuple(study.map.names[k] for k in np.unique(study.map.first))
    return Kind.CLAIM_ON_MAP(motions=claim.size, held=int(claim.sum()), where=tuple(parts), first=first)


def _told_by(expected: Expected) -> Finding:
    """Which parameters a measurement identifies, and which combinations it hardly does."""
    names, more = expected.information.names, expected.information.unseen
    lost = tuple(name for name, seen in zip(names, expected.seen, strict=True) if not seen)
    return (Kind.NOT_TOLD if lost else Kind.ALL_TOLD)(what=expected.what, names=lost or names, more=more)


def sobol_sentences(sobol: Global, kind: JointKind) -> tuple[Finding, ...]:
    """Each output's parameters by their share of its variance, then what was drawn and what is not in it."""
    spans = tuple(
        (Kind.DRAWN_LOGARITHM if s.logarithmic else Kind.DRAWN_SPAN)(name=s.parameter, low=s.low, high=s.high)
        for s in sobol.spans
    )
    reference = {"amplitude": sobol.amplitude, "unit": unit("position", kind), "frequency": sobol.frequency}
    return (
        *(_variance_shares(output, kind) for output in sobol.outputs),
        Kind.DRAWN_FROM(spans=spans, seed=sobol.seed),
        Kind.INDICES_SIMULATED(**reference, level=LEVEL),
    )


def _variance_shares(output: Output, kind: JointKind) -> Finding:
    """An output's parameters by their share of its variance, the largest first, or why there are none."""
    start, indices = output.heading(kind), output.indices
    if indices is None:
        return Kind.NO_INDICES(output=start, why=output.reason)
    largest_first = sorted(indices.effects, key=lambda e: -e.total)
    listed = tuple(
        Kind.SOBOL_INDEX(name=e.parameter, total=e.total, half=e.total_half, first=e.first)
        for k, e in enumerate(largest_first)
        if k == 0 or e.total >= _SMALL_INDEX
    )
    share = 1 - sum(e.first for e in indices.effects)
    return Kind.SOBOL_INDICES(
        output=start, indices=listed, more=Kind.INTERACTIONS(share=share) if share >= _SMALL_INDEX else "",
        samples=indices.samples, evaluations=indices.evaluations,
    )  # fmt: skip  # a list of values
