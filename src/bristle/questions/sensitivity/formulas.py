"""The friction torque and its derivatives as formulas: CasADi expression -> SymPy -> text and LaTeX.

Nothing here knows a derivative; all come from `model.law` by CasADi. SymPy collects like terms and factors, so that one
formula has one form.
"""

import operator
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca

from bristle.control.adaptation import printed
from bristle.diagnostics import Diagnostic, Kind
from bristle.errors import InputError
from bristle.model import law
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import FASTEST, Law
from bristle.model.parameters import estimated_of, lugre_of

Formula = Any
"""A SymPy expression of z, v and the parameters: SymPy ships no types."""
_GUARD = 1e-50
"""A smaller constant keeps an expression finite at rest, and is no part of its formula."""


class Written(NamedTuple):
    """One formula as a reader sees it."""

    what: str
    formula: str
    """As Python reads it."""
    with_g: str
    """The same with g for g(v)."""
    latex: str
    """With g as well."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Formulas:
    """The friction torque of a law and its derivatives."""

    law: Law
    torque: Formula
    """T_f (3)."""
    stribeck: Formula
    """g(v) (5)."""
    partial: dict[str, Formula]
    """The derivative of T_f by each parameter at fixed z, and by `z`."""
    steady: dict[str, Formula]
    """The derivative of the steady torque by each parameter: the total one once the bristle has settled."""
    printed: Formula | None
    """The right-hand side of (19), without -gamma and e; None where the peak is not the paper's."""

    @property
    def printed_is(self) -> tuple[str, ...]:
        """The parameters by which the partial derivative is, term by term, what (19) prints."""
        return tuple(name for name, formula in self.partial.items() if formula == self.printed)

    def rows(self) -> tuple[Written, ...]:
        """Every formula, with what it is."""
        by_parameter = {f"dT_f/d{name} at fixed z": self.partial[name] for name in estimated_of(self.law)}
        steady = {f"dT_ss/d{name}, steady sliding": formula for name, formula in self.steady.items()}
        others = {
            "T_f": self.torque, **by_parameter, "dT_f/dz": self.partial["z"], **steady,
        } | ({} if self.printed is None else {"(19) as printed, without -gamma_1 and e": self.printed})  # fmt: skip  # a table
        short = {what: abbreviated(formula, self.stribeck) for what, formula in others.items()}
        return (
            Written("g(v)", as_text(self.stribeck), as_text(self.stribeck), as_latex(self.stribeck)),
            *(Written(what, as_text(x), as_text(short[what]), as_latex(short[what])) for what, x in others.items()),
        )

    def sentences(self) -> tuple[Diagnostic, ...]:
        """What the printed (19) is, compared term by term with CasADi's derivatives, and what the formulas are of."""
        more = [Kind.FORMULAS_AS_MEASURED(fastest=FASTEST)] if self.law.terms else []
        if self.printed is None:
            return Kind.TOTAL_DERIVATIVES(), *more
        same = tuple(f"dT_f/d{name}" for name in self.printed_is)
        extra = "" if "alpha_0" in self.printed_is else Kind.PRINTED_IS_ANOTHER()
        is_ = Kind.PRINTED_IS(derivatives=same, extra=extra) if same else Kind.PRINTED_IS_NONE(extra=extra)
        return is_, Kind.TOTAL_DERIVATIVES(), *more

    def text(self) -> str:
        """What `bristle sensitivity --symbolic` prints."""
        lines = ["Derivatives of the friction torque T_f (3)-(5), by CasADi.", ""]
        for row in self.rows():
            short = "" if row.with_g == row.formula else f"    = {row.with_g}\n"
            lines.append(f"{row.what}\n    = {row.formula}\n{short}    LaTeX: {row.latex}\n")
        return "\n".join([*lines, *map(str, self.sentences())])


