"""The whole model that was identified of a joint, for a compensator: both sets, inertia, and joints that its covariance allows.

What the data do not show of the bristle is filled in, and to be said where it is used.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from bristle.data.experiment.load import Experiment
from bristle.errors import InputError
from bristle.identification.results import Joint
from bristle.model import functions
from bristle.model.law import DAMPING_RATIO
from bristle.model.parameters import Lugre, Pair
from bristle.model.vectorize import evaluate

DRAWS = 60
"""Joints drawn from the covariance of the identified parameters."""
SEED = 0
DEFLECTION = 1e-3
"""Where nothing shows the bristle's stiffness: its deflection in slow sliding over the reference's amplitude; sigma_1 is then that of (15)."""
_LOGARITHMIC = ("alpha_0", "v_s", "sigma_0", "inertia")
"""Drawn by their logarithms: they are positive."""


def identified(joint: Joint) -> Pair[float]:
    """The model that was identified: of all runs at once, or of constant velocities and slow loading.

    Raises InputError where part of it is missing.
    """
    return Pair(*(_identified(joint, direction) for direction in "+-"))


def _identified(joint: Joint, direction: str) -> Lugre[float]:
    fit = joint.moving
    moving = fit and (fit.values(direction) or fit.values("both"))
    if moving:
        return moving
    static = joint.static.get(direction) or joint.static.get("both")
    p = static.values() if static else None
    slow = joint.presliding.fits.get(direction) if joint.presliding else None
    known = slow and slow.sigma_0.value
    if p is None or not slow or not known:
        what = "friction over velocity" if p is None else "bristle stiffness (sigma_0)"
        raise InputError(
            f"{joint.name}: nothing is known of the {what} in direction {direction}; "
            "a compensator needs a tracking run, or ramp and presliding runs in both directions"
        )
    return p._replace(sigma_0=known, sigma_1=slow.sigma_1.value or 0.0)


def unseen_of(joint: Joint) -> dict[str, list[str]]:
    """Of each direction what the runs do not show of the bristle, and was not given either."""
    fit, slow = joint.moving, joint.presliding.fits if joint.presliding else {}
    if fit is None:
        return {d: ["sigma_1"] for d, own in slow.items() if own.sigma_1.value is None}
    found = {}
    for d in "+-":
        known = {name: fit.parameters.get(name + d, fit.parameters.get(name)) for name in ("sigma_0", "sigma_1")}
        found[d] = [name for name, e in known.items() if e is not None and e.value is None]
    return found


def filled(pair: Pair[float], unseen: Mapping[str, Sequence[str]], amplitude: float, J: float) -> Pair[float]:
    """The pair with a bristle where none was seen."""
    sets = []
    for p, d in zip(pair, "+-", strict=True):
        missing = unseen.get(d, ())
        sigma_0 = p.alpha_0 / (DEFLECTION * amplitude) if "sigma_0" in missing else p.sigma_0
        damping = float(evaluate(functions.presliding_damping(), sigma_0, J, DAMPING_RATIO)[0])
        sets.append(p._replace(sigma_0=sigma_0, sigma_1=damping if "sigma_1" in missing else p.sigma_1))
    return Pair(*sets)


def truth_of(joint: Joint) -> Pair[float] | None:
    """The true sets of simulated data, where all of them are known."""
    sets = [joint.truth.get(d) or joint.truth.get("both") for d in "+-"]
    known = [p for p in sets if p is not None and np.isfinite(p).all()]
    return Pair(*known) if len(known) == len(sets) else None


def inertia_of(experiment: Experiment, joint: Joint) -> float:
    """J, kg*m**2: identified, else as the experiment file gives it. Raises InputError where nothing tells it."""
    for fit in (joint.joint_fit, joint.tracking):
        J = fit.known.get("inertia", 0.0) if fit is not None else 0.0
        if J > 0:
            return J
    if experiment.inertia is not None:
        return experiment.inertia.value
    motor = experiment.motor
    if motor is not None and np.isfinite(motor.J):
        return motor.J
    raise InputError(
        f"{joint.name}: no inertia is known, without which no loop can be simulated; give it as inertia, or a tracking run that shows it"
    )


def draws_of(joint: Joint, inertia: float) -> tuple[tuple[Pair[float], float], ...]:
    """Joints from the covariance of the fit of moving runs, with this inertia where that was not fitted; none without such a fit."""
    fit = joint.moving
    if fit is None or not fit.names:
        return ()
    values = {name: e.value for name, e in fit.parameters.items() if e.value is not None}
    names = [name for name in fit.names if name in values]
    own = [fit.names.index(name) for name in names]
    centre = np.array([values[name] for name in names])
    positive = np.array([name.rstrip("+-") in _LOGARITHMIC for name in names]) & (centre > 0)
    chain = np.where(positive, 1 / np.where(positive, centre, 1.0), 1.0)
    covariance = fit.covariance[np.ix_(own, own)] * np.outer(chain, chain)
    if not np.isfinite(covariance).all():
        return ()
    rng = np.random.default_rng(SEED)
    moved = rng.multivariate_normal(np.zeros(len(names)), covariance, DRAWS, method="eigh")
    with np.errstate(over="ignore"):
        drawn = np.where(positive, centre * np.exp(np.minimum(moved, 5.0)), np.maximum(centre + moved, 0.0))
    found = []
    for row in drawn.tolist():
        one = {**fit.known, **dict(zip(names, row, strict=True))}
        pair = Pair(*(_set(one, d) for d in "+-"))
        found.append((pair, one.get("inertia") or inertia))
    return tuple(found)


def _set(values: Mapping[str, float], direction: str) -> Lugre[float]:
    return Lugre(*(values.get(name + direction, values.get(name, 0.0)) for name in Lugre._fields))
