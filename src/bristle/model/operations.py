"""CasADi functions instruction by instruction, and the NumPy counterpart of each operation."""

from collections.abc import Callable
from typing import TypeVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy import special

T = TypeVar("T")
Floats = NDArray[np.float64]
Operation = Callable[..., object]  # A ufunc of operands and an optional output array, the last one

_ZERO = np.array(0.0)


def walked(
    function: ca.Function,
    operand: Callable[[int, int], T],
    constant: Callable[[float], T],
    operation: Callable[[int, list[T], int], T],
) -> dict[tuple[int, int], T]:
    """A CasADi function evaluated with any values: (output, element) -> value, structural zeros left out.

    Args:
        function: expanded where it is no SX function.
        operand: (input, element of it, column after column) -> value.
        constant: number -> value.
        operation: (CasADi's number of it, operands, number of the instruction) -> value.
    """
    function = function if function.is_a("SXFunction") else function.expand()
    work, outputs = dict[int, T](), dict[tuple[int, int], T]()
    for k in range(function.n_instructions()):
        code, read, write = function.instruction_id(k), function.instruction_input(k), function.instruction_output(k)
        if code == ca.OP_OUTPUT:
            outputs[write[0], function.sparsity_out(write[0]).find()[write[1]]] = work[read[0]]
        elif code == ca.OP_INPUT:
            work[write[0]] = operand(read[0], function.sparsity_in(read[0]).find()[read[1]])
        elif code == ca.OP_CONST:
            work[write[0]] = constant(float(function.instruction_constant(k)))
        else:
            work[write[0]] = operation(code, [work[r] for r in read], k)
    return outputs


def choose(condition: Floats, value: Floats, otherwise: Floats, out: Floats | None = None) -> object:
    """CasADi's if_else."""
    chosen = np.where(condition, value, otherwise)
    if out is None:
        return chosen
    np.copyto(out, chosen)
    return out


def _truth(ufunc: np.ufunc) -> Operation:
    """A comparison with answers 0.0 and 1.0, as CasADi's."""

    def compare(*operands: Floats) -> object:
        """The answers, in the output array or new."""
        return ufunc(*operands) if len(operands) > ufunc.nin else ufunc(*operands).astype(np.float64)

    return compare


_LOWEST = np.array(-700.0)


def _exp(x: Floats, *out: Floats) -> object:
    """exp(x), at least 1e-304: NumPy is slow where a result underflows."""
    return np.exp(np.fmax(x, _LOWEST, *out), *out)


OPERATIONS: dict[int, Operation] = {
    ca.OP_ASSIGN: np.positive, ca.OP_ADD: np.add, ca.OP_SUB: np.subtract, ca.OP_MUL: np.multiply, ca.OP_DIV: np.true_divide,
    ca.OP_NEG: np.negative, ca.OP_SQ: np.square, ca.OP_TWICE: lambda x, *out: np.add(x, x, *out), ca.OP_INV: np.reciprocal,
    ca.OP_EXP: _exp, ca.OP_EXPM1: np.expm1, ca.OP_LOG: np.log, ca.OP_LOG1P: np.log1p, ca.OP_POW: np.power,
    ca.OP_CONSTPOW: np.power, ca.OP_SQRT: np.sqrt, ca.OP_HYPOT: np.hypot, ca.OP_ERF: special.erf,
    ca.OP_SIN: np.sin, ca.OP_COS: np.cos, ca.OP_TAN: np.tan, ca.OP_ASIN: np.arcsin, ca.OP_ACOS: np.arccos, ca.OP_ATAN: np.arctan,
    ca.OP_ATAN2: np.arctan2, ca.OP_SINH: np.sinh, ca.OP_COSH: np.cosh, ca.OP_TANH: np.tanh, ca.OP_ASINH: np.arcsinh,
    ca.OP_ACOSH: np.arccosh, ca.OP_ATANH: np.arctanh, ca.OP_FABS: np.absolute, ca.OP_SIGN: np.sign,
    ca.OP_COPYSIGN: np.copysign, ca.OP_FMOD: np.fmod, ca.OP_FMIN: np.fmin, ca.OP_FMAX: np.fmax, ca.OP_FLOOR: np.floor,
    ca.OP_CEIL: np.ceil, ca.OP_LT: _truth(np.less), ca.OP_LE: _truth(np.less_equal), ca.OP_EQ: _truth(np.equal),
    ca.OP_NE: _truth(np.not_equal), ca.OP_AND: _truth(np.logical_and), ca.OP_OR: _truth(np.logical_or),
    ca.OP_NOT: _truth(np.logical_not), ca.OP_IF_ELSE_ZERO: lambda condition, value, *out: choose(condition, value, _ZERO, *out),
}  # fmt: skip  # a table
"""NumPy counterparts by CasADi's operation number; its erfinv is too rough to be one."""
