"""Static fits of many data sets at the same velocities, from tables over log(v_s) interpolated by polynomials."""

from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.identification.static.grid import Projected, solve
from bristle.identification.static.problem import Regression, log_grid

GRID = 128  # values of v_s, more than for one fit, because results are interpolated
_IN_CACHE = 400_000  # residuals per block of robust errors
COARSE = 48  # values of v_s for the minimum alone
_NEWTON = 4
_NEIGHBOURS = np.arange(-2, 4)
_TO_POLYNOMIAL = np.linalg.inv(np.vander(_NEIGHBOURS.astype(float), increasing=True))
"""From six neighbouring values to the coefficients of their polynomial in t, which counts grid steps."""


class Tables(NamedTuple):
    """Of the Stribeck column s and its slope d by log(v_s), off the linear columns, over the length of s there."""

    log_length: Array  # Logarithm of that length
    cross: Array  # s'd
    steep: Array  # d'd
    inside: Array  # What the linear parameters lose with s, and with d: (2, m, ...)
    along: Array  # s'T of each set; its square is by how much the peak lowers the cost


class Batch:
    """Sets of torques, N*m, (n, sets), at the same velocities, solved as `solve` does; one peak, `grid` >= 8."""

    theta: Array
    """In the order of the problem's `names`, (p, sets)."""
    cost: Array
    """J_s, (sets,)."""

    def __init__(self, problem: Regression, torques: Array, v_s_range: tuple[float, float], grid: int = GRID) -> None:
        """Tabulate and solve."""
        self.problem, self.torques, self.v_s_range, self.grid = problem, torques, v_s_range, grid
        self._step = np.log(v_s_range[1] / v_s_range[0]) / (grid - 1)
        projected = Projected(problem)
        values, q = log_grid(v_s_range, grid), projected.q
        shapes, slopes = problem.slopes(values)
        (of_shapes, off), (of_slopes, steep) = projected.without(shapes), projected.without(slopes * values)
        inside = np.stack([of_shapes, of_slopes])
        products = np.hstack([q, off]).T @ torques
        in_q, along = products[: q.shape[1]], products[q.shape[1] :]
        length = np.maximum(np.linalg.norm(off, axis=0), 1e-300)
        cross, square = (np.einsum("nk,nk->k", a / length, steep / length) for a in (off, steep))
        lost = projected.r_inverse @ (inside / length)
        self._tables = Tables(np.log(length), cross, square, lost, along / length[:, None])
        rest = torques - q @ in_q
        self._gram = projected.r_inverse @ projected.r_inverse.T
        # the minimum of each set, between grid values
        along, last = self._tables.along, grid - 1
        coarse = np.maximum(along, 0.0).argmax(axis=0)
        near = np.clip(coarse, 2, grid - 4) + _NEIGHBOURS[:, None]
        # maximum of each set's polynomial, by Newton's method
        of_set = _TO_POLYNOMIAL @ np.take_along_axis(along, near, axis=0)
        slope, bend, t = polyder(of_set), polyder(of_set, 2), np.zeros(along.shape[1])
        for _ in range(_NEWTON):
            curved = polyval(t, bend, tensor=False)
            step = np.divide(-polyval(t, slope, tensor=False), curved, out=np.full_like(t, np.inf), where=curved < 0)
            t = t + np.clip(step, -0.7, 0.7)
        inside_grid = (coarse >= 2) & (coarse <= grid - 4) & (t > -1.5) & (t < 2.5)
        self._x = np.clip(near[2] + t, 0.0, last)
        at = self._at(self._x[:, None])
        peak = at.along[:, 0]
        with np.errstate(over="ignore"):  # vanishing columns: solved alone below
            linear, alpha_1 = projected.back(in_q) - at.inside[0, :, :, 0] * peak, peak * np.exp(-at.log_length[:, 0])
        self.theta = np.vstack([linear, alpha_1, v_s_range[0] * np.exp(self._step * self._x)])
        self.cost = np.maximum(np.einsum("ns,ns->s", rest, rest) - np.maximum(peak, 0.0) ** 2, 0.0)
        alone = (self.theta[:-1] <= problem.least[:-1, None]).any(axis=0) | ~inside_grid
        # sets at an end of the range or at a bound, one by one
        for k in np.flatnonzero(alone | ~np.isfinite(self.theta).all(axis=0)).tolist():
            one = solve(problem.with_torque(torques[:, k]), v_s_range, grid)
            self.theta[:, k], self.cost[k] = one.theta, one.cost
            self._x[k] = np.clip(np.log(one.theta[-1] / v_s_range[0]) / self._step, 0.0, last)

    def errors(self, *, robust: bool = False) -> Array:
        """Standard errors as `estimation.covariance` has them, HC3 if `robust`, (p, sets); inf for alpha_1 = 0."""
        if robust:
            blocks = np.array_split(np.arange(self.cost.size), ceil(self.torques.size / _IN_CACHE))
            return np.hstack([self._robust_errors(sets) for sets in blocks])
        at, freedom = self._at(self._x[:, None]), max(int(self.torques.shape[0]) - len(self.problem.names), 1)
        b, d = at.inside[..., 0]
        scale, cross, steep = np.exp(at.log_length[:, 0]), at.cross[:, 0], at.steep[:, 0]
        alone = np.maximum(steep - cross**2, 1e-12 * steep)
        linear = np.diag(self._gram)[:, None] + np.maximum(b**2 * steep - 2 * b * d * cross + d**2, 0.0) / alone
        peak, v_s = self.theta[-2] * scale, self.theta[-1]
        u = np.divide(1.0, peak**2 * alone, out=np.full_like(peak, np.inf), where=peak > 0)
        variance: Array = np.vstack([linear, steep / alone / scale**2, v_s**2 * u]) * self.cost / freedom
        return np.sqrt(variance)

    def _robust_errors(self, sets: NDArray[np.intp]) -> Array:
        theta, linear = self.theta[:, sets], self.problem.linear.T
        shapes, slopes = (table.T for table in self.problem.slopes(theta[-1]))
        fixed = np.broadcast_to(linear, (sets.size, *linear.shape))
        jacobian = np.concatenate([fixed, shapes[:, None], (slopes * theta[-2][:, None])[:, None]], axis=1)
        gram = jacobian @ jacobian.swapaxes(1, 2)
        size = np.maximum(np.sqrt(np.einsum("spp->sp", gram)), 1e-150)
        scale = size[:, :, None] * size[:, None]
        weights = np.linalg.pinv(gram / scale, hermitian=True) / scale @ jacobian
        left = self.torques.T[sets] - (theta[:-2].T @ linear + theta[-2][:, None] * shapes)
        kept = 1 - np.minimum(np.einsum("spn,spn->sn", jacobian, weights), 1 - 1e-6)
        errors: Array = np.sqrt(weights**2 @ ((left / kept) ** 2)[..., None])[..., 0].T
        errors[-1, theta[-2] <= 0] = np.inf
        return errors

    def _at(self, x: Array) -> Tables:
        """The tables at grid coordinates x, (sets, q)."""
        first = np.clip(np.floor(x).astype(np.intp), 2, self.grid - 4)
        weights = np.vander((x - first).ravel(), 6, increasing=True) @ _TO_POLYNOMIAL
        weights = weights.reshape(*x.shape, 6)
        near = first[..., None] + _NEIGHBOURS
        along = self._tables.along[near, np.arange(x.shape[0])[:, None, None]]
        tables = (*(table[..., near] for table in self._tables[:4]), along)
        return Tables(*(np.einsum("...sqi,sqi->...sq", table, weights) for table in tables))
