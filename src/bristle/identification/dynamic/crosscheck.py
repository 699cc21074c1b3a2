"""The fit of moving data by a second route: the same problem as one CasADi expression, solved by IPOPT.

The bristle's step is chained by `mapaccum` over the samples and the zero crossings between them; for a pair of sets the law itself chooses the one
that acts at the beginning of each step. Gradients are CasADi's, by reverse differentiation of the whole chain; nothing of the rollout, its scan or
its Jacobian is used.
"""

from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np

from bristle.arrays import Array
from bristle.diagnostics import Kind
from bristle.estimation.ipopt import solver
from bristle.identification.dynamic.fit import Tracked
from bristle.identification.dynamic.problem import Tracking
from bristle.identification.dynamic.unknowns import LOGARITHMIC, bounds, from_scaled, scaled, scales, to_scaled
from bristle.identification.results import Crosscheck
from bristle.model import law
from bristle.model.parameters import Lugre, pair_of
from bristle.model.time_refinement import Nodes, refined

STARTS = 1
_SEED = 0
_APART = 0.2
"""How far a start lies from the answer, as a share either way."""
_SAME = 1e-4
"""Relative difference in cost within which the two routes agree: theirs treat a change of z's sign inside a step differently."""
_OPTIONS = {"tol": 1e-9, "max_iter": 150, "hessian_approximation": "limited-memory", "limited_memory_max_history": 20}


def check_tracking(found: Tracked, starts: int = STARTS, seed: int = _SEED) -> Crosscheck:
    """The same problem by IPOPT, from starts about the answer: costs, parameters in the fit's standard errors, and a verdict.

    Args:
        found: the fit, before anything is taken off for encoder counts.
        starts: >= 1.
        seed: of the starts.
    """
    problem, values = found.problem, dict(found.values)
    scale = scales(problem, values)
    best = to_scaled(problem, values, scale)
    evaluate = scaled(problem, scale)
    size = float(np.sum(evaluate(best)[0] ** 2)) or 1.0
    x = ca.MX.sym("x", best.size)
    whole = solver("moving", x, _cost(problem, x, scale, values) / size, **_OPTIONS)
    lower, upper = bounds(problem)
    rng = np.random.default_rng(seed)
    ends = []
    for _ in range(starts):
        away = {n: v * (1 + _APART * rng.uniform(-1, 1)) for n, v in values.items()}
        solved = whole(x0=np.clip(to_scaled(problem, away, scale), lower, upper), lbx=lower, ubx=upper)
        ends.append(np.asarray(solved["x"]).ravel())
    costs = np.array([float(np.sum(evaluate(end)[0] ** 2)) for end in ends])
    return _compared(found, size, costs, from_scaled(problem, ends[int(costs.argmin())], scale))


def _compared(found: Tracked, cost: float, costs: Array, full: Mapping[str, float]) -> Crosscheck:
    lowest = float(costs.min())
    reached = int(np.count_nonzero(costs <= min(lowest, cost) * (1 + _SAME)))
    difference = {
        name: (full[name] - found.values[name]) / e.standard_error
        for name, e in found.fit.parameters.items()
        if name in full and e.standard_error
    }
    worst = max(map(abs, difference.values()), default=0.0)
    agrees = abs(lowest - cost) <= _SAME * cost
    told = Kind.IPOPT_LOWER if lowest < cost else Kind.IPOPT_HIGHER
    verdict = (
        Kind.IPOPT_AGREES(worst=worst, reached=reached, starts=costs.size)
        if agrees
        else told(lowest=lowest, cost=cost, reached=reached, starts=costs.size)
    )
    return Crosscheck(
        cost_grid=cost,
        cost_full=lowest,
        starts=costs.size,
        reached=reached,
        parameters={name: full[name] for name in difference},
        difference_in_se=difference,
        verdict=verdict,
        agrees=agrees,
    )


def _cost(problem: Tracking, x: ca.MX, scale: Array, values: Mapping[str, float]) -> ca.MX:
    """The sum of squared residuals, priors included, as an expression of the scaled unknowns."""
    known: dict[str, Any] = dict(problem.fixed)
    for k, name in enumerate(problem.names):
        known[name] = ca.exp(x[k]) if name.rstrip("+-") in LOGARITHMIC else x[k] * float(scale[k])
    p = ca.vertcat(*(known[problem.key(name, tag)] for tag in problem.tags for name in Lugre._fields))
    slowest = min(v for n, v in {**problem.fixed, **values}.items() if n.startswith("v_s"))
    extra = ca.vertcat(*(known[name] for name in problem.extra_names)) if problem.extra_names else ca.MX(0, 1)
    cost = ca.MX(0)
    for k, m in enumerate(problem.motions):
        torque = _torque(m.velocity, m.step, p, len(problem.tags), known[f"z0[{k}]"], slowest)
        rest = ca.DM(m.torque) - torque - ca.mtimes(ca.DM(m.extra), extra)
        smooth = rest if m.smooth is None else ca.mtimes(ca.DM(m.smooth.tocsc()), rest)
        cost += m.weight**2 * ca.dot(smooth, smooth)
    for prior in problem.priors:
        off = ca.vertcat(*(known[name] for name in prior.names)) - ca.DM(prior.value)
        row = problem.sigma * ca.mtimes(ca.DM(prior.root), off)
        cost += ca.dot(row, row)
    return cost


def _torque(velocity: Array, step: Array, p: ca.MX, sets: int, z0: ca.MX, v_s: float) -> ca.MX:
    """The friction torque at the samples, (n, 1), by the law's own step and torque."""
    nodes = refined(Nodes(velocity, step, slice(0, velocity.size)), v_s)
    z, u, q = ca.SX.sym("z"), ca.SX.sym("u", 3), ca.SX.sym("p", 6 * sets)
    a, b = law.bristle_step(u[0], u[1], u[2], _acting(q, sets, z, u[0] + u[1]))
    advance = ca.Function("advance", [z, u, q], [a * z + b], {"cse": True})
    v = ca.SX.sym("v")
    friction = ca.Function("friction", [z, v, q], [law.torque(z, v, _acting(q, sets, z, v))], {"cse": True})
    inputs = np.vstack([np.broadcast_to(row, nodes.v.size - 1) for row in nodes.steps])
    chain = advance.mapaccum(nodes.v.size - 1)(z0, ca.DM(inputs), ca.repmat(p, 1, nodes.v.size - 1))
    at = np.arange(nodes.v.size)[nodes.samples]
    bent = ca.horzcat(z0, chain)[at.tolist()]
    return friction.map(velocity.size)(bent, ca.DM(velocity).T, ca.repmat(p, 1, velocity.size)).T


def _acting(q: Any, sets: int, z: Any, v: Any) -> Lugre[Any]:
    parts = ca.vertsplit(q)
    if sets == 1:
        return Lugre(*parts)
    return law.active(z, v, pair_of(parts))
