import math
import os
import re
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bristle.data.robot.motion import read_motions, reader_of, rigid_body
from bristle.data.robot.robot_file import Robot, pick
from bristle.data.robot.urdf import MAX_BYTES, MAX_JOINTS, read_urdf
from bristle.errors import InputError
from simulated_arm import ArmLog

from ..data.experiments import assert_refused
from .arms import ARM, NAMES, SIGNALS, document, inertial, load_robot, pendulum, write

TRACKING = {"files": "log.npz", "experiment": "tracking"}


def with_joint(place: int = 2, **changed: Any) -> list[dict[str, Any]]:
    return [{**own, **(changed if k == place else {})} for k, own in enumerate(document()["joints"])]


def test_columns_limits_and_keys_of_each_joint(tmp_path: Path) -> None:
    """By name, by a range, by a list, by an index, and of one matrix for all; time is everyone's."""
    signals = {
        "time": {"column": "t", "unit": "s"},
        "position": {"columns": "1-6", "unit": "rad"},
        "velocity": {"columns": list("abcdef"), "unit": "rad/s"},
        "current": {"column": "i_{joint}_{index}", "unit": "A"},
    }
    joints = with_joint(index=5)
    robot = load_robot(write(tmp_path, document(signals=signals, joints=joints)))
    own = [joint.experiment.signals for joint in robot.joints]
    assert [(s.position and s.position.column) for s in own] == [1, 2, 6, 4, 5, 6]
    assert [(s.velocity and s.velocity.column) for s in own] == ["a", "b", "f", "d", "e", "f"]
    assert own[2].current is not None
    assert own[2].current.column == "i_elbow_5"
    assert {s.time and s.time.column for s in own} == {"t"}
    matrix = {**signals, "position": {"column": "q", "unit": "rad"}}
    robot = load_robot(write(tmp_path, document(signals=matrix, joints=joints)))
    places = [joint.experiment.signals.position for joint in robot.joints]
    assert [position and position.index for position in places] == [0, 1, 5, 3, 4, 5]
    # what is planned stays within the URDF's limits, unless the joint has its own
    joints = with_joint(plan={"velocity": "1 rad/s"})
    robot = load_robot(write(tmp_path, document(joints=joints)))
    plans = {joint.experiment.joint.name: joint.experiment.plan for joint in robot.joints}
    assert plans["turret"].position == (-2.9, 2.9)
    assert (plans["turret"].velocity, plans["turret"].torque) == (2.5, 60.0)
    assert (plans["elbow"].velocity, plans["elbow"].torque) == (1.0, 35.0)
    # a joint's own keys replace those beside joints, part by part where they have parts
    joints = with_joint(fit={"decimation": 3}, motor={"resistance": "2 ohm"}, inertia="0.2 kg*m**2")
    robot = load_robot(write(tmp_path, document(joints=joints)))
    elbow, turret = (pick(robot, name).experiment for name in ("elbow", "turret"))
    assert (elbow.fit.decimation, elbow.fit.position_cutoff) == (3, 20.0)
    assert elbow.motor is not None
    assert (elbow.motor.k_t, elbow.motor.R) == (8.4, 2.0)
    assert (turret.fit.decimation, turret.inertia) == (6, None)
    # a run that names a joint is fitted for it alone; the others move in it too, each by its own columns
    only = {
        **TRACKING,
        "files": "other.npz",
        "joint": "elbow",
        "signals": {"position": {"columns": list("uvwxyz"), "unit": "rad"}},
    }
    robot = load_robot(write(tmp_path, document(runs=[TRACKING, only])))
    assert {j.experiment.joint.name: len(j.experiment.runs) for j in robot.joints} == {
        name: 2 if name == "elbow" else 1 for name in NAMES
    }
    others = [joint.everywhere.signals_of(joint.everywhere.runs[1]).position for joint in robot.joints]
    assert [s and s.column for s in others] == list("uvwxyz")
    # where each joint stood in a run of another one is read; those that are not identified need no run of their own
    t = np.linspace(0.0, 2.0, 201)
    q = np.column_stack([0.2 * k + (0.3 * np.sin(3 * t) if k == 2 else 0.0 * t) for k in range(6)])
    joints = [{**own, "identify": own["name"] == "elbow"} for own in document()["joints"]]
    keys = document(runs=[{**TRACKING, "joint": "elbow"}], joints=joints)
    robot = load_robot(write(tmp_path, keys, ArmLog(t, q, 0 * q)))
    (motion,) = read_motions(robot, reader_of(robot)).values()
    assert motion.file == "log.npz"
    assert set(motion.moving) == {"elbow"}
    assert motion.resting == pytest.approx({name: 0.2 * k for k, name in enumerate(NAMES) if name != "elbow"})
    at, v, _ = motion.at(t[50:60], NAMES)
    assert at[:, [0, 1, 3, 4, 5]] == pytest.approx(q[50:60][:, [0, 1, 3, 4, 5]])
    assert v[:, 2] == pytest.approx(0.9 * np.cos(3 * t[50:60]), rel=0.01)

    # with the file, the key, what was got, and what to do, on one line
    def load(changed: dict[str, Any]) -> Robot:
        return load_robot(write(tmp_path, document(**changed)))

    assert_refused(((partial(load, changed), told) for changed, told in BAD.values()), str(tmp_path))


