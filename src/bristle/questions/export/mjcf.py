"""Export to MuJoCo: one LuGre set for both directions and a bias as actuators, or frictionloss and damping of a joint.

`<dcmotor lugre=...>` is LuGre exactly in continuous time; MuJoCo steps its bristle by the exponential at the velocity
at the start of the step, which is of first order. Without a voltage, and with a motor constant of 1e-9, the motor has
no other torque (MuJoCo 3.7.0 to 4.0.0). Frictionloss is a soft constraint: a joint creeps where it should stick.
"""

from collections.abc import Iterator, Mapping, Sequence
from textwrap import indent
from typing import NamedTuple

import numpy as np

from bristle.errors import InputError, one_line, short
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.parameters import Lugre, slides, unit
from bristle.questions.export.coulomb_viscous import CoulombViscous, comment_lines, target_of
from bristle.questions.export.export import Artefact, ExportTarget, Request, artefact_of, notes
from bristle.questions.export.exported import ExportedJoint
from bristle.questions.export.loss import Loss, SymmetricSet, all_motions, best_symmetric, losses
from bristle.questions.export.xml_edit import XmlDocument, XmlElement, attribute, comment, joint_named, model_read

NAME, FRICTIONLOSS_NAME = "mujoco", "mujoco-frictionloss"
STEP = 0.002  # time step of the example, s
_NO_SPRING = "0 0"
_MODEL = ("MJCF", "mujoco")  # to merge into, and its root element
_HOLDS = "one LuGre set for both directions, as <dcmotor lugre> (MuJoCo 3.7.0 or newer)"
_HOLDS_FRICTIONLOSS = "Coulomb friction and damping, the same in both directions, as <joint frictionloss damping>; no Stribeck peak and no presliding"
_CLOSEST = "its peak is Gaussian and its viscous friction linear, the closest to another law of the joint"


class MjcfHeld(NamedTuple):
    """The symmetric set of a joint for MuJoCo, and its losses."""

    joint: ExportedJoint
    symmetric: SymmetricSet
    lost: tuple[Loss, ...]


def write_mjcf(joints: Sequence[ExportedJoint], request: Request) -> Artefact:
    """A `<dcmotor>` per joint and order of cogging, and a `<general>` for a bias."""
    found = [mjcf_held(joint, request) for joint in joints]
    text = "\n".join(f"{_comment(one)}\n{mjcf_actuators(one)}" for one in found)
    if request.into is None:
        content = mjcf_example(found, text)
    else:
        document = model_read(request.into, request.into_name, *_MODEL)
        for one in found:
            document.set_attributes(_joint(document, one.joint), _attributes(one.joint))
        if there := [x for x in document.root.children if x.tag == "actuator"]:
            document.insert_last(there[0], text)
        else:
            document.insert_last(document.root, f"<actuator>\n{indent(text, '  ')}\n</actuator>")
        content = document.written()
    lost = {one.joint.name: one.lost for one in found}
    holds = [f"{_HOLDS}{' and a constant bias' * any(one.symmetric.bias for one in found)}"]
    holds += [_CLOSEST] if any(joint.law != GAUSSIAN for joint in joints) else []
    holds += ["cogging"] if any(joint.cogging for joint in joints) else []
    counted = [name for joint in joints for name in joint.cogging_names]
    return artefact_of(joints, NAME, ".xml", content, "; ".join(holds), lost, counted=counted, armature=True)


def mjcf_held(joint: ExportedJoint, request: Request) -> MjcfHeld:
    """The symmetric set of a joint, with its losses."""
    joint = joint.in_newton(NAME).with_bristle(NAME)
    motions = all_motions(joint, request.amplitude, request.frequency)
    best = best_symmetric(joint, motions)
    return MjcfHeld(joint, best, losses(joint, best.friction, motions))


