"""A fit of arrays as text, for which no figure is imported."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from bristle.diagnostics import Severity
from bristle.page.wording import direction

if TYPE_CHECKING:
    from bristle.questions.array_fit.fit import Fit


def text(fit: "Fit") -> str:
    """How the fit ended, its parameters, and what to be careful about."""
    frame = fit.to_frame().drop(columns="warnings")
    return "\n".join([*outcomes(fit), frame.to_string(float_format="{:.5g}".format, na_rep="-"), *serious(fit)])


def outcomes(fit: "Fit") -> Iterator[str]:
    """How each fit of this stage ended."""
    slow, moving = fit.joint.presliding, fit.joint.moving
    if fit.stage == "static":
        for d, static in fit.joint.static.items():
            error = "" if static.relative_error is None else f" Relative error {static.relative_error:.3g} %."
            yield f"{direction(d)}: {static.n} points. {static.outcome}{error}"
    elif fit.stage == "presliding":
        for d, one in slow.fits.items() if slow else ():
            yield f"{direction(d)}: {len(one.loadings)} loadings, g0 = {one.level:.4g} ({one.level_source})"
    elif moving is not None:
        yield f"{moving.n} equations. {moving.outcome} Relative error {moving.relative_error:.3g} %."


def serious(fit: "Fit") -> Iterator[str]:
    """What is critical about it, and what calls for caution."""
    return (f"{w.severity}: {w.coded}" for w in fit.warnings if w.severity is not Severity.NOTE)
