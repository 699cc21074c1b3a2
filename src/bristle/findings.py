"""Findings: what a user must know beside a number. Users look their codes up, and code decides by them."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, is_dataclass, replace
from enum import StrEnum
from types import NoneType
from typing import Annotated, Any

import numpy as np

from bristle.arrays import JsonForm, Number, to_bound


class Severity(StrEnum):
    """What a finding does to the number that it is about."""

    CRITICAL = "critical"
    """Do not use this number."""
    CAUTION = "caution"
    """Its interval is wider than it looks, or something is assumed."""
    NOTE = "note"
    """Worth knowing; the number is as good as it says."""


CRITICAL, CAUTION, NOTE = Severity

_UNIT = "\ue000{}\ue001"
_UNITS = re.compile(_UNIT.format("([a-z_0-9]*)[+-]?"))


def unit_of(quantity: str) -> str:
    """Placeholder in a message for a space and the unit of a quantity or parameter; empty until the joint is known."""
    return _UNIT.format(quantity)


def in_units(message: str, units: Mapping[str, str]) -> str:
    """A message with the units of a joint, by quantity."""
    return _UNITS.sub(lambda found: f" {units[found[1]]}" if units.get(found[1]) else "", message)


def _to_json(value: Any) -> Any:
    """A list, a number or a word; the text of anything else."""
    match value:
        case tuple() | list() if not hasattr(value, "_fields"):
            return [_to_json(x) for x in value]
        case np.generic():
            return _to_json(value.item())
        case float():
            return to_bound(value)
        case bool() | int():
            return value
        case _:
            return str(value)


def _from_json(value: Any) -> Any:
    match value:
        case list():
            return tuple(map(_from_json, value))
        case None | "inf" | "-inf":
            return float(value or "nan")
        case _:
            return value


_EACH = JsonForm(
    dict[str, Any], lambda x: {k: _to_json(v) for k, v in x.items()}, lambda x: {k: _from_json(v) for k, v in x.items()}
)


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing to know about an estimate, a fit, a segment or a run; `str` gives its message."""

    code: str
    severity: Severity
    message: Annotated[str, JsonForm(str, lambda x: in_units(x, {}), str)]
    """A sentence. Until the joint is known, its units are the placeholders of `unit_of`."""
    numbers: Annotated[Mapping[str, Any], _EACH] = field(default_factory=dict, compare=False)
    """The values in the message, by name, for programs; a finding among them is read back from a file as text."""
    effect: Mapping[str, Number] = field(default_factory=dict)
    """Size of its effect, by kind, such as `torque`; empty if not computed."""
    subject: tuple[str, ...] = field(default=(), compare=False)
    """Path from stage to parameter, such as `static`, `+`, `alpha_0`, or file and rows; empty: the whole joint."""

    @property
    def coded(self) -> str:
        """The message, then in brackets the code that `bristle explain` takes."""
        return f"{self} [{self.code}]"

    @property
    def flagged(self) -> str:
        """`coded` for a critical finding or a caution; the message alone for a note."""
        return str(self) if self.severity is Severity.NOTE else self.coded

    def __str__(self) -> str:
        return in_units(self.message, {})

    def __hash__(self) -> int:
        return hash((self.code, self.message))


PLAIN = frozenset((float, int, bool, str, NoneType, np.ndarray, np.float64))  # types of values that hold no others


def with_subjects(
    value: Any, subjects: Mapping[str, tuple[str, ...]], units: Mapping[str, str], subject: tuple[str, ...] = ()
) -> Any:
    """The same result with findings that know their subject, the way from `subject` on, and the joint's units.

    A field is a step of that way as `subjects` names it, an entry of a mapping by its key; an object's own `subject`
    resets the path.
    """
    if type(value) in PLAIN:  # most of what a result holds, which is soon done with
        return value
    if isinstance(value, Finding):
        return replace(value, subject=subject, message=in_units(value.message, units))
    subject = getattr(value, "subject", subject)
    match value:
        case Mapping():
            made = {key: with_subjects(x, subjects, units, (*subject, str(key))) for key, x in value.items()}
            return made if any(made[key] is not x for key, x in value.items()) else value
        case tuple() if not hasattr(value, "_fields"):
            inner = tuple(with_subjects(x, subjects, units, subject) for x in value)
            return inner if any(x is not y for x, y in zip(inner, value, strict=True)) else value
        case _ if is_dataclass(value) and not isinstance(value, type):
            changed = dict[str, Any]()
            for name in value.__dataclass_fields__:
                old = getattr(value, name)
                if type(old) not in PLAIN and old not in ((), {}):
                    new = with_subjects(old, subjects, units, (*subject, *subjects.get(name, ())))
                    changed |= {} if new is old else {name: new}
            return replace(value, **changed) if changed else value
        case _:
            return value


def in_direction(direction: str) -> str:
    """A direction in a sentence; empty where both are one."""
    return f" in direction {direction}" if direction in {"+", "-"} else ""
