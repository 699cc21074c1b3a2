"""Every `ca.Function` of the package, built from `law` and `motor`, once for a law.

Inputs and outputs are scalar and named; parameters are in the order of the law's tuple, of a `Pair` the positive set
first.
"""

from collections.abc import Mapping
from functools import cache
from typing import Any

import casadi as ca

from bristle.model import law, motor
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import Law
from bristle.model.parameters import Lugre, Motor, Pair, lugre_of, static_fields_of, static_of


@cache
def steady_torque_function(of: Law = GAUSSIAN) -> ca.Function:
    """(v, *Stribeck) -> T: the steady curve T_ss(v) of (9), N*m."""
    v, p, T = _steady(of)
    return _function("steady_torque", {"v": v, **p}, {"T": T})


@cache
def steady_jacobian_function(of: Law = GAUSSIAN) -> ca.Function:
    """(v, *Stribeck) -> the derivative of T_ss(v) (9) with respect to each, named `T_alpha_0` and so on."""
    v, p, T = _steady(of)
    return _function("steady_jacobian", {"v": v, **p}, _derivatives("T", T, p))


@cache
def linear_shapes_function(of: Law = GAUSSIAN) -> ca.Function:
    """(v) -> (T_alpha_0, T_alpha_2, ...): the factors of alpha_0, alpha_2 and a law's coefficients in (9)."""
    v, p, T = _steady(of)
    viscous = {f"T_{name}": v * rate for name, rate in law.viscous_rates(ca.fabs(v), of).items()}
    return _function("linear_shapes", {"v": v}, _derivatives("T", T, {"alpha_0": p["alpha_0"]}) | viscous)


@cache
def stribeck_shape_function(of: Law = GAUSSIAN) -> ca.Function:
    """(v, v_s, ...) -> s: what multiplies alpha_1 in (9), dimensionless."""
    v, shape = ca.SX.sym("v"), _symbols(*of.shape_parameters)
    return _function("stribeck_shape", {"v": v, **shape}, {"s": law.stribeck_shape(v, [*shape.values()], of)})


@cache
def stribeck_shape_slope_function(of: Law = GAUSSIAN) -> ca.Function:
    """(v, v_s, ...) -> (s, s_v_s, ...): `stribeck_shape` with its derivatives with respect to v_s, s/rad, and so on."""
    v, shape = ca.SX.sym("v"), _symbols(*of.shape_parameters)
    s = law.stribeck_shape(v, [*shape.values()], of)
    return _function("stribeck_shape_slope", {"v": v, **shape}, {"s": s, **_derivatives("s", s, shape)})


@cache
def load_terms_function() -> ca.Function:
    """(q, v, a, tau) -> `law.load_terms`, in that order."""
    s = _symbols("q", "v", "a", "tau")
    return _function("load_terms", s, law.load_terms(**s))


@cache
def load_levels_function() -> ca.Function:
    """(tau_m, tau_l) -> `law.load_levels` in that order, then the derivative of each by tau_l, then by tau_m."""
    s = _symbols("tau_m", "tau_l")
    levels = law.load_levels(**s)
    slopes = {f"{n}_{by}": ca.jacobian(x, s[by]) for by in ("tau_l", "tau_m") for n, x in levels.items()}
    return _function("load_levels", s, levels | slopes)


@cache
def periodic_terms_function() -> ca.Function:
    """(q, v, k) -> `law.periodic_terms`, in that order."""
    s = _symbols("q", "v", "k")
    return _function("periodic_terms", s, law.periodic_terms(**s))


@cache
def cogging_function(waves: tuple[tuple[float, float, float], ...]) -> ca.Function:
    """(q) -> the cogging torque of some waves, (k, cogging_sin, cogging_cos) each, by `law.periodic_terms`, N*m."""
    q = ca.SX.sym("q")
    terms = [(law.periodic_terms(q, ca.SX(0), k), a, b) for k, a, b in waves]
    torque = sum((a * x["cogging_sin"] + b * x["cogging_cos"] for x, a, b in terms), ca.SX(0))
    return ca.Function("cogging", [q], [torque])


