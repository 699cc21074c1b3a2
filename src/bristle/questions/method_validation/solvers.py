"""The methods compared: grids, and local solvers from a start, for velocity-torque points of one direction.

Each takes torques (n, sets) that share their velocities and returns theta (4, sets), in the order of `NAMES`, which is `Regression.names`'.
Local solvers see the same scaled variables, v_s by its logarithm, and stay within the grid's bounds: alpha >= 0, v_s in its range.
"""

from collections.abc import Callable
from dataclasses import replace
from importlib.util import find_spec

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
from bristle.model.functions import steady_jacobian_function, steady_torque_function
from bristle.model.parameters import ParameterName, Stribeck
from bristle.model.vectorize import evaluate

NAMES = ("alpha_0", "alpha_2", "alpha_1", "v_s")
"""Order of theta."""
LMFIT = find_spec("lmfit") is not None
"""Whether lmfit is installed."""
_BEYOND = 1e3
"""How far beyond the grid's range v_s may go where it is set free, as a factor."""
_TOLERANCE = 1e-12
"""Of SciPy's solver, so that it ends in a minimum and not before."""

Local = Callable[[Array, Array], Array]
"""From torques (n,) and a start theta (4,) to theta (4,)."""


@result
class ValidationCase:
    """What is simulated: one direction of a joint, measured at some velocities."""

    label: str
    design: str
    """The velocities in words."""
    truth: Stribeck[float]
    """Parameters that the points are simulated from."""
    velocity: Array
    """rad/s, (n,), none zero, n > 4."""
    noise: float
    """Standard deviation of a point's torque, N*m, > 0."""
    v_s_range: tuple[float, float]
    """Where v_s is searched, rad/s."""

    @property
    def theta(self) -> Array:
        """The truth in the order of `NAMES`, (4,)."""
        return np.array([getattr(self.truth, name) for name in NAMES])

    @property
    def unknowns(self) -> Unknowns[ParameterName]:
        """The parameters as local solvers see them, over sizes that go with the true torque."""
        return unknowns_of(self.problem(modelled(self, self.theta[:, None])[:, 0]), self.v_s_range)

    def problem(self, torque: Array) -> Regression:
        """The static problem of one data set, torque (n,)."""
        return from_points(self.velocity, torque, ("both",))


def modelled(case: ValidationCase, theta: Array) -> Array:
    """T_ss (9) at the case's velocities for theta (4, sets): (n, sets), N*m."""
    alpha_0, alpha_2, alpha_1, v_s = theta
    (torque,) = evaluate(steady_torque_function(), case.velocity[:, None], alpha_0, alpha_1, alpha_2, v_s)
    return torque


def costs(case: ValidationCase, torques: Array, theta: Array) -> Array:
    """J_s (10) of each set at its theta, (sets,), (N*m)**2."""
    residuals = torques - modelled(case, theta)
    total: Array = np.einsum("ns,ns->s", residuals, residuals)
    return total


def jacobians(case: ValidationCase, theta: Array) -> Array:
    """Exact derivative of the modelled torque with respect to theta (4, sets): (sets, n, 4)."""
    alpha_0, alpha_2, alpha_1, v_s = theta[..., None]
    by = evaluate(steady_jacobian_function(), case.velocity, alpha_0, alpha_1, alpha_2, v_s)
    return np.stack([by[0], by[2], by[1], by[3]], axis=-1)


def random_starts(case: ValidationCase, count: int, rng: np.random.Generator) -> Array:
    """Starts anywhere within the grid's bounds, (count, 4): alphas uniform up to their typical sizes, v_s even in its logarithm."""
    linear = rng.uniform(0.0, 1.0, (count, 3)) * case.unknowns.scale[:3]
    low, high = np.log(case.v_s_range)
    v_s = np.exp(rng.uniform(low, high, (count, 1)))
    return np.concatenate([linear, v_s], axis=1)


