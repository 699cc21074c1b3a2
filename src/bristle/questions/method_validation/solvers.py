"""Grids and local solvers for velocity-torque points of one direction.

Torques are (n, sets) at the same velocities, theta (p, sets) in the order of the case's `names`; other shape parameters
of a peak than v_s are held at their true values. Local solvers take log(v_s), and stay within the grid's bounds.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib.util import find_spec
from typing import Any

import casadi as ca
import numpy as np
from scipy.optimize import least_squares

from bristle.arrays import Array, result
from bristle.estimation.ipopt import ends, natural, solver
from bristle.estimation.nonlinear import Unknowns
from bristle.identification.static import grid
from bristle.identification.static.crosscheck import OPTIONS
from bristle.identification.static.problem import Regression, from_points, unknowns_of
from bristle.model import law
from bristle.model.functions import steady_torque_function
from bristle.model.laws.parts import Law
from bristle.model.parameters import ParameterName, Stribeck
from bristle.model.vectorize import evaluate

LMFIT = find_spec("lmfit") is not None  # whether lmfit is installed

Local = Callable[[Array, Array], Array]  # from torques (n,) and a start theta (p,) to theta (p,)


@result
class ValidationCase:
    """One direction of a joint, to be simulated at some velocities."""

    label: str
    design: str  # the velocities in words
    truth: Stribeck[float]  # parameters that the points are simulated from
    velocity: Array  # rad/s, (n,), none zero, n > p
    noise: float  # standard deviation of a point's torque, N*m, > 0
    v_s_range: tuple[float, float]  # where v_s is searched, rad/s

    @property
    def names(self) -> tuple[str, ...]:
        """Names of theta, in order; v_s is the last."""
        return case_names(self.truth.law)

    @property
    def theta(self) -> Array:
        """The truth in the order of `names`, (p,)."""
        return np.array([getattr(self.truth, name) for name in self.names])

    def parameters(self, theta: Sequence[Any] | Array) -> Stribeck[Any]:
        """The law's parameters with theta in place of the truth."""
        return self.truth._replace(**dict(zip(self.names, theta, strict=True)))

    @property
    def unknowns(self) -> Unknowns[ParameterName]:
        """The parameters as local solvers take them, scaled by the true torque."""
        return unknowns_of(self.problem(modelled(self, self.theta[:, None])[:, 0]), self.v_s_range)

    def problem(self, torque: Array) -> Regression:
        """The static problem of one data set, torque (n,)."""
        law = self.truth.law
        shape = tuple(getattr(self.truth, name) for name in law.shape_parameters[1:])
        return replace(from_points(self.velocity, torque, ("both",), law=law), shape=shape)


def case_names(of: Law) -> tuple[str, ...]:
    """Fitted parameters of a law, in the order of theta."""
    return ("alpha_0", "alpha_2", *of.coefficients, "alpha_1", "v_s")


def modelled(case: ValidationCase, theta: Array) -> Array:
    """T_ss (9) at the case's velocities for theta (p, sets): (n, sets), N*m."""
    p = case.parameters(theta)
    (torque,) = evaluate(steady_torque_function(p.law), case.velocity[:, None], *p)
    return torque


def costs(case: ValidationCase, torques: Array, theta: Array) -> Array:
    """J_s (10) of each set at its theta, (sets,), (N*m)**2."""
    residuals = torques - modelled(case, theta)
    return np.asarray(np.einsum("ns,ns->s", residuals, residuals))


def random_starts(case: ValidationCase, count: int, rng: np.random.Generator) -> Array:
    """Starts within the grid's bounds, (count, p): alphas uniform up to their typical sizes, v_s log-uniform."""
    linear = rng.uniform(0.0, 1.0, (count, len(case.names) - 1)) * case.unknowns.scale[:-1]
    low, high = np.log(case.v_s_range)
    return np.concatenate([linear, np.exp(rng.uniform(low, high, (count, 1)))], axis=1)


def plain(case: ValidationCase, torques: Array, count: int) -> Array:
    """`static.plain_grid` of `count` values for many sets."""
    return grid.plain_grids(case.problem(torques[:, 0]), torques, case.v_s_range, count)


def refined(case: ValidationCase, torques: Array) -> Array:
    """`static.solve`, set by set."""
    return np.stack([grid.solve(case.problem(torque), case.v_s_range).theta for torque in torques.T], axis=1)


def ipopt(case: ValidationCase, *, free: bool = False) -> Local:
    """All parameters at once by CasADi and IPOPT; `free`: v_s up to 1000 times beyond the grid's range."""
    unknowns = case.unknowns
    beyond = np.where(unknowns.logarithmic, np.log(1000), 0.0) * free
    unknowns = replace(unknowns, lower=unknowns.lower - beyond, upper=unknowns.upper + beyond)
    x, torque, top = ca.SX.sym("x", len(case.names)), ca.SX.sym("torque", case.velocity.size), float(unknowns.scale[0])
    curve = law.steady_torque(ca.DM(case.velocity), case.parameters(natural(unknowns, x)))
    residual = (torque - curve) / top
    full = solver("full", x, ca.dot(residual, residual), torque, **OPTIONS)

    def fit(measured: Array, start: Array) -> Array:
        return unknowns.natural(ends(full, unknowns, [_scaled(unknowns, start)], p=measured)[0])

    return fit


def trf(case: ValidationCase) -> Local:
    """SciPy's least_squares: trust region reflective within the bounds, exact Jacobian."""
    unknowns = case.unknowns
    lower, upper, top = unknowns.lower, unknowns.upper, float(unknowns.scale[0])

    def fit(measured: Array, start: Array) -> Array:
        # Residuals are scaled by the largest torque.
        problem = case.problem(measured)

        def residuals(x: Array) -> Array:
            return problem.residuals(unknowns.natural(x)) / top

        def jacobian(x: Array) -> Array:
            return np.asarray(-problem.jacobian(unknowns.natural(x)) * unknowns.slopes(x) / top)

        x0 = np.clip(_scaled(unknowns, start), lower, upper)
        tight = 1e-12  # ends in a minimum, not before
        found = least_squares(residuals, x0, jacobian, (lower, upper), method="trf", ftol=tight, xtol=tight, gtol=tight)
        return unknowns.natural(found.x)

    return fit


def _scaled(unknowns: Unknowns[ParameterName], theta: Array) -> Array:
    return unknowns.scaled(dict(zip(unknowns.names, theta.tolist(), strict=True)))


def lmfit(case: ValidationCase) -> Local:
    """Lmfit's default: Levenberg-Marquardt on transformed variables, with finite differences."""
    from lmfit import Parameters, minimize

    names, (low, high), least = case.names, case.v_s_range, case.problem(np.zeros(case.velocity.size)).least

    def fit(measured: Array, start: Array) -> Array:
        problem, parameters = case.problem(measured), Parameters()
        for name, value, lowest in zip(names[:-1], start[:-1].tolist(), least[:-1].tolist(), strict=True):
            parameters.add(name, value=value, min=lowest)
        parameters.add(names[-1], value=float(np.clip(start[-1], low, high)), min=low, max=high)

        def residuals(at: Parameters) -> Array:
            return problem.residuals(np.array([at[name].value for name in names]))

        found = minimize(residuals, parameters).params
        return np.array([found[name].value for name in names])

    return fit


def local_methods(case: ValidationCase) -> dict[str, Local]:
    """The local solvers of a case by name; lmfit if it is installed."""
    found = {"IPOPT": ipopt(case), "SciPy TRF": trf(case)}
    return found | {"lmfit": lmfit(case)} if LMFIT else found
