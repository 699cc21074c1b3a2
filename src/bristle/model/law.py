"""The LuGre friction law: every equation of the package that is not the motor's stands here, once.

Pure CasADi expressions of the bristle deflection z (rad), the velocity v (rad/s) and the parameters p (`Lugre`, or
`Stribeck` where no bristle enters). Which peak and which terms the law has, p knows; they stand in `laws`.
Everything else - curves, simulators, residuals, Jacobians, adaptation - is derived from them; derivatives come from
CasADi.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca

from bristle.model.laws.parts import FASTEST, Expression, Law
from bristle.model.parameters import Lugre, Pair, Stribeck, lugre_of

_TINY = 1e-100  # keeps (1 - exp(-x)) / x and its derivatives finite at x = 0, where both are exact to rounding


def stribeck(v: Expression, p: Lugre[Any] | Stribeck[Any]) -> Expression:
    """g(v) = alpha_0 + alpha_1 s(v), N*m: the friction level in slow sliding; the paper's s is exp(-(v / v_s)**2) (5)."""
    shape = [getattr(p, name) for name in p.law.shape_parameters]
    return p.alpha_0 + p.alpha_1 * p.law.peak.shape(v, *shape)


def viscous_rates(speed: Expression, law: Law) -> dict[str, Expression]:
    """What multiplies alpha_2 v, which is one, and the coefficients of a law's terms, by name, at a speed that was measured."""
    return {"alpha_2": 1.0} | {term.coefficient.name: term.rate(speed) for term in law.terms}


def viscous_rate(v: Expression, p: Lugre[Any] | Stribeck[Any]) -> Expression:
    """What multiplies v beside the level, N*m*s/rad: alpha_2 in the paper, and what the terms of a law add.

    Where a term is negative, the viscous friction stays beyond the fastest speed that was measured, v_end, as large as
    it is there: nobody has seen it fall further.
    """
    if not p.law.terms:
        return p.alpha_2
    speed, fastest, lowest = ca.fabs(v), getattr(p, FASTEST), 0.0
    for name in p.law.coefficients:
        lowest = ca.fmin(lowest, getattr(p, name))
    beyond = ca.if_else(lowest < 0, ca.fmax(speed, fastest) / fastest, 1.0)
    return _rate_at(ca.if_else(lowest < 0, ca.fmin(speed, fastest), speed), p) / beyond


def _rate_at(speed: Expression, p: Lugre[Any] | Stribeck[Any]) -> Expression:
    return sum(getattr(p, name) * rate for name, rate in viscous_rates(speed, p.law).items())


def is_passive(p: Lugre[Any]) -> Expression:
    """Whether LuGre dissipates in every motion: alpha_2 > sigma_1 alpha_1 / alpha_0 (Barabanov and Ortega, 2000).

    With a deflection of at most g(0) / sigma_0, T_f v - d(sigma_0 z**2 / 2)/dt >= v**2 (f(v) / v - sigma_1 (g(0) - g(v))
    / g(v)), f the viscous friction. The last falls to sigma_1 alpha_1 / alpha_0 as the peak falls; f / v is alpha_2, and
    with a negative term as low as that is at v_end: up to there it is told.
    """
    lowest = p.alpha_2
    if p.law.terms:
        lowest = ca.fmin(lowest, _rate_at(getattr(p, FASTEST), p))
    return lowest > p.sigma_1 * p.alpha_1 / p.alpha_0


def relaxation(v: Expression, p: Lugre[Any]) -> Expression:
    """lambda(v) = sigma_0 abs(v) / g(v), 1/s: the rate at which the bristle forgets."""
    return p.sigma_0 * ca.fabs(v) / stribeck(v, p)


def bristle_rate(z: Expression, v: Expression, p: Lugre[Any], at: Expression | None = None) -> Expression:
    """dz/dt = v - lambda(v) z, rad/s (4).

    With `at`, lambda is evaluated at that velocity instead: the law is then linear in (z, v), which is what a coupled
    step freezes.
    """
    return v - relaxation(v if at is None else at, p) * z


def torque(z: Expression, v: Expression, p: Lugre[Any], at: Expression | None = None) -> Expression:
    """T_f = sigma_0 z + sigma_1 dz/dt + alpha_2 v, N*m (3), alpha_2 or what a law has in its place; `at` as in `bristle_rate`."""
    return p.sigma_0 * z + p.sigma_1 * bristle_rate(z, v, p, at) + viscous_rate(v if at is None else at, p) * v


