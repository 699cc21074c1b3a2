"""URDF and SDFormat 1.6 and later: `<dynamics>` of a joint, as a small model of its own or merged into a given file.

It holds Coulomb friction and damping of the joint, N*m and N*m*s/rad (N and N*s/m where it slides), and no rotor inertia.
"""

from collections.abc import Callable, Sequence

from bristle.errors import InputError, one_line, short
from bristle.model.parameters import slides
from bristle.questions.export.artefact import Artefact, ExportTarget, Request, slug
from bristle.questions.export.coulomb_viscous import CoulombViscous, artefact_of, best_values, comment_lines
from bristle.questions.export.exported import ExportedJoint
from bristle.questions.export.xml_edit import XmlDocument, XmlElement, attribute, comment, joint_named

_HOLDS = (
    "Coulomb friction and damping, the same in both directions; no Stribeck peak, no presliding, and no rotor inertia."
)
_HEAD = '<?xml version="1.0" encoding="utf-8"?>\n'
_PLACEHOLDERS = "{} are placeholders, so that this file loads; copy <dynamics> into your own {}, or export into that."
_FAR = "1000"
"""A limit that is none."""
_Merged = Callable[[bytes, str, Sequence[CoulombViscous]], bytes]
"""A file and its name -> that file with the values of some joints."""
_Element = Callable[[int, CoulombViscous], str]
"""The number of a joint, and its values -> its element."""
_TYPES = {False: ("revolute", "continuous"), True: ("prismatic",)}
"""Of a joint in a URDF or an SDF, by whether the exported one slides."""


def write_urdf(joints: Sequence[ExportedJoint], request: Request) -> Artefact:
    """A URDF with the best values along the motion that is asked for.

    Raises InputError where a joint's torque is a current, or the file that is merged into is no URDF or lacks the joint.
    """
    # a robot of these joints, each with a link of its own on one base
    head = f'<robot name={attribute(slug(joints))}>\n  <link name="base"/>'
    around = comment(_PLACEHOLDERS.format("Links, axes and limits", "URDF")), head, "</robot>"
    return _written("urdf", joints, request, _into_urdf, around, _urdf_joint)


def _written(
    kind: str,
    joints: Sequence[ExportedJoint],
    request: Request,
    merged: _Merged,
    around: Sequence[str],
    element: _Element,
) -> Artefact:
    """What holds the best values: the file that is merged into, or one with a comment, then the elements between a head and an end."""
    found = best_values(joints, request, kind)
    if request.into is not None:
        content = merged(request.into, request.into_name, found)
    else:
        note, head, end = around
        content = "\n".join([_HEAD + note, head, *map(element, range(len(found)), found), end, ""]).encode()
    return artefact_of(found, kind, f".{kind}", content, _HOLDS)


def _urdf_dynamics(one: CoulombViscous) -> str:
    return f"<dynamics {' '.join(f'{name}={attribute(value)}' for name, value in _values(one).items())}/>"


def _urdf_joint(k: int, one: CoulombViscous) -> str:
    """A joint and its link, which has the identified inertia, or 1 where none is known."""
    sliding = slides(one.joint.kind)
    J = one.joint.inertia or 1.0
    mass, moment = (repr(J), "1") if sliding else ("1", repr(J))
    limit = f' lower="-{_FAR}" upper="{_FAR}"' if sliding else ""
    return f"""\
  <joint name={attribute(one.joint.name)} type="{"prismatic" if sliding else "continuous"}">
    <parent link="base"/>
    <child link="link_{k}"/>
    <axis xyz="{"1 0 0" if sliding else "0 0 1"}"/>
    <limit effort="{_FAR}" velocity="{_FAR}"{limit}/>
    {comment(_note(one))}
    {_urdf_dynamics(one)}
  </joint>
  <link name="link_{k}">
    <inertial>
      <mass value="{mass}"/>
      <inertia ixx="{moment}" ixy="0" ixz="0" iyy="{moment}" iyz="0" izz="{moment}"/>
    </inertial>
  </link>"""


