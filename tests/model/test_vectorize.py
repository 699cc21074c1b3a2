from collections.abc import Callable, Sequence
from itertools import combinations
from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from bristle.model import vectorize
from bristle.model.vectorize import evaluate, scan, vectorised

UNARY: dict[str, Callable[[Any], Any]] = {
    **{f.__name__: f for f in (ca.exp, ca.expm1, ca.sin, ca.cos, ca.tan, ca.atan, ca.sinh, ca.cosh, ca.tanh, ca.asinh)},
    **{f.__name__: f for f in (ca.erf, ca.fabs, ca.sign, ca.floor, ca.ceil)},
    "log": lambda x: ca.log(ca.fabs(x) + 0.1), "log1p": lambda x: ca.log1p(ca.fabs(x)), "sqrt": lambda x: ca.sqrt(ca.fabs(x)),
    "sq": lambda x: x**2, "cube": lambda x: x**3, "constpow": lambda x: (ca.fabs(x) + 0.1) ** 2.5, "twice": lambda x: 2 * x,
    "inv": lambda x: 1 / (x + 10), "neg": lambda x: -x, "asin": lambda x: ca.asin(x / 4), "acos": lambda x: ca.acos(x / 4),
    "acosh": lambda x: ca.acosh(x + 5), "atanh": lambda x: ca.atanh(x / 4), "not": lambda x: ca.logic_not(x > 0),
}  # fmt: skip  # a table
BINARY: dict[str, Callable[[Any, Any], Any]] = {
    **{f.__name__: f for f in (ca.atan2, ca.hypot, ca.copysign, ca.fmod, ca.fmin, ca.fmax)},
    "add": lambda x, y: x + y, "sub": lambda x, y: x - y, "mul": lambda x, y: x * y, "div": lambda x, y: x / (y + 10),
    "pow": lambda x, y: (ca.fabs(x) + 0.1) ** y, "lt": lambda x, y: x < y, "le": lambda x, y: x <= y,
    "eq": lambda x, y: ca.floor(x) == ca.floor(y), "ne": lambda x, y: ca.floor(x) != ca.floor(y),
    "and": lambda x, y: ca.logic_and(x > 0, y > 0), "or": lambda x, y: ca.logic_or(x > 0, y > 0),
    "if_else": lambda x, y: ca.if_else(x < y, ca.exp(x), y), "if_else_zero": lambda x, y: ca.if_else(x < y, 1 / x, 0),
}  # fmt: skip  # a table
X, Y = ca.SX.sym("x"), ca.SX.sym("y")
rng = np.random.default_rng(1)
VALUES = np.concatenate([rng.uniform(-3, 3, 40), [0.0, 1.0, -1.0, 2.0, 3.0]])
OTHERS = rng.permutation(VALUES)


def by_casadi(function: ca.Function, *columns: np.ndarray) -> list[np.ndarray]:
    outputs = function.map(columns[0].size).call([ca.DM(c).T for c in columns])
    return [np.array(output.full()).ravel() for output in outputs]


def both_routes(function: ca.Function, *inputs: np.ndarray) -> list[Sequence[np.ndarray]]:
    """Our evaluation as small inputs get it, and through blocks and buffers as large ones do."""
    shape = np.broadcast_shapes(*(x.shape for x in inputs))
    out = [np.empty(shape) for _ in range(function.n_out())]
    with np.errstate(all="ignore"):
        return [evaluate(function, *inputs), vectorised(function)(*inputs, out=out)]


@pytest.mark.parametrize("name", UNARY)
def test_unary_operation_and_its_derivative_equal_casadi(name: str) -> None:
    """Every elementary function of one argument, and the operations in its derivative, give what CasADi gives."""
    expression = UNARY[name](X)
    function = ca.Function("f", [X], [expression, ca.densify(ca.jacobian(expression, X))])
    for ours in both_routes(function, VALUES):
        for mine, theirs in zip(ours, by_casadi(function, VALUES), strict=True):
            np.testing.assert_allclose(mine, theirs, rtol=1e-13, atol=1e-15)


@pytest.mark.parametrize("name", BINARY)
def test_binary_operation_and_its_derivatives_equal_casadi(name: str) -> None:
    """The same for two arguments, both arrays, and either a scalar."""
    expression = ca.densify(BINARY[name](X, Y))
    gradient = ca.densify(ca.jacobian(expression, ca.vertcat(X, Y)))
    function = ca.Function("f", [X, Y], [expression, gradient[0], gradient[1]])
    for x, y in ((VALUES, OTHERS), (VALUES, np.array(0.7)), (np.array(-1.3), OTHERS)):
        theirs = by_casadi(function, *(np.ascontiguousarray(c) for c in np.broadcast_arrays(x, y)))
        for ours in both_routes(function, x, y):
            for mine, other in zip(ours, theirs, strict=True):
                np.testing.assert_allclose(mine, other, rtol=1e-13, atol=1e-15)


