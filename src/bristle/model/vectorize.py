"""Scalar CasADi functions over NumPy arrays, and scans of linear recurrences, without a compiler."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import count
from math import gcd, prod
from operator import itemgetter
from typing import Any

import casadi as ca
import numpy as np
from scipy.linalg import lapack

from bristle.arrays import Array
from bristle.model.operations import OPERATIONS, Operation, choose, walked

_IF_ELSE_ZERO, _NOT = OPERATIONS[ca.OP_IF_ELSE_ZERO], OPERATIONS[ca.OP_NOT]
_BLOCK = 16_384  # elements per block, whose buffers stay in the cache
_TOGETHER = 10  # ticks that are written out as one, at most
_REUSE = 4096  # elements from which looking for memory to write over is worth the while


@dataclass(frozen=True, slots=True)
class _Instruction:
    operation: Operation
    value: int
    operands: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class _Plan:
    """Program for one choice of array inputs; registers hold scalars, input blocks, outputs or buffers."""

    size: int  # Number of registers
    scalars: tuple[_Instruction, ...]  # Operations that depend on no array, once per call
    steps: tuple[tuple[Operation, Callable[[Sequence[Any]], Any]], ...]
    """Operations per block, with their registers, the output last."""
    buffers: tuple[int, ...]  # Registers that need a buffer
    rows: dict[int, int]  # Register -> output row
    copies: tuple[tuple[int, int], ...]
    """(output row, register) of outputs that are inputs, constants, scalars or other outputs."""


class Vectorised:
    """A scalar `ca.Function` as a list of ufunc calls; made by `vectorised`."""

    def __init__(self, function: ca.Function) -> None:
        name, (n_in, self._n_out) = function.name(), (function.n_in(), function.n_out())
        sizes = [function.size_in(i) for i in range(n_in)] + [function.size_out(i) for i in range(self._n_out)]
        if any(size != (1, 1) for size in sizes):
            raise ValueError(
                f"{name}: inputs and outputs have sizes {sizes}; expected 1x1 each: split vectors into scalars"
            )
        self._name, self._n_in = name, n_in
        self._plans: dict[tuple[bool, ...], _Plan] = {}
        # buffers of calls that have ended, for the next: fresh memory is slow, and threads may call at once
        self._spare: list[Array] = []
        self._constants: dict[int, float] = {}
        self._program: list[_Instruction] = []
        numbers = count(n_in)  # values 0..n_in-1 are the inputs, each other value is assigned once

        def constant(x: float) -> int:
            value = next(numbers)
            self._constants[value] = x
            return value

        def operation(code: int, operands: list[int], _: int) -> int:
            if code not in OPERATIONS:
                raise ValueError(
                    f"{name}: CasADi operation number {code} has no NumPy counterpart; write the expression without it"
                )
            self._program.append(_Instruction(OPERATIONS[code], next(numbers), tuple(operands)))
            return self._program[-1].value

        found = walked(function, lambda place, _: place, constant, operation)
        rows = range(self._n_out)  # a structurally zero output has no instruction
        self._outputs = {row: found[row, 0] if (row, 0) in found else constant(0.0) for row in rows}
        self._n_values = next(numbers)
        self._registers: list[Any] = [None] * self._n_values
        for register, number in self._constants.items():
            self._registers[register] = np.array(number)
        self._program = _with_choices(self._program, set(self._outputs.values()))
        last = {operand: k for k, instruction in enumerate(self._program) for operand in instruction.operands}
        values = list(self._outputs.values())
        computed = {instruction.value for instruction in self._program}
        inner = computed.difference(values)
        self._fresh = [x in computed and x not in values[:row] for row, x in enumerate(values)]
        self._small = []
        for k, i in enumerate(self._program):
            first = i.operands[0]
            pick = itemgetter(*i.operands) if len(i.operands) > 1 else itemgetter(slice(first, first + 1))
            self._small.append(
                (i.operation, i.value, pick, [*inner.intersection(o for o in i.operands if last[o] == k)])
            )

    def __call__(self, *inputs: float | Array, out: Sequence[Array] | None = None) -> Sequence[Array]:
        """Evaluate at inputs of shapes that broadcast; one array of the common shape per output.

        `out`, contiguous arrays of the common shape, one per output, receives the results where it is given. Raises
        ValueError where the number of inputs is wrong or their shapes do not broadcast.
        """
        if len(inputs) != self._n_in:
            raise ValueError(f"{self._name}: got {len(inputs)} inputs; expected {self._n_in}")
        arrays = [np.asarray(x, dtype=np.float64) for x in inputs]
        shape = np.broadcast(*arrays).shape
        if out is None and shape and prod(shape) <= _BLOCK:
            return self._run_small(arrays, shape)
        if out is None and len(shape) == 2 and shape[0] > 1 and shape[1] > _BLOCK:
            # a row at a time: what is one number in it is not repeated
            out = tuple(np.empty(shape) for _ in range(self._n_out))
            for i, rows in enumerate(zip(*out, strict=True)):
                self(*(x if x.ndim < 2 else x[min(i, len(x) - 1)] for x in arrays), out=rows)
            return out
        is_array = tuple(x.size != 1 for x in arrays)
        if is_array not in self._plans:
            self._plans[is_array] = self._plan(is_array)
        plan = self._plans[is_array]
        registers: list[Any] = [None] * plan.size
        for register, constant in self._constants.items():
            registers[register] = constant
        flat: list[tuple[int, Array]] = []
        for i, x in enumerate(arrays):
            if is_array[i]:
                flat.append((i, (x if x.shape == shape else np.broadcast_to(x, shape)).reshape(-1)))
            else:
                registers[i] = x.item()
        if out is None:
            out = tuple(np.empty(shape) for _ in range(self._n_out))
        self._run(plan, registers, flat, [row.reshape(-1) for row in out])
        return out

    def _run_small(self, inputs: Sequence[Array], shape: tuple[int, ...]) -> Sequence[Array]:
        """Each instruction at the shape of its operands; finished large values are overwritten."""
        registers = self._registers.copy()
        registers[: self._n_in] = inputs
        reuse = prod(shape) >= _REUSE
        for operation, value, pick, done in self._small:
            if reuse and done:
                free = [x for x in map(registers.__getitem__, done) if x.shape == shape][:1]
                registers[value] = operation(*pick(registers), *free)
            else:
                registers[value] = operation(*pick(registers))
        return [
            x if fresh and x.shape == shape else np.broadcast_to(x, shape).copy()
            for x, fresh in zip(map(registers.__getitem__, self._outputs.values()), self._fresh, strict=True)
        ]

    def _run(
        self, plan: _Plan, registers: list[Any], inputs: Sequence[tuple[int, Array]], out: Sequence[Array]
    ) -> None:
        for instruction in plan.scalars:
            registers[instruction.value] = instruction.operation(*(registers[r] for r in instruction.operands))
        size = out[0].size
        width = min(size, _BLOCK)
        buffers = self._spare.pop() if self._spare else np.empty((0, 0))
        if buffers.shape[0] < len(plan.buffers) or buffers.shape[1] < width:
            buffers = np.empty((len(plan.buffers), width))
        for start in range(0, size, _BLOCK):
            stop = min(start + _BLOCK, size)
            for register, buffer in zip(plan.buffers, buffers, strict=False):
                registers[register] = buffer[: stop - start]
            for register, array in inputs:
                registers[register] = array[start:stop]
            for register, row in plan.rows.items():
                registers[register] = out[row][start:stop]
            for operation, pick in plan.steps:
                operation(*pick(registers))
            for row, register in plan.copies:
                out[row][start:stop] = registers[register]
        self._spare.append(buffers)

    def _plan(self, is_array: tuple[bool, ...]) -> _Plan:
        """Sort instructions by whether they depend on an array, and give each array value a register that is free.

        An array divided by a scalar is multiplied by its reciprocal, which is faster.
        """
        varies = {i for i, array in enumerate(is_array) if array}
        for instruction in self._program:
            if not varies.isdisjoint(instruction.operands):
                varies.add(instruction.value)
        scalars = [i for i in self._program if i.value not in varies]
        program = [i for i in self._program if i.value in varies]
        n_values = self._n_values
        for k, instruction in enumerate(program):
            if instruction.operation is np.true_divide and instruction.operands[1] not in varies:
                scalars.append(_Instruction(np.reciprocal, n_values, instruction.operands[1:]))
                program[k] = _Instruction(np.multiply, instruction.value, (instruction.operands[0], n_values))
                n_values += 1
        last = {operand: k for k, instruction in enumerate(program) for operand in instruction.operands}
        computed = {instruction.value for instruction in program}
        rows = {value: row for row, value in self._outputs.items() if value in computed}
        copies = tuple((row, value) for row, value in self._outputs.items() if rows.get(value) != row)
        registers = {value: value for value in range(n_values)}
        free: list[int] = []
        buffers: list[int] = []
        steps = []
        for k, instruction in enumerate(program):
            operands = tuple(registers[operand] for operand in instruction.operands)
            free += [
                registers[o] for o in set(instruction.operands) if last[o] == k and o in computed and o not in rows
            ]
            if instruction.value not in rows:
                if not free:
                    free.append(instruction.value)
                    buffers.append(instruction.value)
                registers[instruction.value] = free.pop()
            steps.append((instruction.operation, itemgetter(*operands, registers[instruction.value])))
        return _Plan(n_values, tuple(scalars), tuple(steps), tuple(buffers), rows, copies)


def _with_choices(program: Sequence[_Instruction], wanted: set[int]) -> list[_Instruction]:
    """The program with each if_else, CasADi's (c ? a : 0) + (!c ? b : 0), as one choice."""
    made = {instruction.value: instruction for instruction in program}
    chosen = []
    for instruction in program:
        terms = [made.get(operand) for operand in instruction.operands]
        if instruction.operation is np.add and all(x and x.operation is _IF_ELSE_ZERO for x in terms):
            (c, a), (not_c, b) = (x.operands for x in terms if x)
            for one, other, first, second in ((c, not_c, a, b), (not_c, c, b, a)):
                opposite = made.get(other)
                if opposite and opposite.operation is _NOT and opposite.operands == (one,):
                    instruction = _Instruction(choose, instruction.value, (one, first, second))  # noqa: PLW2901
                    break
        chosen.append(instruction)
    used, left = set(wanted), []
    for instruction in reversed(chosen):  # without what nobody needs any more
        if instruction.value in used:
            used.update(instruction.operands)
            left.append(instruction)
    return left[::-1]


