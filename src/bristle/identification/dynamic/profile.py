"""The profile of each parameter of moving data: the cost at a value of it, with all others, each motion's start included, fitted anew.

The interval is where the profiled cost stays below

    J_min + d,    d = S F J_min / (n - p),    F = F(0.95; 1, freedom),    S = (error / naive error)**2

S is by how much the covariance widens this parameter's variance for correlated residuals: in a linear problem both intervals are the same.
sqrt((J - J_min) / d) is linear in the scaled parameter where the problem is: where it crosses one is found in few steps. Each point starts from the
one solved before it on the way from the estimate, moved along the others' linearised conditional mean, and is solved by the descent of the fit.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from bristle.arrays import Array
from bristle.diagnostics import Diagnostic, Kind
from bristle.errors import InputError
from bristle.estimation.covariance import student
from bristle.estimation.levenberg_marquardt import minimise
from bristle.estimation.linear import inverse_gram
from bristle.identification.dynamic.fit import Tracked
from bristle.identification.dynamic.multistart import SEEN
from bristle.identification.dynamic.problem import is_start
from bristle.identification.dynamic.unknowns import LOGARITHMIC, bounds, from_scaled, natural, scaled, scales, to_scaled
from bristle.progress import Progress

_TRIES, _BUDGET = 12, 40
"""Steps of the descent at one value, and evaluations on one side of the estimate (five, where the profile is smooth)."""
_SETTLED = 1e-3
"""Of d: a descent ends when a step would lower the cost by less."""
_EXACT = 1e-3
"""Of its distance from the estimate: how near to the crossing an end is sought."""
_STRAIGHT = 1e-2
"""This near to one, the statistic's root is a line from the estimate on."""
_BETTER = 1e-3
"""Of d: a cost this much below the fit's is a better optimum."""
_FAR, _GROWTH = 6, 4.0
"""How often an end that is not reached is sought farther away, and by what factor at most."""
_STEEP = 1e3
"""Stands for the statistic's root where nothing can be computed."""


class Profiled(NamedTuple):
    """One parameter's profile, in its unit."""

    interval: tuple[float, float]
    """A side that the profile leaves open is infinite, or the bound of zero."""
    curve: Array
    """As in `Uncertainty`, (2, k)."""
    doubts: tuple[Diagnostic, ...] = ()


class _Better(Exception):  # noqa: N818  # a way out of a search that became pointless
    """A lower cost than the fit's was found, at these scaled unknowns."""

    def __init__(self, x: Array) -> None:
        """Remember where."""
        super().__init__("a profile found a lower cost than the fit")
        self.x = x


class _Spent(Exception):  # noqa: N818  # a way out as well
    """The budget of a search is."""


class _Point(NamedTuple):
    """A solved point of a path."""

    x: Array
    """Scaled unknowns, (p,)."""
    gram: Array
    """J'J, (p, p)."""


class _Surface(NamedTuple):
    """The least-squares problem about its minimum."""

    evaluate: Callable[[Array], tuple[Array, Array]]
    lower: Array
    upper: Array
    cost: float
    """J_min."""
    rows: int
    heed: bool
    """Whether a better optimum ends the search."""


@dataclass(slots=True)
class _Path:
    """The points solved for one parameter, the estimate first."""

    surface: _Surface
    which: int
    high: float
    """d."""
    points: list[_Point]
    roots: dict[float, float] = field(default_factory=dict)
    """sqrt((J - J_min) / d) at scaled values of the parameter."""
    spent: int = 0
    rough: bool = False
    """Whether a descent did not settle, or a search was given up ..."""
    lost: bool = False
    """... without an end."""

    def root(self, value: float) -> float:
        """The statistic's root at a scaled value of the parameter."""
        if value not in self.roots:
            near = self._inner(value)
            moved = near.x + self._slope(near) * (value - near.x[self.which])
            tried = (self._solved(start, value) for start in (moved, near.x))
            self.roots[value] = next((root for root in tried if root is not None), _STEEP)
        return self.roots[value]

    def _inner(self, value: float) -> _Point:
        """The point next to a value on the way from the estimate: what lies beyond may be in another valley."""
        best = float(self.points[0].x[self.which])
        way = value - best
        inside = [point for point in self.points if 0 <= (point.x[self.which] - best) / way <= 1]
        return max(inside, key=lambda point: abs(float(point.x[self.which]) - best))

    def _slope(self, near: _Point) -> Array:
        """Derivative of the others' linearised conditional mean by the parameter, (p,): 1 for itself, 0 at a bound."""
        size = np.sqrt(near.gram.diagonal())
        free = (size > 0) & (near.x > self.surface.lower) & (near.x < self.surface.upper)
        free[self.which] = False
        inner = near.gram[np.ix_(free, free)] / np.outer(size[free], size[free])
        out = np.zeros(near.x.size)
        out[free] = -np.linalg.lstsq(inner, near.gram[free, self.which] / size[free], rcond=1e-12)[0] / size[free]
        out[self.which] = 1.0
        return out

    def _solved(self, start: Array, value: float) -> float | None:
        """The statistic's root of the fit with the parameter held at a value; None where nothing can be computed at the start."""
        _, lower, upper, cost, rows, heed = self.surface
        held = np.arange(start.size) == self.which
        lower, upper, start = (np.where(held, value, bound) for bound in (lower, upper, start))
        try:
            found = minimise(self._evaluate, start, lower, upper, _TRIES, _SETTLED * self.high * rows / cost)
        except InputError:
            return None
        excess = (found.cost - cost) / self.high
        if heed and excess < -_BETTER:
            raise _Better(found.x)
        self.rough |= not found.converged
        self.points.append(_Point(found.x, found.jacobian.T @ found.jacobian))
        return float(np.sqrt(max(excess, 0.0)))

    def _evaluate(self, x: Array) -> tuple[Array, Array]:
        self.spent += 1
        if self.spent > _BUDGET:
            raise _Spent
        return self.surface.evaluate(x)

    def end(self, reach: float, limit: float) -> float | None:
        """Where the root crosses one, on the side of `limit`, first looked for `reach` away from the estimate; None where it does not."""
        best, self.spent = float(self.points[0].x[self.which]), 0
        side = float(np.sign(limit - best))
        try:
            return self._crossing(best, side, reach, abs(limit - best))
        except _Spent:
            self.rough = True
            beyond = [x for x, root in self.roots.items() if (x - best) * side > 0 and root > 1]
            self.lost |= not beyond
            return max(beyond, key=lambda x: abs(x - best), default=None)  # the nearer ones may only look so high

    def _crossing(self, best: float, side: float, reach: float, most: float) -> float | None:
        inside, away = best, min(reach, most)
        for _ in range(_FAR):
            outside = best + side * away
            root = self.root(outside)
            if abs(root - 1) < _STRAIGHT:
                return best + side * min(away / root, most)
            if root > 1:
                return float(brentq(lambda x: self.root(x) - 1, inside, outside, xtol=_EXACT * away))
            if away == most:
                return None
            inside, away = outside, min(away * (_GROWTH if root * _GROWTH < 1 else 1.01 / root), most)
        return None