OF_ARM = {"urdf": "arm.urdf"}
LOAD = {"mass": "1 kg", "link": "tool"}
TORQUE = {
    **{key: x for key, x in SIGNALS.items() if key != "current"},
    "torque": {"column": "i_{joint}", "unit": "N*m"},
}
BAD: dict[str, tuple[dict[str, Any], str]] = {
    "joints no list": ({"joints": {"elbow": 1}}, r"joints: got \{'elbow': 1\}; expected a list"),
    "named twice": ({"joints": with_joint(name="turret")}, "joints: 'turret' is named twice"),
    "no name": ({"joints": [{"index": 1}]}, "joints.0: name: missing"),
    "none of the URDF": ({"joints": with_joint(name="knee")}, r"joints\.2: name: joint 'knee' is none of arm\.urdf"),
    "control character": ({"robot": None, "joints": with_joint(name="a\x07b")}, r"holds U\+0007"),
    "none identified": ({"joints": [{**x, "identify": False} for x in with_joint()]}, "joints: each has identify: false"),
    "negative index": ({"joints": with_joint(index=-1)}, r"joints\.2: index: got -1"),
    "unknown key of a joint": ({"joints": with_joint(colour="red")}, r"joints\.2: unknown key 'colour'"),
    "joint beside joints": ({"joint": {"name": "elbow"}}, "got joint beside joints"),
    "kind against the URDF": ({"joints": with_joint(kind="prismatic")}, r"kind: got 'prismatic'; arm\.urdf has elbow revolute"),
    "robot no keys": ({"robot": "arm.urdf"}, "robot: got 'arm.urdf'"),
    "no such URDF": ({"robot": {"urdf": "none.urdf"}}, r"none\.urdf: no such file"),
    "gravity nan": ({"robot": {**OF_ARM, "gravity": [0, 0, float("nan")]}}, r"robot: gravity\.2: got nan"),
    "gravity of a star": ({"robot": {**OF_ARM, "gravity": [0, 0, 1e9]}}, r"robot: gravity\.2: got 1000000000"),
    "negative payload": ({"robot": {**OF_ARM, "payload": {**LOAD, "mass": "-1 kg"}}}, r"robot: payload\.mass: got '-1 kg'"),
    "payload without unit": ({"robot": {**OF_ARM, "payload": {**LOAD, "mass": 1}}}, r"robot: payload\.mass: got 1;"),
    "columns too few": (
        {"signals": {**SIGNALS, "position": {"columns": ["a", "b"], "unit": "rad"}}},
        r"joints\.2: signals\.position\.columns: got 2; expected one for each joint, at least 3",
    ),
    "columns backwards": (
        {"signals": {**SIGNALS, "position": {"columns": "6-1", "unit": "rad"}}},
        r"signals\.position\.columns: got '6-1'; expected a range",
    ),
    "column and columns": (
        {"signals": {**SIGNALS, "position": {"column": 1, "columns": "1-6", "unit": "rad"}}},
        r"signals\.position: got column beside columns",
    ),
    "free without URDF": ({"robot": None, "joints": with_joint(torque_constant="free")}, r"free needs robot\.urdf"),
    "free without current": ({"signals": TORQUE, "joints": with_joint(torque_constant="free")}, "free needs a current"),
    "constant without unit": ({"joints": with_joint(torque_constant=3.0)}, r"joints\.2: torque_constant: got 3\.0"),
    "run of no joint": ({"runs": [{**TRACKING, "joint": "knee"}]}, r"runs\.0: joint: got 'knee'; expected one of turret"),
    "no run of a joint": ({"runs": [{**TRACKING, "joint": "elbow"}]}, r"joints\.0: each of the runs is of another joint"),
}  # fmt: skip  # a table