@cache
def vectorised(function: ca.Function) -> Vectorised:
    """The function for arrays, `vectorised(f)(x, y)`, compiled once.

    Raises ValueError where an input or output is not 1x1, or an operation has no NumPy counterpart.
    """
    return Vectorised(function)


def evaluate(function: ca.Function, *inputs: float | Array) -> tuple[Array, ...]:
    """A scalar CasADi function (1x1 in, 1x1 out) over broadcastable arrays, one array per output.

    Raises ValueError as `vectorised` and `Vectorised.__call__` do.
    """
    return tuple(vectorised(function)(*inputs))


def bound(function: ca.Function, inputs: Sequence[Array], outputs: Sequence[Array]) -> Callable[[], None]:
    """A CasADi function bound to memory: each call reads inputs and writes outputs without a copy.

    Arrays are C-contiguous and hold CasADi's matrices column by column. Calls raise RuntimeError where the function
    fails.
    """
    buffer, evaluate_there = function.buffer()
    for k, values in enumerate(inputs):
        buffer.set_arg(k, memoryview(values))  # type: ignore[call-arg, arg-type]  # its stubs know the C++ call alone
    for k, values in enumerate(outputs):
        buffer.set_res(k, memoryview(values))  # type: ignore[call-arg, arg-type]  # as above

    def run() -> None:
        """Evaluate; keeps `buffer` alive."""
        evaluate_there()
        if buffer.ret():
            raise RuntimeError(f"{function.name()}: CasADi could not evaluate it")

    return run


