"""The parameters as typed tuples: Stribeck's four, LuGre's six, one set per direction, the motor's four.

And how one of them is named. Each tuple is generic over what stands in it: floats, NumPy arrays, or CasADi symbols; a
tuple knows the law whose parameters it holds. Units are SI strings that pint reads.
"""

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
"""Of a joint; in A, V, rad or m: its torque is known as a current, a voltage or a position error alone, in whose unit all
of it is; per inertia: as an acceleration."""


class Direction(StrEnum):
    """Of which motion a parameter is."""

    POSITIVE = "+"
    NEGATIVE = "-"
    BOTH = "both"
    """Of one set for both directions."""
    SHARED = "shared"
    """Of no direction, as an inertia is."""


class Stribeck(NamedTuple, Generic[T]):
    """The static law (9): the parameters of `Lugre` that constant velocities show.

    These four are the paper's; `static_of` has the type of another law, with more fields.
    """

    alpha_0: T
    alpha_1: T
    alpha_2: T
    v_s: T

    @property
    def law(self) -> Law:
        """Whose parameters these are."""
        return GAUSSIAN


class Lugre(NamedTuple, Generic[T]):
    """One set of LuGre parameters, equations (3)-(5). Units for a revolute joint; see `unit` for a prismatic one.

    These six are the paper's; `lugre_of` has the type of another law, with more fields.
    """

    alpha_0: T
    """Coulomb friction, N*m, > 0."""
    alpha_1: T
    """Stribeck amplitude, N*m, >= 0 (the paper calls it stiction; the breakaway level is alpha_0 + alpha_1)."""
    alpha_2: T
    """Viscous friction, N*m*s/rad, >= 0."""
    v_s: T
    """Stribeck velocity, rad/s, > 0."""
    sigma_0: T
    """Bristle stiffness, N*m/rad, > 0."""
    sigma_1: T
    """Bristle damping, N*m*s/rad, >= 0."""

    @property
    def law(self) -> Law:
        """Whose parameters these are."""
        return GAUSSIAN

    @property
    def stribeck(self) -> Stribeck[T]:
        """Its static law."""
        static: Stribeck[T] = static_of(self.law)(*self[:4], *self[6:])
        return static


@cache
def static_of(law: Law) -> type[Stribeck[Any]]:
    """The type of a law's static parameters: `Stribeck`'s four, then what the law has beside them (`Law.more`)."""
    return Stribeck if law == GAUSSIAN else _of_law(Stribeck, law)


@cache
def lugre_of(law: Law) -> type[Lugre[Any]]:
    """The type of a law's parameters: `Lugre`'s six, then what the law has beside them (`Law.more`)."""
    return Lugre if law == GAUSSIAN else _of_law(Lugre, law)


def _of_law(base: type[Any], law: Law) -> type[Any]:
    """A named tuple like `base`, with the fields of a law after its own."""
    named = namedtuple(base.__name__, (*base._fields, *law.more))  # type: ignore[misc]  # fields that are known at run time
    own = {"law": property(lambda _: law), "__reduce__": lambda self: (_restored, (base, law, tuple(self)))}
    return type(base.__name__, (named, base), {"__slots__": (), **own})


def _restored(base: type[Any], law: Law, values: tuple[Any, ...]) -> Any:
    """A tuple of `_of_law`, from what it was written as."""
    return (static_of if base is Stribeck else lugre_of)(law)._make(values)


def fields_of(law: Law) -> tuple[str, ...]:
    """The names of all parameters of a law, in the order of its tuple."""
    return lugre_of(law)._fields


def static_fields_of(law: Law) -> tuple[str, ...]:
    """The same of its static ones."""
    return static_of(law)._fields


def estimated_of(law: Law) -> tuple[str, ...]:
    """Those of `fields_of` that are estimated, which come first: all but `FASTEST`."""
    return tuple(name for name in fields_of(law) if name != FASTEST)


def static_estimated_of(law: Law) -> tuple[str, ...]:
    """The same of the static ones."""
    return tuple(name for name in static_fields_of(law) if name != FASTEST)


def of_shape(name: str) -> bool:
    """Whether a parameter is of a peak's shape beside v_s, and so positive."""
    own = own_parameter(name)
    return own is not None and own.searched[0] > 0


def of_friction(name: str) -> bool:
    """Whether a parameter is of friction: of `Lugre`, or of a law that is known."""
    return name in Lugre._fields or name in friction_names()


def of_curve(name: str) -> bool:
    """Whether a parameter is of friction in sliding: of `Stribeck`, or of a law that is known."""
    return name in Stribeck._fields or name in friction_names()


def of_load(name: str) -> bool:
    """Whether a parameter says how the level rises with load (`law.load_levels`)."""
    return any(name in names for names in LOADS.values())


def without_peak(law: Law) -> dict[str, float]:
    """Of a law whose Stribeck term is not there, or not identifiable: it is zero, at any v_s and of any shape."""
    return {"alpha_1": 0.0, "v_s": 1.0} | {own.name: own.searched[0] for own in law.peak.own}


def peak_parameters(law: Law) -> tuple[str, ...]:
    """The parameters that are not there without a Stribeck term."""
    return ("alpha_1", *law.shape_parameters)


def reserved_names() -> frozenset[str]:
    """Names that a part of a law cannot give its own parameters."""
    return frozenset(_UNITS)


class Pair(NamedTuple, Generic[T]):
    """One LuGre set per direction of motion, as in Table 1 of the paper."""

    positive: Lugre[T]
    negative: Lugre[T]

    @property
    def law(self) -> Law:
        """Of both sets."""
        return self.positive.law


