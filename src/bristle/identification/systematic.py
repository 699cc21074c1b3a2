"""Systematic errors of estimates from errors of constants, added to every interval last."""

from collections.abc import Mapping
from dataclasses import replace
from math import hypot, sqrt
from typing import Any, TypeVar

from bristle.estimation import levels
from bristle.identification.fits import Estimate, StaticFit, TrackingFit, Uncertainty
from bristle.model.parameters import least_of

Key = TypeVar("Key")
Fitted = TypeVar("Fitted", StaticFit, TrackingFit)
_ROUNDING = 1e-9  # of a value: smaller changes are zero


def combined(interval: tuple[float, float], value: float, systematic: float, least: float = 0.0) -> tuple[float, float]:
    """A 95 % interval with a systematic standard error added in quadrature at each end, not below `least`."""
    low, high = interval
    below = value - hypot(value - low, levels.NORMAL * systematic)
    return max(below, least) if low >= least else below, value + hypot(high - value, levels.NORMAL * systematic)


def statistical(e: Estimate) -> tuple[float, float] | None:
    """The 95 % interval of an estimate without its systematic error."""
    if e.interval is None or e.value is None or not e.systematic:
        return e.interval
    off = levels.NORMAL * e.systematic
    below, above = (abs(end - e.value) for end in e.interval)
    return e.value - sqrt(max(below**2 - off**2, 0.0)), e.value + sqrt(max(above**2 - off**2, 0.0))


def shifted(e: Estimate, shifts: Mapping[str, float], least: float = 0.0) -> Estimate:
    """The estimate with its `shifts`, change per standard error of each constant, included in its interval."""
    if not shifts or e.value is None:
        return e
    shifts = {c: x if abs(x) > _ROUNDING * abs(e.value) else 0.0 for c, x in shifts.items()}
    systematic = hypot(*shifts.values())
    interval = e.interval and combined(e.interval, e.value, systematic, least)
    return replace(e, systematic=systematic, shifts=shifts, interval=interval)


def shifted_three(three: Uncertainty, e: Estimate, least: float = 0.0) -> Uncertainty:
    """The three intervals with the systematic error of an estimate."""
    value, systematic = e.value, e.systematic
    if value is None or systematic is None:
        return three
    covariance, profile, bootstrap = (
        ends and combined(ends, value, systematic, least) for ends in (three.covariance, three.profile, three.bootstrap)
    )
    return replace(three, covariance=covariance, profile=profile, bootstrap=bootstrap)


def all_shifted(parameters: Mapping[Key, Estimate], shifts: Mapping[str, Mapping[Key, float]]) -> dict[Key, Estimate]:
    """`shifted` for the estimates of a fit; `shifts` by constant and parameter."""
    return {
        name: shifted(e, {constant: by.get(name, 0.0) for constant, by in shifts.items()}, _least(name))
        for name, e in parameters.items()
    }


def with_systematic(fit: Fitted, shifts: Mapping[str, Mapping[Any, float]]) -> Fitted:
    """The fit with errors of constants in all its intervals; `shifts` as in `all_shifted`."""
    parameters = all_shifted(fit.parameters, shifts)
    uncertainty = {name: shifted_three(x, parameters[name], _least(name)) for name, x in fit.uncertainty.items()}
    return replace(fit, parameters=parameters, uncertainty=uncertainty)


def _least(name: object) -> float:
    return least_of(str(getattr(name, "name", name)))
