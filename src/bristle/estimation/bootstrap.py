"""Bootstrap of least squares: blocks of equations of time series, or single residuals of independent points.

A resample counts block b m_b times. Its minimum is, to first order (Davidson and MacKinnon, 1999; Andrews, 2002), at

    d = -(sum m_b G_b + P'P)**-1 (sum m_b s_b + P'e),    G_b = J_b'J_b,    s_b = J_b'r_b

from the estimate; P are rows of priors, whose means e are drawn as well. Blocks overlap and wrap around within their
segment (Politis and Romano, 1992). Intervals are by bootstrap-t: t = d / error in the resample, times the fit's own
error. Residuals of independent points are drawn with replacement, corrected for leverage; with uneven variance by the
wild bootstrap (Webb's six values).
"""

from collections.abc import Callable, Sequence
from itertools import pairwise
from math import ceil
from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc

from bristle.arrays import Array
from bristle.estimation import levels
from bristle.estimation.autocorrelation import inflation
from bristle.estimation.linear import inverse_gram
from bristle.estimation.multistart import MultistartSolution
from bristle.estimation.nonlinear import Name

DRAWS, REFITS = 2000, 1999  # of blocks, and of refitted residuals, whose interval ends are draws
_AT_ONCE = 4_000_000  # numbers drawn, or scores computed, at a time
SHOWN = 500  # draws kept for figures
_OVERLAP = 4  # cells per block
_CELLS = 2000  # most cells
_TIMES = 4.0  # least integrated autocorrelation times per block
_SIX = np.sqrt(np.array([0.5, 1.0, 1.5]))
_WEBB = np.concatenate([-_SIX, _SIX])  # mean 0, variance 1, third moment 0 (Webb 2014)
_FULL = 1.0 - 1e-6  # leverage without a residual

Refit = Callable[[Array, bool], tuple[Array, Array]]
"""(added to the model, (n, sets); whether variances differ) -> steps off the estimate and errors, (p, sets) each."""


class Resampled(NamedTuple):
    """Resampled steps of an estimate."""

    steps: Array  # d, (B, p)
    studentised: Array  # d over its error in the resample, (B, p); not finite where an unknown is not seen
    blocks: int  # Blocks per draw
    rounded: bool = False  # Whether interval ends are draws, rounded outward

    def interval(self, which: int, error: float) -> tuple[float, float]:
        """The 95 % interval of one unknown about its estimate by bootstrap-t, from its standard error."""
        if error == 0 or not np.isfinite(error):
            return (0.0, 0.0) if error == 0 else (-np.inf, np.inf)
        t, tail = self.studentised[:, which], (1 - levels.CONFIDENCE) / 2
        if not self.rounded:
            least, most = np.quantile(t, [tail, 1 - tail])
        else:  # a draw without information counts on either side
            blind = ~np.isfinite(t)
            most = np.quantile(np.where(blind, np.inf, t), 1 - tail, method="higher")
            least = np.quantile(np.where(blind, -np.inf, t), tail, method="lower")
        return -float(most) * error, -float(least) * error


