"""Parameters as typed tuples of floats, arrays or CasADi symbols, with names, units and bounds."""

import re
from collections import namedtuple
from collections.abc import Mapping, Sequence
from enum import StrEnum
from functools import cache
from math import isfinite
from typing import Any, Generic, Literal, NamedTuple, TypeVar

from bristle.arrays import JsonForm
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import FASTEST, Law
from bristle.model.laws.registry import LOADS, friction_names, own_parameter

T = TypeVar("T")
Kind = Literal[
    "revolute", "prismatic", "revolute in A", "prismatic in A", "revolute in V", "prismatic in V",
    "revolute in rad", "prismatic in m", "revolute per inertia", "prismatic per inertia",
]  # fmt: skip  # a list of words
"""Of a joint; in A, V, rad or m, or per inertia, where the torque is known in that unit alone."""


class Direction(StrEnum):
    """Direction of motion of a parameter."""

    POSITIVE = "+"
    NEGATIVE = "-"
    BOTH = "both"
    """One set for both directions."""
    SHARED = "shared"
    """No direction, as for an inertia."""


class Stribeck(NamedTuple, Generic[T]):
    """The static law (9); of other laws see `static_of`."""

    alpha_0: T
    alpha_1: T
    alpha_2: T
    v_s: T

    @property
    def law(self) -> Law:
        """The law of these parameters."""
        return GAUSSIAN


class Lugre(NamedTuple, Generic[T]):
    """LuGre parameters, (3)-(5), with units of a revolute joint; for other laws see `lugre_of`."""

    alpha_0: T  #: Coulomb friction, N*m, > 0
    alpha_1: T
    """Stribeck amplitude, N*m, >= 0 (the paper calls it stiction; the breakaway level is alpha_0 + alpha_1)."""
    alpha_2: T  #: Viscous friction, N*m*s/rad, >= 0
    v_s: T  #: Stribeck velocity, rad/s, > 0
    sigma_0: T  #: Bristle stiffness, N*m/rad, > 0
    sigma_1: T  #: Bristle damping, N*m*s/rad, >= 0

    @property
    def law(self) -> Law:
        """The law of these parameters."""
        return GAUSSIAN

    @property
    def stribeck(self) -> Stribeck[T]:
        """The parameters of the steady curve."""
        static: Stribeck[T] = static_of(self.law)(*self[:4], *self[6:])
        return static


@cache
def static_of(law: Law) -> type[Stribeck[Any]]:
    """The type of a law's static parameters: those of `Stribeck`, then `Law.more`."""
    return Stribeck if law == GAUSSIAN else _of_law(Stribeck, law)


@cache
def lugre_of(law: Law) -> type[Lugre[Any]]:
    """The type of a law's parameters: those of `Lugre`, then `Law.more`."""
    return Lugre if law == GAUSSIAN else _of_law(Lugre, law)


def _of_law(base: type[Any], law: Law) -> type[Any]:
    """A named tuple like `base` with a law's fields appended."""
    named = namedtuple(base.__name__, (*base._fields, *law.more))  # type: ignore[misc]  # fields that are known at run time
    own = {"law": property(lambda _: law), "__reduce__": lambda self: (_restored, (base, law, tuple(self)))}
    return type(base.__name__, (named, base), {"__slots__": (), **own})


def _restored(base: type[Any], law: Law, values: tuple[Any, ...]) -> Any:
    """Unpickle a tuple of `_of_law`."""
    return (static_of if base is Stribeck else lugre_of)(law)._make(values)


def fields_of(law: Law) -> tuple[str, ...]:
    """Names of all parameters of a law, in the order of its tuple."""
    return lugre_of(law)._fields


def static_fields_of(law: Law) -> tuple[str, ...]:
    """Names of its static parameters."""
    return static_of(law)._fields


def estimated_of(law: Law) -> tuple[str, ...]:
    """The estimated ones of `fields_of`, which come first: all but `FASTEST`."""
    return tuple(name for name in fields_of(law) if name != FASTEST)


def static_estimated_of(law: Law) -> tuple[str, ...]:
    """The estimated ones of the static parameters."""
    return tuple(name for name in static_fields_of(law) if name != FASTEST)


