"""Alternatives to the paper's law: other Stribeck peaks, and a term beside viscous friction."""

from math import inf

import casadi as ca

from bristle.model.laws.parts import Expression, OwnParameter, Peak, ViscousTerm

_TINY = 1e-100  # keeps the power and its derivatives finite at rest


def exponential(v: Expression, v_s: Expression) -> Expression:
    """exp(-abs(v) / v_s), Tustin's (J. IEE 94, 1947)."""
    return ca.exp(-ca.fabs(v) / v_s)


def lorentzian(v: Expression, v_s: Expression) -> Expression:
    """1 / (1 + (v / v_s)**2) (D. P. Hess and A. Soom, J. Tribology 112, 1990)."""
    return 1 / (1 + v**2 * (1 / v_s**2))


def free_exponent(v: Expression, v_s: Expression, delta: Expression) -> Expression:
    """exp(-(abs(v) / v_s)**delta): 1 is Tustin's, 2 the paper's (Armstrong-Helouvry et al., Automatica 30, 1994).

    On measured joints delta often runs to an end of its range, so it does not compete.
    """
    return ca.exp(-ca.exp(delta * ca.log(ca.fabs(v) / v_s + _TINY)))


def drag(speed: Expression) -> Expression:
    """abs(v), so that alpha_3 v abs(v) is drag if positive, and a lubricant that thins if negative."""
    return speed


DELTA = OwnParameter(name="delta", symbol="δ", units=("1", "1"), searched=(0.5, 4.0))
ALPHA_3 = OwnParameter(name="alpha_3", symbol="α₃", units=("N*m*s**2/rad**2", "N*s**2/m**2"), least=-inf)
EXPONENTIAL = Peak(name="exponential", title="exponential", shape=exponential, reach=2.3)
LORENTZIAN = Peak(name="lorentzian", title="Lorentzian", shape=lorentzian, reach=3.0)
FREE_EXPONENT = Peak(name="free-exponent", title="free-exponent", shape=free_exponent, own=(DELTA,), reach=2.3)
QUADRATIC = ViscousTerm(name="quadratic", title="v·|v|", coefficient=ALPHA_3, rate=drag)
