"""What is said of moving runs and of presliding, in diagnostics that page and text share."""

import math
from collections.abc import Iterable

from bristle.diagnostics import Kind
from bristle.findings import Finding, Severity
from bristle.identification.fits import Crosscheck, Estimate, PreslidingFit, TrackingFit
from bristle.identification.results import Joint
from bristle.model.parameters import Kind as JointKind
from bristle.model.parameters import ParameterName, unit
from bristle.page.wording import METHODS, measured, number, span

BIASED = 0.1
"""Of a standard error: what encoder counts add is named where it is more."""


def pair(e: Estimate) -> str:
    """Value and standard error, then the systematic error where there is one: 0.30 ± 0.01 ± 0.02 (systematic)."""
    return measured(e.value, e.standard_error) + systematic(e, " ± {} (systematic)")


def systematic(e: Estimate, words: str) -> str:
    """The systematic error in two digits in some words; nothing where no constant has an error, or there is no value."""
    return "" if e.systematic is None or e.value is None else words.format(number(e.systematic, 2))


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


def reached(fit: TrackingFit) -> Finding:
    """How many starts found the lowest cost."""
    return Kind.NO_STARTS() if fit.starts == 1 else Kind.STARTS_REACHED(reached=fit.reached, starts=fit.starts)


def cost_change(check: Crosscheck, first: str) -> Finding:
    """How far the costs of the two routes are apart, and how many starts reached the lower one."""
    change = check.cost_full / check.cost_grid - 1 if check.cost_grid else check.cost_full
    starts = {"first": first, "reached": check.reached, "starts": check.starts}
    if not change:
        return Kind.COST_EQUAL(**starts)
    return (Kind.COST_HIGHER if change > 0 else Kind.COST_LOWER)(change=abs(change), **starts)


def agreement(joint: Joint) -> Finding | None:
    """How many parameters agree between their own stage and the moving data; None where there is nothing to compare."""
    known = {x.parameter: abs(x.difference_in_se) for x in joint.consistency if x.difference_in_se is not None}
    if not known:
        return Kind.NONE_COMPARED() if joint.consistency else None
    agreed, unseen = len(known) - sum(x.differs for x in joint.consistency), len(joint.consistency) - len(known)
    largest = max(known, key=lambda name: known[name])
    more = Kind.MORE_UNSEEN(count=unseen) if unseen else ""
    return Kind.STAGES_COMPARED(agreed=agreed, compared=len(known), largest=known[largest], name=largest, more=more)


def distinct(warnings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Each once, as terminal and page count them."""
    return tuple(dict.fromkeys(warnings))


def critical(joint: Joint) -> dict[Finding, list[tuple[str, ...]]]:
    """What is critical about a joint, which stands first wherever it is shown: each once, with all that it is about."""
    about: dict[Finding, list[tuple[str, ...]]] = {}
    for warning in joint.all_warnings():
        if warning.severity is Severity.CRITICAL:
            about.setdefault(warning, []).append(warning.subject)
    return {warning: list(filter(None, dict.fromkeys(subjects))) for warning, subjects in about.items()}


def critical_titles(joint: Joint) -> dict[Finding, str]:
    """The same with the text that stands before each: `critical`, and what it is about in brackets."""
    named = {warning: ", ".join(" ".join(x) for x in about) for warning, about in critical(joint).items()}
    return {warning: f"critical{f' ({where})' if where else ''}" for warning, where in named.items()}


def methods(fit: PreslidingFit) -> dict[str, Estimate]:
    """The estimates of sigma_0 by the name of their method, in the order of `METHODS`."""
    return {name: getattr(fit, name) for name in METHODS}


def choice(fit: PreslidingFit) -> Finding:
    """Which of the four to use, and why."""
    if fit.sigma_0.value is None:
        low = (fit.sigma_0.interval or (math.nan,))[0]
        return Kind.SIGMA_0_UNKNOWN() if math.isnan(low) else Kind.SIGMA_0_AT_LEAST(least=low, unit=fit.sigma_0.unit)
    return Kind.FROM_TRANSITIONS() if fit.recommended == "edges" else Kind.FROM_SAMPLES()


def level(fit: PreslidingFit, kind: JointKind) -> str:
    """g0 with its error, or as the lower bound that it is, and its unit."""
    at_least = math.isinf(fit.level_standard_error)
    value = measured(fit.level, None if at_least else fit.level_standard_error)
    return f"{'at least ' * at_least}{value} {unit('torque', kind)}"


def median_breakaway(estimate: Estimate) -> Finding:
    """The torque at which half of a direction's loadings slid, with its interval where it has one."""
    ends = "" if estimate.interval is None else Kind.ENDS(ends=span(estimate.interval))
    return Kind.MEDIAN_BREAKAWAY(torque=f"{pair(estimate)} {estimate.unit}", ends=ends)


def bias(fit: PreslidingFit, kind: JointKind) -> Finding:
    """What (14) as printed would be off by with this encoder."""
    if math.isnan(fit.bias_on_edge):
        return Kind.BIAS_UNKNOWN()
    return Kind.BIAS_OF_PRINTED(
        on_edge=fit.bias_on_edge, mean=fit.bias_mean, spread=fit.bias_spread,
        count=fit.quantum, unit=unit("position", kind),
    )  # fmt: skip  # a list of values
