"""What the residuals of moving runs would like to have been otherwise.

A torque logged earlier or later, one that drifts, another inertia than the one given, another model in a few moments.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter1d

from bristle.arrays import Array
from bristle.control.plant import quantise
from bristle.data.differentiation import derivative, smoothed, usable
from bristle.data.record import Record
from bristle.estimation.autocorrelation import inflation, lag_one
from bristle.estimation.linear import inverse_gram
from bristle.estimation.multistart import MultistartSolution
from bristle.findings import Finding
from bristle.identification.dynamic.problem import DynamicProblem, Motion, Unknown, modelled, parameters
from bristle.identification.messages import Kind
from bristle.model.parameters import INERTIA, Lugre, unit
from bristle.model.parameters import Kind as JointKind

_SURE = 4.0
"""Standard errors from zero, beyond which it is said."""
_ALIKE = 3.3
"""The same far from reversals, where all equations are sure: 5e-4 of clean runs by chance alone."""
_SHARE = 0.05
"""Of the cost, that must go with it: less is not worth a sentence."""
_SLID = 5.0
"""Deflections g0 / sigma_0 that a joint travels after a reversal until it slides: exp(-5) is left of the way."""
_FILTERED = 2.0
"""Periods of the position's cut-off before and after a reversal in which the low pass rounds it off."""
_REACHED = 0.02
"""An equation whose decimation filter gives less than this weight to what is near a reversal is far from it."""
_LOST = 1e-9
"""A column that keeps less of its length far from reversals is not seen there."""
_LEAST = 1e-100
"""Of sigma_0: no division by zero."""
_BURST, _TOP = 0.25, 0.01
"""Share of the squares left, that this share of the equations may hold: 0.08 of normal noise, 0.16 of Laplace's."""
_PATTERN = 0.9
"""Correlation of neighbours in what is left, beyond which hardly any of it is noise: 1 - 0.9**2 at the most."""
_ENOUGH, _INDEPENDENT = 300, 30
"""Equations that tell it, and how many of them must be independent."""
_TURNING, _BESIDE = 0.1, 2
"""An equation is about a reversal where it is slower than this share of the rms speed, or one of two neighbours is, ..."""
_TURNS_WORSE, _FEWEST = 2.0, 20
"""... and so many of them may not leave more than so many times what the others do, rms: 1.0 to 1.1 times of clean runs."""
_PLACES, _BETWEEN, _LARGE = 3, 0.2, 0.1
"""Places named, s between two, and their squares beside the largest."""
_PHASE = 0.37
"""Where in a count the joint rests in a draw of what counting does."""


def missing_terms(problem: DynamicProblem, solution: MultistartSolution[Unknown], kind: JointKind) -> list[Finding]:
    """What is doubted: a shift in time between torque and motion, that nothing drifts, and an inertia that was given and not fitted.

    One more column beside the Jacobian's: what part of the residuals it would explain that no parameter can, to first
    order.
    """
    if problem.quantity != "torque":
        return []
    motions = problem.motions
    torque = list(zip(modelled(problem, solution.values), motions, strict=True))
    late = _equations(motions, [-np.gradient(T, m.time) for T, m in torque])
    drift = _equations(motions, [T * ((m.time - m.time[0]) / np.ptp(m.time) - 0.5) for T, m in torque])
    inert = _equations(motions, [np.gradient(m.velocity, m.time) for m in motions])
    given = INERTIA not in problem.names
    warnings = _delay(problem, solution, late, inert[:, None] if given else np.zeros((inert.size, 0)))
    every = np.ones(inert.size, dtype=bool)
    grows = _wanted(solution, drift, late[:, None], every)
    if grows.counts:
        how = "grows" if grows.value > 0 else "falls"
        warnings.append(Kind.TORQUE_DRIFTS_IN_RUNS(how=how, by=abs(grows.value), share=grows.share))
    weight = [k for k, name in enumerate(problem.extra_names) if name.name.startswith("gravity")]
    if weight and all(m.load is None for m in motions):
        force = np.array([solution.values.get(n, problem.fixed.get(n, 0.0)) for n in problem.extra_names])[weight]
        by_load = [np.abs(m.extra[:, weight] @ force) * np.sign(m.velocity) for m in motions]
        loaded = _wanted(solution, _equations(motions, by_load), late[:, None], every)
        if loaded.counts:
            warnings.append(
                Kind.FRICTION_BY_LOAD(by=loaded.value, error=loaded.error, share=loaded.share, law=problem.law.name)
            )
    more = _wanted(solution, inert, late[:, None], every)
    if given and more.counts:
        warnings.append(Kind.INERTIA_DOUBTED(more=more.value, error=more.error, unit=unit("inertia", kind)))
    return warnings