GOOD = ARM.read_text(encoding="utf-8")
LIMIT = '<limit lower="-1.5" upper="2" velocity="3" effort="40"/>'


def written(folder: Path, content: str | bytes) -> Path:
    """A URDF file."""
    path = folder / "robot.urdf"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def test_limits_meshes_and_hostile_files(tmp_path: Path) -> None:
    """A pipe that is named as a mesh would block a reader for ever; its name does not reach the text that goes on."""
    pipe = tmp_path / "shape.stl"
    os.mkfifo(pipe)
    shape = f'<visual><geometry><mesh filename="{pipe}"/></geometry></visual><collision><geometry><mesh filename="file:///etc/passwd"/></geometry></collision>'
    urdf = read_urdf(written(tmp_path, GOOD.replace('<link name="base"/>', f'<link name="base">{shape}</link>')))
    assert "mesh" not in urdf.text
    assert [j.name for j in urdf.joints] == [j.name for j in read_urdf(ARM).joints]
    # each with the file's name, what is wrong, and on one short line; so are a folder, a pipe and nothing at all
    asks = []
    for name, (content, told) in HOSTILE.items():
        (tmp_path / f"{name}.urdf").write_bytes(content if isinstance(content, bytes) else content.encode())
        says = rf"^{re.escape(str(tmp_path))}(?=.{{1,399}}$)/{re.escape(name)}\.urdf.*{told}"
        asks.append((partial(read_urdf, tmp_path / f"{name}.urdf"), says))
    os.mkfifo(tmp_path / "pipe")
    asks += [
        (partial(read_urdf, path), f"^{re.escape(str(path))}")
        for path in (tmp_path, tmp_path / "pipe", tmp_path / "none.urdf")
    ]
    assert_refused(asks)
    # 100 000 elements nested in each other, inside a link, leave the text that goes on as it is
    deep = "<a>" * 100_000 + "</a>" * 100_000
    junk = read_urdf(written(tmp_path, GOOD.replace('<link name="base"/>', f'<link name="base">{deep}</link>')))
    assert junk.text == read_urdf(ARM).text
    # a joint has the limits that its URDF gives; without any, or without end, it has none
    (joint,) = read_urdf(written(tmp_path, pendulum(LIMIT))).joints
    assert (joint.name, joint.kind) == ("swing", "revolute")
    assert (joint.lower, joint.upper, joint.velocity, joint.effort) == (-1.5, 2.0, 3.0, 40.0)
    for text in (pendulum(), pendulum(LIMIT, kind="continuous").replace('velocity="3" effort="40"', "")):
        (free,) = read_urdf(written(tmp_path, text)).joints
        assert (free.kind, free.lower, free.upper, free.velocity) == ("revolute", -math.inf, math.inf, math.inf)


def many(count: int) -> str:
    """That many joints, of seven million bytes where they are 100 000."""
    joints = "".join(f'<joint name="{k}"><parent link="a"/><child link="b"/></joint>' for k in range(count))
    return f'<robot><link name="a"/><link name="b"/>{joints}</robot>'


