"""Whether the best of many columns explains anything: it would explain something of pure noise as well."""

import numpy as np

from bristle.arrays import Array


def p_value(off: Array, length: Array, q: Array, ratio: float, *, draws: int = 2000, seed: int = 0) -> float:
    """How often pure noise would look as much like one of the columns, times a factor that is not negative, as the data do.

    Where columns differ by a parameter that means nothing without them, no F table applies to the best of all. But the ratio
    (cost without - cost with) / cost with does not depend on the other parameters nor on the noise level: it is drawn here, with Gaussian noise.

    Args:
        off: the columns off those that are there anyhow, (n, k).
        length: their squared lengths, (k,); inf where one vanishes.
        q: orthonormal basis of those that are there anyhow, (n, m).
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
