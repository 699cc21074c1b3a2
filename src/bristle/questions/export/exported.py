"""An identified joint for export: parameters with interval and source, assumed only where a target needs them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bristle.arrays import Interval, Number
from bristle.data.experiment.load import Experiment
from bristle.errors import InputError
from bristle.findings import CAUTION, NOTE, Finding, in_units
from bristle.findings import in_direction as said_in
from bristle.identification.fits import Estimate, LawByName
from bristle.identification.known_joint import (
    KnownJoint,
    assumed_damping,
    chosen,
    inertia_of,
    known_joint,
    rises_among,
)
from bristle.identification.results import Joint
from bristle.identification.shared_findings import not_passive
from bristle.identification.verdict import Trust, verdict
from bristle.model import parameters
from bristle.model.law import DAMPING_RATIO, is_passive
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import Law
from bristle.model.laws.registry import with_load
from bristle.model.parameters import INERTIA, SIGNED, Direction, Kind, Pair, ParameterName, Stribeck, unit
from bristle.simulation.joint_loop import bristle_filled, fastest_measured

WAYS = dict(zip(Direction, ("positive", "negative", "both", "shared"), strict=True))  # directions in C and MATLAB
FREQUENCY = 0.5  # Hz, of the motions along which torques are compared


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportedParameter:
    """One exported parameter."""

    parameter: ParameterName
    value: float
    unit: str
    standard_error: Number | None  # None of a value that is given or assumed
    interval: Interval | None  # 95 %
    source: str  # a fit, as `static` or `joint`; `given` in the experiment file, or `assumed`

    @property
    def assumed(self) -> bool:
        """Whether it is not identified, and its value is assumed."""
        return self.source == "assumed"


@dataclass(frozen=True, slots=True, kw_only=True)
class Origin:
    """Origin of the numbers."""

    bristle: str  # version that exports
    results_sha256: str | None  # of the results.json, if there is one
    experiment: str | None  # name of the experiment file
    logs: Mapping[str, str]  # SHA-256 of each log, by its name


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportedJoint:
    """One exported joint. Units are those of a revolute joint; rad stands for m and N*m for N where it slides."""

    name: str
    kind: Kind
    simulated: bool  # whether it was identified from simulated data
    trust: Trust
    reason: Finding | None  # why not to trust it without care
    parameters: tuple[ExportedParameter, ...]
    """Six of each direction (`both`, or + and -), four without a bristle; then those of no direction, as inertia."""
    inertia: float | None  # all that the joint accelerates, kg*m**2, with the links of a robot; None: not known
    rotor_inertia: float | None  # without the links of a robot, kg*m**2: the armature of a simulator; None: not known
    law: LawByName = GAUSSIAN  # of the friction without load
    fastest: float  # fastest measured speed, rad/s
    said: tuple[Finding, ...]  # what was assumed, and which values are doubtful, beside the reason
    origin: Origin

    @property
    def curves(self) -> tuple[Stribeck[float], Stribeck[float]]:
        """Friction vs velocity of both directions, + first. Raises KeyError where a parameter is missing."""
        one = parameters.static_of(self.law)
        return self._set(one, Direction.POSITIVE), self._set(one, Direction.NEGATIVE)

    @property
    def pair(self) -> Pair[float]:
        """Both directions. Raises KeyError where the bristle is not known."""
        return Pair(*(self._set(parameters.lugre_of(self.law), d) for d in SIGNED))

    @property
    def quadratic(self) -> float:
        """Coefficient of v abs(v) beside the friction of the pair, N*m*s**2/rad**2; 0 where none was fitted."""
        return next((x.value for x in self.parameters if x.parameter.name == "quadratic"), 0.0)

    @property
    def cogging(self) -> tuple[tuple[float, float, float], ...]:
        """Waves: k, rad per rad (per m where the joint slides), and coefficients of sin(k q) and cos(k q), N*m."""
        found: dict[int, dict[str, float]] = {}
        for x in self.parameters:
            if (of := parameters.periodic(x.parameter.name)) is not None and of[0] == "cogging":
                found.setdefault(of[2], {})[of[1]] = x.value
        turn = 2 * np.pi if parameters.slides(self.kind) else 1.0
        return tuple((k * turn, x.get("sin", 0.0), x.get("cos", 0.0)) for k, x in sorted(found.items()))

    @property
    def cogging_names(self) -> tuple[str, ...]:
        """The parameters of `cogging`."""
        return tuple(x.parameter.name for x in self.parameters if x.parameter.name.startswith("cogging"))

    @property
    def rises(self) -> dict[str, float]:
        """The coefficients by which friction rises with load (`law.load_levels`), by name."""
        return rises_among({x.parameter: x.value for x in self.parameters})

    @property
    def law_name(self) -> str:
        """Name of the law and of the load by which friction rises, as of `fit.law`."""
        return with_load(self.law, self.rises)

    @property
    def has_bristle(self) -> bool:
        """Whether sigma_0 is identified in both directions."""
        rows = {x.parameter: x for x in self.parameters}
        found = [parameters.in_direction(rows, "sigma_0", d) for d in SIGNED]
        return all(row is not None and not row.assumed for row in found)

    def _set(self, of: Any, direction: Direction) -> Any:
        rows = {x.parameter: x.value for x in self.parameters}
        found = {name: parameters.in_direction(rows, name, direction) for name in of._fields}
        if missing := [name for name, value in found.items() if value is None]:
            raise KeyError(f"{missing[0]}{direction}")
        return of(**found)

    def in_newton(self, target: str) -> "ExportedJoint":
        """The joint. Raises InputError where its torque is known in another unit alone."""
        if parameters.has_own_unit(self.kind):
            of, K_t = parameters.effort(self.kind), "motor.torque_constant"
            lacks = {"current": K_t, "voltage": f"{K_t} and motor.resistance", "position error": "motor.kp"}
            raise InputError(
                f"{self.name}: its torque is known as a {of} alone, and {target} takes N*m or N; give "
                f"{lacks.get(of, 'coasting.inertia or coasting.gravity')}, identify, and export again"
            )
        return self

    def with_bristle(self, target: str) -> "ExportedJoint":
        """The joint. Raises InputError where its sigma_0 is not identified."""
        if not self.has_bristle:
            raise InputError(
                f"{self.name}: sigma_0 is not identified, and {target} holds a LuGre bristle; add a presliding or tracking run "
                "that shows it, or export to c with --compensator stribeck, urdf, sdf, isaac, mujoco-frictionloss, json, matlab or latex"
            )
        return self


def exported(joint: Joint, experiment: Experiment | None, origin: Origin) -> ExportedJoint:
    """A joint for export. Raises InputError where no friction vs velocity is known in a direction."""
    known = known_joint(joint)
    known.check_law(*SIGNED, remedy="; an export needs ramp, points or tracking runs in both directions")
    J = inertia_of(experiment, joint)
    signed = any(
        row.parameter.direction in SIGNED for row in chosen(joint) if parameters.of_friction(row.parameter.name)
    )
    ways = (Direction.BOTH,) if known.directions == (Direction.BOTH,) and not signed else SIGNED
    sources = {row.parameter: str(row.source) for row in chosen(joint)}
    rows = []
    for d in ways:  # without the bristle where its stiffness is not known
        values, missing = known.values(d), known.missing(d)
        if "sigma_0" not in missing and "sigma_1" in missing:
            values["sigma_1"] = assumed_damping(values["sigma_0"], J) if J else 0.0
        for name in parameters.static_fields_of(known.law) if "sigma_0" in missing else parameters.fields_of(known.law):
            e = None if name in missing else known.estimate(name, d)
            if e is not None and e.value is not None:
                source = "assumed" if _priors(e) else parameters.in_direction(sources, name, d) or "given"
            else:
                e = Estimate(value=values[name], unit=unit(name, joint.kind))
                source = "assumed" if name in missing else "given"
            rows.append(_exported(ParameterName(name, d), e, source))
    said = _assumed(known, ways, rows, joint.kind, J)
    for row in chosen(joint):  # without a direction
        if not parameters.of_friction(row.parameter.name) and row.estimate.value is not None:
            shared = ParameterName.parse(str(row.parameter))
            rows.append(_exported(shared, row.estimate, sources[row.parameter]))
    found = verdict(joint)
    said += _doubts(rows, ways, known.law)
    rotor = inertia_of(experiment, replace(joint, link_inertia=None))
    told, units = (x for x in dict.fromkeys(said) if _about(x) != _about(found.reason)), parameters.units_of(joint.kind)
    reason, *whole = (x and replace(x, message=in_units(x.message, units)) for x in (found.reason, *told))
    return ExportedJoint(
        name=joint.name, kind=joint.kind, simulated=joint.simulated, trust=found.trust, reason=reason,
        law=known.law, parameters=tuple(rows), inertia=J, rotor_inertia=rotor,
        fastest=fastest_measured(joint), said=tuple(x for x in whole if x), origin=origin,
    )  # fmt: skip  # a list of values


def _about(said: Finding | None) -> tuple[str, str] | None:
    """Code and direction of a finding."""
    return None if said is None else (said.code, str(said.numbers.get("direction", "")))


def _exported(name: ParameterName, e: Estimate, source: str) -> ExportedParameter:
    return ExportedParameter(
        parameter=name, value=e.value or 0.0, unit=e.unit, standard_error=e.standard_error, interval=e.interval, source=source,
    )  # fmt: skip  # a list of values


def _priors(e: Estimate) -> list[Finding]:
    return [x for x in e.warnings if x.code == "prior"]


def _assumed(
    known: KnownJoint, ways: Sequence[Direction], rows: Sequence[ExportedParameter], kind: Kind, J: float | None
) -> list[Finding]:
    """What was assumed of each direction, once where it is the same of both."""
    first, *others = ([*_assumed_of(known, d, Direction.BOTH, rows, kind, J)] for d in ways)
    if others and first != others[0]:
        return [x for d in ways for x in _assumed_of(known, d, d, rows, kind, J)]
    return first


def _assumed_of(
    known: KnownJoint, d: Direction, named: Direction, rows: Sequence[ExportedParameter], kind: Kind, J: float | None
) -> Iterator[Finding]:
    """What was assumed of direction `d`; `named`: the direction in the message."""
    missing, numbers = known.missing(d), {"direction": named}
    if peak := tuple(name for name in parameters.peak_parameters(known.law) if name in missing):
        taken = "without a Stribeck peak, as alpha_1 = 0"
        if held := known.values(d).get("alpha_1", 0.0):
            taken = f"with alpha_1 = {held:.3g}, as the fit held it: the curve is known, its parts are not"
        message = f"{' and '.join(peak)}{said_in(named)}: not identifiable from these data; exported {taken}."
        yield Finding("peak-taken-as-none", CAUTION, message, {"names": peak, **numbers})
    if "sigma_0" in missing:
        message = (
            f"The bristle (sigma_0, sigma_1){said_in(named)} is not identified, and is not exported; "
            "losses are those of the friction curve."
        )
        yield Finding("export-without-bristle", CAUTION, message, numbers)
    elif "sigma_1" in missing:
        value = next(x.value for x in rows if x.parameter == ParameterName("sigma_1", d))
        ratio = f"from (15) with a damping ratio of {DAMPING_RATIO:g}"
        how = ratio if J else "for no inertia is known, without which (15) gives no damping"
        yield bristle_filled(ParameterName("sigma_1", named), value, kind, how)
    elif e := known.estimate("sigma_1", d):
        yield from _priors(e)


def _doubts(rows: list[ExportedParameter], ways: tuple[Direction, ...], law: Law) -> Iterator[Finding]:
    """Findings on intervals that hold zero, and on sets that are not passive."""
    for row in rows:
        name, _ = row.parameter
        of_model = parameters.of_friction(name) or name == INERTIA.name
        if of_model and row.interval is not None and row.interval[0] <= 0 <= row.interval[1]:
            holds_zero, named = f"{row.parameter}: its 95 % interval holds zero", {"name": str(row.parameter)}
            if parameters.is_positive(name):
                message = f"{holds_zero}, which it cannot be; the exported value may be off by any factor."
                yield Finding("interval-with-zero-impossible", CAUTION, message, named)
            else:
                message = f"{holds_zero}; the value is exported, although the data do not distinguish it from zero."
                yield Finding("interval-with-zero", NOTE, message, named)
    for d in ways:
        values = {x.parameter.name: x.value for x in rows if x.parameter.direction == d}
        p = parameters.lugre_of(law)(**{name: values.get(name, 0.0) for name in parameters.fields_of(law)})
        if not is_passive(p):
            yield not_passive(p, d)