def steady_deflection(v: Expression, p: Lugre[Any]) -> Expression:
    """z_ss = g(v) sgn(v) / sigma_0, rad: where dz/dt = 0."""
    return stribeck(v, p) * ca.sign(v) / p.sigma_0


def steady_torque(v: Expression, p: Lugre[Any] | Stribeck[Any]) -> Expression:
    """T_ss(v) = g(v) sgn(v) + alpha_2 v, N*m (9), alpha_2 or what a law has in its place."""
    return stribeck(v, p) * ca.sign(v) + viscous_rate(v, p) * v


def loading_displacement(T: Expression, g0: Expression, sigma_0: Expression) -> Expression:
    """y(T) = -(g0 / sigma_0) log(1 - T / g0), rad.

    How far slow loading from z = 0 moves the joint, 0 <= T < g0 = alpha_0 + alpha_1. The solution of (4) with T =
    sigma_0 z where v goes to zero from above: dz/dy = 1 - sigma_0 z / g(0). Its inverse is T = g0 (1 - exp(-sigma_0 y /
    g0)), which (14) takes for sigma_0 y.
    """
    return -(g0 / sigma_0) * ca.log1p(-T / g0)


DAMPING_RATIO = 0.1  # what (15) assumes of the bristle in presliding: 0.2 sqrt(J sigma_0) is 2 * 0.1 sqrt(J sigma_0)


def presliding_damping(sigma_0: Expression, J: Expression, damping_ratio: Expression) -> Expression:
    """sigma_1 = 2 damping_ratio sqrt(J sigma_0), N*m*s/rad: the damping of J on the bristle spring.

    (15) assumes a ratio of 0.1.
    """
    return 2 * damping_ratio * ca.sqrt(J * sigma_0)


def stribeck_shape(v: Expression, shape: Sequence[Expression], law: Law) -> Expression:
    """s(v) sgn(v), of v_s and what else the shape of the peak has: what multiplies alpha_1 in (9), the second column of (11)-(12)."""
    return law.peak.shape(v, *shape) * ca.sign(v)


def load_terms(q: Expression, v: Expression, a: Expression, tau: Expression) -> dict[str, Expression]:
    """What multiplies each parameter of the torque that is not friction, by that parameter's name.

    T = T_f + inertia dv/dt + offset + gravity_sin sin(q) + gravity_cos cos(q) + spring q + quadratic v abs(v) + links
    tau, of the position q (rad), the velocity, the acceleration a and the torque tau (N*m) that a robot's links ask of the joint.
    """
    return {
        "inertia": a,
        "offset": 1.0,
        "gravity_sin": ca.sin(q),
        "gravity_cos": ca.cos(q),
        "spring": q,
        "quadratic": v * ca.fabs(v),
        "links": tau,
    }


def load_levels(tau_m: Expression, tau_l: Expression) -> dict[str, Expression]:
    """What multiplies each coefficient by which the level rises with load, by its name: N*m, and its square.

    Gears lose torque in proportion to what they carry, so g = alpha_0 + alpha_1 s(v) + link_load abs(tau_l) + motor_load
    abs(tau_m) + gear_load abs(tau_m - tau_l) + gear_load_squared (tau_m - tau_l)**2, of the torque of the motor and that of
    gravity and links on the joint, N*m (M. Duclusaud, G. Passault, V. Padois and O. Ly, Extended friction models for the
    physics simulation of servo actuators, 2024). None is split by the sign of power: that rebuilds tau_l, and fits anything.
    """
    carried = tau_m - tau_l
    return {
        "link_load": ca.fabs(tau_l),
        "motor_load": ca.fabs(tau_m),
        "gear_load": ca.fabs(carried),
        "gear_load_squared": carried**2,
    }


def load_rise(rises: Mapping[str, Expression], tau_m: Expression, tau_l: Expression) -> Expression:
    """By how much a load raises the level, N*m: each coefficient, by name, times its load (`load_levels`)."""
    levels = load_levels(tau_m, tau_l)
    return sum(value * levels[name] for name, value in rises.items())