def residual_bootstrap(
    jacobian: Array, residuals: Array, place: Array, refit: Refit | None = None, draws: int = REFITS, seed: int = 0
) -> tuple[Resampled, Array]:
    """Steps of an estimate from independent equations, and its standard errors, (p,).

    Jacobian (n, p) and residuals (n,) are at the estimate; the variance may depend on a `place`, (n,). `refit` fits
    each of the `draws` sets, >= 40; None: by a Gauss-Newton step.
    """
    rng, n = np.random.default_rng(seed), residuals.size
    leverage = np.minimum(np.einsum("np,pq,nq->n", jacobian, inverse_gram(jacobian), jacobian), _FULL)
    wild = variances_differ(residuals, place)
    apart, even = residuals / (1 - leverage), residuals / np.sqrt(1 - leverage)
    even -= even.mean()
    found = list[tuple[Array, Array]]()
    for first in range(0, draws, at_once := max(_AT_ONCE // n, 1)):
        size = (n, min(at_once, draws - first))
        noise = apart[:, None] * rng.choice(_WEBB, size) if wild else even[rng.integers(0, n, size)]
        sets = noise if found else np.column_stack([residuals, noise])  # the estimate's own set comes first
        found.append(refit(sets, wild) if refit else linear_refit(jacobian, sets, wild))
    steps, errors = (np.hstack(parts) for parts in zip(*found, strict=True))
    with np.errstate(divide="ignore", invalid="ignore"):
        studentised = steps[:, 1:] / errors[:, 1:]
    return Resampled(steps[:, 1:].T, studentised.T, n, rounded=True), errors[:, 0]


def linear_refit(columns: Array, values: Array, uneven: bool) -> tuple[Array, Array]:
    """Coefficients of columns (n, p) for values (n, sets), and their errors, HC3 if `uneven`, (p, sets) each."""
    inner = inverse_gram(columns)
    weights = inner @ columns.T
    theta = weights @ values
    left = values - columns @ theta
    if uneven:
        kept = 1 - np.minimum(np.einsum("np,pn->n", columns, weights), _FULL)
        return theta, np.sqrt(weights**2 @ (left / kept[:, None]) ** 2)
    cost = np.einsum("ns,ns->s", left, left) / max(left.shape[0] - theta.shape[0], 1)
    return theta, np.sqrt(np.diag(inner)[:, None] * cost)


def variances_differ(residuals: Array, place: Array) -> bool:
    """Whether the variance depends on the place: Koenker's test of a parabola in its logarithm."""
    x, square = np.log(np.abs(place)), residuals**2
    if residuals.size < levels.VARIANCE_POINTS or not np.ptp(x) > 0 or not square.any():
        return False
    s = 2 * (x - x.min()) / np.ptp(x) - 1
    basis = np.linalg.qr(np.column_stack([np.ones_like(s), s, s * s]))[0][:, 1:]
    total = float(np.sum((square - square.mean()) ** 2))
    share = float(np.sum((basis.T @ square) ** 2)) / total if total > 0 else 0.0
    return bool(chdtrc(2, residuals.size * share) < levels.SIGNIFICANCE)


def bootstrap_at(solution: MultistartSolution[Name]) -> tuple[dict[Name, tuple[Array, Array]], int]:
    """Ends of the interval, (2,), and draws, (B,), of each shared unknown inside its bounds; blocks per draw."""
    problem, minimum, errors = solution.posed, solution.minimum, solution.scaled_errors
    x, unknowns, n = minimum.x, problem.unknowns, minimum.residuals.size - problem.priors
    which = np.flatnonzero(np.isfinite(errors) & ((unknowns.lower < x) & (x < unknowns.upper))[: errors.size])
    J = minimum.jacobian[:, which]
    drawn = block_bootstrap(J[:n], minimum.residuals[:n], problem.starts, priors=J[n:], sigma=problem.sigma)
    out: dict[Name, tuple[Array, Array]] = {}
    for column, j in enumerate(which.tolist()):
        box, ends = (unknowns.lower[j], unknowns.upper[j]), x[j] + np.array(drawn.interval(column, float(errors[j])))
        closed = unknowns.natural_of(j, np.clip(ends, *box))
        limited = np.where([ends[0] <= box[0], ends[1] >= box[1]], [unknowns.least[j], np.inf], closed)
        out[unknowns.names[j]] = limited, unknowns.natural_of(j, np.clip(x[j] + drawn.steps[:, column], *box))
    return out, drawn.blocks


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
    """Steps of a least-squares estimate under resampled blocks of equations.

    Args:
        jacobian: of the residuals at the minimum, (n, p), of full rank together with the priors.
        residuals: (n,), of the Jacobian's sign.
        starts: first equation of each segment between gaps.
        priors: rows of the Jacobian that belong to priors, (m, p), whose residuals scatter by `sigma`.
        sigma: see there.
        length: equations in a block; None: `block_length` of the scores.
        draws: B.
        seed: of the generator.
    """
    prior_rows = np.zeros((0, jacobian.shape[1])) if priors is None else priors
    size = np.sqrt(np.einsum("np,np->p", jacobian, jacobian) + np.einsum("mp,mp->p", prior_rows, prior_rows))
    size[size == 0] = 1.0
    J = jacobian / size
    length = length or block_length(J * residuals[:, None])
    edges, of_segment = cells(residuals.size, starts, length)
    grams = np.array([J[a:b].T @ J[a:b] for a, b in pairwise(edges.tolist())])
    scores = np.array([J[a:b].T @ residuals[a:b] for a, b in pairwise(edges.tolist())])
    # sums over the block from each cell, over the number of blocks with each cell
    sizes = np.bincount(of_segment)
    begin, cells_of = (np.cumsum(sizes) - sizes)[of_segment], sizes[of_segment]
    place, share = np.arange(of_segment.size) - begin, 1 / np.minimum(cells_of, _OVERLAP)
    others = [begin + (place + k) % cells_of for k in range(_OVERLAP)]
    inside = [(k < cells_of).astype(float) for k in range(_OVERLAP)]
    grams = np.asarray(sum(grams[o] * w[:, None, None] for o, w in zip(others, inside, strict=True)))
    scores = np.asarray(sum(scores[o] * w[:, None] for o, w in zip(others, inside, strict=True)))
    prior_rows = prior_rows / size
    number, count, p = max(round(float(share.sum())), 1), share.size, size.size
    rng = np.random.default_rng(seed)
    drawn = rng.choice(count, (draws, number), p=share / share.sum()) + count * np.arange(draws)[:, None]
    weight = float(share.sum()) / number
    times = weight * np.bincount(drawn.ravel(), minlength=draws * count).reshape(draws, count)
    gram = (times @ grams.reshape(count, -1)).reshape(draws, p, p) + prior_rows.T @ prior_rows
    inverse: Array = np.asarray(np.linalg.pinv(gram, hermitian=True), dtype=np.float64)
    # centred: equal counts of all blocks give no step
    news = sigma * rng.standard_normal((draws, prior_rows.shape[0])) @ prior_rows
    steps = -np.einsum("bij,bj->bi", inverse, times @ scores - share @ scores + news)
    # standard errors from the remaining scores of blocks in each resample
    squares, by_block, errors = times * weight * number / max(number - 1, 1), grams.transpose(1, 2, 0), list[Array]()
    for k in np.array_split(np.arange(draws), ceil(draws * scores.size / _AT_ONCE)):
        left = scores.T + (steps[k] @ by_block.reshape(p, -1)).reshape(-1, p, count)
        influence, by_priors = inverse[k] @ left, prior_rows @ inverse[k]
        variance = np.einsum("bic,bic,bc->bi", influence, influence, squares[k])
        errors.append(np.sqrt(variance + sigma**2 * np.einsum("bmi,bmi->bi", by_priors, by_priors)))
    with np.errstate(over="ignore"):  # resamples without scatter
        studentised = steps / np.maximum(np.concatenate(errors), np.finfo(float).tiny)
    return Resampled(steps / size, studentised, number)


def block_length(scores: Array) -> int:
    """Equations in a block: four correlation times of the most correlated score column, or n**(1/3)."""
    n = scores.shape[0]
    times = max(inflation(score) for score in scores.T)
    return int(min(max(ceil(_TIMES * times), ceil(n ** (1 / 3))), n))


def cells(n: int, starts: Sequence[int], length: int) -> tuple[Array, Array]:
    """Quarters of blocks: the first equation of each and n, (C + 1,), and the segment of each, (C,)."""
    step = max(length / _OVERLAP, n / _CELLS)
    firsts = [*starts, n]
    counts = [max(round((stop - first) / step), 1) for first, stop in pairwise(firsts)]
    inner = [
        np.linspace(a, b, k, endpoint=False).astype(int) for (a, b), k in zip(pairwise(firsts), counts, strict=True)
    ]
    return np.append(np.concatenate(inner), n), np.repeat(np.arange(len(counts)), counts)
