"""Names, units and numbers in print, for figures, tables and text alike."""

import math
import re
from collections.abc import Callable
from itertools import count

from bristle.model.laws.parts import FASTEST
from bristle.model.laws.registry import own_parameter, own_parameters
from bristle.model.parameters import Kind, ParameterName, effort, periodic, unit

MISSING = "–"  # what stands where there is no number
WORK = "J"  # unit of work, whatever the kind of joint
SYMBOLS = {
    "alpha_0": "α₀",
    "alpha_1": "α₁",
    "alpha_2": "α₂",
    "v_s": "vₛ",
    FASTEST: "vₑ",
    "sigma_0": "σ₀",
    "sigma_1": "σ₁",
    "gravity_sin": "gravity (sin)",
    "gravity_cos": "gravity (cos)",
    "spring": "spring",
    "quadratic": "v·|v|",
}
PARAMETERS = {  # of every law, in words
    "alpha_0": "Coulomb friction",
    "alpha_1": "Stribeck amplitude",
    "alpha_2": "viscous friction",
    "v_s": "Stribeck velocity",
    "sigma_0": "bristle stiffness",
    "sigma_1": "bristle damping",
}
_DIRECTIONS = {"+": "(+)", "-": "(−)", "both": "both directions", "shared": "shared by both directions"}
_WORDS = {"displacement": "position", "displacement from rest": "position"}  # on an axis, by the signal of their unit


def symbol(name: str | ParameterName) -> str:
    """A parameter as the paper writes it: alpha_0 -> α₀, alpha_0+ -> α₀ (+), and as its law has it; other names unchanged."""
    bare, d = ParameterName.parse(name) if isinstance(name, str) else name
    if (repeats := periodic(bare)) is not None:
        return "{} ({} {})".format(*repeats)
    own = None if bare in SYMBOLS else own_parameter(bare)
    plain = own.symbol if own is not None and "$" not in own.symbol else bare
    return SYMBOLS.get(bare, plain) + (f" {_DIRECTIONS[d]}" if d in ("+", "-") else "")


def in_symbols(sentence: str) -> str:
    """A sentence with the symbols of friction parameters, direction included.

    A law's own parameter is replaced if its name has a _ in it; delta is a word.
    """
    own = "".join(f"|{name}" for name in own_parameters() if "_" in name)
    names = rf"\b(alpha_[012]|sigma_[01]|v_s|{FASTEST}{own})\b([+-](?=\W|$))?"
    return re.sub(names, lambda name: symbol(name[0]), sentence)


def in_print(sentence: object) -> str:
    """A sentence of a finding in print: parameters as symbols, units in print."""
    return pretty(in_symbols(str(sentence)))


def direction(name: str) -> str:
    """A direction in a heading: + -> (+)."""
    return _DIRECTIONS.get(name, name)


def pretty(si: str) -> str:
    """An SI unit string in print: kg*m**2 -> kg·m²."""
    return si.replace("**2", "²").replace("*", "·")


def axis(quantity: str, kind: Kind, prefix: str = "") -> str:
    """Label of an axis with quantity and unit, as `Residual torque (N·m)`; a prismatic joint's torque is a force."""
    word = effort(kind) if quantity == "torque" else quantity
    label = f"{prefix} {word}".strip()
    return f"{label[0].upper()}{label[1:]} ({pretty(unit(_WORDS.get(quantity, quantity), kind))})"


def number(x: float | None, digits: int = 4) -> str:
    """A number in a few significant digits, without an exponent below a million; None and nan as a dash, infinity as its sign."""
    if x is None or math.isnan(x):
        return MISSING
    if math.isinf(x):
        return "∞" if x > 0 else "-∞"
    text = f"{x:.{digits}g}"
    return f"{float(text):.0f}" if "e+" in text and abs(x) < 1e6 else text


def two_digits(x: float) -> str:
    """A finite number in two significant digits, or all those before its point: 0.62, 2.0, 145."""
    return f"{x:.0f}" if abs(x) >= 9.95 else f"{x:#.2g}"