def loaded(p: Lugre[Any], level: Expression) -> Lugre[Any]:
    """The parameters where a load raises the level by so much (`load_levels`), N*m: alpha_0 and that."""
    return p._replace(alpha_0=p.alpha_0 + level)


def periodic_terms(q: Expression, v: Expression, k: Expression) -> dict[str, Expression]:
    """What multiplies each parameter of the torque that repeats with the position, at k rad per rad (or per m).

    Cogging is the same in both directions of motion, cogging_sin sin(k q) + cogging_cos cos(k q); a ripple is of
    friction, and turns with the motion: (ripple_sin sin(k q) + ripple_cos cos(k q)) sgn(v). Each is a sum over orders.
    """
    waves = {"sin": ca.sin(k * q), "cos": ca.cos(k * q)}
    cogging = {f"cogging_{name}": wave for name, wave in waves.items()}
    return cogging | {f"ripple_{name}": wave * ca.sign(v) for name, wave in waves.items()}


def adapted(p: Lugre[Any], theta: Mapping[str, Expression]) -> Lugre[Any]:
    """The parameters of the adaptive form (16)-(18): each named one times its gain.

    The paper's theta_1 scales alpha_0, theta_2 alpha_2.
    """
    return p._replace(**{name: gain * getattr(p, name) for name, gain in theta.items()})


def active(z: Expression, v: Expression, pair: Pair[Any]) -> Lugre[Any]:
    """The set that acts at (z, v) when the two directions differ.

    sigma_0 by the sign of z, all others by the sign of v. Every switched term is then multiplied by something that is
    zero at its switch, so T_f is continuous through each reversal, and the bristle remains a spring that gives back no
    more than it took.
    """
    positive, negative = pair
    by_v = (ca.if_else(v < 0, n, q) for q, n in zip(positive, negative, strict=True))
    return lugre_of(pair.law)(*by_v)._replace(sigma_0=ca.if_else(z < 0, negative.sigma_0, positive.sigma_0))


def rescaled_deflection(z: Expression, z_ss: Expression, harder: Expression) -> tuple[Expression, Expression]:
    """Where a bristle is that rose from zero to z towards z_ss, had it been `harder` times as stiff on the way.

    rad, and its derivative by z. While g is constant dz/dt = abs(v) (1 - z / z_ss) has z = z_ss (1 - exp(-way / z_ss)),
    and z_ss is as much smaller as the bristle is harder.
    """
    left = ca.fmin(ca.fmax(1 - z / (z_ss + 1e-200), 1e-200), 1.0)
    return -z_ss / harder * ca.expm1(harder * ca.log(left)), ca.fmin(left ** (harder - 1), 1.0)


def bristle_step(v0: Expression, v1: Expression, h: Expression, p: Lugre[Any]) -> tuple[Expression, Expression]:
    """The step z(t + h) = a z(t) + b of `bristle_change`: a = 1 - c, b. Returns (a, b), dimensionless and rad."""
    forgotten, b = bristle_change(v0, v1, h, p)
    return 1 - forgotten, b


def bristle_change(v0: Expression, v1: Expression, h: Expression, p: Lugre[Any]) -> tuple[Expression, Expression]:
    """The exact-exponential step z(t + h) = z(t) + b - c z(t) of (4), v going linearly from v0 to v1 of the same sign.

    dz/dt = lambda (z_ss - z) is linear in z. With z_ss linear over the step and lambda by Simpson's rule, x = h lambda,
    phi = (1 - exp(-x)) / x:  c = 1 - exp(-x),  b = c z_ss(v0) + (1 - phi) (z_ss(v1) - z_ss(v0)).
    Stable for any stiffness and any h; second order where x <~ 1. In this form z keeps its digits where it hardly
    changes, in single precision too. Returns (c, b), dimensionless and rad.
    """
    g0, g1 = stribeck(v0, p), stribeck(v1, p)
    gm = stribeck((v0 + v1) / 2, p)
    speed0, speed1 = ca.fabs(v0), ca.fabs(v1)
    x = h * (p.sigma_0 / 6) * (speed0 / g0 + 2 * (speed0 + speed1) / gm + speed1 / g1)
    forgotten = -ca.expm1(-x)
    phi = (forgotten + _TINY) / (x + _TINY)
    reach = ca.sign(v0 + v1) / p.sigma_0
    return forgotten, reach * (forgotten * g0 + (1 - phi) * (g1 - g0))
