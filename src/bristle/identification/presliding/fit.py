"""sigma_0 and sigma_1 from slow loading below breakaway (3.2 of the paper).

The estimators of sigma_0 stand side by side; then come breakaway, loops, and (15).
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from bristle.data.experiment.schema import FitOptions
from bristle.data.record import Record
from bristle.data.slow_loading import Loading, Loop, find_loadings, find_loops
from bristle.diagnostics import Diagnostic, Kind
from bristle.errors import InputError
from bristle.estimation.covariance import student
from bristle.identification.fits import Estimate, Presliding, PreslidingFit
from bristle.identification.presliding.stiffness import (
    REACH,
    KnownValue,
    count_edges,
    printed_bias,
    stiffness,
    torque_shares,
    with_shifts,
)
from bristle.identification.presliding.uncertainty import stiffness_uncertainty
from bristle.model import functions
from bristle.model.law import DAMPING_RATIO
from bristle.model.parameters import Kind as JointKind
from bristle.model.parameters import unit
from bristle.model.vectorize import evaluate

_FEW = 8
"""Count edges in a loading below which they are called few."""
_YIELDS = 3.0
"""An edge-to-edge stiffness this many times below what the first count allows is that of a joint that slides."""
_OUTLIER = 0.2
"""A breakaway torque this far from the median, relative, is named."""
_SINGLE = 0.1
"""Standard error of a breakaway torque seen once, relative: a guess, said where it is used."""


def identify_presliding(
    records: Sequence[Record],
    levels: Mapping[str, KnownValue],
    inertia: KnownValue | None,
    options: FitOptions,
    resolution: float | None,
    kind: JointKind,
) -> Presliding:
    """Everything that presliding runs show of a joint.

    Args:
        records: with position and torque.
        levels: g0 per direction, where other runs tell it; where none does, breakaway in these runs stands in.
        inertia: for (15); None where unknown.
        options: the experiment's `fit`.
        resolution: one encoder count, rad; None: from the data.
        kind: of the joint.

    Raises InputError where a run holds no loading from zero torque, or slides from its start.
    """
    loadings: list[Loading] = []
    for record in records:
        of_record = find_loadings(record, options.presliding_cutoff, resolution, options.breakaway_displacement)
        if not of_record:
            raise InputError(
                f"{record.file}: the torque never grows slowly from zero; a presliding run is a slow ramp or cycle of torque from rest"
            )
        loadings += of_record
    slid = [loading for loading in loadings if loading.breakaway is not None]
    fits, breakaway, warnings = {}, {}, list[Diagnostic]()
    for direction in ("+", "-"):
        own_slid = [x for x in slid if x.direction == direction]
        if own_slid:
            breakaway[direction], outliers = _breakaway(own_slid, direction, kind)
            warnings += outliers
    for direction in sorted({loading.direction for loading in loadings}):
        level = levels.get(direction) or _from_breakaway(breakaway, direction)
        if level is None:
            warnings.append(Kind.NO_SIGMA_0(direction=direction))
            continue
        fits[direction] = fit_presliding([x for x in loadings if x.direction == direction], level, inertia, kind)
    cycles = [find_loops(r, options.presliding_cutoff, resolution) for r in records]
    loops = tuple(loop for closed, _ in cycles for loop in closed)
    warnings += _loop_warnings(loops, [drift for _, drifts in cycles for drift in drifts])
    return Presliding(fits=fits, breakaway=breakaway, breakaways=tuple(slid), loops=loops, warnings=tuple(warnings))


def fit_presliding(
    loadings: Sequence[Loading], level: KnownValue, inertia: KnownValue | None, kind: JointKind
) -> PreslidingFit:
    """sigma_0 of one direction by four estimators, side by side, and sigma_1 by (15).

    Args:
        loadings: of one direction, at least one.
        level: g0 of this direction.
        inertia: for (15); None: sigma_1 is absent, with the reason.
        kind: of the joint.
    """
    quantum = max(loading.quantum for loading in loadings)
    counts = count_edges(loadings, level)
    estimates = stiffness(loadings, level, kind)
    hidden = estimates["edges"] is estimates["samples"]  # one lower bound stands for all
    warnings = list(estimates["samples"].warnings) if hidden else []
    if 0 < counts < _FEW * len(loadings):
        warnings.append(Kind.FEW_COUNTS(edges=counts, loadings=len(loadings)))
    first = estimates["corrected"]
    if first.interval and (estimates["edges"].value or np.inf) < first.interval[0] / _YIELDS:
        warnings.append(Kind.YIELDS())
    best = "edges" if quantum > 0 else "samples"
    sigma_0 = estimates[best]
    u = np.array([max((sigma_0.value or 0.0) * quantum / level.value, 1e-9)])
    known = quantum > 0 and (sigma_0.value or 0.0) > 0
    on_edge, mean, spread = (float(x[0]) if known else np.nan for x in printed_bias(u))
    three = stiffness_uncertainty(loadings, level, best, sigma_0)
    estimates = with_shifts(estimates, loadings, level)
    sigma_0 = estimates[best]
    warnings += [warning for warning in three.warnings if warning.kind is Kind.INTERVALS_DIFFER]
    reached = max(float(loading.torque.max()) for loading in loadings)
    if reached > level.value:
        warnings.append(Kind.ABOVE_G0(reached=reached, g0=level.value, source=level.source, reach=REACH))
    return PreslidingFit(
        direction=loadings[0].direction,
        **estimates,
        sigma_1=_sigma_1(sigma_0, inertia, kind),
        recommended=best,
        level=level.value,
        level_standard_error=level.standard_error,
        level_source=level.source,
        quantum=quantum,
        counts=counts,
        bias_on_edge=on_edge,
        bias_mean=mean,
        bias_spread=spread,
        loadings=tuple(loadings),
        warnings=tuple(warnings),
        uncertainty={"sigma_0": three.of(sigma_0)},
    )


def with_damping(presliding: Presliding, inertia: KnownValue, kind: JointKind) -> Presliding:
    """The same with sigma_1 by (15) for an inertia that became known since."""
    fits = {d: replace(fit, sigma_1=_sigma_1(fit.sigma_0, inertia, kind)) for d, fit in presliding.fits.items()}
    return replace(presliding, fits=fits)


def _breakaway(slid: Sequence[Loading], direction: str, kind: JointKind) -> tuple[Estimate, list[Diagnostic]]:
    """The median breakaway torque of some loadings, and its outliers by name."""
    torque = np.array([loading.breakaway for loading in slid], dtype=float)
    middle, n = float(np.median(torque)), torque.size
    shifts = {name: middle * share for name, share in torque_shares(slid).items()}
    if n == 1:
        single = Estimate(value=middle, unit=unit("torque", kind), warnings=(Kind.SINGLE_RUN(),))
        return single.shifted(shifts), []
    error = float(1.2533 * 1.4826 * np.median(np.abs(torque - middle)) / np.sqrt(n))  # of a median of normal values
    reach = student(n - 1) * error
    warnings = [
        Kind.OUTLIER(file=loading.file, torque=value, runs=n, direction=direction, median=middle)
        for loading, value in zip(slid, torque.tolist(), strict=True)
        if n > 2 and abs(value - middle) > _OUTLIER * middle
    ]
    whole = Estimate(
        value=middle,
        unit=unit("torque", kind),
        standard_error=error,
        interval=(max(middle - reach, 0.0), middle + reach),
    )
    return whole.shifted(shifts), warnings


def _from_breakaway(breakaway: Mapping[str, Estimate], direction: str) -> KnownValue | None:
    """g0 from the breakaway of this direction, or else of the other one."""
    for d in (direction, "-" if direction == "+" else "+"):
        if d in breakaway:
            value, error = breakaway[d].value or 0.0, breakaway[d].standard_error
            source = Kind.OF_BREAKAWAY(direction=d) if error else Kind.OF_ONE_BREAKAWAY(direction=d, share=_SINGLE)
            return KnownValue(value, error or _SINGLE * value, source, breakaway[d].shifts)
    return None


def _loop_warnings(loops: Sequence[Loop], drifts: Sequence[float]) -> list[Diagnostic]:
    warnings = []
    few = [x.counts for x in loops if 0 < x.counts < 2 * _FEW]
    if few:
        one = min(few) == max(few)
        warnings.append(
            Kind.COARSE_LOOPS(counts=few[0]) if one else Kind.COARSE_LOOPS_BETWEEN(least=min(few), most=max(few))
        )
    if drifts:
        most = max(drifts, key=abs)
        warnings.append(Kind.OPEN_CYCLES(open=len(drifts), cycles=len(drifts) + len(loops), most=most))
    return warnings


def _sigma_1(sigma_0: Estimate, inertia: KnownValue | None, kind: JointKind) -> Estimate:
    """(15): a prior from an assumed damping ratio, no estimate."""
    known = inertia is not None and inertia.value > 0
    if inertia is None or not known or not sigma_0.value or sigma_0.value < 0:
        why = Kind.NO_STIFFNESS() if known else Kind.NO_INERTIA()
        return Estimate(value=None, unit=unit("sigma_1", kind), warnings=(Kind.NO_SIGMA_1(why=why),))
    value, by_sigma_0, by_J = (
        float(x) for x in evaluate(functions.presliding_damping_function(), sigma_0.value, inertia.value, DAMPING_RATIO)
    )
    prior = Estimate(
        value=value,
        unit=unit("sigma_1", kind),
        standard_error=float(np.hypot(by_sigma_0 * (sigma_0.standard_error or 0.0), by_J * inertia.standard_error)),
        warnings=(Kind.PRIOR(ratio=DAMPING_RATIO, source=inertia.source),),
    )
    constants = dict.fromkeys((*sigma_0.shifts, *inertia.shifts))
    return prior.shifted(
        {c: by_sigma_0 * sigma_0.shifts.get(c, 0.0) + by_J * inertia.shifts.get(c, 0.0) for c in constants}
    )
