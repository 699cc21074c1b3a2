"""What the residuals of moving runs would like to have been otherwise.

A torque logged earlier or later, another inertia than the one given.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from bristle.arrays import Array
from bristle.diagnostics import Diagnostic, Kind
from bristle.estimation.autocorrelation import inflation
from bristle.estimation.linear import inverse_gram
from bristle.estimation.multistart import MultistartSolution
from bristle.identification.dynamic.problem import DynamicProblem, Unknown, modelled
from bristle.model.parameters import INERTIA, unit
from bristle.model.parameters import Kind as JointKind

_SURE = 4.0
"""Standard errors from zero, beyond which it is said."""
_SHARE = 0.05
"""Of the cost, that must go with it: less is not worth a sentence."""


def missing_terms(problem: DynamicProblem, solution: MultistartSolution[Unknown], kind: JointKind) -> list[Diagnostic]:
    """What is doubted: a shift in time between torque and motion, and about an inertia that was given and not fitted.

    One more column beside the Jacobian's: what part of the residuals it would explain that no parameter can, to first
    order.
    """
    if problem.quantity != "torque":
        return []
    warnings, motions = [], problem.motions
    torque = modelled(problem, solution.values)
    wanted = {"delay": [-np.gradient(T, m.time) for T, m in zip(torque, motions, strict=True)]}
    if INERTIA not in problem.names:
        wanted["inertia"] = [np.gradient(m.velocity, m.time) for m in motions]
    missing = {name: more for name, more in _wanted(problem, solution, wanted).items() if more.counts}
    if more := missing.get("delay"):
        samples = abs(more.value) / float(np.median(np.concatenate([m.step for m in motions])))
        when = "earlier" if more.value > 0 else "later"
        warnings.append(
            Kind.TORQUE_DELAYED(seconds=abs(more.value), samples=samples, when=when, share=more.share, delay=more.value)
        )
    if more := missing.get("inertia"):
        warnings.append(Kind.INERTIA_DOUBTED(more=more.value, error=more.error, unit=unit("inertia", kind)))
    return warnings


class _More(NamedTuple):
    """How much of a column the residuals ask for, its standard error, and the share of the cost that goes with it."""

    value: float
    error: float
    share: float

    @property
    def counts(self) -> bool:
        """Whether it is worth a sentence."""
        return abs(self.value) > _SURE * self.error and self.share > _SHARE


def _wanted(
    problem: DynamicProblem, solution: MultistartSolution[Unknown], wanted: Mapping[str, Sequence[Array]]
) -> dict[str, _More]:
    """Each column, given per motion as (N,), beside all the others and the Jacobian's."""
    jacobian, rest = solution.minimum.jacobian, solution.minimum.residuals
    known = jacobian[:, solution.scaled_errors < np.inf]
    columns = np.zeros((rest.size, len(wanted)))
    for k, by_motion in enumerate(wanted.values()):
        rows = [m.weight * m.smoothed(c) for m, c in zip(problem.motions, by_motion, strict=True)]
        columns[: sum(r.size for r in rows), k] = np.concatenate(rows)
    beside = columns - known @ (inverse_gram(known) @ (known.T @ columns))
    weights = beside @ inverse_gram(beside)
    out = {}
    for name, weight in zip(wanted, weights.T, strict=True):
        score = weight * rest
        value, square = float(score.sum()), float(weight @ weight)
        error = float(np.sqrt(score @ score * inflation(score)))
        out[name] = _More(value, error, value**2 / square / solution.minimum.cost if square else 0.0)
    return out
