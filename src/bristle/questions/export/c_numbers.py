"""Names, units, meanings and ranges of the numbers in the printed C."""

from typing import NamedTuple

from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import FASTEST, Law, OwnParameter
from bristle.model.parameters import unit
from bristle.page.wording import PARAMETERS
from bristle.questions.export.c_code import escaped
from bristle.questions.export.export import slug
from bristle.questions.export.exported import ExportedJoint

_Range = tuple[float, float]
_AS_DOCUMENTED = "as docs/compensation.md has it"


class _Number(NamedTuple):
    """A number of any header."""

    unit: str
    what: str
    double: _Range = (-1e30, 1e30)  # lowest and highest value without overflow
    single: _Range | None = None  # in single precision with adaptation, which squares gradients, if narrower


_NUMBERS = {
    "alpha_0": _Number(unit("alpha_0"), PARAMETERS["alpha_0"], (1e-5, 1e4), (1e-3, 1e3)),
    "alpha_1": _Number(unit("alpha_1"), PARAMETERS["alpha_1"], (0.0, 1e4), (0.0, 1e3)),
    "alpha_2": _Number(unit("alpha_2"), PARAMETERS["alpha_2"], (0.0, 1e4)),
    "v_s": _Number(unit("v_s"), PARAMETERS["v_s"], (1e-5, 1e3)),
    "sigma_0": _Number(unit("sigma_0"), PARAMETERS["sigma_0"], (1e-1, 1e9)),
    "sigma_1": _Number(unit("sigma_1"), PARAMETERS["sigma_1"], (0.0, 1e4), (0.0, 1e3)),
    FASTEST: _Number(unit(FASTEST), "fastest measured speed: viscous friction with a term below zero is held beyond it", (1e-5, 1e3)),
    "share": _Number("1", "of the friction that is compensated", (0.0, 10.0)),
    "inertia": _Number(unit("inertia"), "fed forward: times the reference acceleration", (0.0, 1e4)),
    "softness": _Number(unit("velocity"), "v_0 of the Coulomb compensator", (1e-6, 1e3)),
    "observer_gain": _Number("1/s", "k of the observer", (0.0, 1e4), (0.0, 1e3)),
    "dead_zone": _Number(unit("position"), "a position error below it teaches nothing", (0.0, 1e3)),
    "leakage": _Number("1/s", "rate at which gains return to 1", (0.0, 1e3)),
    "forgetting": _Number("1/s", "of least squares", (0.0, 10.0)),
    "lower": _Number("1", "least gain", (1e-3, 1.0)),
    "upper": _Number("1", "largest gain", (1.0, 1e3)),
    "gamma": _Number(_AS_DOCUMENTED, "learning rate of adapted parameter {}", (0.0, 1e6), (0.0, 1e4)),
    "theta": _Number("1", "gain of {}: what it is multiplied by"),
    "sensitivity": _Number(unit("position"), "dz / d theta of {}"),
    "covariance": _Number(_AS_DOCUMENTED, "P of least squares"),
    "deflection": _Number(unit("position"), "of the model's bristle"),
    "reference_position": _Number(unit("position"), "where the joint is to be", (-1e6, 1e6), (-1e4, 1e4)),
    "reference_velocity": _Number(unit("velocity"), "how fast it is to move", (-1e3, 1e3)),
    "reference_acceleration": _Number(unit("acceleration"), "for the inertia", (-1e6, 1e6)),
    "position": _Number(unit("position"), "measured", (-1e6, 1e6), (-1e4, 1e4)),
    "velocity": _Number(unit("velocity"), "that drives the model", (-1e3, 1e3)),
    "dt": _Number("s", "since the last step", (1e-6, 1.0)),
    "motor_torque": _Number(unit("torque"), "that the motor gives", (-1e4, 1e4)),
    "link_torque": _Number(
        unit("torque"), "of gravity and links on the joint, minus what holds it: -(gravity_sin sin q + gravity_cos cos q)", (-1e4, 1e4)
    ),
    "link_load": _Number(unit("link_load"), "friction per load of gravity and links", (0.0, 10.0)),
    "motor_load": _Number(unit("motor_load"), "friction per torque of the motor", (0.0, 10.0)),
    "gear_load": _Number(unit("gear_load"), "friction per torque that the gear carries, motor_torque - link_torque", (0.0, 10.0)),
    "gear_load_squared": _Number(unit("gear_load_squared"), "the same per its square", (0.0, 1e3)),
}  # fmt: skip  # by name, or stem of the name
_STRONGEST = 1e4  # largest coefficient of a term


class CField(NamedTuple):
    """A number of a struct."""

    name: str
    unit: str
    what: str
    low: str
    high: str
    shown: str  # its range, for a reader


def identifier(joint: ExportedJoint) -> str:
    """Name of a joint's parameters in C."""
    return f"bristle_{slug([joint])}"


def range_of(name: str, law: Law = GAUSSIAN) -> _Range:
    """Lowest and highest value of a parameter of this law, or of another number."""
    own = _own(name, law)
    if own is None:
        return _NUMBERS[stem_of(name)].double
    return own.searched if own in law.peak.own else (max(own.least, -_STRONGEST), _STRONGEST)


def _own(name: str, law: Law) -> OwnParameter | None:
    return next((own for own in law.own if own.name == name), None)


def ranges(name: str, law: Law = GAUSSIAN, *, adapts: bool) -> tuple[_Range, _Range]:
    """Lowest and highest value of a number in double precision, and in single."""
    double, known = range_of(name, law), _NUMBERS.get(stem_of(name))
    return double, (known and known.single) or double if adapts else double


def c_field(name: str, law: Law = GAUSSIAN, *, adapts: bool) -> CField:
    """A number of a struct, of a compensator that adapts or not; `law`: of a parameter."""
    double, single = ranges(name, law, adapts=adapts)
    low, high = (
        f"BR_C({digits(x)})" if x == y else f"BR_K({digits(x)}, {digits(y)})"
        for x, y in zip(double, single, strict=True)
    )
    shown = "[{:g}, {:g}]".format(*double) + ("" if single == double else " (single [{:g}, {:g}])".format(*single))
    own, stem = _own(name, law), stem_of(name)
    if own is None:
        known = _NUMBERS[stem]
        return CField(name, known.unit, known.what.format(name.removeprefix(f"{stem}_")), low, high, shown)
    of_peak = own in law.peak.own
    part = law.peak if of_peak else next(term for term in law.terms if term.coefficient == own)
    kind = "shape of the peak" if of_peak else "viscous friction"
    return CField(name, escaped(own.units[0]), escaped(f"{kind}: {part.name}"), low, high, shown)


def stem_of(name: str) -> str:
    """Kind of a number: gamma_1 -> gamma, theta_alpha_0 -> theta."""
    return name.split("_", 1)[0] if name.startswith(("gamma_", "theta_", "sensitivity_", "covariance_")) else name


def digits(value: float) -> str:
    """A number with every digit."""
    return repr(float(value))
