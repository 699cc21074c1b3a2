"""Results of a joint, as written to `results.json`."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, Annotated, Any, Literal

from bristle.arrays import JsonForm, Number
from bristle.data.constant_velocity.segments import Segment
from bristle.errors import one_line
from bristle.estimation import levels
from bristle.findings import Finding, Severity, with_subjects
from bristle.identification.comparison import Comparison
from bristle.identification.fits import Crosscheck, Estimate, Presliding, StaticFit, TrackingFit
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import Law
from bristle.model.laws.registry import with_load
from bristle.model.parameters import Kind, Lugre, ParameterName, of_load, units_of

if TYPE_CHECKING:
    from pydantic import TypeAdapter


def _lugre(values: Mapping[str, float]) -> Lugre[float]:
    if set(values) != set(Lugre._fields):
        raise ValueError(f"expected {', '.join(Lugre._fields)}")
    return Lugre(**values)


LugreByName = Annotated[Lugre[float], JsonForm(dict[str, Number], Lugre._asdict, _lugre)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Consistency:
    """One parameter from its own stage and from moving runs."""

    parameter: ParameterName
    stage: str
    """`static`, `presliding` or `experiment file`."""
    stage_value: Number
    stage_error: Number
    tracking_value: float | None
    """Of the moving runs alone; None where they do not show it."""
    tracking_error: float | None
    joint_value: float | None
    joint_error: float | None
    difference_in_se: float | None
    """(tracking - stage) in combined standard errors."""
    verdict: Finding

    @property
    def subject(self) -> tuple[str, ...]:
        """What the verdict is about."""
        return f"{self.stage} stage and moving runs", str(self.parameter)

    @property
    def differs(self) -> bool:
        """Whether they differ by more than chance."""
        return self.verdict.severity is not Severity.NOTE


@dataclass(frozen=True, slots=True, kw_only=True)
class Accuracy:
    """How well friction is known over the measured speeds: percent of friction, root mean square."""

    slowest: Number
    """rad/s."""
    fastest: Number
    """rad/s."""
    band: Number
    """Half of the 95 % band: errors, findings and second opinion in quadrature."""
    statistical: Number
    """From the errors of parameters and constants; infinite where they tell nothing."""
    apart: Number
    """Difference of the second opinion beyond both errors; 0 where there is none."""
    share: Number
    """Friction over fitted torque, both root mean square."""
    opinion: str | None = None
    """Set-up of the second opinion, or None."""
    sides: Number = 0.0
    """Part due to the choice between one friction with an offset and one per direction."""
    constants: Number = 0.0
    """Part of `statistical` due to the errors of constants."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Input:
    """An input file."""

    file: str
    sha256: str
    rows: int
    dropped: int
    notes: tuple[Finding, ...] = ()
    labels: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Joint:
    """Everything identified of one joint."""

    kind: Kind
    name: str
    static: Mapping[str, StaticFit]
    crosscheck: Mapping[str, Crosscheck]
    presliding: Presliding | None = None
    tracking: TrackingFit | None = None
    """From the moving runs alone."""
    joint_fit: TrackingFit | None = None
    """The same with the other stages as priors."""
    consistency: tuple[Consistency, ...] = ()
    accuracy: Accuracy | None = None
    """None where friction vs velocity is unknown."""
    need: float = field(default_factory=lambda: levels.NEED)
    """Accuracy of friction, percent, that the verdict requires."""
    models: tuple[Comparison, ...] = ()
    """Friction models compared, on points and on moving runs."""
    laws: Comparison | None = None
    """Friction laws compared, or None."""
    warnings: tuple[Finding, ...] = ()
    torque_scale: Finding | None = None
    """Constants behind the torque, with their errors; None without any."""
    travel: float | None = None
    """From lowest to highest position, rad."""
    torque_constant: Estimate | None = None
    """N*m/A, estimated from a robot's links."""
    link_inertia: float | None = None
    """Mean inertia of a robot's links at the joint, kg*m**2; the fitted inertia is then the rotor's."""
    truth: Mapping[str, LugreByName] = field(default_factory=dict)
    """True parameters of simulated data."""
    simulated: bool = False
    assumptions: tuple[str, ...] = ()
    settings: Mapping[str, str] = field(default_factory=dict)
    """Options in force, and what was decided."""
    inputs: tuple[Input, ...]
    segments: tuple[Segment, ...]

    def __repr__(self) -> str:
        """One line."""
        fits = [f"static {d}" for d in self.static]
        fits += [what for what, fit in (("presliding", self.presliding), ("moving runs", self.moving)) if fit]
        return f"Joint({self.name!r}: {', '.join(fits) or 'nothing fitted'})"

    @property
    def law(self) -> Law:
        """The friction law that all fits of the joint share."""
        laws = (*(fit.law for fit in self.static.values()), *(fit.law for fit in self._moving_fits()))
        return next(iter(laws), GAUSSIAN)

    @property
    def law_name(self) -> str:
        """The law with the load by which friction rises, as `fit.law` takes it."""
        known = self.moving.parameters if self.moving is not None else {}
        return with_load(self.law, {name.name for name in known if of_load(name.name)})

    @property
    def moving(self) -> TrackingFit | None:
        """The moving fit to use: the joint fit, else that of the moving runs alone."""
        return self.joint_fit or self.tracking

    def _moving_fits(self) -> Iterator[TrackingFit]:
        """The moving runs alone, then the joint fit, where they exist."""
        return filter(None, (self.tracking, self.joint_fit))

    def with_subjects(self) -> "Joint":
        """The same with the subject and units of each finding filled in."""
        joint: Joint = with_subjects(self, _SUBJECTS, units_of(self.kind))
        return joint

    @property
    def uncertain_constants(self) -> tuple[str, ...]:
        """Constants whose errors are in the estimates."""
        scale = self.torque_scale
        return tuple(map(str, scale.numbers["constants"])) if scale and scale.code == "torque-uncertain" else ()

    def fit_warnings(self) -> Iterator[Finding]:
        """Those about the joint and each fit as a whole."""
        yield from (*self.warnings, *(warning for fit in self.static.values() for warning in fit.warnings))
        if slow := self.presliding:
            yield from (*slow.warnings, *(warning for fit in slow.fits.values() for warning in fit.warnings))
        yield from (warning for fit in self._moving_fits() for warning in fit.warnings)

    def all_warnings(self) -> Iterator[Finding]:
        """Those about the joint, each stage with its estimates, differing stages, and kept segments."""
        yield from self.warnings
        for static in self.static.values():
            yield from static.all_warnings()
        if self.presliding:
            yield from (warning for d in self.presliding.fits for warning in self.presliding.warnings_of(d))
            yield from self.presliding.warnings
        for moving in self._moving_fits():
            yield from moving.all_warnings()
        yield from (x.verdict for x in self.consistency if x.differs)
        yield from (warning for s in self.segments for warning in s.warnings)


