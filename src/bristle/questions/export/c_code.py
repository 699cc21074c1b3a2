"""Printing of CasADi functions as C99.

`br_real` is double, or float with BRISTLE_SINGLE. Comparisons are `int`; equality is a pair of < and >, of which no
compiler warns. No operation raises a flag of division by zero that Python's does not.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from math import isfinite

import casadi as ca
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from bristle.errors import InputError
from bristle.model.printing import FUNCTIONS, INFIX, Language, Printed, Term, statements
from bristle.questions.export.xml_edit import attribute

_COMPARED = {
    ca.OP_LT: "{0} < {1}",
    ca.OP_LE: "{0} <= {1}",
    ca.OP_EQ: "{0} <= {1} && {0} >= {1}",
    ca.OP_NE: "{0} < {1} || {0} > {1}",
}
_OTHERS: dict[int, Callable[..., str]] = {
    ca.OP_ASSIGN: "{}".format,
    ca.OP_NEG: "-{}".format,
    ca.OP_SQ: "{0} * {0}".format,
    ca.OP_TWICE: "{0} + {0}".format,
    ca.OP_INV: "BR_C(1.0) / {}".format,
}
_SMALLEST, _LARGEST = 1e-24, 1e30  # of numbers of single precision, so that products and quotients stay finite
_ALWAYS = ("exp", "expm1", "log", "pow", "sqrt", "sin", "cos", "tanh")
_OWN = ("abs", "sign", "min", "max")  # defined in the header


def math_of(lines: Sequence[str]) -> tuple[str, ...]:
    """Functions of math.h that the header defines: the usual ones, and rare ones that these lines call."""
    called = {name for line in lines for name in re.findall(r"BR_([A-Z0-9]+)\(", line)}
    return (*_ALWAYS, *(x for x in FUNCTIONS.values() if x not in _ALWAYS and x.upper() in called))


def constant(value: float) -> str:
    """A constant of br_real with all digits. Raises InputError where it is not finite."""
    if not isfinite(value):
        raise InputError(f"got {value}, which has no constant in C99; write the expression without it")
    size = abs(value)
    near = min(max(size, _SMALLEST), _LARGEST) if size else 0.0
    text = f"BR_C({size!r})" if near == size else f"BR_K({size!r}, {near!r})"
    return f"(-{text})" if value < 0 else text


def operation(code: int, operands: Sequence[Term]) -> Term:
    """CasADi's operation with this code as an expression in C. Raises KeyError where C has none."""
    if code in (ca.OP_NOT, ca.OP_AND, ca.OP_OR):
        asked = [_answer(x) for x in operands]
        joined = {ca.OP_NOT: "!({0})", ca.OP_AND: "({0}) && ({1})", ca.OP_OR: "({0}) || ({1})"}
        return Term(joined[code].format(*asked), truth=True)
    texts = [f"(br_real){x.text}" if x.truth else x.text for x in operands]
    if code == ca.OP_IF_ELSE_ZERO:
        return Term(f"{_answer(operands[0])} ? {texts[1]} : BR_C(0.0)")
    if code in _COMPARED:
        return Term(_COMPARED[code].format(*texts), truth=True)
    if code in INFIX:
        return Term(f" {INFIX[code]} ".join(texts))
    if name := FUNCTIONS.get(code):
        return Term(f"{f'br_{name}' if name in _OWN else f'BR_{name.upper()}'}({', '.join(texts)})")
    return Term(_OTHERS[code](*texts))


def _answer(x: Term) -> str:
    return x.text if x.truth else f"({x.text} < BR_C(0.0) || {x.text} > BR_C(0.0))"


def printed(function: ca.Function, operand: Callable[[int, int], str]) -> Printed:
    """Statements in C of a CasADi function, and its outputs; `operand`: (input, element) -> its name in C."""

    def assignment(name: str, value: Term) -> str:
        return f"const {'int' if value.truth else 'br_real'} {name} = {value.text};"

    return statements(function, operand, Language("C99", operation, constant, assignment, prefix="x"))


def escaped(text: str) -> str:
    """A text for a comment in C: printable ASCII, without comment marks, trigraphs or joined lines."""
    plain = "".join(c if c.isascii() and c.isprintable() else f"<U+{ord(c):04X}>" for c in text)
    return re.sub(r"\?(?=\?)", "? ", plain).replace("*/", "* /").replace("/*", "/ *").replace("\\", "<U+005C>")


def filled(template: str, context: Mapping[str, object]) -> str:
    """A template of an export, filled."""
    return _environment().get_template(template).render(context)


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("bristle.questions.export"),
        autoescape=lambda name: name is not None and not name.endswith((".c", ".h")),  # noqa: S701  # texts in C pass `escaped`
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "c": escaped,
        "digits": repr,
        "attribute": lambda text: Markup(attribute(text)),  # noqa: S704  # which escapes
    }
    return environment
