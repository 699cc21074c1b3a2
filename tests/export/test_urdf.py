import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any
from xml.etree import ElementTree as Xml

import numpy as np
import pytest

from bristle.errors import InputError
from bristle.model.parameters import unit
from bristle.questions.export.axes import SDF as SDF_TARGET
from bristle.questions.export.axes import URDF as URDF_TARGET
from bristle.questions.export.coulomb_viscous import ISAAC as ISAAC_TARGET
from bristle.questions.export.coulomb_viscous import best_values
from bristle.questions.export.export import Request
from bristle.questions.export.exported import ExportedJoint
from bristle.questions.export.loss import along, coulomb_viscous, friction_of
from export_checks.axes import check_urdf
from export_checks.documents import check_isaac

from .conftest import HOSTILE, SURROGATE, Handed, beside, scaled

ARM = Path(__file__).parents[2] / "datasets" / "arm" / "arm.urdf"
JOINTS = ("gripper rotation", "wrist pitch", "elbow pitch", "base rotation")
URDF = b"""\
<?xml version="1.0" ?>\r
<robot name='r' xmlns:xacro="http://www.ros.org/wiki/xacro">\r
\t<!-- <joint name="wrist pitch" type="revolute"> -->\r
\t<joint   name = 'wrist pitch'  type="revolute" ><!-- keep -- me not -->\r
""".replace(b" -- me not", b"") + b"""\
\t\t<parent link="a"/><child link="b"/>\r
\t</joint>\r
\t<joint name="slide" type="prismatic"/>\r
\t<joint name="rigid" type="fixed"/>\r
\t<joint name="twice" type="revolute"/><joint name="twice" type="revolute"/>\r
\t<joint name="elbow pitch" type="continuous"><dynamics  friction='1'\tspring="2"/></joint>\r
\t<joint name="two" type="revolute"><dynamics/><dynamics/></joint>\r
\t<transmission name="t"><joint name="wrist pitch"><hardwareInterface>E</hardwareInterface></joint>\r
\t\t<joint name="only here" type="revolute"/></transmission>\r
\t<xacro:macro name="m"><joint name="in a macro" type="revolute"/></xacro:macro>\r
\t<link name="a"/><link name="b"/><![CDATA[ <joint> ]]>\r
</robot>\r
"""  # fmt: skip  # one file
SDF = b"""\
<sdf version='1.7'>
    <world name="w">
        <model name="m">
            <joint name="wrist pitch" type="revolute">
                <axis>
                    <xyz>0 0 1</xyz>
                    <dynamics> <spring_reference>1</spring_reference>
                        <friction  a="b"> 7 </friction></dynamics>
                </axis>
            </joint>
            <model name="inner"><joint name="elbow pitch" type="revolute"><axis/></joint></model>
            <joint name="slide" type="prismatic"><axis><dynamics/></axis></joint>
            <joint name="two" type="revolute"><axis/><axis/></joint>
            <joint name="no axis" type="revolute"/>
            <joint name="twice" type="revolute"><axis/></joint>
        </model>
        <model name="n"><joint name="twice" type="revolute"><axis/></joint></model>
        <plugin><joint name="in a plugin" type="revolute"/></plugin>
    </world>
</sdf>
"""


@pytest.fixture
def slide(handed: Handed) -> ExportedJoint:
    joint = handed("wrist pitch", name="slide", kind="prismatic")
    units = {x.parameter: unit(x.parameter.name, "prismatic") for x in joint.parameters}
    return replace(joint, parameters=tuple(replace(x, unit=units[x.parameter]) for x in joint.parameters))


def parsed(content: bytes) -> Xml.Element:
    return Xml.fromstring(content)  # noqa: S314  # made here


def outside(old: bytes, new: bytes) -> tuple[bytes, bytes]:
    """What lies between the part with which both begin and the part with which both end."""
    pairs = enumerate(zip(old, new, strict=False))
    begin = next((k for k, (x, y) in pairs if x != y), min(len(old), len(new)))
    pairs = enumerate(zip(reversed(old[begin:]), reversed(new[begin:]), strict=False))
    end = next((k for k, (x, y) in pairs if x != y), min(len(old), len(new)) - begin)
    return old[begin : len(old) - end], new[begin : len(new) - end]


