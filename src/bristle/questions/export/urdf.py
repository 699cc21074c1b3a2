"""URDF: `<dynamics friction= damping=>`, as a small robot of its own or merged into a given file.

URDF holds Coulomb friction and damping of a joint, N*m and N*m*s/rad (N and N*s/m where it slides), and no rotor inertia.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from bristle.errors import InputError, one_line, short
from bristle.model.parameters import slides
from bristle.questions.export.artefact import Artefact, ExportTarget, Request, slug
from bristle.questions.export.coulomb_viscous import (
    AXIS_HOLDS,
    CoulombViscous,
    axis_note,
    axis_values,
    best_values,
    losses_of,
    place_of,
    said_of,
)
from bristle.questions.export.exported import ExportedJoint
from bristle.questions.export.xml_edit import XmlDocument, XmlElement, attribute, comment

if TYPE_CHECKING:
    pass

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


TARGET = ExportTarget(fitted=True, write=write_urdf, merges=True)
