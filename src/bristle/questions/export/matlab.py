"""Export to MATLAB and Octave: a script that assigns a struct of parameters, and equations of other laws."""

import math
import re
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import casadi as ca

from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.parameters import unit
from bristle.model.printing import FUNCTIONS, Language, Term, statements
from bristle.page.wording import slugs
from bristle.questions.export.export import Artefact, ExportTarget, Request, equations, in_ascii, notes, slug
from bristle.questions.export.exported import WAYS, ExportedJoint

_LONGEST = 50  # characters of an identifier; MATLAB takes 63
_WORDS = frozenset({
    "break", "case", "catch", "classdef", "continue", "do", "else", "elseif", "end", "endfor", "endfunction", "endif", "endwhile", "for",
    "function", "global", "if", "otherwise", "parfor", "persistent", "return", "spmd", "switch", "try", "until", "unwind_protect", "while",
    "struct", "true", "false", "uint8", "native2unicode", "inf", "nan",
})  # fmt: skip  # keywords of MATLAB and Octave, and names that the script calls
_HOLDS = "every parameter with unit, standard error, 95 % interval and source; warnings as comments"


def write_matlab(joints: Sequence[ExportedJoint], request: Request) -> Artefact:  # noqa: ARG001  # nothing is lost along any motion
    """The script: a struct of one joint, or `robot` with a field per joint."""
    names = [_identifier(name) for name in slugs([joint.name for joint in joints])]
    name = _identifier(slug(joints))
    places = [name] if len(joints) == 1 else [f"{name}.{field}" for field in names]
    lines = [line for joint, place in zip(joints, places, strict=True) for line in _lines(joint, place)]
    text = "\n".join((f"% Friction that bristle identified; run it to get the struct {name}.", *lines)) + "\n"
    holds = f"{_HOLDS}; the equations of the law" if any(joint.law != GAUSSIAN for joint in joints) else _HOLDS
    return Artefact(name=f"{name}_friction.m", content=text.encode("ascii"), holds=holds)


def _identifier(text: str) -> str:
    name = re.sub(r"\W+", "_", text, flags=re.ASCII).strip("_")[:_LONGEST]
    return name if name[:1].isalpha() and name not in _WORDS else f"joint_{name}"


def _lines(joint: ExportedJoint, place: str) -> Iterator[str]:
    yield "%"
    for note in notes(joint):
        yield f"% {in_ascii(note)}"
    yield f"{place} = struct();"
    for name in ("name", "kind", "simulated", "trust"):
        yield f"{place}.{name} = {_constant(getattr(joint, name))};"
    yield f"{place}.inertia = {_constant(joint.inertia)}; % {unit('inertia', joint.kind)}, all that the joint accelerates"
    yield f"{place}.fastest = {_constant(joint.fastest)}; % {unit('velocity', joint.kind)}, up to which it was identified"
    yield f"{place}.bristle = {_constant(joint.origin.bristle)};"
    yield f"{place}.results_sha256 = {_constant(joint.origin.results_sha256 or '')};"
    for one in joint.parameters:
        columns = ("value", "unit", "standard_error", "interval", "source", "assumed")
        fields = ", ".join(f"'{name}', {_constant(getattr(one, name))}" for name in columns)
        yield f"{place}.{WAYS[one.parameter.direction]}.{_identifier(one.parameter.name)} = struct({fields});"
    if joint.law != GAUSSIAN:
        yield f"{place}.law = {_constant(joint.law.name)};"
        yield "% Of a set p such as .positive, chosen by the sign of v; of two sets sigma_0 goes by the sign of z, the deflection of the bristle."
    for told in equations(joint):
        text = in_matlab(told.expression, lambda x: x if x in ("z", "v") else f"p.{_identifier(x)}.value")
        yield f"{place}.{told.name} = @({', '.join(told.of)}, p) {text}; % {told.unit}"


def _constant(x: str | float | tuple[float, ...] | None) -> str:
    """A value in MATLAB: numbers with all digits, other text than printable ASCII by its bytes, [] for None."""
    if x is None or isinstance(x, tuple):
        return f"[{', '.join(map(_constant, x or ()))}]"
    if isinstance(x, bool):
        return "true" if x else "false"
    if not isinstance(x, str):
        return repr(x) if math.isfinite(x) else "NaN" if math.isnan(x) else "Inf" if x > 0 else "-Inf"
    if x.isascii() and x.isprintable():
        return "'" + x.replace("'", "''") + "'"
    codes = " ".join(map(str, x.encode("utf-8", "replace")))
    return f"native2unicode(uint8([{codes}]), 'UTF-8')"


_PATTERNS = {
    ca.OP_ASSIGN: "{0}", ca.OP_ADD: "{0} + {1}", ca.OP_SUB: "{0} - {1}", ca.OP_MUL: "{0} .* {1}", ca.OP_DIV: "{0} ./ {1}",
    ca.OP_NEG: "-{0}", ca.OP_SQ: "{0} .^ 2", ca.OP_TWICE: "2 .* {0}", ca.OP_INV: "1 ./ {0}",
    ca.OP_POW: "{0} .^ {1}", ca.OP_CONSTPOW: "{0} .^ {1}", ca.OP_FMOD: "rem({0}, {1})",
    ca.OP_LT: "{0} < {1}", ca.OP_LE: "{0} <= {1}", ca.OP_EQ: "{0} == {1}", ca.OP_NE: "{0} ~= {1}",
    ca.OP_NOT: "~{0}", ca.OP_AND: "{0} & {1}", ca.OP_OR: "{0} | {1}",
    ca.OP_IF_ELSE_ZERO: "min(max({1}, -realmax .* {0}), realmax .* {0})",  # a product with infinity is NaN
}  # fmt: skip  # a table
_COMPARED = frozenset({ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_NOT, ca.OP_AND, ca.OP_OR})


def in_matlab(expression: Any, operand: Callable[[str], str]) -> str:
    """A scalar CasADi expression (SX) in MATLAB and Octave, elementwise; `operand`: name of a symbol -> name there.

    Raises InputError where an operation has no counterpart.
    """

    def operation(code: int, operands: Sequence[Term]) -> Term:  # KeyError: none gives the same real number
        texts = [x.text for x in operands]
        if code in _PATTERNS:
            return Term(_PATTERNS[code].format(*texts), truth=code in _COMPARED)
        if code in (ca.OP_COPYSIGN, ca.OP_ASINH, ca.OP_ACOSH, ca.OP_ATANH):
            raise KeyError(code)
        return Term(f"{FUNCTIONS[code]}({', '.join(texts)})")

    symbols = ca.symvar(expression)
    function = ca.Function("expression", symbols, [ca.densify(expression)], {"cse": True})
    matlab = Language("MATLAB", operation, repr, lambda name, value: f"{name}={value.text}", prefix="#")
    lines, (value,) = statements(function, lambda place, _: operand(symbols[place].name()), matlab)
    known: dict[str, str] = {}

    def whole(text: str) -> str:  # names replaced by their values, as an anonymous function has no statements
        return re.sub(r"#\d+", lambda name: known[name[0]], text)

    for line in lines:
        name, text = line.split("=", 1)
        known[name] = f"({whole(text)})"
    return whole(value.text)


TARGET = ExportTarget(write=write_matlab)