def of_shape(name: str) -> bool:
    """Whether a parameter is of a peak's shape beside v_s, and so positive."""
    own = own_parameter(name)
    return own is not None and own.searched[0] > 0


def of_friction(name: str) -> bool:
    """Whether a parameter is of friction."""
    return name in Lugre._fields or name in friction_names()


def of_curve(name: str) -> bool:
    """Whether a parameter is of friction in sliding."""
    return name in Stribeck._fields or name in friction_names()


def of_load(name: str) -> bool:
    """Whether a parameter is a coefficient of the load (`law.load_levels`)."""
    return any(name in names for names in LOADS.values())


def without_peak(law: Law) -> dict[str, float]:
    """Values of a Stribeck term that is not there."""
    return {"alpha_1": 0.0, "v_s": 1.0} | {own.name: own.searched[0] for own in law.peak.own}


def peak_parameters(law: Law) -> tuple[str, ...]:
    """Parameters of the Stribeck term."""
    return ("alpha_1", *law.shape_parameters)


def reserved_names() -> frozenset[str]:
    """Names that a part of a law may not use."""
    return frozenset(_UNITS)


class Pair(NamedTuple, Generic[T]):
    """One LuGre set per direction of motion, as in Table 1 of the paper."""

    positive: Lugre[T]
    negative: Lugre[T]

    @property
    def law(self) -> Law:
        """The law of both sets."""
        return self.positive.law


def bends_down(p: Lugre[float] | Stribeck[float]) -> bool:
    """Whether a term of the law is negative, so that viscous friction is held beyond v_end (`law.viscous_rate`)."""
    return any(getattr(p, name) < 0 for name in p.law.coefficients)


def pair_of(numbers: Sequence[T], law: Law = GAUSSIAN) -> Pair[T]:
    """The inverse of `(*pair.positive, *pair.negative)`."""
    one, count = lugre_of(law), len(fields_of(law))
    return Pair(one(*numbers[:count]), one(*numbers[count : 2 * count]))


SIGNED = (Direction.POSITIVE, Direction.NEGATIVE)  # the two directions of motion


class ParameterName(NamedTuple):
    """A parameter and its direction. Prints as alpha_0+, or as alpha_0 if the directions share it."""

    name: str
    direction: Direction

    @classmethod
    def parse(cls, text: str) -> "ParameterName":
        """The inverse of `str`. Without a sign, a friction parameter holds for both directions, any other is shared."""
        if text.endswith(("+", "-")):
            return cls(text[:-1], Direction(text[-1]))
        return cls(text, Direction.BOTH if of_friction(text) else Direction.SHARED)

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: Any) -> Any:
        """In JSON it is the string that it prints as, also as a key."""
        return JsonForm(str, str, cls.parse).__get_pydantic_core_schema__(source, handler)

    def within(self, direction: str) -> str:
        """As printed where `direction` is known from the context: without that sign."""
        return self.name if self.direction == direction else str(self)

    def __str__(self) -> str:
        return self.name + (self.direction if self.direction in SIGNED else "")


INERTIA = ParameterName("inertia", Direction.SHARED)


def in_direction(values: Mapping[ParameterName, T], name: str, direction: str) -> T | None:
    """A parameter's value in a direction, else of both directions, else the shared one, else None."""
    keys = (ParameterName(name, d) for d in (Direction(direction), Direction.BOTH, Direction.SHARED))
    return next((values[key] for key in keys if key in values), None)


def periodic(name: str) -> tuple[str, str, int] | None:
    """Regressor, wave and order of a periodic parameter: cogging_sin_4 is cogging, sin, 4; else None."""
    parts = _PERIODIC.fullmatch(name)
    return None if parts is None else (parts[1], parts[2], int(parts[3]))


_PERIODIC = re.compile(r"(cogging|ripple)_(sin|cos)_([1-9][0-9]*)")


class Motor(NamedTuple, Generic[T]):
    """The DC motor seen at the joint, (1)-(2)."""

    k_t: T  #: Torque constant, N*m/A, which is also the back-EMF constant, V*s/rad, > 0
    R: T  #: Armature resistance, ohm, > 0
    L: T  #: Armature inductance, H, >= 0
    J: T  #: Combined inertia of rotor and link, kg*m**2, > 0