def drive_torque_slopes_function() -> ca.Function:
    """(V, w, k_t, R) -> (T_V, T_k_t, T_R): derivatives of `motor.drive_torque` (7)-(8), N*m/V, A and N*m/ohm."""
    s = _symbols("V", "w", "k_t", "R")
    T = motor.drive_torque(s["V"], s["w"], Motor(s["k_t"], s["R"], 0.0, 1.0))
    return _function("drive_torque_slopes", s, _derivatives("T", T, {name: s[name] for name in ("V", "k_t", "R")}))


@cache
def loading_displacement_function() -> ca.Function:
    """(T, g0, sigma_0) -> (y, y_T, y_g0, y_sigma_0): `law.loading_displacement`, rad, with its derivatives."""
    s = _symbols("T", "g0", "sigma_0")
    y = law.loading_displacement(**s)
    return _function("loading_displacement", s, {"y": y, **_derivatives("y", y, s)})


@cache
def presliding_damping_function() -> ca.Function:
    """(sigma_0, J, damping_ratio) -> (sigma_1, sigma_1_sigma_0, sigma_1_J): (15), with its derivatives."""
    s = _symbols("sigma_0", "J", "damping_ratio")
    sigma_1 = law.presliding_damping(s["sigma_0"], s["J"], s["damping_ratio"])
    free = {name: s[name] for name in ("sigma_0", "J")}
    return _function("presliding_damping", s, {"sigma_1": sigma_1, **_derivatives("sigma_1", sigma_1, free)})


@cache
def faded_sine_function() -> ca.Function:
    """(t, amplitude, frequency, phase, duration, rest) -> (x, x_t, x_tt): a sine faded in and out over `rest`."""
    s = _symbols("t", "amplitude", "frequency", "phase", "duration", "rest")
    r = ca.fmin(ca.fmax(ca.fmin(s["t"], s["duration"] - s["t"]) / s["rest"], 0), 1)
    x = s["amplitude"] * r**3 * (10 - 15 * r + 6 * r**2) * ca.sin(2 * ca.pi * s["frequency"] * s["t"] + s["phase"])
    x_t = ca.jacobian(x, s["t"])
    return _function("faded_sine", s, {"x": x, "x_t": x_t, "x_tt": ca.jacobian(x_t, s["t"])})


@cache
def torque_function(of: Law = GAUSSIAN) -> ca.Function:
    """(z, v, *Lugre) -> T: the friction torque T_f of (3)-(5), N*m."""
    s, p = _symbols("z", "v"), _lugre(of)
    return _function("torque", {**s, **p._asdict()}, {"T": law.torque(s["z"], s["v"], p)})


@cache
def torque_sensitivity_function(of: Law = GAUSSIAN) -> ca.Function:
    """(z, v, *Lugre) -> (T, T_z, T_alpha_0, ..., T_sigma_1): T_f with its partial derivatives."""
    z, v, p = ca.SX.sym("z"), ca.SX.sym("v"), _lugre(of)
    T, by = law.torque(z, v, p), {"z": z, **p._asdict()}
    return _function("torque_sensitivity", {"z": z, "v": v, **p._asdict()}, {"T": T, **_derivatives("T", T, by)})


@cache
def steady_deflection_function(of: Law = GAUSSIAN) -> ca.Function:
    """(v, *Lugre) -> (z, z_alpha_0, ..., z_sigma_1): the deflection where dz/dt = 0, rad, with its derivatives."""
    v, p = ca.SX.sym("v"), _lugre(of)
    z = law.steady_deflection(v, p)
    return _function("steady_deflection", {"v": v, **p._asdict()}, {"z": z, **_derivatives("z", z, p._asdict())})