def _into_urdf(into: bytes, name: str, found: Sequence[CoulombViscous]) -> bytes:
    """The URDF with the values in its joints, and nothing else changed."""
    document = XmlDocument.read(into, name)
    root, what = document.root, document.what
    if root.tag != "robot":
        raise InputError(f"{what}: its root is <{one_line(root.tag, 40)}>; expected a URDF, whose root is <robot>")
    joints = [x for x in root.children if x.tag == "joint"]
    remedy = "run xacro on it first; " if any(x.tag.startswith("xacro:") for x in root.children) else ""
    for one in found:
        joint = _place(what, joints, one.joint, remedy)
        dynamics = [x for x in joint.children if x.tag == "dynamics"]
        if len(dynamics) > 1:
            where = f"{what}, line {joint.line}: joint {short(one.joint.name)}"
            raise InputError(f"{where} has two <dynamics>; keep one of them")
        document.annotate(joint, _note(one))
        if dynamics:
            document.set_attributes(dynamics[0], _values(one))
        else:
            document.insert_last(joint, _urdf_dynamics(one))
    return document.written()


def write_sdf(joints: Sequence[ExportedJoint], request: Request) -> Artefact:
    """An SDF with the best values along the motion that is asked for.

    Raises InputError where a joint's torque is a current, or the file that is merged into is no SDF or lacks the joint.
    """
    # a model of these joints, each between the world and a link of its own
    head = f'<sdf version="1.6">\n  <model name={attribute(slug(joints))}>'
    around = comment(_PLACEHOLDERS.format("Links and axes", "SDF")), head, "  </model>\n</sdf>"
    return _written("sdf", joints, request, _into_sdf, around, _sdf_joint)


def _sdf_dynamics(one: CoulombViscous, indent: str = "") -> str:
    """The element with its comment, the second and later lines indented."""
    elements = [f"<{tag}>{value}</{tag}>" for tag, value in _values(one).items()]
    inside = "\n".join((comment(_note(one)), *elements)).replace("\n", "\n  ")
    return f"<dynamics>\n  {inside}\n</dynamics>".replace("\n", f"\n{indent}")


def _sdf_joint(k: int, one: CoulombViscous) -> str:
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
        {_sdf_dynamics(one, " " * 8)}
      </axis>
    </joint>"""


def _into_sdf(into: bytes, name: str, found: Sequence[CoulombViscous]) -> bytes:
    """The SDF with the values in its joints, and nothing else changed."""
    document = XmlDocument.read(into, name)
    for one in found:
        axis = _axis(document, one.joint)
        dynamics = [x for x in axis.children if x.tag == "dynamics"]
        if not dynamics:
            document.insert_last(axis, _sdf_dynamics(one))
            continue
        document.annotate(dynamics[0], _note(one))
        for tag, value in _values(one).items():
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
    element = _place(what, joints, joint)
    where = f"{what}, line {element.line}: joint {short(joint.name)}"
    axes = [x for x in element.children if x.tag == "axis"]
    if len(axes) != 1:
        raise InputError(f"{where} has {len(axes)} <axis>; expected one")
    dynamics = [x for x in axes[0].children if x.tag == "dynamics"]
    inside = [x.tag for one in dynamics for x in one.children if x.tag in ("damping", "friction")]
    if len(dynamics) > 1:
        raise InputError(f"{where} has two <dynamics> in its <axis>; keep one of them")
    if twice := [tag for tag in sorted(inside) if inside.count(tag) > 1]:
        raise InputError(f"{where} has two <{twice[0]}> in its <dynamics>; keep one of them")
    return axes[0]


def _note(one: CoulombViscous) -> str:
    """What stands beside `<dynamics>`; its first two words mark it as ours."""
    return "\n     ".join(comment_lines(one, _HOLDS))


def _values(one: CoulombViscous) -> dict[str, str]:
    """What `<dynamics>` has, every digit."""
    return {"damping": repr(one.viscous), "friction": repr(one.coulomb)}


def _place(what: str, elements: Sequence[XmlElement], joint: ExportedJoint, remedy: str = "") -> XmlElement:
    """The one element of a file's joints that has the joint's name.

    Raises InputError where there is none, opening the list of its joints with a remedy, or two, or it does not move as the exported one.
    """
    found = joint_named(what, elements, joint.name, remedy)
    got, expected = found.attributes.get("type", ""), _TYPES[slides(joint.kind)]
    if got not in expected:
        raise InputError(
            f"{what}, line {found.line}: joint {short(joint.name)} is {short(got)}, and the identified one is {joint.kind}; "
            f"expected {' or '.join(expected)}"
        )
    return found


URDF = ExportTarget(fitted=True, write=write_urdf, merges=True)
SDF = ExportTarget(fitted=True, write=write_sdf, merges=True)
