"""Correlated noise: by how much it inflates the variance of a mean, and what residuals hold beyond it."""

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from bristle.arrays import Array
from bristle.findings import CRITICAL, NOTE, Finding

_WINDOW = 5.0  # Sokal's c: the sum is cut at the first lag of at least c integrated autocorrelation times
_FEW = 8
_POOR = 0.15  # of the measured torque: a fit that leaves a larger pattern describes something else
_CHANCE = 3.3  # white noise's share that is not in its differences exceeds this over sqrt(n) once in two thousand times


def autocorrelation(x: Array) -> Array:
    """Autocorrelation of x about its mean at lags 0 to n - 1, shape (n,), by FFT, biased (divided by n, not n - lag).

    One at lag 0. Zero at all others where x is constant or holds one sample; empty where x is.
    """
    n = x.size
    if n == 0:
        return np.zeros(0)
    _, exponent = np.frexp(np.abs(x).max())
    scaled = np.ldexp(x, -exponent)  # exact, and no mean of the smallest numbers rounds
    centred = scaled - scaled.mean()
    largest = np.abs(centred).max()
    if largest <= 1e-12 * np.abs(scaled).max():
        return np.asarray(np.arange(n) == 0, dtype=np.float64)
    length = next_fast_len(2 * n, real=True)
    covariance = irfft(np.abs(rfft(centred / largest, length)) ** 2, length)[:n]
    return np.asarray(covariance / covariance[0], dtype=np.float64)


def lag_one(x: Array) -> float:
    """Correlation of each sample with the next, in [-1, 1]; zero where x is constant or shorter than two samples."""
    return float(autocorrelation(x)[1]) if x.size > 1 else 0.0


def inflation(x: Array, along: Array | None = None) -> float:
    """The factor tau in var(mean) = tau var(x) / n, or in var(d'x) = tau var(x) |d|**2 of noise `along` a direction d, (n,).

    The integrated autocorrelation time 1 + 2 sum of the autocorrelation, in samples; along a direction of its products
    with d's own, about zero. The sum ends at the first lag of five tau (Sokal, 1997) and is corrected for the mean being
    taken from the same data (Wolff, 2004, eq. 49). At least 1, at most n; 1 for fewer than four samples or a constant.
    White noise gives 1, AR(1) noise (1 + rho) / (1 - rho).
    """
    n, rho = x.size, autocorrelation(x)
    if n < 4 or not rho[1:].any():
        return 1.0
    partial = 2 * np.cumsum(rho) - 1
    far = np.flatnonzero(np.arange(n) >= _WINDOW * partial)
    cut = min(int(far[0]) if far.size else n - 1, n // 2)
    whole = partial[cut]
    if along is not None:
        length = next_fast_len(2 * n, real=True)
        own = irfft(np.abs(rfft(along, length)) ** 2, length)[:n]
        if not own[0] > 0:
            return 1.0
        whole = 2 * float(rho[: cut + 1] @ (own / own[0])[: cut + 1]) - 1
    return float(np.clip(whole * (1 + (2 * cut + 1) / n), 1.0, n))


def standard_error(x: Array) -> float | None:
    """Standard error of the mean of correlated x; None of fewer than two independent samples."""
    tau = inflation(x)
    return float(np.std(x) * np.sqrt(tau / (x.size - tau))) if x.size >= 2 * tau else None


def correlated(residuals: Array, widened: float) -> Finding:
    """That residuals go with their neighbours, and by what errors are multiplied for it."""
    lag = lag_one(residuals)
    message = f"Residuals are correlated (lag one {lag:.2f}); standard errors are multiplied by {widened:.1f} for it."
    return Finding("correlated", NOTE, message, {"lag_one": lag, "widened": widened})


def unexplained(residuals: Array, norm: float) -> tuple[Finding, ...]:
    """A diagnostic where residuals, (n,), in the order of time or of velocity, hold a pattern of more than `_POOR` of what was measured.

    `norm` is that of what was measured. Noise changes from one equation to the next, a pattern does not: half the mean
    square of the successive differences is the noise's variance (von Neumann, 1941). None of fewer than eight equations.
    """
    if residuals.size < _FEW or not norm > 0:
        return ()
    power, n = float(residuals @ residuals), residuals.size
    noise = min(float(np.sum(np.diff(residuals) ** 2)) / 2 * n / (n - 1), power)
    if power - noise <= max((_POOR * norm) ** 2, _CHANCE / np.sqrt(n) * power):
        return ()
    error, of_noise = 100 * np.sqrt(power) / norm, 100 * np.sqrt(noise) / norm
    message = (
        f"The relative error is {error:.2g} %, of which noise accounts for {of_noise:.2g} %: the model does not describe these data, so do not use "
        "its parameters."
    )
    return (Finding("unexplained", CRITICAL, message, {"error": error, "noise": of_noise}),)
