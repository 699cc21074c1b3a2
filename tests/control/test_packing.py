"""Nested tuples and vectors: what goes in comes out, by the same names."""

import casadi as ca
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from bristle.control.adaptation import Adaptation
from bristle.control.compensator import Compensator
from bristle.control.control_period import LoopOptions, at_rest, control_period, flat, numbers_of, shaped, symbols
from bristle.control.pid import Gains
from bristle.model.parameters import Motor
from bristle.simulation import edro

from .conftest import H, case

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


def test_a_period_keeps_what_no_number_changes() -> None:
    """At rest, asked for nothing, a period leaves every memory as it is: plant, current, controller, compensator and what is on its way."""
    adapting = Compensator(adaptation=Adaptation(step="least-squares", gamma=(0.0, 0.0)))
    for options in (LoopOptions(), LoopOptions(compensator=adapting, drive="voltage", inductance=True, delay=3)):
        m = edro.motor("wrist pitch")._replace(L=1e-3)
        memory = flat(at_rest(options, 0.0))
        given = [0.0] * 6 + [1.0, 1.0, 0.0]
        new, _ = control_period(options)(memory, given, numbers_of(case("wrist pitch", motor=m), H))
        np.testing.assert_allclose(new.full().ravel(), memory, atol=1e-15)
