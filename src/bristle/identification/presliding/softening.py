"""Softening beyond LuGre's exponential: y = rest + f(U), f piecewise linear."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import stdtrit

from bristle.arrays import Array
from bristle.data.slow_loading import Loading
from bristle.estimation import levels
from bristle.estimation.autocorrelation import inflation
from bristle.estimation.covariance import student
from bristle.estimation.profile_likelihood import interval_on_grid
from bristle.findings import CAUTION, Finding, in_direction
from bristle.identification.presliding.stiffness import KnownValue, of_loading, unbent
from bristle.model.parameters import Kind, unit

_BLOCKS = 32  # means per loading without counts
_GRID = 64  # values of 1 / g0 between which ends are sought
_STRAIGHT = 1e-6  # smallest 1 / g0 over the bound's, which bends nothing


class _Points(NamedTuple):
    """Points of all loadings of a direction below REACH of g0."""

    y: Array
    T: Array
    weight: Array
    loading: Array  # Which one each point is of, (n,)


class _Bending(NamedTuple):
    """f at the knots, with covariance."""

    U: Array
    y: Array
    covariance: Array
    freedom: float

    @property
    def fall(self) -> float:
        """Logarithm of U / y at the last knot over that at the first; 0 for LuGre."""
        return float(np.log(self.U[-1] / self.y[-1] * self.y[0] / self.U[0]))

    @property
    def error(self) -> float:
        """Standard error of the fall."""
        share = np.zeros(self.y.size)
        share[[0, -1]] = 1 / self.y[0], -1 / self.y[-1]
        return float(np.sqrt(share @ self.covariance @ share))


def softening(loadings: Sequence[Loading], level: KnownValue, kind: Kind) -> Finding | None:
    """A finding if the stiffness of one direction falls with the torque by more than LuGre's; None also of too few points.

    Its `sigma_0` are those of the LuGre joints with the displacement of each amplitude.
    """
    points, line = _points(loadings, level.value), None
    # even knots, as many as the points determine, with some points before each
    most = float(points.T.max(initial=0.0))
    for count in range(min(levels.KNOTS[1], points.T.size // levels.PER_KNOT), levels.KNOTS[0] - 1, -1):
        knots = most * np.arange(1, count + 1) / count
        if most > 0 and (np.histogram(points.T, [0.0, *knots])[0] >= levels.PER_KNOT // 2).all():
            line = _line(points, knots, level.value)
        if line is not None and (np.sqrt(np.diag(line.covariance)) < levels.VAGUE * line.y).all():
            break
        line = None
    if line is None:
        return None
    by_level = 0.0  # error of the fall by g0
    if level.standard_error and not level.is_bound:
        width = min(level.standard_error, 0.1 * level.value)
        falls = [other.fall for s in (-1, 1) if (other := _line(points, knots, level.value + s * width)) is not None]
        by_level = abs(falls[-1] - falls[0]) / (2 * width) * level.standard_error if len(falls) == 2 else np.inf
    if (
        line.fall > stdtrit(line.freedom, levels.RARE) * np.hypot(line.error, by_level)
        or np.exp(line.fall) > 1 - levels.SOFTER
    ):
        return None
    secant, lugre = knots / line.y, knots / line.U
    low, high, of, d = float(knots[0]), float(knots[-1]), unit("torque", kind), loadings[0].direction
    ratio, own = (float(x[-1] / x[0]) for x in (secant, lugre))
    error = ratio * line.error
    message = (
        f"Softening{in_direction(d)}: from {low:.3g} to {high:.3g} {of} the secant stiffness falls to {ratio:.2g} +/- "
        f"{error:.1g} of its initial value, LuGre's own exponential to {own:.2g}; the interval of sigma_0 spans what the "
        "amplitudes give, and a Maxwell-slip model would describe the rest."
    )
    numbers = {
        "low": low, "high": high, "unit": of, "ratio": ratio, "error": error, "lugre": own, "direction": d,
        "sigma_0": tuple((line.U / line.y).tolist()),
    }  # fmt: skip  # a list of values
    return Finding("softens", CAUTION, message, numbers)


def with_most(loadings: Sequence[Loading], level: KnownValue) -> KnownValue:
    """A lower bound of g0 with the largest g0 that the loadings' bend allows at 95 % (F test); else as given."""
    points = _points(loadings, level.value) if level.is_bound else None
    if points is None or points.T.size <= np.unique(points.loading).size + 2 or not np.ptp(points.y):
        return level

    def left(x: float) -> Array:
        """Residuals of T at g0 = level / x."""
        g0 = level.value / x
        U = unbent(points.T, g0)
        weighted = points._replace(weight=(1 - points.T / g0) ** 2)
        y, u = _within_loadings(np.column_stack([points.y, U]), weighted)[0].T
        return np.asarray(u - y * float(y @ u) / float(y @ y))

    def costs(values: Array) -> Array:
        return np.array([float(np.sum(left(x) ** 2)) for x in values.tolist()])

    grid = np.maximum(np.linspace(0, 1, _GRID + 1), _STRAIGHT)
    of_grid = costs(grid)
    k = int(np.argmin(of_grid))
    near = grid[max(k - 1, 0)], grid[min(k + 1, _GRID)]
    best = float(minimize_scalar(lambda x: costs(np.array([x]))[0], bounds=near, method="bounded").x)
    rest = left(best)
    freedom = max(rest.size / inflation(rest) - np.unique(points.loading).size - 2, 1.0)
    limit = float(rest @ rest) * (1 + student(freedom) ** 2 / freedom)
    low, high = interval_on_grid(costs, grid, of_grid, best, limit)
    return level._replace(value=level.value / min(high, 1.0), most=level.value / low if low else np.inf)


