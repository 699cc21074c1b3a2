"""The joints of a URDF or an SDF, read again: by an XML parser, MuJoCo, Pinocchio, and `gz sdf --check`."""

import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from xml.etree import ElementTree as Xml

from bristle.errors import one_line
from bristle.questions.export.coulomb_viscous import best_values
from bristle.questions.export.export import Artefact, Request
from bristle.questions.export.exported import ExportedJoint
from export_checks.common import NotInstalled, Values, compared, expected_values

_FAR = "1000"
"""A limit that is none."""


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


def _parsed(text: str) -> Xml.Element:
    return Xml.fromstring(text)  # noqa: S314  # our own text, or one that `XmlDocument` found without entities


def _written(root: Xml.Element) -> Values:
    held = {joint.get("name", ""): joint.find("dynamics") for joint in root.iterfind("joint")}
    return {
        name: (float(x.get("damping", "nan")), float(x.get("friction", "nan")))
        for name, x in held.items() if x is not None
    }  # fmt: skip  # an entry


def _tree(root: Xml.Element) -> str:
    """The joints with their dynamics, and links that are balls: without meshes, limits and whatever else a loader may miss."""
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


def check_sdf(artefact: Artefact, joints: Sequence[ExportedJoint], request: Request) -> tuple[str, ...]:
    """Parses the file again, and lets `gz sdf --check` read it. Raises NotInstalled where that is not installed."""
    root = Xml.fromstring(artefact.content)  # noqa: S314  # our own text, or one that `XmlDocument` found without entities
    held = {
        joint.get("name", ""): (_number(dynamics, "damping"), _number(dynamics, "friction"))
        for joint in root.iter("joint")
        for dynamics in joint.iterfind("axis/dynamics")
    }
    line = compared("parsed again", held, expected_values(best_values(joints, request, "sdf")))
    gz = shutil.which("gz")
    if gz is None:
        raise NotInstalled(f"{line}; gz, whose `gz sdf --check` reads an SDF, is not here: install Gazebo")
    return line, _by_gazebo(gz, artefact.content)


def _number(dynamics: Xml.Element, tag: str) -> float:
    return float(dynamics.findtext(tag, "nan"))


def _by_gazebo(gz: str, content: bytes) -> str:
    """What `gz sdf --check` says of a file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "exported.sdf"
        path.write_bytes(content)
        done = subprocess.run(  # noqa: S603  # the program that was found, and our own file
            [gz, "sdf", "--check", str(path)], capture_output=True, text=True, timeout=60, check=False
        )
    said = one_line((done.stdout + done.stderr).replace(str(path), "the file"), 200)
    return f"gz sdf --check: {said or 'nothing to say'} (status {done.returncode})"
