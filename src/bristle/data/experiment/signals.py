"""The signals of an experiment file: their columns, units and handling, and the gear between motor and joint."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import AfterValidator, BeforeValidator, Field, StrictInt, StrictStr, ValidationInfo, field_validator

from bristle.data import units
from bristle.data.columns import ISO, Key
from bristle.data.experiment.yaml_file import StrictModel
from bristle.errors import InputError, short
from bristle.estimation import levels
from bristle.model.parameters import Kind, unit

DRIVE = ("torque", "voltage", "current")  # a run has exactly one of them, or commands
COMMANDS = {"command": "position", "velocity_command": "velocity"}
"""Commands of a drive, each in the unit, and on the side of the gear, of the signal that follows it."""
GAINS = {"command": "kp", "velocity_command": "kd"}  # what the drive multiplies each with, less what follows it


def _counted_from_zero(column: int | str) -> int | str:
    if isinstance(column, int) and column < 0:
        raise InputError(f"got {column}; expected a name or a number counted from 0")
    return column


Column = Annotated[StrictInt | StrictStr, AfterValidator(_counted_from_zero)]  # name, or number counted from 0


Side = Literal["motor", "joint"]
SIDED = ("position", "velocity", "torque")  # logged on either side; current and voltage are the motor's
_MOST = 1e6  # turns of one side for a turn of the other; in SI for a prismatic joint the square of it


def _read_ratio(value: object, info: ValidationInfo) -> float:
    """Turns of the motor for one of the joint, `100` or `-100`; prismatic `1256 rad/m`, or its inverse, `5 mm/rev`."""
    most, ratio = _MOST, 0.0
    if getattr(info.context, "kind", "revolute") == "prismatic":
        most = _MOST**2
        try:
            ratio = units.to_si(value, "rad/m")
        except InputError:
            travel = units.to_si(value, "m/rad") if isinstance(value, str) and "/" in value else 0.0
            ratio = 1 / travel if travel else 0.0
    elif isinstance(value, int | float) and not isinstance(value, bool):
        ratio = float(value)
    if not 1 / most <= abs(ratio) <= most:
        raise InputError(
            f"got {short(value)}; expected turns of the motor for one turn of the joint, such as 100, or -100 if they "
            "turn in opposite directions (prismatic joint: with a unit, such as 1256 rad/m or 5 mm/rev)"
        )
    return ratio


class Gear(StrictModel):
    """Ratio of the gear, and the side on which each signal was logged."""

    ratio: Annotated[float, BeforeValidator(_read_ratio)]
    """Angle of the motor over that of the joint, 1, or rad/m; negative where they turn opposite ways."""
    position: Side | None = None
    velocity: Side | None = None
    torque: Side | None = None
    current: Literal["motor"] = "motor"  # current, and voltage, are always the motor's

    def at_motor(self, signal: str) -> bool:
        """Whether a signal was logged on the motor's side."""
        return getattr(self, signal, None) == "motor" or signal == "voltage"

    def to_joint(self, signal: str) -> float:
        """Factor from a signal in SI, as logged, to the joint's: angles 1/ratio, torques ratio.

        Of current and voltage it is the sign of the ratio: with it k_t at the joint, abs(ratio) times the motor's, is
        positive in (6) to (8).
        """
        if not self.at_motor(signal):
            return 1.0
        by = {"position": 1 / self.ratio, "velocity": 1 / self.ratio, "torque": self.ratio}
        return by.get(signal, math.copysign(1.0, self.ratio))


@dataclass(frozen=True, slots=True, kw_only=True)
class Context:
    """What the units of an experiment file depend on."""

    kind: Kind = "revolute"
    resolution: float | None = None
    """Size of one encoder count, rad or m, on the side of the gear that the encoder is on."""
    gear: Gear | None = None

    def kind_of(self, signal: str) -> Kind:
        """Kind of the side where a signal was logged: a motor turns."""
        return "revolute" if self.gear and self.gear.at_motor(signal) else self.kind

    def to_joint(self, signal: str) -> float:
        """Factor from a signal in SI, as logged, to the joint's."""
        return self.gear.to_joint(signal) if self.gear else 1.0


def quantity(name: str, *, of_motor: bool = False) -> BeforeValidator:
    """Validator of a quantity such as `2.1 ohm`, to SI; `name` is a parameter's or signal's, or an SI unit.

    Outside an experiment file (no validation context) a number is in SI.
    """

    def read(value: object, info: ValidationInfo) -> object:
        if not isinstance(info.context, Context) and not isinstance(value, str):
            return value
        return units.to_si(value, (motor_si if of_motor else si)(name, info.context))

    return BeforeValidator(read)


