"""The plant, motor and LuGre friction stepped together in CasADi, and its sensors.

Velocity and bristle are one stiff pair. With lambda(v) frozen, (4) and (7) are linear, d(v, z)/dt = A (v, z) + b with
tr A < 0 < det A, and are stepped by exp(A h) in closed form, stable for any step. Lambda is frozen at the velocity of
an implicit half step: second order for smooth motion.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from bristle.arrays import Array
from bristle.model import law, motor
from bristle.model.laws.parts import Expression
from bristle.model.parameters import Motor, Pair

Current = Callable[[Expression, Expression, Motor[Any]], Expression]
"""(drive, velocity, motor) -> armature current, A: `motor.current` or `motor.current_for`."""

_TINY = 1e-100  # keeps sinh(w h) / w and sin(w h) / w finite at w = 0, where both are exact to rounding


class State(NamedTuple):
    """The plant: rad, rad/s, and the bristle's deflection z, rad."""

    position: Expression
    velocity: Expression
    deflection: Expression


STILL = State(0.0, 0.0, 0.0)


def exponential(A: Expression, h: Expression) -> Expression:
    """exp(A h) of a 2x2 matrix whose eigenvalues have no positive real part, in closed form.

    With m = tr A / 2 and d = m**2 - det A: exp(A h) = c I + s (A - m I), c = exp(m h) cosh(sqrt(d) h), s = exp(m h)
    sinh(sqrt(d) h) / sqrt(d), or their cosine and sine for d < 0. No exponent is positive, so nothing overflows.
    """
    m = (A[0, 0] + A[1, 1]) / 2
    d = ((A[0, 0] - A[1, 1]) / 2) ** 2 + A[0, 1] * A[1, 0]
    w = ca.sqrt(ca.fabs(d) + _TINY)
    slow, decay = ca.exp((m + w) * h), ca.exp(m * h)
    forgotten = -ca.expm1(-2 * w * h)
    c = ca.if_else(d < 0, decay * ca.cos(w * h), slow * (1 - forgotten / 2))
    s = ca.if_else(d < 0, decay * ca.sin(w * h), slow * forgotten / 2) / w
    return c * ca.SX.eye(2) + s * (A - m * ca.SX.eye(2))


def plant_rates(
    v: Expression,
    z: Expression,
    drive: Expression,
    load: Expression,
    pair: Pair[Any],
    m: Motor[Any],
    current: Current,
    at: tuple[Expression, Expression] | None = None,
) -> Expression:
    """d(v, z)/dt, (2, 1), from (2), (4) and (6); with `at`, lambda and the sets are those of that (v, z)."""
    v_at, z_at = at or (v, z)
    p = law.active(z_at, v_at, pair)
    friction = law.torque(z, v, p, at=v_at)
    return ca.vertcat(motor.acceleration(current(drive, v, m), friction - load, m), law.bristle_rate(z, v, p, at=v_at))


def _frozen(
    at: Expression, drive: Expression, load: Expression, pair: Pair[Any], m: Motor[Any], current: Current
) -> tuple[Expression, Expression]:
    """A, b of d(v, z)/dt = A (v, z) + b with lambda frozen at a (v, z)."""
    x = ca.SX.sym("x", 2)
    rates = plant_rates(x[0], x[1], drive, load, pair, m, current, at=(at[0], at[1]))
    return ca.jacobian(rates, x), ca.substitute(rates, x, ca.SX.zeros(2))


def plant_step(
    state: State,
    drive: Expression,
    load: Expression,
    h: Expression,
    pair: Pair[Any],
    m: Motor[Any],
    current: Current = motor.current,
) -> State:
    """The plant after h seconds at a constant drive and disturbing torque `load` (N*m, along positive velocity).

    The drive is V under `motor.current`, N*m under `motor.current_for`; floats or CasADi symbols.
    """
    x = ca.vertcat(state.velocity, state.deflection)
    A, b = _frozen(x, drive, load, pair, m, current)
    middle = ca.inv_minor(ca.SX.eye(2) - h / 2 * A) @ (x + h / 2 * b)
    A, b = _frozen(middle, drive, load, pair, m, current)
    inverse = ca.inv_minor(A)
    rest = -inverse @ b
    new = rest + exponential(A, h) @ (x - rest)
    travel = inverse @ (new - x - h * b)
    return State(state.position + travel[0], new[0], new[1])


class Sensors(NamedTuple):
    """Errors of the bench."""

    resolution: float
    """One encoder count, rad or m, > 0."""
    voltage_noise: float
    """Standard deviation of each logged voltage, V, white."""
    torque_noise: float
    """Standard deviation of the disturbing torque, N*m, white from one control period to the next."""


def quantise(x: Expression, resolution: Expression) -> Expression:
    """The nearest count to x, in its unit; intervals are half open, [k - 1/2, k + 1/2)."""
    return ca.floor(x / resolution + 0.5) * resolution


def white_noise(rng: np.random.Generator, standard_deviation: float, shape: tuple[int, ...]) -> Array:
    """White normal noise, in the unit of `standard_deviation`."""
    return standard_deviation * rng.standard_normal(shape)
