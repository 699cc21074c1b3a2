"""The parts of an experiment file: joint, motor, thresholds, fit options, plan; quantities are in SI once validated."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import hypot, inf
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    ModelWrapValidatorHandler,
    PrivateAttr,
    StrictStr,
    ValidationInfo,
    model_validator,
)

from bristle.data import units
from bristle.data.experiment.signals import Context, Gear, Hertz, Seconds, Speed, motor_si, quantity, si
from bristle.data.experiment.yaml_file import StrictModel
from bristle.errors import InputError, check_name, short
from bristle.model.laws.parts import Law
from bristle.model.laws.registry import AUTO, LOADS, PAPER, apart, law_named, own_parameter
from bristle.model.parameters import Kind, Lugre, is_positive, is_possible, of_friction

RunKind = Literal["ramp", "points", "presliding", "tracking"]
Regressor = Literal["inertia", "offset", "gravity", "spring", "quadratic", "links", "cogging", "ripple"]


@dataclass(frozen=True, slots=True, kw_only=True)
class PlusMinus:
    """A quantity in SI, taken as exact, or with a standard error."""

    value: float
    standard_error: float | None = None

    def times(self, factor: float) -> "PlusMinus":
        """The quantity, `factor` times as large."""
        error = self.standard_error
        return PlusMinus(value=factor * self.value, standard_error=None if error is None else factor * error)


_SUREST = 1e-9  # of an inertia: a smaller error is none, and its weight would drown the data in rounding


def read_constant(name: str, *, of_motor: bool = False, is_prior: bool = False) -> BeforeValidator:
    """Validator of `x` (exact) or `x ± s`, each with its unit; outside an experiment file a number is in SI.

    The error of a prior may be larger than its value, but no smaller than `_SUREST` of it.
    """

    def read(value: object, info: ValidationInfo) -> object:
        if isinstance(value, PlusMinus):
            return value
        plain = isinstance(value, int | float) and not isinstance(info.context, Context)
        target = (motor_si if of_motor else si)(name, info.context)
        number, error = (value, None) if plain else units.plus_minus(value, target)
        if not isinstance(number, int | float) or not number > 0:
            raise InputError(f"got {short(value)}; expected {'a positive inertia' if is_prior else 'greater than 0'}")
        if error is not None and is_prior and error < _SUREST * number:
            least = f"an error of at least {_SUREST:g} of the inertia, or none at all"
            raise InputError(f"got {short(value)}; expected {least}")
        if error is not None and not is_prior and not error < number:
            raise InputError(f"got {short(value)}; expected an error that is smaller than the constant")
        return PlusMinus(value=float(number), standard_error=error)

    return BeforeValidator(read)


_FIXABLE = (*Lugre._fields, "inertia", "offset", "gravity_sin", "gravity_cos", "spring", "quadratic", "links")


def read_fixed(value: object, info: ValidationInfo) -> object:
    """Values in SI of `{sigma_1: 0.02 N*m*s/rad, ...}`; a name may end with the sign of a direction."""
    if not isinstance(value, dict):
        raise InputError(f"got {short(value)}; expected names with values, as {{sigma_1: 0.02 N*m*s/rad}}")
    wrong = [name for name in value if _bare(name) not in _FIXABLE and own_parameter(_bare(name)) is None]
    if wrong:
        raise InputError(
            f"got {short(wrong[0])}; expected one of {', '.join(_FIXABLE)}, or what the law has of its own, with + or - for one direction"
        )
    if not isinstance(info.context, Context):
        return value
    found = {}
    for name, x in value.items():  # a number alone where it has no unit
        unit = si(_bare(name), info.context)
        plain = unit == "1" and isinstance(x, int | float) and not isinstance(x, bool)
        found[name] = units.to_si(f"{x} {unit}" if plain else x, unit)
    return found


def _bare(name: object) -> str:
    """The name without the sign of a direction at its end."""
    return str(name)[:-1] if str(name).endswith(("+", "-")) else str(name)


def _physical(fixed: dict[str, float]) -> dict[str, float]:
    """The values. Raises InputError where one has an impossible sign, or is given twice over."""
    for name, value in fixed.items():
        own = own_parameter(_bare(name))
        if own is not None:
            low, high = own.searched if own.searched[1] else (own.least, inf)
            if not low <= value <= high:
                raise InputError(f"{name}: got {value:g}; expected a value from {low:g} to {high:g}")
        if not is_possible(_bare(name), value):
            raise InputError(f"{name}: got {value:g}; expected a value {'>' if is_positive(_bare(name)) else '>='} 0")
        if name != _bare(name) and _bare(name) in fixed:
            expected = "expected either one value for both directions, or + and -"
            raise InputError(f"got both {_bare(name)} and {name}; {expected}")
    return fixed


Shown = Annotated[StrictStr, AfterValidator(lambda text: check_name(text, "the text"))]
"""Text that pages and terminals show as it is."""
Label = Annotated[
    Shown,
    Field(max_length=200),
    BeforeValidator(lambda x: str(x) if isinstance(x, int | float) and not isinstance(x, bool) else x),
]


def _declared_kind(value: object) -> object:
    """A kind that a file can declare; others, such as a torque in A, are found."""
    if value not in ("revolute", "prismatic"):
        raise InputError(f"got {short(value)}; expected 'revolute' or 'prismatic'")
    return value


class JointDescription(StrictModel):
    """Which joint, and whether it turns or slides."""

    name: Annotated[Shown, Field(min_length=1, max_length=200)]
    kind: Annotated[Kind, BeforeValidator(_declared_kind)] = "revolute"


class MotorConstants(StrictModel):
    """Constants of the motor: its own where a gear is declared, else as seen at the joint, gear included."""

    torque_constant: Annotated[PlusMinus, read_constant("k_t", of_motor=True)] | None = None
    resistance: Annotated[PlusMinus, read_constant("R", of_motor=True)] | None = None
    inductance: Annotated[float, quantity("L"), Field(ge=0)] = 0.0
    inertia: Annotated[float, quantity("J", of_motor=True), Field(gt=0)] | None = None
    kp: Annotated[PlusMinus, read_constant("K_p", of_motor=True)] | None = None
    """Gain of the drive on command less position."""
    kd: Annotated[PlusMinus, read_constant("K_d", of_motor=True)] | None = None
    """Gain on velocity command (or 0) less velocity; errs with kp, by the drive's torque constant."""
    torque_limit: Annotated[float, quantity("torque", of_motor=True), Field(gt=0)] | None = None  # of the drive
    gear: Gear | None = None

    def _problems(self) -> Iterator[str]:
        if self.torque_constant is None and self.gear is None and self.kp is None and self.kd is None:
            yield "motor.torque_constant: missing; add this key"
        if self.kp is not None and self.kd is not None and self.kd.standard_error is not None:
            yield "motor.kd: got an error; expected an error of kp alone: a drive's gains err together, by its torque constant"

    def at_joint(self) -> "MotorConstants":
        """The constants without a gear: k_t and a limit times abs(ratio), J and gains times its square."""
        if self.gear is None:
            return self
        ratio = abs(self.gear.ratio)
        by = {"torque_constant": ratio, "kp": ratio**2, "kd": ratio**2}
        at_joint: dict[str, Any] = {
            name: known.times(x) for name, x in by.items() if (known := getattr(self, name)) is not None
        }
        at_joint["torque_limit"] = self.torque_limit and ratio * self.torque_limit
        at_joint["inertia"] = self.inertia and ratio**2 * self.inertia
        return self.model_copy(update={**at_joint, "gear": None})


