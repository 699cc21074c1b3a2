"""Joints drawn from what is known of one: the covariance of its moving fit and the errors of constants."""

from dataclasses import replace

import numpy as np

from bristle.identification.known_joint import KnownJoint
from bristle.identification.results import Joint
from bristle.model.parameters import INERTIA, Pair, is_positive, least_of, of_curve

DRAWS = 60  # joints drawn
SEED = 0
_MOST_MOVED = 5.0  # largest move of a drawn logarithm


def draws_of(
    joint: Joint, known: KnownJoint, travel: float, J: float, *, statistical: bool = True
) -> tuple[tuple[Pair[float], float], ...]:
    """Joints drawn from the covariance of the moving fit and the errors of constants, each with its inertia, kg*m**2.

    Positive parameters are drawn as logarithms. Empty without such a fit. `travel` is as in `KnownJoint.filled`, `J`
    the inertia where it was not fitted; `statistical` False draws the errors of constants alone.
    """
    fit = joint.moving
    shown = {} if fit is None else {name: e for name, e in fit.parameters.items() if e.value is not None}
    names = [] if fit is None else [name for name in fit.names if name in shown]
    if fit is None or not names:
        return ()
    rows = [fit.names.index(name) for name in names]
    centre = np.array([shown[name].value for name in names], dtype=float)
    positive = np.array([is_positive(name.name) for name in names]) & (centre > 0)
    chain = np.where(positive, 1 / np.where(positive, centre, 1.0), 1.0)
    covariance = fit.covariance[np.ix_(rows, rows)] * np.outer(chain, chain)
    if not np.isfinite(covariance).all():
        return ()
    rng = np.random.default_rng(SEED)
    scattered = rng.multivariate_normal(np.zeros(len(names)), covariance, DRAWS, method="eigh")
    moved = np.zeros(scattered.shape)
    for constant in dict.fromkeys(c for name in names for c in shown[name].shifts):
        shift = np.array([shown[name].shifts.get(constant, 0.0) for name in names])
        moved += rng.standard_normal((DRAWS, 1)) * (shift * chain)
    if statistical:
        moved += scattered
    elif not moved.any():
        return ()
    least = np.array([least_of(name.name) if of_curve(name.name) else 0.0 for name in names])
    with np.errstate(over="ignore"):
        by_factor = centre * np.exp(np.clip(moved, -_MOST_MOVED, _MOST_MOVED))
        drawn = np.where(positive, by_factor, np.maximum(centre + moved, least))
    joints = []
    for draw in drawn.tolist():
        sample = dict(zip(names, draw, strict=True))
        estimates = {name: replace(shown[name], value=x) for name, x in sample.items()}
        own = sample.get(INERTIA)
        inertia = own + (joint.link_inertia or 0.0) if own else J
        joints.append((replace(known, estimates={**known.estimates, **estimates}).pair(travel, inertia), inertia))
    return tuple(joints)
