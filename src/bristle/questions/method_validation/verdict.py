"""What a validation says, as diagnostics: of one case, and over all."""

from collections.abc import Iterator, Sequence

import numpy as np

from bristle.diagnostics import Kind
from bristle.findings import Finding
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
        return (Kind.NOTHING_TRIED(),)
    deficit = max(result.cost_deficit for result in results)
    starts = sum(result.starts.initial_v_s.size for result in results)
    fits = starts + sum(result.methods["IPOPT, random start"].repetitions for result in results)
    if deficit <= SAME_COST:
        claim = Kind.NEVER_UNDERCUT(fits=fits, starts=starts, same=SAME_COST, deficit=max(deficit, 0.0))
    else:
        claim = Kind.UNDERCUT(fits=fits, starts=starts, deficit=deficit)
    designs = list(dict.fromkeys(result.case.design for result in results))
    if len(designs) == 1:
        return (claim,)
    return (claim, *(_design(name, [x for x in results if x.case.design == name]) for name in designs))


def _design(name: str, results: Sequence[CaseResult]) -> Finding:
    knowable = [result for result in results if not result.not_identifiable]
    return Kind.DESIGN_VALIDATED(
        design=name,
        other=tuple(
            (solver, 100 * float(np.mean([x.starts.in_other_minimum(solver).mean() for x in results])))
            for solver in results[0].starts.solvers
        ),
        outside=100 * float(np.mean([result.outside_range.mean() for result in results])),
        unknowable=len(results) - len(knowable),
        cases=len(results),
        coarse=sum(result.resolution.share(PLAIN_GRID) > FINE_ENOUGH for result in knowable),
        values=PLAIN_GRID,
    )


def _knowable(result: CaseResult) -> Iterator[Finding]:
    speeds, v_s = np.abs(result.case.velocity), result.case.truth.v_s
    best = result.methods[REFINED]
    facts = {
        "below": int(np.count_nonzero(speeds < v_s)),
        "speeds": speeds.size,
        "declined": 100 * result.declined,
        "spread": 100 * best.spread[-1] / v_s,
    }
    if result.not_identifiable:
        yield Kind.V_S_UNKNOWABLE(**facts, bias=100 * best.bias[-1] / v_s)
    else:
        yield Kind.V_S_KNOWABLE(**facts)


def _against_ipopt(result: CaseResult) -> Iterator[Finding]:
    if result.cost_deficit <= SAME_COST:
        yield Kind.IPOPT_NEVER_LOWER(starts=result.starts.initial_v_s.size)
    else:
        yield Kind.IPOPT_UNDERCUTS(deficit=result.cost_deficit)
    if not result.not_identifiable:
        moved = result.polish_shift > _UNMOVED
        yield (Kind.POLISHING_MOVES if moved else Kind.POLISHING_STAYS)(shift=result.polish_shift)


def _other_minima(result: CaseResult) -> Iterator[Finding]:
    starts = result.starts
    other = tuple((name, 100 * float(starts.in_other_minimum(name).mean())) for name in starts.solvers)
    flat = tuple((name, 100 * float(starts.without_peak(name).mean())) for name in starts.solvers)
    if any(share for _, share in other):
        yield Kind.STARTS_PART(other=other, flat=flat)
    else:
        yield Kind.STARTS_AGREE(solvers=tuple(starts.solvers))


def _resolution(result: CaseResult) -> Iterator[Finding]:
    resolution, most = result.resolution, 100 * FINE_ENOUGH
    if not result.not_identifiable:
        yield Kind.PLAIN_GRID_ERROR(
            values=PLAIN_GRID,
            share=100 * resolution.share(PLAIN_GRID),
            enough=Kind.FINE_GRID(most=most, values=resolution.enough, predicted=resolution.predicted)
            if resolution.enough
            else Kind.NO_FINE_GRID(most=most, predicted=resolution.predicted),
        )


def _outside_range(result: CaseResult) -> Iterator[Finding]:
    outside = result.outside_range
    if outside.any():
        v_s = result.starts.final[FREE][-1][outside]
        yield Kind.LOWER_OUTSIDE_RANGE(count=outside.sum(), starts=outside.size, low=v_s.min(), high=v_s.max())


def _times(result: CaseResult) -> Iterator[Finding]:
    """How long each method takes, and whether another is as good and faster."""
    seconds = {name: method.seconds for name, method in result.methods.items()}
    names = (PLAIN_GRIDS[PLAIN_GRID], POLISHED, *(f"{solver}, random start" for solver in result.starts.solvers))
    yield Kind.FIT_TIMES(times=tuple((name, seconds[name] / seconds[REFINED]) for name in names))
    faster = (
        values
        for values in result.resolution.counts
        if result.resolution.share(values) <= FINE_ENOUGH and seconds[PLAIN_GRIDS[values]] < 0.9 * seconds[REFINED]
    )
    fewest = next(faster, None)
    if fewest is not None and not result.not_identifiable:
        yield Kind.PLAIN_GRID_ENOUGH(values=fewest)
