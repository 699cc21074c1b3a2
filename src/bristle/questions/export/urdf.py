"""URDF: `<dynamics friction= damping=>`, as a small robot of its own or merged into a given file.

URDF holds Coulomb friction and damping of a joint, N*m and N*m*s/rad (N and N*s/m where it slides), and no rotor inertia.
"""

from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

from bristle.errors import InputError, one_line, short
from bristle.model.parameters import slides
from bristle.questions.export.artefact import Artefact, ExportTarget, NotInstalled, Request, slug
from bristle.questions.export.coulomb_viscous import (
    AXIS_HOLDS,
    CoulombViscous,
    Values,
    axis_note,
    axis_values,
    best_values,
    compared,
    expected_values,
    losses_of,
    place_of,
    said_of,
)
from bristle.questions.export.exported import ExportedJoint
from bristle.questions.export.xml_edit import XmlDocument, XmlElement, attribute, comment

if TYPE_CHECKING:
    from xml.etree import ElementTree as Xml

_PLACEHOLDERS = "Links, axes and limits are placeholders, so that this file loads; copy <dynamics> into your own URDF, or export into that."
_FAR = "1000"
"""A limit that is none."""


def write_urdf(joints: Sequence[ExportedJoint], request: Request) -> Artefact:
    """A URDF with the best values along the motion that is asked for.

    Raises InputError where a joint's torque is a current, or the file that is merged into is no URDF or lacks the joint.
    """
    found = best_values(joints, request, "urdf")
    content = _robot(found).encode() if request.into is None else _merged(request.into, request.into_name, found)
    return Artefact(
        name=f"{slug(joints)}.urdf", content=content, holds=AXIS_HOLDS, losses=losses_of(found), said=said_of(found, "urdf"),
    )  # fmt: skip  # a list of values


def _robot(found: Sequence[CoulombViscous]) -> str:
    """A robot of these joints, each with a link of its own on one base."""
    name = slug([one.joint for one in found])
    body = "\n".join(_joint(k, one) for k, one in enumerate(found))
    return (
        f'<?xml version="1.0" encoding="utf-8"?>\n{comment(_PLACEHOLDERS)}\n'
        f'<robot name={attribute(name)}>\n  <link name="base"/>\n{body}\n</robot>\n'
    )


def _joint(k: int, one: CoulombViscous) -> str:
    """A joint and its link, which has the identified inertia, or 1 where none is known."""
    sliding = slides(one.joint.kind)
    J = one.joint.inertia or 1.0
    mass, moment = (repr(J), "1") if sliding else ("1", repr(J))
    limit = f' lower="-{_FAR}" upper="{_FAR}"' if sliding else ""
    dynamics = " ".join(f"{name}={attribute(value)}" for name, value in axis_values(one).items())
    return f"""\
  <joint name={attribute(one.joint.name)} type="{"prismatic" if sliding else "continuous"}">
    <parent link="base"/>
    <child link="link_{k}"/>
    <axis xyz="{"1 0 0" if sliding else "0 0 1"}"/>
    <limit effort="{_FAR}" velocity="{_FAR}"{limit}/>
    {comment(axis_note(one))}
    <dynamics {dynamics}/>
  </joint>
  <link name="link_{k}">
    <inertial>
      <mass value="{mass}"/>
      <inertia ixx="{moment}" ixy="0" ixz="0" iyy="{moment}" iyz="0" izz="{moment}"/>
    </inertial>
  </link>"""


def _merged(into: bytes, name: str, found: Sequence[CoulombViscous]) -> bytes:
    """The URDF with the values in its joints, and nothing else changed."""
    document = XmlDocument.read(into, name)
    for one in found:
        joint = _place(document, one.joint)
        document.annotate(joint, axis_note(one))
        dynamics = [x for x in joint.children if x.tag == "dynamics"]
        if dynamics:
            document.set_attributes(dynamics[0], axis_values(one))
        else:
            values = " ".join(f"{name}={attribute(value)}" for name, value in axis_values(one).items())
            document.insert_last(joint, f"<dynamics {values}/>")
    return document.written()


