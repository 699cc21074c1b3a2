"""What a trial says, in words: per case and design, and over all."""

from collections.abc import Iterator, Sequence

import numpy as np

from bristle.identification.static.grid import PLAIN_GRID
from bristle.questions.method_validation.results import ENOUGH, FREE, SAME, Trial, Tried
from bristle.questions.method_validation.run import POLISHED, REFINED

_ALIKE = 1e-3
"""A parameter that moves by fewer spreads than this is the same."""


def verdict(tried: Tried) -> tuple[str, ...]:
    """The sentences on one case: whether v_s can be known, grid against full fit, resolution, and what others do better."""
    return (
        *_knowable(tried),
        _against_ipopt(tried),
        *_polished(tried),
        *_wrong_minima(tried),
        *_resolution(tried),
        *_beyond(tried),
        *_elsewhere_better(tried),
    )


def overall(trial: Trial) -> tuple[str, ...]:
    """The sentences on all cases: the claim, then each design."""
    cases = trial.cases
    if not cases:
        return ("Nothing was tried.",)
    worst = max(tried.beaten for tried in cases)
    starts = sum(tried.starts.begun.size for tried in cases)
    fits = starts + sum(tried.methods["IPOPT, random start"].repetitions for tried in cases)
    sets = f"{len(cases)} data set{'s' if len(cases) > 1 else ''}"
    claim = f"{fits} fits by IPOPT from random starts within the grid's bounds, {starts} of them on {sets}"
    if worst <= SAME:
        held = f"{claim}: none undercuts the refined grid's cost by more than {SAME:g}, relative (at most {max(worst, 0.0):.1g})."
    else:
        held = f"{claim}: the refined grid was undercut by up to {worst:.2g}, relative; do not trust it before you know why."
    designs = dict.fromkeys(tried.case.design for tried in cases)
    return (held, *(_design(name, [t for t in cases if t.case.design == name]) for name in designs if len(designs) > 1))


def _design(name: str, cases: Sequence[Tried]) -> str:
    away = {n: float(np.mean([t.starts.elsewhere(n).mean() for t in cases])) for n in _solvers(cases[0])}
    shares = ", ".join(f"{n} {_percent(x)}" for n, x in away.items())
    lost, beyond = sum(t.blind for t in cases), float(np.mean([t.beyond.mean() for t in cases]))
    coarse = sum(t.resolution.share(PLAIN_GRID) > ENOUGH for t in cases if not t.blind)
    rest = f"; in {coarse} of the others a plain grid of {PLAIN_GRID} is too coarse" if lost < len(cases) else ""
    return (
        f"{name}: of random starts end elsewhere {shares}; with v_s free, {_percent(beyond)} find a lower cost beyond the grid's range; "
        f"nobody can know v_s in {lost} of {len(cases)} cases{rest}."
    )


def _solvers(tried: Tried) -> list[str]:
    return [name for name in tried.starts.ended if name != FREE]


def _knowable(tried: Tried) -> Iterator[str]:
    speeds, v_s = np.abs(tried.case.velocity), tried.case.truth.v_s
    below = int(np.count_nonzero(speeds < v_s))
    where = f"{below or 'none'} of the {speeds.size} speeds {'lies' if below < 2 else 'lie'} below v_s"
    best = tried.methods[REFINED]
    of_truth = best.spread[3] / v_s
    declines = _percent(tried.declined)
    if tried.blind:
        yield (
            f"No method can know v_s here ({where}): in {declines} of the repetitions bristle itself declines to give it a finite interval, "
            f"and the best fit's v_s is off by {_percent(best.bias[3] / v_s)} of the truth in the median and scatters by {_percent(of_truth)}. "
            "A solver that returns a number all the same returns noise."
        )
    else:
        yield f"v_s can be known here ({where}): it scatters by {_percent(of_truth)} of the truth; bristle declines in {declines} of the cases."


def _against_ipopt(tried: Tried) -> str:
    count = tried.starts.begun.size
    if tried.beaten <= SAME:
        return f"From {count} random starts within the grid's bounds IPOPT never finds a cost below the refined grid's."
    return f"IPOPT finds a cost below the refined grid's, by {tried.beaten:.2g} relative; do not trust the grid before you know why."


def _polished(tried: Tried) -> Iterator[str]:
    if tried.blind:
        return
    if tried.moved <= _ALIKE:
        yield f"Started from the grid's answer it stays there, within {tried.moved:.1g} standard errors: the full fit adds nothing."
    else:
        yield f"Started from the grid's answer it moves by up to {tried.moved:.2g} standard errors, along a valley of one cost."


def _wrong_minima(tried: Tried) -> Iterator[str]:
    shares = []
    for name in _solvers(tried):
        away, flat = tried.starts.elsewhere(name).mean(), tried.starts.without_peak(name).mean()
        of_it = f" ({_percent(flat)} without a Stribeck term)" if flat else ""
        shares.append(f"{name} {_percent(away)}{of_it}")
    if any(tried.starts.elsewhere(name).any() for name in _solvers(tried)):
        yield f"Of random starts end in another minimum, or short of one: {', '.join(shares)}. The grid has no start."
    else:
        yield f"Every random start of {', '.join(_solvers(tried))} ends in the grid's minimum: here the grid has no advantage but time."


def _resolution(tried: Tried) -> Iterator[str]:
    r = tried.resolution
    if tried.blind:
        return
    cost = f"The paper's plain grid of {PLAIN_GRID} has an error of v_s of {_percent(r.share(PLAIN_GRID))} of its standard error"
    fine = (
        f"the first of the resolutions tried to keep below {_percent(ENOUGH)} is {r.enough}"
        if r.enough
        else "none of the resolutions tried keeps below a tenth"
    )
    yield f"{cost}; {fine} (a step over √12 predicts {r.predicted}). The refined grid has none."


def _beyond(tried: Tried) -> Iterator[str]:
    if tried.beyond.any():
        v_s = tried.starts.ended[FREE][3][tried.beyond]
        ends = f"{v_s.min():.3g}" if tried.beyond.sum() == 1 else f"{v_s.min():.3g} to {v_s.max():.3g}"
        yield (
            f"With v_s free, {int(tried.beyond.sum())} of {tried.beyond.size} starts find a lower cost beyond the grid's range, at v_s = {ends}: "
            "there the range decides, not the data."
        )


def _elsewhere_better(tried: Tried) -> Iterator[str]:
    """Where another method is as good and not slower, and how long each takes."""
    base = tried.methods[REFINED]
    names = [f"plain grid of {PLAIN_GRID}", POLISHED, *(f"{n}, random start" for n in _solvers(tried))]
    yield (
        "Time of one fit, over the refined grid's: "
        + ", ".join(f"{n} {_times(tried.methods[n].seconds / base.seconds)}" for n in names)
        + "."
    )
    quick = [
        n
        for n in tried.resolution.counts
        if tried.resolution.share(n) <= ENOUGH and tried.methods[f"plain grid of {n}"].seconds < 0.9 * base.seconds
    ]
    if quick and not tried.blind:
        yield f"Faster than the refined grid, and fine enough here: a plain grid of {quick[0]}."


def _percent(share: float) -> str:
    return f"{100 * share:.3g} %"


def _times(ratio: float) -> str:
    return f"{ratio:.2g}"
