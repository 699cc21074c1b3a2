"""Friction compensators as pure functions: `initial_state`, then `step` at every sample, of floats or symbols.

The names:

    none              nothing
    coulomb           alpha_0 tanh(v / v_0)
    stribeck          the steady curve (9)
    lugre             LuGre driven by the reference velocity: the paper's feed-forward scheme, section 4
    lugre-feedback    LuGre driven by the measured velocity, or by one that is differentiated from the measured position
    lugre-observer    the same, the bristle corrected by the position error: dz/dt = v - lambda z - k e, e = y - y_ref
    (Canudas de Wit, 1995)
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import inf
from typing import Any, Literal, NamedTuple, get_args

import casadi as ca
import numpy as np

from bristle.control.adaptation import Adaptation, Learnt, effective, gradient, learn, nothing_learnt
from bristle.control.pid import differentiated
from bristle.errors import InputError
from bristle.model import functions, law
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import Expression, Law
from bristle.model.parameters import Pair, fields_of, pair_of
from bristle.model.vectorize import bound

Name = Literal["none", "coulomb", "stribeck", "lugre", "lugre-feedback", "lugre-observer"]
NAMES: tuple[Name, ...] = get_args(Name)
Velocity = Literal["reference", "measured"]


class Reference(NamedTuple):
    """Reference motion in rad, rad/s and rad/s**2: floats or symbols, or arrays (n,) or (cases, n) of a run."""

    position: Expression
    velocity: Expression
    acceleration: Expression
    torque: Expression = 0.0
    """Open-loop torque added to the command, N*m."""
    level: Expression = 0.0
    """Rise of alpha_0 by the load on the way, of joint and model alike, N*m (`law.load_levels`)."""


class Measurement(NamedTuple):
    """Measured motion."""

    position: Expression  # rad
    velocity: Expression | None = None  # rad/s; None: differentiated from the position


@dataclass(frozen=True, slots=True, kw_only=True)
class Compensator:
    """A compensator and its settings. Raises InputError for settings that are not possible."""

    name: Name = "lugre"
    velocity: Velocity = "reference"
    """Velocity that drives coulomb and stribeck."""
    share: float = 1.0
    """Compensated share of the predicted friction."""
    inertia: float = 0.0
    """Inertia feed-forward, kg*m**2; 0: none, as in the paper."""
    adaptation: Adaptation | None = None
    softness: float = 0.01
    """v_0 of the Coulomb compensator, rad/s."""
    filter_time: float = 0.0
    """Of the differentiated velocity, s; 0: plain difference."""
    observer_gain: float = 10.0
    """k, 1/s."""

    def __post_init__(self) -> None:
        if self.name not in NAMES:
            raise InputError(f"compensator: got {self.name!r}; expected one of {', '.join(NAMES)}")
        if self.velocity not in get_args(Velocity):
            raise InputError(f"compensator: velocity: got {self.velocity!r}; expected reference or measured")
        if self.adaptation is not None and not self.name.startswith("lugre"):
            able = ", ".join(n for n in NAMES if n.startswith("lugre"))
            raise InputError(f"compensator: {self.name} cannot adapt; expected one of {able}")
        for what in ("share", "inertia", "softness", "filter_time", "observer_gain"):
            value, positive = getattr(self, what), what == "softness"
            if not 0 <= value < inf or (positive and value == 0):
                expected = "a positive number" if positive else "zero or more"
                raise InputError(f"compensator: {what}: got {value:g}; expected {expected}, and finite")


class CompensatorState(NamedTuple):
    """State between samples."""

    parameters: Pair[Any]
    deflection: Expression  # Of the model's bristle, rad
    velocity: Expression  # Last driving velocity, rad/s
    position: Expression  # Last measured, rad
    learnt: Learnt


def initial_state(compensator: Compensator, parameters: Pair[Any], position: Expression = 0.0) -> CompensatorState:
    """At rest at a position, rad, bristle not bent, nothing learnt."""
    learnt = nothing_learnt(compensator.adaptation) if compensator.adaptation else Learnt((), (), ())
    return CompensatorState(parameters, 0.0, 0.0, position, learnt)


def step(
    compensator: Compensator, state: CompensatorState, reference: Reference, measurement: Measurement, h: Expression
) -> tuple[CompensatorState, Expression]:
    """One sample of h seconds: the new state, and the torque to add to the controller's, N*m."""
    name, pair = compensator.name, state.parameters
    forward = compensator.inertia * reference.acceleration
    if name == "none":
        return state, forward
    v, level = driving(compensator, state, reference, measurement, h), reference.level
    p = law.loaded(law.active(v, v, pair), level)
    seen = state._replace(velocity=v, position=measurement.position)
    if name == "coulomb":
        return seen, forward + compensator.share * p.alpha_0 * ca.tanh(v / compensator.softness)
    if name == "stribeck":
        return seen, forward + compensator.share * law.steady_torque(v, p)
    e = measurement.position - reference.position
    z, learnt = advanced(compensator.adaptation, state, v, h, level)
    if name == "lugre-observer":
        z = z - h * compensator.observer_gain * e
    p, a = law.active(z, v, pair), compensator.adaptation
    T = law.torque(z, v, effective(p, a, learnt.theta, level) if a else law.loaded(p, level))
    if a:
        learnt = learn(a, learnt, gradient(a, z, v, p, learnt, level), e, h)
    return CompensatorState(pair, z, v, measurement.position, learnt), forward + compensator.share * T


