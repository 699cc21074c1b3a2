"""The static fit of moving runs beside the fit of all parameters of the same runs, which knows presliding."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.special import ndtri

from bristle.findings import CAUTION, NOTE, Finding, Severity
from bristle.identification.fits import Estimate, StaticFit, TrackingFit
from bristle.identification.repeats import spreader, wider_three
from bristle.identification.systematic import NORMAL, combined, statistical
from bristle.model.parameters import Direction, ParameterName, least_of, of_curve, peak_parameters

_LEVEL = 1e-3
"""Probability, by chance, that any of the parameters differs."""
_LEFT = 0.9
"""Presliding matters where LuGre's fit leaves less than this share of what the static law leaves of the torque, in power."""
_NO_DOUBT = {
    "unseen", "nothing-seen", "hardly-seen", "only-as-sum", "only-against", "only-sum-seen-of-fit", "not-passive",
    "count-bias",
}  # fmt: skip  # a list of values
"""Warnings about LuGre's fit that leave the numbers it gives as they are."""
_NO_PEAK = {"unseen-peak", "unseen-no-peak", "unseen-wide", "unseen-far", "unseen-bend"}
"""Why LuGre's fit gives no alpha_1, where its term may be none."""


def beside_moving(static: Mapping[str, StaticFit], moving: TrackingFit | None) -> dict[str, StaticFit]:
    """The static fits of moving runs; where a parameter misses what all parameters together give, its error spans both.

    A static law is LuGre's with a bristle that does not bend: it has the fewer parameters, and where it is right, its
    estimates differ from LuGre's by less than the standard error of those (Hausman, 1978). Two-sided normal test at 0.1 %,
    Bonferroni over the parameters of both; what errors of constants do is in both alike. A difference that the static
    interval covers is left alone, as is all where LuGre itself does not describe the data.

    Where LuGre's fit is not in doubt and explains a tenth or more of what the static law leaves, the static law is only
    the poorer model of the same runs; that only some starts reached LuGre's minimum is no doubt of that, since a lower one
    would explain more. Its outcome then says so, and its own warnings are left out; each parameter has the doubts that
    LuGre's fit has about it, and no number where that sees none. In any case a Stribeck term that LuGre's fit does not find
    has no value here: presliding looks like one.
    """
    if moving is None or any(w.code in {"unexplained", "out-of-steps"} for w in moving.warnings):
        return dict(static)
    out = {
        d: _superseded(d, fit, moving) if _is_poorer(fit, moving) else _without_refused_peak(d, fit, moving)
        for d, fit in static.items()
    }
    pairs = {(d, name): e for d, fit in out.items() for name in fit.parameters if (e := _other(name, d, fit, moving))}
    limit = float(ndtri(1 - _LEVEL / (2 * max(len(pairs), 1))))
    trust = ": believe that one"
    if _is_in_doubt(moving):
        trust = "; but that fit is questionable itself, as its warnings say: believe neither"
    for (d, name), other in pairs.items():
        own = out[d].parameters[name]
        error, reach = own.standard_error or 0.0, other.standard_error or 0.0
        apart = abs((own.value or 0.0) - (other.value or 0.0))
        if apart > max(limit * reach, NORMAL * error):
            out[d] = _spanning(out[d], name, other, float(np.hypot(error, apart)) / error, trust)
        elif is_superseded(out[d]) and reach > error:  # the poorer model knows no more than the better one
            out[d] = _spanning(out[d], name, other, float(np.hypot(reach, apart)) / error, trust)
    return out


def is_superseded(fit: StaticFit) -> bool:
    """Whether the fit of all parameters of the same runs is the one to use."""
    return fit.outcome.code == "static-superseded"


def _is_poorer(fit: StaticFit, moving: TrackingFit) -> bool:
    """Whether LuGre's fit is not in doubt, finds friction, and explains by presliding what the static law leaves."""
    unseen = any(e.value is None for name, e in moving.parameters.items() if name.name == "alpha_0")
    if unseen or _is_in_doubt(moving, "few-starts"):  # another minimum would be lower still
        return False
    return fit.relative_error is not None and moving.relative_error**2 < _LEFT * fit.relative_error**2


def _is_in_doubt(moving: TrackingFit, *but: str) -> bool:
    """Whether anything is critical about LuGre's fit, or anything that is not about single numbers, or of these kinds, calls for caution."""
    critical = any(w.severity is Severity.CRITICAL for w in moving.all_warnings())
    return critical or any(w.code not in _NO_DOUBT and w.code not in but for w in _doubts(moving.warnings))