HOSTILE: dict[str, tuple[str | bytes, str]] = {
    "entities": ('<!DOCTYPE x [<!ENTITY a "aaaa">]><robot name="&a;"/>', "declares a document type or entities"),
    "hidden entities": (f'<robot><!ENTITY lol "x">{GOOD}</robot>', "declares a document type or entities"),
    "100000 joints": (many(100_000), rf"holds 100000 joints; expected at most {MAX_JOINTS}"),
    "nan": (GOOD.replace('value="0.4"', 'value="nan"'), "tool: value: got 'nan'; expected a number"),
    "infinite": (GOOD.replace('xyz="0 0 0.26"', 'xyz="0 0 inf"'), "expected a number of at most"),
    "negative mass": (GOOD.replace('value="0.4"', 'value="-1"'), "the mass is -1"),
    "no axis": (GOOD.replace('axis xyz="0 1 0"', 'axis xyz="0 0 0"'), "its axis has no direction"),
    "cycle": (GOOD.replace('<parent link="base"/>', '<parent link="tool"/>'), "make no single tree"),
    "two parents": (GOOD.replace('<child link="tool"/>', '<child link="hand"/>'), "is the child of two joints"),
    "missing link": (GOOD.replace('<child link="tool"/>', '<child link="claw"/>'), "names the link 'claw'"),
    "same name": (GOOD.replace('"wrist_roll"', '"elbow"'), "2 <joint> elements are named 'elbow'"),
    "no name": (GOOD.replace('joint name="elbow"', "joint"), "a <joint> has no name"),
    "control character": (GOOD.replace('"elbow"', '"el&#27;[31mbow"'), "is not XML"),
    "line break": (GOOD.replace('"elbow"', '"el&#10;bow"'), r"holds U\+000A, a control character"),
    "right to left": (GOOD.replace('"elbow"', '"el\u202ebow"'), r"holds U\+202E, a control character"),
    "floating": (GOOD.replace('name="elbow" type="revolute"', 'name="elbow" type="floating"'), "of type 'floating'"),
    "xacro": (
        '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:include filename="a.xacro"/></robot>',
        "holds 0 links and 0 joints; run xacro on it first",
    ),
    "xacro's number": (GOOD.replace('value="0.4"', 'value="${mass}"'), "run xacro on it first"),
    "deep": ("<robot>" + "<a>" * 100_000 + "</a>" * 100_000 + "</robot>", "holds 0 links and 0 joints"),
    "UTF-16": (GOOD.encode("utf-16"), "is not text in UTF-8"),
    "another root": ("<html><body/></html>", "begins with <html>"),
    "large": (b" " * (MAX_BYTES + 1), "is larger than"),
}


SMALL = f'<robot name="two"><link name="a"/><link name="b">{inertial(1.0, "0 0 0.2", 0.1)}</link><link name="c">{inertial(0.5)}</link><joint name="one" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0 0 0.1" rpy="0 0 0"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" velocity="2" effort="3"/></joint><joint name="two" type="prismatic"><parent link="b"/><child link="c"/><axis xyz="0 0 1"/></joint></robot>'  # noqa: E501  # one line, of which bytes change
"""A URDF in which most bytes mean something."""
changes = st.lists(
    st.tuples(
        st.integers(0, len(SMALL)),
        st.integers(0, 3),
        st.binary(max_size=3) | st.sampled_from([b"-", b"9", b"e9", b'"']),
    ),
    min_size=1,
    max_size=3,
)


@settings(max_examples=400, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(edits=changes)
def test_changed_bytes_give_a_robot_or_a_sentence(tmp_path: Path, edits: list[tuple[int, int, bytes]]) -> None:
    """Whatever becomes of a good URDF: finite torques, or an InputError, and the interpreter lives."""
    content = SMALL.encode()
    for at, dropped, inserted in edits:
        content = content[:at] + inserted + content[at + dropped :]
    try:
        urdf = read_urdf(written(tmp_path, content))
        if find_spec("pinocchio") is None:
            return
        names = [joint.name for joint in urdf.joints]
        body = rigid_body(urdf, names, (0.0, 0.0, -9.81), None)
    except InputError as error:
        assert len(str(error).splitlines()) == 1  # noqa: PT017  # either is right
        return
    assert np.isfinite(body.torques(*np.full((3, 2, len(names)), 0.1))).all()