class Hung(StrictModel):
    """A mass on a joint that turns, in place of the torque of its gravity."""

    mass: Annotated[PlusMinus, read_constant("kg")]
    centre: Annotated[PlusMinus, read_constant("m")]  # how far its centre of mass is from the axis, which is horizontal

    @property
    def torque(self) -> PlusMinus:
        """Torque of its gravity a quarter turn from where it hangs, m g l, N*m; both errors are independent."""
        parts = [x.standard_error / x.value for x in (self.mass, self.centre) if x.standard_error]
        size = self.mass.value * GRAVITY * self.centre.value
        return PlusMinus(value=size, standard_error=size * hypot(*parts) if parts else None)


GRAVITY = 9.81  # m/s**2
Gravity = Annotated[
    PlusMinus,
    read_constant("torque"),
    BeforeValidator(lambda x, info: Hung.model_validate(x, context=info.context).torque if isinstance(x, dict) else x),
]
"""Torque of a joint's gravity a quarter turn from where it hangs, m g l, or the mass and the centre that make it."""


class Coasting(StrictModel):
    """Of a joint that nothing but gravity and inertia drives, of which at most one is known."""

    gravity: Gravity | None = None
    inertia: Annotated[PlusMinus, read_constant("inertia")] | None = None

    def _problems(self) -> Iterator[str]:
        if self.gravity is not None and self.inertia is not None:
            yield "got gravity and inertia; expected one of them: the other comes out"

    @property
    def made_of(self) -> Literal["gravity", "inertia"]:
        """The quantity from which the torque is computed; the inertia, of 1, where nothing is known."""
        return "inertia" if self.gravity is None else "gravity"

    @property
    def known(self) -> PlusMinus | None:
        """Value of the known quantity; None where nothing is known."""
        return self.gravity or self.inertia


