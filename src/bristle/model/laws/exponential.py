"""Tustin's peak: an exponential of the speed (J. IEE 94, 1947)."""

import casadi as ca

from bristle.model.laws.parts import Expression, Peak


def exponential(v: Expression, v_s: Expression) -> Expression:
    """exp(-abs(v) / v_s)."""
    return ca.exp(-ca.fabs(v) / v_s)


PEAK = Peak(name="exponential", title="exponential", shape=exponential, reach=2.3)
