"""Many static data sets that share their velocities, in a few matrix products.

Estimates, standard errors, and both kinds of interval. What v_s changes - the Stribeck column and its slope, each off
the linear columns, and their products with the data - is tabulated on a grid of log(v_s) once for all sets, and
interpolated by polynomials through six neighbours. Each set then has a few small sums of its own. Tables and errors in
closed form are for speed: a projection or a Jacobian for each set would take many times as long.
"""

from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.estimation.conditional_profile import Conditional, ConditionalProfiles, Looks
from bristle.estimation.covariance import student
from bristle.estimation.profile_likelihood import profile_threshold
from bristle.identification.static.grid import Projected, solve
from bristle.identification.static.problem import Regression, log_grid
from bristle.identification.static.profiles import profiled

GRID = 128  # values of v_s: more than in one fit, for minimum, errors and intervals are interpolated between them
_IN_CACHE = 400_000  # residuals of sets, of which robust errors are computed at a time
COARSE = 48  # as many are enough for the minimum alone
_NEWTON = 4
_CROSSING = 12  # secant steps to where a profile crosses its threshold
_CROSSED = 1e-8  # this near to one, the statistic's root is on the threshold
_LOOKS = Looks(first=17, near=9, again=4, drawn=1)  # over v_s's interval, for the extremes of the other parameters
_UNSEEN = 300.0  # logarithm of alpha_1 over the torque where hardly anything is left of its column
_NEIGHBOURS = np.arange(-2, 4)
_TO_POLYNOMIAL = np.linalg.inv(np.vander(_NEIGHBOURS.astype(float), increasing=True))
"""From six neighbouring values to the coefficients of their polynomial in t, which counts grid steps."""


class Tables(NamedTuple):
    """What depends on v_s.

    Of the Stribeck column s and its slope d by log(v_s), off the linear columns and relative to the length of s there.
    So scaled, nothing vanishes where hardly a point is left within v_s, and polynomials hold over the whole range.
    """

    log_length: Array
    """Logarithm of that length."""
    cross: Array
    """s'd."""
    steep: Array
    """d'd."""
    inside: Array
    """What the linear parameters lose with s, and with d: (2, m, ...)."""
    along: Array
    """s'T of each set; its square is by how much the peak lowers the cost."""


