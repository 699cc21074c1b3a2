"""A URDF, read with care: joints, limits, masses. What a parser could stumble on is refused before one sees it.

Meshes, includes and whatever else it names are never opened; what goes on to Pinocchio is written anew from numbers.
"""

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal
from xml.etree import ElementTree as Xml

from bristle.errors import InputError, check_name, read_at_most, short, short_list

MAX_BYTES = 2**23
"""Largest URDF, bytes."""
MAX_JOINTS = 1000
"""Most joints of a URDF, fixed ones included."""
_MOVES: dict[str, Literal["revolute", "prismatic"]] = {
    "revolute": "revolute",
    "continuous": "revolute",
    "prismatic": "prismatic",
}
_TYPES = (*_MOVES, "fixed")
_FAR = 1e9
"""No length, mass or limit of a robot is larger, in SI."""
PAYLOAD = "bristle_payload"
"""What the link of a payload is called."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UrdfJoint:
    """A joint that moves, with its limits, SI; infinite where there are none."""

    name: str
    kind: Literal["revolute", "prismatic"]
    lower: float
    upper: float
    velocity: float
    effort: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Payload:
    """What the robot holds: a point of mass, kg, somewhere in the frame of a link, m, (3,)."""

    mass: float
    center: tuple[float, float, float]
    link: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Urdf:
    """What a URDF says of a robot: its joints that move, and a text of masses and joints alone."""

    file: str
    joints: tuple[UrdfJoint, ...]
    links: tuple[str, ...]
    text: str
    """A URDF without shapes: each number was read, and is finite; names are our own, which no parser takes for its own."""
    places: Mapping[str, str]
    """What each joint is called there."""

    def place(self, name: str) -> str:
        """What a joint that moves is called in `text`. Raises InputError as `joint` does."""
        return self.places[self.joint(name).name]

    def joint(self, name: str) -> UrdfJoint:
        """The joint of a name. Raises InputError where none that moves has it."""
        for joint in self.joints:
            if joint.name == name:
                return joint
        raise InputError(
            f"joint {short(name)} is none of {self.file}; expected one of {short_list(j.name for j in self.joints)}"
        )

    def holding(self, payload: Payload) -> str:
        """The text with a payload fixed to a link. Raises InputError where the URDF has no such link."""
        if payload.link not in self.links:
            raise InputError(
                f"robot.payload.link: got {short(payload.link)}; expected a link of {self.file}: {short_list(self.links)}"
            )
        root = Xml.fromstring(self.text)  # noqa: S314  # our own text
        link = Xml.SubElement(root, "link", name=PAYLOAD)
        inertial = Xml.SubElement(link, "inertial")
        Xml.SubElement(inertial, "origin", xyz=_text(payload.center))
        Xml.SubElement(inertial, "mass", value=repr(payload.mass))
        Xml.SubElement(inertial, "inertia", dict.fromkeys(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), "0.0"))
        joint = Xml.SubElement(root, "joint", name=f"{PAYLOAD}_joint", type="fixed")
        Xml.SubElement(joint, "parent", link=_link(self.links.index(payload.link)))
        Xml.SubElement(joint, "child", link=PAYLOAD)
        return Xml.tostring(root, encoding="unicode")


def read_urdf(path: Path) -> Urdf:
    """The robot that a URDF file describes.

    Raises InputError, one sentence, where it cannot be read, is no URDF, holds a number that is none, or its joints make no
    tree.
    """
    content = read_at_most(path, MAX_BYTES, "a URDF, without meshes")
    try:
        return _urdf(content, path.name)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _urdf(content: bytes, name: str) -> Urdf:
    root = _root(content)
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
    numbered = {key: _link(k) for k, key in enumerate(links)}
    places = {key: f"joint_{k}" for k, key in enumerate(joints)}
    clean = Xml.Element("robot", name="robot")
    clean.extend([_clean_link(key, x, numbered) for key, x in links.items()])
    clean.extend([_clean_joint(key, x, places, numbered) for key, x in joints.items()])
    text = Xml.tostring(clean, encoding="unicode")
    return Urdf(file=name, joints=moving, links=tuple(links), text=text, places=places)


def _link(k: int) -> str:
    return f"link_{k}"


def _root(content: bytes) -> Xml.Element:
    """The document's root; entities, which may grow without bound, are refused."""
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"is no text in UTF-8 (byte {error.start}); expected a URDF") from error
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise InputError("declares a document type or entities; expected a URDF without them")
    try:
        root = Xml.fromstring(text)  # noqa: S314  # without entities nothing grows, and nothing outside is opened
    except (Xml.ParseError, ValueError) as error:
        raise InputError(f"is no XML ({error}); expected a URDF") from error
    if root.tag != "robot":
        raise InputError(f"begins with <{str(root.tag)[:60]}>; expected a URDF, which begins with <robot>")
    return root


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
        kind = x.get("type", "")
        if kind not in _TYPES:
            raise InputError(f"joint {short(name)} is of type {short(kind)}; expected one of {', '.join(_TYPES)}")
        if kind in _MOVES:
            limit = x.find("limit")
            lower, upper, velocity, effort = (
                _number(limit, key, math.nan, name) for key in ("lower", "upper", "velocity", "effort")
            )
            known = kind != "continuous" and lower < upper
            yield UrdfJoint(
                name=name,
                kind=_MOVES[kind],
                lower=lower if known else -math.inf,
                upper=upper if known else math.inf,
                velocity=velocity if velocity > 0 else math.inf,
                effort=effort if effort > 0 else math.inf,
            )


