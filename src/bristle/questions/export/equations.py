"""The equations of a friction law, for documents that carry them: each is the expression of `model.law`."""

from collections.abc import Iterator
from typing import NamedTuple

import casadi as ca

from bristle.model import law
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import Expression
from bristle.model.parameters import lugre_of, unit
from bristle.questions.export.exported import ExportedJoint


class Equation(NamedTuple):
    """One of them."""

    name: str
    latex: str
    """Its left side."""
    unit: str
    of: tuple[str, ...]
    """What it is a function of beside the parameters: v, or z and v."""
    expression: Expression
    """Of symbols with these names and those of the parameters."""


def equations(joint: ExportedJoint) -> Iterator[Equation]:
    """What must be known of a law that is not the paper's; none of that.

    `level` g(v), then `rate` dz/dt and `torque` T_f where the bristle is known, else `steady`, the friction vs velocity.
    """
    if joint.law == GAUSSIAN:
        return
    one, torque, velocity = lugre_of(joint.law), unit("torque", joint.kind), unit("velocity", joint.kind)
    z, v, p = ca.SX.sym("z"), ca.SX.sym("v"), one(*(ca.SX.sym(name) for name in one._fields))
    yield Equation("level", "g(v)", torque, ("v",), law.stribeck(v, p))
    if joint.has_bristle:
        yield Equation("rate", r"\dot z", velocity, ("z", "v"), law.bristle_rate(z, v, p))
        yield Equation("torque", "T_f", torque, ("z", "v"), law.torque(z, v, p))
    else:
        yield Equation("steady", r"T_{\mathrm{ss}}(v)", torque, ("v",), law.steady_torque(v, p))
