"""How far to trust a static fit: covariance, Student intervals, the profile's interval for v_s, and whether a Stribeck term is there at all."""

from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq
from scipy.special import fdtri, stdtrit

from bristle.arrays import Array
from bristle.estimation.linear import inverse_gram

LEVEL = 0.95
"""Every interval's level."""


def covariance(jacobian: Array, cost: float, inflation: float = 1.0) -> tuple[Array, float]:
    """Covariance of least-squares estimates and its degrees of freedom.

    s**2 (J'J)**-1 with s**2 = cost / (n - p), times the factor by which autocorrelated residuals inflate it.

    Args:
        jacobian: shape (n, p), of the free parameters, at the minimum.
        cost: sum of squared residuals.
        inflation: integrated autocorrelation time of the residuals, >= 1.

    Returns:
        The covariance (p, p), and n / inflation - p, at least 1.
    """
    n, p = jacobian.shape
    freedom = max(n / inflation - p, 1.0)
    return cost / max(n - p, 1) * inflation * inverse_gram(jacobian), freedom


def condition(jacobian: Array) -> float:
    """Condition number of the Jacobian with its columns scaled to unit length; 1 where it has none."""
    if jacobian.shape[1] == 0:
        return 1.0
    scale = np.linalg.norm(jacobian, axis=0)
    return float(np.linalg.cond(jacobian / np.where(scale == 0, 1.0, scale)))


def student(freedom: float) -> float:
    """Half-width of the 95 % interval in standard errors, by Student's t."""
    return float(stdtrit(freedom, (1 + LEVEL) / 2))


def profile_threshold(cost: float, n: int, p: int, inflation: float = 1.0) -> float:
    """The cost at which a profiled parameter leaves its 95 % interval: J_min (1 + F / (n - p)), F = F(0.95; 1, n - p)."""
    freedom = max(n / inflation - p, 1.0)
    return cost * (1 + inflation * float(fdtri(1, freedom, LEVEL)) / max(n - p, 1))


def profile_interval(
    costs: Callable[[Array], Array], grid: Array, profile: Array, best: float, threshold: float
) -> tuple[float, float]:
    """The interval of v_s whose profile stays below a threshold; 0 or inf where the profile stays below it to the end of the grid.

    Args:
        costs: the profile as a function of v_s, (k,) -> (k,).
        grid: v_s, ascending, (k,).
        profile: the profile on it, (k,).
        best: where the profile is lowest.
        threshold: from `profile_threshold`.
    """
    below = np.flatnonzero(profile <= threshold)
    low, high = (
        (int(below[0]), int(below[-1]))
        if below.size
        else (int(np.searchsorted(grid, best)), int(np.searchsorted(grid, best)) - 1)
    )

    def crossing(outside: float, inside: float) -> float:
        """Where between two v_s the profile crosses the threshold; the inner one where it does not."""

        def excess(u: float) -> float:
            """The profile less the threshold at log(v_s)."""
            return float(costs(np.array([np.exp(u)]))[0]) - threshold

        a, b = np.log(outside), np.log(inside)
        return inside if excess(a) * excess(b) > 0 else float(np.exp(brentq(excess, a, b, xtol=1e-10)))

    lower = 0.0 if low == 0 else crossing(float(grid[low - 1]), min(best, float(grid[min(low, grid.size - 1)])))
    upper = np.inf if high == grid.size - 1 else crossing(float(grid[high + 1]), max(best, float(grid[max(high, 0)])))
    return lower, float(upper)


def stribeck_p_value(off: Array, length: Array, q: Array, ratio: float, *, draws: int = 2000, seed: int = 0) -> float:
    """How often pure noise would look as much like a Stribeck peak as the data do.

    Without a peak v_s means nothing, so no F table applies to the best of all v_s. But the ratio (cost without - cost with) / cost with
    does not depend on the parameters nor on the noise level: it is drawn here, at the same velocities, with Gaussian noise.

    Args:
        off: Stribeck columns off the linear ones, (n, k).
        length: their squared lengths, (k,).
        q: orthonormal basis of the linear columns, (n, m).
        ratio: the ratio seen (with autocorrelated residuals, divided by their inflation).
        draws: repetitions.
        seed: of the generator.
    """
    rng = np.random.default_rng(seed)
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
