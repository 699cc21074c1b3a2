"""Linear least squares from LAPACK: free, bounded, factored."""

from functools import cache

import numpy as np
from scipy.linalg import lapack
from scipy.optimize import nnls

from bristle.arrays import Array

_RANK = 1e-14  # reciprocal condition number of dependent columns
_INDEPENDENT = 1e-10  # relative length off the columns before from which a column is independent


def least_squares(design: Array, torque: Array) -> Array:
    """The solution (m,) for columns (n, m) and torque (n,), by pivoted QR; the shortest one if they are dependent."""
    m = design.shape[1]
    return np.asarray(lapack.dgelsy(design, torque, np.zeros((m, 1), dtype=np.int32), _RANK, 16 * m)[1][:m])


def bounded_least_squares(design: Array, torque: Array, lower: Array) -> Array:
    """The solution with lower bounds (m,), 0 or -inf, by nnls off the unbounded columns."""
    free = np.isinf(lower)
    if free.all():  # nnls crashes without columns
        return least_squares(design, torque)
    q, r_inverse = orthonormal(design[:, free])
    off = design[:, ~free] - q @ (q.T @ design[:, ~free])
    scale = np.linalg.norm(design[:, ~free], axis=0)
    scale[scale == 0] = 1.0
    solution = np.empty(lower.size)
    solution[~free] = nnls(off / scale, torque - q @ (q.T @ torque))[0] / scale
    solution[free] = r_inverse @ (q.T @ (torque - design[:, ~free] @ solution[~free]))
    return solution


def orthonormal(columns: Array) -> tuple[Array, Array]:
    """An orthonormal basis Q (n, m) of independent columns (n, m), and the inverse of R (m, m)."""
    if columns.shape[1] == 0:  # LAPACK complains
        return columns, np.zeros((0, 0))
    factored, tau, _, _ = lapack.dgeqrf(columns)
    return lapack.dorgqr(factored, tau)[0], _inverse(factored)


def _inverse(factored: Array) -> Array:
    """The inverse of dgeqrf's R, (m, m), without BLAS threads."""
    m = factored.shape[1]
    return np.asarray(lapack.dtrtri(factored[:m] * _upper(m))[0])


@cache
def _upper(m: int) -> Array:
    """Ones on and above the diagonal, (m, m)."""
    return np.triu(np.ones((m, m)))


def inverse_gram(jacobian: Array) -> Array:
    """(J'J)**-1, (m, m), by QR, or a scaled pseudo-inverse."""
    n, m = jacobian.shape
    if n >= m > 0:
        factored = lapack.dgeqrf(jacobian)[0]
        r = factored[:m] * _upper(m)
        if (r.diagonal() ** 2 > _INDEPENDENT**2 * (r * r).sum(axis=0)).all():
            inverse = _inverse(factored)
            return inverse @ inverse.T
    scale = np.linalg.norm(jacobian, axis=0)
    scale[scale == 0] = 1.0
    inverse = np.linalg.pinv(jacobian / scale)
    return (inverse @ inverse.T) / np.outer(scale, scale)


def best_column_p_value(off: Array, length: Array, q: Array, ratio: float, *, draws: int = 2000) -> float:
    """How often noise alone resembles the best of the columns as much as the data, by simulation.

    Columns are `off` the linear ones, (n, k), of squared lengths (k,), with a coefficient >= 0; q is an orthonormal
    basis of the linear ones, (n, m). The ratio (cost without - cost with) / cost with is over the inflation of
    correlated residuals.
    """
    rng = np.random.default_rng(0)
    # noise matters along the columns; elsewhere only its length does. A column of infinite length vanishes.
    _, reach, directions = np.linalg.svd(off / np.sqrt(length), full_matrices=False)
    alive = reach > 1e-6 * reach[0]
    along = rng.standard_normal((int(alive.sum()), draws))
    rest = off.shape[0] - q.shape[1] - along.shape[0]
    total = np.einsum("rd,rd->d", along, along) + (rng.chisquare(rest, draws) if rest > 0 else 0.0)
    products = (directions[alive].T * reach[alive]) @ along
    gain = (np.maximum(products, 0.0) ** 2).max(axis=0)
    drawn = gain / np.maximum(total - gain, 1e-12 * total)
    return float((1 + np.count_nonzero(drawn >= ratio)) / (draws + 1))
