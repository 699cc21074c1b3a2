"""The exact profile of every parameter of a static fit: where its cost, minimised over all other parameters, stays below a threshold.

At given v_s the problem is linear. With theta_j held at c and the rest solved,

    J(v_s, c) = J(v_s) + (c - theta_j(v_s))**2 / C_jj(v_s),    C = (A'A)**-1 of the columns A at v_s,

so the values of c that cost no more than K are the union over v_s of theta_j(v_s) -+ sqrt(C_jj(v_s) (K - J(v_s))): an interval ends at the highest
and the lowest point of a curve over v_s (a surface, where there are two peaks), and no path over c is followed. Friction parameters are not negative.
At given v_s the constrained extreme lies inside a face, where some of them are zero, and is that face's free one: where the free extreme of all
breaks a bound, the curve is, at each v_s, that of the best face whose extreme breaks none.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.estimation.linear import orthonormal
from bristle.estimation.profile_likelihood import interval_on_grid, profile_threshold
from bristle.identification.static.compression import reduced
from bristle.identification.static.grid import Projected, Solution, subsets
from bristle.identification.static.problem import Regression

_FIRST = {1: 65, 2: 25}
"""Values of each v_s in the first look, by the number of peaks, ..."""
_NEXT = {1: 9, 2: 7}
"""... in each look between the neighbours of the best one, ..."""
_LOOKS = {1: 4, 2: 5}
"""... and how many looks there are after the first."""
_DRAWN = 61
"""Values of a parameter at which its profile is drawn."""
_BEYOND = 0.5
"""How far beyond its interval, in widths of it."""
_OVER = {1: 161, 2: 33}
"""Values of each v_s over which the drawn profile is minimised."""
_AROUND = (0.5, 2.0, 101)
"""Of two peaks, where the other v_s is searched, over its best: from, to, values."""
_ROUNDING = 1e-13
"""Of what the linear columns leave of the torque: costs this near are the same."""
_LOWER = 1e-3
"""Of the threshold's height above the least cost: a cost this much below that is a better minimum."""
_SLACK = 1e-9
"""A parameter this far below its bound of zero, in standard errors, is at it."""


class Profiled(NamedTuple):
    """The profiles of a solved problem."""

    intervals: dict[str, tuple[float, float]]
    """The 95 % interval of each parameter by its profile, by name."""
    threshold: float
    """What a parameter inside its interval costs at most."""
    shape: "Profiles"
    """Of the linear parameters, to be drawn."""


def profiled(problem: Regression, solution: Solution, stretch: float = 1.0) -> Profiled:
    """The profiles of a problem's solution; `stretch` is by how much correlated residuals inflate the variance.

    v_s is open, 0 or inf, where its profile stays below the threshold to the end of the range; alpha_1 goes with it, and has no upper end then.
    """
    threshold = profile_threshold(solution.cost, problem.torque.size, len(problem.names), stretch)
    few = reduced(problem, (float(solution.grid[0]), float(solution.grid[-1]))) if problem.peaks else problem
    peaks = len(problem.peaks)
    best = solution.theta[solution.theta.size - peaks :]
    v_s = _of_v_s(few, solution, best, threshold)
    box = np.array([np.clip(ends, solution.grid[0], solution.grid[-1]) for ends in v_s.values()]).reshape(peaks, 2)
    shape = Profiles(few, best, solution.cost, threshold, box, solution.grid[[0, -1]])
    found = shape.intervals()
    for name, (low, high) in v_s.items():
        if low == 0 or not np.isfinite(high):
            alpha_1 = name.replace("v_s", "alpha_1")
            found[alpha_1] = found[alpha_1][0], np.inf
    return Profiled(found | v_s, threshold, shape)


def others(solution: Solution, peaks: int, peak: int) -> Array:
    """Over which values of the other v_s the profile of a peak's own is minimised, where there are two: near its best, and the grid, (k,)."""
    other = float(solution.theta[solution.theta.size - 1 - peak])
    return solution.grid if peaks < 2 else np.append(other * np.geomspace(*_AROUND), solution.grid)


