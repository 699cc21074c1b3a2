"""The sampled PID controller (21), and sliding mode for comparison, for floats and CasADi symbols."""

from typing import Any, Generic, NamedTuple, TypeVar

import casadi as ca

from bristle.model.laws.parts import Expression

T = TypeVar("T")


class Gains(NamedTuple, Generic[T]):
    """Gains of (21): N*m/rad, N*m/(rad*s), N*m*s/rad."""

    K_p: T
    K_i: T
    K_d: T
    filter_time: T  # Of the filter on the derivative, s, >= 0; 0: plain difference


class Sliding(NamedTuple, Generic[T]):
    """Sliding mode T = K sat(s / layer), s = de/dt + slope e, for an error in rad and an output in N*m."""

    K: T  # Largest torque, N*m
    slope: T  # Rate of decay of the error at s = 0, 1/s
    layer: T  # Half width of the boundary layer, rad/s, > 0
    filter_time: T  # As in `Gains`, s


class Memory(NamedTuple, Generic[T]):
    """State of the controller, zero at rest."""

    integral: T  # K_i times the integral of the error, N*m
    derivative: T  # Filtered derivative, rad/s
    error: T  # Last error, rad


AT_REST: Memory[float] = Memory(0.0, 0.0, 0.0)


def differentiated(
    derivative: Expression, last: Expression, new: Expression, h: Expression, filter_time: Expression
) -> Expression:
    """Backward difference through a first-order filter, per second, from the last derivative and value."""
    plain = (new - last) / h
    return derivative + h / (h + filter_time) * (plain - derivative)


def pid(
    memory: Memory[Any], error: Expression, h: Expression, gains: Gains[Any], limit: Expression
) -> tuple[Expression, Memory[Any]]:
    """One sample of (21): the output, N*m, within +-limit, and the new memory.

    `error` is reference minus measurement, rad; `h` the sampling interval, s. Rectangle rule, backward difference; the
    integral stops where the output meets its limit (anti-windup).
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
    """One sample of sliding mode: the output, N*m, within +-K, and the new memory; arguments as in `pid`."""
    derivative = differentiated(memory.derivative, memory.error, error, h, gains.filter_time)
    s = derivative + gains.slope * error
    output = gains.K * ca.fmin(ca.fmax(s / gains.layer, -1.0), 1.0)
    return output, Memory(memory.integral, derivative, error)