def read_rows(value: object) -> object:
    """First and last row of `12` or `12-40`."""
    if isinstance(value, tuple):
        return value
    ends = str(value).split("-") if isinstance(value, int | str) and not isinstance(value, bool) else []
    if len(ends) not in {1, 2} or not all(end.strip().isdecimal() and len(end) < 12 for end in ends):
        raise InputError(f"got {short(value)}; expected a row such as 12, or rows such as 12-40")
    first, last = int(ends[0]), int(ends[-1])
    if last < first:
        raise InputError(f"got {short(value)}; expected the first row before the last")
    return first, last


class ExcludedRows(StrictModel):
    """Points or segments that are not fitted."""

    file: Annotated[StrictStr, Field(min_length=1, max_length=4096)]  # as `bristle inspect` prints it
    rows: Annotated[tuple[int, int], BeforeValidator(read_rows)]
    """As `bristle inspect` prints them: lines of a text file, else rows of data, from 1; all that they touch are left
    out."""


def read_law(name: str) -> str:
    """The name of a law, or `auto`. Raises InputError where there is none of that name."""
    law, load = apart(name)
    try:
        law_named(law.replace(WITHOUT_PEAK, PAPER))
    except KeyError as error:
        why = f"got {short(name)}; expected {PAPER}, {AUTO}, {WITHOUT_PEAK}, or one of {error.args[0]}"
        raise InputError(f"{why}; a load last, +{' or +'.join(LOADS)}") from None
    if load and law == AUTO:
        raise InputError(f"got {short(name)}; expected {AUTO} alone, which tries the loads as well, or a law by name")
    return name


WITHOUT_PEAK = "coulomb-viscous"  # what `fit.law` takes in a peak's place: Coulomb and viscous friction alone
AS_WRITTEN = "as-written"
GONE = {
    "loss": "points that do not belong to the law of the others are found, left out and named",
    "stray": f"points off the law of the others are left out and named, unless fit.set_up: {AS_WRITTEN}",
    "model": f"the peak is fitted where the data show one, always by fit.set_up: {AS_WRITTEN}, never by fit.law: {WITHOUT_PEAK}",
    "v_s_range": "v_s is searched from a third of the slowest speed to the fastest",
    "grid": "v_s has a grid of 32 values, and is refined from there",
    "plain_grid": "the paper's grid has 500 values of v_s",
    "velocity_cutoff": "the spectra choose the low pass of held speeds",
    "presliding_cutoff": "the spectra choose the low pass of slow loading",
    "moving_above": "the fit of all parameters describes slow motion as well",
    "shared": "fit.directions: symmetric has both directions share all of friction",
    "horizon": "moving runs are fitted whole",
    "predict": "the torque of the measured velocity is predicted, and the bias by encoder counts taken off",
}
"""Keys that `fit` had, and what holds in their place: files that have them are read, and told so."""


PERIODIC = ("cogging", "ripple")
"""Regressors that repeat with the position, each with columns for every one of `fit.orders`."""
_MOST, _HIGHEST = 20, 100_000


def read_orders(value: object) -> object:
    """Sorted orders of `[4, 11]`, or `auto`. Raises InputError of anything else."""
    if value is None or value == AUTO:
        return value
    numbers = value if isinstance(value, list | tuple) else [value]
    for k in numbers:
        if not isinstance(k, int) or isinstance(k, bool) or not 1 <= k <= _HIGHEST:
            raise InputError(f"got {short(k)}; expected {AUTO}, or whole numbers from 1 to {_HIGHEST:_}, as [4, 11]")
    if not 1 <= len(set(numbers)) == len(numbers) <= _MOST:
        raise InputError(f"got {short(value)}; expected {AUTO}, or up to {_MOST} orders, each once, as [4, 11]")
    return tuple(sorted(numbers))


