"""Many static data sets that share their velocities, in a few matrix products."""

import numpy as np

from bristle.identification.regression import from_points
from bristle.identification.static import Projected, log_grid, solve
from bristle.model.arrays import Array

GRID = 48
"""Values of v_s; more than one refined fit needs, for here the minimum is interpolated between them."""
_NEWTON = 4
_NEIGHBOURS = np.arange(-2, 4)
_TO_POLYNOMIAL = np.linalg.inv(np.vander(_NEIGHBOURS.astype(float), increasing=True))
"""From six neighbouring values to the coefficients of their polynomial in t, which counts grid steps."""


def solve_batch(
    velocity: Array, torques: Array, v_s_range: tuple[float, float], grid: int = GRID
) -> tuple[Array, Array]:
    """Many data sets that share their velocities, in a few matrix products (one direction, no extra regressors).

    The grid's projections serve all sets at once. Each set's minimum is then refined between grid values: what the profile is made of,
    s'r and s's, is interpolated over log(v_s) by polynomials through six neighbours.

    Args:
        velocity: rad/s, shape (n,), one sign or symmetric.
        torques: N*m, shape (n, sets).
        v_s_range: as in `solve`.
        grid: as in `solve`, >= 8.

    Returns:
        theta, shape (4, sets), in the order alpha_0, alpha_2, alpha_1, v_s; and the cost, shape (sets,). Sets whose minimum lies at the end
        of the range, or whose free solution breaks a bound, are solved one by one, as `solve` does.
    """
    problem = from_points(velocity, torques[:, 0], ("both",))
    projected = Projected(problem)
    values = log_grid(v_s_range, grid)
    off, length = projected.off(values)
    inside = projected.q.T @ problem.shapes(values)
    products = np.hstack([projected.q, off]).T @ torques
    in_q, along = products[: projected.q.shape[1]], products[projected.q.shape[1] :]
    coarse = (np.maximum(along, 0.0) ** 2 / length[:, None]).argmax(axis=0)
    near = np.clip(coarse, 2, grid - 4) + _NEIGHBOURS[:, None]
    local_along = _TO_POLYNOMIAL @ np.take_along_axis(along, near, axis=0)
    local_length = _TO_POLYNOMIAL @ length[near]
    t = _steepest_gain(local_along, local_length)
    a, x = _horner(local_along, t), _horner(local_length, t)
    alpha_1 = a / x
    reached = np.stack([_horner(_TO_POLYNOMIAL @ row[near], t) for row in inside])
    linear = projected.back(in_q - reached * alpha_1)
    cost = np.einsum("ns,ns->s", torques, torques) - np.einsum("ms,ms->s", in_q, in_q) - a * alpha_1
    v_s = values[near[2]] * (values[1] / values[0]) ** t
    theta = np.vstack([linear, alpha_1, v_s])
    alone = (theta[:3] <= 0).any(axis=0) | (coarse < 2) | (coarse > grid - 4) | ~((t > -1.5) & (t < 2.5))
    for k in np.flatnonzero(alone):
        one = solve(from_points(velocity, torques[:, k], ("both",)), v_s_range, grid)
        theta[:, k], cost[k] = one.theta, one.cost
    return theta, cost


def _steepest_gain(along: Array, length: Array) -> Array:
    """Where along(t)**2 / length(t) is largest, by Newton on 2 along' length - along length' = 0 from t = 0; coefficients (6, sets)."""
    along_1, length_1 = _derivative(along), _derivative(length)
    along_2, length_2 = _derivative(along_1), _derivative(length_1)
    t = np.zeros(along.shape[1])
    for _ in range(_NEWTON):
        a, a1, a2 = _horner(along, t), _horner(along_1, t), _horner(along_2, t)
        x, x1, x2 = _horner(length, t), _horner(length_1, t), _horner(length_2, t)
        bend = 2 * a2 * x + a1 * x1 - a * x2
        step = np.divide(a * x1 - 2 * a1 * x, bend, out=np.full_like(t, np.inf), where=bend < 0)
        t = t + np.clip(step, -0.7, 0.7)
    return t


def _horner(coefficients: Array, t: Array) -> Array:
    value: Array = coefficients[-1]
    for c in coefficients[-2::-1]:
        value = value * t + c
    return value


def _derivative(coefficients: Array) -> Array:
    result: Array = coefficients[1:] * np.arange(1.0, coefficients.shape[0])[:, None]
    return result
