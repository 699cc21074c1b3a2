"""Profiles: the cost over one unknown, all others fitted again; the interval is where it is below a threshold.

With n equations and p unknowns the threshold is J_min + S F J_min / (n - p), F = F(0.95; 1, freedom), S the variance
inflation. The root of the scaled excess is linear where the problem is, so that few descents find where it crosses one.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.special import fdtri

from bristle.arrays import Array
from bristle.errors import InputError
from bristle.estimation import levels
from bristle.estimation.covariance import seen, student
from bristle.estimation.linear import inverse_gram
from bristle.estimation.multistart import MultistartSolution
from bristle.estimation.nonlinear import LeastSquares, Minimum, Name, minimise
from bristle.findings import CAUTION, Finding
from bristle.progress import Progress

_OPEN = Finding(
    "profile-open",
    CAUTION,
    "No finite interval by the profile: with the other parameters re-optimised, every value on that side that a motion can show "
    "fits about as well.",
)
_TRIES, _BUDGET = 12, 40  # steps per value, and evaluations per side (five of a smooth profile)
_SETTLED = 1e-3  # of d: smaller gains end a descent
_EXACT = 1e-3  # of its distance from the estimate: tolerance of an end
_STRAIGHT = 1e-2  # distance from one within which the root is linear
BETTER = 1e-3  # of d: a cost this much below the fit's is a better optimum
_FAR, _GROWTH = 6, 4.0  # extensions of the search for an end, and the largest factor
_STEEP = 1e3  # root where nothing can be computed


class Profiled(NamedTuple):
    """One unknown's profile, in its unit."""

    interval: tuple[float, float]  # Open sides are infinite, or the least possible value
    curve: Array  # Values, ascending, and (cost - least) / d, (2, k): 1 at the interval's ends
    warnings: tuple[Finding, ...] = ()


def profile_threshold(cost: float, n: int, p: int, inflation: float = 1.0) -> float:
    """The cost at the ends of a 95 % interval, J_min + d; S is the `inflation`."""
    freedom = max(n / inflation - p, 1.0)
    return cost * (1 + inflation * float(fdtri(1, freedom, levels.CONFIDENCE)) / max(n - p, 1))


def interval_on_grid(
    costs: Callable[[Array], Array], grid: Array, profile: Array, best: float, most: float
) -> tuple[float, float]:
    """The interval of a positive unknown from its profile on an ascending grid, (k,); 0 or inf for no end."""
    inside = np.append(grid[profile <= most], best)

    def crossing(outside: float, within: float) -> float:
        """Where the profile crosses the threshold between two values; else the inner one."""

        def excess(u: float) -> float:
            return float(costs(np.array([np.exp(u)]))[0]) - most

        a, b = np.log(outside), np.log(within)
        return within if excess(a) * excess(b) > 0 else float(np.exp(brentq(excess, a, b, xtol=1e-10)))

    low, high = float(inside.min()), float(inside.max())
    below, above = int(np.searchsorted(grid, low)), int(np.searchsorted(grid, high, side="right"))
    lower = 0.0 if below == 0 else crossing(float(grid[below - 1]), low)
    return lower, np.inf if above == grid.size else crossing(float(grid[above]), high)


def profiles(
    solution: MultistartSolution[Name], progress: Progress | None = None, *, stop_at_better: bool = True
) -> tuple[dict[Name, Profiled], Array | None]:
    """Profiles of the shared unknowns, by name, and None; an unknown without influence is open.

    With `stop_at_better`, a lower cost ends the search: the profiles until then, and the scaled unknowns there.
    """
    problem, minimum = solution.posed, solution.minimum
    unknowns, x, known = problem.unknowns, minimum.x, seen(minimum.jacobian)
    naive = np.full(known.size, np.inf)  # the diagonal of (J'J)**-1
    naive[known] = np.diag(inverse_gram(minimum.jacobian[:, known]))
    first = x, minimum.jacobian.T @ minimum.jacobian
    out: dict[Name, Profiled] = {}
    for done, j in enumerate(range(problem.shared)):
        name = unknowns.names[j]
        value, reach = solution.values[name], student(solution.freedom) * float(solution.scaled_errors[j])
        if progress:
            progress(f"profile of {name}", done, problem.shared)
        if reach**2 == 0:  # data without any noise
            out[name] = Profiled((value, value), np.array([[value], [0.0]]))
        elif not np.isfinite(reach):
            whole = float(unknowns.least[j]), np.inf
            out[name] = Profiled(whole, np.zeros((2, 0)), (_OPEN,))
        else:
            high = reach**2 / float(naive[j])
            path = _Path(problem, minimum, j, high, stop_at_better, [first], {float(x[j]): 0.0})
            profiled = path.profiled(reach)
            if path.better is not None:
                return out, path.better
            out[name] = profiled
    return out, None


class _Stop(Exception):  # noqa: N818  # a way out of a search: it found a better optimum, or its budget is spent
    """Ends a search along a profile."""