_SUBJECTS = {
    **{name: (name,) for name in ("static", "presliding", "breakaway", "sigma_0", "sigma_1", "models", "laws")},
    "printed": ("sigma_0", "printed"),
    "crosscheck": ("cross-check",),
    "tracking": ("moving runs",),
    "joint_fit": ("joint fit",),
}
"""Subjects of findings, by the field that holds them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WrittenExperiment:
    """An experiment or robot file as it was read."""

    file: str
    folder: str | None
    """Relative to the results file; null: part of bristle."""
    text: str
    beside: Mapping[str, str] = field(default_factory=dict)
    """SHA-256 of files that it names beside logs, such as a URDF."""
    joints: tuple[str, ...]
    """Identified from it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Document:
    """What bristle identified. An open bound is "inf" or "-inf"; what the data do not give is null."""

    schema: Literal["bristle-results/3"] = "bristle-results/3"
    bristle: str
    """Version."""
    joints: Mapping[str, Joint]
    experiments: tuple[WrittenExperiment, ...] = ()
    samples: Mapping[str, Mapping[str, Any]]
    """Arrays per sample, by joint and path; a text is the path of an equal value."""


@cache
def adapter() -> "TypeAdapter[Document]":
    """Reads and writes the document, without the fields marked as unwritten."""
    from pydantic import TypeAdapter

    return TypeAdapter(Document)


def first_reason(error: Exception) -> str:
    """The first error of pydantic, shortened."""
    from pydantic import ValidationError

    if not isinstance(error, ValidationError):
        return one_line(str(error), _SHOWN)
    if error.error_count() > _WRONG:
        return f"{error.error_count()} of its entries are wrong or missing"
    first = error.errors(include_url=False, include_context=False, include_input=False)[0]
    where = ".".join(str(part) for part in first["loc"]) or "the file"
    return f"{one_line(where, _SHOWN)}: {one_line(first['msg'], _SHOWN)}"


_WRONG = 1000  # errors above which the first is not looked for
_SHOWN = 120  # characters quoted
