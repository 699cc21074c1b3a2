"""Prints a CasADi expression as one expression of MATLAB and Octave: `model.printing` in their language, element by element.

An anonymous function holds no statements, so each value stands where it is used.
"""

import re
from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca

from bristle.model.printing import Language, Term, statements

_PATTERNS = {
    ca.OP_ASSIGN: "{0}", ca.OP_ADD: "{0} + {1}", ca.OP_SUB: "{0} - {1}", ca.OP_MUL: "{0} .* {1}", ca.OP_DIV: "{0} ./ {1}",
    ca.OP_NEG: "-{0}", ca.OP_SQ: "{0} .^ 2", ca.OP_TWICE: "2 .* {0}", ca.OP_INV: "1 ./ {0}",
    ca.OP_POW: "{0} .^ {1}", ca.OP_CONSTPOW: "{0} .^ {1}",
    ca.OP_LT: "{0} < {1}", ca.OP_LE: "{0} <= {1}", ca.OP_EQ: "{0} == {1}", ca.OP_NE: "{0} ~= {1}",
    ca.OP_NOT: "~{0}", ca.OP_AND: "{0} & {1}", ca.OP_OR: "{0} | {1}",
    ca.OP_IF_ELSE_ZERO: "min(max({1}, -realmax .* {0}), realmax .* {0})",  # a product would make NaN of what is left out
    ca.OP_FABS: "abs({0})", ca.OP_SIGN: "sign({0})", ca.OP_FMIN: "min({0}, {1})", ca.OP_FMAX: "max({0}, {1})",
    ca.OP_EXP: "exp({0})", ca.OP_EXPM1: "expm1({0})", ca.OP_LOG: "log({0})", ca.OP_LOG1P: "log1p({0})",
    ca.OP_SQRT: "sqrt({0})", ca.OP_SIN: "sin({0})", ca.OP_COS: "cos({0})", ca.OP_TAN: "tan({0})", ca.OP_ASIN: "asin({0})",
    ca.OP_ACOS: "acos({0})", ca.OP_ATAN: "atan({0})", ca.OP_ATAN2: "atan2({0}, {1})", ca.OP_SINH: "sinh({0})",
    ca.OP_COSH: "cosh({0})", ca.OP_TANH: "tanh({0})", ca.OP_ERF: "erf({0})", ca.OP_HYPOT: "hypot({0}, {1})",
    ca.OP_FLOOR: "floor({0})", ca.OP_CEIL: "ceil({0})", ca.OP_FMOD: "rem({0}, {1})",
}  # fmt: skip  # a table
_COMPARED = frozenset({ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_NOT, ca.OP_AND, ca.OP_OR})


def _operation(code: int, operands: Sequence[Term]) -> Term:
    return Term(_PATTERNS[code].format(*(x.text for x in operands)), truth=code in _COMPARED)


_MATLAB = Language("MATLAB", _operation, repr, lambda name, value: f"{name}={value.text}", prefix="#")


def in_matlab(expression: Any, operand: Callable[[str], str]) -> str:
    """A scalar CasADi expression (SX) of named symbols as MATLAB has it.

    Args:
        expression: of symbols.
        operand: (name of a symbol) -> what it is called there.

    Raises InputError where an operation has no counterpart.
    """
    symbols = ca.symvar(expression)
    function = ca.Function("expression", symbols, [ca.densify(expression)], {"cse": True})
    lines, (value,) = statements(function, lambda place, _: operand(symbols[place].name()), _MATLAB)
    known: dict[str, str] = {}

    def whole(text: str) -> str:
        """A text in which each name stands for its value."""
        return re.sub(r"#\d+", lambda name: known[name[0]], text)

    for line in lines:
        name, text = line.split("=", 1)
        known[name] = f"({whole(text)})"
    return whole(value.text)
