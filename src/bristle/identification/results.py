"""What was found out about a joint, as values, of which `results.json` is made; every warning listed singly."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, Annotated, Any, Literal

from bristle.arrays import JsonForm, Number
from bristle.data.constant_velocity.segments import Segment
from bristle.errors import one_line
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
    """One parameter from its own stage and from the moving data."""

    parameter: ParameterName
    stage: str
    """`static`, `presliding` or `experiment file`."""
    stage_value: Number
    stage_error: Number
    tracking_value: float | None
    """From the moving data alone; None where they do not show it."""
    tracking_error: float | None
    joint_value: float | None
    joint_error: float | None
    difference_in_se: float | None
    """(tracking - stage) in combined standard errors."""
    verdict: Finding

    @property
    def subject(self) -> tuple[str, ...]:
        """What its verdict is about."""
        return f"{self.stage} stage and moving runs", str(self.parameter)

    @property
    def differs(self) -> bool:
        """Whether they differ by more than chance."""
        return self.verdict.severity is not Severity.NOTE


NEED = 10.0  # percent of friction, to which it has to be known where nobody asks for more or less


@dataclass(frozen=True, slots=True, kw_only=True)
class Accuracy:
    """How well friction is known over the speeds that were measured: percent of friction, root mean square over these."""

    slowest: Number
    """rad/s, as the next."""
    fastest: Number
    band: Number
    """Half of the 95 % band: what the errors tell and, in quadrature, where the second opinion differs."""
    statistical: Number
    """What the errors of the parameters, and of constants, tell of it; infinite where they tell nothing."""
    apart: Number
    """By which the second opinion differs, where that is more than both errors explain; 0 where it agrees, or there is none."""
    share: Number
    """Of friction in the torque that was fitted, both as a root mean square."""
    opinion: str | None = None
    """The set-up that the second opinion took; None where there is none."""
    sides: Number = 0.0
    """What it adds that directions were chosen one friction, or each its own: between the two lies an offset."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Input:
    """One file that went in."""

    file: str
    sha256: str
    rows: int
    dropped: int
    notes: tuple[Finding, ...] = ()
    labels: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Joint:
    """Everything that was found out about one joint."""

    kind: Kind
    name: str
    static: Mapping[str, StaticFit]
    crosscheck: Mapping[str, Crosscheck]
    presliding: Presliding | None = None
    """None where no presliding run was given."""
    tracking: TrackingFit | None = None
    """All parameters from the moving runs alone; None where there are none."""
    joint_fit: TrackingFit | None = None
    """The same with what the other stages say as priors."""
    consistency: tuple[Consistency, ...] = ()
    accuracy: Accuracy | None = None
    """None where no friction vs velocity is known, and of results that earlier versions wrote."""
    need: float = NEED
    """Percent of friction, to which it has to be known, for its values to be used."""
    models: tuple[Comparison, ...] = ()
    """Friction models side by side, on points and on moving runs, where there are any."""
    laws: Comparison | None = None
    """Friction laws side by side, on the points, or else on the moving runs; None where there are too few for any but the paper's."""
    warnings: tuple[Finding, ...] = ()
    torque_scale: Finding | None = None
    """Which constants between logs and torques have an error, and which are taken as exact; None: there are none, or the data are simulated."""
    travel: float | None = None
    """From the lowest to the highest position, declared under `plan` or measured, rad; None where neither is known."""
    torque_constant: Estimate | None = None
    """N*m/A, as the links of a robot tell it; None where it was not looked for."""
    link_inertia: float | None = None
    """What the joint of a robot accelerates of its links, on average over its runs, kg*m**2; the inertia of its fits is then the rotor's."""
    truth: Mapping[str, LugreByName] = field(default_factory=dict)
    """The true parameters, where the data are simulated."""
    simulated: bool = False
    assumptions: tuple[str, ...] = ()
    settings: Mapping[str, str] = field(default_factory=dict)
    """Thresholds, cut-offs and options in force, as the report states them."""
    inputs: tuple[Input, ...]
    segments: tuple[Segment, ...]

    def __repr__(self) -> str:
        """In a line: what there is, not every number of it."""
        fits = [f"static {d}" for d in self.static]
        fits += [what for what, fit in (("presliding", self.presliding), ("moving runs", self.moving)) if fit]
        return f"Joint({self.name!r}: {', '.join(fits) or 'nothing fitted'})"

    @property
    def law(self) -> Law:
        """Of its friction: one for all its fits."""
        laws = (*(fit.law for fit in self.static.values()), *(fit.law for fit in self._moving_fits()))
        return next(iter(laws), GAUSSIAN)

    @property
    def law_name(self) -> str:
        """Of that law and the load by which friction rises, as `fit.law` takes it."""
        known = self.moving.parameters if self.moving is not None else {}
        return with_load(self.law, {name.name for name in known if of_load(name.name)})

    @property
    def moving(self) -> TrackingFit | None:
        """The fit of moving runs to use: the joint fit where there is one, else that of the moving runs alone, else None."""
        return self.joint_fit or self.tracking

    def _moving_fits(self) -> Iterator[TrackingFit]:
        """That of the moving runs alone, then the joint fit, where there are any."""
        return filter(None, (self.tracking, self.joint_fit))

    def with_subjects(self) -> "Joint":
        """The same, in which each diagnostic knows what it is about, and its units."""
        joint: Joint = with_subjects(self, _SUBJECTS, units_of(self.kind))
        return joint

    @property
    def uncertain_constants(self) -> tuple[str, ...]:
        """The constants whose errors are in the estimates, as they print."""
        scale = self.torque_scale
        return tuple(map(str, scale.numbers["constants"])) if scale and scale.code == "torque-uncertain" else ()

    def fit_warnings(self) -> Iterator[Finding]:
        """Those about the joint, its presliding runs, and each of its fits as a whole."""
        yield from (*self.warnings, *(warning for fit in self.static.values() for warning in fit.warnings))
        if slow := self.presliding:
            yield from (*slow.warnings, *(warning for fit in slow.fits.values() for warning in fit.warnings))
        yield from (warning for fit in self._moving_fits() for warning in fit.warnings)

    def all_warnings(self) -> Iterator[Finding]:
        """Those about the joint, then about each stage, its fits and their estimates; stages that differ; then those about kept segments."""
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
    "static": ("static",),
    "crosscheck": ("cross-check",),
    "presliding": ("presliding",),
    "breakaway": ("breakaway",),
    **{name: ("sigma_0", name) for name in ("printed", "corrected", "edges", "samples")},
    "sigma_1": ("sigma_1",),
    "tracking": ("moving runs",),
    "joint_fit": ("joint fit",),
    "models": ("models",),
    "laws": ("laws",),
}
"""The steps of a diagnostic's subject, by the fields that hold it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WrittenExperiment:
    """An experiment file, or a robot's, as it was read."""

    file: str
    """Its name."""
    folder: str | None
    """Where it stood, from the folder of the results file; null: in the data set that is part of bristle."""
    text: str
    beside: Mapping[str, str] = field(default_factory=dict)
    """SHA-256 of other files that it names, its logs apart, as a URDF."""
    joints: tuple[str, ...]
    """Those that were identified from it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Document:
    """What bristle identified. A bound that is open is "inf" or "-inf"; what these data do not give is null."""

    schema: Literal["bristle-results/3"] = "bristle-results/3"
    bristle: str
    """Version that wrote it."""
    joints: Mapping[str, Joint]
    experiments: tuple[WrittenExperiment, ...] = ()
    """From which the joints were identified, as far as these are files."""
    samples: Mapping[str, Mapping[str, Any]]
    """By joint, and by the way to it, what has an entry per sample; text is the way to what is the same."""


@cache
def adapter() -> "TypeAdapter[Document]":
    """What writes and reads the document; without the fields that are marked as unwritten, which `samples` has."""
    from pydantic import TypeAdapter

    return TypeAdapter(Document)


def first_reason(error: Exception) -> str:
    """What is wrong first with what pydantic read, where so much is not that it takes long to tell."""
    from pydantic import ValidationError

    if not isinstance(error, ValidationError):
        return one_line(str(error), _SHOWN)
    if error.error_count() > _WRONG:
        return f"{error.error_count()} of its entries are wrong or missing"
    first = error.errors(include_url=False, include_context=False, include_input=False)[0]
    where = ".".join(str(part) for part in first["loc"]) or "the file"
    return f"{one_line(where, _SHOWN)}: {one_line(first['msg'], _SHOWN)}"


_WRONG = 1000  # wrong entries of which the first is looked for
_SHOWN = 120  # characters of what is quoted
