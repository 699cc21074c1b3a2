"""A URDF: joints, limits, masses.

Meshes, includes and whatever else it names are never opened; the text for Pinocchio is written anew from checked
numbers.
"""

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Annotated, Literal
from xml.etree import ElementTree as Xml

from pydantic import Field, StrictStr

from bristle.data.experiment.signals import quantity
from bristle.data.experiment.yaml_file import StrictModel
from bristle.data.text_table import naming
from bristle.errors import InputError, check_name, read_at_most, short, short_list

MAX_BYTES = 2**23  # largest URDF, bytes
MAX_JOINTS = 1000  # most joints of a URDF, fixed ones included
_MOVES: dict[str, Literal["revolute", "prismatic"]]
_MOVES = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic"}
_TYPES = (*_MOVES, "fixed")
_ENDS, _MOMENTS = ("parent", "child"), ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
_ORIGIN = {"xyz": "0 0 0", "rpy": "0 0 0"}
_FAR = 1e9  # no length, mass or limit of a robot is larger, in SI
PAYLOAD = "bristle_payload"  # what the link of a payload is called


@dataclass(frozen=True, slots=True, kw_only=True)
class UrdfJoint:
    """A joint that moves, with its limits, SI; infinite where there are none."""

    name: str
    kind: Literal["revolute", "prismatic"]
    lower: float
    upper: float
    velocity: float
    effort: float


Metres = Annotated[float, quantity("m")]


