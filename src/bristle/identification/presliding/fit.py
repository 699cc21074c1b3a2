"""sigma_0 and sigma_1 from slow loading below breakaway (3.2 of the paper), with breakaway and loops."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from bristle.data.bandwidth import of_slow_loading
from bristle.data.experiment.schema import FitOptions
from bristle.data.record import Record
from bristle.data.slow_loading import Loading, find_all_loadings, find_loops
from bristle.errors import InputError
from bristle.estimation import levels
from bristle.estimation.covariance import student
from bristle.findings import CAUTION, NOTE, Finding, in_direction, in_units, unit_of
from bristle.identification.fits import Estimate, Presliding, PreslidingFit, Uncertainty
from bristle.identification.presliding.softening import softening, with_most
from bristle.identification.presliding.stiffness import (
    KnownValue,
    estimator_of,
    of_loading,
    printed,
    quantum_of,
    stiffness,
    torque_shares,
    with_shifts,
)
from bristle.identification.presliding.uncertainty import stiffness_scatter, stiffness_uncertainty
from bristle.identification.repeats import spreader, wider_estimate, wider_three
from bristle.identification.systematic import shifted, shifted_three
from bristle.model import functions
from bristle.model.law import DAMPING_RATIO
from bristle.model.parameters import Kind, unit
from bristle.model.vectorize import evaluate

_SINGLE = 0.1  # assumed relative standard error of a single breakaway torque


def identify_presliding(
    records: Sequence[Record],
    breakaways: Mapping[str, KnownValue],
    inertia: KnownValue | None,
    options: FitOptions,
    resolution: float | None,
    kind: Kind,
) -> Presliding:
    """The results of presliding runs; `breakaways` are g0 per direction. Raises InputError where a run loads nothing."""
    records = [r if r.cutoff else replace(r, cutoff=of_slow_loading(r)[0]) for r in records]
    found = find_all_loadings(records, resolution, options.breakaway_displacement)
    for record, of_record in zip(records, found, strict=True):
        if not of_record:
            raise InputError(
                f"{record.file}: the torque never grows slowly from zero; a presliding run is a slow ramp or cycle of torque from rest"
            )
    loadings = [loading for of_record in found for loading in of_record]
    slid = [loading for loading in loadings if loading.breakaway is not None]
    fits, breakaway, warnings = {}, {}, list[Finding]()
    for direction in ("+", "-"):
        own_slid = [x for x in slid if x.direction == direction]
        if own_slid:
            breakaway[direction], outliers = _breakaway(own_slid, direction, kind)
            warnings += outliers
    # of a breakaway torque, found by speed: by which g0 may be higher, from LuGre's creep
    creep = 0.0 if options.breakaway_displacement else 1 / (levels.ONSET - 1)
    for direction in sorted({loading.direction for loading in loadings}):
        own = [x for x in loadings if x.direction == direction]
        held = max(x.held for x in own)
        level = breakaways.get(direction)
        if level is None or (level.is_bound and (held > level.value or breakaway)):
            level = _from_breakaway(breakaway, direction, held, creep)
        fits[direction] = fit_presliding(own, level, inertia, kind)
    cycles = [find_loops(r, r.cutoff, resolution) for r in records]
    loops = tuple(loop for closed, _ in cycles for loop in closed)
    if drifts := [drift for _, drifts in cycles for drift in drifts]:
        farthest = max(drifts, key=abs)
        message = (
            f"{len(drifts)} of {len(drifts) + len(loops)} hysteresis cycles not closed, by up to {100 * farthest:+.0f} % of "
            "their range, and left out: friction differs between the directions at these peaks, or the first cycle started "
            "from rest."
        )
        numbers = {"open": len(drifts), "cycles": len(drifts) + len(loops), "most": farthest}
        warnings.append(Finding("open-cycles", CAUTION, message, numbers))
    return Presliding(fits=fits, breakaway=breakaway, breakaways=tuple(slid), loops=loops, warnings=tuple(warnings))


def fit_presliding(
    loadings: Sequence[Loading], level: KnownValue, inertia: KnownValue | None, kind: Kind
) -> PreslidingFit:
    """sigma_0 of one direction, beside (14) as printed, and sigma_1 by (15) if an inertia is known."""
    quantum, direction = quantum_of(loadings), loadings[0].direction
    pieces = [of_loading(loading, level.value) for loading in loadings]
    counts = sum(piece.edge_y.size for piece in pieces)
    by_bend = with_most(loadings, level)
    sigma_0 = stiffness(loadings, by_bend, kind)
    warnings = [w for w in sigma_0.warnings if w.code == "within-noise"]
    bent = by_bend.middle if by_bend.most < np.inf else level
    softens = None if sigma_0.value is None else softening(loadings, bent, kind)
    if softens is not None:
        warnings.append(softens)
        if sigma_0.interval is not None:  # widened to hold the sigma_0 of each amplitude
            ends = [*sigma_0.interval, *softens.numbers["sigma_0"]]
            error = max(sigma_0.standard_error or 0.0, (max(ends) - min(ends)) / (2 * student(np.inf)))
            sigma_0 = replace(sigma_0, standard_error=error, interval=(min(ends), max(ends)))
    if 0 < counts < levels.FEW * len(loadings):
        message = (
            f"Few encoder counts: {counts} edges in {len(loadings)} loadings; use a finer encoder, or load closer to "
            "breakaway."
        )
        warnings.append(Finding("few-counts", CAUTION, message, {"edges": counts, "loadings": len(loadings)}))
    more = softens  # why the interval is wider than one at a given g0
    if level.is_bound:
        warnings.append(bound := _bounded(direction, level, by_bend))
        more = softens or bound
    if more is None:
        three = stiffness_uncertainty(loadings, level, sigma_0)
    else:
        three = Uncertainty(covariance=None, profile=sigma_0.interval, bootstrap=None, warnings=(more,))
    scatter = stiffness_scatter(loadings, by_bend.middle, sigma_0)
    if scatter and scatter.stretched > 1 and sigma_0.value is not None:
        widen = spreader(sigma_0.value, scatter.stretched, "sigma_0")
        sigma_0, three = wider_estimate(sigma_0, scatter, widen), wider_three(three, widen)
    sigma_0 = with_shifts(sigma_0, loadings, level)
    warnings += [warning for warning in three.warnings if warning.code == "intervals-differ"]
    reached = max((x.held for x in loadings if x.breakaway is None), default=0.0)
    if not level.is_bound and reached > level.value + levels.SURE * level.standard_error:
        of = unit_of("torque")
        message = (
            f"The torque reaches {reached:.3g}{of} without sliding, above g0 = {level.value:.3g}{of} "
            f"({level.source.message}): g0 may be too low. Samples above {levels.REACH:g} g0 are not used."
        )
        numbers = {"reached": reached, "g0": level.value, "source": level.source, "reach": levels.REACH}
        warnings.append(Finding("above-g0", CAUTION, message, numbers))
    return PreslidingFit(
        direction=direction, printed=printed(loadings, level.value, kind), sigma_0=sigma_0,
        sigma_1=_sigma_1(sigma_0, inertia, kind), degrees_of_freedom=estimator_of(loadings)(pieces)[2],
        level=level.value, level_standard_error=level.standard_error,
        level_source=level.source, quantum=quantum, counts=counts, loadings=tuple(loadings), warnings=tuple(warnings),
        uncertainty={"sigma_0": shifted_three(three, sigma_0)},
        repeats={"sigma_0": scatter} if scatter else {},
    )  # fmt: skip  # a list of values


def _bounded(direction: str, level: KnownValue, by_bend: KnownValue) -> Finding:
    """The caution that g0 is a lower bound."""
    bend, of = "", unit_of("torque")
    if by_bend.most < np.inf:
        bend = f", from {by_bend.value:.4g}{of} to {by_bend.most:.4g}{of} by the bend of LuGre's loading curve"
    message = (
        f"No run breaks away{in_direction(direction)}: g0 is at least {level.value:.3g}{of} ({level.source.message}){bend}, and the "
        "interval of sigma_0 allows for every such g0; add slower ramp runs, or load up to breakaway once."
    )
    numbers = {"direction": direction, "held": level.value, "source": level.source, "bend": in_units(bend, {})}
    return Finding("g0-at-least", CAUTION, message, numbers)


def with_damping(presliding: Presliding, inertia: KnownValue, kind: Kind) -> Presliding:
    """The same with sigma_1 by (15) for another inertia."""
    fits = {d: replace(fit, sigma_1=_sigma_1(fit.sigma_0, inertia, kind)) for d, fit in presliding.fits.items()}
    return replace(presliding, fits=fits)


def _breakaway(slid: Sequence[Loading], direction: str, kind: Kind) -> tuple[Estimate, list[Finding]]:
    """Median breakaway torque, and its outliers."""
    torque = np.array([loading.breakaway for loading in slid], dtype=float)
    middle, n = float(np.median(torque)), torque.size
    shifts = {name: middle * share for name, share in torque_shares(slid).items()}
    if n == 1:
        alone = Finding("single-run", CAUTION, "One run only: its error is unknown.")
        return shifted(Estimate(value=middle, unit=unit("torque", kind), warnings=(alone,)), shifts), []
    error = float(1.2533 * 1.4826 * np.median(np.abs(torque - middle)) / np.sqrt(n))  # of a median of normal values
    reach = student(n - 1) * error
    warnings, of = list[Finding](), unit_of("torque")
    for loading, value in zip(slid, torque.tolist(), strict=True):
        if n > 2 and abs(value - middle) > levels.OUTLIER * middle:
            message = (
                f"{loading.file} is an outlier: it breaks away at {value:.4g}{of}; the median of {n} runs{in_direction(direction)} "
                f"is {middle:.4g}{of}."
            )
            numbers = {"file": loading.file, "torque": value, "runs": n, "direction": direction, "median": middle}
            warnings.append(Finding("outlier", CAUTION, message, numbers))
    interval = max(middle - reach, 0.0), middle + reach
    whole = Estimate(value=middle, unit=unit("torque", kind), standard_error=error, interval=interval)
    return shifted(whole, shifts), warnings


def _from_breakaway(breakaway: Mapping[str, Estimate], direction: str, held: float, creep: float) -> KnownValue:
    """g0 from breakaway in this direction, else in the other, else at least the largest torque held."""
    for d in (direction, "-" if direction == "+" else "+"):
        torque = breakaway[d].value if d in breakaway else None
        if torque is not None and (d == direction or held <= torque * (1 + creep)):
            error = breakaway[d].standard_error
            added = f", with up to {100 * creep:.0f} % added for the creep before it" if creep else ""
            of, numbers = f"breakaway in direction {d}{added}", {"direction": d, "creep": added}
            source = Finding("of-breakaway", NOTE, of, numbers)
            if not error:
                guess = f"{of}; its error of {100 * _SINGLE:.0f} % is a guess"
                source = Finding("of-one-breakaway", CAUTION, guess, {**numbers, "share": _SINGLE})
            value, half = torque * (1 + creep / 2), torque * creep / 2
            shifts = {constant: by * (1 + creep / 2) for constant, by in breakaway[d].shifts.items()}
            return KnownValue(value, float(np.hypot(error or _SINGLE * value, half)), source, shifts)
    source = Finding("of-largest-held", CAUTION, "the largest torque held")
    return KnownValue(held, float("inf"), source)


def _sigma_1(sigma_0: Estimate, inertia: KnownValue | None, kind: Kind) -> Estimate:
    """sigma_1 by (15) from an assumed damping ratio, without a standard error."""
    known = inertia is not None and inertia.value > 0
    if inertia is None or not known or not sigma_0.value or sigma_0.value < 0:
        why = "no positive inertia is known: give inertia in the experiment file, or add moving runs"
        why = "there is no sigma_0" if known else why
        none = Finding("no-sigma-1", NOTE, f"No estimate: (15) needs J and sigma_0, but {why}.", {"why": why})
        return Estimate(value=None, unit=unit("sigma_1", kind), warnings=(none,))
    damping = functions.presliding_damping_function()
    value, by_sigma_0, by_J = map(float, evaluate(damping, sigma_0.value, inertia.value, DAMPING_RATIO))
    message = (
        f"An assumption, not an estimate: (15) with an assumed damping ratio of {DAMPING_RATIO:g} (J: "
        f"{inertia.source.message}); without an error, since that ratio is known no better than a factor."
    )
    assumed = Finding("prior", CAUTION, message, {"ratio": DAMPING_RATIO, "source": inertia.source})
    prior = Estimate(value=value, unit=unit("sigma_1", kind), warnings=(assumed,))
    shifts = {c: by_sigma_0 * by for c, by in sigma_0.shifts.items()}
    for c, by in inertia.shifts.items():
        shifts[c] = shifts.get(c, 0.0) + by_J * by
    return shifted(prior, shifts)
