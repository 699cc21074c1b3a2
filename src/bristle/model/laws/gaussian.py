"""The paper's Stribeck peak (5)."""

import casadi as ca

from bristle.model.laws.parts import Expression, Law, Peak


def gaussian(v: Expression, v_s: Expression) -> Expression:
    """exp(-(v / v_s)**2)."""
    return ca.exp(v**2 * (-1 / v_s**2))


PEAK = Peak(name="gaussian", title="Gaussian", shape=gaussian, reach=1.5)
GAUSSIAN = Law(PEAK)  # the paper's law: a Gaussian peak, linear viscous friction
