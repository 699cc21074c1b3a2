"""A fit of arrays as text, for which no figure is imported."""

from collections.abc import Iterator
from math import isnan
from typing import TYPE_CHECKING

from bristle.findings import Severity
from bristle.page.plain import columns, interval, pair, wrapped
from bristle.page.wording import direction

if TYPE_CHECKING:
    from bristle.questions.array_fit.fit import Fit


def text(fit: "Fit") -> str:
    """How the fit ended, its parameters with their errors and 95 % intervals, and what to be careful about; 80 columns wide."""
    ends, frame = fit.conf_int(), fit.to_frame()
    rows = [("parameter", "value +/- standard error", "95 % interval")]
    for name, value in fit.params.items():
        low, high = map(float, ends.loc[name])
        shown = "not identifiable" if isnan(value) else f"{pair(value, fit.stderr[name])} {frame.unit[name]}"
        rows.append((name, shown, "none" if isnan(low + high) else interval((low, high))))
    return "\n".join(wrapped([*outcomes(fit), *columns(rows), *serious(fit)]))


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
