"""The fitted curve of friction vs velocity, and how far it is known: its 95 % band over the speeds that were measured."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bristle.arrays import Array
from bristle.data.constant_velocity.segments import Segment
from bristle.errors import InputError
from bristle.estimation import levels
from bristle.estimation.autocorrelation import pattern_of
from bristle.estimation.covariance import student
from bristle.identification.fits import StaticFit, TrackingFit
from bristle.identification.known_joint import KnownJoint, Source, as_identified, chosen, known_joint, value_fits
from bristle.identification.measured import Measured
from bristle.identification.results import Accuracy, Joint
from bristle.identification.second_opinion import SecondOpinion, of_motion, of_points
from bristle.identification.verdict import value_warnings
from bristle.model.functions import steady_jacobian_function, steady_torque_function
from bristle.model.parameters import (
    SIGNED,
    Direction,
    ParameterName,
    Stribeck,
    in_direction,
    lugre_of,
    of_curve,
    slides,
)
from bristle.model.vectorize import evaluate

_DRAG = "quadratic"
SPEEDS, LEAST = 60, 0.02  # of a motion, each way: speeds at which the curve is looked at, the least over the greatest


def curve(v: Array, p: Stribeck[float]) -> Array:
    """T_ss(v) of (9), N*m, shape of v."""
    return evaluate(steady_torque_function(p.law), v, *p)[0]


def band(v: Array, fit: StaticFit | TrackingFit, direction: str = "", *, constants: bool = True) -> Array | None:
    """Half-width of the 95 % confidence band of the fitted curve at v, N*m; None where the covariance gives none.

    sqrt(j C j') times Student's t, with j the exact derivative of (9) with respect to the free parameters, by CasADi;
    in quadrature with what the errors of `constants` do to the curve. Of moving runs, in a direction.
    """
    if isinstance(fit, StaticFit):
        p, sides = fit.values(), {fit.direction}
        names = [ParameterName(name, Direction(fit.direction)) for name in fit.names]
        reach = student(fit.degrees_of_freedom) if fit.degrees_of_freedom >= 1 else np.inf
        shifts = {name: fit.parameters[name.name].shifts for name in names if name.name in fit.parameters}
    else:
        lugre, sides, reach = fit.values(direction), {direction, "both"}, levels.NORMAL
        p, names = None if lugre is None else lugre.stribeck, list(fit.names)
        shifts = {name: fit.parameters[name].shifts for name in names if name in fit.parameters}
    keep = [k for k, x in enumerate(names) if (of_curve(x.name) and str(x.direction) in sides) or x.name == _DRAG]
    covariance = fit.covariance[np.ix_(keep, keep)]
    if p is None or not keep or not np.isfinite(covariance).all() or reach == np.inf:
        return None
    columns = dict(zip(p._fields, evaluate(steady_jacobian_function(p.law), v, *p), strict=True))
    columns[_DRAG] = v * np.abs(v)
    j = np.array([columns[names[k].name] for k in keep])
    half = reach * np.sqrt(np.maximum(np.einsum("kn,kl,ln->n", j, covariance, j), 0.0))
    moved = [shifts.get(names[k], {}) if constants else {} for k in keep]
    for constant in dict.fromkeys(c for shift in moved for c in shift):  # all parameters by one constant together
        half = np.hypot(half, levels.NORMAL * np.array([shift.get(constant, 0.0) for shift in moved]) @ j)
    return np.asarray(half)


def friction_of(known: KnownJoint, v: Array) -> Array:
    """Friction (9) and drag of what is known of a joint at some velocities, N*m, of their shape: 0 at rest, nan in a direction without a law."""
    torque = np.where(v == 0, 0.0, np.nan)
    for d, side in zip(SIGNED, (v > 0, v < 0), strict=True):
        if known.has_law(d):
            values = {"sigma_0": 0.0, "sigma_1": 0.0, **known.values(d)}
            torque[side] = curve(v[side], lugre_of(known.law)(**values).stribeck)
    return torque + drag_of(known) * v * np.abs(v)


def drag_of(known: KnownJoint) -> float:
    """What v abs(v) is multiplied by in friction, beside its law, N*m*s**2/rad**2."""
    return sum(e.value or 0.0 for name, e in known.estimates.items() if name.name == _DRAG)


def known_curve(joint: Joint, v: Array, *, constants: bool = True) -> tuple[Array, Array]:
    """`friction_of` an identified joint at some velocities, N*m, and half of its 95 % band (`band`), each (n,).

    Both are nan in a direction of which no law is known, the band where it is not known how far. Raises InputError where a
    number of the joint is none that a joint can have.
    """
    known, rows = known_joint(joint), chosen(joint)
    moving = any(row.source is not Source.STATIC for row in rows if row.parameter.name == "alpha_0")
    half = np.full(v.size, np.nan)
    for d, side in zip(SIGNED, (v > 0, v < 0), strict=True):
        fit = joint.moving if moving else joint.static.get(d) or joint.static.get(Direction.BOTH)
        wide = band(v[side], fit, d, constants=constants) if fit is not None and known.has_law(d) else None
        half[side] = np.nan if wide is None else wide
    return friction_of(known, v), half


def stated_curve(joint: Joint, v: Array) -> tuple[Array, Array]:
    """`known_curve` with half of the band that the accuracy states, the rest of it as a share of friction; infinite where none is known."""
    known = joint.accuracy
    try:
        friction, half = known_curve(joint, v)
    except InputError:  # a number that no joint has
        known, friction, half = None, friction_of(as_identified(joint), v), np.zeros(0)
    if known is None or not np.isfinite(known.statistical):
        return friction, np.full(v.size, np.inf)
    rest = np.sqrt(max(known.band**2 - known.statistical**2, 0.0)) / 100
    return friction, np.hypot(levels.BIASED * half, rest * np.abs(friction))


class FrictionPoints(NamedTuple):
    """Measured friction of one direction, or of both, beside which the values to use are drawn."""

    direction: Direction
    velocity: Array
    """(n,), rad/s."""
    torque: Array
    """The measured torque less the other fitted terms, (n,), N*m."""
    segments: tuple[Segment, ...]
    """Where each point at constant velocity comes from, (n,); empty for a motion."""


def shown_motion(joint: Joint) -> TrackingFit | None:
    """The fit of moving runs that superseded every static fit of them, with its friction; None where there is none."""
    fit = joint.moving
    return (
        fit if fit is not None and fit.friction.size and all(x.is_superseded for x in joint.static.values()) else None
    )


def friction_points(joint: Joint) -> list[FrictionPoints]:
    """The points at constant velocity, else every equation of the moving runs that the values come from, else of those of static fits."""
    known = as_identified(joint)
    if (fit := shown_motion(joint)) is not None:
        v, torque = fit.velocity, fit.friction
        sides = {d: v > 0 if d == "+" else v < 0 if d == "-" else v != 0 for d in known.directions or (Direction.BOTH,)}
        shown = [FrictionPoints(d, v[side], torque[side], ()) for d, side in sides.items()]
    else:
        static = ((Direction(d), x) for d, x in joint.static.items() if d != Direction.SHARED)
        shown = [FrictionPoints(d, x.velocity, x.torque, x.segments) for d, x in static]
    drag = drag_of(known)
    return [x._replace(torque=x.torque + drag * x.velocity * np.abs(x.velocity)) for x in shown]


def tops_of(joint: Joint) -> tuple[float, float]:
    """The fastest speed that was measured in each direction, rad/s; of the other one where a direction was not."""
    along = np.concatenate([np.zeros(0), *(fit.velocity for fit in value_fits(joint))])
    plus, minus = float(along.max(initial=0.0)), -float(along.min(initial=0.0))
    return plus or minus, minus or plus


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
        tops = [top for top in (along.max(initial=0.0), along.min(initial=0.0)) if top]
        # the same both ways, for one range is stated
        least = max((slowest_shown(fits, top) / top for top in tops), default=LEAST)
        v = np.concatenate([np.zeros(0), *(np.linspace(least, 1, SPEEDS) * top for top in tops)])
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
    exact = known_curve(joint, v, constants=False)[1]
    # a pattern that a fit leaves may be friction; errors allow for it, but shrink as a log grows
    left = [
        levels.PATTERN * float(np.sqrt(pattern_of(fit.residuals) / fit.n))
        for fit in fits
        if isinstance(fit, TrackingFit)
    ]
    errors = (levels.BIASED * _rms(np.where(np.isfinite(x), x, np.inf)) for x in (half, exact))
    statistical, alone = (100 * max([x, *left]) / size for x in errors)

    # the second opinion, from what the values come from: points at constant velocity, else moving runs
    apart, points = 0.0, measured.points(hold_out=False)
    if any(isinstance(fit, TrackingFit) for fit in fits) or not points:
        opinion = of_motion(measured.moving(hold_out=False), slides=slides(joint.kind))
    else:
        opinion = of_points(np.array([s.velocity for s in points]), np.array([s.torque for s in points]))
    if opinion is not None:
        differs, explained = _differs(joint, opinion, v)
        worse = opinion.held_out > levels.MUCH_WORSE * max(fit.relative_error or 0.0 for fit in fits)
        apart = differs if differs > max(explained, levels.OPINIONS_APART) and not worse else 0.0
    # between one friction and two lies the offset, or half of what the levels differ by; nothing beside gravity, which an offset is part of
    values = {row.parameter: row.estimate.value or 0.0 for row in chosen(joint)}
    plus, minus = (values.get(ParameterName("alpha_0", d), 0.0) for d in SIGNED)
    gravity = any(name.name == "gravity_cos" for name in values)
    offset = next((x for name, x in values.items() if name.name == "offset"), (plus - minus) / 2)
    sides = 0.0 if gravity else float(100 * levels.NORMAL * np.sqrt(other * (1 - other)) * abs(offset) / size)
    effects = [100 * x.effect["torque"] / size for x in value_warnings(joint) if "torque" in x.effect]
    effects += [100 * _withheld(fit, v) / size for fit in fits if isinstance(fit, TrackingFit)]
    moving = joint.moving  # whose torque has the load, too, where a static fit of it does not
    own = [moving if moving and isinstance(fit, StaticFit) and not fit.segments else fit for fit in fits]
    torque = np.concatenate([fit.measured if isinstance(fit, TrackingFit) else fit.torque for fit in own])
    acting, _ = known_curve(joint, along)
    share = _rms(acting[np.isfinite(acting)]) / (_rms(torque) or 1.0)
    return Accuracy(
        slowest=float(np.abs(v).min()), fastest=float(np.abs(v).max()),
        band=float(np.linalg.norm([statistical, apart, sides, *effects])), statistical=statistical, apart=apart,
        sides=sides, share=share, constants=float(np.sqrt(statistical**2 - alone**2)) if alone < statistical < np.inf else 0.0,
        opinion=None if opinion is None else ", ".join(opinion.set_up) or "one friction for both directions",
    )  # fmt: skip  # a list of values


def slowest_shown(fits: Sequence[StaticFit | TrackingFit], top: float) -> float:
    """The slowest velocity on the way to `top`, rad/s, of which moving runs tell: `LEAST` of it or, where they show no peak, one they stay at.

    Of speeds that a motion passes through from one equation to the next these see a mixture, in which a Stribeck peak is lost.
    """
    seen = np.zeros(0)
    for fit in fits:
        named = ("alpha_1", f"alpha_1{SIGNED[int(top < 0)]}")
        peak = next((e for name, e in fit.parameters.items() if str(name) in named), None)
        if (v := fit.velocity).size > 1 and (peak is None or peak.value is None):
            seen = np.append(seen, v[np.abs(np.gradient(v)) < np.abs(v)] / top)
    return top * float(np.sort(seen[seen > LEAST])[: levels.SLOWEST_SHOWN].max(initial=LEAST))


def _withheld(fit: TrackingFit, v: Array) -> float:
    """What the curve lacks of a peak that was fitted and is not claimed, N*m, rms over velocities (n,); one that bends all of it is part of it."""
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
    """How much the two differ over velocities (n,), and what both errors explain, percent of friction; where it moves both ways, of its odd part."""
    v = v[(np.abs(v) > opinion.slowest) & (np.abs(v) <= opinion.top)]
    (f, half), (other, error) = known_curve(joint, v), opinion.friction(v)
    if v.size and v.min() < 0 < v.max():
        (f_back, half_back), (other_back, error_back) = known_curve(joint, -v), opinion.friction(-v)
        f, other = (f - f_back) / 2, (other - other_back) / 2
        half, error = np.hypot(half, half_back) / 2, np.hypot(error, error_back) / 2
    known, size = np.isfinite(f), _rms(f[np.isfinite(f)]) or np.inf
    return 100 * _rms((f - other)[known]) / size, 100 * _rms(np.hypot(half, levels.NORMAL * error)[known]) / size


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(x**2))) if x.size else 0.0
