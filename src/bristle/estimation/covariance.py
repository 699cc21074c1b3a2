"""Covariance of least-squares estimates, and Student's t."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from bristle.arrays import Array
from bristle.estimation import levels
from bristle.estimation.autocorrelation import inflation
from bristle.estimation.linear import inverse_gram
from bristle.estimation.nonlinear import LeastSquares, Minimum

SEEN = 1e-9  # of the longest Jacobian column: shorter ones have no influence


class Covariance(NamedTuple):
    """Uncertainty of the unknowns at a minimum."""

    errors: Array  # Standard errors of the scaled unknowns, (p,); inf where not seen
    matrix: Array  # In the unknowns' units, (p, p); nan where not known
    freedom: float
    widening: float  # Median factor on errors by correlated residuals
    freedoms: Array  # Degrees of freedom of each unknown, (p,)


def covariance(jacobian: Array, cost: float, inflation: float = 1.0) -> tuple[Array, float]:
    """Covariance cost / (n - p) (J'J)**-1 inflation, (p, p), and degrees of freedom n / inflation - p, at least 1."""
    n, p = jacobian.shape
    freedom = max(n / inflation - p, 1.0)
    return cost / max(n - p, 1) * inflation * inverse_gram(jacobian), freedom


def covariance_at(problem: LeastSquares[Any], minimum: Minimum) -> Covariance:
    """The covariance of the shared unknowns at a minimum, robust to correlation."""
    known, scaled = _robust(problem, minimum)
    errors, whole = np.full(known.size, np.inf), np.full((known.size, known.size), np.nan)
    chain = problem.unknowns.slopes(minimum.x)[: known.size][known]
    errors[known], whole[np.ix_(known, known)] = scaled.errors, scaled.matrix * np.outer(chain, chain)
    return scaled._replace(errors=errors, matrix=whole)


def seen(jacobian: Array) -> NDArray[np.bool_]:
    """Which unknowns influence the residuals, (p,)."""
    length = _lengths(jacobian)
    return np.asarray(length > SEEN * length.max())


def _lengths(jacobian: Array) -> Array:
    return np.asarray(np.sqrt(np.einsum("np,np->p", jacobian, jacobian)))


def _robust(problem: LeastSquares[Any], minimum: Minimum) -> tuple[NDArray[np.bool_], Covariance]:
    """By weighted sums of residuals, which may be correlated and of uneven variance."""
    rest, known = minimum.residuals, seen(minimum.jacobian)
    jacobian = minimum.jacobian[:, known]
    (n, p), priors = jacobian.shape, problem.priors
    p += len(problem.blocks)
    inner = inverse_gram(jacobian)
    weights = jacobian @ inner
    plain = inner * minimum.cost / max(n - p, 1)
    scores = weights[: n - priors] * rest[: n - priors, None]
    variance_inflation = np.array([inflation(score) for score in scores.T])
    spread = np.einsum("np,np->p", scores, scores) * variance_inflation * n / max(n - p, 1)
    spread += problem.sigma**2 * np.einsum("np,np->p", weights[n - priors :], weights[n - priors :])
    spread = np.maximum(spread, 0.0 if priors else plain.diagonal())
    ratio = np.sqrt(spread / plain.diagonal())
    widening = float(np.median(ratio)) if ratio.size else 1.0
    freedoms = np.ones(known.size)
    freedoms[known] = np.maximum((n - p) / variance_inflation, 1.0)
    freedom = float(np.median(freedoms[known])) if ratio.size else 1.0
    return known, Covariance(np.sqrt(spread), plain * np.outer(ratio, ratio), freedom, widening, freedoms)


def moved_without_each(inverse: Array, grams: Sequence[Array], slopes: Sequence[Array]) -> Array:
    """Moves of the estimate without each of k blocks, (k, p), to first order (Bell and McCaffrey, 2002).

    G**-1 (I - A_i G**-1)**-1 b_i with A_i = J_i'J_i, b_i = J_i'r_i, G = sum A_i; the jackknife's covariance is (k - 1)
    / k times the sum of their squares (Survey Methodology 28).
    """
    one = np.eye(len(inverse))
    moves = [inverse @ np.linalg.lstsq(one - A @ inverse, b, rcond=None)[0] for A, b in zip(grams, slopes, strict=True)]
    return np.array(moves)


def condition(jacobian: Array) -> float:
    """Condition number of the Jacobian with columns of unit length; 1 if empty."""
    if jacobian.shape[1] == 0:
        return 1.0
    scale = np.linalg.norm(jacobian, axis=0)
    return float(np.linalg.cond(jacobian / np.where(scale == 0, 1.0, scale)))


def student(freedom: float, level: float | None = None) -> float:
    """Half-width of an interval in standard errors, by Student's t; None: of 95 %."""
    return float(stdtrit(freedom, (1 + (levels.CONFIDENCE if level is None else level)) / 2))
