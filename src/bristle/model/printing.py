"""Prints a CasADi function as code of another language, so that a page or a controller evaluates the very expressions that bristle does.

The instructions are those that `vectorize` walks for NumPy; every value is a name of its own, assigned once.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import casadi as ca

from bristle.errors import InputError

FUNCTIONS = {
    ca.OP_EXP: "exp", ca.OP_EXPM1: "expm1", ca.OP_LOG: "log", ca.OP_POW: "pow", ca.OP_CONSTPOW: "pow", ca.OP_SQRT: "sqrt",
    ca.OP_SIN: "sin", ca.OP_COS: "cos", ca.OP_TANH: "tanh", ca.OP_LOG1P: "log1p", ca.OP_TAN: "tan", ca.OP_ASIN: "asin",
    ca.OP_ACOS: "acos", ca.OP_ATAN: "atan", ca.OP_ATAN2: "atan2", ca.OP_SINH: "sinh", ca.OP_COSH: "cosh", ca.OP_ASINH: "asinh",
    ca.OP_ACOSH: "acosh", ca.OP_ATANH: "atanh", ca.OP_HYPOT: "hypot", ca.OP_ERF: "erf", ca.OP_FLOOR: "floor",
    ca.OP_CEIL: "ceil", ca.OP_FMOD: "fmod", ca.OP_COPYSIGN: "copysign", ca.OP_FABS: "abs", ca.OP_SIGN: "sign",
    ca.OP_FMIN: "min", ca.OP_FMAX: "max",
}  # fmt: skip  # a table
"""CasADi's operations that are calls of a function, most of them by their name in math.h; bristle's own laws need those up to tanh."""
INFIX = {ca.OP_ADD: "+", ca.OP_SUB: "-", ca.OP_MUL: "*", ca.OP_DIV: "/"}


class Term(NamedTuple):
    """An expression in the language that is printed."""

    text: str
    truth: bool = False
    """Whether it is an answer, 0 or 1, and no number."""


class Language(NamedTuple):
    """How values are written down."""

    name: str
    operation: Callable[[int, Sequence[Term]], Term]
    """CasADi's operation of that number on these operands; raises KeyError where the language has none."""
    constant: Callable[[float], str]
    assignment: Callable[[str, Term], str]
    """(name, value) -> the statement that gives the value its name."""
    prefix: str = "_"
    """Of the names."""


class Printed(NamedTuple):
    """A function as statements, and an expression for each element of its outputs, one output after the other."""

    statements: tuple[str, ...]
    outputs: tuple[Term, ...]


def statements(function: ca.Function, operand: Callable[[int, int], str], language: Language) -> Printed:
    """A CasADi function in another language.

    Args:
        function: whatever it is; what is no SX function is expanded.
        operand: (input, element of it, column after column) -> its name there.
        language: of the target.

    Raises InputError where the language has no counterpart of an operation, which is of a law from outside.
    """
    function = function if function.is_a("SXFunction") else function.expand()
    ends = [0]
    for k in range(function.n_out()):
        ends.append(ends[-1] + function.numel_out(k))
    outputs = [Term(language.constant(0.0))] * ends[-1]  # an element that is zero by structure has no instruction
    work: dict[int, Term] = {}
    lines = []
    for k in range(function.n_instructions()):
        code, read, write = function.instruction_id(k), function.instruction_input(k), function.instruction_output(k)
        if code == ca.OP_INPUT:
            place, element = read
            work[write[0]] = Term(operand(place, function.sparsity_in(place).find()[element]))
        elif code == ca.OP_OUTPUT:
            place, element = write
            outputs[ends[place] + function.sparsity_out(place).find()[element]] = work[read[0]]
        elif code == ca.OP_CONST:
            work[write[0]] = Term(language.constant(float(function.instruction_constant(k))))
        else:
            try:
                value = language.operation(code, [work[r] for r in read])
            except KeyError:
                raise InputError(
                    f"{function.name()}: CasADi operation number {code} has no {language.name} counterpart; "
                    "write the expression without it"
                ) from None
            work[write[0]] = Term(f"{language.prefix}{k}", value.truth)
            lines.append(language.assignment(f"{language.prefix}{k}", value))
    return Printed(tuple(lines), tuple(outputs))