@dataclass(slots=True)
class _Path:
    """The points solved for one unknown, the estimate first."""

    problem: LeastSquares[Any]
    minimum: Minimum
    which: int
    high: float  # d
    stop_at_better: bool
    points: list[tuple[Array, Array]]  # Scaled unknowns, (p,), and J'J, (k, k)
    roots: dict[float, float]  # sqrt((J - J_min) / d) at scaled values of the unknown
    spent: int = 0
    better: Array | None = None  # Scaled unknowns at which a lower cost than the fit's was found
    rough: bool = False  # Whether a descent did not settle, or a search was given up

    def profiled(self, reach: float) -> Profiled:
        """The profile in the unknown's unit; its ends are first sought at `reach`."""
        unknowns, j, x = self.problem.unknowns, self.which, self.minimum.x
        limits = min(unknowns.lower[j], x[j]), max(unknowns.upper[j], x[j])
        ends = [self._end(reach, float(limit)) if self.better is None else None for limit in limits]
        low, high = (
            limit if end is None else float(unknowns.natural_of(j, np.array(end)))
            for end, limit in zip(ends, (float(unknowns.least[j]), np.inf), strict=True)
        )
        known = {at: root**2 for at, root in self.roots.items() if root < _STEEP}
        known |= {end: 1.0 for end in ends if end is not None}
        at, heights = np.array(sorted(known.items())).T
        is_open = None in ends and (high == np.inf or low < 0 or bool(unknowns.logarithmic[j]))
        told = (_OPEN,) if is_open else ()
        if self.rough:
            message = (
                "The profile is hard to compute here: its bounds are approximate, and a side without one may have one."
            )
            told = (Finding("profile-rough", CAUTION, message),)
        return Profiled((low, high), np.stack([unknowns.natural_of(j, at), heights]), told)

    def _end(self, reach: float, limit: float) -> float | None:
        """Where the root crosses one towards `limit`, first sought at `reach`; None: nowhere."""
        best, self.spent = float(self.minimum.x[self.which]), 0
        side, most = float(np.sign(limit - best)), abs(limit - best)
        inside, away = best, min(reach, most)
        try:
            for _ in range(_FAR):
                outside = best + side * away
                root = self._root(outside)
                if abs(root - 1) < _STRAIGHT:
                    return best + side * min(away / root, most)
                if root > 1:
                    return float(brentq(lambda x: self._root(x) - 1, inside, outside, xtol=_EXACT * away))
                if away == most:
                    break
                inside, away = outside, min(away * (_GROWTH if root * _GROWTH < 1 else 1.01 / root), most)
        except _Stop:
            self.rough = True
            beyond = [x for x, root in self.roots.items() if (x - best) * side > 0 and root > 1]
            return max(beyond, key=lambda x: abs(x - best), default=None)  # nearer ones may be false
        return None

    def _root(self, value: float) -> float:
        """The root of the statistic at a scaled value."""
        if value not in self.roots:
            j, best = self.which, float(self.minimum.x[self.which])
            # start next to the value, on the side of the estimate, to stay in one valley
            inside = [point for point in self.points if 0 <= (point[0][j] - best) / (value - best) <= 1]
            x, gram = max(inside, key=lambda point: abs(float(point[0][j]) - best))
            tried = (self._solved(start, value) for start in (x + self._slope(x, gram) * (value - x[j]), x))
            self.roots[value] = next((root for root in tried if root is not None), _STEEP)
        return self.roots[value]

    def _slope(self, x: Array, gram: Array) -> Array:
        """Derivative of the others' conditional mean by the unknown, (p,): 1 for itself, 0 at a bound or if private."""
        size, unknowns = np.sqrt(gram.diagonal()), self.problem.unknowns
        free = (size > 0) & ((x > unknowns.lower) & (x < unknowns.upper))[: size.size]
        free[self.which] = False
        inner = gram[np.ix_(free, free)] / np.outer(size[free], size[free])
        out = np.zeros(x.size)
        out[: size.size][free] = (
            -np.linalg.lstsq(inner, gram[free, self.which] / size[free], rcond=1e-12)[0] / size[free]
        )
        out[self.which] = 1.0
        return out

    def _solved(self, start: Array, value: float) -> float | None:
        """The root with the unknown held; None where it cannot be computed at the start."""
        held, cost = np.arange(start.size) == self.which, self.minimum.cost
        box = (self.problem.unknowns.lower, self.problem.unknowns.upper)
        lower, upper = (np.where(held, value, bound) for bound in box)
        settled = _SETTLED * self.high * self.minimum.residuals.size / cost
        try:
            minimum = minimise(self._evaluate, start, lower, upper, _TRIES, settled, blocks=self.problem.blocks)
        except InputError:
            return None
        excess = (minimum.cost - cost) / self.high
        if self.stop_at_better and excess < -BETTER:
            self.better = minimum.x
            raise _Stop
        self.rough |= not minimum.converged
        self.points.append((minimum.x, minimum.jacobian.T @ minimum.jacobian))
        return float(np.sqrt(max(excess, 0.0)))

    def _evaluate(self, x: Array) -> tuple[Array, Array]:
        self.spent += 1
        if self.spent > _BUDGET:
            raise _Stop
        return self.problem.evaluate(x)
