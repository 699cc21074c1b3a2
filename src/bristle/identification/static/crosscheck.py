"""The full nonlinear static fit by CasADi and IPOPT, a check of the grid, of which it uses the range of v_s."""

from collections.abc import Mapping

import casadi as ca
import numpy as np

from bristle.arrays import Array
from bristle.estimation.ipopt import ends, natural, solver
from bristle.identification.fits import Crosscheck
from bristle.identification.shared_findings import crosschecked
from bristle.identification.static.grid import Solution
from bristle.identification.static.problem import Regression, unknowns_of
from bristle.model import law
from bristle.model.laws.parts import FASTEST
from bristle.model.parameters import Direction, ParameterName, of_curve, static_of, without_peak

STARTS = 8  # random starts of the full fit
SEED = 0
_SAME = 1e-6  # relative difference in cost below which two minima are the same
OPTIONS = {"tol": 1e-11, "max_iter": 300, "bound_relax_factor": 0.0}  # of IPOPT, for a fit to the last digits


def full_fit(problem: Regression, v_s_range: tuple[float, float], starts: int = STARTS) -> list[Array]:
    """theta, in the order of `names`, at the end of each IPOPT run from random starts; v_s within a range, rad/s."""
    unknowns, (low, high) = unknowns_of(problem, v_s_range), np.log(v_s_range).tolist()
    x = ca.MX.sym("x", len(problem.names))
    value = dict(zip(problem.names, natural(unknowns, x), strict=True))
    others = [k for k, name in enumerate(problem.linear_names) if not of_curve(name.name)]
    extra = ca.vertcat(*(value[problem.linear_names[k]] for k in others))
    residual = ca.DM(problem.torque) - ca.mtimes(ca.DM(problem.linear[:, others]), extra)
    one, shape = static_of(problem.law), dict(zip(problem.law.shape_parameters[1:], problem.shape, strict=True))
    nothing = without_peak(problem.law) | {"alpha_2": 0.0}  # for a single speed
    given = {**nothing, **shape, FASTEST: float(np.abs(problem.velocity).max())}
    for direction in problem.directions:
        fitted = {name: value[key] for name in one._fields if (key := ParameterName(name, direction)) in value}
        p = one(**{name: {**given, **fitted}[name] for name in one._fields})
        moving = problem.velocity != 0
        if len(problem.directions) == 2:
            moving = problem.velocity > 0 if direction is Direction.POSITIVE else problem.velocity < 0
        if problem.smooth is None:
            residual -= ca.DM(np.where(moving, 1.0, 0.0)) * law.steady_torque(ca.DM(problem.velocity), p)
        else:
            shares = ca.DM(problem.smooth[:, moving].tocsc())
            residual -= ca.mtimes(shares, law.steady_torque(ca.DM(problem.velocity[moving]), p))
    residual /= float(np.abs(problem.torque).max()) or 1.0
    full = solver("full", x, ca.dot(residual, residual), **OPTIONS)
    rng = np.random.default_rng(SEED)
    begun = []
    for _ in range(starts):
        x0 = rng.uniform(0.0, 1.0, len(problem.names))
        x0[unknowns.logarithmic] = rng.uniform(low, high, len(problem.peaks))
        begun.append(x0)
    return [unknowns.natural(end) for end in ends(full, unknowns, begun)]


def crosscheck(
    problem: Regression, found: Solution, errors: Mapping[ParameterName, float | None], v_s_range: tuple[float, float]
) -> Crosscheck:
    """The full fit as a check of the grid's solution; `errors` are the grid fit's, v_s_range in rad/s."""
    ended = full_fit(problem, v_s_range)
    costs = [float(np.sum(problem.residuals(end) ** 2)) for end in ended]
    same = _SAME * min(costs) + 1e-12 * float(problem.torque @ problem.torque)
    minima = [problem.named(end) for end in ended]
    return crosschecked("Grid", problem.named(found.theta), found.cost, errors, minima, costs, same)
