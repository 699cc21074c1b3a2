"""The full nonlinear fit beside the grid: the same data by CasADi + IPOPT, all static parameters at once, from several starts.

Nothing of the grid is used but its range of v_s: the model is the law's own expression (9) on CasADi symbols, derivatives are exact, variables
are scaled (v_s by its logarithm), and the starts are random with a fixed seed.
"""

import casadi as ca
import numpy as np

from bristle.identification.estimate import Crosscheck
from bristle.identification.regression import Regression
from bristle.model import law
from bristle.model.arrays import Array
from bristle.model.parameters import Lugre

STARTS = 8
"""Random starts of the full fit."""
SEED = 0
_SAME = 1e-6
"""Relative difference in cost below which two minima are the same."""
_OPTIONS = {
    "print_time": False,
    "error_on_fail": False,
    "ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-11, "max_iter": 300, "bound_relax_factor": 0.0},
}


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
    residual = (problem.torque - _model(problem, theta)) / torque_scale
    options = (
        _OPTIONS
        if problem.smooth is None
        else _OPTIONS | {"ipopt": {**_OPTIONS["ipopt"], "hessian_approximation": "limited-memory"}}
    )
    solver = ca.nlpsol("full", "ipopt", {"x": x, "f": ca.dot(residual, residual)}, options)
    log_range = np.log(v_s_range)
    lower = np.concatenate([problem.lower, np.zeros(count), np.full(count, log_range[0])])
    upper = np.concatenate([np.full(linear, np.inf), np.full(count, log_range[1])])
    rng = np.random.default_rng(seed)
    ends, costs = [], []
    for _ in range(starts):
        x0 = rng.uniform(0.0, 1.0, len(problem.names))
        x0[linear:] = rng.uniform(*log_range, count)
        found = solver(x0=x0, lbx=lower, ubx=upper)
        values = np.asarray(found["x"]).ravel()
        ends.append(np.append(values[:linear] * scale[:linear], np.exp(values[linear:])))
        costs.append(float(found["f"]) * torque_scale**2)
    best = int(np.argmin(costs))
    return ends[best], costs[best], np.array(costs)


def crosscheck(
    problem: Regression,
    theta: Array,
    cost: float,
    standard_errors: Array,
    v_s_range: tuple[float, float],
    starts: int = STARTS,
) -> Crosscheck:
    """The full fit beside the grid's: costs, parameters in units of the grid fit's standard errors, and a verdict.

    Args:
        problem: the data.
        theta: the grid's answer, in the order of the problem's `names`.
        cost: the grid's cost.
        standard_errors: of theta; nan where there is none.
        v_s_range: the range that the grid searched.
        starts: random starts.
    """
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


def _model(problem: Regression, theta: ca.MX) -> ca.MX:
    """The modelled torque as a CasADi expression, shape (n, 1)."""
    value = dict(zip(problem.names, ca.vertsplit(theta), strict=True))
    velocity = ca.DM(problem.velocity)
    raw = ca.MX.zeros(problem.velocity.size)
    for direction in problem.directions:
        tag = "" if len(problem.directions) == 1 else direction
        p = Lugre(
            value["alpha_0" + tag],
            value.get("alpha_1" + tag, 0.0),
            value["alpha_2" + tag],
            value.get("v_s" + tag, 1.0),
            1.0,
            0.0,
        )
        moving = (
            1.0 if not tag else ca.DM(np.where(problem.velocity > 0 if tag == "+" else problem.velocity < 0, 1.0, 0.0))
        )
        raw += moving * law.steady_torque(velocity, p)
    torque = raw if problem.smooth is None else ca.mtimes(_sparse(problem), raw)
    if problem.root_weight is not None:
        torque *= problem.root_weight
    friction = 2 * len(problem.directions)
    extra = [value[name] for name in problem.linear_names[friction:]]
    return torque + ca.mtimes(ca.DM(problem.linear[:, friction:]), ca.vertcat(*extra)) if extra else torque


def _sparse(problem: Regression) -> ca.DM:
    matrix = problem.smooth.tocsc()  # type: ignore[union-attr]  # only called where there is one
    pattern = ca.Sparsity(*matrix.shape, matrix.indptr.tolist(), matrix.indices.tolist())
    return ca.DM(pattern, matrix.data)
