"""Information criteria of least squares: of models on the same equations the lowest one is preferred.

With k parameters, the noise variance among them, and the sum of squared residuals RSS of n equations, of which n' are
independent:

    AICc = n' log(RSS / n) + 2 k + 2 k (k + 1) / (n' - k - 1),    BIC = n' log(RSS / n) + k log(n')
"""

from math import log

from bristle.arrays import Array

_EXACT = 1e-24  # of the measured power: residuals below are rounding


def power_of(x: Array) -> float:
    """The sum of squares of x, (n,)."""
    return float(x @ x)


def criteria(residuals: Array, parameters: int, effective: float, power: float) -> tuple[float | None, float]:
    """AICc, None where there are too few independent equations, and BIC, of residuals (n,).

    Of so many `parameters`, the noise variance apart, `effective` independent equations, and `power`, the sum of squares of
    what is explained.
    """
    k = parameters + 1
    fit_term = effective * log(max(power_of(residuals), _EXACT * power, 1e-300) / residuals.size)
    spare = effective - k - 1
    return fit_term + 2 * k + 2 * k * (k + 1) / spare if spare > 0 else None, fit_term + k * log(effective)
