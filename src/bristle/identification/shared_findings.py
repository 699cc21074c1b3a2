"""Findings common to fits of points and of motion."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.special import fdtrc

from bristle.arrays import Array
from bristle.estimation import levels
from bristle.findings import CAUTION, CRITICAL, NOTE, Finding, in_direction, unit_of
from bristle.identification.fits import Crosscheck
from bristle.model.parameters import SIGNED, Lugre, ParameterName

UNRESOLVED = frozenset({
    "unseen-unconverged", "unseen-below-count", "unseen-no-reversal", "unseen-fast", "unseen-halves",
    "unseen-companion", "unseen-in-counts", "unseen-biased", "unseen-too-few", "unseen-shape", "unseen-inertia",
})  # fmt: skip  # a list of values
"""Codes that refuse a parameter and its interval."""
NOT_IDENTIFIABLE = UNRESOLVED | {
    "unseen-wide", "unseen-bend", "unseen-peak", "unseen-no-peak",
}  # fmt: skip  # a list of values
"""Codes that refuse a parameter."""


AT_BOUND = Finding("at-bound", CAUTION, "At its physical bound of zero: the interval is one-sided.")  # of an estimate
TAKES_UP_PEAK = Finding(
    "takes-up-peak",
    CAUTION,
    "It takes up part of a Stribeck term that these speeds show but do not bound: it describes the measured speeds, and no others.",
)
"""Of a parameter beside an omitted Stribeck term."""


def curve_held(fastest: float) -> Finding:
    """A caution on viscous friction that bends down beyond the fastest measured speed, rad/s."""
    message = (
        f"Viscous friction bends down with speed (alpha_3 < 0). Faster than {fastest:.3g}{unit_of('velocity')}, the fastest speed "
        "measured, it is taken to stay as large as there."
    )
    return Finding("curve-held", CAUTION, message, {"fastest": fastest})


def not_passive(p: Lugre[float], direction: str, *, surely: bool = True) -> Finding:
    """A caution on parameters of one direction that are not passive (`law.is_passive`); a note if they are within their errors."""
    least, of = p.sigma_1 * p.alpha_1 / p.alpha_0, unit_of("alpha_2")
    message = (
        f"The model can feed energy back{in_direction(direction)}: alpha_2 = {p.alpha_2:.3g}{of} is below sigma_1 alpha_1 / alpha_0 = "
        f"{least:.3g}{of}. The fit stands; test a compensator that uses it with care."
    )
    numbers = {"direction": direction, "alpha_2": p.alpha_2, "least": least}
    if surely:
        return Finding("not-passive", CAUTION, message, numbers)
    return Finding("perhaps-not-passive", NOTE, f"{message} Within the errors of its values it may not.", numbers)


def not_shown(names: Iterable[object]) -> tuple[Finding, ...]:
    """A note on parameters that the motion does not show."""
    unseen = tuple(map(str, names))
    message = f"Not identifiable from this motion: {', '.join(unseen)}."
    return (Finding("unseen", NOTE, message, {"names": unseen}),) if unseen else ()


def crosschecked(
    first: str,
    values: Mapping[ParameterName, float],
    cost: float,
    errors: Mapping[ParameterName, float | None],
    minima: Sequence[Mapping[Any, float]],
    costs: Sequence[float],
    same: float,
) -> Crosscheck:
    """The comparison of a full nonlinear fit with the `first` route; costs closer than `same` are equal."""
    full, starts = min(costs), len(costs)
    found, reached = minima[costs.index(full)], sum(one <= full + same for one in costs)
    known = {name: error for name, error in errors.items() if name in found and error and np.isfinite(error)}
    apart = {name: (found[name] - values[name]) / error for name, error in known.items()}
    many = f"{reached} of {starts} random starts of the full fit reached its lowest cost."
    numbers: dict[str, float] = {"full": full, "cost": cost, "reached": reached, "starts": starts}
    if agrees := abs(full - cost) <= same:
        worst = max(map(abs, apart.values()), default=0.0)
        message = f"{first} and full nonlinear fit agree: the largest difference is {worst:.2g} standard errors. {many}"
        verdict = Finding("routes-agree", NOTE, message, {**numbers, "worst": worst})
    elif full < cost:
        message = (
            f"The full nonlinear fit found a lower cost than this one ({full:.6g} against {cost:.6g}); use neither before the cause "
            f"is known. {many}"
        )
        verdict = Finding("full-fit-lower", CRITICAL, message, numbers)
    else:
        message = f"The full nonlinear fit did not reach as low a cost ({full:.6g} against {cost:.6g}), so it confirms nothing. {many}"
        verdict = Finding("full-fit-higher", NOTE, message, numbers)
    return Crosscheck(
        parameters={name: x for name, x in found.items() if name in errors},
        difference_in_se=apart, verdict=verdict, agrees=agrees,
    )  # fmt: skip  # a list of values


def offset_or_friction(
    names: Sequence[Any], values: Mapping[Any, float], covariance: Array, freedom: float
) -> list[Finding]:
    """A finding where the directions differ by a constant alone (Wald tests); `names` as in the covariance."""
    pairs = [[ParameterName(name, d) for d in SIGNED] for name in ("alpha_0", "alpha_1", "alpha_2", "v_s")]
    told = [
        k for k, name in enumerate(names) if any(name in pair for pair in pairs) and np.isfinite(covariance[k]).all()
    ]
    free = [pair for pair in pairs if {names[k] for k in told}.issuperset(pair)]
    if pairs[0] not in free:
        return []
    # + minus - of each parameter, and their covariance; alpha_0 given that all others are equal
    D = np.array([[(names[k] == a) - float(names[k] == b) for k in told] for a, b in free])
    apart, S = D @ [values[names[k]] for k in told], D @ covariance[np.ix_(told, told)] @ D.T
    weight, rest = np.linalg.pinv(S[1:, 1:], hermitian=True), len(free) - 1
    others = float(apart[1:] @ weight @ apart[1:])
    twice = float(apart[0] - S[0, 1:] @ weight @ apart[1:])
    variance = float(S[0, 0] - S[0, 1:] @ weight @ S[1:, 0])
    a, b = (float(values[name]) for name in pairs[0])
    common = (a + b) / 2
    if abs(twice) < 2 * levels.MATTERS * common or not variance > 0:
        return []
    if (rest and fdtrc(rest, freedom, others / rest) < levels.RARE) or fdtrc(
        1, freedom, twice**2 / variance
    ) > levels.RARE:
        return []
    T = unit_of("torque")
    message = (
        f"The torque of the two directions differs by a constant. Either it has an offset of {twice / 2:.3g}{T}, and alpha_0 is "
        f"{common:.4g}{T} in both (`directions: symmetric`, and offset among the regressors, under fit); or friction differs, with alpha_0 "
        f"{a:.4g}{T} (+) and {b:.4g}{T} (-). The data cannot tell which."
    )
    numbers = {"offset": twice / 2, "common": common, "plus": a, "minus": b}
    return [Finding("offset-or-friction", CAUTION, message, numbers)]
