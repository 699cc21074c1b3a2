"""Fisher information F = J' J / noise**2, J = dT / dp, of torques with white noise; covariance >= F**-1."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from bristle.arrays import Array, result
from bristle.estimation import levels
from bristle.findings import CAUTION, Finding
from bristle.identification.dynamic.fit import hardly_seen
from bristle.model import functions
from bristle.model.parameters import (
    SIGNED,
    Direction,
    Lugre,
    Pair,
    ParameterName,
    Stribeck,
    estimated_of,
    fields_of,
    static_estimated_of,
)
from bristle.model.rollout import rollout_jacobian
from bristle.model.vectorize import evaluate

_SINGULAR = 1e-13  # of the largest eigenvalue of the scaled F: smaller ones are zero
_MEMBER = 1e-5  # share of an unseen direction that makes a parameter unseen
_NOTHING = 1e-100  # smaller derivatives are zero


@result
class Information:
    """What a measurement tells about some parameters."""

    names: tuple[ParameterName, ...]
    point: Array  # Parameter values at which the model was linearised, (p,)
    matrix: Array  # F, (p, p), in one over the parameters' units

    @property
    def standard_errors(self) -> Array:
        """Lower bounds for any unbiased fit, (p,); infinite where the parameter is not seen."""
        return covariance(self.matrix)[0]

    @property
    def correlation(self) -> Array:
        """Of the estimates, (p, p); zero where one of the two is not seen."""
        return covariance(self.matrix)[1]

    @property
    def unseen(self) -> tuple[Finding, ...]:
        """Hardly seen directions in parameter space, worst first."""
        size = np.sqrt(np.diag(self.matrix))
        unseen = [
            Finding("nothing-seen-of", CAUTION, f"{name} is not identifiable.", {"name": name})
            for name, s in zip(self.names, size, strict=True)
            if s == 0
        ]
        kept = np.flatnonzero(size > 0)
        values, vectors = np.linalg.eigh(_scaled(self.matrix, size)[np.ix_(kept, kept)])
        for value, vector in zip(values, vectors.T, strict=True):
            if value < levels.HARDLY_SHOWN * values[-1]:
                share = np.abs(vector) / np.abs(vector).max()
                order = [k for k in np.argsort(-share, kind="stable") if share[k] > levels.MEMBERS]
                unseen.append(hardly_seen([(self.names[kept[k]], float(vector[k])) for k in order]))
        return tuple(unseen)


def names_of(p: Lugre[float] | Pair[float]) -> tuple[ParameterName, ...]:
    """The estimated parameters of one set (`both`), or of a pair, the positive set first."""
    directions = (Direction.BOTH,) if isinstance(p, Lugre) else SIGNED
    return tuple(ParameterName(name, d) for d in directions for name in estimated_of(p.law))


def values_of(p: Lugre[float] | Pair[float]) -> Array:
    """The values of `names_of`."""
    sets = [p] if isinstance(p, Lugre) else p
    return np.array([x for one in sets for x in one[: len(estimated_of(p.law))]])


def of_estimated(columns: Array, p: Lugre[float] | Pair[float]) -> Array:
    """Of columns for every field of one set or of a pair, (n, ...), those of `names_of`."""
    law = p.law
    by_set = columns.reshape(len(columns), -1, len(fields_of(law)))[:, :, : len(estimated_of(law))]
    return by_set.reshape(len(columns), -1)


def static_jacobian(velocity: Array, p: Lugre[float] | Stribeck[float] | Pair[float]) -> Array:
    """dT_ss / dp of (9), (n, p), at velocities, rad/s, (n,).

    Columns in the order of `static_estimated_of`; of a pair, the positive set first.
    """
    if not isinstance(p, Pair):
        curve = p.stribeck if isinstance(p, Lugre) else p
        slopes = evaluate(functions.steady_jacobian_function(p.law), velocity, *curve)
        return np.column_stack(slopes[: len(static_estimated_of(p.law))])
    rows = [static_jacobian(velocity, one) for one in p]
    ways = np.asarray(velocity)[:, None] > 0, np.asarray(velocity)[:, None] < 0
    return np.hstack([row * way for row, way in zip(rows, ways, strict=True)])


def static_information(velocity: Array, p: Lugre[float] | Stribeck[float] | Pair[float], noise: float | Array) -> Array:
    """F, (p, p), of steady torques at velocities, rad/s, (n,), with standard deviation `noise`, N*m, one or (n,)."""
    return gram(static_jacobian(velocity, p), noise)


def motion_jacobian(
    velocity: Array, step: float | Array, p: Lugre[float] | Pair[float], extra: Mapping[Any, Array] | None = None
) -> Array:
    """dT_f / dp along a motion, rad/s, (n,), through the bristle, (n, p + k), by `names_of`, `extra` (n,) last."""
    friction = of_estimated(cleared(rollout_jacobian(velocity, step, p).by_parameters), p)
    return np.column_stack([friction, *(extra or {}).values()])


def cleared(derivatives: Array) -> Array:
    """Derivatives without the tiny numbers by which `rollout_jacobian` avoids denormals."""
    return np.where(np.abs(derivatives) < _NOTHING, 0.0, derivatives)


def gram(jacobian: Array, noise: float | Array) -> Array:
    """F = J' J / noise**2 of a Jacobian, (n, p), with a standard deviation, one or (n,)."""
    weighted = jacobian / np.reshape(noise, (-1, 1))
    return np.asarray(weighted.T @ weighted)


def covariance(matrix: Array) -> tuple[Array, Array]:
    """Standard errors, (p,), infinite where nothing is seen, and correlations, (p, p), for information F, (p, p)."""
    if not np.isfinite(matrix).all():  # overflow
        return np.full(len(matrix), np.inf), np.eye(len(matrix))
    size = np.sqrt(np.diag(matrix))
    seen = size > 0
    values, vectors = np.linalg.eigh(_scaled(matrix, size))
    good = values > _SINGULAR * values.max(initial=0.0)
    lost = (np.abs(vectors[:, ~good]) > _MEMBER).any(axis=1)  # a zero row is a direction too
    inverse = (vectors[:, good] / values[good]) @ vectors[:, good].T
    spread = np.sqrt(np.diag(inverse))
    errors = np.where(lost, np.inf, spread / np.where(seen, size, 1.0))
    correlation = inverse / np.where(lost, np.inf, spread)[:, None] / np.where(lost, np.inf, spread)
    np.fill_diagonal(correlation, 1.0)
    return errors, correlation


def _scaled(matrix: Array, size: Array) -> Array:
    """F scaled to 1 on the diagonal, 0 where nothing is seen."""
    unit = np.where(size > 0, size, 1.0)
    return matrix / unit[:, None] / unit