def plain(case: ValidationCase, torques: Array, count: int) -> Array:
    """`static.plain_grid` of `count` values for many sets."""
    return grid.plain_grids(case.problem(torques[:, 0]), torques, case.v_s_range, count)


def refined(case: ValidationCase, torques: Array) -> Array:
    """`static.solve`, set by set."""
    return np.stack([grid.solve(case.problem(torque), case.v_s_range).theta for torque in torques.T], axis=1)


def ipopt(case: ValidationCase, *, free: bool = False) -> Local:
    """All parameters at once by CasADi and IPOPT, built once, each data set a parameter; `free`: v_s up to 1000 times beyond the grid's range."""
    unknowns = case.unknowns
    beyond = np.where(unknowns.logarithmic, np.log(_BEYOND), 0.0) * free
    unknowns = replace(unknowns, lower=unknowns.lower - beyond, upper=unknowns.upper + beyond)
    x, torque, top = ca.SX.sym("x", 4), ca.SX.sym("torque", case.velocity.size), float(unknowns.scale[0])
    alpha_0, alpha_2, alpha_1, v_s = natural(unknowns, x)
    curve = law.steady_torque(ca.DM(case.velocity), Stribeck(alpha_0, alpha_1, alpha_2, v_s))
    residual = (torque - curve) / top
    full = solver("full", x, ca.dot(residual, residual), torque, **OPTIONS)

    def fit(measured: Array, start: Array) -> Array:
        """Where IPOPT ends."""
        return unknowns.natural(ends(full, unknowns, [_scaled(unknowns, start)], p=measured)[0])

    return fit


def trf(case: ValidationCase) -> Local:
    """SciPy's least_squares: trust region reflective within the bounds, exact Jacobian."""
    unknowns = case.unknowns
    lower, upper, top = unknowns.lower, unknowns.upper, float(unknowns.scale[0])

    def fit(measured: Array, start: Array) -> Array:
        """Where SciPy ends; residuals are scaled by the largest torque."""
        problem = case.problem(measured)

        def residuals(x: Array) -> Array:
            """Measured minus modelled torque, (n,)."""
            return problem.residuals(unknowns.natural(x)) / top

        def jacobian(x: Array) -> Array:
            """Its exact derivative with respect to x, (n, 4)."""
            slopes: Array = -problem.jacobian(unknowns.natural(x)) * unknowns.slopes(x) / top
            return slopes

        x0 = np.clip(_scaled(unknowns, start), lower, upper)
        found = least_squares(
            residuals, x0, jacobian, (lower, upper), method="trf", ftol=_TOLERANCE, xtol=_TOLERANCE, gtol=_TOLERANCE
        )
        return unknowns.natural(found.x)

    return fit


def _scaled(unknowns: Unknowns[ParameterName], theta: Array) -> Array:
    return unknowns.scaled(dict(zip(unknowns.names, theta.tolist(), strict=True)))


def lmfit(case: ValidationCase) -> Local:
    """The default of lmfit (Levenberg-Marquardt on transformed variables, differences for derivatives), with the same bounds and start."""
    from lmfit import Parameters, minimize

    names, (low, high) = NAMES, case.v_s_range

    def fit(measured: Array, start: Array) -> Array:
        """Where lmfit ends."""
        problem, parameters = case.problem(measured), Parameters()
        for name, value in zip(names[:3], start[:3].tolist(), strict=True):
            parameters.add(name, value=value, min=0.0)
        parameters.add(names[3], value=float(np.clip(start[3], low, high)), min=low, max=high)

        def residuals(at: Parameters) -> Array:
            """Measured minus modelled torque, (n,)."""
            return problem.residuals(np.array([at[name].value for name in names]))

        found = minimize(residuals, parameters).params
        return np.array([found[name].value for name in names])

    return fit


def local_methods(case: ValidationCase) -> dict[str, Local]:
    """The local solvers by name, ready for the case; lmfit where it is installed."""
    found = {"IPOPT": ipopt(case), "SciPy TRF": trf(case)}
    return found | {"lmfit": lmfit(case)} if LMFIT else found
