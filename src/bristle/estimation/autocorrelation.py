"""Correlated noise.

Autocorrelation, by how much it inflates the variance of a mean, and what residuals hold beyond it.
"""

from typing import Any

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.special import fdtrc

from bristle.arrays import Array
from bristle.findings import CAUTION, CRITICAL, NOTE, Finding, unit_of

_WINDOW = 5.0
"""Sokal's c: the sum is cut at the first lag of at least c integrated autocorrelation times."""
_HARMONICS = 64
"""Most ripples looked for."""
_SIGNIFICANT = 0.01
_FEW = 8
_POOR = 0.15
"""Of the measured torque: a fit that leaves a larger pattern describes something else."""
_BESIDE = 1e-6
"""Of its length: what a column has beside others, below which it is made of them."""
_CHANCE = 3.3
"""White noise's share that is not in its differences exceeds this over sqrt(n) once in two thousand times."""


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


def inflation(x: Array) -> float:
    """The factor tau in var(mean) = tau var(x) / n.

    The integrated autocorrelation time 1 + 2 sum of the autocorrelation, in samples. The sum ends at the first lag of
    five tau (Sokal, 1997) and is corrected for the mean being taken from the same data (Wolff, 2004, eq. 49). At least
    1, at most n; 1 for fewer than four samples or a constant. White noise gives 1, AR(1) noise (1 + rho) / (1 - rho).
    """
    n, rho = x.size, autocorrelation(x)
    if n < 4 or not rho[1:].any():
        return 1.0
    partial = 2 * np.cumsum(rho) - 1
    far = np.flatnonzero(np.arange(n) >= _WINDOW * partial)
    cut = min(int(far[0]) if far.size else n - 1, n // 2)
    return float(np.clip(partial[cut] * (1 + (2 * cut + 1) / n), 1.0, n))


def standard_error(x: Array) -> float | None:
    """Standard error of the mean of x, corrected for autocorrelation.

    None where x holds fewer than two independent samples.
    """
    tau = inflation(x)
    return float(np.std(x) * np.sqrt(tau / (x.size - tau))) if x.size >= 2 * tau else None


def correlated(residuals: Array, widened: float) -> Finding:
    """That residuals go with their neighbours, and by what errors are multiplied for it."""
    lag = lag_one(residuals)
    message = f"Residuals are correlated (lag one {lag:.2f}); standard errors are multiplied by {widened:.1f} for it."
    return Finding("correlated", NOTE, message, {"lag_one": lag, "widened": widened})


def unexplained(residuals: Array, norm: float) -> tuple[Finding, ...]:
    """A diagnostic where the model leaves more than noise: a pattern of more than `_POOR` of what it should explain.

    Noise changes from one equation to the next, a pattern does not: half the mean square of the successive differences
    is the noise's variance (von Neumann, 1941). None of fewer than eight equations.

    Args:
        residuals: in the order of time, or of velocity where there is no time, (n,).
        norm: of what was measured, > 0, in the residuals' unit.
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


def residual_warnings(residuals: Array, velocity: Array, time: Array, position: Array) -> tuple[Finding, ...]:
    """A diagnostic for what the residuals show beyond noise.

    A trend over time or velocity, a ripple over position, a difference between directions, friction that changes over
    time. F tests against a constant, of a parabola over time, velocity and position, and of each harmonic of the range of
    positions, all Bonferroni corrected for their number; residuals that are correlated in the order given count for fewer.
    Significant is p < 0.01 after correction.

    Args:
        residuals: N*m, shape (n,).
        velocity: rad/s, shape (n,), or empty.
        time: s, shape (n,), or empty.
        position: rad, shape (n,), or empty.
    """
    n = residuals.size
    trends = {"time": time, "velocity": velocity, "position": position}
    known = {name: x for name, x in trends.items() if x.size == n and n >= _FEW and np.ptp(x) > 0}
    scaled = {name: 2 * (x - x.min()) / np.ptp(x) - 1 for name, x in known.items()}
    count = min(n // 4, _HARMONICS) if "position" in known else 0
    both = "velocity" in known and velocity.min() < 0 < velocity.max()
    fades = both and "time" in known
    looks, warnings = len(known) + count + both + fades, []
    if both:  # a symmetric curve that is not: what it leaves is even in velocity
        p, share = _f_test(residuals, np.stack([np.ones(n), np.abs(velocity)]), about_mean=False)
        if (p := p * looks) < _SIGNIFICANT:
            message = (
                f"Friction differs between the directions (p = {p:.1g}, corrected for {looks} tests): the difference explains "
                f"{100 * share:.0f} % of the residuals' variance. Fit the directions separately (directions: separate)."
            )
            warnings.append(Finding("directions-differ", CAUTION, message, {"p": p, "looks": looks, "share": share}))
    patterns: list[tuple[str, dict[str, Any], Array]] = [
        (f"trend vs {over}", {"over": over}, np.stack([s, s * s])) for over, s in scaled.items()
    ]
    if fades:  # friction opposes motion, so a change of it has another sign in each direction
        powers = np.stack([scaled["time"], scaled["time"] ** 2])
        basis = (powers - powers.mean(axis=1, keepdims=True)) * np.sign(velocity)
        p, share = _f_test(residuals, basis)
        if (p := p * looks) < _SIGNIFICANT:
            change = 2 * float(basis[0] @ residuals) / float(basis[0] @ basis[0])
            way = "grows" if change > 0 else "falls"
            message = (
                f"Friction {way} by {abs(change):.2g}{unit_of('torque')} from the beginning to the end (p = {p:.1g}, corrected for {looks} "
                f"tests), which explains {100 * share:.0f} % of the residuals' variance: it wears in or warms up. Repeat it on a joint "
                "that has settled."
            )
            numbers = {"change": change, "p": p, "share": share}
            warnings.append(Finding("friction-drifts", CAUTION, message, numbers, {"torque": abs(change)}))
    if count:
        period, basis = _strongest_harmonic(residuals, known["position"], count)
        patterns.append((f"ripple vs position of period {period:.3g}{unit_of('position')}", {"period": period}, basis))
    for what, of, basis in patterns:
        p, share = _f_test(residuals, basis)
        if (p := p * looks) < _SIGNIFICANT:
            message = (
                f"Residuals show a {what} (p = {p:.1g}, corrected for {looks} tests), which explains "
                f"{100 * share:.0f} % of their variance."
            )
            warnings.append(
                Finding(
                    "residual-ripple" if "period" in of else "residual-trend",
                    CAUTION,
                    message,
                    {**of, "p": p, "looks": looks, "share": share},
                )
            )
    return tuple(warnings)


def explained_beside(known: Array, y: Array, columns: Array, inflated: float = 1.0) -> tuple[float, float]:
    """Probability of the F test of columns (n, k) beside known ones (n, p), counting independent samples of y (n,).

    These are no more than one in `inflated`. Then comes their share of the squares that the known ones leave of y.
    """
    lengths = [np.maximum(np.linalg.norm(x, axis=0), 1e-300) for x in (known, columns)]
    off = np.linalg.qr(known / lengths[0])[0]
    beside, left = (x - off @ (off.T @ x) for x in (columns / lengths[1], y))
    directions = np.linalg.qr(beside[:, np.linalg.norm(beside, axis=0) > _BESIDE])[0]
    k, total = directions.shape[1], float(left @ left)
    explained = directions @ (directions.T @ left)
    share = float(explained @ explained) / total if total > 0 else 0.0
    freedom = y.size / max(inflation(left - explained), inflated) - known.shape[1] - k
    if freedom < 1 or not k or share <= 0:
        return 1.0, share
    return float(fdtrc(k, freedom, share / k / max(1 - share, 1e-300) * freedom)), share


def _strongest_harmonic(y: Array, position: Array, count: int) -> tuple[float, Array]:
    """Of the first `count` harmonics of the range of positions, the one that explains most of y.

    Returned are its period and cosine and sine.
    """
    reach = float(np.ptp(position))
    phase = 2 * np.pi * np.arange(1, count + 1)[:, None] * (position - position.min()) / reach
    bases = np.stack([np.cos(phase), np.sin(phase)], axis=1)
    directions = np.linalg.qr(np.swapaxes(bases - bases.mean(axis=2, keepdims=True), 1, 2))[0]
    best = int(np.argmax((((y - y.mean()) @ directions) ** 2).sum(axis=1)))
    return reach / (best + 1), bases[best]


def _f_test(y: Array, basis: Array, *, about_mean: bool = True) -> tuple[float, float]:
    """Probability of the F test of basis, shape (k, n), against a constant (or zero), counting independent samples.

    Then comes its share of the variance.
    """
    centred = y - y.mean() if about_mean else y
    total = float(centred @ centred)
    directions = np.linalg.qr((basis - basis.mean(axis=1, keepdims=True) if about_mean else basis).T)[0].T
    explained = (directions @ centred) @ directions
    rest = centred - explained
    share = float(explained @ explained) / total if total > 0 else 0.0
    k, independent = basis.shape[0], y.size / inflation(rest)
    freedom = independent - k - about_mean
    if freedom < 1 or share <= 0:
        return 1.0, share
    return float(fdtrc(k, freedom, share / k / max(1 - share, 1e-300) * freedom)), share
