"""The full nonlinear fit beside the grid: the same data by CasADi + IPOPT, all static parameters at once, from several starts.

Nothing of the grid is used but its range of v_s: the model is the law's own expression (9) on CasADi symbols, derivatives are exact, variables
are scaled (v_s by its logarithm), and the starts are random with a fixed seed.
"""

from typing import Any

import casadi as ca
import numpy as np

from bristle.identification.estimate import Crosscheck
from bristle.identification.regression import Regression
from bristle.identification.static import GRID, log_grid
from bristle.model import law
from bristle.model.arrays import Array
from bristle.model.parameters import Lugre

STARTS, MOVING_STARTS = 8, 3
"""Random starts of the full fit, on points and on moving data, where each costs as much as all those on points."""
SEED = 0
_SAME = 1e-6
"""Relative difference in cost below which two minima are the same."""
_IPOPT = {"print_level": 0, "sb": "yes", "tol": 1e-11, "max_iter": 300, "bound_relax_factor": 0.0}
_OPTIONS: dict[str, Any] = {"print_time": False, "error_on_fail": False, "ipopt": _IPOPT}


def full_fit(
    problem: Regression, v_s_range: tuple[float, float], starts: int = STARTS, seed: int = SEED
) -> tuple[Array, float, Array]:
    """All parameters of a static problem at once, by IPOPT.

    Args:
        problem: the data.
        v_s_range: bounds of v_s, rad/s.
        starts: random starts, >= 1.
        seed: of the starts.

    Returns:
        theta at the lowest cost found, in the order of the problem's `names`; that cost; and the cost where each start ended, (starts,).
    """
    torque_scale = float(np.abs(problem.torque).max()) or 1.0
    scale = _scale(problem, torque_scale)
    count = len(problem.peaks)
    x = ca.MX.sym("x", len(problem.names))
    linear = len(problem.names) - count
    theta = ca.vertcat(x[:linear] * scale[:linear], ca.exp(x[linear:]))
    residual = _residuals(problem, theta, v_s_range) / torque_scale
    nlp: dict[str, Any] = {"x": x, "f": ca.dot(residual, residual)}
    solver = ca.nlpsol("full", "ipopt", nlp, _options(x, residual, points=problem.smooth is None))
    log_range = np.log(v_s_range)
    lower = np.concatenate([problem.lower, np.zeros(count), np.full(count, log_range[0])])
    upper = np.concatenate([np.full(linear, np.inf), np.full(count, log_range[1])])
    rng = np.random.default_rng(seed)
    ends = []
    for _ in range(starts):
        x0 = rng.uniform(0.0, 1.0, len(problem.names))
        x0[linear:] = rng.uniform(log_range[0], log_range[1], count)
        values = np.asarray(solver(x0=x0, lbx=lower, ubx=upper)["x"]).ravel()
        ends.append(np.append(values[:linear] * scale[:linear], np.exp(values[linear:])))
    costs = np.array([float(np.sum(problem.residuals(end) ** 2)) for end in ends])
    best = int(costs.argmin())
    return ends[best], float(costs[best]), costs


def crosscheck(
    problem: Regression,
    theta: Array,
    cost: float,
    standard_errors: Array,
    v_s_range: tuple[float, float],
) -> Crosscheck:
    """The full fit beside the grid's: costs, parameters in units of the grid fit's standard errors, and a verdict.

    Args:
        problem: the data.
        theta: the grid's answer, in the order of the problem's `names`.
        cost: the grid's cost.
        standard_errors: of theta; nan where there is none.
        v_s_range: the range that the grid searched.
    """
    starts = STARTS if problem.smooth is None else MOVING_STARTS
    full, cost_full, costs = full_fit(problem, v_s_range, starts)
    tolerance = _SAME * cost_full + 1e-14 * float(problem.torque @ problem.torque)
    known = np.isfinite(standard_errors) & (standard_errors > 0)
    difference = {
        name: float((f - g) / s)
        for name, f, g, s, k in zip(problem.names, full, theta, standard_errors, known, strict=True)
        if k
    }
    reached = int(np.count_nonzero(costs <= cost_full + tolerance))
    return Crosscheck(
        cost_grid=cost,
        cost_full=cost_full,
        starts=starts,
        reached=reached,
        parameters=dict(zip(problem.names, map(float, full), strict=True)),
        difference_in_se=difference,
        verdict=_verdict(cost, cost_full, tolerance, difference, reached, starts),
    )


