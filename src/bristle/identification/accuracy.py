"""How well the friction of a joint is known, as one number: the 95 % band of its curve over the speeds that were measured."""

import numpy as np

from bristle.arrays import Array
from bristle.errors import InputError
from bristle.identification.curve import curve, known_curve
from bristle.identification.fits import StaticFit, TrackingFit
from bristle.identification.known_joint import chosen, value_fits
from bristle.identification.measured import Measured
from bristle.identification.results import Accuracy, Joint
from bristle.identification.second_opinion import SLOWEST, SecondOpinion, of_motion, of_points
from bristle.identification.systematic import NORMAL
from bristle.identification.verdict import value_warnings
from bristle.model.parameters import SIGNED, ParameterName, in_direction

SPEEDS, LEAST = 60, 0.02
"""Of a motion in each direction: at how many speeds the curve is looked at, the least as a share of the greatest."""
BIASED = 1.5
"""Times what the errors tell: filters, counts, settling and the choice of a set-up bend a curve too. Set on one half of the simulated joints of
`benchmarks/calibration.py`, so that 93 % of clean curves lie within the band."""
APART = 5.0  # percent of friction: a second opinion that differs by less differs by nothing
WORSE = 2.0  # times what the fit leaves of the torque: an opinion that leaves more is the one that is wrong


def accuracy_of(joint: Joint, measured: Measured, other: float = 0.0) -> Accuracy | None:
    """The band of the curve of an identified joint, beside a second opinion on the same records.

    Where the two differ by more than both errors explain, and by more than 5 % of friction, the difference is part of the
    band: one of them is wrong, and nothing says which, unless one leaves much more of the torque. So is what findings say
    of friction that is not one. `other` is the probability that directions which were chosen one friction for are two, or the
    other way round: between the two, friction differs by the offset. None where no friction vs velocity is known.
    """
    # velocities that were measured: of the points, or a grid over those of a motion in each direction
    fits = value_fits(joint)
    along = np.concatenate([np.zeros(0), *(fit.velocity for fit in fits)])
    if any(isinstance(fit, StaticFit) and fit.segments for fit in fits):
        v = np.unique(along[along != 0])
    else:
        tops = (along.max(initial=0.0), along.min(initial=0.0))
        v = np.concatenate([np.zeros(0), *(np.linspace(LEAST, 1, SPEEDS) * top for top in tops if top)])
    if not v.size:
        return None
    try:
        friction, half = known_curve(joint, v)
    except InputError:  # a number that no joint has
        return None
    v, friction, half = (x[np.isfinite(friction)] for x in (v, friction, half))
    size = _rms(friction)
    if not size:
        return None
    statistical = 100 * BIASED * _rms(np.where(np.isfinite(half), half, np.inf)) / size

    # the second opinion, from what the values come from: points at constant velocity, else moving runs
    apart, points = 0.0, measured.points(hold_out=False)
    if any(isinstance(fit, TrackingFit) for fit in fits) or not points:
        opinion = of_motion(measured.moving(hold_out=False))
    else:
        opinion = of_points(np.array([s.velocity for s in points]), np.array([s.torque for s in points]))
    if opinion is not None:
        differs, explained = _differs(joint, opinion, v)
        worse = opinion.held_out > WORSE * max(fit.relative_error or 0.0 for fit in fits)
        apart = differs if differs > max(explained, APART) and not worse else 0.0
    # between one friction and two lies the offset, or half of what the levels differ by; nothing beside gravity, which an offset is part of
    values = {row.parameter: row.estimate.value or 0.0 for row in chosen(joint)}
    plus, minus = (values.get(ParameterName("alpha_0", d), 0.0) for d in SIGNED)
    gravity = any(name.name == "gravity_cos" for name in values)
    offset = next((x for name, x in values.items() if name.name == "offset"), (plus - minus) / 2)
    sides = 0.0 if gravity else float(100 * NORMAL * np.sqrt(other * (1 - other)) * abs(offset) / size)
    effects = [100 * x.effect["torque"] / size for x in value_warnings(joint) if "torque" in x.effect]
    effects += [100 * _withheld(fit, v) / size for fit in fits if isinstance(fit, TrackingFit)]
    torque = np.concatenate([fit.measured if isinstance(fit, TrackingFit) else fit.torque for fit in fits])
    acting, _ = known_curve(joint, along)
    share = _rms(acting[np.isfinite(acting)]) / (_rms(torque) or 1.0)
    return Accuracy(
        slowest=float(np.abs(v).min()),
        fastest=float(np.abs(v).max()),
        band=float(np.linalg.norm([statistical, apart, sides, *effects])),
        statistical=statistical,
        apart=apart,
        sides=sides,
        share=share,
        opinion=None if opinion is None else ", ".join(opinion.set_up) or "one friction for both directions",
    )


def _withheld(fit: TrackingFit, v: Array) -> float:
    """A peak that is not claimed, and was in the fit, at some velocities, (n,): what the curve lacks of the one that was fitted, N*m, rms.

    One that bends the whole curve is part of it.
    """
    lacks = np.zeros(v.size)
    for d, side in zip(SIGNED, (v > 0, v < 0), strict=True):
        own, claimed = fit.values(d), in_direction(fit.parameters, "alpha_1", d)
        if own is None or claimed is None or claimed.value is not None:
            continue
        if all(why.code != "unseen-shape" for why in claimed.warnings):
            peak = own.stribeck
            lacks[side] = curve(v[side], peak) - curve(v[side], peak._replace(alpha_1=0.0))
    return _rms(lacks)


def _differs(joint: Joint, opinion: SecondOpinion, v: Array) -> tuple[float, float]:
    """By how much the two differ over some velocities, (n,), and what both errors explain of that, percent of friction.

    Where the joint moves both ways, it is half of the difference between the directions: what is alike in both no data tell
    from an offset, or from gravity.
    """
    v = v[(np.abs(v) > SLOWEST * opinion.top) & (np.abs(v) <= opinion.top)]
    (f, half), (other, error) = known_curve(joint, v), opinion.friction(v)
    if v.size and v.min() < 0 < v.max():
        (f_back, half_back), (other_back, error_back) = known_curve(joint, -v), opinion.friction(-v)
        f, other = (f - f_back) / 2, (other - other_back) / 2
        half, error = np.hypot(half, half_back) / 2, np.hypot(error, error_back) / 2
    known, size = np.isfinite(f), _rms(f[np.isfinite(f)]) or np.inf
    return 100 * _rms((f - other)[known]) / size, 100 * _rms(np.hypot(half, NORMAL * error)[known]) / size


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(x**2))) if x.size else 0.0