def measured(value: float | None, error: float | None) -> str:
    """Value ± standard error, both to the second digit of the error: 0.01942 ± 0.00016; the value alone where it has none.

    Very large and very small ones share an exponent: (1.23457 ± 0.00089)e+06.
    """
    if value is None or error is None or not math.isfinite(error) or error <= 0 or not math.isfinite(value):
        return number(value)
    rounded = float(f"{error:.1e}")
    places = 1 - math.floor(math.log10(rounded))
    size = max(math.floor(math.log10(max(abs(value), rounded))), -300)
    if -5 <= size < 6:
        return f"{round(value, places):.{max(places, 0)}f} ± {rounded:.{max(places, 0)}f}"
    scale, digits = 10.0**size, max(places + size, 0)
    return f"({value / scale:.{digits}f} ± {rounded / scale:.{digits}f})e{size:+03d}"


def span(interval: tuple[float, float] | None) -> str:
    """An interval as [low, high], both rounded to two digits of its standard error, a quarter of the width.

    Four digits if an end is infinite, both are equal, or they are very large or very small.
    """
    if interval is None:
        return MISSING
    low, high = interval
    width = high - low
    if not (math.isfinite(width) and width > 0 and 1e-5 <= max(abs(low), abs(high)) < 1e6):
        return f"[{number(low)}, {number(high)}]"
    places = min(1 - math.floor(math.log10(width / 4)), 12)
    return "[" + ", ".join(f"{round(end, places):.{max(places, 0)}f}" for end in interval) + "]"


def percent(value: float | None, error: float | None) -> float | None:
    """Standard error in percent of the value; None where either does not exist or the value is zero."""
    if not value or error is None or not math.isfinite(error):
        return None
    return abs(100 * error / value)


def in_percent(share: float) -> str:
    """A share in percent, in two digits, without an exponent where it is large: 0.8312 -> 83 %, 12.34 -> 1200 %."""
    return f"{number(float(f'{100 * share:.2g}'))} %"


def counted(count: int, thing: str) -> str:
    """So many of a thing: 1 point, 2 points."""
    return f"{count} {thing}{'' if count == 1 else 's'}"


def sentence(text: str) -> str:
    """A caption's finding as its first sentence, with a capital and a full stop; empty of an empty text."""
    return f"{text[0].upper()}{text[1:]}." if text else ""


def printable(text: str) -> str:
    """Text without control characters and lone surrogates, which neither SVG nor UTF-8 can hold."""
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)


def shortened(text: str, length: int = 60, *, end: bool = False) -> str:
    """Text that fits a figure's title: its beginning, or its end, where files are told apart."""
    text = printable(text)
    if len(text) <= length:
        return text
    return f"…{text[1 - length :]}" if end else f"{text[: length - 1]}…"


def slugs(names: list[str]) -> list[str]:
    """One file name per joint name, of ASCII letters, digits and single hyphens between them, each different.

    An id of the page is a slug, two hyphens and a word, so that no slug makes an id of another joint or of the page itself.
    """
    out: dict[str, None] = {}
    for name in names:
        out[free(plain(name), out.__contains__)] = None
    return list(out)


def plain(name: str, between: str = "-", length: int = 40) -> str:
    """A name in ASCII letters and digits, with single signs between them, as a file is called on every system."""
    found = re.sub(r"[^a-z0-9]+", between, name.lower()).strip(between)[:length].strip(between) or "joint"
    is_device = re.fullmatch("con|prn|aux|nul|(com|lpt)[0-9]", found)  # on Windows, whatever follows a dot
    return f"{found}{between}joint" if is_device else found


def free(name: str, taken: Callable[[str], bool]) -> str:
    """The name, or with the first number from 2 up that is not taken."""
    return name if not taken(name) else next(x for k in count(2) if not taken(x := f"{name}-{k}"))


FITS = {"tracking": "moving runs", "joint": "joint fit"}  # fits of moving runs, in headings and tables
METHODS = {  # ways to sigma_0, in tables and legends
    "printed": "(14) as printed, T₁ / x₁",
    "edges": "count edge to count edge",
    "samples": "all samples",
}
