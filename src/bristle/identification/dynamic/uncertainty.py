"""The 95 % intervals of a fit of moving data three ways: covariance, profile, bootstrap of blocks; and where they part.

What encoder counts add is taken off after the fit (`counts`): the estimate is moved, and its error widened by a factor. The profile's ends and the
bootstrap's draws, which know nothing of it, are moved and spread about the estimate in the same way; an end that is open stays so.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.diagnostics import Diagnostic, Kind
from bristle.estimation import interval_comparison
from bristle.estimation.bootstrap import ENOUGH, FEW, SHOWN, Resampled, bootstrap_at, too_few
from bristle.estimation.profile_likelihood import Profiled, profiles
from bristle.identification.dynamic.fit import SEED, Tracked
from bristle.identification.results import Estimate, TrackingFit, Uncertainty
from bristle.progress import Progress

_RESTARTS = 3

Again = Callable[[Mapping[str, float]], Tracked]
"""The fit done again, also from a start with every unknown in it."""


def explored(found: Tracked, again: Again, progress: Progress | None = None) -> tuple[Tracked, Mapping[str, Profiled]]:
    """The profile of each parameter, and the fit: done again, and saying so, where a profile found a better optimum."""
    said: tuple[Diagnostic, ...] = ()
    for refits in range(_RESTARTS + 1):
        own = found.judged
        seen, better = profiles(
            own.posed, own.minimum, own.scaled_errors, own.freedom, progress, stop_at_better=refits < _RESTARTS
        )
        if better is None:
            break
        end = own.posed.unknowns.values(better)
        found, said = again({**found.problem.fixed, **end}), (Kind.REFITTED(),)
    if refits == _RESTARTS:
        said = (*said, Kind.STILL_LOWER(fits=_RESTARTS))
    return found._replace(fit=replace(found.fit, doubts=(*found.fit.doubts, *said))), seen


def with_three_ways(
    found: Tracked, fit: TrackingFit, profiles: Mapping[str, Profiled], seed: int = SEED
) -> TrackingFit:
    """The fit with each parameter's intervals three ways.

    Args:
        found: as it was profiled.
        fit: the same, the bias of encoder counts taken off.
        profiles: by name.
        seed: of the bootstrap.
    """
    free = _inside(found)
    drawn = bootstrap_at(found.judged.posed, found.judged.minimum, free, seed)
    columns = [found.problem.names[j] for j in free.tolist()]
    three = {}
    for name, e in fit.parameters.items():
        if name in profiles:
            steps = _steps(found, name, drawn, columns.index(name)) if name in columns else None
            three[name] = _three(found, name, e, profiles[name], steps, drawn.blocks)
        else:
            three[name] = Uncertainty(
                covariance=None, profile=None, bootstrap=None, doubts=(*e.doubts, Kind.NOT_FITTED())
            )
    parted = {name: replace(e, doubts=(*e.doubts, *_new(e, three[name]))) for name, e in fit.parameters.items()}
    return replace(fit, parameters=parted, uncertainty=three)


def _new(e: Estimate, three: Uncertainty) -> tuple[Diagnostic, ...]:
    """What the three intervals let doubt of an estimate, and has not been said."""
    return () if e.value is None else tuple(doubt for doubt in three.doubts if doubt not in e.doubts)


def _three(
    found: Tracked, name: str, e: Estimate, profile: Profiled, steps: tuple[Array, Array] | None, blocks: int
) -> Uncertainty:
    """One parameter's intervals, and where they part; `steps` are the ends of the bootstrap's interval, and its draws."""
    moved = _moved(found, name, e)
    ends = moved(np.array(profile.interval))
    low, high = ends.tolist()
    drawn = None if steps is None or blocks < FEW else moved(steps[0])
    at_bound = found.values[name] == 0
    few = Kind.RESIDUAL_BLOCKS(blocks=blocks)
    doubts = profile.doubts
    if at_bound:
        doubts = (*doubts, Kind.NO_BOOTSTRAP_AT_BOUND())
    elif blocks < FEW:
        doubts = (*doubts, too_few(few))
    bootstrap = None if drawn is None else (float(drawn[0]), float(drawn[1]))
    if e.value is not None:
        doubts = (
            *doubts,
            *interval_comparison.doubts(
                e.value, e.interval, (low, high), bootstrap, at_bound=at_bound, few=few if blocks < ENOUGH else None
            ),
        )
    curve = np.stack([moved(profile.curve[0]), profile.curve[1]])
    seen = profile.curve.size > 0
    return Uncertainty(
        covariance=e.interval if seen else None,
        profile=(low, high),
        bootstrap=bootstrap,
        curve=curve,
        draws=np.zeros(0) if steps is None else moved(steps[1][:SHOWN]),
        doubts=doubts,
    )


def _moved(found: Tracked, name: str, e: Estimate) -> Callable[[Array], Array]:
    """What takes the bias of counts off values of a parameter, and spreads them as it widens the error; ends that are open stay."""
    value, limits = found.values[name], _limits(found, name)
    new, wider = value if e.value is None else e.value, 1.0
    error = found.fit.parameters[name].standard_error
    if e.standard_error and error:
        wider = e.standard_error / error

    def moved(x: Array) -> Array:
        """Values moved, none beyond what the parameter may be, (k,) -> (k,)."""
        inside = np.where(np.isfinite(x), x, value)
        return np.where(np.isin(x, limits), x, np.clip(new + (inside - value) * wider, *limits))

    return moved


def _limits(found: Tracked, name: str) -> tuple[float, float]:
    """What a parameter may be at all."""
    return float(found.judged.posed.unknowns.least[found.problem.names.index(name)]), np.inf


def _inside(found: Tracked) -> NDArray[np.intp]:
    """The parameters that data show and that lie at no bound."""
    judged, x = found.judged, found.judged.minimum.x
    unknowns, shared = judged.posed.unknowns, judged.posed.shared
    inside = np.isfinite(judged.scaled_errors) & (unknowns.lower < x) & (x < unknowns.upper)
    return shared[inside[shared]]


def _steps(found: Tracked, name: str, drawn: Resampled, column: int) -> tuple[Array, Array]:
    """The ends of a parameter's interval by bootstrap-t, (2,), and its draws, (b,), in its unit; what leaves its range is open."""
    j, unknowns = found.problem.names.index(name), found.judged.posed.unknowns
    x, lower, upper = (float(each[j]) for each in (found.judged.minimum.x, unknowns.lower, unknowns.upper))
    ends = x + np.array(drawn.interval(column, float(found.judged.scaled_errors[j])))
    open_ends = [ends[0] <= lower, ends[1] >= upper]
    draws = unknowns.natural_of(j, np.clip(x + drawn.steps[:, column], lower, upper))
    inside = unknowns.natural_of(j, np.clip(ends, lower, upper))
    return np.where(open_ends, _limits(found, name), inside), draws