def chained(tick: ca.Function, samples: int) -> ca.Function:
    """Successive ticks, (memory, input, constants) -> (memory, output) each, as one function.

    Short scalar ticks are written out several at a time, because calls cost CasADi a third of their time.
    """
    together = gcd(samples, _TOGETHER) if tick.is_a("SXFunction") else 1

    def arguments(kind: Any, count: int) -> list[Any]:
        columns = {"memory": 1, "inputs": count, "constants": 1}
        return [kind.sym(name, tick.size1_in(k), wide) for k, (name, wide) in enumerate(columns.items())]

    some, calls = tick, samples // together
    if together > 1:  # their inputs, and their outputs, one below the other
        memory, inputs, constants = arguments(ca.SX, together)
        end, each = memory, []
        for k in range(together):
            end, output = tick(end, inputs[:, k], constants)
            each.append(output)
        some = ca.Function("ticks", [memory, ca.vec(inputs), constants], [end, ca.vertcat(*each)])
    memory, inputs, constants = arguments(ca.MX, samples)
    grouped = ca.reshape(inputs, inputs.shape[0] * together, calls)
    ends, outputs = some.mapaccum(calls)(memory, grouped, ca.repmat(constants, 1, calls))
    outputs = ca.reshape(outputs, tick.size1_out(1), samples)
    return ca.Function("chained", [memory, inputs, constants], [ends[:, -1], outputs])


def scan(a: Array, b: Array, z0: float | Array) -> Array:
    """All z of z[k + 1] = a[k] z[k] + b[k], (n + 1,) or (m, n + 1), by LAPACK's bidiagonal solver.

    Args:
        a: shape (n,), with |a| <= 1 for a stable scan.
        b: shape (n,), or (m, n) for m recurrences that share a.
        z0: first value, scalar or (m,).
    """
    n = a.size
    z = np.empty((*b.shape[:-1], n + 1))
    z[..., 0], z[..., 1:] = z0, b
    band = np.empty((n + 1, 2))
    np.negative(a, out=band[:n, 1])
    lapack.dtbtrs(band.T, z.T if z.ndim > 1 else z[:, None], uplo="L", diag="U", overwrite_b=True)
    return z
