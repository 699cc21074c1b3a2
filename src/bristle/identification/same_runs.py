"""The static fit of moving runs beside the fit of all parameters of the same runs, which knows presliding."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.special import ndtri

from bristle.diagnostics import Kind
from bristle.identification.fits import Estimate, StaticFit, TrackingFit
from bristle.identification.repeats import spreader, wider_three
from bristle.identification.systematic import NORMAL, combined, statistical
from bristle.model.parameters import Direction, ParameterName, least_of

_LEVEL = 1e-3
"""Probability, by chance, that any of the parameters differs."""


def beside_moving(static: Mapping[str, StaticFit], moving: TrackingFit | None) -> dict[str, StaticFit]:
    """The static fits of moving runs; where a parameter misses what all parameters together give, its error spans both.

    A static law is LuGre's with a bristle that does not bend: it has the fewer parameters, and where it is right, its
    estimates differ from LuGre's by less than the standard error of those (Hausman, 1978). Two-sided normal test at 0.1 %,
    Bonferroni over the parameters of both; what errors of constants do is in both alike. A difference that the static
    interval covers is left alone, as is all where LuGre itself does not describe the data.
    """
    if moving is None or any(w.kind in {Kind.UNEXPLAINED, Kind.OUT_OF_STEPS} for w in moving.warnings):
        return dict(static)
    pairs = {
        (d, name): e for d, fit in static.items() for name in fit.parameters if (e := _other(name, d, fit, moving))
    }
    limit = float(ndtri(1 - _LEVEL / (2 * max(len(pairs), 1))))
    out = dict(static)
    for (d, name), other in pairs.items():
        own = static[d].parameters[name]
        apart = (own.value or 0.0) - (other.value or 0.0)
        if abs(apart) > max(limit * (other.standard_error or 0.0), NORMAL * (own.standard_error or 0.0)):
            out[d] = _spanning(out[d], name, own, other)
    return out


def _other(name: str, direction: str, fit: StaticFit, moving: TrackingFit) -> Estimate | None:
    """The same parameter from all together; None where one of the two has none, or the static law is the fuller one."""
    own = fit.parameters[name]
    shared = direction == Direction.SHARED or name not in {"alpha_0", "alpha_1", "alpha_2", "v_s"}
    key = ParameterName(name, Direction.SHARED if shared else Direction(direction))
    other = moving.parameters.get(key)
    if other is None or not (own.value is not None and own.standard_error and other.value and other.standard_error):
        return None
    if shared:
        return other
    has_peak, peak = fit.parameters.get("alpha_1"), moving.parameters.get(key._replace(name="alpha_1"))
    own_alone = has_peak is not None and has_peak.value is not None and (peak is None or peak.value is None)
    return None if own_alone else other  # with a peak on one side only, the law with it is the fuller one


def _spanning(fit: StaticFit, name: str, own: Estimate, other: Estimate) -> StaticFit:
    """The fit with the standard error of one parameter widened by its distance to another estimate."""
    value, error = own.value or 0.0, own.standard_error or 1.0
    factor = float(np.hypot(error, value - (other.value or 0.0))) / error
    spread = spreader(value, factor, name, logarithmic=name == "v_s")
    ends = statistical(own)
    if ends is not None:
        low, high = spread(np.array(ends)).tolist()
        ends = combined((low, high), value, own.systematic or 0.0, least_of(name))
    why = Kind.STATIC_WITHOUT_PRESLIDING(value=other.value, error=other.standard_error, unit=own.unit, factor=factor)
    wider = replace(own, standard_error=factor * error, interval=ends, warnings=(*own.warnings, why))
    by = np.array([factor if n == name else 1.0 for n in fit.names])
    return replace(
        fit,
        parameters={**fit.parameters, name: wider},
        covariance=fit.covariance * np.outer(by, by),
        uncertainty={n: wider_three(x, spread) if n == name else x for n, x in fit.uncertainty.items()},
    )
