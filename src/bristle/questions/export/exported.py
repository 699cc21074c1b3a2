"""What is handed over of an identified joint: one value of each parameter with its interval and source, and what must be said of it.

What the data do not show is filled in only where a target cannot do without it, and is marked as assumed wherever it stands.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from bristle.arrays import Interval, Number
from bristle.data.experiment.load import Experiment
from bristle.diagnostics import Kind, but
from bristle.errors import InputError
from bristle.findings import Finding, in_units
from bristle.identification.fits import Estimate, LawByName
from bristle.identification.known_joint import (
    KnownJoint,
    assumed_damping,
    chosen,
    inertia_of,
    known_joint,
    load_left_out,
    rises_among,
)
from bristle.identification.results import Joint
from bristle.identification.verdict import Trust, verdict
from bristle.model.law import DAMPING_RATIO, is_passive
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import Law
from bristle.model.laws.registry import with_load
from bristle.model.parameters import (
    INERTIA,
    SIGNED,
    Direction,
    Pair,
    ParameterName,
    Stribeck,
    fields_of,
    in_current,
    in_direction,
    is_positive,
    lugre_of,
    of_friction,
    peak_parameters,
    static_fields_of,
    static_of,
    unit,
    units_of,
)
from bristle.model.parameters import Kind as JointKind
from bristle.simulation.joint_loop import fastest_measured

FREQUENCY = 0.5
"""Hz, of the motions along which torques are compared."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportedParameter:
    """One parameter as it is handed over."""

    parameter: ParameterName
    value: float
    unit: str
    standard_error: Number | None
    """None: there is none, as of what is given or assumed."""
    interval: Interval | None
    """95 %."""
    source: str
    """The fit that it comes from, as `static` or `joint`; `given` in the experiment file, or `assumed`."""

    @property
    def assumed(self) -> bool:
        """Whether the data do not show it, and it had to be filled in."""
        return self.source == "assumed"