def mjcf_actuators(held: MjcfHeld) -> str:
    """The elements of one joint, with all attributes that a default class may change."""
    name, (p, bias) = held.joint.name, held.symmetric
    numbers = " ".join(map(repr, (p.sigma_0, p.sigma_1, p.alpha_0, p.alpha_0 + p.alpha_1, p.v_s)))
    lines = [
        f'<dcmotor name={attribute(own_actuator(name))} joint={attribute(name)} gear="1" lugre="{numbers}" '
        f'damping="{p.alpha_2!r} 0 0" resistance="1" motorconst="1e-9" saturation="1e9 0 0"/>'
    ]
    for n, (k, of_sin, of_cos) in enumerate(held.joint.cogging, 1):  # against the drive
        wave = f"{float(np.hypot(of_sin, of_cos))!r} {k!r} {float(np.arctan2(-of_cos, -of_sin))!r}"
        lines.append(
            f'<dcmotor name={attribute(f"{own_actuator(name)} cogging {n}")} joint={attribute(name)} gear="1" cogging="{wave}" '
            f'damping="0 0 0" resistance="1" motorconst="1e-9" saturation="1e9 0 0"/>'
        )
    if bias:
        lines.append(
            f'<general name={attribute(own_actuator(name) + " bias")} joint={attribute(name)} gear="1" dyntype="none" gaintype="fixed" gainprm="0" '
            f'biastype="affine" biasprm="{-bias!r} 0 0" damping="0 0 0" ctrllimited="false" forcelimited="false" actlimited="false"/>'
        )
    return "\n".join(lines)


def own_actuator(name: str) -> str:
    """Name of the actuator with a joint's friction."""
    return f"{name} friction"


def _comment(held: MjcfHeld) -> str:
    joint, (p, bias) = held.joint, held.symmetric
    torque, largest = unit("torque", joint.kind), _largest_step(p)
    step = "Without damping MuJoCo's bristle oscillates in stick at any time step."
    if largest:
        step = f"Keep the time step well below {largest:.2g} s: above it MuJoCo's bristle oscillates in stick."
    lines = [
        *map(one_line, notes(joint, held.lost)),
        f"Held here: one LuGre set for both directions, sigma_0 {p.sigma_0:.4g}, sigma_1 {p.sigma_1:.4g}, alpha_0 {p.alpha_0:.4g}, "
        f"alpha_1 {p.alpha_1:.4g}, alpha_2 {p.alpha_2:.4g}, v_s {p.v_s:.4g}, and a constant bias of {bias:.4g} {torque}.",
        *(() if joint.law == GAUSSIAN else (f"Of the set: {_CLOSEST}.",)),
        "Both directions, exactly: bristle.mujoco.Friction, in a Python simulation.",
        step,
        "Leave ctrl of these actuators at 0.",
        "saturation and gear keep defaults of the model from cutting or scaling the friction.",
        *_joint_lines(joint),
    ]
    return comment("\n".join(lines) + "\n")


def _largest_step(p: Lugre[float]) -> float:
    """Largest step without an eigenvalue outside the unit circle in stick, s.

    MuJoCo steps z + h v and v - h / (J + h d) (sigma_0 z + d v), d = sigma_1 + alpha_2, with the determinant
    (J + h**2 sigma_0) / (J + h d); of the semi-implicit step it is 1 - h d / J + h**2 sigma_0 / J. Both are 1 there.
    """
    return (p.sigma_1 + p.alpha_2) / p.sigma_0


def _joint_lines(joint: ExportedJoint) -> Iterator[str]:
    """Lines of a comment on the attributes of the joint itself."""
    yield "damping and frictionloss of the joint itself are set here, so that friction does not count twice."
    J, rest = joint.rotor_inertia, "the rotor's inertia, without the links."
    if joint.inertia == J:
        rest = "all that the joint was seen to accelerate; where the bodies of the model hold a part of it as well, subtract that part."
    told_of = "No inertia is known: armature is not set."
    yield told_of if J is None else f"armature {J:.4g} {unit('inertia', joint.kind)} is {rest}"


def _attributes(joint: ExportedJoint, damping: str = "0 0 0", frictionloss: str = "0") -> dict[str, str]:
    """Attributes of the joint itself, with an armature if an inertia is known."""
    armature = {} if joint.rotor_inertia is None else {"armature": repr(joint.rotor_inertia)}
    return {**armature, "damping": damping, "frictionloss": frictionloss, "springdamper": _NO_SPRING}


def _type(joint: ExportedJoint) -> str:
    return "slide" if slides(joint.kind) else "hinge"