def _of_v_s(problem: Regression, solution: Solution, best: Array, threshold: float) -> dict[str, tuple[float, float]]:
    """The interval of v_s of each peak; of two, the other's v_s is searched on the grid and near its best."""
    projected, peaks = Projected(problem), len(problem.peaks)
    found = {}
    for k, name in enumerate(problem.names[len(problem.names) - peaks :]):
        costs = partial(projected.profile, peak=k, others=others(solution, peaks, k))
        found[name] = interval_on_grid(costs, solution.grid, costs(solution.grid), float(best[k]), threshold)
    return found


def _products(axes: Sequence[Array]) -> Array:
    """Every combination of values of the axes, a row each; one empty row for no axis."""
    rows = list(product(*(axis.tolist() for axis in axes)))
    return np.array(rows, dtype=float).reshape(len(rows), len(axes))


class _At(NamedTuple):
    """A face at K values of v_s."""

    theta: Array
    """(K, M), zero for what the face drops."""
    spread: Array
    """C, (K, M, M)."""
    cost: Array
    """J, (K,)."""


class _Face:
    """A problem of M linear parameters without some of them, which are zero."""

    def __init__(self, problem: Regression, dropped: Sequence[str] = ()) -> None:
        """Factor the columns that v_s does not change."""
        names = problem.names[: len(problem.names) - len(problem.peaks)]
        m = len(problem.linear_names)
        self.problem, self.size = problem, len(names)
        self.columns = [k for k, name in enumerate(problem.linear_names) if name not in dropped]
        self.peaks = [k for k in range(len(problem.peaks)) if names[m + k] not in dropped]
        self.kept = [*self.columns, *(m + k for k in self.peaks)]
        self.q, self.r_inverse = orthonormal(problem.linear[:, self.columns])
        self.torque_in_q = self.q.T @ problem.torque
        self.rest = problem.torque - self.q @ self.torque_in_q

    def at(self, v_s: Array) -> _At:
        """The face at v_s, (K, peaks)."""
        K, P = v_s.shape[0], len(self.peaks)
        off = np.empty((K, P, self.rest.size))
        inside = np.empty((K, P, len(self.columns)))
        for row, k in enumerate(self.peaks):
            shapes = self.problem.shapes(v_s[:, k], k)
            in_q = self.q.T @ shapes
            off[:, row], inside[:, row] = (shapes - self.q @ in_q).T, in_q.T
        gram = np.linalg.pinv(off @ off.transpose(0, 2, 1), hermitian=True)  # zero where a peak touches no point
        along = off @ self.rest
        alpha_1 = np.einsum("kpr,kr->kp", gram, along)
        back = inside @ self.r_inverse.T
        linear = self.r_inverse @ self.torque_in_q - np.einsum("kpm,kp->km", back, alpha_1)
        across = -gram @ back
        of_linear = self.r_inverse @ self.r_inverse.T - back.transpose(0, 2, 1) @ across
        spread = np.block([[of_linear, across.transpose(0, 2, 1)], [across, gram]])
        theta, whole = np.zeros((K, self.size)), np.zeros((K, self.size, self.size))
        theta[:, self.kept] = np.concatenate([linear, alpha_1], axis=1)
        whole[np.ix_(range(K), self.kept, self.kept)] = spread
        cost = float(self.rest @ self.rest) - np.einsum("kp,kp->k", along, alpha_1)
        return _At(theta, whole, np.maximum(cost, 0.0))

    def breaks(self, at: _At, k: int) -> bool:
        """Whether a friction parameter is negative at the k-th v_s."""
        bounded = np.append(self.problem.lower, np.zeros(len(self.problem.peaks))) == 0
        return bool((at.theta[k][bounded] < 0).any())