def si(name: str, context: object) -> str:
    """SI unit of a parameter or signal of the joint at hand; an SI unit is returned as it is."""
    try:
        return unit(name, context.kind if isinstance(context, Context) else "revolute")
    except KeyError:
        return name


def motor_si(name: str, context: object) -> str:
    """SI unit of a constant of the motor, or of its encoder; at the joint, unless there is a gear."""
    if not isinstance(context, Context) or context.gear is None:
        return si(name, context)
    return unit(name, context.kind_of("position") if name == "position" else "revolute")


Hertz = Annotated[float, quantity("Hz"), Field(gt=0)]
Seconds = Annotated[float, quantity("s"), Field(gt=0)]
Speed = Annotated[float, quantity("velocity"), Field(gt=0)]


Index = Annotated[StrictInt, Field(ge=0)]  # column of a matrix, or of an array in the names of columns, from 0


def _of_time(text: str) -> str:
    units.factor(text, "s")
    return text


class PlusColumn(StrictModel):
    """A second column of a time, which is added to the first, as nanoseconds to seconds."""

    column: Column
    index: Index | None = None
    unit: Annotated[StrictStr, AfterValidator(_of_time)]


class TimeColumn(StrictModel):
    """Time stamps from a column."""

    column: Column | None = None
    index: Index | None = None
    unit: Annotated[StrictStr, AfterValidator(lambda text: text if text == ISO else _of_time(text))] | None = None
    """Such as s, or `iso` for dates and times of day; None, of one signal's own time: that of the others."""
    plus: PlusColumn | None = None

    def _problems(self) -> Iterator[str]:
        if self.plus is not None and (self.unit == ISO or self.column is None):
            yield "plus: expected it beside a column with a unit such as s: unit iso and a rate have no second column"

    def columns(self) -> tuple[Key, ...]:
        """Its columns: the first, and the one that is added."""
        first = [] if self.column is None else [Key(self.column, self.index, self.unit == ISO)]
        return (*first, *([Key(self.plus.column, self.plus.index)] if self.plus else []))


class Time(TimeColumn):
    """The time of the samples: a column of time stamps, or a constant rate."""

    rate: Hertz | None = None

    def _problems(self) -> Iterator[str]:
        yield from super()._problems()
        if (self.column is None) == (self.rate is None) or (self.column is not None and self.unit is None):
            yield "expected either a column with its unit, as in {column: t, unit: s}, or a rate, as in {rate: 1 kHz}"


def _as_column(value: object) -> object:
    return {"column": value} if isinstance(value, int | str) and not isinstance(value, bool) else value


class Signal(StrictModel):
    """One column: value in SI = logged value times unit times scale, which may have an error for a torque."""

    column: Column  # name, or number counted from 0; in MAT and NPZ files a variable or a dotted path
    index: Index | None = None
    file: Annotated[StrictStr, Field(min_length=1, max_length=4096)] | None = None  # if another than the run's
    time: Annotated[TimeColumn | None, BeforeValidator(_as_column)] = None  # its own, if not logged with the others
    unit: StrictStr
    scale: float | str = 1.0
    delay: Annotated[float, quantity("s")] = 0.0  # by which it was logged later than the others, s; negative: earlier

    def factor(self, name: str, context: Context) -> float:
        """Factor from logged values to SI. Raises InputError where the unit does not fit."""
        name = COMMANDS.get(name, name)
        target = unit(name, context.kind_of(name))
        logged = units.factor(self.unit, target, scale=self.scale, resolution=context.resolution)
        return logged * context.to_joint(name)

    def _problems(self) -> Iterator[str]:
        if self.file is not None and self.time is None:
            yield "file: a signal of another file needs a time of its own; add it, as in time: {column: t, unit: s}"

    @property
    def relative_error(self) -> float | None:
        """Relative standard error of `scale`; None where none is declared."""
        return units.scale_parts(self.scale)[2]


class Position(Signal):
    """A position, which may wrap."""

    wraps: bool | str | None = None
    """True: at each full turn; or at a period such as `360 deg`; None: a jump of a full turn is refused."""

    def period(self, context: Context) -> float | None:
        """Period at which the position wraps, rad or m at the joint; None where it does not.

        Raises InputError where a prismatic joint has no explicit period.
        """
        kind, by = context.kind_of("position"), abs(context.to_joint("position"))
        if isinstance(self.wraps, str):
            period = units.to_si(self.wraps, unit("position", kind))
            if not period > 0:
                raise InputError(f"wraps: got {short(self.wraps)}; expected a positive period such as '360 deg'")
            return period * by
        if self.wraps and kind == "prismatic":
            why = "wraps: true means a full turn, which a prismatic joint does not have"
            raise InputError(f"{why}; give the period, such as wraps: '10 mm'")
        return units.to_si("360 deg", "rad") * by if self.wraps else None