@pytest.mark.parametrize(("name", "quadratic"), [*((name, 0.0) for name in JOINTS), ("wrist pitch", 0.05)])
def test_the_values_are_the_best_and_the_losses_are_those_of_the_formula(
    handed: Handed, name: str, quadratic: float
) -> None:
    """No other Coulomb and viscous friction loses less along the declared motion, and the loss is rms error by rms torque, in percent."""
    # what is lost of is all of the joint's friction, a term v abs(v) too
    joint = beside(handed(name), quadratic=quadratic) if quadratic else handed(name)
    (found,) = best_values([joint], Request(amplitude=0.3, frequency=0.7), "urdf")
    assert [x.motion.name for x in found.losses] == ["fitted", "medium", "slow", "presliding"]
    assert found.motion[1:] == (0.3, 0.7)

    def loss(coulomb: float, viscous: float) -> float:
        v, T = along(friction_of(found.joint), found.motion)
        error = coulomb * np.sign(v) + viscous * v - T
        return 100 * float(np.sqrt(np.mean(error**2) / np.mean(T**2)))

    least = loss(found.coulomb, found.viscous)
    assert found.losses[0].percent == pytest.approx(least, rel=1e-9)
    for x, y in ((1e-4, 0), (-1e-4, 0), (0, 1e-4), (0, -1e-4), (1e-4, 1e-4), (-1e-4, 1e-4), (1e-2, -1e-2)):
        assert loss(found.coulomb * (1 + x), found.viscous * (1 + y)) > least
    model, own = coulomb_viscous(found.coulomb, found.viscous), friction_of(found.joint)
    for one in found.losses:
        kept, true = (along(f, one.motion)[1] for f in (model, own))
        assert one.percent == pytest.approx(100 * np.linalg.norm(kept - true) / np.linalg.norm(true), rel=1e-12)


def test_hostile_names_and_joints_of_a_urdf(handed: Handed, slide: ExportedJoint) -> None:
    """Whatever a joint is called, the file has its numbers, one joint, and nothing that its name says; XML has U+FFFD for what it cannot hold."""
    (best,) = best_values([handed("wrist pitch")], Request(), "urdf")
    failed = []
    for name in (*HOSTILE, SURROGATE):
        joints = [handed("wrist pitch", name=name)]
        texts = [target.write(joints, Request()).content for target in (URDF_TARGET, SDF_TARGET)]
        urdf, sdf = map(parsed, texts)
        (joint,) = urdf.findall("joint")
        dynamics = {key: float(x) for one in joint.iter("dynamics") for key, x in one.attrib.items()}
        made = run(ISAAC_TARGET.write(joints, Request()).content)
        read = [content.decode() for content in texts]
        held = (
            (joint.get("name") == name) == (not {"\0", "\x1b", "\ud800"} & set(name)),
            dynamics == {"friction": best.coulomb, "damping": best.viscous},
            [float(x.text or "") for x in sdf.iter("friction")] == [best.coulomb],
            [(one, x.dynamic_friction) for one, x in made.items()] == [(name, best.coulomb)],
            all(c.isprintable() or c == "\n" for text in read for c in text),
            all(len(line) < 11_000 for text in read for line in text.splitlines()),
        )
        failed += [(name, held)] * (not all(held))
    assert failed == []
    # the snippet is a robot: MuJoCo and Pinocchio read damping and friction as exported, turning and sliding
    mujoco = pytest.importorskip("mujoco", reason="needs MuJoCo: pip install mujoco")
    joints = [*map(handed, JOINTS), slide, handed("wrist pitch", name="no inertia", inertia=None)]
    artefact = URDF_TARGET.write(joints, Request())
    lines = check_urdf(artefact, joints, Request())
    assert all(line.endswith(": damping and friction are as exported, to the last bit, in 6 joints") for line in lines)
    assert {"parsed", "MuJoCo"} <= {re.split(r"\W", line)[0] for line in lines}
    model = mujoco.MjModel.from_xml_string(artefact.content.decode())
    moving = model.body_inertia[1:, 2].tolist()
    assert moving[:4] == pytest.approx([x.inertia for x in joints[:4]])
    assert model.body_mass[5] == pytest.approx(slide.inertia)


