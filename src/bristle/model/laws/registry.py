"""The known friction laws by name: bristle's own, of installed packages (`bristle.laws`), and registered ones."""

import logging
import re
from collections.abc import Collection
from functools import cache
from importlib.metadata import entry_points
from keyword import iskeyword

from bristle.model.laws.alternatives import EXPONENTIAL, FREE_EXPONENT, LORENTZIAN, QUADRATIC
from bristle.model.laws.check import fault_of
from bristle.model.laws.gaussian import GAUSSIAN, PEAK
from bristle.model.laws.parts import FASTEST, Law, OwnParameter, Peak, ViscousTerm

PAPER = "paper"  # another name of the paper's law
AUTO = "auto"  # not a law: the data choose one
LOADS = {
    "link-load": ("link_load",),
    "motor-load": ("motor_load",),
    "gear-load": ("gear_load",),
    "gear-load-squared": ("gear_load", "gear_load_squared"),
}
"""Loads by which the level rises (`law.load_levels`), as in `fit.law` after a +, and their coefficients."""
_PARTS: dict[str, Peak | ViscousTerm] = {
    part.name: part for part in (PEAK, EXPONENTIAL, LORENTZIAN, FREE_EXPONENT, QUADRATIC)
}
_COMPETE = set(_PARTS) - {FREE_EXPONENT.name}  # choices of `auto`; the free exponent is fitted by name alone
_NAME = re.compile("[A-Za-z][A-Za-z0-9_]*")  # names of parameters, valid in C and MATLAB
_LOG = logging.getLogger(__name__)


def register_law(part: Peak | ViscousTerm, *, compete: bool = True) -> None:
    """Make a peak or a term known by its name, for `fit.law`, and for `auto` where it is to compete.

    >>> import bristle
    >>> n = bristle.OwnParameter(name="steep", symbol="n", units=("1", "1"), searched=(0.5, 3.0))
    >>> steep = lambda v, v_s, n: (1 + (v / v_s) ** 2) ** -n
    >>> bristle.register_law(bristle.Peak(name="steep", title="power-law", shape=steep, own=(n,), reach=3.0))

    Args:
        part: what the law is to have.
        compete: whether `auto`, and the comparison of laws, try it: a peak with and without each term, a term beside each
            peak.

    Raises ValueError where another part has the name already, a parameter of it is called as one that there is, or the
    part, tried on speeds, is not what the equations take it for: a peak even in v, 1 at rest and falling to 0, a term's
    rate rising from 0, each of CasADi's operations.
    """
    if not isinstance(part, Peak | ViscousTerm):
        raise ValueError(f"got {type(part).__name__}; expected a Peak or a ViscousTerm")
    known = _PARTS.get(part.name)
    if known not in (None, part):
        raise ValueError(f"{part.name!r} is a part of a law already; choose another name")
    if not part.name.replace("-", "").isalnum() or part.name in (PAPER, AUTO):
        raise ValueError(f"got the name {part.name!r}; expected letters, digits and hyphens, and not {PAPER} or {AUTO}")
    from bristle.model.parameters import reserved_names

    others = reserved_names() | {own.name for other in _PARTS.values() if other != part for own in other.own}
    taken = [x.name for x in part.own if x.name in others or iskeyword(x.name) or not _NAME.fullmatch(x.name)]
    if taken:
        raise ValueError(
            f"{part.name}: got a parameter called {taken[0]!r}; expected letters, digits and _, and a name that no other has"
        )
    fault = None if known == part else fault_of(part)
    if fault is not None:
        raise ValueError(f"{part.name}: {fault}")
    _PARTS[part.name] = part
    if compete:
        _COMPETE.add(part.name)


def law_named(name: str) -> Law:
    """The law of a name such as `lorentzian+quadratic`; `paper` and `auto` are the Gaussian peak.

    Raises KeyError, with the known names, for others.
    """
    if name == AUTO:
        return GAUSSIAN
    first, *rest = name.split("+")
    first = PEAK.name if first == PAPER else first
    if not {first, *rest} <= _PARTS.keys():
        _look()
    peak, terms = _PARTS.get(first), [_PARTS.get(x) for x in rest]
    found = tuple(term for term in terms if isinstance(term, ViscousTerm))
    if not isinstance(peak, Peak) or len(found) < len(rest) or len(set(rest)) < len(rest):
        raise KeyError(f"{' | '.join(_named(Peak))}, each perhaps with +{' or +'.join(_named(ViscousTerm))}")
    return Law(peak, found)


def apart(name: str) -> tuple[str, tuple[str, ...]]:
    """The name of a law without its load, and the load, of `LOADS`, or none."""
    bare, _, last = name.rpartition("+")
    return (bare, (last,)) if last in LOADS else (name, ())


def with_load(law: Law, coefficients: Collection[str]) -> str:
    """The name of a law with the load of these coefficients, as in `fit.law`: gaussian+link-load."""
    return "+".join((law.name, *(load for load, names in LOADS.items() if {*names} == {*coefficients})))


def competing() -> tuple[Law, ...]:
    """The choices of `auto`, the paper's first: every peak, with and without each term."""
    _look()
    parts = [part for name, part in _PARTS.items() if name in _COMPETE]
    terms = [(), *((part,) for part in parts if isinstance(part, ViscousTerm))]
    return tuple(Law(peak, chosen) for peak in parts if isinstance(peak, Peak) for chosen in terms)


def own_parameters() -> dict[str, OwnParameter]:
    """Parameters of known peaks and terms, by name."""
    return {own.name: own for part in _PARTS.values() for own in part.own}


def own_parameter(name: str) -> OwnParameter | None:
    """A parameter of a known law or of an installed package, or None."""
    if name not in own_parameters():
        _look()
    return own_parameters().get(name)


def friction_names() -> frozenset[str]:
    """Friction parameters that not every law has."""
    return frozenset((*own_parameters(), FASTEST))


def _named(kind: type[Peak] | type[ViscousTerm]) -> list[str]:
    return [name for name, part in _PARTS.items() if isinstance(part, kind)]


@cache
def _look() -> None:
    """Load the laws of installed packages, once."""
    for entry in entry_points(group="bristle.laws"):
        try:
            register_law(entry.load())
        except Exception as error:  # noqa: BLE001  # a package that is broken is no reason to fail without its law
            _LOG.warning("the law %s of an installed package is left out: %s: %s", entry.name, entry.value, error)
