"""What is said of moving runs and of presliding, in sentences that page, text and figures share."""

import math

from bristle.identification.results import Crosscheck, Estimate, Joint, PreslidingFit, TrackingFit
from bristle.model.parameters import Kind, ParameterName, unit
from bristle.page.wording import METHODS, number, pretty, symbol

BIASED = 0.1
"""Of a standard error: what encoder counts add is named where it is more."""


def biased(fit: TrackingFit) -> list[tuple[ParameterName, float, float]]:
    """Parameter, what encoder counts added to it, and that in standard errors, where it is more than `BIASED` of one."""
    found = []
    for name, bias in fit.count_bias.items():
        error = fit.parameters[name].standard_error if name in fit.parameters else None
        if error and abs(bias) > BIASED * error:
            found.append((name, bias, bias / error))
    return found


def bias_text(fit: TrackingFit, name: ParameterName, bias: float, share: float) -> str:
    """What counts added to one parameter: -0.12 N*m/rad (-0.4 standard errors)."""
    return f"{bias:+.3g} {fit.parameters[name].unit} ({share:+.1f} standard errors)"


def reached(fit: TrackingFit) -> str:
    """How many starts found the lowest cost; one sentence."""
    if fit.starts == 1:
        return "It began from the other stages' estimates alone."
    return f"{fit.reached} of {fit.starts} starts reached the lowest cost."


def cost_change(check: Crosscheck, first: str) -> str:
    """How far the costs of the two routes are apart, and how many starts reached the lower one."""
    change = check.cost_full / check.cost_grid - 1 if check.cost_grid else check.cost_full
    apart = (
        f"is {'higher' if change > 0 else 'lower'} by {abs(change):.1g} of {first}'s" if change else f"equals {first}'s"
    )
    return f"the full fit's {apart}; {check.reached} of {check.starts} starts reached it"


def agreement(joint: Joint) -> str:
    """How many parameters agree between their own stage and the moving data; one sentence, empty where there is nothing to compare."""
    known = {x.parameter: abs(x.difference_in_se) for x in joint.consistency if x.difference_in_se is not None}
    if not known:
        return "The moving data show none of the parameters that the other stages know." if joint.consistency else ""
    agreed, unseen = len(known) - sum(x.differs for x in joint.consistency), len(joint.consistency) - len(known)
    said = f"{agreed} of {len(known)} parameters agree between their own stage and the moving data"
    largest = max(known, key=lambda name: known[name])
    rest = f"; {unseen} more cannot be seen in the moving data" if unseen else ""
    return f"{said}; the largest difference is {number(known[largest], 2)} standard errors ({symbol(largest)}){rest}."


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
