"""What a validation says, as diagnostics: of one case, and over all."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from bristle.findings import CAUTION, CRITICAL, NOTE, Finding
from bristle.identification.static.grid import PLAIN_GRID
from bristle.questions.method_validation.results import FINE_ENOUGH, FREE, SAME_COST, CaseResult, Validation
from bristle.questions.method_validation.run import PLAIN_GRIDS, POLISHED, REFINED

_UNMOVED = 1e-3
"""A parameter that moves by fewer spreads than this is the same."""


def verdict(result: CaseResult) -> tuple[Finding, ...]:
    """Of one case: whether v_s can be known, grid against full fit, resolution, and what others do better."""
    return (
        *_knowable(result),
        *_against_ipopt(result),
        *_other_minima(result),
        *_resolution(result),
        *_outside_range(result),
        *_times(result),
    )


def overall(validation: Validation) -> tuple[Finding, ...]:
    """Of all cases: the claim, then each design where there are several."""
    results = validation.cases
    if not results:
        return (Finding("nothing-tried", NOTE, "Nothing was validated."),)
    deficit = max(result.cost_deficit for result in results)
    starts = sum(result.starts.initial_v_s.size for result in results)
    fits = starts + sum(result.methods["IPOPT, random start"].repetitions for result in results)
    tried = f"{fits} IPOPT fits from random starts within the grid's bounds ({starts} of them on the first data set of each case)"
    if deficit <= SAME_COST:
        least = max(deficit, 0.0)
        claim = Finding(
            "never-undercut",
            NOTE,
            f"{tried}: none has a cost below the refined grid's by more than {SAME_COST:g} relative (at most {least:.1g}).",
            {"fits": fits, "starts": starts, "deficit": least},
        )
    else:
        claim = Finding(
            "undercut",
            CRITICAL,
            f"{tried}: the lowest cost is up to {deficit:.2g} relative below the refined grid's; do not use the grid before the "
            "cause is known.",
            {"fits": fits, "starts": starts, "deficit": deficit},
        )
    designs = list(dict.fromkeys(result.case.design for result in results))
    if len(designs) == 1:
        return (claim,)
    return (claim, *(_design(name, [x for x in results if x.case.design == name]) for name in designs))


def _design(name: str, results: Sequence[CaseResult]) -> Finding:
    knowable = [result for result in results if not result.not_identifiable]
    unknowable = len(results) - len(knowable)
    other = tuple(
        (solver, 100 * float(np.mean([x.starts.in_other_minimum(solver).mean() for x in results])))
        for solver in results[0].starts.solvers
    )
    outside = 100 * float(np.mean([result.outside_range.mean() for result in results]))
    coarse = sum(result.resolution.share(PLAIN_GRID) > FINE_ENOUGH for result in knowable)
    return Finding(
        "design-validated",
        NOTE,
        f"{name}: random starts that end in another minimum: {_shares(other)}; with v_s free, {outside:.3g} % find a lower cost "
        f"outside the grid's range; v_s is not identifiable by any method in {unknowable} of {len(results)} cases; in {coarse} of "
        f"the others a plain grid of {PLAIN_GRID} is too coarse.",
        {"other": other, "outside": outside, "unknowable": unknowable, "cases": len(results), "coarse": coarse},
    )


def _shares(named: Iterable[tuple[str, float]]) -> str:
    """Percentages, each with its name."""
    return ", ".join(f"{name} {percent:.3g} %" for name, percent in named)


def _knowable(result: CaseResult) -> Iterator[Finding]:
    speeds, v_s = np.abs(result.case.velocity), result.case.truth.v_s
    best = result.methods[REFINED]
    below, declined = int(np.count_nonzero(speeds < v_s)), 100 * result.declined
    spread, bias = (100 * float(x[-1]) / v_s for x in (best.spread, best.bias))
    numbers = {"below": below, "speeds": speeds.size, "declined": declined, "spread": spread}
    if result.not_identifiable:
        yield Finding(
            "v-s-unknowable",
            CRITICAL,
            f"v_s is not identifiable here by any method ({below} of {speeds.size} speeds lie below it): no estimate returned in "
            f"{declined:.3g} % of the repetitions, and the best fit's v_s has a median error of {bias:.3g} % of the true value and "
            f"scatters by {spread:.3g} %. A solver that returns a number all the same returns noise.",
            {**numbers, "bias": bias},
        )
    else:
        yield Finding(
            "v-s-knowable",
            NOTE,
            f"v_s is identifiable here ({below} of {speeds.size} speeds lie below it): its estimates scatter by {spread:.3g} % of the "
            f"true value; no estimate returned in {declined:.3g} % of the repetitions.",
            numbers,
        )


def _against_ipopt(result: CaseResult) -> Iterator[Finding]:
    deficit, shift = result.cost_deficit, result.polish_shift
    if deficit <= SAME_COST:
        starts = result.starts.initial_v_s.size
        yield Finding(
            "ipopt-never-lower",
            NOTE,
            f"From {starts} random starts within the grid's bounds IPOPT never finds a cost below the refined grid's.",
            {"starts": starts},
        )
    else:
        yield Finding(
            "ipopt-undercuts",
            CRITICAL,
            f"IPOPT finds a cost below the refined grid's, by {deficit:.2g} relative; do not use the grid before the cause is known.",
            {"deficit": deficit},
        )
    if result.not_identifiable:
        return
    if shift > _UNMOVED:
        yield Finding(
            "polishing-moves",
            CAUTION,
            f"IPOPT initialised at the grid's estimate moves by up to {shift:.2g} standard errors, at nearly the same cost.",
            {"shift": shift},
        )
    else:
        yield Finding(
            "polishing-stays",
            NOTE,
            f"IPOPT initialised at the grid's estimate stays there, within {shift:.1g} standard errors: the full fit adds nothing.",
            {"shift": shift},
        )


def _other_minima(result: CaseResult) -> Iterator[Finding]:
    starts = result.starts
    other = tuple((name, 100 * float(starts.in_other_minimum(name).mean())) for name in starts.solvers)
    flat = tuple((name, 100 * float(starts.without_peak(name).mean())) for name in starts.solvers)
    if any(share for _, share in other):
        yield Finding(
            "starts-part",
            NOTE,
            f"Random starts that end in another minimum, or before they reach one: {_shares(other)}; without a Stribeck term: "
            f"{_shares(flat)}. The grid needs no start.",
            {"other": other, "flat": flat},
        )
    else:
        yield Finding(
            "starts-agree",
            NOTE,
            f"Every random start of {', '.join(starts.solvers)} ends in the grid's minimum: here the grid's only advantage is its "
            "computing time.",
        )


def _resolution(result: CaseResult) -> Iterator[Finding]:
    if result.not_identifiable:
        return
    resolution, most = result.resolution, f"{100 * FINE_ENOUGH:.3g} %"
    enough, predicted, share = resolution.enough, resolution.predicted, 100 * resolution.share(PLAIN_GRID)
    needed = (
        f"the smallest of the grids tried that stays below {most} has {enough} values "
        f"(a step divided by the root of 12 predicts {predicted})"
        if enough
        else f"to stay below {most} it would need about {predicted} values"
    )
    yield Finding(
        "plain-grid-error",
        NOTE,
        f"The paper's plain grid of {PLAIN_GRID} adds an error of v_s of {share:.3g} % of its standard error; {needed}. The refined "
        "grid adds none.",
        {"share": share, "predicted": predicted} | ({"enough": enough} if enough else {}),
    )


def _outside_range(result: CaseResult) -> Iterator[Finding]:
    outside = result.outside_range
    if outside.any():
        v_s = result.starts.final[FREE][-1][outside]
        low, high = float(v_s.min()), float(v_s.max())
        yield Finding(
            "lower-outside-range",
            CAUTION,
            f"With v_s free, {v_s.size} of {outside.size} starts find a lower cost outside the grid's range, at v_s from {low:.3g} to "
            f"{high:.3g}: there the range determines v_s, not the data.",
            {"count": v_s.size, "starts": outside.size, "low": low, "high": high},
        )


def _times(result: CaseResult) -> Iterator[Finding]:
    """How long each method takes, and whether another is as good and faster."""
    seconds = {name: method.seconds for name, method in result.methods.items()}
    names = (PLAIN_GRIDS[PLAIN_GRID], POLISHED, *(f"{solver}, random start" for solver in result.starts.solvers))
    times = tuple((name, seconds[name] / seconds[REFINED]) for name in names)
    listed = ", ".join(f"{name} {ratio:.2g}" for name, ratio in times)
    message = f"Computing time of one fit relative to the refined grid: {listed}."
    yield Finding("fit-times", NOTE, message, {"times": times})
    faster = (
        values
        for values in result.resolution.counts
        if result.resolution.share(values) <= FINE_ENOUGH and seconds[PLAIN_GRIDS[values]] < 0.9 * seconds[REFINED]
    )
    fewest = next(faster, None)
    if fewest is not None and not result.not_identifiable:
        message = f"A plain grid of {fewest} is faster than the refined grid, and fine enough here."
        yield Finding("plain-grid-enough", NOTE, message, {"values": fewest})
