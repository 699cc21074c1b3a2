"""The static fit of moving runs beside the fit of all parameters of the same runs, which knows presliding."""

from collections.abc import Mapping
from dataclasses import replace

from bristle.findings import NOTE, Finding
from bristle.identification.fits import StaticFit, TrackingFit


def beside_moving(static: Mapping[str, StaticFit], moving: TrackingFit | None) -> dict[str, StaticFit]:
    """The static fits of moving runs; where the fit of all parameters of the same runs knows their friction, their outcome says so.

    A static law is LuGre's with a bristle that does not bend: the poorer model of the same runs, whose errors do not know what
    presliding does to it. One fit gives a joint's values; what is said of the other is then no reason to doubt them. One that
    estimated nothing says why, as before.
    """
    if moving is None or all(e.value is None for name, e in moving.parameters.items() if name.name == "alpha_0"):
        return dict(static)
    found = dict(static)
    for d, fit in static.items():
        if fit.relative_error is not None:
            message = (
                f"Without presliding, of which its errors know nothing: the relative error is {fit.relative_error:.2g} %, and "
                f"{moving.relative_error:.2g} % with it. Use the fit of all parameters of the moving runs, not these numbers."
            )
            numbers = {"error": fit.relative_error, "other": moving.relative_error}
            found[d] = replace(fit, outcome=Finding("static-superseded", NOTE, message, numbers), warnings=())
    return found


def is_superseded(fit: StaticFit) -> bool:
    """Whether the fit of all parameters of the same runs is the one to use."""
    return fit.outcome.code == "static-superseded"
