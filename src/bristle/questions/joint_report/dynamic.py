"""What is said of moving runs, in sentences that page, text and figures share; and their warnings."""

from collections.abc import Iterator

from bristle.diagnostics import Diagnostic, Kind
from bristle.identification.known_joint import moving_fits
from bristle.identification.results import Consistency, Joint, TrackingFit
from bristle.model.parameters import ParameterName
from bristle.page.wording import FITS, number, symbol

_DIFFER = {Kind.STAGE_DIFFERS, Kind.DISTRUST_MOVING, Kind.DISTRUST_STAGE}
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


def differing(joint: Joint) -> list[Consistency]:
    """The comparisons in which stage and moving data differ by more than chance."""
    return [x for x in joint.consistency if x.verdict.kind in _DIFFER]


def agreement(joint: Joint) -> str:
    """How many parameters agree between their own stage and the moving data; one sentence, empty where there is nothing to compare."""
    known = {x.parameter: abs(x.difference_in_se) for x in joint.consistency if x.difference_in_se is not None}
    if not known:
        return "The moving data show none of the parameters that the other stages know." if joint.consistency else ""
    agreed, unseen = len(known) - len(differing(joint)), len(joint.consistency) - len(known)
    said = f"{agreed} of {len(known)} parameters agree between their own stage and the moving data"
    largest = max(known, key=lambda name: known[name])
    rest = f"; {unseen} more cannot be seen in the moving data" if unseen else ""
    return f"{said}; the largest difference is {number(known[largest], 2)} standard errors ({symbol(largest)}){rest}."


def moving_warnings(joint: Joint) -> Iterator[tuple[str, Diagnostic]]:
    """Every warning about the moving runs with what it is about: of the fits, of single parameters, and of stages that differ."""
    for kind, fit in moving_fits(joint).items():
        yield from fit_warnings(FITS[kind], fit)
    for x in differing(joint):
        yield f"{x.parameter} of {x.stage} stage and moving runs", x.verdict


def fit_warnings(where: str, fit: TrackingFit) -> Iterator[tuple[str, Diagnostic]]:
    """Warnings about one fit, then those about one parameter alone."""
    yield from ((where, warning) for warning in fit.warnings)
    for name, e in fit.parameters.items():
        yield from ((f"{where} {name}", warning) for warning in e.warnings if warning not in fit.warnings)
