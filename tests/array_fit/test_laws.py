"""Fits of arrays under laws that are not the paper's."""

import numpy as np
import pytest

import bristle
from bristle.model.parameters import fields_of
from bristle.page.wording import in_symbols, symbol

from ..laws import DRAG, EXPONENT, OUTSIDE, motion, points, registered, truth_of


@pytest.mark.parametrize("law", [DRAG, EXPONENT])
def test_a_fit_under_a_law_has_its_curve(law: str) -> None:
    """Each parameter is near the true one, and friction and prediction are the true curve to a thousandth."""
    found, truth, v = points(law), truth_of(law), np.linspace(-0.8, 0.8, 9)
    assert found.joint.law == truth.law
    for name in truth.law.own:
        assert found.params[name.name] == pytest.approx(getattr(truth, name.name), rel=0.1)
    for torque in (found.predict(v), bristle.friction(v, found)):
        assert torque == pytest.approx(bristle.friction(v, truth), rel=1e-3)


@pytest.mark.parametrize("law", [DRAG, EXPONENT])
def test_a_motion_has_the_law_of_its_prior(law: str) -> None:
    """It is fitted under the law of the points without being told, and simulates as the true parameters do."""
    found, truth = motion(law), truth_of(law)
    assert found.joint.law == truth.law
    v = 0.5 * np.sin(2.0 * np.arange(0, 4, 0.002))
    true = bristle.simulate(v, 0.002, truth)
    assert np.linalg.norm(bristle.simulate(v, 0.002, found) - true) < 0.01 * np.linalg.norm(true)


def test_every_parameter_has_a_symbol() -> None:
    """Those of bristle's laws and of a registered one, alone, with a direction, and in a sentence where they are no words."""
    with registered():
        assert [symbol(name) for name in fields_of(truth_of(DRAG).law)[-2:]] == ["α₃", "vₑ"]
        assert symbol("delta+") == "δ (+)"
        assert symbol(fields_of(truth_of(OUTSIDE).law)[-1]) == "β"
        assert in_symbols("alpha_3+ beyond v_end; the blunt delta") == "α₃ (+) beyond vₑ; the blunt delta"