def _place(document: XmlDocument, joint: ExportedJoint) -> XmlElement:
    """The joint in a URDF. Raises InputError where there is none, or it cannot be the one that was identified."""
    root = document.root
    if root.tag != "robot":
        raise InputError(
            f"{document.what}: its root is <{one_line(root.tag, 40)}>; expected a URDF, whose root is <robot>"
        )
    joints = [x for x in root.children if x.tag == "joint"]
    xacro = any(x.tag.startswith("xacro:") for x in root.children)
    found = place_of(document.what, joints, joint, "run xacro on it first; " if xacro else "")
    if sum(x.tag == "dynamics" for x in found.children) > 1:
        raise InputError(
            f"{document.what}, line {found.line}: joint {short(joint.name)} has two <dynamics>; keep one of them"
        )
    return found


def check_urdf(artefact: Artefact, joints: Sequence[ExportedJoint], request: Request) -> tuple[str, ...]:
    """Parses the file again, and loads its joints and their tree in MuJoCo and Pinocchio. Raises NotInstalled where neither is installed."""
    found = best_values(joints, request, "urdf")
    root = _parsed(artefact.content.decode("utf-8-sig"))
    expected = expected_values(found)
    lines = [compared("parsed again", _written(root), expected)]
    for load in (_mujoco, _pinocchio):
        with suppress(ModuleNotFoundError):
            lines.append(compared(*load(_tree(root)), expected))
    if len(lines) == 1:
        raise NotInstalled(f"{lines[0]}; MuJoCo and Pinocchio, which load a URDF, are not here: pip install mujoco")
    return tuple(lines)


def _parsed(text: str) -> "Xml.Element":
    from xml.etree import ElementTree as Xml

    return Xml.fromstring(text)  # noqa: S314  # our own text, or one that `XmlDocument` found without entities


def _written(root: "Xml.Element") -> Values:
    held = {joint.get("name", ""): joint.find("dynamics") for joint in root.iterfind("joint")}
    return {
        name: (float(x.get("damping", "nan")), float(x.get("friction", "nan")))
        for name, x in held.items() if x is not None
    }  # fmt: skip  # an entry


def _tree(root: "Xml.Element") -> str:
    """The joints with their dynamics, and links that are balls: without meshes, limits and whatever else a loader may miss."""
    from xml.etree import ElementTree as Xml

    robot = Xml.Element("robot", name="robot")
    for link in root.iterfind("link"):
        inertial = Xml.SubElement(Xml.SubElement(robot, "link", name=link.get("name", "")), "inertial")
        Xml.SubElement(inertial, "mass", value="1")
        Xml.SubElement(
            inertial, "inertia", dict.fromkeys(("ixx", "iyy", "izz"), "1") | dict.fromkeys(("ixy", "ixz", "iyz"), "0")
        )
    for joint in root.iterfind("joint"):
        kind = {"revolute": "continuous", "continuous": "continuous", "prismatic": "prismatic"}.get(
            joint.get("type", ""), "fixed"
        )
        copied = Xml.SubElement(robot, "joint", name=joint.get("name", ""), type=kind)
        copied.extend(x for x in joint if x.tag in {"parent", "child", "axis", "dynamics"})
        Xml.SubElement(copied, "limit", effort=_FAR, velocity=_FAR, lower=f"-{_FAR}", upper=_FAR)
    return Xml.tostring(robot, encoding="unicode")


def _mujoco(text: str) -> tuple[str, Values]:
    """What MuJoCo makes of it. Raises ModuleNotFoundError where that is not installed."""
    import mujoco

    try:
        model = mujoco.MjModel.from_xml_string(text)
    except ValueError as error:
        return f"MuJoCo {mujoco.__version__} refuses it ({one_line(str(error), 120)})", {}
    dofs = {model.joint(k).name: model.jnt_dofadr[k] for k in range(model.njnt)}
    held = {name: (float(model.dof_damping[k]), float(model.dof_frictionloss[k])) for name, k in dofs.items()}
    return f"MuJoCo {mujoco.__version__}", held


def _pinocchio(text: str) -> tuple[str, Values]:
    """What Pinocchio makes of it. Raises ModuleNotFoundError where that is not installed."""
    import pinocchio

    try:
        model = pinocchio.buildModelFromXML(text)
    except (ValueError, RuntimeError) as error:
        return f"Pinocchio {pinocchio.__version__} refuses it ({one_line(str(error), 120)})", {}
    dofs = {name: model.joints[k].idx_v for k, name in enumerate(model.names) if k}
    held = {name: (float(model.damping[k]), float(model.friction[k])) for name, k in dofs.items()}
    return f"Pinocchio {pinocchio.__version__}", held


TARGET = ExportTarget(fitted=True, write=write_urdf, check=check_urdf, merges=True)