_UNITS = {
    name: (unit, unit.replace("(N*m)", "N").replace("N*m", "N").replace("rad", "m").replace("kg*m**2", "kg"))
    for unit, names in {
        "N*m": "alpha_0 alpha_1 torque offset gravity_sin gravity_cos",
        "N*m*s/rad": "alpha_2 sigma_1 K_d",
        "N*m*s**2/rad**2": "quadratic",
        "N*m/rad": "sigma_0 K_p spring",
        "N*m/(rad*s)": "K_i",
        "N*m/A": "k_t torque_constant",
        "kg*m**2": "J inertia",
        "1": "links link_load motor_load gear_load",
        "1/(N*m)": "gear_load_squared",
        "rad": "position",
        "rad/s": f"v_s {FASTEST} velocity",
        "rad/s**2": "acceleration",
        "s": "time",
        "ohm": "R",
        "H": "L",
        "A": "current",
        "V": "voltage",
    }.items()
    for name in names.split()
}
"""SI units of parameters and signals, revolute and prismatic."""


def unit(name: str, kind: Kind = "revolute") -> str:
    """SI unit of a parameter or signal, as pint reads it. Raises KeyError for other names."""
    name = "torque" if periodic(name) else name
    of_law = None if name in _UNITS else own_parameter(name)
    own = (_UNITS[name] if of_law is None else of_law.units)[slides(kind)]
    if not has_own_unit(kind):
        return own
    torque, effort = _UNITS["torque"][slides(kind)], effort_unit(kind)
    if name == "links":
        return f"{effort}/({torque})"
    if name == "gear_load_squared":
        return f"1/{effort}"
    over = {"kg*m**2": "s**2/rad", "kg": "s**2/m"}.get(own)  # in which a torque is unseen
    told = f"{effort}*{over}" if over else own if own == "ohm" else own.replace(torque, effort, 1)
    return _SHORTER.get(told, told)


def units_of(kind: Kind) -> dict[str, str]:
    """SI units of all parameters and signals, by name."""
    return {name: unit(name, kind) for name in _UNITS}


_SHORTER = {
    f"{one}{of}{own}": told
    for one in ("rad", "m")
    for of, short in {
        "": ("s", "1", "s**2", f"s**2/{one}"),
        "/s**2": ("1/s", "1/s**2", "1", f"1/{one}"),
    }.items()
    for own, told in zip((f"*s/{one}", f"/{one}", f"*s**2/{one}", f"*s**2/{one}**2"), short, strict=True)
}
"""Simplified units of joints with a position error or per inertia."""


def slides(kind: Kind) -> bool:
    """Whether a joint is prismatic."""
    return kind.startswith("prismatic")


def effort_unit(kind: Kind) -> str:
    """Unit of a joint's torque."""
    per_inertia = kind.endswith("inertia")
    own = _UNITS["acceleration" if per_inertia else "torque"][slides(kind)]
    return kind.rpartition(" in ")[2] if has_own_unit(kind) and not per_inertia else own


def has_own_unit(kind: Kind) -> bool:
    """Whether the torque is known as a current, voltage, position error or per inertia alone."""
    return kind not in ("revolute", "prismatic")


def effort(kind: Kind) -> str:
    """What a joint's torque is called: torque, force, current, voltage, position error."""
    error = "position error"
    own = {"A": "current", "V": "voltage", "N": "force", "N*m": "torque", "rad": error, "m": error}
    return own.get(effort_unit(kind), "deceleration")


def least_of(name: str) -> float:
    """Least value of a parameter, SI: 0, or -inf where it has a sign."""
    if name in (*Lugre._fields, INERTIA.name, FASTEST) or of_load(name):
        return 0.0
    own = own_parameter(name)
    return -float("inf") if own is None else own.least


_POSITIVE = frozenset({"alpha_0", "v_s", "sigma_0", "inertia", "links", FASTEST})


def is_positive(name: str) -> bool:
    """Whether a parameter cannot be zero."""
    return name in _POSITIVE or of_shape(name)


def is_possible(name: str, value: float) -> bool:
    """Whether a joint can have this value, SI: finite, at least `least_of`, and not zero where it `is_positive`."""
    return isfinite(value) and (value > 0 if is_positive(name) else value >= least_of(name))
