"""The moving fit by a second route: one CasADi expression of the law's own step (`mapaccum`), solved by IPOPT."""

from typing import Any

import casadi as ca
import numpy as np

from bristle.arrays import Array
from bristle.estimation.ipopt import ends, natural, solver
from bristle.identification.dynamic.fit import DynamicSolution
from bristle.identification.dynamic.problem import DynamicProblem, InitialState, Values
from bristle.identification.fits import Crosscheck
from bristle.identification.shared_findings import crosschecked
from bristle.model import law
from bristle.model.parameters import Lugre, ParameterName, fields_of, lugre_of, pair_of
from bristle.model.time_refinement import Nodes, with_extra_nodes

_SEED = 0
_APART = 0.2  # relative distance of the start from the answer
_SAME = 1e-4
"""Relative difference in cost that counts as agreement: sign changes of z within a step are treated differently."""
_OPTIONS = {"tol": 1e-9, "max_iter": 150, "hessian_approximation": "limited-memory", "limited_memory_max_history": 20}


def check_tracking(solved: DynamicSolution) -> Crosscheck:
    """The IPOPT fit from near the answer, as a check of the fit before encoder bias is taken off."""
    posed, values = solved.solution.posed, solved.values
    unknowns, best = posed.unknowns, solved.solution.minimum.cost
    x = ca.MX.sym("x", len(unknowns.names))
    whole = solver("moving", x, _cost(solved, x) / (best or 1.0), **_OPTIONS)
    rng = np.random.default_rng(_SEED)
    away = unknowns.scaled({n: v * (1 + _APART * rng.uniform(-1, 1)) for n, v in values.items()})
    ended = ends(whole, unknowns, [np.clip(away, unknowns.lower, unknowns.upper)])
    costs = [float(np.sum(posed.evaluate(end)[0] ** 2)) for end in ended]
    errors = {name: e.standard_error for name, e in solved.fit.parameters.items() if e.standard_error}
    minima = [unknowns.values(end) for end in ended]
    return crosschecked("Gauss-Newton", values, best, errors, minima, costs, _SAME * best)


def _cost(solved: DynamicSolution, x: ca.MX) -> ca.MX:
    """The sum of squared residuals, priors included, over the scaled unknowns."""
    problem, unknowns = solved.problem, solved.solution.posed.unknowns
    known: dict[Any, Any] = {**problem.fixed, **dict(zip(unknowns.names, natural(unknowns, x), strict=True))}
    p = ca.vertcat(*(known[ParameterName(name, d)] for d in problem.directions for name in fields_of(problem.law)))
    numbers: Values = {**problem.fixed, **solved.values}
    slowest = min(v for n, v in numbers.items() if n.name == "v_s")
    extra = ca.vertcat(*(known[name] for name in problem.extra_names)) if problem.extra_names else ca.MX(0, 1)
    cost = ca.MX(0)
    for k, m in enumerate(problem.motions):
        torque = _torque(m.velocity, m.step, p, problem, known[InitialState("z0", k)], slowest)
        rest = ca.DM(m.torque) - torque - ca.mtimes(ca.DM(m.extra), extra)
        smooth = rest if m.smooth is None else ca.mtimes(ca.DM(m.smooth.tocsc()), rest)
        cost += m.weight**2 * ca.dot(smooth, smooth)
    for prior in problem.priors:
        off = ca.vertcat(*(known[name] for name in prior.names)) - ca.DM(prior.value)
        row = problem.sigma * ca.mtimes(ca.DM(prior.root), off)
        cost += ca.dot(row, row)
    return cost


def _torque(velocity: Array, step: Array, p: ca.MX, problem: DynamicProblem, z0: ca.MX, v_s: float) -> ca.MX:
    """Friction torque at the samples, (n, 1)."""
    nodes = with_extra_nodes(Nodes(velocity, step, slice(0, velocity.size)), v_s)
    z, u, q = ca.SX.sym("z"), ca.SX.sym("u", 3), ca.SX.sym("p", p.numel())
    a, b = law.bristle_step(u[0], u[1], u[2], _acting(q, problem, z, u[0] + u[1]))
    advance = ca.Function("advance", [z, u, q], [a * z + b], {"cse": True})
    v = ca.SX.sym("v")
    friction = ca.Function("friction", [z, v, q], [law.torque(z, v, _acting(q, problem, z, v))], {"cse": True})
    inputs = np.vstack([np.broadcast_to(row, nodes.v.size - 1) for row in nodes.steps])
    chain = advance.mapaccum(nodes.v.size - 1)(z0, ca.DM(inputs), ca.repmat(p, 1, nodes.v.size - 1))
    at = np.arange(nodes.v.size)[nodes.samples]
    bent = ca.horzcat(z0, chain)[at.tolist()]
    return friction.map(velocity.size)(bent, ca.DM(velocity).T, ca.repmat(p, 1, velocity.size)).T


def _acting(q: Any, problem: DynamicProblem, z: Any, v: Any) -> Lugre[Any]:
    parts, one = ca.vertsplit(q), len(problem.directions) == 1
    return lugre_of(problem.law)(*parts) if one else law.active(z, v, pair_of(parts, problem.law))
