"""A Lorentzian peak (D. P. Hess and A. Soom, J. Tribology 112, 1990)."""

from bristle.model.laws.parts import Expression, Peak


def lorentzian(v: Expression, v_s: Expression) -> Expression:
    """1 / (1 + (v / v_s)**2)."""
    return 1 / (1 + v**2 * (1 / v_s**2))


PEAK = Peak(name="lorentzian", title="Lorentzian", shape=lorentzian, reach=3.0)
