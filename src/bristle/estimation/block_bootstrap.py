"""Bootstrap of least squares on time series: blocks of equations drawn anew, and one Gauss-Newton step from the estimate for each draw.

A resample counts block b m_b times. Its minimum is, to first order and with the exact Jacobian, at

    d = -(sum m_b G_b + P'P)**-1 (sum m_b s_b + P'e),    G_b = J_b'J_b,    s_b = J_b'r_b

from the estimate (Davidson and MacKinnon, 1999; Andrews, 2002: one step has the bootstrap's accuracy); P are the rows of priors, whose means are
drawn anew as well, e. Blocks overlap and wrap around within their stretch (Politis and Romano, 1992): each equation is drawn as often as any other.

Where a block ends correlation is cut, and so draws scatter by too little. What is studentised in its own resample, where blocks are independent, does
not: the interval takes its shape from t = d / error in the resample, and its width from the fit's own error. Measured: over 120 simulated runs of
gripper rotation, alone, 96 % of its intervals cover the truth, and 95 % by the draws' quantiles; for means of AR(1) noise (0.8) 94 % and 90 %.
"""

from collections.abc import Sequence
from itertools import pairwise
from math import ceil
from typing import NamedTuple

import numpy as np

from bristle.arrays import Array
from bristle.diagnostics import Diagnostic, Kind
from bristle.estimation.autocorrelation import inflation
from bristle.estimation.covariance import LEVEL

DRAWS = 2000
FEW = 8
"""Blocks below which a bootstrap has little to draw from, and gives no interval."""
ENOUGH = 20
"""Blocks below which a bootstrap that parts from the other intervals is explained by them."""
SHOWN = 500
"""Draws kept of each parameter, to be drawn."""
_OVERLAP = 4
"""Cells in a block: blocks begin at each cell."""
_CELLS = 2000
"""At most; longer records have longer cells."""
_TIMES = 4.0
"""Integrated autocorrelation times in a block, at least."""
_AT_ONCE = 4_000_000
"""Scores of blocks in draws, computed together."""


class Resampled(NamedTuple):
    """What draws of blocks do to an estimate."""

    steps: Array
    """d, (B, p)."""
    studentised: Array
    """d over its standard error in its own resample, (B, p)."""
    blocks: int
    """How many are drawn each time."""

    def interval(self, which: int, error: float) -> tuple[float, float]:
        """The 95 % interval of one unknown about its estimate, by bootstrap-t, from the estimate's standard error."""
        low, high = np.quantile(self.studentised[:, which], [(1 + LEVEL) / 2, (1 - LEVEL) / 2])
        return -float(low) * error, -float(high) * error


def block_bootstrap(
    jacobian: Array,
    residuals: Array,
    starts: Sequence[int] = (0,),
    *,
    priors: Array | None = None,
    sigma: float = 1.0,
    length: int | None = None,
    draws: int = DRAWS,
    seed: int = 0,
) -> Resampled:
    """The steps of a least-squares estimate under resampled blocks of equations.

    Args:
        jacobian: of the residuals at the minimum, (n, p), of full rank together with the priors.
        residuals: (n,), in whatever sign the Jacobian is of.
        starts: first equation of each stretch; no block reaches over one.
        priors: rows of the Jacobian that belong to priors, (m, p), whose residuals scatter by `sigma`; None: there are none.
        sigma: see there.
        length: equations in a block; None: `block_length` of the scores.
        draws: B.
        seed: of the generator.
    """
    told = np.zeros((0, jacobian.shape[1])) if priors is None else priors
    size = np.sqrt(np.einsum("np,np->p", jacobian, jacobian) + np.einsum("mp,mp->p", told, told))
    size[size == 0] = 1.0
    J = jacobian / size
    length = length or block_length(J * residuals[:, None])
    edges, of_stretch = cells(residuals.size, starts, length)
    grams = np.array([J[a:b].T @ J[a:b] for a, b in pairwise(edges.tolist())])
    scores = np.array([J[a:b].T @ residuals[a:b] for a, b in pairwise(edges.tolist())])
    found = resample(grams, scores, of_stretch, told / size, sigma, draws, seed)
    return found._replace(steps=found.steps / size)


def too_few(blocks: Diagnostic) -> Diagnostic:
    """What says that there is no bootstrap, for so few blocks."""
    return Kind.NO_BOOTSTRAP(few=blocks, least=FEW)


