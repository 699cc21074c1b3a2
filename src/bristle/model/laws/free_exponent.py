"""A peak whose exponent delta is estimated: 1 is Tustin's, 2 the paper's.

B. Armstrong-Helouvry, P. Dupont and C. Canudas de Wit, "A survey of models, analysis tools and compensation methods for
the control of machines with friction", Automatica 30 (1994). On measured joints delta often runs to an end of its
range, and does not predict speeds that were left out: it is there for those who ask for it by name.
"""

import casadi as ca

from bristle.model.laws.parts import Expression, OwnParameter, Peak

DELTA = OwnParameter(name="delta", symbol="δ", units=("1", "1"), searched=(0.5, 4.0))
_TINY = 1e-100  # keeps the power and its derivatives finite at rest


def free_exponent(v: Expression, v_s: Expression, delta: Expression) -> Expression:
    """exp(-(abs(v) / v_s)**delta)."""
    return ca.exp(-ca.exp(delta * ca.log(ca.fabs(v) / v_s + _TINY)))


PEAK = Peak(name="free-exponent", title="free-exponent", shape=free_exponent, own=(DELTA,), reach=2.3)
