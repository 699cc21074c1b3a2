"""Quantities with units, read by pint, in SI: `0.35 N*m/A`, `4096 counts/rev`, `95.1 ± 0.5 kg`.

What pint does not mind, and a log must: Hz is not rad/s, and a bare number has no unit.
"""

import re
import tokenize
from functools import cache
from typing import TYPE_CHECKING, Any

from bristle.errors import InputError

if TYPE_CHECKING:
    import pint

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_QUANTITY = re.compile(rf"\s*({_NUMBER})\s*(.*?)\s*", re.DOTALL)
_UNCERTAIN = re.compile(rf"\s*\(?\s*({_NUMBER})\s*([^±]*?)\s*(?:±|\+/-|\+-)\s*({_NUMBER})\s*\)?\s*(.*?)\s*", re.DOTALL)
_UNIT = re.compile(r"[\w%µΩ\s*/^()+-]{1,64}")
_POWER = re.compile(r"(?:\*\*|\^)(?!\s*-?\d(?!\d|\s*(?:\*\*|\^)))")
"""A power that is not one digit, or a power of a power: pint would compute it, however large."""
_COUNTS = re.compile(r"counts?\b")
_PER_TURN = re.compile(rf"\s*({_NUMBER})\s*counts?\s*/\s*(.+?)\s*")

_EXAMPLES = {
    "rad": "rad, deg, rev or counts",
    "m": "m, mm or counts",
    "rad/s": "rad/s, deg/s or rpm",
    "m/s": "m/s or mm/s",
    "N*m": "N*m or mNm",
    "N": "N or kN",
    "s": "s, ms or us",
    "Hz": "Hz or kHz",
    "A": "A or mA",
    "V": "V or mV",
    "1": "1 or percent",
}

_REFUSALS = (
    ArithmeticError,
    AssertionError,
    AttributeError,
    LookupError,
    SyntaxError,
    TypeError,
    ValueError,
    tokenize.TokenError,
)
"""What pint's parser raises on text that is no unit, as seen."""


def to_si(value: object, target: str) -> float:
    """A quantity such as `1.5e-3 rad`, in `target`, an SI unit; for an encoder also `4096 counts/rev`, the size of one count.

    Raises InputError where there is no number, no unit, or a unit of another dimension.
    """
    if isinstance(value, str):
        if target in ("rad", "m") and (per := _PER_TURN.fullmatch(value)) and float(per[1]) > 0:
            return factor(per[2], target) / float(per[1])
        found = _QUANTITY.fullmatch(value)
        if found and found[2]:
            return float(found[1]) * factor(found[2], target)
    raise InputError(f"got {_short(value)}; expected a number with its unit, such as {_example(target)}")


def plus_minus(value: object, target: str) -> tuple[float, float | None]:
    """`x unit` as (x, None), and `x ± s unit` (also `x +/- s unit`, or with a unit after x as well) as (x, s), both in `target`.

    Raises InputError as `to_si`, and where s is not positive.
    """
    found = _UNCERTAIN.fullmatch(value) if isinstance(value, str) else None
    if not found:
        return to_si(value, target), None
    if not float(found[3]) > 0:
        raise InputError(f"got {_short(value)}; expected a positive standard error after ±, or none at all")
    first, second = found[2] or found[4] or "1", found[4] or found[2] or "1"
    return float(found[1]) * factor(first, target), float(found[3]) * factor(second, target)


def factor(unit: str, target: str, *, scale: str | float = 1.0, resolution: float | None = None) -> float:
    """What a value in `unit` is multiplied by to be in `target`: `unit` times `scale`, which may have a unit of its own.

    `counts` (alone or first, as in `counts/s`) are worth `resolution`, rad or m. Raises InputError where the dimension differs.
    """
    number, times = _scale(scale)
    if counts := _COUNTS.match(unit.strip()):
        if resolution is None:
            raise InputError(
                f"unit {unit!r} needs encoder_resolution, the size of one count, such as '4096 counts/rev'"
            )
        number *= resolution
        unit = target.split("/", maxsplit=1)[0] + unit.strip()[counts.end() :]
    measured = _parse(unit) * _parse(times)
    wanted = _parse(target)
    size, root = _root(measured)
    target_size, target_root = _root(wanted)
    torque_like = "N" in target or "kg" in target
    if measured.dimensionality != wanted.dimensionality or not (torque_like or root == target_root):
        by_scale = f" times scale {scale!r}" if times != "1" else ""
        raise InputError(f"unit {unit!r}{by_scale} is no unit of {target}; expected one such as {_example(target, '')}")
    return number * size / target_size


def _scale(scale: str | float) -> tuple[float, str]:
    found = _QUANTITY.fullmatch(str(scale))
    if not found or float(found[1]) == 0:
        raise InputError(
            f"scale {scale!r} is no quantity; expected a non-zero number, with a unit where the unit changes, such as '7.6 N*m/A'"
        )
    return float(found[1]), found[2] or "1"


def _root(unit: "pint.Unit") -> tuple[float, object]:
    """Size of a unit in root units, and the root unit: unlike base units they tell rad/s from Hz."""
    size: Any
    size, root = _registry().get_root_units(unit)
    return float(size), root


def _parse(unit: str) -> "pint.Unit":
    text = re.sub(r"(?<=[^\W\d])[-·⋅.](?=[^\W\d])", "*", unit.strip().replace("°", "deg"))
    text = "dimensionless" if text in ("1", "-") else text.replace("%", "percent")
    bad = f"unit {_short(unit)} is not known; expected a unit such as rad, deg/s, N*m or mA"
    if not _UNIT.fullmatch(text) or _POWER.search(text):
        raise InputError(bad)
    try:
        return _registry().parse_units(text)
    except _REFUSALS as error:
        raise InputError(bad) from error


@cache
def _registry() -> "pint.UnitRegistry[float]":
    import pint

    registry: pint.UnitRegistry[float] = pint.UnitRegistry(autoconvert_offset_to_baseunit=False)
    registry.define("newton_metre = newton * meter = Nm")
    registry.define("@alias turn = rev")
    return registry


def _example(target: str, number: str = "1 ") -> str:
    return f"{number and repr(number + _EXAMPLES.get(target, target).split(',')[0].split(' or ')[0])}" or _EXAMPLES.get(
        target, target
    )


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