def test_merging_into_a_urdf_changes_nothing_else(handed: Handed) -> None:
    """The file is byte-identical but for the comment and <dynamics> of the joint, which is not that of a transmission or a comment."""
    joint = handed("wrist pitch")
    (best,) = best_values([joint], Request(), "urdf")
    merged = URDF_TARGET.write([joint], Request(into=URDF, into_name="r.urdf")).content
    old, new = outside(URDF, merged)
    assert old == b""
    assert new.count(b"\n") == new.count(b"\r\n")
    assert f'<dynamics damping="{best.viscous!r}" friction="{best.coulomb!r}"/>'.encode() in new
    assert new.count(b"<dynamics ") == 1
    assert b"\r\n\t\t<!-- bristle: " in merged
    changed = [x for x in parsed(merged) if x.find("dynamics") is not None and x.get("name") == "wrist pitch"]
    assert len(changed) == 1
    assert merged.index(new) < URDF.index(b"\t</joint>") + len(new)
    # friction and damping are replaced, other attributes and blanks stay; merging once more changes nothing
    joint = handed("elbow pitch")
    (best,) = best_values([joint], Request(), "urdf")
    merged = URDF_TARGET.write([joint], Request(into=URDF, into_name="r.urdf")).content
    expected = f"""<dynamics  friction="{best.coulomb!r}"\tspring="2" damping="{best.viscous!r}"/><!-- bristle: """
    assert expected.encode() in merged
    assert URDF_TARGET.write([joint], Request(into=merged)).content == merged
    again = URDF_TARGET.write([joint], Request(into=merged, amplitude=0.1)).content
    assert again.count(b"<!-- bristle: ") == 1
    begin, end = merged.index(b"<dynamics  "), merged.index(b" -->", merged.index(b"<!-- bristle: "))
    assert again.startswith(merged[:begin])
    assert again.endswith(merged[end:])
    # a joint that is not there, there twice, rigid or of another kind, and what is no model: a sentence, with the line
    cases = [
        *((URDF_TARGET, URDF, name, why) for name, why in IN_URDF.items()),
        *((SDF_TARGET, SDF, name, why) for name, why in IN_SDF.items()),
        (URDF_TARGET, b"<robot/>", "wrist pitch", "f: has no joint 'wrist pitch'; its joints are none"),
        (URDF_TARGET, b"<mujoco/>", "wrist pitch", "f: its root is <mujoco>; expected a URDF"),
        (SDF_TARGET, b"<mujoco/>", "wrist pitch", "f: its root is <mujoco>; expected an SDF"),
        *((target, b"<robot>", "wrist pitch", "f, line 1: is not well-formed") for target in (URDF_TARGET, SDF_TARGET)),
    ]
    failed = []
    for target, content, name, why in cases:
        with pytest.raises(InputError) as error:
            target.write([handed("wrist pitch", name=name)], Request(into=content, into_name="f"))
        failed += [(name, str(error.value))] * (not str(error.value).startswith(why))
    assert failed == []


IN_URDF = {
    "rigid": "f, line 8: joint 'rigid' is 'fixed', and the identified one is revolute; expected revolute or continuous",
    "slide": "f, line 7: joint 'slide' is 'prismatic', and the identified one is revolute; expected revolute or continuous",
    "twice": "f: has joint 'twice' twice, in lines 9 and 9; expected a file that has it once",
    "two": "f, line 11: joint 'two' has two <dynamics>; keep one of them",
    "only here": "f: has no joint 'only here'; run xacro on it first; its joints are 'wrist pitch', 'slide', 'rigid', ",
    "in a macro": "f: has no joint 'in a macro'; run xacro on it first; its joints are 'wrist pitch'",
    "a\nb": r"f: has no joint 'a\nb'; run xacro on it first; ",
}
IN_SDF = {
    "twice": "f: has joint 'twice' twice, in lines 15 and 17; expected a file that has it once",
    "in a plugin": "f: has no joint 'in a plugin'; its joints are ",
    "two": "f, line 13: joint 'two' has 2 <axis>; expected one",
    "no axis": "f, line 14: joint 'no axis' has 0 <axis>; expected one",
    "slide": "f, line 12: joint 'slide' is 'prismatic', and the identified one is revolute; expected revolute or continuous",
}


