"""The full nonlinear fit beside the grid: the same data by CasADi + IPOPT, all static parameters at once, from several starts.

Nothing of the grid is used but its range of v_s: the model is the law's own expression (9) on CasADi symbols, derivatives are exact, variables
are scaled (v_s by its logarithm), and the starts are random with a fixed seed.
"""

import casadi as ca
import numpy as np

from bristle.arrays import Array
from bristle.diagnostics import Diagnostic, Kind
from bristle.estimation.ipopt import solver
from bristle.identification.results import Crosscheck
from bristle.identification.static.compression import reduced
from bristle.identification.static.problem import Regression
from bristle.model import law
from bristle.model.parameters import Stribeck

STARTS = 8
"""Random starts of the full fit."""
SEED = 0
_SAME = 1e-6
"""Relative difference in cost below which two minima are the same."""
OPTIONS = {"tol": 1e-11, "max_iter": 300, "bound_relax_factor": 0.0}
"""Of IPOPT, for a fit to the last digits."""


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
    full = solver("full", x, ca.dot(residual, residual), **OPTIONS)
    log_range = np.log(v_s_range)
    lower = np.concatenate([problem.lower, np.zeros(count), np.full(count, log_range[0])])
    upper = np.concatenate([np.full(linear, np.inf), np.full(count, log_range[1])])
    rng = np.random.default_rng(seed)
    ends = []
    for _ in range(starts):
        x0 = rng.uniform(0.0, 1.0, len(problem.names))
        x0[linear:] = rng.uniform(log_range[0], log_range[1], count)
        values = np.asarray(full(x0=x0, lbx=lower, ubx=upper)["x"]).ravel()
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
    full, cost_full, costs = full_fit(problem, v_s_range)
    tolerance = _SAME * cost_full + 1e-12 * float(problem.torque @ problem.torque)
    known = np.isfinite(standard_errors) & (standard_errors > 0)
    difference = {
        name: float((f - g) / s)
        for name, f, g, s, k in zip(problem.names, full, theta, standard_errors, known, strict=True)
        if k
    }
    reached = int(np.count_nonzero(costs <= cost_full + tolerance))
    agrees = abs(cost - cost_full) <= tolerance
    return Crosscheck(
        cost_grid=cost,
        cost_full=cost_full,
        starts=STARTS,
        reached=reached,
        parameters=dict(zip(problem.names, map(float, full), strict=True)),
        difference_in_se=difference,
        verdict=_verdict(cost, cost_full, difference, reached, agrees=agrees),
        agrees=agrees,
    )


def _verdict(cost: float, full: float, difference: dict[str, float], reached: int, *, agrees: bool) -> Diagnostic:
    if not agrees and full < cost:
        return Kind.FULL_FIT_LOWER(full=full, grid=cost, reached=reached, starts=STARTS)
    if not agrees:
        return Kind.GRID_LOWER(grid=cost, full=full)
    worst = max(map(abs, difference.values()), default=0.0)
    return Kind.ROUTES_AGREE(worst=worst, reached=reached, starts=STARTS)


def _scale(problem: Regression, torque_scale: float) -> Array:
    """A typical size of each parameter: the torque over the column's largest entry."""
    columns = np.abs(problem.linear).max(axis=0)
    columns[columns == 0] = 1.0
    count = len(problem.peaks)
    return np.concatenate([torque_scale / columns, np.full(count, torque_scale), np.ones(count)])


def _residuals(problem: Regression, theta: ca.MX, v_s_range: tuple[float, float]) -> ca.MX:
    """Measured minus modelled torque as a CasADi expression; for smoothed equations, of fewer ones with the same sum of squares up to a constant."""
    few = reduced(problem, v_s_range)
    value = dict(zip(few.names, ca.vertsplit(theta), strict=True))
    known = 2 * len(few.directions)
    extra = ca.vertcat(*(value[name] for name in few.linear_names[known:]))
    residual = ca.DM(few.torque) - ca.mtimes(ca.DM(few.linear[:, known:]), extra)
    for direction in few.directions:
        tag = "" if len(few.directions) == 1 else direction
        alpha_1, v_s = value.get("alpha_1" + tag, 0.0), value.get("v_s" + tag, 1.0)
        p = Stribeck(value["alpha_0" + tag], alpha_1, value["alpha_2" + tag], v_s)
        moving = {"+": few.velocity > 0, "-": few.velocity < 0}.get(tag, few.velocity != 0)
        if few.smooth is None:
            weight = np.ones(few.torque.size) if few.root_weight is None else few.root_weight
            residual -= ca.DM(weight * moving) * law.steady_torque(ca.DM(few.velocity), p)
        else:
            shares = ca.DM(few.smooth[:, moving].toarray())
            residual -= ca.mtimes(shares, law.steady_torque(ca.DM(few.velocity[moving]), p))
    return residual
