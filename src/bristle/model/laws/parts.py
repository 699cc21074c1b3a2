"""What a friction law is made of: a Stribeck peak, and terms beside viscous friction.

    T_ss(v) = (alpha_0 + alpha_1 s(v; v_s, ...)) sgn(v) + v (alpha_2 + alpha_k r(abs(v)) + ...)

A `Peak` is s, even in v, one at rest and falling to zero; a `ViscousTerm` is r. The parameters that all laws share are those of
`Lugre`; what a peak or a term brings of its own is an `OwnParameter`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt
from typing import Any

Expression = Any  # a float or a CasADi symbol: CasADi carries no types

FASTEST = "v_end"
"""The parameter that a law with terms has beside their coefficients: the fastest speed that was measured, rad/s. It is
given, never estimated."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnParameter:
    """A parameter that not every law has."""

    name: str
    """A Python name, unlike any other parameter's."""
    symbol: str
    """In print, as `alpha_3` is α₃; mathematical text may stand between dollars."""
    units: tuple[str, str]
    """SI, of a revolute and of a prismatic joint, as pint reads them."""
    least: float = 0.0
    """What it may be at least, in SI; -inf where it has a sign."""
    searched: tuple[float, float] = (0.0, 0.0)
    """Of a peak's own, which is nonlinear: between which values it is looked for, both > 0."""

    @property
    def middle(self) -> float:
        """The geometric mean of what is searched: where nothing is known of it."""
        return sqrt(self.searched[0] * self.searched[1])


@dataclass(frozen=True, slots=True, kw_only=True)
class Peak:
    """How the Stribeck term falls with speed."""

    name: str
    """What `fit.law` takes: letters and hyphens."""
    title: str
    """In a sentence: a ... peak."""
    shape: Callable[..., Expression]
    """(v, v_s, *own) -> s, dimensionless: CasADi's operations alone, even in v, 1 at v = 0, falling to 0."""
    own: tuple[OwnParameter, ...] = ()
    """What it has beside v_s, in the order of the arguments."""
    reach: float
    """At so many v_s nine tenths of it are gone."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ViscousTerm:
    """What is added to viscous friction: v times a coefficient times a rate that depends on the speed."""

    name: str
    """What `fit.law` takes after a +: letters and hyphens."""
    title: str
    """What the coefficient multiplies, as v·|v|."""
    coefficient: OwnParameter
    rate: Callable[[Expression], Expression]
    """(abs(v)) -> r, >= 0, rising from 0 at rest: CasADi's operations alone."""


@dataclass(frozen=True, slots=True)
class Law:
    """A peak and the terms beside linear viscous friction."""

    peak: Peak
    terms: tuple[ViscousTerm, ...] = ()

    @property
    def name(self) -> str:
        """As `fit.law` has it: the peak's, then those of the terms, with + between them."""
        return "+".join((self.peak.name, *(term.name for term in self.terms)))

    @property
    def title(self) -> str:
        """In a sentence."""
        beside = " + ".join(("linear", *(term.title for term in self.terms)))
        return f"{self.peak.title} peak, {beside} viscous friction"

    @property
    def shape_parameters(self) -> tuple[str, ...]:
        """The nonlinear parameters, v_s first."""
        return ("v_s", *(own.name for own in self.peak.own))

    @property
    def coefficients(self) -> tuple[str, ...]:
        """The linear parameters beside alpha_0, alpha_1 and alpha_2."""
        return tuple(term.coefficient.name for term in self.terms)

    @property
    def own(self) -> tuple[OwnParameter, ...]:
        """What it has beside the parameters of `Lugre` and `FASTEST`."""
        return (*self.peak.own, *(term.coefficient for term in self.terms))

    @property
    def more(self) -> tuple[str, ...]:
        """The fields that its parameters have after those of every law."""
        return (*(own.name for own in self.own), *((FASTEST,) if self.terms else ()))
