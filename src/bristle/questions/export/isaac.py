"""Export to Isaac Lab: a Python snippet with an `ImplicitActuatorCfg` per joint.

From Isaac Sim 5.0 on PhysX takes static and dynamic friction as efforts and viscous friction as effort by velocity
(docstrings of isaaclab.actuators.ActuatorBaseCfg and of PhysX's PxJointFrictionParams).
"""

import re
from collections.abc import Sequence

from bristle.model.parameters import unit
from bristle.questions.export.artefact import in_ascii
from bristle.questions.export.coulomb_viscous import CoulombViscous, comment_lines, target_of

_HOLDS = "static, dynamic and viscous friction, the same in both directions, and armature; no Stribeck velocity and no presliding."
_HEAD = """\
# Actuators of Isaac Lab with identified friction: put them into `actuators` of your ArticulationCfg.
#
# For Isaac Sim 5.0 and later, where friction and dynamic_friction are efforts and viscous_friction is effort by velocity.
# In Isaac Sim 4.5 friction is a coefficient of the transmitted load, and the other two are not applied: do not use it there.
# PhysX holds a joint at rest up to `friction`; a Newton backend takes it as the friction of a moving joint: give it dynamic_friction.
# stiffness and damping None: as the asset has them. A joint is in one group alone: take its name out of the others.
# joint_names_expr is a regular expression of the name as it was identified; USD names have letters, digits and _ only.
"""


def static_effort(one: CoulombViscous) -> float:
    """Static effort, N*m: alpha_0 + alpha_1, mean of both directions, and at least the dynamic one, as PhysX asks."""
    return max(sum(p.alpha_0 + p.alpha_1 for p in one.joint.curves) / 2, one.coulomb)


def _snippet(found: Sequence[CoulombViscous]) -> bytes:
    parts = [f"{_HEAD}\nfrom isaaclab.actuators import ImplicitActuatorCfg\n\nACTUATORS = {{\n"]
    for one in found:
        kind, name, J = one.joint.kind, one.joint.name, one.joint.rotor_inertia
        lines = "".join(f"    # {in_ascii(line)}\n" for line in comment_lines(one, _HOLDS))
        of_armature = "all that the joint accelerates: take off what the asset's links have of it"
        if J is None:
            of_armature = "no inertia is known: as the asset has it"
        elif one.joint.inertia != J:
            of_armature = "of the rotor, as identified beside the links"
        parts.append(f"""\
{lines}    {name!a}: ImplicitActuatorCfg(
        joint_names_expr=[{re.escape(name)!a}],
        stiffness=None,
        damping=None,
        friction={static_effort(one)!r},  # {unit("torque", kind)}, at rest: alpha_0 + alpha_1, the mean of both directions
        dynamic_friction={one.coulomb!r},  # {unit("torque", kind)}
        viscous_friction={one.viscous!r},  # {unit("alpha_2", kind)}
        armature={J!r},  # {unit("inertia", kind)}; {of_armature}
    ),
""")
    return "".join((*parts, "}\n")).encode("ascii")


TARGET = target_of("isaac", "_actuators.py", _HOLDS, _snippet, armature=True)
