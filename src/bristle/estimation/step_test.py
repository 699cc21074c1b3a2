"""Likelihood-ratio scan for one step of a level at an unknown observation, with Worsley's bound of its p-value.

P(max |Z_k| > c) <= sum P(|Z_k| > c) - sum P(|Z_k| > c, |Z_k+1| > c) (Worsley, Biometrika 70, 1983).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri_exp, owens_t, stdtr

from bristle.arrays import Array


class Steps(NamedTuple):
    """The most significant step of each series, (m,)."""

    after: NDArray[np.intp]  # Index of the first observation after it
    size: Array  # Mean after less mean before
    error: Array  # Standard error at a known place
    z: Array
    p: Array  # p-value over all places
    before: Array  # Mean before it


class Levels(NamedTuple):
    """Series of observations, one per row, padded at the end."""

    y: Array  # (m, n)
    variance: Array  # (m, n); inf where padded
    regressors: Array  # Subtracted from y by coefficient, (m, n, p)
    covariance: Array  # Of these coefficients, (p, p)


def step_scan(levels: Levels, baseline: int, freedom: float) -> Steps:
    """The most significant step of each series, after at least `baseline` >= 1 observations, of which each has more.

    `freedom` are degrees of freedom of the variances, for Student's t.
    """
    weight = np.where(np.isfinite(levels.variance), 1 / levels.variance, 0.0)
    y = np.where(weight > 0, levels.y, 0.0)
    X = np.where(weight[..., None] > 0, levels.regressors, 0.0)
    # weights before and after each place of a step, (m, n - baseline), zero after the end of a row
    total = weight.cumsum(axis=1)
    before = total[:, baseline - 1 : -1]
    after = np.where(weight[:, baseline:] > 0, total[:, -1:] - before, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        means = _means(weight * y, before, after, baseline)
        moved = [_means(weight * X[..., k], before, after, baseline) for k in range(X.shape[2])]
        size = means[1] - means[0]
        contrast = np.stack([b - a for a, b in moved], axis=-1) if moved else np.zeros((*size.shape, 0))
        extra = np.einsum("mkp,pq,mkq->mk", contrast, levels.covariance, contrast) if moved else 0.0
        error = np.sqrt(1 / before + 1 / after + extra)
        z = np.where(after > 0, size / error, 0.0)
    best = np.abs(z).argmax(axis=1)
    row = np.arange(best.size)
    # the standard normal deviate with the tail of a Student's t
    largest = np.abs(z[row, best])
    if np.isfinite(freedom) and freedom <= 1e6:
        with np.errstate(divide="ignore"):
            tail = np.log(stdtr(freedom, -largest))
        largest = np.where(np.isfinite(tail), -ndtri_exp(np.minimum(tail, 0.0)), largest)
    return Steps(
        after=best + baseline, size=size[row, best], error=error[row, best], z=z[row, best],
        p=largest_p(largest, before, after), before=means[0][row, best],
    )  # fmt: skip  # a list of values


def _means(weighted: Array, before: Array, after: Array, baseline: int) -> tuple[Array, Array]:
    total = weighted.cumsum(axis=1)
    first = total[:, baseline - 1 : -1]
    return first / before, (total[:, -1:] - first) / after


def largest_p(c: Array, before: Array, after: Array) -> Array:
    """P(max |Z_k| > c) of each row, (m,), at most; weights before and after each place, (m, k), 0 after where there is none."""
    there = after > 0
    alone = 2 * ndtr(-c)
    both = there[:, 1:] & there[:, :-1]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = before / (before + after)
        odds = share / (1 - share)
        correlation = np.sqrt(np.where(both, odds[:, :-1] / odds[:, 1:], 0.0))
    row, _ = np.nonzero(both)
    joint = np.bincount(row, _both_beyond(c[row], np.minimum(correlation[both], 1.0)), minlength=c.size)
    return np.asarray(np.clip(there.sum(axis=1) * alone - joint, alone, 1.0))


def _both_beyond(c: Array, correlation: Array) -> Array:
    """P(|Z_1| > c and |Z_2| > c) of standard normal variables, (k,), by Owen's T function (Ann. Math. Stat. 27, 1956)."""
    with np.errstate(divide="ignore"):
        a = np.sqrt((1 - correlation) / (1 + correlation))
        return np.asarray(4 * (ndtr(-c) - owens_t(c, a) - owens_t(c, 1 / a)))
