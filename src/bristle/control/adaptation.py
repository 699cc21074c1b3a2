"""On-line adaptation of friction parameters (3.3): gains theta of (16)-(18) and the laws that move them.

    d theta_i / dt = -gamma_i  G_i  e,        e = y - y_ref, rad: position error, measured minus reference

    printed          (19)-(20) as typeset, for alpha_0 and alpha_2 alone: the first is dT_f / d alpha_1, not d alpha_0
    partial          G = dT_f / dp at given z, p = theta times its start: the law that (19) says it is
    partial-theta    G = dT_f / d theta = the same times the start
    total            G = dT_f / dp + (dT_f / dz) (dz / dp), with dz / dp from the forward-sensitivity equation

Theta is a number, so gamma is in 1/(rad*s) for alpha_0 and in s/(rad*s) for alpha_2. All functions take floats or
CasADi symbols.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import inf, isfinite
from typing import Any, Literal, NamedTuple, get_args

import casadi as ca
import numpy as np

from bristle.arrays import Array
from bristle.errors import InputError
from bristle.model import functions
from bristle.model import law as friction
from bristle.model.laws.parts import Expression
from bristle.model.laws.parts import Law as FrictionLaw
from bristle.model.parameters import Lugre, fields_of, lugre_of
from bristle.model.vectorize import evaluate

Law = Literal["printed", "partial", "partial-theta", "total"]
LAWS: tuple[Law, ...] = get_args(Law)
Step = Literal["gradient", "normalised", "least-squares"]
STEPS: tuple[Step, ...] = get_args(Step)
_TYPESET = {"alpha_0", "alpha_2"}  # parameters for which (19) and (20) are defined
_LARGEST = 1e150  # larger inputs teach nothing


@dataclass(frozen=True, slots=True, kw_only=True)
class Adaptation:
    """Which gains move, by which law and how fast. Raises InputError for settings that are not possible."""

    law: Law = "partial"
    step: Step = "gradient"
    """`gradient`: theta_i' = -gamma_i G_i e. `normalised`: the same over 1 + sum gamma_i G_i**2. `least-squares`:
    theta' = -P G e with P' = forgetting P - P G G' P, from P = diag(gamma), its trace never above the first."""
    parameters: tuple[str, ...] = ("alpha_0", "alpha_2")
    """Adapted parameters, in the order of `gamma`; the paper's choice."""
    gamma: tuple[float, ...] = (20.0, 20.0)
    """Learning rates, >= 0."""
    limits: tuple[float, float] = (0.05, 5.0)
    """Limits of the gains (projection)."""
    dead_zone: float = 0.0
    """Smaller errors teach nothing, rad; larger ones by their excess."""
    leakage: float = 0.0
    """Rate at which gains return to 1, 1/s."""
    forgetting: float = 0.0
    """Of least squares, 1/s."""

    def __post_init__(self) -> None:
        for name, value, known in (("law", self.law, LAWS), ("step", self.step, STEPS)):
            if value not in known:
                raise InputError(f"adaptation: {name}: got {value!r}; expected one of {', '.join(known)}")
        wrong = [name for name in self.parameters if name not in Lugre._fields]
        if wrong or not self.parameters or len(set(self.parameters)) < len(self.parameters):
            raise InputError(
                f"adaptation: parameters: got {', '.join(self.parameters) or 'none'}; expected some of {', '.join(Lugre._fields)}, each once"
            )
        if self.law == "printed" and set(self.parameters) - _TYPESET:
            raise InputError(
                "adaptation: law: printed is typeset for alpha_0 and alpha_2 alone; choose partial or total for others"
            )
        if len(self.gamma) != len(self.parameters):
            raise InputError(
                f"adaptation: gamma: got {len(self.gamma)} rates for {len(self.parameters)} parameters; expected one each"
            )
        for name in ("gamma", "dead_zone", "leakage", "forgetting"):
            if bad := [x for x in np.ravel(getattr(self, name)) if not 0 <= x < inf]:
                raise InputError(f"adaptation: {name}: got {bad[0]:g}; expected zero or more, and finite")
        low, high = self.limits
        if not (0 < low <= 1 <= high and isfinite(high)):
            raise InputError(
                f"adaptation: limits: got {low:g} to {high:g}; expected 0 < lower <= 1 <= upper: the gains start at 1"
            )

    def moved(self, theta: Expression, change: Expression) -> Expression:
        """A gain after a change, projected onto the limits."""
        low, high = self.limits
        return ca.fmin(ca.fmax(theta + change, low), high)


class Learnt(NamedTuple):
    """State of the adaptation."""

    theta: tuple[Expression, ...]  # Gains
    sensitivity: tuple[Expression, ...]  # dz / d theta for the total law, rad
    covariance: tuple[Expression, ...]  # P of least squares, row by row


def nothing_learnt(adaptation: Adaptation) -> Learnt:
    """The initial state, gains of 1."""
    n = len(adaptation.parameters)
    rows = tuple(adaptation.gamma[i] if i == j else 0.0 for i in range(n) for j in range(n))
    return Learnt((1.0,) * n, (0.0,) * n, rows)


def effective(
    p: Lugre[Any], adaptation: Adaptation, theta: tuple[Expression, ...], level: Expression = 0.0
) -> Lugre[Any]:
    """The parameters of (16)-(18), gains applied; `level` of a load, N*m, is not adapted."""
    return friction.loaded(friction.adapted(p, dict(zip(adaptation.parameters, theta, strict=True))), level)


