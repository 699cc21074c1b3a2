"""CasADi expressions as formulas: CasADi -> SymPy -> text and LaTeX."""

import operator
from collections.abc import Callable, Mapping
from typing import Any

import casadi as ca

from bristle.errors import InputError
from bristle.model.operations import walked

Formula = Any  # a SymPy expression of z, v and the parameters: SymPy ships no types
_GUARD = 1e-90  # a constant below it keeps an evaluation finite at rest, and has no place in a formula


def formula_of(expression: Any, signed: Mapping[str, float] | None = None) -> Formula:
    """A scalar CasADi expression (SX) over named symbols as a SymPy one; `signed` symbols have the sign of their value.

    Raises InputError where SymPy is not installed, or an operation has no place in a formula.
    """
    sympy, symbols = _sympy(), ca.symvar(expression)
    operations: dict[int, Callable[..., Formula]] = {
        ca.OP_ASSIGN: operator.pos, ca.OP_ADD: operator.add, ca.OP_SUB: operator.sub, ca.OP_MUL: operator.mul,
        ca.OP_DIV: operator.truediv, ca.OP_NEG: operator.neg, ca.OP_TWICE: lambda a: 2 * a, ca.OP_INV: lambda a: 1 / a,
        ca.OP_SQ: lambda a: a**2, ca.OP_POW: operator.pow, ca.OP_CONSTPOW: operator.pow, ca.OP_SQRT: sympy.sqrt,
        ca.OP_FABS: sympy.Abs, ca.OP_SIGN: sympy.sign, ca.OP_EXP: _exp, ca.OP_EXPM1: lambda a: sympy.exp(a) - 1,
        ca.OP_LOG: sympy.log, ca.OP_LOG1P: lambda a: sympy.log(1 + a), ca.OP_FMIN: sympy.Min, ca.OP_FMAX: sympy.Max,
        ca.OP_SIN: sympy.sin, ca.OP_COS: sympy.cos, ca.OP_TAN: sympy.tan, ca.OP_SINH: sympy.sinh, ca.OP_COSH: sympy.cosh,
        ca.OP_TANH: sympy.tanh, ca.OP_ATAN: sympy.atan, ca.OP_ERF: sympy.erf,
        ca.OP_LT: sympy.Lt, ca.OP_LE: sympy.Le, ca.OP_EQ: sympy.Eq, ca.OP_NE: sympy.Ne,
        ca.OP_NOT: sympy.Not, ca.OP_AND: sympy.And, ca.OP_OR: sympy.Or,
        ca.OP_IF_ELSE_ZERO: lambda asked, a: sympy.Piecewise((a, asked), (0, True)),
    }  # fmt: skip  # a table
    function = ca.Function("formula", symbols, [ca.densify(expression)])

    def constant(x: float) -> Formula:
        return sympy.Rational(repr(x)) if abs(x) > _GUARD else sympy.Integer(0)

    def operation(code: int, operands: list[Formula], _: int) -> Formula:
        if code not in operations:
            raise InputError(f"CasADi operation number {code} cannot be written as a formula")
        return operations[code](*operands)

    found = walked(function, lambda place, _: symbol_of(symbols[place].name(), signed), constant, operation)
    return found.get((0, 0), sympy.Integer(0))


def symbol_of(name: str, signed: Mapping[str, float] | None = None) -> Formula:
    """A symbol for a number, with the sign of its value if given."""
    value = (signed or {}).get(name)
    sign = {} if value is None else {"negative": True} if value < 0 else {"nonnegative": True}
    return _sympy().Symbol(name, real=True, **sign)


def _exp(a: Formula) -> Formula:
    """exp(a); where a is b log(c), c**b."""
    sympy = _sympy()
    logs = [factor for factor in sympy.Mul.make_args(a) if isinstance(factor, sympy.log)]
    return logs[0].args[0] ** (a / logs[0]) if len(logs) == 1 else sympy.exp(a)


def abbreviated(formula: Formula, stribeck: Formula) -> Formula:
    """The formula with g standing for g(v)."""
    return formula.xreplace({stribeck: _sympy().Symbol("g", real=True)})


def as_text(formula: Formula) -> str:
    """A formula in Python's notation."""
    return str(_sympy().sstr(formula)).replace("Abs(", "abs(")


def as_latex(formula: Formula) -> str:
    """A formula in LaTeX."""
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