class Command(Signal):
    """A command that a drive follows."""

    held: bool | None = None
    """Whether a drive that is faster than the log holds it between samples; None: assumed not, with a caution."""
    fresh: bool | None = None
    """Whether the drive compares it with measurements of the moment, not of the same age; None: assumed not."""


class Enabled(Signal):
    """Whether the drive is on: rows with 0 are left out, for the motor is open there and its torque unknown."""

    unit: StrictStr = ""

    def factor(self, name: str, context: Context) -> float:  # noqa: ARG002  # a flag has no unit
        """1: a flag has no unit."""
        return 1.0

    def _problems(self) -> Iterator[str]:
        yield from super()._problems()
        if self.unit or self.scale != 1.0 or self.delay:
            yield "got a unit, a scale or a delay; expected a column that is 0 where the drive is off, and not 0 elsewhere"


class Signals(StrictModel):
    """The logged signals: exactly one of torque, voltage and current, or commands."""

    time: Time | None = None
    position: Position | None = None
    velocity: Signal | None = None
    torque: Signal | None = None
    voltage: Signal | None = None
    current: Signal | None = None
    command: Command | None = None
    """Position command; its delay is that of the torque which the drive makes of it."""
    velocity_command: Signal | None = None
    enabled: Annotated[Enabled | None, BeforeValidator(_as_column)] = None

    @field_validator("position", "velocity", *DRIVE, *COMMANDS)
    @classmethod
    def _units_fit(cls, signal: Signal | None, info: ValidationInfo) -> Signal | None:
        if signal is not None and isinstance(info.context, Context):
            signal.factor(str(info.field_name), info.context)
            if info.field_name not in DRIVE and signal.relative_error:
                expected = "no error: only that of torque, voltage or current is followed up"
                raise InputError(f"scale: got {short(str(signal.scale))}; expected {expected}")
            if isinstance(signal, Position):
                signal.period(info.context)
        return signal

    def _problems(self) -> Iterator[str]:
        given = [name for name in DRIVE if getattr(self, name) is not None]
        commands = [name for name in COMMANDS if getattr(self, name) is not None]
        if len(given) > 1 or (given and commands):
            told = " and ".join([*given, *commands])
            yield f"got {told}; expected exactly one of torque, voltage, current, or command and velocity_command"
        if self.velocity_command is not None and self.velocity_command.delay:
            yield "velocity_command: got a delay; expected it under command: it is of the torque that both make"

    def over(self, base: "Signals") -> "Signals":
        """These signals, and those of `base` that they do not replace; a new drive signal replaces any other."""
        given = {name: signal for name, signal in self if signal is not None}
        drives = (*DRIVE, *COMMANDS)
        cleared = dict.fromkeys(drives) if set(drives) & set(given) else {}
        return base.model_copy(update=cleared | given)

    def timed(self) -> "Signals":
        """These signals, with the position's time where there is no other. Raises InputError where it has no unit."""
        own = self.position.time if self.position is not None and self.position.file is None else None
        if self.time is not None or self.position is None or own is None:
            return self
        if own.unit is None:
            why = "signals.position.time: no unit, and no other time"
            raise InputError(f"{why}; give it, as in time: {{column: t, unit: s}}")
        time = Time(**dict(own))
        return self.model_copy(update={"time": time, "position": self.position.model_copy(update={"time": None})})

    def apart(self) -> dict[str, Signal]:
        """The signals with a time of their own, by name."""
        return {name: s for name, s in self if isinstance(s, Signal) and s.time is not None}

    def drive(self) -> str | None:
        """Which of torque, voltage and current is logged, or `command`, of a position, a velocity or both."""
        commands = any(getattr(self, name) is not None for name in COMMANDS)
        return next((name for name in DRIVE if getattr(self, name) is not None), "command" if commands else None)


class Cleaning(StrictModel):
    """Handling of rows that cannot be used; each is counted and reported."""

    non_finite: Literal["drop", "refuse"] = "drop"  # rows with inf, nan or nothing in a signal
    backward: Literal["drop", "refuse"] = "refuse"  # rows with a time stamp before one that was seen
    gap: Annotated[float, Field(gt=1)] = Field(default_factory=lambda: levels.GAP)
    """Gap: an interval longer than this many median ones; nothing is filtered across it."""
    times: Literal["auto", "as-written"] = "auto"
    """Whether uneven samples are brought onto even times, or left."""
