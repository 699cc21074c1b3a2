"""Intervals of a presliding stiffness, and its scatter over the runs."""

from collections.abc import Sequence

import numpy as np

from bristle.arrays import Array
from bristle.data.slow_loading import Loading
from bristle.estimation import interval_comparison, levels
from bristle.estimation.covariance import student
from bristle.identification.fits import Estimate, RunScatter, Uncertainty
from bristle.identification.presliding.stiffness import KnownValue, estimator_of, of_loading, quantum_of
from bristle.identification.repeats import limit_widening, scatter_of

_NODES = 17  # values of g0 of the estimator, linear between them
_LOOKS = 4001  # values of g0 at which extremes are looked for
_LEAST = 0.2  # of g0: its least value
_CURVE = 41
_BEYOND = 1.3  # drawn range, in half-widths of the interval


def stiffness_uncertainty(loadings: Sequence[Loading], level: KnownValue, estimate: Estimate) -> Uncertainty:
    """Intervals of sigma_0 by covariance and by profile; of a lower bound its interval alone.

    By profile: Q(u) = min over x of ((u - u(x)) / e(x))**2 + x**2 <= t**2, where u is sigma_0, or its inverse by all
    samples, and x = (g0 - level) / its error.
    """
    if estimate.value is None or not estimate.standard_error or estimate.value <= 0:
        return Uncertainty(covariance=None, profile=estimate.interval, bootstrap=None, warnings=estimate.warnings)
    inverse = not quantum_of(loadings)
    nodes, of_u, of_e, reach = _estimator(loadings, level, inverse=inverse)
    x = np.append(nodes[0] + np.ptp(nodes) * np.linspace(0, 1, _LOOKS), 0.0)
    u, variance = np.interp(x, nodes, of_u), np.interp(x, nodes, of_e) ** 2
    far = np.sqrt(variance * np.maximum(reach**2 - x**2, 0.0))
    ends = np.array([-float((far - u).max()), float((u + far).max())])
    middle = u[-1]
    drawn = np.unique(np.append(middle + _BEYOND * np.linspace(-1, 1, _CURVE)[:, None] * np.abs(ends - middle), ends))
    heights = (x**2 + ((drawn[:, None] - u) / variance) ** 2 * variance).min(axis=1) / reach**2

    def sigma_0(u: Array) -> Array:
        """sigma_0 >= 0, infinite where an inverse is not positive."""
        if not inverse:
            return np.maximum(u, 0.0)
        return np.asarray(np.divide(1.0, u, out=np.full(u.shape, np.inf), where=u > 0), dtype=np.float64)

    low, high = sorted(sigma_0(ends).tolist())
    values = sigma_0(drawn)
    order = np.argsort(values)
    return Uncertainty(
        covariance=estimate.interval, profile=(low, high), bootstrap=None,
        curve=np.stack([values, heights])[:, order[np.isfinite(values[order])]],
        warnings=interval_comparison.warnings(estimate.value, estimate.interval, (low, high), None),
    )  # fmt: skip  # a list of values


def stiffness_scatter(loadings: Sequence[Loading], level: KnownValue, estimate: Estimate) -> RunScatter | None:
    """Scatter of sigma_0 over the runs at given g0, whose error is common to all; None of fewer than two."""
    by_file = {x.file: [of_loading(own, level.value) for own in loadings if own.file == x.file] for x in loadings}
    solve = estimator_of(loadings)
    each = {file: solve(pieces) for file, pieces in by_file.items()}
    alone = {
        file: (value, error, freedom)
        for file, (value, error, freedom) in each.items()
        if 0 < value < np.inf and 0 < error < np.inf and freedom >= levels.LEAST_FREEDOM
    }
    of_all, own, freedom = solve([piece for pieces in by_file.values() for piece in pieces])
    values, errors, freedoms = np.array(list(alone.values())).reshape(-1, 3).T
    found = scatter_of(dict(zip(alone, values.tolist(), strict=True)), errors, freedoms, own, freedom)
    if found is None or not estimate.standard_error or not of_all:
        return None
    share = min(own / estimate.standard_error, 1.0)  # without the error of g0
    return limit_widening(found, float(np.sqrt(1 + share**2 * (found.widened**2 - 1))))


def _estimator(loadings: Sequence[Loading], level: KnownValue, *, inverse: bool) -> tuple[Array, Array, Array, float]:
    """The estimator u and its error e at some x, (k,) each, and Student's t."""
    solve = estimator_of(loadings)

    def at(g0: float) -> tuple[float, float, float]:
        """u, e and degrees of freedom at one g0; nan without edges."""
        value, error, freedom = solve([of_loading(loading, g0) for loading in loadings])  # infinite without two edges
        if not np.isfinite(value):
            return np.nan, np.nan, 1.0
        return (1 / value, error / value**2, freedom) if inverse else (value, error, freedom)

    reach = student(at(level.value)[2])
    error = level.standard_error if np.isfinite(level.standard_error) else 0.0
    x = np.linspace(-reach, reach, _NODES) if error else np.zeros(1)
    g0 = level.value + x * error
    x, g0 = x[g0 >= _LEAST * level.value], g0[g0 >= _LEAST * level.value]
    u, e, _ = np.array([at(one) for one in g0.tolist()]).T
    return x[np.isfinite(u)], u[np.isfinite(u)], e[np.isfinite(u)], reach