def _delay(
    problem: DynamicProblem, solution: MultistartSolution[Unknown], column: Array, others: Array
) -> list[Finding]:
    """Whether the torque was logged early or late: all equations ask for it, and those far from reversals as well.

    At a reversal a bristle that the model does not describe, or that the encoder does not show, delays the torque as
    well; and what only some equations ask for is no delay.
    """
    every = np.ones(column.size, dtype=bool)
    made = _made_by_counts(problem, solution)
    whole, far = (
        _without_counts(_wanted(solution, column, others, rows), made[rows])
        for rows in (every, _far_from_reversals(problem, solution))
    )
    alike = far.value * whole.value > 0 and abs(far.value) > _ALIKE * far.error
    if not whole.counts or (not alike and _SURE * far.error < abs(whole.value)):
        return []  # sliding would have shown it
    kind, more = (Kind.TORQUE_DELAYED, far) if alike else (Kind.DELAY_OR_PRESLIDING, whole)
    step = float(np.median(np.concatenate([m.step for m in problem.motions])))
    when = "earlier" if more.value > 0 else "later"
    numbers = {"seconds": abs(more.value), "samples": abs(more.value) / step, "when": when}
    further = {"share": more.share, "delay": more.value} if kind is Kind.TORQUE_DELAYED else {}
    return [kind(**numbers, **further)]


class _More(NamedTuple):
    """How much of a column the residuals ask for, its standard error, and the share of the cost that goes with it."""

    value: float
    error: float
    share: float
    rest: float = np.inf
    """Squared length of the column beside all others."""

    @property
    def counts(self) -> bool:
        """Whether it is worth a sentence."""
        return abs(self.value) > _SURE * self.error and self.share > _SHARE


def pattern_left(problem: DynamicProblem, rows: Array) -> list[Finding]:
    """Whether what the fit leaves, (n,), is a pattern throughout, or much more about reversals than elsewhere, or most of it in a few equations."""
    correlation = lag_one(rows)
    if correlation > _PATTERN:
        return [Kind.LACKS_UNKNOWN_TERM(lag_one=correlation)]
    squares, speed = rows**2, np.abs(problem.velocity)
    turns = minimum_filter1d(speed, 2 * _BESIDE + 1) < _TURNING * np.sqrt(np.mean(speed**2))
    total, few = float(squares.sum()), round(_TOP * rows.size)
    if rows.size < _ENOUGH or not total > 0 or rows.size < _INDEPENDENT * inflation(rows):
        return []
    if min(turns.sum(), (~turns).sum()) >= _FEWEST:
        ratio = float(np.sqrt(squares[turns].mean() / max(squares[~turns].mean(), 1e-300)))
        if ratio > _TURNS_WORSE:
            return [Kind.REVERSALS_LEFT(ratio=ratio)]
    worst = np.argsort(-squares)[:few]
    share = float(squares[worst].sum()) / total
    if share < _BURST:
        return []
    file, places = problem.file, list[int]()
    for k in worst[squares[worst] > _LARGE * squares[worst[0]]].tolist():
        near = (abs(problem.time[k] - problem.time[j]) < _BETWEEN for j in places if file[j] == file[k])
        if len(places) < _PLACES and not any(near):
            places.append(k)
    return [Kind.BURSTS(share=share, few=_TOP, where=tuple(f"{file[k]} at {problem.time[k]:.5g} s" for k in places))]


def _wanted(solution: MultistartSolution[Unknown], column: Array, others: Array, rows: NDArray[np.bool_]) -> _More:
    """A column of the equations, (n,), beside others, (n, k), and the Jacobian's, in some of them.

    Nothing for sure where these are too few.
    """
    n = column.size
    jacobian = np.hstack([solution.minimum.jacobian[:n, solution.scaled_errors < np.inf], others])
    length = np.linalg.norm(jacobian, axis=0)
    seen = np.linalg.norm(jacobian[rows], axis=0) > _LOST * length
    known, rest, more = jacobian[rows][:, seen] / length[seen], solution.minimum.residuals[:n][rows], column[rows]
    if rest.size < 2 * known.shape[1] + 2:
        return _More(0.0, np.inf, 0.0)
    inverse = inverse_gram(known)
    beside, left = (x - known @ (inverse @ (known.T @ x)) for x in (more, rest))
    square, cost = float(beside @ beside), float(left @ left)
    if not (square > 0 and cost > 0):
        return _More(0.0, np.inf, 0.0)
    value = float(beside @ left) / square
    score = beside * (left - value * beside) / square
    return _More(value, float(np.sqrt(score @ score * inflation(score))), value**2 * square / cost, square)