def driving(
    compensator: Compensator, state: CompensatorState, reference: Reference, measurement: Measurement, h: Expression
) -> Expression:
    """The velocity that drives the model, rad/s."""
    if compensator.name not in ("lugre-feedback", "lugre-observer") and compensator.velocity == "reference":
        return reference.velocity
    if measurement.velocity is not None:
        return measurement.velocity
    return differentiated(state.velocity, state.position, measurement.position, h, compensator.filter_time)


def advanced(
    a: Adaptation | None, state: CompensatorState, v: Expression, h: Expression, level: Expression = 0.0
) -> tuple[Expression, Learnt]:
    """The bristle after h seconds with linear v, and dz / d theta for the total law; a load adds `level`, N*m.

    Two exact-exponential steps, to the zero of v or the middle, and from there.
    """
    v0, learnt = state.velocity, state.learnt
    crosses = v0 * v < 0
    share = ca.if_else(crosses, ca.fabs(v0) / (ca.fabs(v0) + ca.fabs(v) + 1e-200), 0.5)
    middle = ca.if_else(crosses, 0.0, (v0 + v) / 2)
    z, slopes = state.deflection, learnt.sensitivity
    for first, last, part in ((v0, middle, share * h), (middle, v, (1 - share) * h)):
        p = law.active(z, first + last, state.parameters)
        acting = effective(p, a, learnt.theta, level) if a else law.loaded(p, level)
        if a and a.law == "total":
            forgotten, rest, *by_p = functions.change_sensitivity_function(p.law)(first, last, part, *acting)
            enter = functions.step_parameters(p.law)
            more = {n: by_p[len(enter) + i] - by_p[i] * z for i, n in enumerate(enter)}
            pairs = zip(a.parameters, slopes, strict=True)
            slopes = tuple(s + (getattr(p, n) * more.get(n, 0.0) - forgotten * s) for n, s in pairs)
        else:
            forgotten, rest = law.bristle_change(first, last, part, acting)
        z = z + (rest - forgotten * z)
        stiffness = law.active(z, first + last, state.parameters).sigma_0  # of its new side where z has passed zero
        crossed = stiffness != p.sigma_0
        other, slope = law.rescaled_deflection(z, rest / (forgotten + 1e-200), stiffness / p.sigma_0)
        z, slopes = ca.if_else(crossed, other, z), tuple(ca.if_else(crossed, slope * s, s) for s in slopes)
    return z, learnt._replace(sensitivity=slopes)


@lru_cache(maxsize=64)
def compiled(
    compensator: Compensator, of: Law = GAUSSIAN, *, velocity: bool = True
) -> Callable[[CompensatorState, Reference, Measurement, float], tuple[CompensatorState, float]]:
    """`step` for a real-time loop and a joint with this law, compiled by CasADi, called with floats.

    With `velocity` the measurement must hold one. Not thread-safe.
    """
    gains, count = adapted_count(compensator), len(fields_of(of))
    blank = pair_of([0.0] * 2 * count, of)
    memory, q = ca.SX.sym("memory", len(packed(initial_state(compensator, blank)))), ca.SX.sym("pair", 2 * count)
    inputs = ca.SX.sym("inputs", 7)
    state = unpacked(ca.vertsplit(memory), pair_of(ca.vertsplit(q), of), gains)
    y_ref, v_ref, a_ref, level, *m, h = ca.vertsplit(inputs)
    r = Reference(y_ref, v_ref, a_ref, level=level)
    new, T = step(compensator, state, r, Measurement(m[0], m[1] if velocity else None), h)
    out = [ca.densify(ca.vertcat(*packed(new), T))]
    function = ca.Function("compensate", [memory, q, inputs], out, {"cse": True})
    buffers = [np.zeros(function.numel_in(k)) for k in range(3)]
    result = np.zeros(function.numel_out(0))
    run = bound(function, buffers, [result])

    def call(
        state: CompensatorState, reference: Reference, measurement: Measurement, h: float
    ) -> tuple[CompensatorState, float]:
        """Step with floats."""
        buffers[0][:] = packed(state)
        buffers[1][:count], buffers[1][count:] = state.parameters
        y_ref, v_ref, a_ref, _, level = reference
        buffers[2][:] = (y_ref, v_ref, a_ref, level, measurement.position, measurement.velocity or 0.0, h)
        run()
        *memory, T = result.tolist()
        return unpacked(memory, state.parameters, gains), T

    return call


def adapted_count(compensator: Compensator) -> int:
    """Number of adapted parameters."""
    return len(compensator.adaptation.parameters) if compensator.adaptation else 0


def packed(state: CompensatorState) -> list[Expression]:
    """The state as a list of numbers."""
    theta, sensitivity, covariance = state.learnt
    return [state.deflection, state.velocity, state.position, *theta, *sensitivity, *covariance]


def unpacked(memory: Sequence[Expression], parameters: Pair[Any], adapted: int) -> CompensatorState:
    """The inverse of `packed`, for so many adapted parameters."""
    z, v, position, *rest = memory
    theta, sensitivity, covariance = rest[:adapted], rest[adapted : 2 * adapted], rest[2 * adapted :]
    return CompensatorState(parameters, z, v, position, Learnt(tuple(theta), tuple(sensitivity), tuple(covariance)))