leaves = st.sampled_from([X, Y, ca.SX(0.5), ca.SX(-2)])
trees = st.recursive(
    leaves,
    lambda inner: st.one_of(
        st.tuples(st.sampled_from([ca.sin, ca.tanh, ca.fabs, ca.sign, ca.floor]), inner).map(lambda t: t[0](t[1])),
        st.tuples(st.sampled_from(["add", "sub", "mul", "atan2", "fmin", "lt", "if_else_zero"]), inner, inner).map(
            lambda t: BINARY[t[0]](t[1] + 2, t[2]) if t[0] == "if_else_zero" else BINARY[t[0]](t[1], t[2])
        ),
    ),
    max_leaves=12,
)


@given(first=trees, second=trees)
def test_any_expression_equals_casadi(first: Any, second: Any) -> None:
    """Registers are shared without one value overwriting another that is still needed, whatever the expression, also across outputs."""
    function = ca.Function("f", [X, Y], [first, first * second, ca.SX(second), X])
    for ours in both_routes(function, VALUES, OTHERS):
        for mine, theirs in zip(ours, by_casadi(function, VALUES, OTHERS), strict=True):
            np.testing.assert_allclose(mine, theirs, rtol=1e-12, atol=1e-13)


def test_shapes_blocks_and_refusals(monkeypatch: pytest.MonkeyPatch) -> None:
    """A column and a row give a table; constants, structural zeros and inputs come out as wide; scalars give zero-dimensional arrays."""
    function = ca.Function("f", [X, Y], [X + Y, ca.SX(3.0), ca.SX(1, 1), X, X + Y])
    x, y = np.arange(3.0)[:, None], np.arange(4.0)[None, :]
    for outputs in both_routes(function, x, y):
        total, three, nothing, same, again = outputs
        assert not any(np.shares_memory(a, b) for a, b in combinations((*outputs, x, y), 2))
        np.testing.assert_array_equal(total, x + y)
        np.testing.assert_array_equal(again, x + y)
        np.testing.assert_array_equal(three, np.full((3, 4), 3.0))
        np.testing.assert_array_equal(nothing, np.zeros((3, 4)))
        np.testing.assert_array_equal(same, np.broadcast_to(x, (3, 4)))
    assert [o.shape for o in evaluate(function, 1.0, 2.0)] == [()] * 5
    assert [o.shape for o in evaluate(function, np.zeros(0), 2.0)] == [(0,)] * 5
    assert float(evaluate(function, 1.0, 2.0)[0]) == 3.0
    # an MX function of scalars is as good as an SX one
    x = ca.MX.sym("x")
    np.testing.assert_allclose(
        evaluate(ca.Function("f", [x], [ca.sin(x) ** 2]), VALUES)[0], np.sin(VALUES) ** 2, rtol=1e-14
    )
    # vectors, unknown operations, wrong numbers of inputs and shapes that do not broadcast are ValueErrors that say what was expected
    vector = ca.SX.sym("vector", 2)
    with pytest.raises(ValueError, match="expected 1x1 each"):
        vectorised(ca.Function("f", [vector], [vector[0]]))
    with pytest.raises(ValueError, match="no NumPy counterpart"):
        vectorised(ca.Function("f", [X, Y], [ca.remainder(X, Y)]))
    function = ca.Function("f", [X, Y], [X + Y])
    with pytest.raises(ValueError, match="got 1 inputs; expected 2"):
        evaluate(function, VALUES)
    with pytest.raises(ValueError, match="broadcast"):
        evaluate(function, np.zeros(3), np.zeros(4))
    # the result does not depend on the block size, and `out` receives it
    function = ca.Function("f", [X, Y], [ca.exp(X) * Y, ca.sin(X + Y)])
    x, y = rng.normal(size=(2, 1000))
    expected = np.array(evaluate(function, x, y))
    for block in (1, 7, 999, 1000, 1001):
        monkeypatch.setattr(vectorize, "_BLOCK", block)
        out = np.empty((2, 1000))
        vectorised(function)(x, y, out=list(out))
        np.testing.assert_array_equal(out, expected)


finite = st.floats(-1, 1, allow_subnormal=False)


@given(data=st.data(), n=st.integers(0, 40), m=st.integers(1, 4))
def test_scan_equals_the_plain_loop(data: st.DataObject, n: int, m: int) -> None:
    """z[k + 1] = a[k] z[k] + b[k], for one recurrence and for several that share a."""
    a = data.draw(hnp.arrays(float, n, elements=finite))
    b = data.draw(hnp.arrays(float, (m, n), elements=finite))
    z0 = data.draw(hnp.arrays(float, m, elements=finite))
    expected = np.empty((m, n + 1))
    expected[:, 0] = z0
    for k in range(n):
        expected[:, k + 1] = a[k] * expected[:, k] + b[:, k]
    np.testing.assert_allclose(scan(a, b, z0), expected, rtol=1e-14, atol=1e-14)
    np.testing.assert_allclose(scan(a, b[0], z0[0]), expected[0], rtol=1e-14, atol=1e-14)
