"""Correlated noise: inflation of variances, and patterns in residuals."""

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from bristle.arrays import Array
from bristle.estimation import levels
from bristle.findings import CRITICAL, NOTE, Finding

_WINDOW = 5.0  # Sokal's c: the sum ends at c integrated autocorrelation times


def autocorrelation(x: Array) -> Array:
    """Autocorrelation of x about its mean at lags 0 to n - 1, (n,), by FFT, biased; zero beyond lag 0 if constant."""
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


def white_noise(x: Array) -> float:
    """Standard deviation of the white noise of a signal that is smooth from sample to sample, (n,), by its second differences."""
    return 1.4826 * float(np.median(np.abs(np.diff(x, 2)))) / 6**0.5


def lag_one(x: Array) -> float:
    """Correlation of each sample with the next, in [-1, 1]; zero for a constant or a single sample."""
    return float(autocorrelation(x)[1]) if x.size > 1 else 0.0


def inflation(x: Array, along: Array | None = None) -> float:
    """Variance inflation tau of correlated x, (n,): var(mean) = tau var(x) / n.

    With `along`, a direction d, (n,): var(d'x) = tau var(x) |d|**2. tau is the integrated autocorrelation time, summed
    up to the first lag of at least five tau (Sokal, 1997), corrected for the mean (Wolff, 2004, eq. 49) and limited to
    between 1 and n. White noise gives 1, AR(1) noise (1 + rho) / (1 - rho).
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


def spectral_line(x: Array, step: float) -> tuple[float, float]:
    """Frequency, Hz, of the largest line of a signal, (n,), with a sample each `step`, s, and the share of its power."""
    from scipy.signal import periodogram

    f, power = periodogram(x, 1 / step, window="hann")
    line = float(f[np.argmax(power)])
    near = np.abs(f - line) <= max(levels.LINE_WIDTH * line, 3 * float(f[1]))
    return line, float(power[near].sum() / max(power.sum(), 1e-300))


def standard_error(x: Array) -> float | None:
    """Standard error of the mean of correlated x; None of fewer than two independent samples."""
    tau = inflation(x)
    return float(np.std(x) * np.sqrt(tau / (x.size - tau))) if x.size >= 2 * tau else None


def correlated(residuals: Array, widened: float) -> Finding:
    """A note on correlated residuals, and the factor on standard errors."""
    lag = lag_one(residuals)
    message = f"Residuals are correlated (lag one {lag:.2f}); standard errors are multiplied by {widened:.1f} for it."
    return Finding("correlated", NOTE, message, {"lag_one": lag, "widened": widened})


def pattern_of(residuals: Array) -> float:
    """Sum of squares of residuals, (n,), beyond noise, which is half the mean square of successive differences (von Neumann, 1941)."""
    n = residuals.size
    noise = float(np.sum(np.diff(residuals) ** 2)) / 2 * n / max(n - 1, 1)
    return max(float(residuals @ residuals) - noise, 0.0)


def unexplained(residuals: Array, norm: float) -> tuple[Finding, ...]:
    """A finding where residuals, (n,), in order of time or velocity, hold a pattern larger than `POOR` of the `norm`.

    None of fewer than eight equations.
    """
    if residuals.size < levels.FEW or not norm > 0:
        return ()
    power, pattern = float(residuals @ residuals), pattern_of(residuals)
    if pattern <= max((levels.POOR * norm) ** 2, levels.NOISE / np.sqrt(residuals.size) * power):
        return ()
    error, of_noise = 100 * np.sqrt(power) / norm, 100 * np.sqrt(power - pattern) / norm
    message = (
        f"The relative error is {error:.2g} %, of which noise accounts for {of_noise:.2g} %: the model does not describe these data, so do not use "
        "its parameters."
    )
    return (Finding("unexplained", CRITICAL, message, {"error": error, "noise": of_noise}),)
