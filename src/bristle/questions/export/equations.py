"""The equations of a friction law, for documents that carry them: each is the expression of `model.law`."""

import casadi as ca

from bristle.model import law
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import Expression
from bristle.model.parameters import lugre_of
from bristle.questions.export.exported import ExportedJoint


def equations(joint: ExportedJoint) -> dict[str, Expression]:
    """What must be known of a law that is not the paper's, by name: `level` g(v), and of z, v and its parameters by their names.

    `rate` dz/dt and `torque` T_f where the bristle is known, else `steady`, the friction vs velocity; none of the paper's law.
    """
    if joint.law == GAUSSIAN:
        return {}
    one = lugre_of(joint.law)
    z, v, p = ca.SX.sym("z"), ca.SX.sym("v"), one(*(ca.SX.sym(name) for name in one._fields))
    moving = {"rate": law.bristle_rate(z, v, p), "torque": law.torque(z, v, p)}
    return {"level": law.stribeck(v, p), **(moving if joint.has_bristle else {"steady": law.steady_torque(v, p)})}