def _points(loadings: Sequence[Loading], g0: float) -> _Points:
    """Count edges, or means over stretches of samples without counts."""
    rows = []
    for k, loading in enumerate(loadings):
        piece = of_loading(loading, g0)
        if loading.quantum > 0:
            y, U, weight = piece.edge_y, piece.edge_U, piece.weight
        else:
            stretches = np.linspace(0, piece.y.size, min(_BLOCKS, piece.y.size) + 1).astype(int)[:-1]
            sizes = np.diff([*stretches, piece.y.size])
            y, U = (np.add.reduceat(x, stretches) / sizes if x.size else x for x in (piece.y, piece.U))
            weight = np.exp(-2 * np.maximum(U, 0.0) / g0)
        rows.append([y, -g0 * np.expm1(-U / g0), weight, np.full(y.size, k)])
    return _Points(*(np.concatenate(column) for column in zip(*rows, strict=True)))


def _line(points: _Points, knots: Array, g0: float) -> _Bending | None:
    """The line f by weighted least squares, or None."""
    U, at = (unbent(np.minimum(T, levels.NEAREST * g0), g0) for T in (points.T, knots))
    columns = [np.interp(U, [0.0, *at], row) for row in np.eye(at.size + 1)[1:]]
    centred, used = _within_loadings(np.column_stack([points.y, *columns]), points)
    y, A = centred[:, 0], centred[:, 1:]
    scale = np.linalg.norm(A, axis=0)
    if (scale == 0).any() or np.linalg.cond(A / scale) > levels.DEPENDENT or y.size <= used + at.size:
        return None
    inverse = np.linalg.pinv(A)
    found = inverse @ y
    rest = y - A @ found
    correlated = inflation(rest)
    freedom = max(y.size / correlated - used - at.size, 1.0)
    variance = float(rest @ rest) / (y.size - used - at.size) * correlated
    return _Bending(at, found, variance * inverse @ inverse.T, freedom)


def _within_loadings(columns: Array, points: _Points) -> tuple[Array, int]:
    """Columns, (n, k), less the weighted mean of each loading, times root weight; and the number of loadings."""
    member = points.loading[:, None] == np.unique(points.loading)
    mean = (member * points.weight[:, None]).T @ columns / (points.weight @ member)[:, None]
    return np.sqrt(points.weight)[:, None] * (columns - member @ mean), member.shape[1]