class FitOptions(StrictModel):
    """What the user fixes of the fit; the data decide the rest."""

    set_up: Literal["auto", "as-written"] = "auto"
    """`auto`: the data decide what is not written, which points belong to the law, and whether there is a peak."""
    directions: Literal["auto", "separate", "symmetric"] = "separate"
    """Of friction: `auto` lets the data choose between one set for both, with an offset, and one for each."""
    law: Annotated[StrictStr, AfterValidator(read_law)] = PAPER
    """Of friction: the paper's, the one that the data choose (`auto`), or one by name, as `lorentzian+quadratic`."""
    exclude: Annotated[tuple[ExcludedRows, ...], Field(max_length=1000)] = ()  # points and segments that are left out
    regressors: tuple[Regressor, ...] | None = None
    """None: those that the data ask for; as written, inertia (and offset, if symmetric) for tracking, else none."""
    orders: Annotated[tuple[int, ...] | Literal["auto"] | None, BeforeValidator(read_orders)] = None
    """Of cogging and ripple, periods per turn of the joint, or per metre; None, as `auto`: those that the data show."""
    fixed: Annotated[dict[str, float], BeforeValidator(read_fixed), AfterValidator(_physical)] = Field(
        default_factory=dict
    )
    """Parameters that the fit of all parameters takes as given, by name, a bare one for both directions; SI."""
    breakaway_displacement: Annotated[float, quantity("position"), Field(gt=0)] | None = None
    """Displacement from rest that counts as breakaway, rad; None: where the speed leaves noise and loading behind."""
    position_cutoff: Hertz | None = None
    """Low pass of position before it is differentiated, tracking runs, Hz; None: by each run's spectra."""
    decimation: Annotated[int, Field(ge=1, le=10_000)] | None = None
    """Samples of the slowest moving run per equation; None: as the spectra need."""
    _gone: tuple[str, ...] = PrivateAttr(default=())

    @model_validator(mode="wrap")
    @classmethod
    def _without_gone(cls, value: Any, handler: ModelWrapValidatorHandler["FitOptions"]) -> "FitOptions":
        """Options of a file with keys of earlier versions: what they asked for, where something still does that."""
        if not isinstance(value, dict) or not GONE & value.keys():
            return handler(value)
        kept = {key: x for key, x in value.items() if key not in GONE}
        if value.get("model") == WITHOUT_PEAK:
            kept.setdefault("law", WITHOUT_PEAK)
        if value.get("stray") == "report" or value.get("model") == "stribeck":
            kept.setdefault("set_up", AS_WRITTEN)
        found = handler(kept)
        found._gone = tuple(key for key in value if key in GONE)
        return found

    @property
    def gone(self) -> tuple[str, ...]:
        """Keys of `GONE` that the file has."""
        return self._gone

    @property
    def model(self) -> Literal["auto", "coulomb-viscous", "stribeck"]:
        """Whether the law has a peak: never, always, or where the data show it."""
        if self.law.split("+")[0] == WITHOUT_PEAK:
            return "coulomb-viscous"
        return "stribeck" if self.set_up == AS_WRITTEN else "auto"

    @property
    def drops_strays(self) -> bool:
        """Whether points off the law of the others are left out where they move the curve."""
        return self.set_up != AS_WRITTEN

    @property
    def every(self) -> int:
        """Samples per equation, once the runs are read."""
        return self.decimation or 1

    @property
    def friction(self) -> Law:
        """The law of friction without its load; the paper's before the data chose."""
        return law_named(apart(self.law)[0].replace(WITHOUT_PEAK, PAPER))

    @property
    def load(self) -> tuple[str, ...]:
        """The loads, of `LOADS`, by which its level rises."""
        return apart(self.law)[1]

    def _problems(self) -> Iterator[str]:
        if self.regressors is not None and "offset" in self.regressors and self.directions == "separate":
            yield (
                "fit.regressors: offset cannot be told from the two Coulomb terms of separate directions; leave it out, "
                "or set directions: symmetric"
            )
        if "quadratic" in (self.regressors or ()) and "quadratic" in self.law.split("+"):
            yield f"fit.regressors: quadratic is the same term as that of law: {self.law}, v abs(v); write one of the two"
        repeats = [name for name in PERIODIC if name in (self.regressors or ())]
        if self.orders is not None and not repeats:
            yield "fit.orders: nothing has orders; add cogging or ripple to fit.regressors, or leave it out"


class PidGains(StrictModel):
    """The PID controller (21)."""

    K_p: Annotated[float, quantity("K_p"), Field(gt=0)]
    K_i: Annotated[float, quantity("K_i"), Field(ge=0)] = 0.0
    K_d: Annotated[float, quantity("K_d"), Field(ge=0)] = 0.0
    filter_time: Annotated[float, quantity("time"), Field(ge=0)] = 0.0  # of the derivative, s


