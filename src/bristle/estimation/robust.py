"""Huber's M-estimates (1964, 1981) for observations with known variances and a common unknown one (Proposal 2).

mean(min(r**2 / s**2, c**2)) = E[min(Z**2, c**2)], s**2 = m variance + known.
"""

from typing import Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import chdtr, chdtri

from bristle.arrays import Array
from bristle.estimation import levels

SCALE = 2.0  # c of the variance, standard deviations
BEND = 1.345  # c of the coefficients: 95 % efficiency with normal errors
SCALE_EFFICIENCY = 0.88  # of the variance's estimate with normal errors, at `SCALE`
_PASSES = 60
_SETTLED = 1e-7
_LEAST_VARIANCE = 1e-200


def expected_square(bend: float) -> float:
    """E[min(Z**2, bend**2)] of a standard normal Z."""
    return float(chdtr(3, bend**2) + bend**2 * (1 - chdtr(1, bend**2)))


def common_variance(residuals: Array, known: Array, times: float = 1.0, lost: int = 0) -> float:
    """The common variance of residuals, (n,), beside known ones, (n,), `times` in each; `lost` coefficients fitted."""
    squares, free = residuals**2, residuals.size - lost
    if free < 1:
        return 0.0
    goal = expected_square(SCALE) * free

    def excess(variance: float) -> float:
        """Mean bounded square over its expectation."""
        with np.errstate(over="ignore"):  # where nothing varies
            ratio = squares / np.maximum(times * variance + known, _LEAST_VARIANCE)
        return float(np.minimum(ratio, SCALE**2).sum()) - goal

    if excess(0.0) <= 0:
        return 0.0
    top = float(squares.max()) / times
    while excess(top) > 0:  # mostly strays
        top *= 4
    return float(brentq(excess, 0.0, top, xtol=1e-12 * top, rtol=1e-8))


def variance_interval(variance: float, known: float, freedom: float) -> tuple[float, float]:
    """95 % interval of a common variance beside a typical known one, by chi-squared of the sum."""
    total, tail = variance + known, (1 - levels.CONFIDENCE) / 2
    if freedom <= 0 or total <= 0:
        return 0.0, float("inf")
    low, high = total * freedom / float(chdtri(freedom, tail)), total * freedom / float(chdtri(freedom, 1 - tail))
    return max(low - known, 0.0), max(high - known, 0.0)


class RobustFit(NamedTuple):
    """Coefficients and common variance."""

    coefficients: Array  # (p,)
    covariance: Array  # (p, p)
    variance: float  # Of one observation, beside its known one
    freedom: float  # Of the variance
    freedom_of_coefficients: float


def differences_of(owner: NDArray[np.intp]) -> NDArray[np.intp]:
    """Observations, (m,), whose successor has the same owner; (n,) sorted by owner."""
    return np.flatnonzero(owner[1:] == owner[:-1])


def fit_differences(
    y: Array, known: Array, regressors: Array, first: NDArray[np.intp], groups: NDArray[np.intp]
) -> RobustFit:
    """Fit y = level of its owner + regressors @ coefficients + error by successive differences, robust to a step.

    Observations, (n,), are sorted by owner and time; regressors are (n, p). The covariance is of scores summed over
    `groups` where there are `ENOUGH`, else of the model.
    """
    d, X = y[first + 1] - y[first], regressors[first + 1] - regressors[first]
    v = known[first] + known[first + 1]
    n, p = X.shape
    b: Array = np.zeros(p)
    variance = common_variance(d, v, 2.0, p)
    for _ in range(_PASSES if p else 0):
        s2 = np.maximum(2 * variance + v, np.finfo(float).tiny)
        r = d - X @ b
        w = np.minimum(1.0, BEND / np.maximum(np.abs(r) / np.sqrt(s2), 1e-300)) / s2
        moved: Array = np.linalg.lstsq(X * np.sqrt(w)[:, None], d * np.sqrt(w), rcond=None)[0].astype(float)
        change, b = float(np.abs(X @ (moved - b)).max(initial=0.0)), moved
        variance = common_variance(d - X @ b, v, 2.0, p)
        if change < _SETTLED * np.sqrt(float(np.median(s2))):
            break
    freedom = max(n * 2 / 3 * SCALE_EFFICIENCY - p, 0.0)  # neighbours share an observation: 2/3 of independent ones
    if p == 0:
        return RobustFit(b, np.zeros((0, 0)), variance, freedom, freedom)
    s2 = np.maximum(2 * variance + v, np.finfo(float).tiny)
    u = (d - X @ b) / np.sqrt(s2)
    names, owner = np.unique(groups[first], return_inverse=True)
    if names.size >= levels.ENOUGH:
        inverse = np.linalg.pinv((X * ((np.abs(u) < BEND) / s2)[:, None]).T @ X, hermitian=True)
        scores = np.zeros((names.size, p))
        np.add.at(scores, owner, X * (np.clip(u, -BEND, BEND) / np.sqrt(s2))[:, None])
        outer, free = scores.T @ scores * (names.size / (names.size - 1)), names.size - 1.0
    else:
        inverse = np.linalg.pinv((X / s2[:, None]).T @ X, hermitian=True)
        pull = np.zeros((y.size, p))
        np.add.at(pull, first + 1, X / s2[:, None])
        np.add.at(pull, first, -X / s2[:, None])
        outer, free = (pull * (variance + known)[:, None]).T @ pull, freedom
    return RobustFit(b, inverse @ outer @ inverse, variance, freedom, free)


Size = TypeVar("Size", float, Array)


class Population(NamedTuple, Generic[Size]):
    """A population with known variances of its members; or, (n,) each, without each of n members."""

    mean: Size
    mean_error: Size
    variance: Size  # Between members
    freedom: float


def population(values: Array, known: Array) -> Population[float]:
    """Robust random effects: mean and variance of a population of values (n,) with known variances (n,)."""
    mean, s2, variance = float(np.median(values)), known, 0.0
    for _ in range(_PASSES):
        variance = common_variance(values - mean, known, lost=1)
        s2 = np.maximum(variance + known, _LEAST_VARIANCE)
        w = np.minimum(1.0, BEND / np.maximum(np.abs(values - mean) / np.sqrt(s2), 1e-300)) / s2
        before, mean = mean, float(w @ values / w.sum())
        if abs(mean - before) < _SETTLED * np.sqrt(np.median(s2)):
            break
    u = (values - mean) / np.sqrt(s2)
    bread, meat = float(np.sum((np.abs(u) < BEND) / s2)), float(np.sum(np.clip(u, -BEND, BEND) ** 2 / s2))
    error = float(np.sqrt(meat)) / bread if bread > 0 else np.inf
    return Population(mean, error, variance, max((values.size - 1) * SCALE_EFFICIENCY, 0.0))


def without_each(values: Array, known: Array) -> Population[Array]:
    """The same without each value in turn, in a time that grows with n**2."""
    others = [population(np.delete(values, k), np.delete(known, k)) for k in range(values.size)]
    mean, error, variance, freedom = np.array(others).T
    return Population(mean, error, variance, float(freedom[0]))
