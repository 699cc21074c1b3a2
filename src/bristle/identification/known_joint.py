"""The estimate to use of each parameter of an identified joint, and what is assumed where data show none."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from math import inf, isclose
from typing import NamedTuple

import numpy as np

from bristle.arrays import Interval
from bristle.data.experiment.load import Experiment
from bristle.errors import InputError
from bristle.findings import CAUTION, Finding
from bristle.identification.fits import Estimate, StaticFit, TrackingFit
from bristle.identification.load_levels import friction_rise
from bristle.identification.results import Joint
from bristle.model import functions
from bristle.model.law import DAMPING_RATIO
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import FASTEST, Law
from bristle.model.laws.registry import friction_names
from bristle.model.parameters import (
    INERTIA,
    SIGNED,
    Direction,
    Lugre,
    Pair,
    ParameterName,
    fields_of,
    in_direction,
    is_positive,
    is_possible,
    least_of,
    lugre_of,
    of_curve,
    of_load,
    static_fields_of,
    unit,
    without_peak,
)
from bristle.model.parameters import Kind as JointKind
from bristle.model.vectorize import evaluate

DEFLECTION = 1e-3  # of the joint's travel: assumed deflection in slow sliding, where nothing shows the stiffness
INERTIAL = 0.1  # of alpha_0: torque of the largest acceleration, where no inertia is known


class Source(StrEnum):
    """The stage of an estimate."""

    STATIC = "static"
    PRESLIDING = "presliding"
    TRACKING = "tracking"
    """The moving runs alone."""
    JOINT = "joint"
    """The moving runs with what the other stages say."""


class Known(NamedTuple):
    """One parameter from one stage."""

    source: Source
    parameter: ParameterName
    estimate: Estimate


def moving_fits(joint: Joint) -> dict[Source, TrackingFit]:
    """The fits of moving runs that exist, by source."""
    fits = {Source.TRACKING: joint.tracking, Source.JOINT: joint.joint_fit}
    return {source: fit for source, fit in fits.items() if fit is not None}


def stage_estimates(joint: Joint) -> Iterator[Known]:
    """Estimates of the static and presliding stages by direction, then the torque constant of a robot."""
    slow = joint.presliding.fits if joint.presliding else {}
    for d in dict.fromkeys((*joint.static, *slow)):
        fit = joint.static[d].parameters if d in joint.static else {}
        yield from (Known(Source.STATIC, ParameterName(name, Direction(d)), e) for name, e in fit.items())
        bristle = {"sigma_0": slow[d].sigma_0, "sigma_1": slow[d].sigma_1} if d in slow else {}
        yield from (Known(Source.PRESLIDING, ParameterName(name, Direction(d)), e) for name, e in bristle.items())
    if joint.torque_constant is not None:
        yield Known(Source.TRACKING, ParameterName("torque_constant", Direction.SHARED), joint.torque_constant)


def moving_estimates(joint: Joint, source: Source) -> Iterator[Known]:
    """Estimates of one fit of moving runs."""
    return (Known(source, name, e) for name, e in moving_fits(joint)[source].parameters.items())


def chosen(joint: Joint) -> tuple[Known, ...]:
    """The estimate to use of each parameter: of the joint fit, else of the moving runs alone, else of its own stage.

    The parameters of one friction curve come from one fit. Ordered by direction, then as in `Lugre`; shared ones last.
    A parameter is without a value only if every stage lacks it.
    """
    moving = [row for source in reversed(moving_fits(joint)) for row in moving_estimates(joint, source)]
    shown = {(row.parameter.name, row.parameter.direction) for row in moving if row.estimate.value is not None}
    curves = {d for name, d in shown if name == "alpha_0"}
    if shown_alone(joint):  # even where it shows sums of parameters alone
        curves |= {row.parameter.direction for row in moving if row.parameter.name == "alpha_0"}
    staged = list(stage_estimates(joint))
    static = {row.parameter.direction for row in staged if row.parameter.name == "alpha_0"}
    # names fitted to the motion, and to points
    fitted = {FASTEST, *(row.parameter.name for row in moving)}
    beside = {row.parameter.name for row in staged if row.source is Source.STATIC and row.estimate.value is not None}
    rows = []
    for row in moving:  # regressors go with their curve
        name, d = row.parameter
        is_of_curve = of_curve(name)
        if (_within(d, curves) if is_of_curve else curves) or not (
            _within(d, static) if is_of_curve else name in beside
        ):
            rows.append(row)
    for row in staged:
        name, d = row.parameter
        of_one = name in fitted and row.source is Source.STATIC
        if not _within(d, curves if of_one else {own for n, own in shown if n == name}):
            rows.append(row)
    best: dict[ParameterName, Known] = {}
    for row in rows:
        before = best.get(row.parameter)
        if before is None or (before.estimate.value is None and row.estimate.value is not None):
            best[row.parameter] = row
    order = {name: k for k, name in enumerate((*Lugre._fields, *sorted(friction_names())))}
    ways = list(Direction)

    def place(row: Known) -> tuple[int, int]:
        return ways.index(row.parameter.direction), order.get(row.parameter.name, len(order))

    return tuple(sorted(best.values(), key=place))


def shown_alone(joint: Joint) -> bool:
    """Whether the moving runs superseded every static fit of them."""
    return bool(joint.static) and all(fit.is_superseded for fit in joint.static.values())


def _within(direction: Direction, known: Collection[Direction]) -> bool:
    """Whether something is known in a direction: there, in `both`, or in each."""
    return bool({direction, Direction.BOTH, Direction.SHARED} & {*known}) or {*known} >= set(SIGNED)


def rises_of(joint: Joint) -> dict[str, float]:
    """Coefficients by which friction rises with load (`law.load_levels`), by name."""
    return rises_among(joint.moving.known if joint.moving is not None else {})


def rises_among(values: Mapping[ParameterName, float]) -> dict[str, float]:
    """Those coefficients among some values; empty where all are zero."""
    rises = {name.name: value for name, value in values.items() if of_load(name.name)}
    return rises if any(rises.values()) else {}


def without_load(joint: Joint) -> tuple[Finding, ...]:
    """A caution for questions that ignore the rise of friction with load."""
    return load_left_out(rises_of(joint), joint.kind)


def load_left_out(rises: Mapping[str, float], kind: JointKind) -> tuple[Finding, ...]:
    """The same for some coefficients of a joint of this kind."""
    if not rises:
        return ()
    rise, of = float(friction_rise(rises, np.ones(1))[0]), unit("torque", kind)
    message = (
        f"Friction rises with load in the fit ({' and '.join(rises)}), by {rise:.3g} {of} under 1 {of}; here the joint is taken without "
        "load."
    )
    return (Finding("load-left-out", CAUTION, message, {"names": tuple(rises), "rise": rise, "unit": of}),)


def value_fits(joint: Joint) -> tuple[StaticFit | TrackingFit, ...]:
    """The fits that the values of `chosen` come from."""
    sources = {row.source for row in chosen(joint) if row.estimate.value is not None}
    if joint.moving is not None and sources & {Source.TRACKING, Source.JOINT}:
        return (joint.moving,)
    return tuple(joint.static.values()) if Source.STATIC in sources else ()


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownJoint:
    """The friction of one joint as one model."""

    name: str
    law: Law = GAUSSIAN
    estimates: Mapping[ParameterName, Estimate]
    given: Mapping[ParameterName, float]  # Fixed by the experiment file
    held: Mapping[ParameterName, float]  # Values at which parameters that the moving runs do not show were held

    @property
    def directions(self) -> tuple[Direction, ...]:
        """`both` for one law, else those of + and - with a known law."""
        law = {d for name, d in (*self.estimates, *self.given) if of_curve(name)}
        ways = (Direction.BOTH,) if law == {Direction.BOTH} else SIGNED
        return tuple(d for d in ways if self.has_law(d))

    def has_law(self, direction: Direction) -> bool:
        """Whether friction vs velocity is known in a direction, with alpha_0 > 0."""
        values = self.values(direction)
        return values.keys() >= set(static_fields_of(self.law)) and values["alpha_0"] > 0

    def check_law(self, *directions: Direction, remedy: str = "") -> None:
        """Raise InputError, ending with a remedy, where friction vs velocity is not known in one of the directions."""
        if unknown := [d for d in directions if not self.has_law(d)]:
            raise InputError(
                f"{self.name}: nothing is known of the friction vs velocity in direction {unknown[0]}{remedy}"
            )

    def estimate(self, name: str, direction: Direction) -> Estimate | None:
        """The estimate of a parameter in a direction; None where no stage looked for it."""
        return in_direction(self.estimates, name, direction)

    def missing(self, direction: Direction) -> tuple[str, ...]:
        """LuGre parameters of a direction that no stage shows and nobody gave."""
        names = (name for name in fields_of(self.law) if in_direction(self.given, name, direction) is None)
        return tuple(name for name in names if (e := self.estimate(name, direction)) is None or e.value is None)

    def values(self, direction: Direction) -> dict[str, float]:
        """LuGre parameters of a direction, SI: estimated, given or held; without a peak as in `without_peak`."""
        fields = fields_of(self.law)
        values = {name: e.value for name in fields if (e := self.estimate(name, direction)) is not None}
        for fixed in (self.given, self.held):
            values |= {n: in_direction(fixed, n, direction) for n in fields if values.get(n) is None}
        if values["alpha_0"] is not None and values["alpha_1"] is None:
            values |= without_peak(self.law)
        fastest = in_direction(self.given, FASTEST, direction)
        if fastest is not None:  # points may not go as far as a motion
            values[FASTEST] = max(fastest, values.get(FASTEST) or 0.0)
        return {name: x for name, x in values.items() if x is not None}

    def filled(self, direction: Direction, travel: float, J: float) -> Lugre[float]:
        """A direction's set: unknown sigma_0 by `DEFLECTION` of `travel` (rad), sigma_1 by (15) with J (kg*m**2)."""
        self.check_law(direction)
        values, missing = self.values(direction), self.missing(direction)
        if "sigma_0" in missing:
            values["sigma_0"] = assumed_stiffness(values["alpha_0"], travel)
        if "sigma_1" in missing:
            values["sigma_1"] = assumed_damping(values["sigma_0"], J)
        return lugre_of(self.law)(**values)

    def pair(self, travel: float, J: float) -> Pair[float]:
        """`filled` for both directions."""
        return Pair(*(self.filled(d, travel, J) for d in SIGNED))


