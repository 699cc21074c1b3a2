"""The fitted curve of friction vs velocity, and how far it is known."""

import numpy as np
from scipy.special import stdtrit

from bristle.arrays import Array
from bristle.identification.fits import StaticFit
from bristle.identification.systematic import NORMAL
from bristle.model.functions import steady_jacobian_function, steady_torque_function
from bristle.model.parameters import Stribeck, of_curve
from bristle.model.vectorize import evaluate


def curve(v: Array, p: Stribeck[float]) -> Array:
    """T_ss(v) of (9), N*m, shape of v."""
    return evaluate(steady_torque_function(p.law), v, *p)[0]


def band(v: Array, fit: StaticFit) -> Array | None:
    """Half-width of the 95 % confidence band of the fitted curve at v, N*m; None where the covariance gives none.

    sqrt(j C j') times Student's t, with j the exact derivative of (9) with respect to the free parameters, by CasADi;
    in quadrature with what the errors of constants do to the curve.
    """
    p = fit.values()
    keep = [k for k, name in enumerate(fit.names) if of_curve(name)]
    covariance = fit.covariance[np.ix_(keep, keep)]
    if p is None or not keep or fit.degrees_of_freedom < 1 or not np.isfinite(covariance).all():
        return None
    columns = dict(zip(p._fields, evaluate(steady_jacobian_function(p.law), v, *p), strict=True))
    j = np.array([columns[fit.names[k]] for k in keep])
    variance = np.maximum(np.einsum("kn,kl,ln->n", j, covariance, j), 0.0)
    half = float(stdtrit(fit.degrees_of_freedom, 0.975)) * np.sqrt(variance)
    shifts = [fit.parameters[fit.names[k]].shifts for k in keep]
    for constant in dict.fromkeys(c for shift in shifts for c in shift):  # all parameters by one constant together
        half = np.hypot(half, NORMAL * np.array([shift.get(constant, 0.0) for shift in shifts]) @ j)
    return np.asarray(half)