def bends_down(p: Lugre[float] | Stribeck[float]) -> bool:
    """Whether a term of the law is negative: beyond the speeds measured its viscous friction is then held (`law.viscous_rate`)."""
    return any(getattr(p, name) < 0 for name in p.law.coefficients)


def pair_of(numbers: Sequence[T], law: Law = GAUSSIAN) -> Pair[T]:
    """The pair of these numbers, twelve of the paper's law: the inverse of `(*pair.positive, *pair.negative)`."""
    one, count = lugre_of(law), len(fields_of(law))
    return Pair(one(*numbers[:count]), one(*numbers[count : 2 * count]))


SIGNED = (Direction.POSITIVE, Direction.NEGATIVE)  # the two directions of motion


class ParameterName(NamedTuple):
    """Which parameter: alpha_0 of the positive direction prints as alpha_0+, of both, as an inertia, as it is."""

    name: str
    direction: Direction

    @classmethod
    def parse(cls, text: str) -> "ParameterName":
        """The parameter that prints so; friction without a sign is of both directions, all else is shared."""
        if text.endswith(("+", "-")):
            return cls(text[:-1], Direction(text[-1]))
        return cls(text, Direction.BOTH if of_friction(text) else Direction.SHARED)

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: Any) -> Any:
        """In JSON, as it prints: a key or a text."""
        return JsonForm(str, str, cls.parse).__get_pydantic_core_schema__(source, handler)

    def within(self, direction: str) -> str:
        """How it prints where the direction is said already."""
        return self.name if self.direction == direction else str(self)

    def __str__(self) -> str:
        return self.name + (self.direction if self.direction in SIGNED else "")


INERTIA = ParameterName("inertia", Direction.SHARED)


def in_direction(values: Mapping[ParameterName, T], name: str, direction: str) -> T | None:
    """A parameter's value in a direction, or else of both directions, or the shared one; None where there is none."""
    keys = (ParameterName(name, d) for d in (Direction(direction), Direction.BOTH, Direction.SHARED))
    return next((values[key] for key in keys if key in values), None)


def periodic(name: str) -> tuple[str, str, int] | None:
    """Regressor, wave and order of a parameter that repeats, as cogging_sin_4: cogging, sin, 4; else None."""
    parts = _PERIODIC.fullmatch(name)
    return None if parts is None else (parts[1], parts[2], int(parts[3]))


_PERIODIC = re.compile(r"(cogging|ripple)_(sin|cos)_([1-9][0-9]*)")


class Motor(NamedTuple, Generic[T]):
    """The DC motor as seen at the joint, equations (1)-(2)."""

    k_t: T
    """Torque constant, N*m/A, which is also the back-EMF constant, V*s/rad, > 0."""
    R: T
    """Armature resistance, ohm, > 0."""
    L: T
    """Armature inductance, H, >= 0."""
    J: T
    """Combined inertia of rotor and link, kg*m**2, > 0."""


_UNITS = {
    name: (unit, unit.replace("(N*m)", "N").replace("N*m", "N").replace("rad", "m").replace("kg*m**2", "kg"))
    for unit, names in {
        "N*m": "alpha_0 alpha_1 torque offset gravity_sin gravity_cos",
        "N*m*s/rad": "alpha_2 sigma_1 K_d",
        "N*m*s**2/rad**2": "quadratic",
        "N*m/rad": "sigma_0 K_p",
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
"""SI units of parameters and signals, of a revolute joint and of a prismatic one, which has N for N*m and m for rad."""


def unit(name: str, kind: Kind = "revolute") -> str:
    """SI unit of a parameter or signal of a joint, as pint reads it. Raises KeyError for a name that is neither."""
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
    """The same of every parameter and signal, by name."""
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
"""Units of a joint that is known as a position error or per inertia, by what they come from."""


def slides(kind: Kind) -> bool:
    """Whether a joint is prismatic."""
    return kind.startswith("prismatic")


def effort_unit(kind: Kind) -> str:
    """SI unit of a joint's torque: of its own, A, V, that of a position or of an acceleration, or N*m or N."""
    per_inertia = kind.endswith("inertia")
    own = _UNITS["acceleration" if per_inertia else "torque"][slides(kind)]
    return kind.rpartition(" in ")[2] if has_own_unit(kind) and not per_inertia else own


def has_own_unit(kind: Kind) -> bool:
    """Whether the torque of a joint is known as a current, a voltage or a position error alone, or per inertia."""
    return kind not in ("revolute", "prismatic")


def effort(kind: Kind) -> str:
    """What a joint's torque is called: a joint that slides has a force, one without motor constants a current, a voltage or a position error."""
    own = {
        "A": "current",
        "V": "voltage",
        "N": "force",
        "N*m": "torque",
        "rad": "position error",
        "m": "position error",
    }
    return own.get(effort_unit(kind), "deceleration")


def least_of(name: str) -> float:
    """The least value of a parameter, in SI: 0, but -inf for an offset, gravity and a quadratic term, which have a sign."""
    if name in (*Lugre._fields, INERTIA.name, FASTEST) or of_load(name):
        return 0.0
    own = own_parameter(name)
    return -float("inf") if own is None else own.least


_POSITIVE = frozenset({"alpha_0", "v_s", "sigma_0", "inertia", "links", FASTEST})


def is_positive(name: str) -> bool:
    """Whether a parameter cannot be zero: the equations divide by it."""
    return name in _POSITIVE or of_shape(name)


def is_possible(name: str, value: float) -> bool:
    """Whether a joint can have a parameter of this value, in SI: finite, at least `least_of`, and not zero where it `is_positive`."""
    return isfinite(value) and (value > 0 if is_positive(name) else value >= least_of(name))
