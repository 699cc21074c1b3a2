"""Viscous friction that bends, alpha_3 v abs(v): drag if positive, a lubricant that thins if negative."""

from bristle.model.laws.parts import Expression, OwnParameter, ViscousTerm

ALPHA_3 = OwnParameter(name="alpha_3", symbol="α₃", units=("N*m*s**2/rad**2", "N*s**2/m**2"), least=-float("inf"))


def drag(speed: Expression) -> Expression:
    """abs(v)."""
    return speed


TERM = ViscousTerm(name="quadratic", title="v·|v|", coefficient=ALPHA_3, rate=drag)
