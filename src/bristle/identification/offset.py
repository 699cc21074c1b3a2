"""An offset of the torque, or friction that differs between the directions: what two frictions that differ by a constant may be."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.linalg import block_diag
from scipy.special import fdtrc

from bristle.arrays import Array
from bristle.data.experiment.load import Experiment
from bristle.estimation.levels import RARE
from bristle.findings import CAUTION, NOTE, Finding, unit_of
from bristle.identification.fits import StaticFit
from bristle.identification.moving_runs import DIRECTIONS
from bristle.identification.static.fit import is_superseded
from bristle.identification.static.points import point_regressors
from bristle.model.parameters import SIGNED, Direction, ParameterName

_LEAST = 0.01  # of alpha_0: a smaller offset is not worth a sentence


def offset_or_friction(
    names: Sequence[Any], values: Mapping[Any, float], covariance: Array, freedom: float
) -> list[Finding]:
    """A difference of the two directions that is one of alpha_0 alone, as an offset of the torque makes it.

    Wald tests: the directions agree on all else that a curve has, and with these made equal they differ in alpha_0. `names` of p
    unknowns are in the order of the covariance, (p, p), with its degrees of freedom; those that are no `ParameterName` do not matter.
    """
    order = {name: k for k, name in enumerate(names)}
    pairs = [[ParameterName(name, d) for d in SIGNED] for name in ("alpha_0", "alpha_1", "alpha_2", "v_s")]
    told = {name for name, k in order.items() if np.isfinite(covariance[k]).all()}
    free = [pair for pair in pairs if told.issuperset(pair)]
    if pairs[0] not in free:
        return []
    plus, minus = (np.array([order[pair[k]] for pair in free]) for k in (0, 1))
    apart = np.array([values[a] - values[b] for a, b in free])
    (S_pp, S_pm), (S_mp, S_mm) = ([covariance[np.ix_(a, b)] for b in (plus, minus)] for a in (plus, minus))
    S = S_pp + S_mm - S_pm - S_mp
    weight = np.linalg.pinv(S[1:, 1:], hermitian=True)
    others, rest = float(apart[1:] @ weight @ apart[1:]), len(free) - 1
    twice = float(apart[0] - S[0, 1:] @ weight @ apart[1:])
    variance = float(S[0, 0] - S[0, 1:] @ weight @ S[1:, 0])
    a, b = (float(values[name]) for name in pairs[0])
    common = (a + b) / 2
    if abs(twice) < 2 * _LEAST * common or not variance > 0:
        return []
    if (rest and fdtrc(rest, freedom, others / rest) < RARE) or fdtrc(1, freedom, twice**2 / variance) > RARE:
        return []
    T = unit_of("torque")
    message = (
        f"The torque of the two directions differs by a constant. Either it has an offset of {twice / 2:.3g}{T}, and alpha_0 is "
        f"{common:.4g}{T} in both (`directions: symmetric`, and offset among the regressors, under fit); or friction differs, with alpha_0 "
        f"{a:.4g}{T} (+) and {b:.4g}{T} (-). The data cannot tell which."
    )
    numbers = {"offset": twice / 2, "common": common, "plus": a, "minus": b}
    return [Finding("offset-or-friction", CAUTION, message, numbers)]


def offset_of_points(experiment: Experiment, static: Mapping[str, StaticFit]) -> list[Finding]:
    """The same of two fits of points; where they differ in more than a constant, a note what it would be."""
    fits = [static[d] for d in DIRECTIONS if d in static]
    if experiment.fit.directions != "separate" or len(fits) < 2 or any(map(is_superseded, fits)):
        return []
    if not point_regressors(experiment):
        names = [ParameterName(name, Direction(fit.direction)) for fit in fits for name in fit.names]
        values = {name: static[name.direction].parameters[name.name].value or 0.0 for name in names}
        both = block_diag(*(fit.covariance for fit in fits))
        if found := offset_or_friction(names, values, both, min(fit.degrees_of_freedom or 0 for fit in fits)):
            return found
    levels = (fit.parameters["alpha_0"] for fit in fits)
    (plus, one), (minus, other) = ((e.value, e.standard_error or 0.0) for e in levels)
    if plus is None or minus is None or abs(plus - minus) < 2 * np.hypot(one, other):
        return []
    offset, common, T = (plus - minus) / 2, (plus + minus) / 2, unit_of("torque")
    message = (
        f"An offset of the torque cannot be told from a difference of alpha_0, and is not fitted. If alpha_0 were {common:.4g}{T} in both "
        f"directions, the offset would be {offset:.3g}{T}: see whether the torque is zero where nothing loads the joint."
    )
    return [Finding("offset-left-out", NOTE, message, {"offset": offset, "common": common})]
