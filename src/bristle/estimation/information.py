"""The Bayesian information criterion of least squares: BIC = n' log(RSS / n) + k log(n')."""

from math import log

from bristle.arrays import Array

_EXACT = 1e-24  # of the measured power: smaller residuals are rounding


def power_of(x: Array) -> float:
    """The sum of squares of x, (n,)."""
    return float(x @ x)


def bic(residuals: Array, parameters: int, effective: float, power: float) -> float:
    """BIC of residuals (n,), k = `parameters` + 1, n' = `effective`; `power` is the sum of squares explained."""
    squares = max(power_of(residuals), _EXACT * power, 1e-300)
    return effective * log(squares / residuals.size) + (parameters + 1) * log(effective)
