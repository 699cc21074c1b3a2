"""Findings of a validation: of one case, and over all cases."""

from collections.abc import Iterable

import numpy as np

from bristle.estimation import levels
from bristle.findings import CAUTION, CRITICAL, NOTE, Finding
from bristle.identification.static.grid import PLAIN_GRID
from bristle.questions.method_validation.results import FREE, SAME_COST, CaseResult, Validation
from bristle.questions.method_validation.run import PLAIN_GRIDS, POLISHED, REFINED


def verdict(result: CaseResult) -> tuple[Finding, ...]:
    """Findings of one case: whether v_s is identifiable, grid against full fit, resolution, computing times."""
    starts, v_s, best = result.starts, result.case.truth.v_s, result.methods[REFINED]
    known, found = not result.not_identifiable, list[Finding]()

    # Whether v_s is identifiable.
    speeds, declined = np.abs(result.case.velocity), 100 * result.declined
    below = int(np.count_nonzero(speeds < v_s))
    spread, bias = (100 * float(x[-1]) / v_s for x in (best.spread, best.bias))
    numbers = {"below": below, "speeds": speeds.size, "declined": declined, "spread": spread}
    if known:
        message = (
            f"v_s is identifiable here ({below} of {speeds.size} speeds lie below it): its estimates scatter by {spread:.3g} % of the "
            f"true value; no estimate returned in {declined:.3g} % of the repetitions."
        )
        found.append(Finding("v-s-knowable", NOTE, message, numbers))
    else:
        message = (
            f"v_s is not identifiable here by any method ({below} of {speeds.size} speeds lie below it): no estimate returned in "
            f"{declined:.3g} % of the repetitions, and the best fit's v_s has a median error of {bias:.3g} % of the true value and "
            f"scatters by {spread:.3g} %. A solver that returns a number all the same returns noise."
        )
        found.append(Finding("v-s-unknowable", CRITICAL, message, {**numbers, "bias": bias}))

    found += _against_solvers(result)

    # The resolution of the plain grid.
    if known:
        resolution, most = result.resolution, f"{100 * levels.FINE_ENOUGH:.3g} %"
        enough, share = resolution.enough, 100 * resolution.share(PLAIN_GRID)
        needed = f"none of the grids tried stays below {most}"
        if enough:
            needed = f"the smallest of the grids tried that stays below {most} has {enough} values"
        message = (
            f"The paper's plain grid of {PLAIN_GRID} adds an error of v_s of {share:.3g} % of its standard error; {needed}. The refined "
            "grid adds none."
        )
        numbers = {"share": share} | ({"enough": enough} if enough else {})
        found.append(Finding("plain-grid-error", NOTE, message, numbers))

    # Lower costs outside the grid's range.
    outside = result.outside_range
    if outside.any():
        beyond = starts.final[FREE][-1][outside]
        low, high = float(beyond.min()), float(beyond.max())
        message = (
            f"With v_s free, {beyond.size} of {outside.size} starts find a lower cost outside the grid's range, at v_s from {low:.3g} to "
            f"{high:.3g}: there the range determines v_s, not the data."
        )
        numbers = {"count": beyond.size, "starts": outside.size, "low": low, "high": high}
        found.append(Finding("lower-outside-range", CAUTION, message, numbers))

    # Computing times.
    names = (PLAIN_GRIDS[PLAIN_GRID], POLISHED, *(f"{solver}, random start" for solver in starts.solvers))
    times = tuple((name, result.methods[name].seconds / best.seconds) for name in names)
    listed = ", ".join(f"{name} {ratio:.2g}" for name, ratio in times)
    message = f"Computing time of one fit relative to the refined grid: {listed}."
    found.append(Finding("fit-times", NOTE, message, {"times": times}))
    return tuple(found)


