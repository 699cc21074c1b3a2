"""Prints a CasADi function as code of another language, so that a page or a controller evaluates the very expressions that bristle does.

The instructions are those that `vectorize` walks for NumPy; every value is a name of its own, assigned once.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import casadi as ca

from bristle.errors import InputError


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
