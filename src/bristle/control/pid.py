"""The sampled PID controller (21), for floats and CasADi symbols."""

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
