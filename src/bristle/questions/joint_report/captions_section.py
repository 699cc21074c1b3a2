"""What each figure of a joint shows, in a sentence with a number: the beginning of its caption."""

from collections.abc import Iterator, Sequence

import numpy as np

from bristle.identification.results import Joint
from bristle.model.parameters import unit
from bristle.page.wording import WORK, counted, direction, measured, number, pretty, span
from bristle.questions.joint_report.interval_tables import rows


def captions(joint: Joint) -> dict[str, str]:
    """By figure; empty where there is nothing to say."""
    found = {
        "curve": _list(_curve(joint)),
        "profile": _list(_profile(joint)),
        "residuals": _list(_residuals(joint)),
        "presliding": _list(_presliding(joint)),
        "hysteresis": _hysteresis(joint),
        "tracking": _tracking(joint),
        "uncertainty": _uncertainty(joint),
        "comparison": _comparison(joint),
    }
    return {
        name: f"{text[0].upper()}{text[1:]}." if text and name != "comparison" else text for name, text in found.items()
    }


def _list(parts: Iterator[str]) -> str:
    return "; ".join(parts)


def _curve(joint: Joint) -> Iterator[str]:
    for d, fit in joint.static.items():
        if d != "shared" and fit.relative_error is not None:
            yield f"{direction(d)}: the curve leaves {number(fit.relative_error, 2)} % of the torque of {counted(fit.n, 'point')}"


def _profile(joint: Joint) -> Iterator[str]:
    v = pretty(unit("v_s", joint.kind))
    for d, fit in joint.static.items():
        e = fit.parameters.get("v_s")
        if fit.profile is not None and e is not None:
            ends = "" if e.interval is None else f", below its 95 % threshold over {span(e.interval)}"
            yield f"{direction(d)}: the cost is lowest at vₛ = {number(fit.profile.best, 3)} {v}{ends}"


def _residuals(joint: Joint) -> Iterator[str]:
    T = pretty(unit("torque", joint.kind))
    for d, fit in joint.static.items():
        if d != "shared" and fit.residuals.size:
            rms, most = float(np.sqrt(np.mean(fit.residuals**2))), float(np.abs(fit.residuals).max())
            yield f"{direction(d)}: RMS residual {number(rms, 2)} {T}, the largest {number(most, 2)}"


def _presliding(joint: Joint) -> Iterator[str]:
    for d, fit in (joint.presliding.fits if joint.presliding else {}).items():
        e = fit.sigma_0
        if e.value is not None:
            yield f"{direction(d)}: σ₀ = {measured(e.value, e.standard_error)} {pretty(e.unit)}"


def _hysteresis(joint: Joint) -> str:
    losses = [x.loss for x in joint.presliding.loops] if joint.presliding else []
    if not losses:
        return ""
    least, most = number(min(losses), 2), number(max(losses), 2)
    return f"{counted(len(losses), 'closed cycle')} lose {least if least == most else f'{least} to {most}'} {WORK} each"


def _tracking(joint: Joint) -> str:
    fit = joint.moving
    if fit is None:
        return ""
    rms = f"{number(fit.rms, 2)} {pretty(unit(fit.quantity, joint.kind))}"
    return f"the model leaves {rms} RMS, {number(fit.relative_error, 2)} % of the {fit.quantity}"


def _uncertainty(joint: Joint) -> str:
    every = list(rows(joint))
    apart = sum(any(w.code == "intervals-differ" for w in x.three.warnings) for x in every)
    of = f"of {counted(len(every), 'parameter')} of this joint {apart or 'none'}"
    return f"{of} {'has' if apart <= 1 else 'have'} bounds that differ by more than 1.5x"


def _comparison(joint: Joint) -> str:
    """How far the plain grid is from the refined minimum at most."""
    shifts = _shifts(joint)
    return f"the plain grid is {number(max(shifts), 2)} standard errors off at most" if shifts else "side by side"


def _shifts(joint: Joint) -> Sequence[float]:
    return [
        abs(plain - e.value) / e.standard_error
        for fit in joint.static.values()
        for name, e in fit.parameters.items()
        if (plain := fit.plain_grid.get(name)) is not None and e.value is not None and e.standard_error
    ]