def test_merging_into_an_sdf_keeps_springs(handed: Handed, slide: ExportedJoint) -> None:
    """Damping and friction are replaced or added, in worlds and nested models; springs and all else stay; merging twice changes nothing."""
    joints = [handed("wrist pitch"), handed("elbow pitch"), slide]
    best = {x.joint.name: x for x in best_values(joints, Request(), "sdf")}
    merged = SDF_TARGET.write(joints, Request(into=SDF, into_name="w.sdf")).content
    assert b"<spring_reference>1</spring_reference>" in merged
    held = {
        joint.get("name"): (float(joint.findtext("axis/dynamics/damping", "nan")), float(joint.findtext("axis/dynamics/friction", "nan")))
        for joint in parsed(merged).iter("joint") if joint.find("axis/dynamics") is not None
    }  # fmt: skip  # an entry
    assert held == {name: (x.viscous, x.coulomb) for name, x in best.items()}
    assert SDF_TARGET.write(joints, Request(into=merged)).content == merged
    lost = set(SDF.splitlines()) - set(merged.splitlines())
    assert {line.strip() for line in lost} == {
        b'<friction  a="b"> 7 </friction></dynamics>',
        b'<model name="inner"><joint name="elbow pitch" type="revolute"><axis/></joint></model>',
        b'<joint name="slide" type="prismatic"><axis><dynamics/></axis></joint>',
    }


@contextmanager
def stand_in() -> Iterator[None]:
    """Isaac Lab's ImplicitActuatorCfg as any namespace."""
    stub = ModuleType("isaaclab.actuators")
    stub.ImplicitActuatorCfg = SimpleNamespace  # type: ignore[attr-defined]
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, "isaaclab", ModuleType("isaaclab"))
        patch.setitem(sys.modules, "isaaclab.actuators", stub)
        yield


def run(content: bytes) -> dict[str, Any]:
    with stand_in():
        made: dict[str, Any] = {}
        exec(compile(content, "actuators.py", "exec"), made)  # noqa: S102  # written by ourselves
    found: dict[str, Any] = made["ACTUATORS"]
    return found


def test_the_actuators_of_isaac_lab_have_the_numbers(handed: Handed) -> None:
    """Static friction is the breakaway level, dynamic and viscous are the best values, armature is the identified inertia; a check says so."""
    joints = [*map(handed, JOINTS)]
    artefact = ISAAC_TARGET.write(joints, Request())
    made = run(artefact.content)
    with stand_in():
        said = check_isaac(artefact, joints, Request())
    assert said == ("compiled: its numbers are as exported", "Isaac Lab: takes it")
    for best in best_values(joints, Request(), "isaac"):
        actuator = made[best.joint.name]
        assert (actuator.dynamic_friction, actuator.viscous_friction) == (best.coulomb, best.viscous)
        assert actuator.friction == pytest.approx(np.mean([p.alpha_0 + p.alpha_1 for p in best.joint.pair]), rel=1e-15)
        assert actuator.armature == best.joint.rotor_inertia
        assert [re.fullmatch(actuator.joint_names_expr[0], x.name) is not None for x in joints] == [
            x is best.joint for x in joints
        ]
    # PhysX refuses a static friction below the dynamic one, which a joint without viscous friction at low speed could have
    joint = handed("wrist pitch")
    small = beside(scaled(joint, alpha_0=1e-5, alpha_1=0.0, alpha_2=0.0), quadratic=5.0)
    made = run(ISAAC_TARGET.write([small], Request()).content)["wrist pitch"]
    assert made.friction >= made.dynamic_friction
    # without an inertia it stays as the asset has it; of a robot's joint it is the rotor's alone
    for changes, armature in (
        ({"inertia": None, "rotor_inertia": None}, None),
        ({"inertia": 10.0}, joint.rotor_inertia),
    ):
        (made,) = run(ISAAC_TARGET.write([replace(joint, **changes)], Request()).content).values()
        assert made.armature == armature
