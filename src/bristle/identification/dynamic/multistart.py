"""Moving data solved from several starts: where they lie, and what each motion begins with there."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from bristle.arrays import Array
from bristle.estimation.multistart import MultistartSolution, solve_from_starts
from bristle.identification.dynamic.problem import DynamicProblem, InitialState, Unknown, Values, parameters
from bristle.identification.dynamic.unknowns import polished, solved
from bristle.model.parameters import Lugre, ParameterName
from bristle.model.rollout import rollout

_APART = {"sigma_0": 10.0, "sigma_1": 10.0, "v_s": 6.0}
"""How far random starts lie from the first one, as a factor either way; 3 for the other parameters."""


def solve_dynamic(
    problem: DynamicProblem, start: Values, starts: int, seed: int, others: Sequence[Values] = ()
) -> MultistartSolution[Unknown]:
    """The lowest minimum from several starts, and the covariance there."""
    rng = np.random.default_rng(seed)
    moved = ({name: value * _factor(name.name, rng) for name, value in start.items()} for _ in range(starts - 1))
    first, random = with_deflections(problem, start), (with_deflections(problem, whole) for whole in moved)
    return solve_from_starts(partial(solved, problem), (first, *others), random, partial(polished, problem))


def equations_left(problem: DynamicProblem, solution: MultistartSolution[Unknown]) -> Array:
    """Measured less modelled of every equation at the minimum, without its run's weight, N*m or rad, (n,)."""
    weight = np.repeat([m.weight for m in problem.motions], [m.size for m in problem.motions])
    rows: Array = solution.minimum.residuals[: weight.size] / weight
    return rows


def _factor(name: str, rng: np.random.Generator) -> float:
    reach = np.log(_APART.get(name, 3.0))
    return float(np.exp(rng.uniform(-reach, reach))) if name in Lugre._fields else 1.0


def with_deflections(problem: DynamicProblem, start: Values) -> dict[Unknown, float]:
    """A start with what each motion begins with: the deflection that carries its first torque, within the steady one, and the first position.

    Where a motion goes on from the one before, the deflection is that to which the estimated velocity has brought it.
    """
    p = parameters(problem, start)
    out, end = dict(start), 0.0
    for k, m in enumerate(problem.motions):
        own = p if isinstance(p, Lugre) else p[int(m.torque[0] < 0)]
        most = own.alpha_0 / own.sigma_0
        z0 = float(np.clip(m.torque[: max(m.torque.size // 100, 1)].mean() / own.sigma_0, -most, most))
        if m.continues_previous:
            z0 = end
        end = float(rollout(m.velocity, m.step, p, z0).z[-1]) if problem.quantity == "position" else z0
        first = {"y0": float(m.measured[0]), "v0": float(m.velocity[0]), "z0": z0}
        out |= {InitialState(name, k): first[name] for name in problem.initial_states}
    return out


def without_deflections(values: Values) -> dict[ParameterName, float]:
    """The values without the deflections at the start of each stretch."""
    return {name: value for name, value in values.items() if isinstance(name, ParameterName)}
