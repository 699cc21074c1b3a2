"""CasADi functions printed as code of another language, a name for every value."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import casadi as ca

from bristle.errors import InputError
from bristle.model.operations import walked

FUNCTIONS = {
    ca.OP_EXP: "exp", ca.OP_EXPM1: "expm1", ca.OP_LOG: "log", ca.OP_POW: "pow", ca.OP_CONSTPOW: "pow", ca.OP_SQRT: "sqrt",
    ca.OP_SIN: "sin", ca.OP_COS: "cos", ca.OP_TANH: "tanh", ca.OP_LOG1P: "log1p", ca.OP_TAN: "tan", ca.OP_ASIN: "asin",
    ca.OP_ACOS: "acos", ca.OP_ATAN: "atan", ca.OP_ATAN2: "atan2", ca.OP_SINH: "sinh", ca.OP_COSH: "cosh", ca.OP_ASINH: "asinh",
    ca.OP_ACOSH: "acosh", ca.OP_ATANH: "atanh", ca.OP_HYPOT: "hypot", ca.OP_ERF: "erf", ca.OP_FLOOR: "floor",
    ca.OP_CEIL: "ceil", ca.OP_FMOD: "fmod", ca.OP_COPYSIGN: "copysign", ca.OP_FABS: "abs", ca.OP_SIGN: "sign",
    ca.OP_FMIN: "min", ca.OP_FMAX: "max",
}  # fmt: skip  # a table
"""CasADi operations that are function calls, mostly of math.h."""
INFIX = {ca.OP_ADD: "+", ca.OP_SUB: "-", ca.OP_MUL: "*", ca.OP_DIV: "/"}


class Term(NamedTuple):
    """An expression in the target language."""

    text: str
    truth: bool = False  # Whether it is a truth value, 0 or 1


class Language(NamedTuple):
    """How values are written."""

    name: str
    operation: Callable[[int, Sequence[Term]], Term]
    """An operation by CasADi's number; raises KeyError for unknown ones."""
    constant: Callable[[float], str]
    assignment: Callable[[str, Term], str]  # (name, value) -> statement
    prefix: str = "_"  # Of the names


class Printed(NamedTuple):
    """Statements, and an expression for each output element."""

    statements: tuple[str, ...]
    outputs: tuple[Term, ...]


def statements(function: ca.Function, operand: Callable[[int, int], str], language: Language) -> Printed:
    """A CasADi function in another language.

    Args:
        function: expanded where it is no SX function.
        operand: (input, element of it, column after column) -> its name there.
        language: of the target.

    Raises InputError where the language has no counterpart of an operation.
    """
    lines, zero = list[str](), Term(language.constant(0.0))

    def operation(code: int, operands: list[Term], k: int) -> Term:
        try:
            value = language.operation(code, operands)
        except KeyError:
            raise InputError(
                f"{function.name()}: CasADi operation number {code} has no {language.name} counterpart; "
                "write the expression without it"
            ) from None
        lines.append(language.assignment(f"{language.prefix}{k}", value))
        return Term(f"{language.prefix}{k}", value.truth)

    found = walked(function, lambda *place: Term(operand(*place)), lambda x: Term(language.constant(x)), operation)
    places = ((k, element) for k in range(function.n_out()) for element in range(function.numel_out(k)))
    return Printed(tuple(lines), tuple(found.get(place, zero) for place in places))
