"""The DC motor at a joint, (1)-(2) and (6)-(8), for floats, arrays and symbols; w in rad/s, T_f in N*m."""

from typing import Any

from bristle.model.parameters import Motor

Expression = Any  # a float, an array or a CasADi symbol: CasADi carries no types


def current_rate(i: Expression, V: Expression, w: Expression, m: Motor[Any]) -> Expression:
    """Rate di/dt, A/s, from L di/dt + R i = V - k_t w (1). Needs L > 0."""
    return (V - m.k_t * w - m.R * i) / m.L


def acceleration(i: Expression, T_f: Expression, m: Motor[Any]) -> Expression:
    """d2y/dt2, rad/s**2, from J d2y/dt2 = k_t i - T_f (2)."""
    return (m.k_t * i - T_f) / m.J


def current(V: Expression, w: Expression, m: Motor[Any]) -> Expression:
    """Armature current without inductance, A: i = (V - k_t w) / R (6)."""
    return (V - m.k_t * w) / m.R


def current_for(T: Expression, w: Expression, m: Motor[Any]) -> Expression:  # noqa: ARG001  # as `current`
    """Armature current of a torque drive, A: i = T / k_t; in place of `current`."""
    return T / m.k_t


def drive_torque(V: Expression, w: Expression, m: Motor[Any]) -> Expression:
    """Torque of voltage V at velocity w, N*m: k_t (V - k_t w) / R (7), at constant velocity T_ss*(v) of (8)."""
    return m.k_t * current(V, w, m)


def voltage(T: Expression, w: Expression, m: Motor[Any]) -> Expression:
    """Voltage that drives torque T at velocity w, V: the inverse of (7)-(8)."""
    return m.R * T / m.k_t + m.k_t * w
