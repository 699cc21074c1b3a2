"""Prints a CasADi function as JavaScript: `model.printing` in the language of pages."""

from collections.abc import Callable, Sequence

import casadi as ca

from bristle.model.printing import FUNCTIONS, INFIX, Language, Term, statements

HELPERS = """\
// NaN counts as missing, as in C.
const fmin = (x, y) => (x <= y || y !== y ? x : y);
const fmax = (x, y) => (x >= y || y !== y ? x : y);
const copysign = (x, y) => (y < 0 || Object.is(y, -0) ? -Math.abs(x) : Math.abs(x));
"""
"""What some operations need beside JavaScript's own `Math`; stands before what is printed."""

_INFIX = {**INFIX, ca.OP_FMOD: "%"}
_TRUTH = {ca.OP_LT: "<", ca.OP_LE: "<=", ca.OP_EQ: "===", ca.OP_NE: "!=="}
"""Comparisons, whose answers are 0 and 1, as CasADi's are."""
_HELPED = {ca.OP_FMIN: "fmin", ca.OP_FMAX: "fmax", ca.OP_COPYSIGN: "copysign"}
_OTHERS: dict[int, Callable[..., str]] = {
    ca.OP_ASSIGN: "{}".format,
    ca.OP_NEG: "-{}".format,
    ca.OP_SQ: "{0} * {0}".format,
    ca.OP_TWICE: "2 * {}".format,
    ca.OP_INV: "1 / {}".format,
    ca.OP_AND: "{} !== 0 && {} !== 0 ? 1 : 0".format,
    ca.OP_OR: "{} !== 0 || {} !== 0 ? 1 : 0".format,
    ca.OP_NOT: "{} === 0 ? 1 : 0".format,
    ca.OP_IF_ELSE_ZERO: "{} !== 0 ? {} : 0".format,
}


def operation(code: int, operands: Sequence[Term]) -> Term:
    """CasADi's operation of that number on these operands, as a JavaScript expression.

    Raises KeyError where JavaScript has no such operation: erf, erfinv.
    """
    texts = [x.text for x in operands]
    if code in _INFIX:
        return Term(f" {_INFIX[code]} ".join(texts))
    if code in _TRUTH:
        return Term(f" {_TRUTH[code]} ".join(texts) + " ? 1 : 0")
    if code in FUNCTIONS and code != ca.OP_ERF:
        return Term(f"{_HELPED.get(code) or f'Math.{FUNCTIONS[code]}'}({', '.join(texts)})")
    return Term(_OTHERS[code](*texts))


def _number(value: float) -> str:
    """A constant, exactly."""
    text = {"nan": "NaN", "inf": "Infinity", "-inf": "-Infinity"}.get(repr(value)) or repr(value).removesuffix(".0")
    return f"({text})" if text.startswith("-") else text


def printed(function: ca.Function, name: str) -> str:
    """A CasADi function as one of JavaScript with that name.

    Its arguments are the function's inputs, by their names: a number where that is 1x1, else an array-like of its
    elements, column after column. A function of one number returns it. Any other takes an array as its last argument,
    `out`, to which all elements of all outputs are written, one after the other.

    Raises ValueError where an operation has no counterpart in JavaScript.
    """
    arguments = [function.name_in(k) for k in range(function.n_in())]
    scalar = [function.numel_in(k) == 1 for k in range(function.n_in())]

    def operand(place: int, element: int) -> str:
        """An argument, or an element of one."""
        return arguments[place] if scalar[place] else f"{arguments[place]}[{element}]"

    javascript = Language("JavaScript", operation, _number, lambda name, value: f"const {name} = {value.text};")
    lines, outputs = statements(function, operand, javascript)
    if len(outputs) == 1:
        last = [f"return {outputs[0].text};"]
    else:
        arguments.append("out")
        last = [f"out[{k}] = {x.text};" for k, x in enumerate(outputs)]
    body = "".join(f"  {line}\n" for line in (*lines, *last))
    return f"function {name}({', '.join(arguments)}) {{\n{body}}}\n"
