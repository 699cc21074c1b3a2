"""Sessions under different friction laws: which parameters mean the same in both, and breakaway, which always does."""

from collections.abc import Iterator
from dataclasses import replace
from math import sqrt

import numpy as np

from bristle.estimation.covariance import student
from bristle.identification.fits import Estimate
from bristle.identification.systematic import shifted
from bristle.model.laws.parts import Law
from bristle.model.parameters import ParameterName, of_curve
from bristle.questions.session_comparison.results import SessionFit, SessionJoint, usable

BREAKAWAY = "breakaway"
"""alpha_0 + alpha_1."""
_MANY = 1e9
"""Degrees of freedom that count as without end."""


def alike(name: str, first: Law, second: Law) -> bool:
    """Whether a parameter means the same in two laws: one of friction in sliding in one law alone.

    The tail of one peak, or a term, is the level alpha_0 or the viscous friction of another law: on one curve alpha_0
    may differ by tens of percent, and no cause is behind it.
    """
    return first == second or not of_curve(name)


def with_breakaway(joint: SessionJoint) -> SessionJoint:
    """The same, whose fits know breakaway as well where they know alpha_0 and alpha_1 together."""
    return replace(
        joint, fits=tuple(replace(fit, parameters={**fit.parameters, **dict(_breakaways(fit))}) for fit in joint.fits)
    )


def _breakaways(fit: SessionFit) -> Iterator[tuple[ParameterName, Estimate]]:
    """Breakaway of each direction, by the covariance of the fit."""
    for name, level in fit.parameters.items():
        peak = name._replace(name="alpha_1")
        if name.name == "alpha_0" and {name, peak} <= set(fit.names) and peak in fit.parameters:
            e = _sum(fit, name, level, peak, fit.parameters[peak])
            if e is not None:
                yield name._replace(name=BREAKAWAY), e


def _sum(fit: SessionFit, name: ParameterName, a: Estimate, other: ParameterName, b: Estimate) -> Estimate | None:
    """The sum of two parameters; None where either lacks a number."""
    at = [fit.names.index(name), fit.names.index(other)]
    variance = float(fit.covariance[np.ix_(at, at)].sum())
    if not (usable(a) and usable(b) and variance > 0):
        return None
    value, error = (a.value or 0.0) + (b.value or 0.0), sqrt(variance)
    reach = student(min(fit.freedom, _MANY)) * error
    alone = Estimate(value=value, unit=a.unit, standard_error=error, interval=(max(value - reach, 0.0), value + reach))
    constants = dict.fromkeys((*a.shifts, *b.shifts))
    return shifted(alone, {c: a.shifts.get(c, 0.0) + b.shifts.get(c, 0.0) for c in constants})