@dataclass(frozen=True, slots=True, kw_only=True)
class Origin:
    """Where the numbers come from."""

    bristle: str
    """Version that exports."""
    results_sha256: str | None
    """Of the results.json that was exported; None: there is no such file."""
    experiment: str | None
    """Name of the experiment file."""
    logs: Mapping[str, str]
    """SHA-256 of each log, by its name."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportedJoint:
    """One joint as it is handed over. Units are those of a revolute joint; rad stands for m and N*m for N where it slides."""

    name: str
    kind: JointKind
    simulated: bool
    """Whether it was identified from simulated data."""
    trust: Trust
    reason: Finding | None
    """Why not to trust it without care."""
    parameters: tuple[ExportedParameter, ...]
    """The six of each direction (`both`, or + and -), or four where no bristle is known; then what is of no direction, as inertia or offset."""
    inertia: float | None
    """What the joint accelerates, kg*m**2: identified, or declared, with the links of a robot; None: nothing tells it."""
    rotor_inertia: float | None
    """The same without the links of a robot, kg*m**2: what a simulator that has the links takes as armature; None: nothing tells it."""
    law: LawByName = GAUSSIAN
    """Of the friction, without the load, whose coefficients are among the parameters."""
    fastest: float
    """The fastest measured speed, rad/s: up to there the model was identified."""
    said: tuple[Finding, ...]
    """What was assumed, and what of the values is doubtful, beside the reason."""
    origin: Origin

    @property
    def curves(self) -> tuple[Stribeck[float], Stribeck[float]]:
        """Friction vs velocity of both directions, + first. Raises KeyError where a parameter is missing."""
        one = static_of(self.law)
        positive, negative = (self._set(one._fields, d) for d in SIGNED)
        return one(**positive), one(**negative)

    @property
    def pair(self) -> Pair[float]:
        """Both directions, whole. Raises KeyError where the bristle is not known."""
        one = lugre_of(self.law)
        return Pair(*(one(**self._set(one._fields, d)) for d in SIGNED))

    @property
    def quadratic(self) -> float:
        """What multiplies v abs(v) beside the friction of the pair, N*m*s**2/rad**2; 0 where no such term was fitted."""
        return next((x.value for x in self.parameters if x.parameter.name == "quadratic"), 0.0)

    @property
    def rises(self) -> dict[str, float]:
        """The coefficients by which friction rises with load (`law.load_levels`), by name; none where it does not."""
        return rises_among({x.parameter: x.value for x in self.parameters})

    @property
    def law_name(self) -> str:
        """Of the law and the load by which friction rises, as `fit.law` takes it."""
        return with_load(self.law, self.rises)

    def without_load(self) -> "ExportedJoint":
        """The joint for a target that takes it without load: what that leaves out is said."""
        return replace(self, said=(*load_left_out(self.rises, self.kind), *self.said))

    @property
    def has_bristle(self) -> bool:
        """Whether the data show the bristle's stiffness in both directions."""
        rows = {x.parameter: x for x in self.parameters}
        found = [in_direction(rows, "sigma_0", d) for d in SIGNED]
        return all(row is not None and not row.assumed for row in found)

    def _set(self, names: Sequence[str], direction: Direction) -> dict[str, float]:
        rows = {x.parameter: x.value for x in self.parameters}
        found = {name: in_direction(rows, name, direction) for name in names}
        if missing := [name for name, value in found.items() if value is None]:
            raise KeyError(f"{missing[0]}{direction}")
        return {name: value for name, value in found.items() if value is not None}

    def in_newton(self, target: str) -> "ExportedJoint":
        """The joint. Raises InputError where its torque is known as a current alone, which the target does not take."""
        if in_current(self.kind):
            raise InputError(
                f"{self.name}: its torque is known as a current alone, and {target} takes N*m or N; "
                "give motor.torque_constant, identify, and export again"
            )
        return self

    def with_bristle(self, target: str) -> "ExportedJoint":
        """The joint. Raises InputError where no stage shows its bristle's stiffness, without which the target's model is not its own."""
        if not self.has_bristle:
            raise InputError(
                f"{self.name}: sigma_0 is not identified, and {target} holds a LuGre bristle; add a presliding or tracking run "
                "that shows it, or export to c with compensator stribeck, urdf, sdf, isaac, mujoco-frictionloss, json, matlab or latex"
            )
        return self


def exported(joint: Joint, experiment: Experiment | None, origin: Origin) -> ExportedJoint:
    """What is handed over of a joint. Raises InputError where nothing is known of the friction vs velocity in a direction."""
    known = known_joint(joint)
    known.check_law(*SIGNED, remedy="; an export needs ramp, points or tracking runs in both directions")
    J = inertia_of(experiment, joint)
    signed = any(row.parameter.direction in SIGNED for row in chosen(joint) if of_friction(row.parameter.name))
    ways = (Direction.BOTH,) if known.directions == (Direction.BOTH,) and not signed else SIGNED
    sources = {row.parameter: str(row.source) for row in chosen(joint)}
    said: list[Finding] = []
    rows = [row for d in ways for row in _direction(joint, known, d, J, sources, said)]
    rows += _shared(joint, sources)
    said = _of_both(said)
    found = verdict(joint)
    said += _doubts(rows, ways, known.law)
    rotor = inertia_of(experiment, replace(joint, link_inertia=None))
    told = [
        replace(x, message=in_units(x.message, units_of(joint.kind)))
        for x in dict.fromkeys(said)
        if _about(x) != _about(found.reason)
    ]
    return ExportedJoint(
        name=joint.name, kind=joint.kind, simulated=joint.simulated, trust=found.trust, reason=found.reason,
        law=known.law, parameters=tuple(rows), inertia=J, rotor_inertia=rotor,
        fastest=fastest_measured(joint), said=tuple(told), origin=origin,
    )  # fmt: skip  # a list of values


def _about(said: Finding | None) -> tuple[str, str] | None:
    """What a diagnostic says of which direction."""
    return None if said is None else (said.code, str(said.numbers.get("direction", "")))


