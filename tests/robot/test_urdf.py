"""URDFs: what is read of a good one, and that of a bad one nothing but a sentence comes."""

import math
import os
import re
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bristle.data.robot.motion import rigid_body
from bristle.data.robot.urdf import MAX_BYTES, MAX_JOINTS, read_urdf
from bristle.errors import InputError

from ..data.experiments import assert_refused
from .arms import ARM, inertial, pendulum

GOOD = ARM.read_text(encoding="utf-8")
LIMIT = '<limit lower="-1.5" upper="2" velocity="3" effort="40"/>'


def written(folder: Path, content: str | bytes) -> Path:
    """A URDF file."""
    path = folder / "robot.urdf"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def test_limits_are_read(tmp_path: Path) -> None:
    """A joint has the limits that its URDF gives; without any, or without end, it has none."""
    (joint,) = read_urdf(written(tmp_path, pendulum(LIMIT))).joints
    assert (joint.name, joint.kind) == ("swing", "revolute")
    assert (joint.lower, joint.upper, joint.velocity, joint.effort) == (-1.5, 2.0, 3.0, 40.0)
    for text in (pendulum(), pendulum(LIMIT, kind="continuous").replace('velocity="3" effort="40"', "")):
        (free,) = read_urdf(written(tmp_path, text)).joints
        assert (free.kind, free.lower, free.upper, free.velocity) == ("revolute", -math.inf, math.inf, math.inf)


def test_meshes_are_never_opened(tmp_path: Path) -> None:
    """A pipe that is named as a mesh would block a reader for ever; its name does not reach the text that goes on."""
    pipe = tmp_path / "shape.stl"
    os.mkfifo(pipe)
    shape = f'<visual><geometry><mesh filename="{pipe}"/></geometry></visual><collision><geometry><mesh filename="file:///etc/passwd"/></geometry></collision>'
    urdf = read_urdf(written(tmp_path, GOOD.replace('<link name="base"/>', f'<link name="base">{shape}</link>')))
    assert "mesh" not in urdf.text
    assert [j.name for j in urdf.joints] == [j.name for j in read_urdf(ARM).joints]


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
    "no number": (GOOD.replace('value="0.4"', 'value="heavy"'), "got 'heavy'"),
    "two numbers": (GOOD.replace('xyz="0 0 0.26"', 'xyz="0 0"'), "expected three numbers"),
    "no axis": (GOOD.replace('axis xyz="0 1 0"', 'axis xyz="0 0 0"'), "its axis has no direction"),
    "cycle": (GOOD.replace('<parent link="base"/>', '<parent link="tool"/>'), "make no single tree"),
    "two parents": (GOOD.replace('<child link="tool"/>', '<child link="hand"/>'), "is the child of two joints"),
    "missing link": (GOOD.replace('<child link="tool"/>', '<child link="claw"/>'), "names the link 'claw'"),
    "no child": (GOOD.replace('<child link="tool"/>', ""), "names the link ''"),
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
    "unfinished": ("<robot>" + "<a>" * 100_000, "is not XML"),
    "UTF-16": (GOOD.encode("utf-16"), "is not text in UTF-8"),
    "empty": ("", "is not XML"),
    "another root": ("<html><body/></html>", "begins with <html>"),
    "binary": (bytes(range(256)) * 40, "is not text in UTF-8"),
    "zeros": (b"\0" * 1000, "is not XML"),
    "large": (b" " * (MAX_BYTES + 1), "is larger than"),
}


def test_hostile_files_are_refused_in_one_sentence(tmp_path: Path) -> None:
    """Each with the file's name, what is wrong, and on one short line; so are a folder, a pipe and nothing at all."""
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


def test_junk_beside_the_joints_changes_nothing(tmp_path: Path) -> None:
    """100 000 elements nested in each other, inside a link, leave the text that goes on as it is."""
    deep = "<a>" * 100_000 + "</a>" * 100_000
    junk = read_urdf(written(tmp_path, GOOD.replace('<link name="base"/>', f'<link name="base">{deep}</link>')))
    assert junk.text == read_urdf(ARM).text


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


@settings(max_examples=400, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
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
