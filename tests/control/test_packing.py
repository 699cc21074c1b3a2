"""Nested tuples and vectors: what goes in comes out, by the same names."""

import casadi as ca
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from bristle.control.control_period import flat, shaped, symbols
from bristle.control.pid import Gains
from bristle.model.parameters import Motor

nested = st.recursive(st.floats(allow_nan=False), lambda inner: st.lists(inner, max_size=4).map(tuple))


@given(nested)
def test_flat_and_shaped_are_inverse(value: object) -> None:
    """Whatever the nesting, the numbers put back in its shape are the value; none is left over."""
    numbers = iter(flat(value))
    assert shaped(value, numbers) == value
    assert not list(numbers)


def test_names_survive() -> None:
    """Tuples with names keep their class, in vectors of CasADi symbols too, whose elements stand in the order of `flat`."""
    like = (Motor(1.0, 2.0, 3.0, 4.0), Gains(5.0, 6.0, 7.0, 8.0))
    vector, (m, gains) = symbols("x", like)
    assert isinstance(m, Motor)
    assert isinstance(gains, Gains)
    found = ca.Function("f", [vector], [m.J, gains.K_i])(np.array(flat(like)))
    assert [float(x) for x in found] == [4.0, 6.0]
