"""Prints a CasADi function as C99: `model.printing` in the language of controllers.

`br_real` is double, or float with BRISTLE_SINGLE. Comparisons are `int`; equality is written as a pair of < and >, so that no compiler warns of it,
and no operation can raise the flag of a division by zero that Python's does not.
"""

import re
from collections.abc import Callable, Sequence
from math import isfinite

import casadi as ca

from bristle.errors import InputError
from bristle.model.printing import Language, Printed, Term, statements

_INFIX = {ca.OP_ADD: "+", ca.OP_SUB: "-", ca.OP_MUL: "*", ca.OP_DIV: "/"}
_COMPARED = {
    ca.OP_LT: "{0} < {1}",
    ca.OP_LE: "{0} <= {1}",
    ca.OP_EQ: "{0} <= {1} && {0} >= {1}",
    ca.OP_NE: "{0} < {1} || {0} > {1}",
}
_CALLS = {
    ca.OP_EXP: "BR_EXP",
    ca.OP_EXPM1: "BR_EXPM1",
    ca.OP_LOG: "BR_LOG",
    ca.OP_POW: "BR_POW",
    ca.OP_CONSTPOW: "BR_POW",
    ca.OP_SQRT: "BR_SQRT",
    ca.OP_SIN: "BR_SIN",
    ca.OP_COS: "BR_COS",
    ca.OP_TANH: "BR_TANH",
    ca.OP_FABS: "br_abs",
    ca.OP_SIGN: "br_sign",
    ca.OP_FMIN: "br_min",
    ca.OP_FMAX: "br_max",
}
_RARE = {
    ca.OP_LOG1P: "log1p", ca.OP_TAN: "tan", ca.OP_ASIN: "asin", ca.OP_ACOS: "acos", ca.OP_ATAN: "atan", ca.OP_ATAN2: "atan2",
    ca.OP_SINH: "sinh", ca.OP_COSH: "cosh", ca.OP_ASINH: "asinh", ca.OP_ACOSH: "acosh", ca.OP_ATANH: "atanh",
    ca.OP_HYPOT: "hypot", ca.OP_ERF: "erf", ca.OP_FLOOR: "floor", ca.OP_CEIL: "ceil", ca.OP_FMOD: "fmod", ca.OP_COPYSIGN: "copysign",
}  # fmt: skip  # a table
"""What bristle's own laws do not use, and others may."""
_CALLS |= {code: f"BR_{name.upper()}" for code, name in _RARE.items()}
_OTHERS: dict[int, Callable[..., str]] = {
    ca.OP_ASSIGN: "{}".format,
    ca.OP_NEG: "-{}".format,
    ca.OP_SQ: "{0} * {0}".format,
    ca.OP_TWICE: "{0} + {0}".format,
    ca.OP_INV: "BR_C(1.0) / {}".format,
}
_SMALLEST, _LARGEST = 1e-24, 1e30
"""Numbers of single precision stay within these, so that their products and quotients do."""
_MATH = ("exp", "expm1", "log", "pow", "sqrt", "sin", "cos", "tanh")


def math_of(lines: Sequence[str]) -> tuple[str, ...]:
    """Functions of math.h that printed code may call, as BR_EXP and so on, and the rare ones that these lines do."""
    called = {name for line in lines for name in re.findall(r"BR_([A-Z0-9]+)\(", line)}
    return (*_MATH, *(name for name in _RARE.values() if name.upper() in called))


def constant(value: float) -> str:
    """A number of br_real, every digit of it; what single precision cannot hold is its nearest end there.

    Raises InputError where it is not finite.
    """
    if not isfinite(value):
        raise InputError(f"got {value}, which has no constant in C99; write the expression without it")
    size = abs(value)
    near = min(max(size, _SMALLEST), _LARGEST) if size else 0.0
    text = f"BR_C({size!r})" if near == size else f"BR_K({size!r}, {near!r})"
    return f"(-{text})" if value < 0 else text


def operation(code: int, operands: Sequence[Term]) -> Term:
    """CasADi's operation of that number on these operands, as an expression in C.

    Raises KeyError where the printed C has no such operation.
    """
    if code in (ca.OP_NOT, ca.OP_AND, ca.OP_OR):
        asked = [_answer(x) for x in operands]
        joined = {ca.OP_NOT: "!({0})", ca.OP_AND: "({0}) && ({1})", ca.OP_OR: "({0}) || ({1})"}
        return Term(joined[code].format(*asked), truth=True)
    if code == ca.OP_IF_ELSE_ZERO:
        return Term(f"{_answer(operands[0])} ? {_number(operands[1])} : BR_C(0.0)")
    texts = [_number(x) for x in operands]
    if code in _COMPARED:
        return Term(_COMPARED[code].format(*texts), truth=True)
    if code in _INFIX:
        return Term(f" {_INFIX[code]} ".join(texts))
    if code in _CALLS:
        return Term(f"{_CALLS[code]}({', '.join(texts)})")
    return Term(_OTHERS[code](*texts))


def _number(x: Term) -> str:
    return f"(br_real){x.text}" if x.truth else x.text


def _answer(x: Term) -> str:
    return x.text if x.truth else f"({x.text} < BR_C(0.0) || {x.text} > BR_C(0.0))"


def _assignment(name: str, value: Term) -> str:
    return f"const {'int' if value.truth else 'br_real'} {name} = {value.text};"


_C = Language("C99", operation, constant, _assignment, prefix="x")


def printed(function: ca.Function, operand: Callable[[int, int], str]) -> Printed:
    """The statements of a CasADi function in C, and the expressions of its outputs.

    Args:
        function: of numbers.
        operand: (input, element of it) -> what it is called in C.

    Raises InputError where an operation has no counterpart.
    """
    return statements(function, operand, _C)


def escaped(text: str) -> str:
    """A text for a comment: printable ASCII, without what ends a comment, begins a trigraph or joins lines."""
    plain = "".join(c if c.isascii() and c.isprintable() else f"<U+{ord(c):04X}>" for c in text)
    return re.sub(r"\?(?=\?)", "? ", plain).replace("*/", "* /").replace("/*", "/ *").replace("\\", "<U+005C>")