def known_joint(joint: Joint) -> KnownJoint:
    """What is known of a joint, without an inertia that may be zero. Raises InputError for impossible values."""
    known = as_identified(joint)
    links = {} if joint.link_inertia is None else {INERTIA: joint.link_inertia}  # a rotor's may be lost in their error
    for name, own in known.estimates.items():
        low, high = own.interval or (0.0, 0.0)  # static fits have an inertia in `both`
        if name.name == INERTIA.name and not links and low <= (own.value or 0.0) < 0 < high:
            known = replace(known, estimates={n: e for n, e in known.estimates.items() if n != name})
    faults = [fault_of(name, value) for name, value in (*known.given.items(), *known.held.items())]
    for name, e in known.estimates.items():
        if e.value is not None and (name.name != "alpha_0" or e.value != 0):  # at 0 `has_law` is False
            inside = None if name in links else e.interval
            faults.append(fault_of(name, e.value + links.get(name, 0.0), e.unit, inside))
    if any(faults):
        raise InputError(
            f"{joint.name}: {next(filter(None, faults))}: look at its fit in the report, and identify it from runs that show it"
        )
    return known


def fault_of(name: ParameterName, value: float, si: str = "", interval: Interval | None = None) -> str | None:
    """Why a value is impossible for a joint, or outside its own 95 % interval; None if it is fine."""
    low, high = interval or (-inf, inf)
    got = f"got {name} = {f'{value:g} {si}'.strip()}"
    if not is_possible(name.name, value):
        return f"{got}; expected {'more than 0' if is_positive(name.name) else f'at least {least_of(name.name):g}'}"
    outside = (value < low and not isclose(value, low)) or (value > high and not isclose(value, high))
    return f"{got}; expected a value within its own interval, {low:g} to {high:g}" if outside else None


