"""The PID controller (21), sampled: pure expressions, state in and state out, for floats and for CasADi symbols."""

from typing import Any, Generic, NamedTuple, TypeVar

import casadi as ca

T = TypeVar("T")
Expression = Any
"""A float or a CasADi symbol: CasADi carries no types."""


class Gains(NamedTuple, Generic[T]):
    """Gains of (21) for an error in rad and an output in N*m."""

    K_p: T
    """N*m/rad."""
    K_i: T
    """N*m/(rad*s)."""
    K_d: T
    """N*m*s/rad."""
    filter_time: T
    """Time constant of the first-order filter on the derivative, s, >= 0; at 0 the plain backward difference is left."""


class Memory(NamedTuple, Generic[T]):
    """What the controller remembers from one sample to the next; all zero at rest."""

    integral: T
    """K_i times the integral of the error, N*m."""
    derivative: T
    """Filtered derivative of the error, rad/s."""
    error: T
    """The last error, rad."""


AT_REST: Memory[float] = Memory(0.0, 0.0, 0.0)


def pid(
    memory: Memory[Any], error: Expression, h: Expression, gains: Gains[Any], limit: Expression
) -> tuple[Expression, Memory[Any]]:
    """One sample of (21): the output, N*m, within +-limit, and the new memory.

    `error` is reference minus measurement, rad; `h` the sampling interval, s; `limit` the largest output, N*m. Rectangle rule for the integral,
    backward difference for the derivative. Anti-windup: the integral never moves further than where the output meets its limit.
    """
    slope = (error - memory.error) / h
    derivative = memory.derivative + h / (h + gains.filter_time) * (slope - memory.derivative)
    proportional = gains.K_p * error + gains.K_d * derivative
    lowest = ca.fmin(memory.integral, -limit - proportional)
    highest = ca.fmax(memory.integral, limit - proportional)
    integral = ca.fmin(ca.fmax(memory.integral + h * gains.K_i * error, lowest), highest)
    output = ca.fmin(ca.fmax(proportional + integral, -limit), limit)
    return output, Memory(integral, derivative, error)
