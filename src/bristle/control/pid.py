"""The PID controller (21) and, to compare with, sliding mode, sampled.

Pure expressions, state in and state out, for floats and CasADi symbols.
"""

from typing import Any, Generic, NamedTuple, TypeVar

import casadi as ca

from bristle.model.laws.parts import Expression

T = TypeVar("T")


class Gains(NamedTuple, Generic[T]):
    """Gains of (21) for an error in rad and an output in N*m: N*m/rad, N*m/(rad*s) and N*m*s/rad."""

    K_p: T
    K_i: T
    K_d: T
    filter_time: T
    """Time constant of the first-order filter on the derivative, s, >= 0; at 0 the plain backward difference is left."""


class Sliding(NamedTuple, Generic[T]):
    """Sliding mode with a boundary layer, for an error in rad and an output in N*m.

    T = K sat(s / layer), s = de/dt + slope e.
    """

    K: T
    """Largest torque, N*m."""
    slope: T
    """The rate at which the error decays where s = 0, 1/s."""
    layer: T
    """Half the width of the boundary layer, that of s in which the torque is linear, rad/s, > 0."""
    filter_time: T
    """As in `Gains`, s."""


class Memory(NamedTuple, Generic[T]):
    """What the controller remembers from one sample to the next; all zero at rest."""

    integral: T
    """K_i times the integral of the error, N*m."""
    derivative: T
    """Filtered derivative, rad/s."""
    error: T
    """The last one, rad."""


AT_REST: Memory[float] = Memory(0.0, 0.0, 0.0)


def differentiated(
    derivative: Expression, last: Expression, new: Expression, h: Expression, filter_time: Expression
) -> Expression:
    """The backward difference of a signal through a first-order filter, per second.

    It goes on from the derivative and the value h seconds ago.
    """
    plain = (new - last) / h
    return derivative + h / (h + filter_time) * (plain - derivative)


def pid(
    memory: Memory[Any], error: Expression, h: Expression, gains: Gains[Any], limit: Expression
) -> tuple[Expression, Memory[Any]]:
    """One sample of (21): the output, N*m, within +-limit, and the new memory.

    `error` is reference minus measurement, rad; `h` the sampling interval, s; `limit` the largest output, N*m.
    Rectangle rule for the integral, backward difference for the derivative. Anti-windup: the integral never moves
    further than where the output meets its limit.
    """
    derivative = differentiated(memory.derivative, memory.error, error, h, gains.filter_time)
    proportional = gains.K_p * error + gains.K_d * derivative
    lowest = ca.fmin(memory.integral, -limit - proportional)
    highest = ca.fmax(memory.integral, limit - proportional)
    integral = ca.fmin(ca.fmax(memory.integral + h * gains.K_i * error, lowest), highest)
    output = ca.fmin(ca.fmax(proportional + integral, -limit), limit)
    return output, Memory(integral, derivative, error)


def sliding(
    memory: Memory[Any], error: Expression, h: Expression, gains: Sliding[Any]
) -> tuple[Expression, Memory[Any]]:
    """One sample of sliding mode: the output, N*m, within +-K, and the new memory; `error` and `h` as in `pid`."""
    derivative = differentiated(memory.derivative, memory.error, error, h, gains.filter_time)
    s = derivative + gains.slope * error
    output = gains.K * ca.fmin(ca.fmax(s / gains.layer, -1.0), 1.0)
    return output, Memory(memory.integral, derivative, error)