def as_identified(joint: Joint) -> KnownJoint:
    """`known_joint` without its checks, for display."""
    rows, fit = chosen(joint), joint.moving
    shown = fit.parameters if fit is not None else {}
    fixed = fit.fixed if fit is not None else {}
    if fit is not None and shown_alone(joint):
        sums = {n: x for n, x in fit.known.items() if n in shown and of_curve(n.name) and shown[n].value is None}
        fixed = {**sums, **fixed}
    static = {row.parameter for row in rows if row.source is Source.STATIC}
    return KnownJoint(
        name=joint.name, law=joint.law, estimates={row.parameter: row.estimate for row in rows},
        given={name: x for name, x in fixed.items() if name not in shown},
        held={n: x for n, x in fixed.items() if n in shown and n not in static and (n != INERTIA or x > 0)},
    )  # fmt: skip  # a list of values


def whole(joint: Joint) -> KnownJoint:
    """What is known of a joint to compensate. Raises InputError without friction both ways, or a bristle."""
    known = known_joint(joint)
    remedy = "; a compensator needs a tracking run, or ramp and presliding runs in both directions"
    known.check_law(*SIGNED, remedy=remedy)
    if joint.moving is None and (soft := [d for d in SIGNED if "sigma_0" in known.missing(d)]):
        raise InputError(
            f"{joint.name}: nothing is known of the bristle stiffness (sigma_0) in direction {soft[0]}{remedy}"
        )
    return known


def inertia_of(experiment: Experiment | None, joint: Joint) -> float | None:
    """J, kg*m**2: identified, else as the experiment file gives it, plus the links of a robot; None where unknown."""
    every = [row.estimate.value for row in chosen(joint) if row.parameter.name == INERTIA.name]
    every += [fit.known.get(INERTIA) for fit in reversed(moving_fits(joint).values())]
    if experiment is not None:
        told = (experiment.inertia, experiment.coasting.inertia if experiment.coasting else None)
        every += [x.value for x in told if x is not None]
        every += [experiment.motor_constants.at_joint().inertia] if experiment.motor_constants else []
    own = next((J for J in every if J is not None and J > 0), None)
    return own if joint.link_inertia is None else (own or 0.0) + joint.link_inertia


def guessed_inertia(alpha_0: float, acceleration: float) -> float:
    """J where unknown, kg*m**2: its torque at the largest acceleration (rad/s**2) is a share of alpha_0 (N*m)."""
    return INERTIAL * alpha_0 / acceleration


def assumed_stiffness(alpha_0: float, travel: float) -> float:
    """sigma_0 where unknown, N*m/rad: alpha_0 (N*m) bends it by `DEFLECTION` of `travel` (rad)."""
    return alpha_0 / (DEFLECTION * travel)


def assumed_damping(sigma_0: float, J: float) -> float:
    """sigma_1 where unknown, N*m*s/rad, by (15) from sigma_0 (N*m/rad) and J (kg*m**2)."""
    return float(evaluate(functions.presliding_damping_function(), sigma_0, J, DAMPING_RATIO)[0])