Name = Annotated[StrictStr, Field(min_length=1, max_length=40)]
Plain = Annotated[float, Field(allow_inf_nan=True)]  # a number without a unit, which the adaptation itself judges


class AdaptOptions(StrictModel):
    """The compensated loop and its adaptation; what is not given is taken from the joint, with a note."""

    amplitude: Annotated[float, quantity("position"), Field(gt=0)] | None = None  # of the sinusoidal reference, rad
    centre: Annotated[float, quantity("position")] = 0.0
    """The position about which the reference swings, rad; friction may rise with gravity's load there."""
    frequency: Hertz | None = None  # of the reference of the adaptation, Hz; the other experiments have 0.4 of it
    period: Seconds = 1e-3  # of controller, compensator and adaptation, s
    gains: PidGains | None = None
    compensator: Name = "lugre"
    """lugre (by reference velocity), lugre-feedback and lugre-observer can adapt."""
    law: Name | None = None
    step: Name | None = None
    parameters: tuple[Name, ...] | None = None
    gamma: tuple[Plain, ...] | None = None
    """Learning rates, one for each of `parameters`."""
    limits: tuple[Plain, Plain] | None = None
    dead_zone: Plain | None = None  # rad
    leakage: Plain | None = None  # 1/s
    forgetting: Plain | None = None  # 1/s
    start: Annotated[dict[Name, Annotated[float, Field(gt=0, le=100)]], Field(min_length=1)] = Field(
        default_factory=lambda: {"alpha_0": 0.3, "alpha_2": 0.5}
    )
    """Start of the adaptation, as shares of the identified parameters; the paper's Table 2."""

    def _problems(self) -> Iterator[str]:
        wrong = [name for name in self.start if not of_friction(name)]
        if wrong:
            yield f"adapt.start: got {short(wrong[0])}; expected some of {', '.join(Lugre._fields)}"


class TrueSet(StrictModel):
    """The parameters behind simulated data; presliding ones that are not given are nan."""

    alpha_0: Annotated[float, quantity("alpha_0"), Field(gt=0)]
    alpha_1: Annotated[float, quantity("alpha_1"), Field(ge=0)]
    alpha_2: Annotated[float, quantity("alpha_2"), Field(ge=0)]
    v_s: Annotated[float, quantity("v_s"), Field(gt=0)]
    sigma_0: Annotated[float, quantity("sigma_0"), Field(gt=0)] | None = None
    sigma_1: Annotated[float, quantity("sigma_1"), Field(ge=0)] | None = None


class PlanOptions(StrictModel):
    """Limits of `bristle plan`; what is not given comes from the measured runs, with a note."""

    position: tuple[Annotated[float, quantity("position")], Annotated[float, quantity("position")]] | None = None
    """Lowest and highest position, rad."""
    velocity: Speed | None = None  # fastest speed, rad/s
    minimum_velocity: Speed | None = None  # slowest constant speed at which the drive does not stick and slip, rad/s
    acceleration: Annotated[float, quantity("acceleration"), Field(gt=0)] | None = None  # largest, rad/s**2
    torque: Annotated[float, quantity("torque"), Field(gt=0)] | None = None  # largest of the drive, N*m
    time: Seconds | None = None  # all of it, s; None: as long as it takes
    hold: Seconds | None = None  # time over which each constant velocity is averaged, s
    frequency: Hertz | None = None
    """Highest of the tracking motion, Hz; None: 10 Hz, or less where that is too fast to see or write."""
    rate: Annotated[float, quantity("Hz"), Field(gt=0, le=100_000)] = 100.0  # at which the references are written, Hz

    def _problems(self) -> Iterator[str]:
        if self.position is not None and not self.position[0] < self.position[1]:
            yield f"plan.position: got {self.position[0]:g} to {self.position[1]:g}; expected the smaller value first"
        if self.velocity is not None and self.minimum_velocity is not None and self.minimum_velocity >= self.velocity:
            yield f"plan.minimum_velocity: got {self.minimum_velocity:g}; expected less than plan.velocity, {self.velocity:g}"
        if self.rate < 20:
            yield f"plan.rate: got {self.rate:g} Hz; expected at least 20 Hz, four samples of the shortest turn"
        if self.frequency is not None and self.frequency < 0.2:
            yield f"plan.frequency: got {self.frequency:g} Hz; expected at least 0.2 Hz, three periods of a motion"
        if self.frequency is not None and self.rate < 10 * self.frequency:
            yield f"plan.rate: got {self.rate:g} Hz; expected at least {10 * self.frequency:g} Hz, ten samples of a period of plan.frequency"
