"""Parts of a friction law: a Stribeck peak s, and terms r beside viscous friction.

T_ss(v) = (alpha_0 + alpha_1 s(v; v_s, ...)) sgn(v) + v (alpha_2 + alpha_k r(abs(v)) + ...).
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt
from typing import Any

Expression = Any  # a float or a CasADi symbol: CasADi carries no types

FASTEST = "v_end"  # parameter of laws with terms: the fastest measured speed, rad/s, given and never estimated


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnParameter:
    """A parameter of some laws alone."""

    name: str  #: A Python name, unlike any other parameter's
    symbol: str  #: In print, such as α₃; mathematical text may stand between dollars
    units: tuple[str, str]  #: SI, revolute and prismatic, as pint reads them
    least: float = 0.0  #: Least value, SI; -inf where it has a sign
    searched: tuple[float, float] = (0.0, 0.0)  #: Search range of a peak's parameter, both > 0

    @property
    def middle(self) -> float:
        """Geometric mean of the search range."""
        return sqrt(self.searched[0] * self.searched[1])


@dataclass(frozen=True, slots=True, kw_only=True)
class Peak:
    """The fall of the Stribeck term with speed."""

    name: str  #: In `fit.law`: letters and hyphens
    title: str  #: In a sentence: a ... peak
    shape: Callable[..., Expression]
    """(v, v_s, *own) -> s, dimensionless: CasADi's operations alone, even in v, 1 at v = 0, falling to 0."""
    own: tuple[OwnParameter, ...] = ()  #: Parameters beside v_s, in the order of the arguments
    reach: float  #: Multiple of v_s at which nine tenths are gone


@dataclass(frozen=True, slots=True, kw_only=True)
class ViscousTerm:
    """Added to viscous friction: v times a coefficient times a rate of the speed."""

    name: str  #: In `fit.law` after a +: letters and hyphens
    title: str  #: What the coefficient multiplies, such as v·|v|
    coefficient: OwnParameter
    rate: Callable[[Expression], Expression]  #: (abs(v)) -> r, >= 0, rising from 0 at rest: CasADi's operations alone

    @property
    def own(self) -> tuple[OwnParameter, ...]:
        """The coefficient alone, as `Peak.own`."""
        return (self.coefficient,)


@dataclass(frozen=True, slots=True)
class Law:
    """A peak and the terms beside linear viscous friction."""

    peak: Peak
    terms: tuple[ViscousTerm, ...] = ()

    @property
    def name(self) -> str:
        """As in `fit.law`: peak and terms, with + between them."""
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
        """Linear parameters beside alpha_0, alpha_1 and alpha_2."""
        return tuple(term.coefficient.name for term in self.terms)

    @property
    def own(self) -> tuple[OwnParameter, ...]:
        """Parameters beside those of `Lugre` and `FASTEST`."""
        return (*self.peak.own, *(own for term in self.terms for own in term.own))

    @property
    def more(self) -> tuple[str, ...]:
        """Fields after those of every law."""
        return (*(own.name for own in self.own), *((FASTEST,) if self.terms else ()))