def formulas(of: Law = GAUSSIAN) -> Formulas:
    """The formulas of a law, from `model.law` by CasADi; those of the paper's are what `bristle sensitivity --symbolic` prints.

    The viscous friction is written as it is up to the fastest speed that was measured: there no coefficient's sign
    matters.

    Raises InputError where SymPy is not installed, and ValueError as `formula_of` does.
    """
    z, v, p = ca.SX.sym("z"), ca.SX.sym("v"), lugre_of(of)(*map(ca.SX.sym, lugre_of(of)._fields))
    torque, steady = law.torque(z, v, p), law.steady_torque(v, p)
    estimated = [getattr(p, name) for name in estimated_of(of)]

    def written(expression: Any) -> Formula:
        """As a formula."""
        return formula_of(expression, of.coefficients)

    return Formulas(
        law=of,
        torque=written(torque),
        stribeck=written(law.stribeck(v, p)),
        partial={x.name(): written(ca.jacobian(torque, x)) for x in (z, *estimated)},
        steady={x.name(): written(ca.jacobian(steady, x)) for x in estimated},
        printed=written(printed("alpha_0", z, v, p)) if of.peak == GAUSSIAN.peak else None,
    )


def formula_of(expression: Any, not_negative: Collection[str] = ()) -> Formula:
    """A scalar CasADi expression (SX) over its named symbols as a SymPy one, instruction by instruction.

    What is not negative by assumption leaves no choice between formulas that is made by its sign.

    Raises InputError where SymPy is not installed, and ValueError for an operation that has no place in a formula.
    """
    sympy = _sympy()
    operations = {
        ca.OP_ADD: operator.add, ca.OP_SUB: operator.sub, ca.OP_MUL: operator.mul, ca.OP_DIV: operator.truediv,
        ca.OP_NEG: operator.neg, ca.OP_TWICE: lambda a: 2 * a, ca.OP_INV: lambda a: 1 / a, ca.OP_SQ: lambda a: a**2,
        ca.OP_FABS: sympy.Abs, ca.OP_EXP: sympy.exp, ca.OP_SIGN: sympy.sign, ca.OP_LOG: sympy.log, ca.OP_SQRT: sympy.sqrt,
        ca.OP_POW: operator.pow, ca.OP_CONSTPOW: operator.pow, ca.OP_TANH: sympy.tanh, ca.OP_COSH: sympy.cosh,
        ca.OP_SINH: sympy.sinh, ca.OP_ATAN: sympy.atan, ca.OP_ERF: sympy.erf, ca.OP_LOG1P: lambda a: sympy.log(1 + a),
        ca.OP_EXPM1: lambda a: sympy.exp(a) - 1, ca.OP_FMIN: sympy.Min, ca.OP_FMAX: sympy.Max,
        ca.OP_LT: lambda a, b: sympy.Piecewise((1, a < b), (0, True)), ca.OP_NOT: lambda a: 1 - a,
        ca.OP_LE: lambda a, b: sympy.Piecewise((1, a <= b), (0, True)), ca.OP_IF_ELSE_ZERO: operator.mul,
    }  # fmt: skip  # a table
    symbols = ca.symvar(expression)
    function = ca.Function("formula", symbols, [ca.densify(expression)])
    work: dict[int, Formula] = {}
    result: Formula = sympy.Integer(0)  # a structurally zero output has no instruction
    for k in range(function.n_instructions()):
        code, read, write = function.instruction_id(k), function.instruction_input(k), function.instruction_output(k)
        if code == ca.OP_INPUT:
            name = symbols[read[0]].name()
            signed = {"nonnegative": True} if name in not_negative else {"real": True}
            work[write[0]] = sympy.Symbol(name, **signed)
        elif code == ca.OP_CONST:
            constant = function.instruction_constant(k)
            work[write[0]] = sympy.Rational(constant if abs(constant) > _GUARD else 0)
        elif code == ca.OP_OUTPUT:
            result = work[read[0]]
        elif code in operations:
            work[write[0]] = operations[code](*(work[place] for place in read))
        else:
            raise ValueError(f"CasADi operation number {code} cannot be written as a formula")
    return result


def abbreviated(formula: Formula, stribeck: Formula) -> Formula:
    """The formula with g standing for g(v)."""
    return formula.xreplace({stribeck: _sympy().Symbol("g", real=True)})


def as_text(formula: Formula) -> str:
    """A formula as Python reads it; SymPy calls the absolute value Abs."""
    return str(_sympy().sstr(formula)).replace("Abs(", "abs(")


def as_latex(formula: Formula) -> str:
    """A formula as LaTeX's mathematics reads it."""
    return str(_sympy().latex(formula))


def _sympy() -> Any:
    """SymPy. Raises InputError where it is not installed."""
    try:
        import sympy
    except ImportError as error:
        raise InputError(
            "formulas need SymPy, which is not installed; install it with pip install 'bristle[sensitivity]'"
        ) from error
    return sympy
