"""Findings that fits of points and of motion have in common, and the codes by which a motion refuses a parameter."""

from collections.abc import Iterable

from bristle.findings import CAUTION, NOTE, Finding, in_direction, unit_of
from bristle.model.parameters import Lugre

UNRESOLVED = frozenset({
    "unseen-unconverged", "unseen-below-count", "unseen-no-reversal", "unseen-fast", "unseen-halves",
    "unseen-companion", "unseen-in-counts", "unseen-biased", "unseen-too-few", "unseen-shape", "unseen-inertia",
})  # fmt: skip  # a list of values
"""Kinds that leave no interval either: what was fitted is not what the parameter means."""
NOT_IDENTIFIABLE = UNRESOLVED | {
    "unseen-wide", "unseen-far", "unseen-bend", "unseen-peak", "unseen-no-peak",
}  # fmt: skip  # a list of values
"""Kinds by which a motion refuses a parameter."""


AT_BOUND = Finding("at-bound", CAUTION, "At its physical bound of zero: the interval is one-sided.")  # of an estimate
TAKES_UP_PEAK = Finding(
    "takes-up-peak",
    CAUTION,
    "It takes up part of a Stribeck term that these speeds show but do not bound: it describes the measured speeds, and no others.",
)
"""Of a parameter beside a Stribeck term that is there, and left out."""


def curve_held(fastest: float) -> Finding:
    """Of viscous friction that bends down, with the fastest speed that was measured, rad/s."""
    message = (
        f"Viscous friction bends down with speed (alpha_3 < 0). Faster than {fastest:.3g}{unit_of('velocity')}, the fastest speed "
        "measured, it is taken to stay as large as there."
    )
    return Finding("curve-held", CAUTION, message, {"fastest": fastest})


def not_passive(p: Lugre[float], direction: str) -> Finding:
    """Of parameters of one direction that are not passive (`law.is_passive`)."""
    least, of = p.sigma_1 * p.alpha_1 / p.alpha_0, unit_of("alpha_2")
    message = (
        f"The model can feed energy back{in_direction(direction)}: alpha_2 = {p.alpha_2:.3g}{of} is below sigma_1 alpha_1 / alpha_0 = "
        f"{least:.3g}{of}. The fit stands; test a compensator that uses it with care."
    )
    return Finding("not-passive", CAUTION, message, {"direction": direction, "alpha_2": p.alpha_2, "least": least})


def not_shown(names: Iterable[object]) -> tuple[Finding, ...]:
    """That the motion does not show these parameters, if there are any."""
    unseen = tuple(map(str, names))
    message = f"Not identifiable from this motion: {', '.join(unseen)}."
    return (Finding("unseen", NOTE, message, {"names": unseen}),) if unseen else ()