@cache
def step_function(of: Law = GAUSSIAN) -> ca.Function:
    """(v0, v1, h, *Lugre) -> (a, b): the bristle step z(t + h) = a z(t) + b of `law.bristle_step`."""
    inputs, _, outputs = _step(of)
    return _function("step", inputs, outputs)


@cache
def step_parameters(of: Law = GAUSSIAN) -> tuple[str, ...]:
    """The parameters of the bristle step, in the order of `Lugre`: not sigma_1 and alpha_2."""
    _, p, outputs = _step(of)
    depends = ca.which_depends(ca.vertcat(*outputs.values()), ca.vertcat(*p), 1, False)
    return tuple(name for name, enters in zip(p._fields, depends, strict=True) if enters)


@cache
def step_sensitivity_function(of: Law = GAUSSIAN) -> ca.Function:
    """(v0, v1, h, *Lugre) -> (a, b, a_p..., b_p...): the step and its derivatives by `step_parameters`."""
    inputs, p, outputs = _step(of)
    return _function("step_sensitivity", inputs, outputs | _by_parameters(p, outputs))


@cache
def change_sensitivity_function(of: Law = GAUSSIAN) -> ca.Function:
    """(v0, v1, h, *Lugre) -> (c, b, c_p..., b_p...): `law.bristle_change`, its derivatives by `step_parameters`."""
    s, p = _symbols("v0", "v1", "h"), _lugre(of)
    c, b = ca.cse([*law.bristle_change(s["v0"], s["v1"], s["h"], p)])
    outputs = {"c": c, "b": b}
    return _function("change_sensitivity", s | p._asdict(), outputs | _by_parameters(p, outputs))


def _by_parameters(p: Lugre[Any], outputs: Mapping[str, Any]) -> dict[str, Any]:
    """Derivatives of some outputs by the parameters of the step."""
    free = {name: getattr(p, name) for name in step_parameters(p.law)}
    return {key: slope for name, value in outputs.items() for key, slope in _derivatives(name, value, free).items()}


@cache
def active_function(of: Law = GAUSSIAN) -> ca.Function:
    """(z, v, *positive, *negative) -> *Lugre: the set of a pair that acts at (z, v), by `law.active`."""
    s, pair = _symbols("z", "v"), Pair(_lugre(of, "_positive"), _lugre(of, "_negative"))
    inputs = {x.name(): x for x in (*s.values(), *pair.positive, *pair.negative)}
    return _function("active", inputs, law.active(s["z"], s["v"], pair)._asdict())


def _symbols(*names: str) -> dict[str, Any]:
    return {name: ca.SX.sym(name) for name in names}


def _lugre(of: Law, suffix: str = "") -> Lugre[Any]:
    kind = lugre_of(of)
    return kind(*(ca.SX.sym(name + suffix) for name in kind._fields))


def _step(of: Law) -> tuple[dict[str, Any], Lugre[Any], dict[str, Any]]:
    s, p = _symbols("v0", "v1", "h"), _lugre(of)
    a, b = ca.cse([*law.bristle_step(s["v0"], s["v1"], s["h"], p)])  # what is written once is differentiated once
    return s | p._asdict(), p, {"a": a, "b": b}


def _steady(of: Law) -> tuple[Any, dict[str, Any], Any]:
    v, p = ca.SX.sym("v"), _symbols(*static_fields_of(of))
    return v, p, law.steady_torque(v, static_of(of)(**p))


def _derivatives(name: str, expression: Any, by: Mapping[str, Any]) -> dict[str, Any]:
    jacobian = ca.jacobian(expression, ca.vertcat(*by.values()))
    return {f"{name}_{parameter}": jacobian[i] for i, parameter in enumerate(by)}


def _function(name: str, inputs: Mapping[str, Any], outputs: Mapping[str, Any]) -> ca.Function:
    expressions = ca.cse([ca.densify(expression) for expression in outputs.values()])
    return ca.Function(name, list(inputs.values()), expressions, list(inputs), list(outputs))
