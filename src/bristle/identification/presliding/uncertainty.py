"""Intervals of a presliding stiffness: u is sigma_0, or its inverse for `samples`, x = (g0 - level) / its error."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bristle.arrays import Array
from bristle.data.slow_loading import Loading
from bristle.estimation import interval_comparison
from bristle.estimation.conditional_profile import Conditional, ConditionalProfiles, Looks
from bristle.estimation.covariance import student
from bristle.identification.fits import Estimate, RunScatter, Uncertainty
from bristle.identification.presliding.stiffness import (
    KnownValue,
    estimator_of,
    of_loading,
    quantum_of,
)
from bristle.identification.repeats import limit_widening, scatter_of

_LEAST_FREEDOM = 4.0  # degrees of freedom from which a run states its own error
_NODES = 17  # values of g0 of the estimator, linear between them
_LOOKS = Looks(first=4001, near=2, again=0, drawn=4001)  # one look at so many
_LEAST = 0.2  # of g0: its least value
_CURVE = 41
_BEYOND = 1.3  # drawn range, in half-widths of the interval


class _Line(NamedTuple):
    """An estimator over g0."""

    inverse: bool  # Whether u is the inverse of sigma_0, as by all samples
    x: Array  # (g0 - level) / its error, ascending, (k,)
    u: Array  # (k,)
    e: Array  # (k,)
    reach: float  # t

    def at(self, x: Array | float) -> tuple[Array, Array]:
        """The values of u and e at x."""
        return np.asarray(np.interp(x, self.x, self.u)), np.asarray(np.interp(x, self.x, self.e))

    def sigma_0(self, u: Array) -> Array:
        """sigma_0 >= 0 at u, infinite where an inverse is not positive."""
        if not self.inverse:
            return np.maximum(u, 0.0)
        return np.asarray(np.divide(1.0, u, out=np.full(u.shape, np.inf), where=u > 0), dtype=np.float64)


def stiffness_uncertainty(loadings: Sequence[Loading], level: KnownValue, estimate: Estimate) -> Uncertainty:
    """Intervals of sigma_0 by covariance and by profile; of a lower bound its interval alone.

    By profile: Q(u) = min over x of ((u - u(x)) / e(x))**2 + x**2 <= t**2.
    """
    if estimate.value is None or not estimate.standard_error or estimate.value <= 0:
        return Uncertainty(covariance=None, profile=estimate.interval, bootstrap=None, warnings=estimate.warnings)
    line = _line(loadings, level)

    def at(x: Array) -> Conditional:
        """At x, (K, 1)."""
        u, e = line.at(x)
        return Conditional(u, e[..., None] ** 2, x[:, 0] ** 2)

    box = line.x[[0, -1]][None]
    profiles = ConditionalProfiles(free=at, best=np.zeros(1), threshold=line.reach**2, box=box, looks=_LOOKS)
    (ends,), (middle, _) = profiles.intervals(), line.at(0.0)
    about = np.unique(np.append(middle + _BEYOND * np.linspace(-1, 1, _CURVE)[:, None] * np.abs(ends - middle), ends))
    low, *_, high = sorted(line.sigma_0(ends).tolist())
    profile = low, high
    values = line.sigma_0(about)
    order = np.argsort(values)
    return Uncertainty(
        covariance=estimate.interval, profile=profile, bootstrap=None,
        curve=np.stack([values, profiles.heights(0, about, 0.0)])[:, order[np.isfinite(values[order])]],
        warnings=interval_comparison.warnings(estimate.value, estimate.interval, profile, None),
    )  # fmt: skip  # a list of values


def stiffness_scatter(loadings: Sequence[Loading], level: KnownValue, estimate: Estimate) -> RunScatter | None:
    """Scatter of sigma_0 over the runs at given g0, whose error is common to all; None of fewer than two."""
    by_file = {x.file: [of_loading(own, level.value) for own in loadings if own.file == x.file] for x in loadings}
    solve = estimator_of(loadings)
    each = {file: solve(pieces) for file, pieces in by_file.items()}
    alone = {
        file: (value, error, freedom)
        for file, (value, error, freedom) in each.items()
        if 0 < value < np.inf and 0 < error < np.inf and freedom >= _LEAST_FREEDOM
    }
    of_all, own, freedom = solve([piece for pieces in by_file.values() for piece in pieces])
    values, errors, freedoms = np.array(list(alone.values())).reshape(-1, 3).T
    found = scatter_of(dict(zip(alone, values.tolist(), strict=True)), errors, freedoms, own, freedom)
    if found is None or not estimate.standard_error or not of_all:
        return None
    share = min(own / estimate.standard_error, 1.0)  # without the error of g0
    return limit_widening(found, float(np.sqrt(1 + share**2 * (found.widened**2 - 1))))


def _line(loadings: Sequence[Loading], level: KnownValue) -> _Line:
    """The estimator at values of g0."""
    inverse, solve = not quantum_of(loadings), estimator_of(loadings)

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
    return _Line(inverse, x[np.isfinite(u)], u[np.isfinite(u)], e[np.isfinite(u)], reach)