def _without_counts(more: _More, made: Array) -> _More:
    """The delay that some equations ask for, less the one that counts of the encoder make there, (n,), half of which is its error."""
    if not (made.any() and np.isfinite(more.error)):
        return more
    delay = float(made.sum()) / more.rest
    return more._replace(value=more.value - delay, error=float(np.hypot(more.error, delay / 2)))


def _made_by_counts(problem: DynamicProblem, solution: MultistartSolution[Unknown]) -> Array:
    """What counts of the encoder add to the delay that each equation asks for, times the squares of the column beside all others, (n,).

    Counts make noise in the acceleration, a, which is in the residuals, -J a, and in what a delay multiplies,
    -alpha_2 a - J da/dt: the regression finds a delay of -J alpha_2 sum(a**2) / (squares of the column beside all
    others), which is none (errors in variables).
    """
    inertia = solution.values.get(INERTIA, problem.fixed.get(INERTIA, 0.0))
    if not (problem.count and problem.cutoff and inertia):
        return np.zeros(sum(m.size for m in problem.motions))
    noise = _equations(problem.motions, [_count_noise(m, problem.count, problem.cutoff) for m in problem.motions])
    known = parameters(problem, solution.values)
    alpha_2 = known.alpha_2 if isinstance(known, Lugre) else sum(p.alpha_2 for p in known) / 2
    made: Array = -inertia * alpha_2 * noise**2
    return made


def _count_noise(motion: Motion, count: float, cutoff: float) -> Array:
    """Acceleration that comes of counting the motion anew, with the joint resting elsewhere in a count, rad/s**2, (N,)."""
    if not motion.position.size:
        return np.zeros(motion.time.size)
    record = Record(file=motion.file, time=motion.time)
    cutoff = usable(record, cutoff)
    path = smoothed(record, motion.position, cutoff) + _PHASE * count
    off = np.asarray(quantise(path, count)).ravel() - path
    return derivative(record, smoothed(record, off, cutoff), 2)


def _equations(motions: Sequence[Motion], columns: Sequence[Array]) -> Array:
    """A column per motion, (N,) each, as the fit's equations see it, (n,)."""
    return np.concatenate([m.weighted(c) for m, c in zip(motions, columns, strict=True)])


def _far_from_reversals(problem: DynamicProblem, solution: MultistartSolution[Unknown]) -> NDArray[np.bool_]:
    """Which equations see only samples at which the joint slides, (n,)."""
    known = parameters(problem, solution.values)
    reach = _SLID * max(
        (p.alpha_0 + p.alpha_1) / max(p.sigma_0, _LEAST) for p in ([known] if isinstance(known, Lugre) else known)
    )
    filtered = _FILTERED / problem.cutoff if problem.cutoff else 0.0
    far = []
    for m in problem.motions:
        near = _near_reversals(m, reach, filtered).astype(float)
        far.append((near if m.smooth is None else abs(m.smooth) @ near) < _REACHED)
    return np.concatenate(far)


def _near_reversals(motion: Motion, reach: float, filtered: float) -> NDArray[np.bool_]:
    """Samples less than a way after a reversal, or after the start, or a time before or after one, (N,)."""
    v, t = motion.velocity, motion.time
    way = np.concatenate([[0.0], np.cumsum(np.abs(v[1:] + v[:-1]) / 2 * motion.step)])
    turns = np.append(np.insert(np.flatnonzero(np.diff(np.sign(v))) + 1, 0, 0), t.size)
    interval = np.searchsorted(turns, np.arange(t.size), side="right") - 1
    before, after = turns[interval], turns[interval + 1]
    until = np.where(after < t.size, t[np.minimum(after, t.size - 1)] - t, np.inf)
    near: NDArray[np.bool_] = (way - way[before] < reach) | (t - t[before] < filtered) | (until < filtered)
    return near
