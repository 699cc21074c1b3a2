"""Quantities with units, read by pint, in SI; unlike for pint, Hz is not rad/s, and a number needs a unit."""

import re
from contextlib import suppress
from functools import cache
from math import inf, pi
from typing import TYPE_CHECKING, Any

from bristle.errors import InputError, short

if TYPE_CHECKING:
    import pint

LARGEST = 1e30  # in SI; its inverse is the smallest size: squares of both are still numbers
_LONGEST = 200  # characters of a quantity, and of a unit: what is matched is short
_NUMBER = r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
_QUANTITY = re.compile(rf"({_NUMBER}) ?(.*)")
_PLUS_MINUS = re.compile(r"±|\+/-|\+-")
_ERROR = re.compile(rf"({_NUMBER}) ?\)? ?(.*)")
_UNIT = re.compile(r"[\w%µΩ\s*/^()-]{1,64}")
# powers of more than one digit, and powers of powers: pint would compute them, however large
_POWER = re.compile(r"(?:\*\*|\^)(?!\s*-?\d(?!\d|\s*(?:\*\*|\^)))")
_RAISED = re.compile(r"[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+")
_PLAIN_DIGITS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
_OF_BRACKET = re.compile(r"\)\s*(?:\*\*|\^)")  # a power of a bracket, in which another one may stand
_GERMAN = {"Grad": "deg", "U/min": "rpm"}  # what pint takes for a gigaradian, and for none
# revolutions, in the speed of a shaft
_PER_MINUTE = ("1/min", "/min", "min^-1", "min-1", "min⁻¹", "1/minute")
EXACT = {  # what pint says of the most common units, known without the half second that it takes to load
    ("deg", "rad"): pi / 180, ("rev", "rad"): 2 * pi, ("mrad", "rad"): 1e-3, ("mm", "m"): 1e-3, ("cm", "m"): 1e-2,
    ("deg/s", "rad/s"): pi / 180, ("rpm", "rad/s"): pi / 30, ("rev/s", "rad/s"): 2 * pi, ("mrad/s", "rad/s"): 1e-3,
    ("mm/s", "m/s"): 1e-3, ("cm/s", "m/s"): 1e-2, ("ms", "s"): 1e-3, ("mA", "A"): 1e-3, ("Nm", "N*m"): 1.0, ("kHz", "Hz"): 1e3,
}  # fmt: skip  # a table of numbers
_COUNTS = re.compile(r"counts?\b")
_PER_TURN = re.compile(rf"({_NUMBER}) ?counts? ?/ ?(.+)")


def to_si(value: object, target: str) -> float:
    """A quantity such as `1.5e-3 rad`, in `target`, an SI unit; of an encoder also `4096 counts/rev`, one count.

    Raises InputError where there is no number, no unit, a unit of another dimension, or a number that is too large or
    small.
    """
    text = _plain(value)
    if target in ("rad", "m") and (per := _PER_TURN.fullmatch(text)) and 0 < float(per[1]) < LARGEST:
        return _sane(factor(per[2], target) / float(per[1]), value, target)
    match = _QUANTITY.fullmatch(text)
    if match and target in ("rad", "m") and _COUNTS.match(match[2]) and "/" in match[2]:
        raise InputError(f"got {short(value)}; expected a positive number of counts, such as '4096 counts/rev'")
    if match and match[2]:
        return _sane(float(match[1]) * factor(match[2], target), value, target)
    raise InputError(f"got {short(value)}; expected a number with its unit, such as '1 {target}'")


def positive_si(name: str, value: float | str, target: str) -> float:
    """`to_si` of an option, or a number in SI. Raises InputError, opening with its name, where it is not above zero."""
    try:
        number = to_si(value, target) if isinstance(value, str) else float(value)
    except InputError as error:
        raise InputError(f"{name}: {error}") from error
    if not 0 < number < inf:
        raise InputError(f"{name}: got {value}; expected a quantity above 0, as 0.5 {target}")
    return number


def plus_minus(value: object, target: str) -> tuple[float, float | None]:
    """`x unit` as (x, None), and `x ± s unit` as (x, s), both in `target`; +/- and a unit after x are taken too.

    Raises InputError as `to_si`, and where s is not positive.
    """
    parts = _parts(value)
    if parts is None:
        return to_si(value, target), None
    number, first, error, second = parts
    of = number * factor(first, target), error * factor(second, target)
    return _sane(of[0], value, target), _sane(of[1], value, target)


def scale_parts(scale: object) -> tuple[float, str, float | None]:
    """Number, unit and relative standard error (or None) of a scale `x`, or `x ± s`.

    Raises InputError where it is no quantity, or s is not positive or not below the size of x.
    """
    parts = _parts(scale)
    if parts is None:
        match = _QUANTITY.fullmatch(_plain(str(scale)))
        if not match or float(match[1]) == 0:
            expected = "a non-zero number, with a unit where the unit changes, such as '7.6 N*m/A'"
            raise InputError(f"scale {short(str(scale))} is not a quantity; expected {expected}")
        return float(match[1]), match[2] or "1", None
    number, first, error, second = parts
    if number == 0 or not (relative := error * factor(second, first) / abs(number)) < 1:
        raise InputError(f"scale {short(str(scale))}: expected a number, with an error that is smaller than it")
    return number, first, relative


def _parts(value: object) -> tuple[float, str, float, str] | None:
    """x, its unit, s and its unit in `x ± s`, where one unit may stand for both; None where it is no such text."""
    parts = _PLUS_MINUS.split(_plain(value))
    mean = _QUANTITY.fullmatch(parts[0].strip().removeprefix("(").strip())
    error = _ERROR.fullmatch(parts[-1].strip()) if len(parts) == 2 else None  # before and after the sign
    if not (mean and error):
        return None
    if not float(error[1]) > 0:
        raise InputError(f"got {short(value)}; expected a positive standard error after ±, or none at all")
    return float(mean[1]), mean[2] or error[2] or "1", float(error[1]), error[2] or mean[2] or "1"