def _verdict(
    cost: float, full: float, tolerance: float, difference: dict[str, float], reached: int, starts: int
) -> str:
    ended = f"{reached} of {starts} random starts of the full fit ended in its best minimum"
    if cost > full + tolerance:
        return f"The full nonlinear fit found a lower cost than the grid ({full:.6g} against {cost:.6g}); trust neither before you know why. {ended}."
    if full > cost + tolerance:
        return f"The grid found a lower cost than any start of the full nonlinear fit ({cost:.6g} against {full:.6g})."
    worst = max(map(abs, difference.values()), default=0.0)
    return f"Grid and full nonlinear fit agree: the largest difference is {worst:.2g} standard errors. {ended[0].upper()}{ended[1:]}."


def _scale(problem: Regression, torque_scale: float) -> Array:
    """A typical size of each parameter: the torque over the column's largest entry."""
    columns = np.abs(problem.linear).max(axis=0)
    columns[columns == 0] = 1.0
    count = len(problem.peaks)
    return np.concatenate([torque_scale / columns, np.full(count, torque_scale), np.ones(count)])


def _options(x: ca.MX, residual: ca.MX, *, points: bool) -> dict[str, Any]:
    """Exact Hessians for points; for many moving samples the exact Gauss-Newton Hessian, 2 J'J, which costs a hundredth."""
    if points:
        return _OPTIONS
    jacobian = ca.jacobian(residual, x)
    weight, unused = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", 0)
    hessian = ca.triu(2 * weight * ca.mtimes(jacobian.T, jacobian))
    limited = {**_IPOPT, "max_iter": 100, "tol": 1e-9}  # each step passes over all samples
    return _OPTIONS | {
        "ipopt": limited,
        "hess_lag": ca.Function("hess_lag", [x, ca.MX.sym("p", 0), weight, unused], [hessian]),
    }


def _residuals(problem: Regression, theta: ca.MX, v_s_range: tuple[float, float]) -> ca.MX:
    """Measured minus modelled torque as a CasADi expression.

    Smoothed equations are first rotated into the few directions in which the model can move at all; what is left of the cost is a constant.
    """
    value = dict(zip(problem.names, ca.vertsplit(theta), strict=True))
    velocity = ca.DM(problem.velocity)
    friction = ca.MX.zeros(problem.velocity.size)
    for direction in problem.directions:
        tag = "" if len(problem.directions) == 1 else direction
        alpha_1, v_s = value.get("alpha_1" + tag, 0.0), value.get("v_s" + tag, 1.0)
        p = Lugre(value["alpha_0" + tag], alpha_1, value["alpha_2" + tag], v_s, 1.0, 0.0)
        moving = (
            np.where(problem.velocity > 0 if tag == "+" else problem.velocity < 0, 1.0, 0.0)
            if tag
            else np.ones(velocity.numel())
        )
        friction += ca.DM(moving) * law.steady_torque(velocity, p)
    known = 2 * len(problem.directions)
    columns = problem.linear[:, known:]
    extra = ca.vertcat(*(value[name] for name in problem.linear_names[known:]))
    if problem.smooth is None:
        weight = 1.0 if problem.root_weight is None else ca.DM(problem.root_weight)
        return ca.DM(problem.torque) - weight * friction - ca.mtimes(ca.DM(columns), extra)
    basis = _basis(problem, v_s_range)
    to_basis = (problem.smooth.T @ (basis if problem.root_weight is None else basis * problem.root_weight[:, None])).T
    return (
        ca.DM(basis.T @ problem.torque)
        - ca.mtimes(ca.DM(to_basis), friction)
        - ca.mtimes(ca.DM(basis.T @ columns), extra)
    )


def _basis(problem: Regression, v_s_range: tuple[float, float]) -> Array:
    """Orthonormal directions, (n, r), that span the model's columns for every v_s in the range, to 1e-8."""
    values = log_grid(v_s_range, GRID)
    shapes = [problem.shapes(values, k) for k in range(len(problem.peaks))]
    columns = np.column_stack([problem.linear, *shapes, problem.torque])
    left, lengths, _ = np.linalg.svd(columns / np.linalg.norm(columns, axis=0), full_matrices=False)
    kept: Array = left[:, lengths > 1e-8 * lengths[0]]
    return kept
