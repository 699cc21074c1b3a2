"""Empirical Bayes for variances of few observations (Smyth, Stat. Appl. Genet. Mol. Biol. 3(1), 2004).

A variance s**2 with d degrees of freedom becomes (d0 s0**2 + d s**2) / (d0 + d); s0**2 and d0 come from the scatter of
log(s**2).
"""

import numpy as np
from scipy.optimize import brentq
from scipy.special import digamma, polygamma, stdtridf, stdtrit

from bristle.arrays import Array
from bristle.estimation import levels

_MANY = 1e3  # degrees of freedom that count as infinite
_SCATTER = (1e-6, 1e6)  # of log(s**2): limits between one variance and unrelated ones


def normal_errors(error: Array, half: Array) -> Array:
    """Errors of normal variables as uncertain as estimates with these errors and halves of 95 % intervals, (n,).

    An interval wider than 1.96 errors tells degrees of freedom, by which errors are moderated; an open one counts as
    1.96.
    """
    level = (1 + levels.CONFIDENCE) / 2
    normal = float(stdtrit(np.inf, level))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(np.isfinite(half), half / error, normal)
    freedom = np.full(error.size, np.inf)
    few = ratio > normal * (1 + 1 / _MANY)
    freedom[few] = np.maximum(stdtridf(level, ratio[few]), 1.0)
    variance, freedom = moderated(error**2, freedom)
    reach: Array = np.full(error.size, normal)
    few = np.isfinite(freedom)
    reach[few] = stdtrit(freedom[few], level)
    return np.sqrt(variance) * reach / normal


def moderated(variance: Array, freedom: Array) -> tuple[Array, Array]:
    """Variances > 0 and degrees of freedom after moderation, (n,) each."""
    few = np.isfinite(freedom) & (variance > 0)
    if few.sum() < 2:
        return variance, freedom
    d = freedom[few]
    e = np.log(variance[few]) - digamma(d / 2) + np.log(d / 2)
    scatter = float(e.var(ddof=1) - polygamma(1, d / 2).mean())
    steady, more, (least, most) = variance.copy(), freedom.copy(), _SCATTER
    if scatter <= least:
        steady[few], more[few] = np.exp(e.mean()), np.inf
    else:
        # d0 makes log(s**2) scatter so much: trigamma(d0 / 2)
        d0 = float(brentq(lambda d: polygamma(1, d / 2) - min(scatter, most), 1e-4, 4 / least))
        s0 = np.exp(e.mean() + digamma(d0 / 2) - np.log(d0 / 2))
        steady[few], more[few] = (d0 * s0 + d * variance[few]) / (d0 + d), d0 + d
    return steady, more