def mjcf_example(found: Sequence[MjcfHeld], actuators: str) -> bytes:
    """A small model with the joints and these actuators."""
    step = max(1e-5, min(STEP, *(_largest_step(one.symmetric.parameters) / 2 for one in found)))
    bodies = [_example_body(one.joint, _attributes(one.joint)) for one in found]
    return _example_model(bodies, step, f"<actuator>\n{indent(actuators, '  ')}\n</actuator>")


def _example_body(joint: ExportedJoint, attributes: Mapping[str, str]) -> str:
    """A body on one joint, with an inertia of 1e-9, or 1 where none is known."""
    own = "1" if joint.rotor_inertia is None else "1e-9"
    written = "".join(f" {name}={attribute(value)}" for name, value in attributes.items())
    return (
        f'<body>\n  <joint name={attribute(joint.name)} type="{_type(joint)}" axis="0 0 1"{written}/>\n'
        f'  <inertial pos="0 0 0" mass="{own}" diaginertia="{own} {own} {own}"/>\n</body>'
    )


def _example_model(bodies: Sequence[str], step: float, rest: str = "") -> bytes:
    """A model that MuJoCo loads; its joints and actuators are to be copied."""
    note = comment("An example: copy the attributes of each joint, and what stands beside, into your own model.")
    inner = (
        f'{note}\n<option timestep="{step!r}" gravity="0 0 0" integrator="implicitfast"/>\n'
        f"<worldbody>\n{indent(chr(10).join(bodies), '  ')}\n</worldbody>" + (f"\n{rest}" if rest else "")
    )
    return f'<mujoco model="bristle example">\n{indent(inner, "  ")}\n</mujoco>\n'.encode()


def _joint(document: XmlDocument, joint: ExportedJoint) -> XmlElement:
    """The joint of this name in <worldbody>. Raises InputError where it is not there, or cannot take the friction."""
    own = own_actuator(joint.name)
    actuators = [x for section in document.root.children if section.tag == "actuator" for x in section.children]
    if {x.attributes.get("name") for x in actuators} & {own, f"{own} bias", f"{own} cogging 1"}:
        held = f"{document.what}: has an actuator {short(own)} already, which holds this joint's friction"
        raise InputError(f"{held}; merge into the model as it was before")
    there = [x for world in document.root.children if world.tag == "worldbody" for x in world.find_all("joint")]
    found, where = joint_named(document.what, there, joint.name, "give one in <worldbody> this name; ")
    kind = _type(joint)
    by_class = any("type" in x.attributes for d in document.root.find_all("default") for x in d.find_all("joint"))
    if by_class and "type" not in found.attributes:
        raise InputError(f"{where} may get its type from a default class; write type on the joint itself")
    if (got := found.attributes.get("type", "hinge")) != kind:
        raise InputError(f"{where} is of type {short(got)}; expected {kind}")
    if "actuatorfrcrange" in found.attributes:
        cuts = "has actuatorfrcrange, which would cut the friction too"
        raise InputError(f"{where} {cuts}; limit the motor's own forcerange instead")
    if found.attributes.get("springdamper", _NO_SPRING) != _NO_SPRING:
        raise InputError(f"{where} has springdamper, which makes a damping; give stiffness instead")
    return found


def _into_mjcf(document: XmlDocument, one: CoulombViscous) -> None:
    joint = _joint(document, one.joint)
    document.set_attributes(joint, _own_attributes(one))
    document.annotate(joint, _note(one))


def _own_attributes(one: CoulombViscous) -> dict[str, str]:
    return _attributes(one.joint, damping=f"{one.viscous!r} 0 0", frictionloss=repr(one.coulomb))


def _note(one: CoulombViscous) -> str:
    return "\n".join((*comment_lines(one, _HOLDS_FRICTIONLOSS), *_joint_lines(one.joint)))


def frictionloss_example(found: Sequence[CoulombViscous]) -> bytes:
    """A small model with the joints."""
    bodies = [f"{comment(_note(one))}\n{_example_body(one.joint, _own_attributes(one))}" for one in found]
    return _example_model(bodies, STEP)


TARGET = ExportTarget(fitted=True, write=write_mjcf, merges=True)
FRICTIONLOSS = target_of(
    FRICTIONLOSS_NAME, "_frictionloss.xml", _HOLDS_FRICTIONLOSS, frictionloss_example, _into_mjcf, _MODEL, armature=True
)
