"""Terms of the torque that the fit of moving runs was not asked for, and its data show: a regressor, an offset."""

from collections.abc import Sequence

import numpy as np
from scipy.special import fdtrc

from bristle.arrays import Array
from bristle.estimation.autocorrelation import explained_beside
from bristle.estimation.multistart import MultistartSolution
from bristle.findings import Finding
from bristle.identification.dynamic.problem import DynamicProblem, Motion, Unknown
from bristle.identification.messages import Kind
from bristle.identification.moving_runs import REGRESSORS, load_columns, regressor_line, swings
from bristle.model.parameters import SIGNED, ParameterName, unit
from bristle.model.parameters import Kind as JointKind

_RARE = 5e-4
"""Of clean experiments, in which a term is found all the same."""
_SHARE = 0.1
"""Of the squares that the fit leaves: a term that explains less is not worth a sentence."""
_OFFSET = 0.01
"""Of alpha_0: a smaller offset is not worth a sentence."""
_TRIED = ("gravity", "quadratic")


def regressor_left_out(problem: DynamicProblem, solution: MultistartSolution[Unknown]) -> list[Finding]:
    """The regressor that explains most of what the fit leaves, to first order: an F test beside all that is fitted."""
    if problem.quantity != "torque":
        return []
    asked = {name.name for name in problem.extra_names}
    located = all(m.position.size for m in problem.motions) and swings([m.position for m in problem.motions])
    names = [x for x in _TRIED if asked.isdisjoint(REGRESSORS[x].names) and (located or x != "gravity")]
    known, rest = known_and_left(problem, solution)
    found = {x: explained_beside(known, rest, columns_of(problem, (x,))) for x in names}
    best = max(found, key=lambda x: found[x][1], default=None)
    if best is None or found[best][0] * len(names) > _RARE or found[best][1] < _SHARE:
        return []
    advice = Kind.TERM_EXPLAINS(lines=regressor_line((best,), asked), share=found[best][1])
    return [Kind.LACKS_A_TERM(advice=advice)]


def known_and_left(problem: DynamicProblem, solution: MultistartSolution[Unknown]) -> tuple[Array, Array]:
    """Derivatives of the equations by all that they tell, (n, p), and what the fit leaves of them, (n,)."""
    n = sum(m.size for m in problem.motions)
    jacobian, rest = solution.minimum.jacobian[:n], solution.minimum.residuals[:n]
    return jacobian[:, solution.scaled_errors < np.inf], rest


def columns_of(problem: DynamicProblem, regressors: Sequence[str]) -> Array:
    """The columns of some regressors, as the equations weigh them, (n, k)."""

    def weighted(m: Motion) -> Array:
        """Of one motion."""
        signals = {"position": m.position, "velocity": m.velocity}
        of = load_columns(regressors, lambda signal: signals[signal], m.time.size)
        return m.weighted(np.stack(list(of.values()), axis=1))

    return np.concatenate([weighted(m) for m in problem.motions])


def offset_or_friction(
    problem: DynamicProblem, solution: MultistartSolution[Unknown], kind: JointKind
) -> list[Finding]:
    """A difference of the two directions that is one of alpha_0 alone, as an offset of the torque makes it.

    Wald tests: the directions agree on alpha_1 and alpha_2, and with these made equal they differ in alpha_0.
    """
    order = {name: k for k, name in enumerate(solution.names)}
    pairs = [[ParameterName(name, d) for d in SIGNED] for name in ("alpha_0", "alpha_1", "alpha_2")]
    free = [pair for pair in pairs if all(name in order for name in pair)]
    if set(SIGNED) - set(problem.directions) or problem.quantity != "torque" or pairs[0] not in free:
        return []
    plus, minus = (np.array([order[pair[k]] for pair in free]) for k in (0, 1))
    values = np.array([solution.values[name] for name in solution.names])
    C = solution.covariance
    apart = values[plus] - values[minus]
    S = C[np.ix_(plus, plus)] + C[np.ix_(minus, minus)] - C[np.ix_(plus, minus)] - C[np.ix_(minus, plus)]
    weight = np.linalg.pinv(S[1:, 1:], hermitian=True)
    others = float(apart[1:] @ weight @ apart[1:])
    twice = float(apart[0] - S[0, 1:] @ weight @ apart[1:])
    variance = float(S[0, 0] - S[0, 1:] @ weight @ S[1:, 0])
    common = float(values[[plus[0], minus[0]]].mean())
    if abs(twice) < 2 * _OFFSET * common or not variance > 0:
        return []
    rest = len(free) - 1
    differ = rest and fdtrc(rest, solution.freedom, others / rest) < _RARE
    if differ or fdtrc(1, solution.freedom, twice**2 / variance) > _RARE:
        return []
    a, b = (float(values[k[0]]) for k in (plus, minus))
    lines = "`directions: symmetric`, and offset among the regressors,"
    return [
        Kind.OFFSET_OR_FRICTION(
            offset=twice / 2, common=common, plus=a, minus=b, unit=unit("torque", kind), lines=lines
        )
    ]
