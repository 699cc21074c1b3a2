"""SDFormat 1.6 and later: `<damping>` and `<friction>` of a joint's axis, as a small model of its own or merged into a given file.

SDF holds Coulomb friction and damping, N*m and N*m*s/rad (N and N*s/m where the joint slides), and no rotor inertia.
"""

from collections.abc import Iterator, Sequence
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

_PLACEHOLDERS = (
    "Links and axes are placeholders, so that this file loads; copy <dynamics> into your own SDF, or export into that."
)


def write_sdf(joints: Sequence[ExportedJoint], request: Request) -> Artefact:
    """An SDF with the best values along the motion that is asked for.

    Raises InputError where a joint's torque is a current, or the file that is merged into is no SDF or lacks the joint.
    """
    found = best_values(joints, request, "sdf")
    content = _model(found).encode() if request.into is None else _merged(request.into, request.into_name, found)
    return Artefact(
        name=f"{slug(joints)}.sdf",
        content=content,
        holds=AXIS_HOLDS,
        losses=losses_of(found),
        said=said_of(found, "sdf"),
    )


def _dynamics(one: CoulombViscous, indent: str = "") -> str:
    """The element with its comment, the second and later lines indented."""
    elements = [f"<{tag}>{value}</{tag}>" for tag, value in axis_values(one).items()]
    inside = "\n".join((comment(axis_note(one)), *elements)).replace("\n", "\n  ")
    return f"<dynamics>\n  {inside}\n</dynamics>".replace("\n", f"\n{indent}")


def _model(found: Sequence[CoulombViscous]) -> str:
    """A model of these joints, each between the world and a link of its own."""
    body = "\n".join(_joint(k, one) for k, one in enumerate(found))
    return (
        f'<?xml version="1.0" encoding="utf-8"?>\n{comment(_PLACEHOLDERS)}\n<sdf version="1.6">\n'
        f"  <model name={attribute(slug([one.joint for one in found]))}>\n{body}\n  </model>\n</sdf>\n"
    )


def _joint(k: int, one: CoulombViscous) -> str:
    """A joint and its link, which has the identified inertia, or 1 where none is known."""
    sliding = slides(one.joint.kind)
    J = one.joint.inertia or 1.0
    mass, moment = (J, 1.0) if sliding else (1.0, J)
    return f"""\
    <link name="bristle_link_{k}">
      <inertial>
        <mass>{mass!r}</mass>
        <inertia>
          <ixx>{moment!r}</ixx><ixy>0</ixy><ixz>0</ixz><iyy>{moment!r}</iyy><iyz>0</iyz><izz>{moment!r}</izz>
        </inertia>
      </inertial>
    </link>
    <joint name={attribute(one.joint.name)} type="{"prismatic" if sliding else "revolute"}">
      <parent>world</parent>
      <child>bristle_link_{k}</child>
      <axis>
        <xyz>{"1 0 0" if sliding else "0 0 1"}</xyz>
        <limit><lower>-1e16</lower><upper>1e16</upper></limit>
        {_dynamics(one, " " * 8)}
      </axis>
    </joint>"""


def _merged(into: bytes, name: str, found: Sequence[CoulombViscous]) -> bytes:
    """The SDF with the values in its joints, and nothing else changed."""
    document = XmlDocument.read(into, name)
    for one in found:
        axis = _axis(document, one.joint)
        dynamics = [x for x in axis.children if x.tag == "dynamics"]
        if not dynamics:
            document.insert_last(axis, _dynamics(one))
            continue
        document.annotate(dynamics[0], axis_note(one))
        for tag, value in axis_values(one).items():
            text, old = f"<{tag}>{value}</{tag}>", [x for x in dynamics[0].children if x.tag == tag]
            if old:
                document.replace(old[0], text)
            else:
                document.insert_last(dynamics[0], text)
    return document.written()


def _axis(document: XmlDocument, joint: ExportedJoint) -> XmlElement:
    """The joint's axis in an SDF. Raises InputError where there is none, or the joint cannot be the one that was identified."""
    root, what = document.root, document.what
    if root.tag != "sdf":
        raise InputError(f"{what}: its root is <{one_line(root.tag, 40)}>; expected an SDF, whose root is <sdf>")
    joints = [x for model in root.find_all("model") for x in model.children if x.tag == "joint"]
    element = place_of(what, joints, joint)
    where = f"{what}, line {element.line}: joint {short(joint.name)}"
    axes = [x for x in element.children if x.tag == "axis"]
    if len(axes) != 1:
        raise InputError(f"{where} has {len(axes)} <axis>; expected one")
    for parent, tag in _ambiguous(axes[0]):
        raise InputError(f"{where} has two <{tag}> in its <{parent}>; keep one of them")
    return axes[0]


def _ambiguous(axis: XmlElement) -> Iterator[tuple[str, str]]:
    """Elements that stand there more than once, with what they are in."""
    dynamics = [x for x in axis.children if x.tag == "dynamics"]
    if len(dynamics) > 1:
        yield "axis", "dynamics"
    for tag in ("damping", "friction"):
        if sum(x.tag == tag for one in dynamics for x in one.children) > 1:
            yield "dynamics", tag


TARGET = ExportTarget(fitted=True, write=write_sdf, merges=True)