def _clean_link(name: str, x: Xml.Element, numbered: Mapping[str, str]) -> Xml.Element:
    """The link with its mass, and nothing else."""
    clean = Xml.Element("link", name=numbered[name])
    inertial = x.find("inertial")
    if inertial is None:
        return clean
    mass = _number(inertial.find("mass"), "value", math.nan, name)
    if not mass >= 0:
        raise InputError(f"link {short(name)}: the mass is {mass:g}; expected a number that is not negative")
    own = Xml.SubElement(clean, "inertial")
    own.append(_clean_origin(inertial, name))
    Xml.SubElement(own, "mass", value=repr(mass))
    moments = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    tensor = inertial.find("inertia")
    Xml.SubElement(own, "inertia", {key: repr(_number(tensor, key, 0.0, name)) for key in moments})
    return clean


def _clean_joint(name: str, x: Xml.Element, places: Mapping[str, str], numbered: Mapping[str, str]) -> Xml.Element:
    """The joint with where it stands and its axis; one without end turns between limits that nothing reaches."""
    kind = x.get("type", "")
    clean = Xml.Element("joint", name=places[name], type=_MOVES.get(kind, kind))
    clean.append(_clean_origin(x, name))
    for role in ("parent", "child"):
        end = x.find(role)
        Xml.SubElement(clean, role, link="" if end is None else numbered[end.get("link", "")])
    if kind in _MOVES:
        axis = x.find("axis")
        direction = (1.0, 0.0, 0.0) if axis is None else _triple(axis.get("xyz", "1 0 0"), name)
        if not math.hypot(*direction) > 0:
            raise InputError(f"joint {short(name)}: its axis has no direction; expected one such as 0 0 1")
        Xml.SubElement(clean, "axis", xyz=_text(direction))
        Xml.SubElement(clean, "limit", lower="-1e9", upper="1e9", effort="1e9", velocity="1e9")
    return clean


def _clean_origin(x: Xml.Element, name: str) -> Xml.Element:
    origin = x.find("origin")
    places = ("0 0 0", "0 0 0") if origin is None else (origin.get("xyz", "0 0 0"), origin.get("rpy", "0 0 0"))
    return Xml.Element("origin", xyz=_text(_triple(places[0], name)), rpy=_text(_triple(places[1], name)))


def _refuse_no_tree(links: Mapping[str, Xml.Element], joints: Mapping[str, Xml.Element]) -> None:
    """Raise InputError unless the joints make one tree of all links."""
    parent: dict[str, str] = {}
    for name, x in joints.items():
        ends = [x.find(role) for role in ("parent", "child")]
        above, below = ("" if end is None else end.get("link", "") for end in ends)
        missing = next((end for end in (above, below) if end not in links), None)
        if missing is not None:
            raise InputError(
                f"joint {short(name)} names the link {short(missing)}, which there is none of; add the link"
            )
        if below in parent:
            raise InputError(
                f"link {short(below)} is the child of two joints; expected a tree, each link with one parent"
            )
        parent[below] = above
    roots = [link for link in links if link not in parent]
    children: dict[str, list[str]] = {}
    for below, above in parent.items():
        children.setdefault(above, []).append(below)
    reached, ahead = 0, roots[:1]
    while ahead:
        reached += 1
        ahead += children.get(ahead.pop(), [])
    if len(roots) != 1 or reached != len(links):
        raise InputError(
            f"its joints make no single tree of its {len(links)} links ({len(roots)} without a parent); expected exactly one"
        )


def _number(x: Xml.Element | None, key: str, default: float, name: str) -> float:
    text = None if x is None else x.get(key)
    return default if text is None else _float(text, f"{name}: {key}")


def _triple(text: str, name: str) -> tuple[float, float, float]:
    cells = text.split()
    if len(cells) != 3:
        raise InputError(f"{short(name)}: got {short(text)}; expected three numbers")
    x, y, z = (_float(cell, name) for cell in cells)
    return x, y, z


def _float(text: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not abs(value) <= _FAR:
        remedy = "; run xacro on it first" if "${" in text else ""
        raise InputError(f"{where[:80]}: got {short(text)}; expected a number of at most {_FAR:g} in size{remedy}")
    return value


def _text(numbers: tuple[float, float, float]) -> str:
    return " ".join(map(repr, numbers))
