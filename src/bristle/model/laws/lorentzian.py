"""A Lorentzian peak, whose tail falls with the square of the speed.

D. P. Hess and A. Soom, "Friction at a lubricated line contact operating at oscillating sliding velocities", J.
Tribology 112 (1990).
"""

from bristle.model.laws.parts import Expression, Peak


def lorentzian(v: Expression, v_s: Expression) -> Expression:
    """1 / (1 + (v / v_s)**2)."""
    return 1 / (1 + v**2 * (1 / v_s**2))


PEAK = Peak(name="lorentzian", title="Lorentzian", shape=lorentzian, reach=3.0)