class Batch:
    """Sets of torques at the same velocities, solved as `solve` does; one peak.

    Args:
        problem: one of the sets; its torque is not looked at.
        torques: N*m, (n, sets).
        v_s_range: as in `solve`.
        grid: as in `solve`, >= 8.
    """

    theta: Array
    """In the order of the problem's `names`, (p, sets)."""
    cost: Array
    """J_s, (sets,)."""

    def __init__(self, problem: Regression, torques: Array, v_s_range: tuple[float, float], grid: int = GRID) -> None:
        """Tabulate, and solve."""
        self.problem, self.torques, self.v_s_range, self.grid = problem, torques, v_s_range, grid
        self._base, self._step = v_s_range[0], np.log(v_s_range[1] / v_s_range[0]) / (grid - 1)
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
        self._without = projected.back(in_q)
        rest = torques - q @ in_q
        self._rest = np.einsum("ns,ns->s", rest, rest)
        self._gram = projected.r_inverse @ projected.r_inverse.T
        self._solve()

    @property
    def freedom(self) -> int:
        """Degrees of freedom."""
        return max(int(self.torques.shape[0]) - len(self.problem.names), 1)

    def errors(self, *, robust: bool = False) -> Array:
        """Standard errors from the exact Jacobian, as `uncertainty.covariance` has them, (p, sets).

        inf where alpha_1 is zero. Robust ones allow for a variance that differs from point to point (HC3: each residual
        over one less its leverage).
        """
        if robust:
            blocks = np.array_split(np.arange(self.cost.size), ceil(self.torques.size / _IN_CACHE))
            return np.hstack([self._robust_errors(sets) for sets in blocks])
        at = self._at(self._x[:, None])
        b, d = at.inside[..., 0]
        scale, cross, steep = np.exp(at.log_length[:, 0]), at.cross[:, 0], at.steep[:, 0]
        alone = np.maximum(steep - cross**2, 1e-12 * steep)
        linear = np.diag(self._gram)[:, None] + np.maximum(b**2 * steep - 2 * b * d * cross + d**2, 0.0) / alone
        peak, v_s = self.theta[-2] * scale, self.theta[-1]
        u = np.divide(1.0, peak**2 * alone, out=np.full_like(peak, np.inf), where=peak > 0)
        variance: Array = np.vstack([linear, steep / alone / scale**2, v_s**2 * u]) * self.cost / self.freedom
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

    def covariance_intervals(self) -> tuple[Array, Array]:
        """Lower and upper ends by Student's t, (p, sets) each; no friction parameter below zero."""
        reach = student(self.freedom) * self.errors()
        return self._floored(self.theta - reach), self.theta + reach

    def profile_intervals(self) -> tuple[Array, Array]:
        """Ends where the profile crosses its threshold, (p, sets) each; 0 and inf where it does not in the range."""
        best = self.cost
        threshold = best * profile_threshold(1.0, self.torques.shape[0], len(self.problem.names))
        ends, broken = zip(*(self._crossing(threshold, last) for last in (0.0, self.grid - 1.0)), strict=True)
        box = np.stack(ends, axis=1)
        open_ = [end == last for end, last in zip(ends, (0.0, self.grid - 1.0), strict=True)]
        linear = ConditionalProfiles(
            free=self._conditional,
            best=self._x[:, None],
            threshold=threshold,
            box=box[:, None],
            looks=_LOOKS,
            cost=best,
            bounded=np.isfinite(self.problem.least[:-1]),
        )
        low, high = (
            np.vstack([x.T, self._v_s(end)])
            for x, end in zip(np.moveaxis(linear.intervals(), -1, 0), ends, strict=True)
        )
        low[-1, open_[0]], high[-1, open_[1]] = 0.0, np.inf
        high[-2, open_[0] | open_[1]] = np.inf
        at = self._at(box)  # an end that breaks a bound, but alpha_1's: the profile then costs more there
        theta = self._without[..., None] - at.inside[0] * np.maximum(at.along, 0.0)
        outside = (theta < self.problem.lower[:, None, None]).any(axis=(0, 2))
        alone = self._alone | outside | broken[0] | broken[1] | linear.broken | (best <= 0)
        for k in np.flatnonzero(alone).tolist():
            single = self.problem.with_torque(self.torques[:, k])
            intervals = profiled(single, solve(single, self.v_s_range, self.grid)).intervals
            low[:, k], high[:, k] = np.array([intervals[name] for name in single.names]).T
        return self._floored(low), high

    def _floored(self, low: Array) -> Array:
        return np.maximum(low, self.problem.least[:, None])

    def _v_s(self, x: Array) -> Array:
        return np.asarray(self._base * np.exp(self._step * x))

    def _at(self, x: Array) -> Tables:
        """The tables at grid coordinates x, (sets, q)."""
        first = np.clip(np.floor(x).astype(np.intp), 2, self.grid - 4)
        weights = np.vander((x - first).ravel(), 6, increasing=True) @ _TO_POLYNOMIAL
        weights = weights.reshape(*x.shape, 6)
        near = first[..., None] + _NEIGHBOURS
        along = self._tables.along[near, np.arange(x.shape[0])[:, None, None]]
        tables = (*(table[..., near] for table in self._tables[:4]), along)
        return Tables(*(np.einsum("...sqi,sqi->...sq", table, weights) for table in tables))

    def _costs(self, at: Tables) -> Array:
        return np.asarray(self._rest[:, None] - np.maximum(at.along, 0.0) ** 2)

    def _solve(self) -> None:
        """The minimum of each set, between grid values; those at an end of the range, or at a bound, one by one."""
        along, last = self._tables.along, self.grid - 1
        coarse = np.maximum(along, 0.0).argmax(axis=0)
        near = np.clip(coarse, 2, self.grid - 4) + _NEIGHBOURS[:, None]
        # where the polynomial of each set, > 0, is highest, by Newton's method
        of_set = _TO_POLYNOMIAL @ np.take_along_axis(along, near, axis=0)
        slope, bend, t = polyder(of_set), polyder(of_set, 2), np.zeros(along.shape[1])
        for _ in range(_NEWTON):
            curved = polyval(t, bend, tensor=False)
            step = np.divide(-polyval(t, slope, tensor=False), curved, out=np.full_like(t, np.inf), where=curved < 0)
            t = t + np.clip(step, -0.7, 0.7)
        inside_grid = (coarse >= 2) & (coarse <= self.grid - 4) & (t > -1.5) & (t < 2.5)
        self._x = np.clip(near[2] + t, 0.0, last)
        at = self._at(self._x[:, None])
        peak = at.along[:, 0]
        with np.errstate(over="ignore"):  # a column of vanishing length: that set is solved alone
            linear, alpha_1 = self._without - at.inside[0, :, :, 0] * peak, peak * np.exp(-at.log_length[:, 0])
        self.theta = np.vstack([linear, alpha_1, self._v_s(self._x)])
        self.cost = np.maximum(self._costs(at)[:, 0], 0.0)
        self._alone = (self.theta[:-1] <= self.problem.least[:-1, None]).any(axis=0) | ~inside_grid
        self._alone |= ~np.isfinite(self.theta).all(axis=0)
        for k in np.flatnonzero(self._alone).tolist():
            one = solve(self.problem.with_torque(self.torques[:, k]), self.v_s_range, self.grid)
            self.theta[:, k], self.cost[k] = one.theta, one.cost
            self._x[k] = np.clip(np.log(one.theta[-1] / self._base) / self._step, 0.0, last)

    def _crossing(self, threshold: Array, last: float) -> tuple[Array, Array]:
        """Where the profile over log(v_s) crosses the threshold between the minimum and that end of the grid, (sets,).

        And which sets have it twice. The root of what the profile lies above its minimum is nearly linear: the secant
        method finds it, or halving where that leaves the bracket.
        """
        room = np.maximum(threshold - self.cost, 1e-300)
        inner, outer, sign = self._x.copy(), np.full_like(self._x, last), np.sign(last - self._x)
        error = self.errors()[-1] / self.theta[-1] / self._step * student(self.freedom)
        before, at_before = self._x, np.zeros_like(self._x)
        x = self._x + sign * np.minimum(error, abs(last - self._x) / 2)
        for _ in range(_CROSSING):
            root = np.sqrt(np.maximum(self._costs(self._at(x[:, None]))[:, 0] - self.cost, 0.0) / room)
            inner, outer = np.where(root < 1, x, inner), np.where(root < 1, outer, x)
            rise = root - at_before
            moved = x + np.divide((1 - root) * (x - before), rise, out=np.full_like(x, np.inf), where=rise != 0)
            new = np.where((moved - inner) * (moved - outer) <= 0, moved, (inner + outer) / 2)
            before, at_before, x = x, root, np.where(abs(root - 1) < _CROSSED, x, new)
        grid = np.arange(self.grid)[:, None]
        beyond = (grid < x - 1) if last == 0 else (grid > x + 1)
        on_grid = self._rest - np.maximum(self._tables.along, 0.0) ** 2
        to_end = self._costs(self._at(np.full((x.size, 1), last)))[:, 0] <= threshold
        twice = (beyond & (on_grid <= threshold)).any(axis=0) & ~to_end
        return np.where(to_end, last, x), twice

    def _conditional(self, x: Array) -> Conditional:
        """The linear parameters at grid coordinates x, (sets, q, 1)."""
        at = self._at(x[..., 0])
        unit = np.exp(np.minimum(-at.log_length, _UNSEEN))
        lost = np.concatenate([-at.inside[0], unit[None]])
        theta = lost * at.along
        theta[:-1] += self._without[..., None]
        spread = lost[:, None] * lost[None]
        spread[:-1, :-1] += self._gram[..., None, None]
        return Conditional(np.moveaxis(theta, 0, -1), np.moveaxis(spread, (0, 1), (-2, -1)), self._costs(at))
