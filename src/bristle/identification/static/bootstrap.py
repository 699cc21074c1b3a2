"""Bootstrap of a static fit of points: torques drawn anew at the same velocities, each set fitted again by the whole grid.

Residuals are raised to the size that the fit took from them (their leverage), then drawn with replacement; where their variance differs from speed
to speed each keeps its place and is given a random sign and size instead (the wild bootstrap, with Webb's six values). Each draw is studentised: the
distribution of (theta* - theta) / se* stands for that of (theta - truth) / se, and an interval need be neither symmetric nor normal (bootstrap-t).
"""

from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc

from bristle.arrays import Array
from bristle.estimation.covariance import LEVEL
from bristle.estimation.linear import inverse_gram
from bristle.identification.static.batch import Batch
from bristle.identification.static.grid import Solution
from bristle.identification.static.problem import Regression

DRAWS = 1999
SEED = 0
_SIX = np.sqrt(np.array([0.5, 1.0, 1.5]))
_WEBB = np.concatenate([-_SIX, _SIX])
"""Mean 0, variance 1, third moment 0 (Webb 2014)."""
_UNEVEN = 0.01
"""Significance at which variances differ."""
_SCHEMES = {False: "residuals", True: "signs of residuals (wild)"}
_FULL = 1.0 - 1e-6
"""A point with this leverage leaves no residual."""


class Resampled(NamedTuple):
    """A bootstrap of p parameters."""

    low: Array
    """Lower ends of the 95 % intervals, (p,); -inf, or 0 for what is positive, where too many draws do not show the parameter."""
    high: Array
    """(p,)."""
    draws: Array
    """(p, b)."""
    scheme: str
    """What was drawn, in words."""


def resample(
    problem: Regression, solution: Solution, v_s_range: tuple[float, float], draws: int = DRAWS, seed: int = SEED
) -> Resampled:
    """Intervals of every parameter, in the order of the problem's `names`, for points of which each stands alone, with at most one peak.

    Args:
        problem: the points.
        solution: its solution.
        v_s_range: as it was solved with.
        draws: resampled sets, >= 40.
        seed: of the generator.
    """
    noise, uneven = _noise(solution.jacobian, solution.residuals, problem.velocity, draws, seed)
    sets = (problem.torque - solution.residuals)[:, None] + noise
    both = np.column_stack([problem.torque, sets])
    theta, errors = _fits(problem, both, v_s_range, sandwich=uneven)
    low, high = _studentised(problem, solution.theta, theta[:, 1:], errors)
    return Resampled(low, high, theta[:, 1:], _SCHEMES[uneven])


def one_step(jacobian: Array, residuals: Array, velocity: Array, draws: int = DRAWS, seed: int = SEED) -> Resampled:
    """The same for any fit of points, by a step of Gauss and Newton for each draw: intervals and draws of how far an unknown lies off its estimate.

    Args:
        jacobian: of the model at the estimate, (n, p), of full rank.
        residuals: measured minus modelled, (n,).
        velocity: rad/s, (n,).
        draws: as in `resample`.
        seed: as in `resample`.
    """
    noise, uneven = _noise(jacobian, residuals, velocity, draws, seed)
    steps, errors = _linear_fits(jacobian, np.column_stack([residuals, noise]), sandwich=uneven)
    most, least = _quantiles(steps[:, 1:], errors[:, 1:])
    return Resampled(-most * errors[:, 0], -least * errors[:, 0], steps[:, 1:], _SCHEMES[uneven])


def _noise(jacobian: Array, left: Array, velocity: Array, draws: int, seed: int) -> tuple[Array, bool]:
    """What is added to the modelled torques, (n, draws), and whether it is drawn wild."""
    rng = np.random.default_rng(seed)
    leverage = np.minimum(np.einsum("np,pq,nq->n", jacobian, inverse_gram(jacobian), jacobian), _FULL)
    if variances_differ(left, velocity):
        return (left / (1 - leverage))[:, None] * rng.choice(_WEBB, (left.size, draws)), True
    even = left / np.sqrt(1 - leverage)
    return (even - even.mean())[rng.integers(0, left.size, (left.size, draws))], False


