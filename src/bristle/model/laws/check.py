"""Numerical checks of peaks and terms from outside."""

from collections.abc import Callable

import casadi as ca
import numpy as np

from bristle.arrays import Array
from bristle.model.laws.parts import Expression, Peak, ViscousTerm

_V_S = 0.1  # the Stribeck velocity at which a peak is tried, rad/s
_SPEEDS = np.concatenate([[0.0], _V_S * np.geomspace(1e-6, 1e4, 250)])
_CLOSE = 1e-9
_LEFT = 0.1  # largest remainder of a peak at the highest speed


def fault_of(part: Peak | ViscousTerm) -> str | None:
    """What is wrong with a part, in words that follow its name, or None."""
    if isinstance(part, Peak) and part.reach <= 0:
        return f"got a reach of {part.reach:g}; expected more than 0"
    try:
        return _fault_of_shape(part) if isinstance(part, Peak) else _fault_of_rate(part.rate)
    except Exception as error:  # noqa: BLE001  # whatever a function from outside raises, it is no expression
        return f"got a function that CasADi cannot evaluate ({error}); expected CasADi's operations alone"


def _fault_of_shape(peak: Peak) -> str | None:
    if not all(0 < x.searched[0] < x.searched[1] < np.inf for x in peak.own):
        return "got a parameter of the shape without a range to search; expected searched=(low, high), 0 < low < high"
    for own in ([x.searched[0] for x in peak.own], [x.middle for x in peak.own], [x.searched[1] for x in peak.own]):
        s, slope = _tried(peak.shape, _SPEEDS, _V_S, *own)
        mirrored, _ = _tried(peak.shape, -_SPEEDS, _V_S, *own)
        lost = np.flatnonzero(~(np.isfinite(s) & np.isfinite(slope)))
        if lost.size:
            at = _SPEEDS[lost[0]] / _V_S
            return f"got a shape that is not finite, or has no derivative, at {at:.3g} v_s; expected both from rest on"
        if abs(s[0] - 1) > _CLOSE:
            return f"got a shape of {s[0]:.3g} at rest; expected 1"
        if np.abs(s - mirrored).max() > _CLOSE:
            return "got a shape that differs between v and -v; expected the same"
        if (np.diff(s) > _CLOSE).any() or s.min() < -_CLOSE or s[-1] > _LEFT:
            return "got a shape that does not fall from 1 to 0; expected it to fall with speed"
    return None


def _fault_of_rate(rate: Callable[[Expression], Expression]) -> str | None:
    r, slope = _tried(rate, _SPEEDS)
    # at rest v r(abs(v)) is flat whatever the slope of r
    if not (np.isfinite(r).all() and np.isfinite(slope[1:]).all()):
        return "got a rate that is not finite, or has no derivative, at a speed; expected both"
    if abs(r[0]) > _CLOSE:
        return f"got a rate of {r[0]:.3g} at rest; expected 0"
    if (np.diff(r) < -_CLOSE * np.abs(r).max()).any() or r[-1] <= 0:
        return "got a rate that does not rise with speed; expected it to rise from 0"
    return None


def _tried(expression: Callable[..., Expression], speeds: Array, *more: float) -> tuple[Array, Array]:
    """An expression and its derivative at some speeds, (n,) each, and other arguments."""
    v = ca.SX.sym("v")
    value = ca.SX(expression(v, *more))
    found = ca.Function("tried", [v], [value, ca.jacobian(value, v)]).map(speeds.size)(speeds)
    return np.array(found[0]).ravel(), np.array(found[1]).ravel()
