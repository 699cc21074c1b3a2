"""Export to URDF and SDFormat (1.6 and later): `<dynamics>` of joints in a small model, or merged into a given file."""

from collections.abc import Sequence

from bristle.errors import InputError, short
from bristle.model.parameters import slides
from bristle.questions.export.coulomb_viscous import CoulombViscous, comment_lines, target_of
from bristle.questions.export.export import slug
from bristle.questions.export.exported import ExportedJoint
from bristle.questions.export.xml_edit import XmlDocument, XmlElement, attribute, comment, joint_named

_HOLDS = (
    "Coulomb friction and damping, the same in both directions; no Stribeck peak, no presliding, and no rotor inertia."
)
_HEAD = '<?xml version="1.0" encoding="utf-8"?>\n'
_PLACEHOLDERS = "{} are placeholders, so that this file loads; copy <dynamics> into your own {}, or export into that."
_FAR = "1000"  # stands for no limit
_TYPES = {False: ("revolute", "continuous"), True: ("prismatic",)}  # of joints, by whether the exported one slides


def _new_urdf(found: Sequence[CoulombViscous]) -> bytes:
    """A robot of these joints, each with a link on one base."""
    head = f'<robot name={attribute(slug([one.joint for one in found]))}>\n  <link name="base"/>'
    note = comment(_PLACEHOLDERS.format("Links, axes and limits", "URDF"))
    return "\n".join([_HEAD + note, head, *map(_urdf_joint, range(len(found)), found), "</robot>", ""]).encode()


def _urdf_dynamics(one: CoulombViscous) -> str:
    return f"<dynamics {' '.join(f'{name}={attribute(value)}' for name, value in _values(one).items())}/>"


def _urdf_joint(k: int, one: CoulombViscous) -> str:
    """A joint and its link, with the identified inertia or 1."""
    sliding, J = slides(one.joint.kind), repr(one.joint.inertia or 1.0)
    mass, moment = (J, "1") if sliding else ("1", J)
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


def _into_urdf(document: XmlDocument, one: CoulombViscous) -> None:
    children = document.root.children
    remedy = "run xacro on it first; " if any(x.tag.startswith("xacro:") for x in children) else ""
    joint, where = _place(document, [x for x in children if x.tag == "joint"], one.joint, remedy)
    dynamics = _only(joint, "dynamics", where)
    document.annotate(joint, _note(one))
    if dynamics:
        document.set_attributes(dynamics, _values(one))
    else:
        document.insert_last(joint, _urdf_dynamics(one))


def _new_sdf(found: Sequence[CoulombViscous]) -> bytes:
    """A model of these joints, each between the world and a link."""
    head = f'<sdf version="1.6">\n  <model name={attribute(slug([one.joint for one in found]))}>'
    note, joints = comment(_PLACEHOLDERS.format("Links and axes", "SDF")), map(_sdf_joint, range(len(found)), found)
    return "\n".join([_HEAD + note, head, *joints, "  </model>\n</sdf>", ""]).encode()


def _sdf_dynamics(one: CoulombViscous, indent: str = "") -> str:
    """The element with its comment, the second and later lines indented."""
    elements = [f"<{tag}>{value}</{tag}>" for tag, value in _values(one).items()]
    inside = "\n".join((comment(_note(one)), *elements)).replace("\n", "\n  ")
    return f"<dynamics>\n  {inside}\n</dynamics>".replace("\n", f"\n{indent}")


def _sdf_joint(k: int, one: CoulombViscous) -> str:
    """A joint and its link, with the identified inertia or 1."""
    sliding, J = slides(one.joint.kind), one.joint.inertia or 1.0
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


def _into_sdf(document: XmlDocument, one: CoulombViscous) -> None:
    joints = [x for model in document.root.find_all("model") for x in model.children if x.tag == "joint"]
    joint, where = _place(document, joints, one.joint)
    axes = [x for x in joint.children if x.tag == "axis"]
    if len(axes) != 1:
        raise InputError(f"{where} has {len(axes)} <axis>; expected one")
    dynamics = _only(axes[0], "dynamics", where, " in its <axis>")
    if not dynamics:
        document.insert_last(axes[0], _sdf_dynamics(one))
        return
    document.annotate(dynamics, _note(one))
    for tag, value in _values(one).items():
        text, old = f"<{tag}>{value}</{tag}>", _only(dynamics, tag, where, " in its <dynamics>")
        if old:
            document.replace(old, text)
        else:
            document.insert_last(dynamics, text)


def _only(parent: XmlElement, tag: str, where: str, within: str = "") -> XmlElement | None:
    """The child with a tag, if any. Raises InputError where there are two."""
    found = [x for x in parent.children if x.tag == tag]
    if len(found) > 1:
        raise InputError(f"{where} has two <{tag}>{within}; keep one of them")
    return found[0] if found else None


def _note(one: CoulombViscous) -> str:
    """The comment beside `<dynamics>`; its first two words mark it as ours."""
    return "\n     ".join(comment_lines(one, _HOLDS))


def _values(one: CoulombViscous) -> dict[str, str]:
    return {"damping": repr(one.viscous), "friction": repr(one.coulomb)}


def _place(
    document: XmlDocument, elements: Sequence[XmlElement], joint: ExportedJoint, remedy: str = ""
) -> tuple[XmlElement, str]:
    """`joint_named`, which also raises InputError where the element moves in another way than the joint."""
    found, where = joint_named(document.what, elements, joint.name, remedy)
    got, expected = found.attributes.get("type", ""), _TYPES[slides(joint.kind)]
    if got not in expected:
        raise InputError(
            f"{where} is {short(got)}, and the identified one is {joint.kind}; expected {' or '.join(expected)}"
        )
    return found, where


URDF = target_of("urdf", ".urdf", _HOLDS, _new_urdf, _into_urdf, ("URDF", "robot"))
SDF = target_of("sdf", ".sdf", _HOLDS, _new_sdf, _into_sdf, ("SDF", "sdf"))
