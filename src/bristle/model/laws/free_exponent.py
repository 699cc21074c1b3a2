"""A peak with an estimated exponent: 1 is Tustin's, 2 the paper's (Armstrong-Helouvry et al., Automatica 30, 1994).

On measured joints delta often runs to an end of its range, so it does not compete.
"""

import casadi as ca

from bristle.model.laws.parts import Expression, OwnParameter, Peak

DELTA = OwnParameter(name="delta", symbol="δ", units=("1", "1"), searched=(0.5, 4.0))
_TINY = 1e-100  # keeps the power and its derivatives finite at rest


def free_exponent(v: Expression, v_s: Expression, delta: Expression) -> Expression:
    """exp(-(abs(v) / v_s)**delta)."""
    return ca.exp(-ca.exp(delta * ca.log(ca.fabs(v) / v_s + _TINY)))


PEAK = Peak(name="free-exponent", title="free-exponent", shape=free_exponent, own=(DELTA,), reach=2.3)
