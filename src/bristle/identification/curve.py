"""The fitted curve of friction vs velocity, and how far it is known."""

import numpy as np
from scipy.special import stdtrit

from bristle.arrays import Array
from bristle.identification.fits import StaticFit, TrackingFit
from bristle.identification.known_joint import KnownJoint, Source, chosen, known_joint
from bristle.identification.results import Joint
from bristle.identification.systematic import NORMAL
from bristle.model.functions import steady_jacobian_function, steady_torque_function
from bristle.model.parameters import SIGNED, Direction, ParameterName, Stribeck, lugre_of, of_curve
from bristle.model.vectorize import evaluate

_DRAG = "quadratic"


def curve(v: Array, p: Stribeck[float]) -> Array:
    """T_ss(v) of (9), N*m, shape of v."""
    return evaluate(steady_torque_function(p.law), v, *p)[0]


def band(v: Array, fit: StaticFit | TrackingFit, direction: str = "") -> Array | None:
    """Half-width of the 95 % confidence band of the fitted curve at v, N*m; None where the covariance gives none.

    sqrt(j C j') times Student's t, with j the exact derivative of (9) with respect to the free parameters, by CasADi;
    in quadrature with what the errors of constants do to the curve. Of moving runs, in a direction.
    """
    if isinstance(fit, StaticFit):
        p, sides = fit.values(), {fit.direction}
        names = [ParameterName(name, Direction(fit.direction)) for name in fit.names]
        student = float(stdtrit(fit.degrees_of_freedom, 0.975)) if fit.degrees_of_freedom >= 1 else np.inf
        shifts = {name: fit.parameters[name.name].shifts for name in names if name.name in fit.parameters}
    else:
        lugre, sides, student = fit.values(direction), {direction, "both"}, NORMAL
        p, names = None if lugre is None else lugre.stribeck, list(fit.names)
        shifts = {name: fit.parameters[name].shifts for name in names if name in fit.parameters}
    keep = [k for k, x in enumerate(names) if (of_curve(x.name) and str(x.direction) in sides) or x.name == _DRAG]
    covariance = fit.covariance[np.ix_(keep, keep)]
    if p is None or not keep or not np.isfinite(covariance).all() or student == np.inf:
        return None
    columns = dict(zip(p._fields, evaluate(steady_jacobian_function(p.law), v, *p), strict=True))
    columns[_DRAG] = v * np.abs(v)
    j = np.array([columns[names[k].name] for k in keep])
    half = student * np.sqrt(np.maximum(np.einsum("kn,kl,ln->n", j, covariance, j), 0.0))
    moved = [shifts.get(names[k], {}) for k in keep]
    for constant in dict.fromkeys(c for shift in moved for c in shift):  # all parameters by one constant together
        half = np.hypot(half, NORMAL * np.array([shift.get(constant, 0.0) for shift in moved]) @ j)
    return np.asarray(half)


def friction_of(known: KnownJoint, v: Array) -> Array:
    """Friction (9) of what is known of a joint at some velocities, N*m, of their shape: 0 at rest, nan in a direction of which no law is known."""
    torque = np.where(v == 0, 0.0, np.nan)
    for d, side in zip(SIGNED, (v > 0, v < 0), strict=True):
        if known.has_law(d):
            values = {"sigma_0": 0.0, "sigma_1": 0.0, **known.values(d)}
            torque[side] = curve(v[side], lugre_of(known.law)(**values).stribeck)
    return torque


def known_curve(joint: Joint, v: Array) -> tuple[Array, Array]:
    """Friction of an identified joint at some velocities, N*m, drag included, and half of its 95 % band, each (n,).

    Both are nan in a direction of which no law is known, the band where it is not known how far. Raises InputError where a
    number of the joint is none that a joint can have.
    """
    known, rows = known_joint(joint), chosen(joint)
    drag = sum(row.estimate.value or 0.0 for row in rows if row.parameter.name == _DRAG)
    moving = any(row.source is not Source.STATIC for row in rows if row.parameter.name == "alpha_0")
    half = np.full(v.size, np.nan)
    for d, side in zip(SIGNED, (v > 0, v < 0), strict=True):
        fit = joint.moving if moving else joint.static.get(d) or joint.static.get(Direction.BOTH)
        wide = band(v[side], fit, d) if fit is not None and known.has_law(d) else None
        half[side] = np.nan if wide is None else wide
    return friction_of(known, v) + drag * v * np.abs(v), half