def _direction(
    joint: Joint,
    known: KnownJoint,
    d: Direction,
    J: float | None,
    sources: Mapping[ParameterName, str],
    said: list[Finding],
) -> Iterator[ExportedParameter]:
    """The parameters of a direction: without those of the bristle where its stiffness is not known. What is assumed is added to `said`."""
    values, missing = known.values(d), known.missing(d)
    if missing_peak := [name for name in peak_parameters(known.law) if name in missing]:
        said.append(Kind.PEAK_TAKEN_AS_NONE(names=tuple(missing_peak), direction=d))
    names = static_fields_of(known.law) if "sigma_0" in missing else fields_of(known.law)
    if "sigma_0" in missing:
        said.append(Kind.EXPORT_WITHOUT_BRISTLE(direction=d))
    elif "sigma_1" in missing:
        values["sigma_1"] = assumed_damping(values["sigma_0"], J) if J else 0.0
        how = Kind.WITH_DAMPING_RATIO(ratio=DAMPING_RATIO, inertia="") if J else Kind.WITHOUT_INERTIA_UNDAMPED()
        of = {"value": values["sigma_1"], "unit": unit("sigma_1", joint.kind), "how": how}
        said.append(Kind.BRISTLE_FILLED(name="sigma_1", direction=d, **of))
    for name in names:
        e = None if name in missing else known.estimate(name, d)
        prior = [x for x in e.warnings if x.code == "prior"] if e is not None else []
        said += prior
        if e is not None and e.value is not None:
            source = "assumed" if prior else in_direction(sources, name, d) or "given"
            yield _estimated(ParameterName(name, d), e.value, e, source)
        else:
            source = "assumed" if name in missing else "given"
            yield ExportedParameter(
                parameter=ParameterName(name, d), value=values[name], unit=unit(name, joint.kind),
                standard_error=None, interval=None, source=source,
            )  # fmt: skip  # a list of values


def _of_both(said: Sequence[Finding]) -> list[Finding]:
    """What is said alike of both directions is said once."""
    together = [(x, but(x, direction=Direction.BOTH)) for x in said]
    twice = Counter(both for _, both in together)
    return [both if twice[both] > 1 else x for x, both in together]


def _shared(joint: Joint, sources: Mapping[ParameterName, str]) -> Iterator[ExportedParameter]:
    """What is of no direction, as far as it has a value."""
    for row in chosen(joint):
        if not of_friction(row.parameter.name) and row.estimate.value is not None:
            name = ParameterName.parse(str(row.parameter))  # which is shared, whatever stage it is from
            yield _estimated(name, row.estimate.value, row.estimate, sources[row.parameter])


def _estimated(name: ParameterName, value: float, e: Estimate, source: str) -> ExportedParameter:
    return ExportedParameter(
        parameter=name, value=value, unit=e.unit, standard_error=e.standard_error, interval=e.interval, source=source
    )


def _doubts(rows: list[ExportedParameter], ways: tuple[Direction, ...], law: Law) -> Iterator[Finding]:
    """Intervals that hold zero, and sets that are not passive."""
    for row in rows:
        if row.interval is not None and row.interval[0] <= 0 <= row.interval[1]:
            name, _ = row.parameter
            if of_friction(name) or name == INERTIA.name:
                kind = Kind.INTERVAL_WITH_ZERO_IMPOSSIBLE if is_positive(name) else Kind.INTERVAL_WITH_ZERO
                yield kind(name=str(row.parameter))
    for d in ways:
        values = {x.parameter.name: x.value for x in rows if x.parameter.direction == d}
        p = lugre_of(law)(**{name: values.get(name, 0.0) for name in fields_of(law)})
        if not is_passive(p):
            least = p.sigma_1 * p.alpha_1 / p.alpha_0
            yield Kind.NOT_PASSIVE(direction=d, alpha_2=p.alpha_2, least=least)