def _plain(value: object) -> str:
    """The text with single blanks; empty where there is none, or too much."""
    return " ".join(value.split()) if isinstance(value, str) and len(value) <= _LONGEST else ""


def _sane(number: float, value: object, target: str) -> float:
    """The number. Raises InputError where no joint has such a size."""
    if number != 0 and not 1 / LARGEST < abs(number) < LARGEST:
        expected = f"a finite size between {1 / LARGEST:g} and {LARGEST:g} {target}"
        raise InputError(f"got {short(value)}; expected {expected}; check number and unit")
    return number


def factor(unit: str, target: str, *, scale: str | float = 1.0, resolution: float | None = None) -> float:
    """Factor from `unit` times `scale` to `target`; the scale may have a unit and an error.

    `counts` (alone or first, as in `counts/s`) are worth `resolution`, rad or m. Raises InputError where the dimension
    differs.
    """
    number, times, _ = scale_parts(scale)
    if target != "Hz" and unit.replace(" ", "") in _PER_MINUTE:
        unit = "rpm"
    if counts := _COUNTS.match(unit.strip()):
        if resolution is None:
            needs = "encoder_resolution (--encoder-resolution), the size of one count, such as '4096 counts/rev'"
            raise InputError(f"unit {short(unit)} needs {needs}")
        number *= resolution
        unit = target.split("/", maxsplit=1)[0] + unit.strip()[counts.end() :]
    by_scale = "" if scale == 1 else f" times scale {short(scale)}"
    known = 1.0 if unit == target else EXACT.get((unit, target))
    times_si = number * (known or 1.0)
    if known is None or times != "1":
        measured, wanted = _parse(unit) * _parse(times), _parse(target)
        size, root = _root(measured)
        target_size, target_root = _root(wanted)
        torque_like = "N" in target or "kg" in target
        if measured.dimensionality != wanted.dimensionality or not (torque_like or root == target_root):
            own, expected = f"{wanted / _parse(times):~}", f"one such as {target}"
            if times != "1" and own.isalpha():  # what the column must be in for the scale to make the target of it
                expected = f"unit: {own}, of which this scale makes {target}, or another scale"
            elif measured.dimensionless and times == "1":
                expected += f", or a scale: what 100 % are, as in scale: 0.5 {target}"
            raise InputError(f"unit {short(unit)}{by_scale} is not a unit of {target}; expected {expected}")
        times_si = number * size / target_size
    if not 1 / LARGEST < abs(times_si) < LARGEST:
        expected = f"between {1 / LARGEST:g} and {LARGEST:g}"
        raise InputError(f"unit {short(unit)}{by_scale} is {times_si:g} {target}; expected {expected}")
    return times_si


def fits(unit: str, target: str) -> bool:
    """Whether a quantity in a unit may be one in `target`, an SI unit; pint says it where the unit is not a common one."""
    common = {of for name, of in EXACT if name == unit} | ({unit} & {*_OF_SIGNALS})
    if not common:
        with suppress(InputError):
            return bool(factor(unit, target))
    return target in common


def _root(unit: "pint.Unit") -> tuple[float, object]:
    """Size of a unit in root units, and the root unit, which unlike base units tells rad/s from Hz."""
    size: Any
    try:
        size, root = _registry().get_root_units(unit)
        return float(size), root
    except Exception as error:  # of pint, at text that is no unit
        why = f"unit {short(str(unit))} is too large or too small"
        raise InputError(f"{why}; expected a unit such as rad, N*m or mA") from error


def _parse(unit: str) -> "pint.Unit":
    bad = f"unit {short(unit)} is not known; expected a unit such as rad, deg/s, N*m or mA"
    if len(unit) > _LONGEST:
        raise InputError(bad)
    text = re.sub(r"(?<=[^\W\d])[-·⋅.](?=[^\W\d])", "*", unit.strip().replace("°", "deg"))
    text = _GERMAN.get(text, text)
    text = _RAISED.sub(lambda digits: "**" + digits[0].translate(_PLAIN_DIGITS), text)
    text = "dimensionless" if text in ("1", "-") else text.replace("%", "percent")
    if not _UNIT.fullmatch(text) or _POWER.search(text) or len(_OF_BRACKET.findall(text)) > 1:
        raise InputError(bad)
    try:
        return _registry().parse_units(text)
    except Exception as error:  # of pint, at text that is no unit
        raise InputError(bad) from error


# of what a log may hold: another word in a row of units is none
_OF_SIGNALS = ("s", "rad", "m", "rad/s", "m/s", "rad/s**2", "m/s**2", "N", "N*m", "A", "V", "W", "Hz", "kelvin")


@cache
def signal_unit(text: str) -> str:
    """The unit of a signal in a text, as `factor` takes it: `Volt` as volt; empty where it is none."""
    for unit in (text, text.lower()) if 3 < len(text) <= _LONGEST else (text,):
        with suppress(InputError):
            if unit and _parse(unit).dimensionality in {_parse(x).dimensionality for x in _OF_SIGNALS}:
                return unit
    return ""


@cache
def _registry() -> "pint.UnitRegistry[float]":
    import pint

    registry: pint.UnitRegistry[float] = pint.UnitRegistry(autoconvert_offset_to_baseunit=False)
    registry.define("newton_metre = newton * meter = Nm")
    registry.define("@alias turn = rev")
    registry.define("newton_centimetre = 0.01 * newton * meter = Ncm")
    registry.define("newton_millimetre = 0.001 * newton * meter = Nmm")
    return registry