def _superseded(direction: str, fit: StaticFit, moving: TrackingFit) -> StaticFit:
    """The fit with an outcome that says so in place of its warnings, and without what LuGre's fit does not see."""
    parameters = {}
    for name, e in fit.parameters.items():
        other = moving.parameters.get(_key(name, direction), e)
        if e.value is None or other.value is None or not e.standard_error or not _holds(e):
            parameters[name] = _unknown(e)
        else:
            parameters[name] = replace(e, warnings=_doubts(other.warnings))
    error, other_error = fit.relative_error, moving.relative_error
    message = (
        f"Presliding decides these runs: the relative error is {error:.2g} % without it and {other_error:.2g} % with it. Use the "
        "fit of all parameters of the moving runs, not these numbers."
    )
    return replace(
        _with_values(fit, parameters),
        outcome=Finding("static-superseded", NOTE, message, {"error": error, "other": other_error}),
        warnings=tuple(w for w in moving.warnings if w.code == "only-sum-seen-of-fit"),
    )


def _unknown(e: Estimate) -> Estimate:
    message = "No number without presliding: see the fit of all parameters of the same runs."
    return replace(e, value=None, interval=None, warnings=(Finding("see-moving", NOTE, message),))


def _with_values(fit: StaticFit, parameters: Mapping[str, Estimate]) -> StaticFit:
    """The fit with these parameters; covariance and what is said of uncertainty are of those that have a value."""
    seen = [name for name in fit.names if parameters[name].value is not None]
    keep = [fit.names.index(name) for name in seen]
    return replace(
        fit,
        parameters=parameters,
        names=tuple(seen),
        covariance=fit.covariance[np.ix_(keep, keep)],
        uncertainty={name: x for name, x in fit.uncertainty.items() if name in seen},
    )


def _without_refused_peak(direction: str, fit: StaticFit, moving: TrackingFit) -> StaticFit:
    """The fit without the values of a Stribeck term that LuGre's fit of the same runs does not find: presliding looks like one."""
    other = moving.parameters.get(_key("alpha_1", direction))
    if other is None or other.value is not None or not {w.code for w in other.warnings} & _NO_PEAK:
        return fit
    peak = peak_parameters(fit.law)
    refused = {n: e for n, e in fit.parameters.items() if n in peak and e.value is not None}
    without = {n: _unknown(e) for n, e in refused.items()}
    return _with_values(fit, {**fit.parameters, **without}) if without else fit


def _holds(e: Estimate) -> bool:
    """Whether the interval of an estimate holds it; one cut off at a bound may not."""
    return e.value is None or e.interval is None or e.interval[0] <= e.value <= e.interval[1]


def _doubts(warnings: tuple[Finding, ...]) -> tuple[Finding, ...]:
    return tuple(w for w in warnings if w.severity is not Severity.NOTE)


def _key(name: str, direction: str) -> ParameterName:
    """What LuGre's fit calls a static parameter."""
    shared = direction == Direction.SHARED or not of_curve(name)
    return ParameterName(name, Direction.SHARED if shared else Direction(direction))


def _other(name: str, direction: str, fit: StaticFit, moving: TrackingFit) -> Estimate | None:
    """The same parameter from all together; None where one of the two has none, or the static law is the fuller one."""
    own, key = fit.parameters[name], _key(name, direction)
    other = moving.parameters.get(key)
    if other is None or not (own.value is not None and own.standard_error and other.value and other.standard_error):
        return None
    if key.direction == Direction.SHARED:
        return other
    has_peak, peak = fit.parameters.get("alpha_1"), moving.parameters.get(key._replace(name="alpha_1"))
    own_alone = has_peak is not None and has_peak.value is not None and (peak is None or peak.value is None)
    return None if own_alone else other  # with a peak on one side only, the law with it is the fuller one


def _spanning(fit: StaticFit, name: str, other: Estimate, factor: float, trust: str) -> StaticFit:
    """The fit with the standard error of one parameter multiplied, so that it spans its distance to another estimate."""
    own = fit.parameters[name]
    value, error = own.value or 0.0, own.standard_error or 1.0
    spread = spreader(value, factor, name, logarithmic=name == "v_s")
    ends = statistical(own)
    if ends is not None:
        low, high = spread(np.array(ends)).tolist()
        ends = combined((low, high), value, own.systematic or 0.0, least_of(name))
    numbers = {"value": other.value, "error": other.standard_error, "unit": own.unit, "factor": factor}
    found = f"{other.value:.4g} +/- {other.standard_error:.2g} {own.unit}"
    if is_superseded(fit):
        message = f"The standard error is multiplied by {factor:.2g} to reach {found} of the fit of all parameters."
        why = Finding("widened-to-moving", NOTE, message, numbers)
    else:
        message = (
            f"The fit of all parameters, which knows presliding, finds {found} in the same runs, which is more than chance{trust}. "
            f"The standard error here is multiplied by {factor:.2g} to reach it."
        )
        why = Finding("static-without-presliding", CAUTION, message, {**numbers, "trust": trust})
    wider = replace(own, standard_error=factor * error, interval=ends, warnings=(*own.warnings, why))
    by = np.array([factor if n == name else 1.0 for n in fit.names])
    return replace(
        fit,
        parameters={**fit.parameters, name: wider},
        covariance=fit.covariance * np.outer(by, by),
        uncertainty={n: wider_three(x, spread) if n == name else x for n, x in fit.uncertainty.items()},
    )