def gradient(
    adaptation: Adaptation, z: Expression, v: Expression, p: Lugre[Any], learnt: Learnt, level: Expression = 0.0
) -> tuple[Expression, ...]:
    """G for each adapted parameter at a deflection z, rad, and velocity v, rad/s.

    `p` is the acting set at its start; a load adds `level` to alpha_0, N*m.
    """
    if adaptation.law == "printed":
        return tuple(printed(name, z, v, friction.loaded(p, level)) for name in adaptation.parameters)
    T = functions.torque_sensitivity_function(p.law)(z, v, *effective(p, adaptation, learnt.theta, level))
    by = dict(zip(("T", "z", *p._fields), T, strict=True))
    slopes = [by[name] for name in adaptation.parameters]
    if adaptation.law == "partial-theta":
        return tuple(slope * getattr(p, name) for slope, name in zip(slopes, adaptation.parameters, strict=True))
    if adaptation.law == "total":
        # dz/dp = (dz/d theta) / p; zero for parameters outside z and parameters of zero
        enter = functions.step_parameters(p.law)
        values = {name: ca.if_else(getattr(p, name) == 0, 1.0, getattr(p, name)) for name in enter}
        parts = zip(slopes, learnt.sensitivity, adaptation.parameters, strict=True)
        return tuple(slope + by["z"] * (s / values[name] if name in values else 0.0) for slope, s, name in parts)
    return tuple(slopes)


def laws_for(parameters: Sequence[str]) -> tuple[Law, ...]:
    """The laws that can adapt these parameters."""
    return tuple(law for law in LAWS if law != "printed" or {*parameters} <= _TYPESET)


def steady_gradient(adaptation: Adaptation, v: Array, p: Lugre[float]) -> Array:
    """G in steady sliding at speeds v, rad/s, (n,), before anything is learnt; (parameters, n)."""
    return np.array(evaluate(_steady_gradient(adaptation, p.law), v, *p))


@lru_cache(maxsize=16)
def _steady_gradient(adaptation: Adaptation, of: FrictionLaw) -> ca.Function:
    """(v, *Lugre) -> G of each adapted parameter, z and dz / d theta being steady."""
    v, p = ca.SX.sym("v"), lugre_of(of)(*(ca.SX.sym(name) for name in fields_of(of)))
    z, *by = functions.steady_deflection_function(of)(v, *p)
    slopes = dict(zip(p._fields, by, strict=True))
    settled = tuple(slopes[name] * getattr(p, name) for name in adaptation.parameters)
    G = gradient(adaptation, z, v, p, Learnt((1.0,) * len(settled), settled, ()))
    return ca.Function("steady_gradient", [v, *p], [ca.densify(g) for g in G])


def printed(name: str, z: Expression, v: Expression, p: Lugre[Any]) -> Expression:
    """The right-hand sides of (19) and (20) as typeset, without -gamma and e: the one derivative that is typed."""
    if name == "alpha_2":
        return v
    peak = ca.exp(-((v / p.v_s) ** 2))
    return p.sigma_0 * p.sigma_1 * ca.fabs(v) * z * peak / (p.alpha_0 + p.alpha_1 * peak) ** 2


def rate(adaptation: Adaptation, learnt: Learnt, G: tuple[Expression, ...], e: Expression) -> tuple[Expression, ...]:
    """The rate d theta / dt, 1/s, at a position error e (measured minus reference), rad, before projection."""
    beyond = ca.sign(e) * ca.fmax(ca.fabs(e) - adaptation.dead_zone, 0.0)
    n, P = len(G), learnt.covariance
    if adaptation.step == "least-squares":
        pull = [-sum(P[i * n + j] * G[j] for j in range(n)) * beyond for i in range(n)]
    else:
        over = 1.0
        if adaptation.step == "normalised":
            over = 1 + sum(gamma * g * g for gamma, g in zip(adaptation.gamma, G, strict=True))
        pull = [-gamma * g * beyond / over for gamma, g in zip(adaptation.gamma, G, strict=True)]
    return tuple(x - adaptation.leakage * (theta - 1) for x, theta in zip(pull, learnt.theta, strict=True))


def learn(adaptation: Adaptation, learnt: Learnt, G: tuple[Expression, ...], e: Expression, h: Expression) -> Learnt:
    """One sample of h seconds: gains, projected, and P. An error that is no number teaches nothing."""
    changes = [h * slope for slope in rate(adaptation, learnt, G, e)]
    theta = tuple(
        adaptation.moved(theta, ca.if_else(ca.fabs(change) < _LARGEST, change, 0.0))
        for theta, change in zip(learnt.theta, changes, strict=True)
    )
    if adaptation.step != "least-squares":
        return learnt._replace(theta=theta)
    # P' = forgetting P - P G G' P, the second part by the exact inverse, so that P stays positive for any h.
    n, P = len(G), learnt.covariance
    PG = [sum(P[i * n + j] * G[j] for j in range(n)) for i in range(n)]
    over = 1 + h * sum(g * x for g, x in zip(G, PG, strict=True))
    grown = ca.exp(adaptation.forgetting * h)
    upper = {(i, j): grown * (P[i * n + j] - h * PG[i] * PG[j] / over) for i in range(n) for j in range(i, n)}
    new = [upper[min(i, j), max(i, j)] for i in range(n) for j in range(n)]
    trace = sum(new[i * n + i] for i in range(n))
    shrink = ca.fmin(1.0, sum(adaptation.gamma) / ca.fmax(trace, 1e-200))
    sound = ca.fabs(over) < _LARGEST
    covariance = tuple(ca.if_else(sound, shrink * x, old) for x, old in zip(new, P, strict=True))
    return learnt._replace(theta=theta, covariance=covariance)