def profile_moving(
    found: Tracked, progress: Progress | None = None, *, heed: bool = True
) -> tuple[dict[str, Profiled], Mapping[str, float] | None]:
    """The profile of each free parameter of a fit of moving data, by name; those that have no influence at all are open.

    Args:
        found: the fit, before anything is taken off for encoder counts.
        progress: called with what is done, how much of it, and of how much.
        heed: whether a better optimum found on the way ends the search.

    Returns:
        The profiles and None; or those found so far and every value of the better optimum, from which the fit must be done again.
    """
    problem, errors = found.problem, found.judged.scaled_errors
    scale = scales(problem, found.values)
    x = to_scaled(problem, found.values, scale)
    evaluate, (lower, upper) = scaled(problem, scale), bounds(problem)
    rows, jacobian = evaluate(x)
    gram, naive = jacobian.T @ jacobian, _naive(jacobian)
    surface = _Surface(evaluate, np.minimum(lower, x), np.maximum(upper, x), float(rows @ rows), rows.size, heed)
    out: dict[str, Profiled] = {}
    free = [(j, name) for j, name in enumerate(problem.names) if not is_start(name)]
    for done, (j, name) in enumerate(free):
        if progress:
            progress(f"profile of {name}", done, len(free))
        reach = student(found.judged.freedom) * float(errors[j])
        if reach**2 == 0:  # data without any noise
            out[name] = Profiled((found.values[name],) * 2, np.array([[found.values[name]], [0.0]]))
            continue
        if not np.isfinite(reach):
            out[name] = Profiled(widest(name), np.zeros((2, 0)), (Kind.PROFILE_UNSEEN(open=Kind.PROFILE_OPEN()),))
            continue
        path = _Path(surface, j, reach**2 / float(naive[j]), [_Point(x, gram)], {float(x[j]): 0.0})
        try:
            out[name] = _profiled(path, name, reach, float(scale[j]))
        except _Better as better:
            return out, from_scaled(problem, better.x, scale)
    return out, None


def _naive(jacobian: Array) -> Array:
    """Diagonal of (J'J)**-1, (p,); inf for unknowns without influence."""
    length = np.sqrt(np.einsum("np,np->p", jacobian, jacobian))
    seen = length > SEEN * length.max()
    out = np.full(length.size, np.inf)
    out[seen] = np.diag(inverse_gram(jacobian[:, seen]))
    return out


def widest(name: str) -> tuple[float, float]:
    """What a parameter may be at all."""
    return (0.0 if name.startswith(("alpha", "v_s", "sigma")) else -np.inf), np.inf


def _profiled(path: _Path, name: str, reach: float, size: float) -> Profiled:
    """The interval of one parameter, in its unit; `size` is that of its scaled unknown."""

    def own(x: float) -> float:
        """The parameter at its scaled unknown."""
        return float(natural(name, x, size))

    ends = [path.end(reach, float(bound[path.which])) for bound in (path.surface.lower, path.surface.upper)]
    low, high = (limit if x is None else own(x) for x, limit in zip(ends, widest(name), strict=True))
    known = {own(x): root**2 for x, root in path.roots.items() if root < _STEEP}
    known |= {own(x): 1.0 for x in ends if x is not None}
    is_open = None in ends and (high == np.inf or low < 0 or name.startswith(LOGARITHMIC))
    doubts = [Kind.PROFILE_OPEN()] if is_open and not path.lost else []
    if path.rough:
        doubts.append(Kind.PROFILE_LOST() if path.lost else Kind.PROFILE_ROUGH())
    return Profiled((low, high), np.array(sorted(known.items())).T, tuple(doubts))