def variances_differ(residuals: Array, velocity: Array) -> bool:
    """Whether the residuals' variance depends on the speed (Koenker's test against a parabola over log speed, 1 %); never with few points."""
    speed, square = np.log(np.abs(velocity)), residuals**2
    if residuals.size < 10 or not np.ptp(speed) > 0 or not square.any():
        return False
    s = 2 * (speed - speed.min()) / np.ptp(speed) - 1
    basis = np.linalg.qr(np.column_stack([np.ones_like(s), s, s * s]))[0][:, 1:]
    total = float(np.sum((square - square.mean()) ** 2))
    share = float(np.sum((basis.T @ square) ** 2)) / total if total > 0 else 0.0
    return bool(chdtrc(2, residuals.size * share) < _UNEVEN)


def _fits(
    problem: Regression, torques: Array, v_s_range: tuple[float, float], *, sandwich: bool
) -> tuple[Array, Array]:
    """Estimates and standard errors of each set, (p, sets); inf where nothing is seen of a parameter."""
    if problem.peaks:
        found = Batch(problem, torques, v_s_range)
        return found.theta, found.errors(robust=sandwich)
    return _linear_fits(problem.linear, torques, sandwich=sandwich)


def _linear_fits(columns: Array, torques: Array, *, sandwich: bool) -> tuple[Array, Array]:
    """The same of a problem that is linear in columns (n, p)."""
    inner = inverse_gram(columns)
    weights = inner @ columns.T
    theta = weights @ torques
    left = torques - columns @ theta
    if sandwich:
        kept = 1 - np.minimum(np.einsum("np,pn->n", columns, weights), _FULL)
        return theta, np.sqrt(weights**2 @ (left / kept[:, None]) ** 2)
    cost = np.einsum("ns,ns->s", left, left) / max(left.shape[0] - theta.shape[0], 1)
    return theta, np.sqrt(np.diag(inner)[:, None] * cost)


def _studentised(problem: Regression, best: Array, theta: Array, errors: Array) -> tuple[Array, Array]:
    """Ends of the intervals from draws (p, b) and standard errors, of the estimate (first) and of each draw, (p, 1 + b); v_s by its logarithm."""
    positive = np.array([name.startswith("v_s") for name in problem.names])[:, None]
    size = np.where(positive, theta, 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        off = np.where(positive, np.log(theta / best[:, None]), theta - best[:, None])
        most, least = _quantiles(off, errors[:, 1:] / size)
    own = errors[:, 0] / np.where(positive[:, 0], best, 1.0)
    with np.errstate(over="ignore", invalid="ignore"):
        reach = ((-most * own, -np.inf), (-least * own, np.inf))
        ends = [np.where(own > 0, np.where(np.isfinite(own), end, none), 0.0) for end, none in reach]
        low, high = (np.where(positive[:, 0], best * np.exp(end), best + end) for end in ends)
    floor = np.array([0.0 if name.startswith(("alpha", "v_s")) else -np.inf for name in problem.names])
    return np.maximum(low, floor), np.maximum(high, floor)


def _quantiles(off: Array, errors: Array) -> tuple[Array, Array]:
    """The highest and the lowest studentised draw of the middle 95 %, (p,) each."""
    with np.errstate(divide="ignore", invalid="ignore"):
        t = off / errors
    blind = ~np.isfinite(t)  # a draw that shows nothing of a parameter may lie on either side
    tail = (1 - LEVEL) / 2
    most: Array = np.quantile(np.where(blind, np.inf, t), 1 - tail, axis=1, method="higher")
    least: Array = np.quantile(np.where(blind, -np.inf, t), tail, axis=1, method="lower")
    return most, least