class Profiles:
    """The profiles of a static problem's linear parameters, alpha_1 among them.

    Args:
        problem: the problem.
        best: v_s of its solution, one per peak.
        cost: J_s there.
        threshold: what a parameter inside its interval costs at most.
        box: between which v_s the threshold may be kept, (peaks, 2), positive and finite.
        searched: from the lowest to the highest v_s that counts, (2,).
    """

    def __init__(
        self, problem: Regression, best: Array, cost: float, threshold: float, box: Array, searched: Array
    ) -> None:
        """Factor the problem with no parameter at its bound."""
        self.problem, self.cost, self.threshold = problem, cost, threshold
        self.best, self.box, self.searched = np.log(best), np.log(box), np.log(searched)
        self.names = problem.names[: len(problem.names) - len(problem.peaks)]
        self.bounded = np.array([name.startswith("alpha") for name in self.names])
        self.free = _Face(problem)
        self._tolerance = _ROUNDING * float(self.free.rest @ self.free.rest)
        self.better: Array | None = None
        """Values of v_s, (peaks,), at which the profiles met a cost lower than the solution's; None: they met none."""

    def intervals(self) -> dict[str, tuple[float, float]]:
        """Where each parameter's profile stays below the threshold."""
        high, low = self._extremes(1.0), self._extremes(-1.0)
        return {name: (low[j], high[j]) for j, name in enumerate(self.names)}

    def curve(self, name: str, value: float, low: float, high: float) -> Array:
        """The profile about an estimate, from half a width below its interval to half a width above, as in `Uncertainty`, (2, k)."""
        j, wide = self.names.index(name), high - low
        least = 0.0 if self.bounded[j] else -np.inf
        ends = max(low - _BEYOND * wide, least), high + _BEYOND * wide
        values = np.unique([np.linspace(value, end, _DRAWN // 2) for end in ends])  # a skewed one is steep to one side
        nodes = self._grid(np.clip(self.box + _BEYOND * np.diff(self.box, axis=1) * [-1, 1], *self.searched), _OVER)
        cost, inside = self._held(self.free, nodes, j, values)
        if not inside.all():
            cost = np.min([self._held(face, nodes, j, values)[0] for face in self._faces(j)], axis=0)
        return np.stack([values, np.maximum(cost - self.cost, 0.0) / max(self.threshold - self.cost, 1e-300)])

    def _extremes(self, sign: float) -> list[float]:
        """The highest (sign 1) or lowest (-1) value of each parameter below the threshold."""
        found, inside = self._zoom(sign)
        for j in np.flatnonzero(~inside).tolist():
            found[j] = self._bounded(j, sign)
        values = sign * found
        return [float(x) for x in np.where(self.bounded, np.maximum(values, 0.0), values)]

    def _faces(self, j: int) -> Iterator[_Face]:
        """Every face on which parameter j is free."""
        others = [name for k, name in enumerate(self.names) if self.bounded[k] and k != j]
        return (_Face(self.problem, names) for names in subsets(others))

    def _grid(self, box: Array, values: dict[int, int]) -> Array:
        """Points of log(v_s) over a box, the best one among them, (K, peaks)."""
        axes = [np.linspace(low, high, values[len(box)]) for low, high in box]
        return np.vstack([_products(axes), self.best])

    def _bounded(self, j: int, sign: float) -> float:
        """What is sign times the extreme of parameter j with every bound kept."""
        faces, peaks = list(self._faces(j)), len(self.best)
        nodes = self._grid(self.box, _FIRST)
        offsets, step = self._steps()
        reach = self._kept(faces, nodes, j, sign)
        for _ in range(_LOOKS.get(peaks, 0)):
            nodes = np.clip(nodes[reach.argmax()] + step * offsets, *self.box.T)
            reach = self._kept(faces, nodes, j, sign)
            step = step * 2 / (_NEXT[peaks] - 1)
        return float(reach.max())

    def _kept(self, faces: Sequence[_Face], nodes: Array, j: int, sign: float) -> Array:
        """The best of the faces' reaches of parameter j at each of K nodes that break no bound, (K,); -inf where there is none."""
        best = np.full(nodes.shape[0], -np.inf)
        for face in faces:
            at = face.at(np.exp(nodes))
            best = np.maximum(best, np.where(self._inside(at, j, sign), self._reach(at, sign)[:, j], -np.inf))
        return best

    def _inside(self, at: _At, j: int, sign: float) -> NDArray[np.bool_]:
        """Whether no parameter breaks its bound at the extreme of parameter j, raised to its own bound if need be, at each v_s, (K,)."""
        own, theta = at.spread[:, j, j], at.theta[:, j]
        far = np.sqrt(own * np.maximum(self.threshold - at.cost, 0.0))
        end = np.maximum(theta + sign * far, 0.0) if self.bounded[j] else theta + sign * far
        moved = (end - theta) / np.where(own > 0, own, np.inf)
        slack = _SLACK * np.sqrt(np.einsum("kmm->km", at.spread) * self.threshold)
        inside = (at.theta + moved[:, None] * at.spread[:, j] >= -slack) | ~self.bounded
        inside[:, j] = end <= theta + far + slack[:, j]
        every: NDArray[np.bool_] = inside.all(axis=1)
        return every

    def _steps(self) -> tuple[Array, Array]:
        """The nodes of the second look about the best, in steps, (K, peaks), and a step, (peaks,)."""
        peaks = len(self.best)
        offsets = _products([np.linspace(-1, 1, _NEXT.get(peaks, 1))] * peaks)
        return offsets, np.diff(self.box, axis=1)[:, 0] / (_FIRST.get(peaks, 2) - 1)

    def _zoom(self, sign: float) -> tuple[Array, NDArray[np.bool_]]:
        """What is sign times each parameter's extreme with no bound at all, (M,); and whether no other parameter breaks its bound there, (M,)."""
        face, nodes, peaks = self.free, self._grid(self.box, _FIRST), len(self.best)
        at = face.at(np.exp(nodes))
        lowest = int(at.cost.argmin())
        if at.cost[lowest] < self.cost - _LOWER * (self.threshold - self.cost) - self._tolerance and not face.breaks(
            at, lowest
        ):
            self.better = np.exp(nodes[lowest])
        each = np.arange(face.size)
        k = self._reach(at, sign).argmax(axis=0)
        offsets, step = self._steps()
        for _ in range(_LOOKS.get(peaks, 0)):
            around = nodes[k][:, None] + step * offsets
            nodes = np.clip(around, *self.box.T).reshape(-1, peaks)
            at = face.at(np.exp(nodes))
            own = self._reach(at, sign).reshape(face.size, -1, face.size)[each, :, each]
            k = each * own.shape[1] + own.argmax(axis=1)
            step = step * 2 / (_NEXT[peaks] - 1)
        inside = [bool(self._inside(at, j, sign)[node]) for j, node in enumerate(k.tolist())]
        return self._reach(at, sign)[k, each], np.array(inside)

    def _reach(self, at: _At, sign: float) -> Array:
        """What is sign times the extreme of each parameter at each v_s, (K, M); -inf where it costs too much."""
        left = self.threshold - at.cost[:, None]
        far = sign * at.theta + np.sqrt(np.einsum("kjj->kj", at.spread) * np.maximum(left, 0.0))
        return np.where(left >= -self._tolerance, far, -np.inf)

    def _held(self, face: _Face, nodes: Array, j: int, values: Array) -> tuple[Array, NDArray[np.bool_]]:
        """The least cost on a face with parameter j held at values (D,), inf where others break a bound; and where the free least one breaks none."""
        at = face.at(np.exp(nodes))
        own = at.spread[:, j, j]  # zero where no point shows the parameter: any value costs the same
        off = np.divide(values[:, None] - at.theta[:, j], own, out=np.zeros((values.size, own.size)), where=own > 0)
        cost = at.cost + off**2 * own
        point = at.theta + off[:, :, None] * at.spread[:, j]
        fine = ((point >= -_SLACK * np.abs(point).max()) | ~self.bounded)[..., np.arange(face.size) != j].all(axis=-1)
        return np.where(fine, cost, np.inf).min(axis=1), fine[np.arange(values.size), cost.argmin(axis=1)]
