"""The numbers of the printed C: what each is called, what it is, its unit, and within which ends the arithmetic is sound."""

from typing import NamedTuple

from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import FASTEST, Law, OwnParameter
from bristle.model.parameters import Lugre, of_load, unit
from bristle.page.wording import PARAMETERS
from bristle.questions.export.artefact import slug
from bristle.questions.export.c_code import escaped
from bristle.questions.export.exported import ExportedJoint

RANGES = {
    "alpha_0": (1e-5, 1e4),
    "alpha_1": (0.0, 1e4),
    "alpha_2": (0.0, 1e4),
    "v_s": (1e-5, 1e3),
    "sigma_0": (1e-1, 1e9),
    "sigma_1": (0.0, 1e4),
    FASTEST: (1e-5, 1e3),
    "share": (0.0, 10.0),
    "inertia": (0.0, 1e4),
    "softness": (1e-6, 1e3),
    "observer_gain": (0.0, 1e4),
    "dead_zone": (0.0, 1e3),
    "leakage": (0.0, 1e3),
    "forgetting": (0.0, 10.0),
    "lower": (1e-3, 1.0),
    "upper": (1.0, 1e3),
    "gamma": (0.0, 1e6),
    "reference_position": (-1e6, 1e6),
    "reference_velocity": (-1e3, 1e3),
    "reference_acceleration": (-1e6, 1e6),
    "position": (-1e6, 1e6),
    "velocity": (-1e3, 1e3),
    "dt": (1e-6, 1.0),
    "motor_torque": (-1e4, 1e4),
    "link_torque": (-1e4, 1e4),
    "link_load": (0.0, 10.0),
    "motor_load": (0.0, 10.0),
    "gear_load": (0.0, 10.0),
    "gear_load_squared": (0.0, 1e3),
}
"""Within which nothing overflows."""
SINGLE_ADAPTING = {
    "alpha_0": (1e-3, 1e3),
    "alpha_1": (0.0, 1e3),
    "sigma_1": (0.0, 1e3),
    "gamma": (0.0, 1e4),
    "observer_gain": (0.0, 1e3),
    "reference_position": (-1e4, 1e4),
    "position": (-1e4, 1e4),
}
"""The same of a compensator that adapts in single precision, where these are narrower: its gradients are squared."""
_WHAT = {
    **PARAMETERS,
    FASTEST: "fastest measured speed: viscous friction with a term below zero is held beyond it",
    "share": "of the friction that is compensated",
    "inertia": "fed forward: times the reference acceleration",
    "softness": "v_0 of the Coulomb compensator",
    "observer_gain": "k of the observer",
    "dead_zone": "a position error below it teaches nothing",
    "leakage": "rate at which gains return to 1",
    "forgetting": "of least squares",
    "lower": "least gain",
    "upper": "largest gain",
    "deflection": "of the model's bristle",
    "reference_position": "where the joint is to be",
    "reference_velocity": "how fast it is to move",
    "reference_acceleration": "for the inertia",
    "position": "measured",
    "velocity": "that drives the model",
    "dt": "since the last step",
    "motor_torque": "that the motor gives",
    "link_torque": "of gravity and links on the joint, minus what holds it: -(gravity_sin sin q + gravity_cos cos q)",
    "link_load": "friction per load of gravity and links",
    "motor_load": "friction per torque of the motor",
    "gear_load": "friction per torque that the gear carries, motor_torque - link_torque",
    "gear_load_squared": "the same per its square",
}
_SECONDS = {"dt": "s", "observer_gain": "1/s", "leakage": "1/s", "forgetting": "1/s"}
_LIKE = {
    "softness": "velocity",
    "dead_zone": "position",
    "deflection": "position",
    "reference_position": "position",
    "reference_velocity": "velocity",
    "reference_acceleration": "acceleration",
    "motor_torque": "torque",
    "link_torque": "torque",
}
_LARGEST = 1e30
"""Of what has no range of its own."""
_STRONGEST = 1e4
"""The coefficient of a term, either way."""


class CField(NamedTuple):
    """A number of a struct."""

    name: str
    unit: str
    what: str
    low: str
    high: str
    shown: str
    """Its range, for a reader."""


def identifier(joint: ExportedJoint) -> str:
    """What a joint's parameters are called in C."""
    return f"bristle_{slug([joint])}"


def range_of(name: str, law: Law = GAUSSIAN) -> tuple[float, float]:
    """Lowest and highest value of a number: of a parameter of this law, or of what has the name in every header."""
    own = _own(name, law)
    if own is None:
        return RANGES.get(stem_of(name), (-_LARGEST, _LARGEST))
    return own.searched if own in law.peak.own else (max(own.least, -_STRONGEST), _STRONGEST)


def _own(name: str, law: Law) -> OwnParameter | None:
    return next((own for own in law.own if own.name == name), None)


def ranges(name: str, law: Law = GAUSSIAN, *, adapts: bool) -> tuple[tuple[float, float], tuple[float, float]]:
    """Lowest and highest value of a number in double precision, and in single."""
    double = range_of(name, law)
    return double, SINGLE_ADAPTING.get(stem_of(name), double) if adapts else double


def c_field(name: str, law: Law = GAUSSIAN, *, adapts: bool) -> CField:
    """A number of a struct, of a compensator that adapts or does not; of a set, with the law whose parameters it has."""
    double, single = ranges(name, law, adapts=adapts)
    low, high = (
        f"BR_C({digits(x)})" if x == y else f"BR_K({digits(x)}, {digits(y)})"
        for x, y in zip(double, single, strict=True)
    )
    shown = "[{:g}, {:g}]".format(*double) + ("" if single == double else " (single [{:g}, {:g}])".format(*single))
    stem, own = stem_of(name), _own(name, law)
    if own is not None:
        part = law.peak if own in law.peak.own else next(term for term in law.terms if term.coefficient == own)
        kind = "shape of the peak" if part is law.peak else "viscous friction"
        return CField(name, escaped(own.units[0]), escaped(f"{kind}: {part.name}"), low, high, shown)
    return CField(name, _unit(name, stem), _meaning(name, stem), low, high, shown)


def stem_of(name: str) -> str:
    """What a number is of a kind: gamma_1 -> gamma, theta_alpha_0 -> theta."""
    return name.split("_", 1)[0] if name.startswith(("gamma_", "theta_", "sensitivity_", "covariance_")) else name


def _unit(name: str, stem: str) -> str:
    if stem in ("gamma", "covariance"):
        return "as docs/compensation.md has it"
    if stem == "inertia":
        return unit("inertia")
    if stem in (*Lugre._fields, FASTEST, "position", "velocity"):
        return unit(stem)
    if of_load(stem):
        return unit(stem)
    if stem == "sensitivity":
        return unit("position")
    return _SECONDS.get(name) or (unit(_LIKE[name]) if name in _LIKE else "1")


def _meaning(name: str, stem: str) -> str:
    rest = name.removeprefix(f"{stem}_")
    by_stem = {
        "gamma": f"learning rate of adapted parameter {rest}",
        "theta": f"gain of {rest}: what it is multiplied by",
        "sensitivity": f"dz / d theta of {rest}",
        "covariance": "P of least squares",
    }
    return by_stem.get(stem) or _WHAT[name]


def digits(value: float) -> str:
    """A number with every digit."""
    return repr(float(value))
