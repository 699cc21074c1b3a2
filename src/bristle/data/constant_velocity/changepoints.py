"""Candidates for constant velocity: a run cut into pieces of constant acceleration, each a plateau or not.

The cut depends on the data alone, on no threshold, so that a looser threshold only accepts more of the same candidates.
Velocity is averaged over equal blocks, and the blocks are divided among straight lines by dynamic programming over the
marginal likelihood of each line with its own unknown noise. The block length is the one with the longest plateaus in
all; what lies between them is cut again, finer.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import gammaln

from bristle.arrays import Array
from bristle.estimation import levels
from bristle.estimation.autocorrelation import autocorrelation, white_noise

_SMALLEST = 4  # samples in a block
_BLOCKS = (16, 32, 64, 128, 256, 512, 2048)
_ENOUGH = 512  # blocks; more are tried only where no more than half is explained: the work grows with their square
_COLUMNS = 64  # ends of lines whose costs are found at once
_PRIOR = 4.0  # degrees of freedom of the prior on each line's noise


@dataclass(frozen=True, slots=True)
class CandidateSpan:
    """Samples start to stop - 1 of a run, a plateau or not."""

    start: int
    stop: int
    plateau: bool
    score: float = 0.0  # samples explained as motion at constant velocity; fewer the more the velocity swings
    cut: int = 0  # samples that were cut off its beginning, while its torque settled


def candidates(velocity: Array, torque: Array, start: int, stop: int) -> list[CandidateSpan]:
    """Plateaus, and what lies between them, in the samples start to stop - 1, which hold no gap, in order.

    Without a plateau they are cut into lines. Of velocity, rad/s, and torque, N*m, (n,) each: a plateau begins once
    both have settled.
    """
    # without plateaus that are an edge of another: as near as they are long, a third as long, at its speed within 10 %
    kept: list[tuple[CandidateSpan, float]] = []
    for s in sorted(_plateaus(velocity, torque, start, stop), key=lambda s: s.start - s.stop):
        length, mean = s.stop - s.start, float(velocity[s.start : s.stop].mean())
        if not any(
            max(k.start - s.stop, s.start - k.stop) <= length
            and k.stop - k.start >= levels.EDGE * length
            and abs(mean - speed) <= levels.SAME_PLATEAU * abs(speed)
            for k, speed in kept
        ):
            kept.append((s, mean))
    plateaus = [_without_transient(torque, s) for s in sorted((s for s, _ in kept), key=lambda s: s.start)]
    if not plateaus and stop - start >= _BLOCKS[0] * _SMALLEST:
        return _cut(velocity, torque, start, stop, min(_ENOUGH // 2, (stop - start) // _SMALLEST))
    edges = [start, *(edge for s in plateaus for edge in (s.start, s.stop)), stop]
    between = [CandidateSpan(a, b, False) for a, b in zip(edges[::2], edges[1::2], strict=True) if b > a]
    return sorted([*plateaus, *between], key=lambda s: s.start)


def _plateaus(velocity: Array, torque: Array, start: int, stop: int) -> list[CandidateSpan]:
    if stop - start < _BLOCKS[0] * _SMALLEST:
        return []
    best, most = list[CandidateSpan](), 0.0
    for blocks in _BLOCKS:
        if stop - start < blocks * _SMALLEST or (blocks > _ENOUGH and most > 0.5 * (stop - start)):
            break
        cut = _cut(velocity, torque, start, stop, blocks)
        total = sum(s.score for s in cut)
        if total > levels.FINER * most:
            best, most = cut, total
    if not best:
        return []
    plateaus, edge = list[CandidateSpan](), start
    for plateau in (s for s in best if s.plateau):
        plateaus += [*_plateaus(velocity, torque, edge, plateau.start), plateau]
        edge = plateau.stop
    return plateaus + _plateaus(velocity, torque, edge, stop)


def _cut(velocity: Array, torque: Array, start: int, stop: int, blocks: int) -> list[CandidateSpan]:
    length = (stop - start) // blocks
    blocks = (stop - start) // length
    u, t = (x[start : start + blocks * length].reshape(blocks, length).mean(axis=1) for x in (velocity, torque))
    edges = start + length * np.arange(blocks + 1)
    edges[-1] = stop
    lines = []
    for i, j in _lines(u):
        first, last = _settled(u, t, i, j) if j - i >= levels.PLATEAU_BLOCKS else (i, j)
        a, b = int(edges[first]), int(edges[last])
        score = _score(u[first:last], velocity[a:b])
        lines += [CandidateSpan(a, b, True, score)] if score else [CandidateSpan(int(edges[i]), int(edges[j]), False)]
    return lines


def _lines(u: Array) -> list[tuple[int, int]]:
    """Blocks divided among straight lines: least minus twice the log marginal likelihood, with a penalty per line."""
    n = u.size
    penalty = 6 * np.log(n)
    k = np.arange(n) - n / 2
    sums = np.array([np.r_[0.0, np.cumsum(x)] for x in (np.ones(n), k, k * k, u, u * u, k * u)])
    noise = white_noise(u) + 1e-9 * float(np.abs(u).max())
    constant = gammaln((np.arange(n + 1) + _PRIOR) / 2) * 2 - np.arange(n + 1) * np.log(_PRIOR)
    best, previous = np.zeros(n + 1), np.zeros(n + 1, dtype=int)
    for j in range(1, n + 1):
        if j % _COLUMNS == 1:
            # of lines between two ends, their noise integrated out
            m, sk, skk, su, suu, sku = sums[:, j : j + _COLUMNS, None] - sums[:, None, :]
            m = np.maximum(m, 1)
            spread, covariance = skk - sk * sk / m, sku - sk * su / m
            covariance[m < 2] = 0.0
            residual = np.maximum(suu - su * su / m - covariance * covariance / np.maximum(spread, 0.5), 0.0)
            scale = max(noise, 1e-150) ** 2 + (levels.FLAT * su / m) ** 2
            columns = (m + _PRIOR) * np.log1p(residual / (_PRIOR * scale)) + m * np.log(scale)
        total = best[:j] + columns[(j - 1) % _COLUMNS, :j] - constant[j:0:-1]
        previous[j] = int(np.argmin(total))
        best[j] = total[previous[j]] + penalty
    ends = [n]
    while ends[-1] > 0:
        ends.append(int(previous[ends[-1]]))
    return list(zip(ends[:0:-1], ends[-2::-1], strict=True))


def _settled(u: Array, t: Array, i: int, j: int) -> tuple[int, int]:
    """Blocks i to j - 1 without those at the ends whose velocity or torque is over four deviations off the median."""
    outside = np.zeros(j - i, dtype=bool)
    for x in (u[i:j], t[i:j]):
        middle = float(np.median(x))
        off = np.abs(x - middle)
        outside |= off > max(levels.DEVIATIONS * float(np.median(off)) / 0.6745, levels.SETTLED * abs(middle))
    inside = np.flatnonzero(~outside)
    return (i + int(inside[0]), i + int(inside[-1]) + 1) if inside.size else (i, i)


def _without_transient(torque: Array, s: CandidateSpan) -> CandidateSpan:
    """A plateau from the least standard error of its mean torque on (White, 1997), in its first quarter or 3/4."""
    length = max((s.stop - s.start) // 64, 1)  # 64 parts of a plateau of which the first may be dropped
    count = (s.stop - s.start) // length
    t = torque[s.start : s.start + count * length].reshape(count, length).mean(axis=1)
    first = 0
    for most in (count // 4, 3 * count // 4):
        errors = [float(np.var(t[d:])) / (count - d) for d in range(most + 1)]
        first = int(np.argmin(errors))
        halves = np.array_split(t[first:], 2)
        apart = abs(float(halves[0].mean() - halves[1].mean()))
        few = min(x.size for x in halves) < 2
        noise = np.inf if few else float(np.sqrt(sum(np.var(x, ddof=1) / x.size for x in halves)))
        if apart <= levels.DEVIATIONS * noise:
            break
    return replace(s, start=s.start + length * first, cut=length * first)


def _score(u: Array, v: Array) -> float:
    """Samples explained if block means u and samples v are a plateau; 0 if they are none."""
    m = u.size
    if m < levels.PLATEAU_BLOCKS:
        return 0.0
    mean = float(abs(u.mean()))
    slope, level = np.polyfit(np.arange(m), u, 1)
    sd = float(np.std(u - (level + slope * np.arange(m)))) * np.sqrt(m / (m - 2))
    drifts = abs(slope) * m > max(levels.CUT_DRIFT * mean, levels.SURE * sd * np.sqrt(12 / m))
    if drifts or mean <= levels.MOVES * sd / np.sqrt(m):
        return 0.0
    swing = float(np.var(v)) * max(float(autocorrelation(v)[min(2, v.size - 1)]), 0.0)
    return v.size / (1 + 6 * max(float(np.sqrt(swing)) / mean - levels.CUT_SWING, 0.0))
