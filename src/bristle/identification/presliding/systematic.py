"""What errors of constants do to the estimates of slow loading."""

from collections.abc import Mapping, Sequence

import numpy as np

from bristle.data.slow_loading import Loading
from bristle.identification.fits import Estimate
from bristle.identification.presliding.stiffness import KnownValue, by_edges, by_level, by_samples, first_torques
from bristle.identification.systematic import shifted
from bristle.model import functions
from bristle.model.vectorize import evaluate


def torque_shares(loadings: Sequence[Loading]) -> dict[str, float]:
    """Relative change of the torque of some loadings per standard error of each constant: the mean, by their torque."""
    weight = [float(np.square(loading.torque).sum()) for loading in loadings]
    names = dict.fromkeys(name for loading in loadings for name in loading.shares)
    shares = {name: [loading.shares.get(name, 0.0) for loading in loadings] for name in names}
    return {name: float(np.average(share, weights=weight)) for name, share in shares.items()}


def with_shifts(
    estimates: Mapping[str, Estimate], loadings: Sequence[Loading], level: KnownValue
) -> dict[str, Estimate]:
    """The estimates of `stiffness` with what errors of constants do to them.

    Where torque and g0 grow by one factor, so does sigma_0: a torque that grows by e does to it what g0 less by e does,
    and e of its value beside. A g0 that is a lower bound is a torque of these loadings, and grows with them.
    """
    shares = torque_shares(loadings)
    constants = (*dict.fromkeys((*shares, *level.shifts)),)
    if not constants:
        return dict(estimates)
    moved = {c: level.shifts.get(c, 0.0) - level.value * shares.get(c, 0.0) for c in constants}
    slopes: dict[str, float] = {}  # by g0, on which (14) as printed does not depend
    if not level.is_bound:
        slopes = {"edges": by_level(by_edges, loadings, level), "samples": by_level(by_samples, loadings, level)}
        quantum, first = max(loading.quantum for loading in loadings), first_torques(loadings, level.value)
        if quantum > 0 and first.size:
            by_g0 = evaluate(functions.loading_displacement_function(), first, level.value, 1.0)[1]
            slopes["corrected"] = float(np.mean(by_g0)) / quantum
    return {
        name: shifted(
            e, {c: (e.value or 0.0) * shares.get(c, 0.0) + slopes.get(name, 0.0) * moved[c] for c in constants}
        )
        for name, e in estimates.items()
    }