def block_length(scores: Array) -> int:
    """Equations in a block: four integrated autocorrelation times of the most correlated column of scores, (n, p), and n**(1/3) at least."""
    n = scores.shape[0]
    times = max(inflation(score) for score in scores.T)
    return int(min(max(ceil(_TIMES * times), ceil(n ** (1 / 3))), n))


def cells(n: int, starts: Sequence[int], length: int) -> tuple[Array, Array]:
    """Quarters of blocks: the first equation of each and n, (C + 1,), and the number of the stretch that each lies in, (C,)."""
    step = max(length / _OVERLAP, n / _CELLS)
    firsts = [*starts, n]
    counts = [max(round((stop - first) / step), 1) for first, stop in pairwise(firsts)]
    inner = [
        np.linspace(a, b, k, endpoint=False).astype(int) for (a, b), k in zip(pairwise(firsts), counts, strict=True)
    ]
    return np.append(np.concatenate(inner), n), np.repeat(np.arange(len(counts)), counts)


def resample(
    grams: Array, scores: Array, of_stretch: Array, told: Array, sigma: float, draws: int, seed: int
) -> Resampled:
    """The steps -gram**-1 score where blocks of cells are drawn, centred so that they vanish where each is drawn as often as any other.

    Args:
        grams: of each cell, (C, p, p).
        scores: of each cell, (C, p).
        of_stretch: the stretch of each cell, ascending, (C,).
        told: rows of priors, (m, p).
        sigma: what those scatter by.
        draws: B.
        seed: of the generator.
    """
    grams, scores, share = _blocks(grams, scores, of_stretch)
    number = max(round(float(share.sum())), 1)
    rng = np.random.default_rng(seed)
    count, p = share.size, scores.shape[1]
    drawn = rng.choice(count, (draws, number), p=share / share.sum()) + count * np.arange(draws)[:, None]
    weight = float(share.sum()) / number
    times = weight * np.bincount(drawn.ravel(), minlength=draws * count).reshape(draws, count)
    gram = (times @ grams.reshape(count, -1)).reshape(draws, p, p) + told.T @ told
    inverse: Array = np.asarray(np.linalg.pinv(gram, hermitian=True), dtype=np.float64)
    score = times @ scores
    news = sigma * rng.standard_normal((draws, told.shape[0])) @ told
    steps = -np.einsum("bij,bj->bi", inverse, score - share @ scores + news)
    errors = [
        _errors(
            grams, scores, told, sigma, times[part] * weight * number / max(number - 1, 1), inverse[part], steps[part]
        )
        for part in np.array_split(np.arange(draws), ceil(draws * scores.size / _AT_ONCE))
    ]
    studentised = steps / np.maximum(np.concatenate(errors), np.finfo(float).tiny)
    return Resampled(steps, studentised, number)


def _errors(
    grams: Array, scores: Array, told: Array, sigma: float, times: Array, inverse: Array, steps: Array
) -> Array:
    """Standard errors of resampled estimates from the scores that blocks have left there, (b, p); `times` (b, C) counts squares."""
    count, p = scores.shape
    left = scores.T + (steps @ grams.transpose(1, 2, 0).reshape(p, -1)).reshape(-1, p, count)
    influence = inverse @ left
    squares = np.einsum("bic,bic,bc->bi", influence, influence, times)
    by_priors = told @ inverse
    errors: Array = np.sqrt(squares + sigma**2 * np.einsum("bmi,bmi->bi", by_priors, by_priors))
    return errors


def _blocks(grams: Array, scores: Array, of_stretch: Array) -> tuple[Array, Array, Array]:
    """Sums over the block that begins at each cell, and its weight: one over the number of blocks that each of its cells lies in."""
    sizes = np.bincount(of_stretch)
    first, size = (np.cumsum(sizes) - sizes)[of_stretch], sizes[of_stretch]
    place = np.arange(of_stretch.size) - first
    others = [first + (place + k) % size for k in range(_OVERLAP)]
    inside = [(k < size).astype(float) for k in range(_OVERLAP)]
    whole = sum(grams[o] * w[:, None, None] for o, w in zip(others, inside, strict=True))
    total = sum(scores[o] * w[:, None] for o, w in zip(others, inside, strict=True))
    return np.asarray(whole), np.asarray(total), 1 / np.minimum(size, _OVERLAP)