class Payload(StrictModel):
    """What the robot holds: a point mass, kg, in the frame of a link, m, (3,)."""

    mass: Annotated[float, quantity("kg"), Field(gt=0)]
    center: tuple[Metres, Metres, Metres] = (0.0, 0.0, 0.0)
    link: Annotated[StrictStr, Field(min_length=1, max_length=200)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Urdf:
    """The moving joints of a URDF, and a text of masses and joints alone."""

    file: str
    joints: tuple[UrdfJoint, ...]
    links: tuple[str, ...]
    text: str  # without shapes; each number is finite, and names are our own, which no parser takes for its own
    places: Mapping[str, str]  # what each joint is called there

    def joint(self, name: str) -> UrdfJoint:
        """The moving joint of a name. Raises InputError where there is none."""
        for joint in self.joints:
            if joint.name == name:
                return joint
        there = short_list(j.name for j in self.joints)
        raise InputError(f"joint {short(name)} is none of {self.file}; expected one of {there}")

    def holding(self, payload: Payload) -> str:
        """The text with a payload fixed to a link. Raises InputError where the URDF has no such link."""
        if payload.link not in self.links:
            expected = f"a link of {self.file}: {short_list(self.links)}"
            raise InputError(f"robot.payload.link: got {short(payload.link)}; expected {expected}")
        moments = " ".join(f'{key}="0.0"' for key in _MOMENTS)
        held = (
            f'<link name="{PAYLOAD}"><inertial><origin xyz="{" ".join(map(repr, payload.center))}" /><mass value="{payload.mass!r}" />'
            f'<inertia {moments} /></inertial></link><joint name="{PAYLOAD}_joint" type="fixed">'
            f'<parent link="link_{self.links.index(payload.link)}" /><child link="{PAYLOAD}" /></joint></robot>'
        )
        return self.text.removesuffix("</robot>") + held


def read_urdf(path: Path) -> Urdf:
    """The robot of a URDF file.

    Raises InputError where it cannot be read, is no URDF, holds an invalid number, or its joints make no tree.
    """
    content = read_at_most(path, MAX_BYTES, "a URDF, without meshes")
    with naming(str(path)):
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            raise InputError(f"is not text in UTF-8 (byte {error.start}); expected a URDF") from error
        if "<!DOCTYPE" in text or "<!ENTITY" in text:  # which may grow without bound
            raise InputError("declares a document type or entities; expected a URDF without them")
        try:
            root = Xml.fromstring(text)  # noqa: S314  # without entities nothing grows, and nothing outside is opened
        except (Xml.ParseError, ValueError) as error:
            raise InputError(f"is not XML ({error}); expected a URDF") from error
        if root.tag != "robot":
            raise InputError(f"begins with <{str(root.tag)[:60]}>; expected a URDF, which begins with <robot>")
        links = _by_name(root, "link")
        joints = {key: x for key, x in _by_name(root, "joint").items() if x.find("parent") is not None}
        if not links or not joints:
            xacro = any("xacro" in str(x.tag) for x in root)
            remedy = "run xacro on it first" if xacro else "expected a URDF with <link> and <joint> elements"
            raise InputError(f"holds {len(links)} links and {len(joints)} joints; {remedy}")
        if len(joints) > MAX_JOINTS:
            raise InputError(f"holds {len(joints)} joints; expected at most {MAX_JOINTS}")
        moving = tuple(_moving_joints(joints))
        _refuse_no_tree(links, joints)
        numbered = {key: f"link_{k}" for k, key in enumerate(links)}
        places = {key: f"joint_{k}" for k, key in enumerate(joints)}
        clean = Xml.Element("robot", {"name": "robot"})
        clean.extend([_clean_link(name, x, numbered[name]) for name, x in links.items()])
        clean.extend([_clean_joint(name, x, places[name], numbered) for name, x in joints.items()])
        text = Xml.tostring(clean, encoding="unicode")
    return Urdf(file=path.name, joints=moving, links=tuple(links), text=text, places=places)


def _by_name(root: Xml.Element, tag: str) -> dict[str, Xml.Element]:
    found = root.findall(tag)
    names = [x.get("name", "") for x in found]
    for name, count in Counter(names).items():
        if not name:
            raise InputError(f"a <{tag}> has no name; name it")
        if count > 1:
            raise InputError(f"{count} <{tag}> elements are named {short(name)}; give each its own name")
        check_name(name, f"the name of a <{tag}>")
    return dict(zip(names, found, strict=True))


def _moving_joints(joints: Mapping[str, Xml.Element]) -> Iterator[UrdfJoint]:
    for name, x in joints.items():
        kind, limit = x.get("type", ""), x.find("limit")
        if kind not in _TYPES:
            raise InputError(f"joint {short(name)} is of type {short(kind)}; expected one of {', '.join(_TYPES)}")
        if kind in _MOVES:
            lower, upper = (_number(limit, key, math.nan, name) for key in ("lower", "upper"))
            if kind == "continuous" or not lower < upper:
                lower, upper = -math.inf, math.inf
            most = (_number(limit, key, math.nan, name) for key in ("velocity", "effort"))
            velocity, effort = (x if x > 0 else math.inf for x in most)
            yield UrdfJoint(name=name, kind=_MOVES[kind], lower=lower, upper=upper, velocity=velocity, effort=effort)


def _clean_link(name: str, x: Xml.Element, own: str) -> Xml.Element:
    """The link, named anew, with its mass alone."""
    made, inertial = Xml.Element("link", {"name": own}), x.find("inertial")
    if inertial is not None:
        into = Xml.SubElement(made, "inertial")
        _copy(inertial, into, "origin", _ORIGIN, name)
        (mass,) = _copy(inertial, into, "mass", {"value": "nan"}, name)
        if not mass >= 0:
            raise InputError(f"link {short(name)}: the mass is {mass:g}; expected a number that is not negative")
        _copy(inertial, into, "inertia", dict.fromkeys(_MOMENTS, "0"), name)
    return made


def _clean_joint(name: str, x: Xml.Element, own: str, numbered: Mapping[str, str]) -> Xml.Element:
    """The joint, named anew, with its place and axis; one without ends turns between limits that nothing reaches."""
    kind = x.get("type", "")
    made = Xml.Element("joint", {"name": own, "type": _MOVES.get(kind, kind)})
    _copy(x, made, "origin", _ORIGIN, name)
    for role, end in zip(_ENDS, _ends(x), strict=True):
        Xml.SubElement(made, role, {"link": numbered[end]})
    if kind in _MOVES:
        if not any(_copy(x, made, "axis", {"xyz": "1 0 0"}, name)):
            raise InputError(f"joint {short(name)}: its axis has no direction; expected one such as 0 0 1")
        Xml.SubElement(made, "limit", {"lower": "-1e9", "upper": "1e9", "effort": "1e9", "velocity": "1e9"})
    return made


def _copy(x: Xml.Element, into: Xml.Element, tag: str, defaults: Mapping[str, str], name: str) -> list[float]:
    """The numbers of a child of an element, or their defaults, which are copied into another one."""
    child, found = x.find(tag), list[float]()
    copied = Xml.SubElement(into, tag)
    for key, default in defaults.items():
        text = default if child is None else child.get(key, default)
        cells, many = text.split(), len(default.split())
        if len(cells) != many:
            why = f"{short(name)}: got {short(text)}"
            raise InputError(f"{why}; expected {'three numbers' if many > 1 else 'a number'}")
        numbers = [_float(cell, f"{name}: {key}") for cell in cells]
        copied.set(key, " ".join(map(repr, numbers)))
        found += numbers
    return found


def _ends(joint: Xml.Element) -> list[str]:
    """The parent and the child of a joint; empty where it does not say."""
    ends = (joint.find(role) for role in _ENDS)
    return ["" if end is None else end.get("link", "") for end in ends]


def _refuse_no_tree(links: Mapping[str, Xml.Element], joints: Mapping[str, Xml.Element]) -> None:
    """Raise InputError unless the joints make one tree of all links."""
    parent: dict[str, str] = {}
    for name, x in joints.items():
        above, below = _ends(x)
        missing = next((end for end in (above, below) if end not in links), None)
        if missing is not None:
            raise InputError(f"joint {short(name)} names the link {short(missing)}, which is missing; add the link")
        if below in parent:
            expected = "expected a tree, each link with one parent"
            raise InputError(f"link {short(below)} is the child of two joints; {expected}")
        parent[below] = above
    roots, tree = [link for link in links if link not in parent], TopologicalSorter({x: [y] for x, y in parent.items()})
    with suppress(CycleError):
        tree.prepare()
        if len(roots) == 1:
            return
    why = f"its joints make no single tree of its {len(links)} links ({len(roots)} without a parent)"
    raise InputError(f"{why}; expected exactly one")


def _number(x: Xml.Element | None, key: str, default: float, name: str) -> float:
    text = None if x is None else x.get(key)
    return default if text is None else _float(text, f"{name}: {key}")


def _float(text: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not abs(value) <= _FAR:
        remedy = "; run xacro on it first" if "${" in text else ""
        raise InputError(f"{where[:80]}: got {short(text)}; expected a number of at most {_FAR:g} in size{remedy}")
    return value
