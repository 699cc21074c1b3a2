"""Compensators with CasADi symbols as numbers, for printing in other languages."""

from collections.abc import Mapping
from dataclasses import dataclass

from bristle.control.adaptation import Adaptation
from bristle.control.compensator import Compensator
from bristle.model.laws.parts import Expression

OF_COMPENSATOR = ("share", "inertia", "softness", "filter_time", "observer_gain")  # numbers of a compensator
OF_ADAPTATION = ("dead_zone", "leakage", "forgetting")  # and of its adaptation, beside its limits and rates


@dataclass(frozen=True, slots=True, kw_only=True)
class SymbolicAdaptation(Adaptation):
    """An adaptation with symbols, unchecked."""

    def __post_init__(self) -> None:
        """Refuse nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SymbolicCompensator(Compensator):
    """A compensator with symbols, unchecked."""

    def __post_init__(self) -> None:
        """Refuse nothing."""


def setting_names(adapted: int) -> tuple[str, ...]:
    """Names of the numbers of a compensator with so many adapted parameters, in order."""
    return (*OF_COMPENSATOR, *OF_ADAPTATION, "lower", "upper", *(f"gamma_{k + 1}" for k in range(adapted)))


def settings_of(compensator: Compensator) -> dict[str, float]:
    """Its numbers, by these names; of the default adaptation where there is none."""
    a = compensator.adaptation or Adaptation()
    rates = a.gamma if compensator.adaptation else ()
    own = [*(getattr(compensator, name) for name in OF_COMPENSATOR), *(getattr(a, name) for name in OF_ADAPTATION)]
    return dict(zip(setting_names(len(rates)), map(float, (*own, *a.limits, *rates)), strict=True))


def with_settings(
    compensator: Compensator, settings: Mapping[str, Expression], adapting: type[Adaptation] = SymbolicAdaptation
) -> SymbolicCompensator:
    """The compensator with symbols in place of its numbers, and another class of adaptation if asked."""
    a = compensator.adaptation
    adaptation = a and adapting(
        law=a.law, step=a.step, parameters=a.parameters, limits=(settings["lower"], settings["upper"]),
        gamma=tuple(settings[f"gamma_{k + 1}"] for k in range(len(a.parameters))),
        **{name: settings[name] for name in OF_ADAPTATION},
    )  # fmt: skip  # a list of values
    own = {name: settings[name] for name in OF_COMPENSATOR}
    return SymbolicCompensator(name=compensator.name, velocity=compensator.velocity, adaptation=adaptation, **own)