def _against_solvers(result: CaseResult) -> list[Finding]:
    """The refined grid against IPOPT, and the minima of random starts of local solvers."""
    starts, known, found = result.starts, not result.not_identifiable, list[Finding]()
    deficit, shift = result.cost_deficit, result.polish_shift
    if deficit <= SAME_COST:
        many = starts.initial_v_s.size
        message = (
            f"From {many} random starts within the grid's bounds IPOPT never finds a cost below the refined grid's."
        )
        found.append(Finding("ipopt-never-lower", NOTE, message, {"starts": many}))
    else:
        message = f"IPOPT finds a cost below the refined grid's, by {deficit:.2g} relative; do not use the grid before the cause is known."
        found.append(Finding("ipopt-undercuts", CRITICAL, message, {"deficit": deficit}))
    if known and shift > levels.POLISH_MOVES:
        message = f"IPOPT initialised at the grid's estimate moves by up to {shift:.2g} standard errors, at nearly the same cost."
        found.append(Finding("polishing-moves", CAUTION, message, {"shift": shift}))
    elif known:
        message = f"IPOPT initialised at the grid's estimate stays there, within {shift:.1g} standard errors: the full fit adds nothing."
        found.append(Finding("polishing-stays", NOTE, message, {"shift": shift}))
    other = tuple((name, 100 * float(starts.in_other_minimum(name).mean())) for name in starts.solvers)
    if any(share for _, share in other):
        message = f"Random starts that end in another minimum, or before they reach one: {_shares(other)}. The grid needs no start."
        found.append(Finding("starts-part", NOTE, message, {"other": other}))
    else:
        message = (
            f"Every random start of {', '.join(starts.solvers)} ends in the grid's minimum: here the grid's only advantage is its "
            "computing time."
        )
        found.append(Finding("starts-agree", NOTE, message))
    return found


def overall(validation: Validation) -> tuple[Finding, ...]:
    """Findings of all cases: the claim, then each of several designs."""
    results = validation.cases
    if not results:
        return (Finding("nothing-tried", NOTE, "Nothing was validated."),)
    deficit = max(result.cost_deficit for result in results)
    starts = sum(result.starts.initial_v_s.size for result in results)
    fits = starts + sum(result.methods["IPOPT, random start"].repetitions for result in results)
    tried = f"{fits} IPOPT fits from random starts within the grid's bounds ({starts} of them on the first data set of each case)"
    if deficit <= SAME_COST:
        least = max(deficit, 0.0)
        message = (
            f"The grid search holds: none of {tried} has a cost below the refined grid's by more than {SAME_COST:g} relative (at "
            f"most {least:.1g})."
        )
        found = [Finding("never-undercut", NOTE, message, {"fits": fits, "starts": starts, "deficit": least})]
    else:
        message = (
            f"The grid search misses the minimum: the lowest cost of {tried} is up to {deficit:.2g} relative below the refined "
            "grid's; do not use the grid before the cause is known."
        )
        found = [Finding("undercut", CRITICAL, message, {"fits": fits, "starts": starts, "deficit": deficit})]
    designs = dict.fromkeys(result.case.design for result in results)
    for name in designs if len(designs) > 1 else ():
        of = [x for x in results if x.case.design == name]
        knowable = [x for x in of if not x.not_identifiable]
        unknowable = len(of) - len(knowable)
        shares = {n: [x.starts.in_other_minimum(n).mean() for x in of] for n in of[0].starts.solvers}
        other = tuple((solver, 100 * float(np.mean(share))) for solver, share in shares.items())
        outside = 100 * float(np.mean([x.outside_range.mean() for x in of]))
        coarse = sum(x.resolution.share(PLAIN_GRID) > levels.FINE_ENOUGH for x in knowable)
        message = (
            f"{name}: random starts that end in another minimum: {_shares(other)}; with v_s free, {outside:.3g} % find a lower cost "
            f"outside the grid's range; v_s is not identifiable by any method in {unknowable} of {len(of)} cases; in {coarse} of "
            f"the others a plain grid of {PLAIN_GRID} is too coarse."
        )
        numbers = {"other": other, "outside": outside, "unknowable": unknowable, "cases": len(of), "coarse": coarse}
        found.append(Finding("design-validated", NOTE, message, numbers))
    return tuple(found)


def _shares(named: Iterable[tuple[str, float]]) -> str:
    return ", ".join(f"{name} {percent:.3g} %" for name, percent in named)
