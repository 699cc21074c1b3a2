"""What is said of presliding, in sentences that page, text and figures share; and its warnings."""

import math
from collections.abc import Iterator

from bristle.diagnostics import Diagnostic
from bristle.identification.results import Estimate, Joint, PreslidingFit
from bristle.model.parameters import Kind, unit
from bristle.page.wording import METHODS, direction, number, pretty


def methods(fit: PreslidingFit) -> dict[str, Estimate]:
    """The estimates of sigma_0 by the name of their method, in the order of `METHODS`."""
    return {name: getattr(fit, name) for name in METHODS}


def choice(fit: PreslidingFit) -> str:
    """Which of the four to use, and why; one sentence."""
    if fit.sigma_0.value is None:
        low = (fit.sigma_0.interval or (math.nan,))[0]
        return (
            "No sigma_0 can be given."
            if math.isnan(low)
            else f"No sigma_0 can be given; it is at least {low:.3g} {fit.sigma_0.unit}."
        )
    if fit.recommended == "edges":
        return "Use the edges: from count edge to count edge it does not matter where inside a count the joint rests, which nobody knows."
    return "Use the samples: no counts are seen in the displacement, so there are no edges to go by."


def bias(fit: PreslidingFit, kind: Kind) -> str:
    """What (14) as printed would be off by with this encoder; one sentence."""
    if math.isnan(fit.bias_on_edge):
        return "unknown: that needs encoder counts and a sigma_0."
    on_edge, mean, spread = (100 * x for x in (fit.bias_on_edge, fit.bias_mean, fit.bias_spread))
    count = f"{number(fit.quantum)} {pretty(unit('position', kind))}"
    anywhere = f"{mean:+.0f} % on average, with a spread of {spread:.0f} %, where it rests anywhere in a count"
    return f"{on_edge:+.1f} % where the joint rests on a count edge; {anywhere} (one count is {count}; noise in the torque comes on top)."


def presliding_warnings(fit: PreslidingFit, breakaway: Estimate | None) -> Iterator[tuple[str, Diagnostic]]:
    """Every warning about one direction, with what it is about: those about the fit, then those about one estimate alone."""
    named = {f"sigma_0 {name}": e for name, e in methods(fit).items()} | {"sigma_1": fit.sigma_1}
    where = f"presliding {direction(fit.direction)}"
    yield from ((where, warning) for warning in fit.warnings)
    for name, e in {**named, **({"breakaway": breakaway} if breakaway else {})}.items():
        yield from ((f"{where} {name}", warning) for warning in e.warnings if warning not in fit.warnings)


def whole_warnings(joint: Joint) -> tuple[Diagnostic, ...]:
    """Warnings about the presliding runs as a whole."""
    return joint.presliding.warnings if joint.presliding else ()
