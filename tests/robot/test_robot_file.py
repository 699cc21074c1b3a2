"""The file of a robot: what each key means to each joint, and one sentence for each bad one."""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bristle.data.robot.motion import read_motions, reader_of
from bristle.data.robot.robot_file import Robot, pick
from simulated_arm import ArmLog

from ..data.experiments import assert_refused
from .arms import NAMES, SIGNALS, document, load_robot, write

TRACKING = {"files": "log.npz", "experiment": "tracking"}


def with_joint(place: int = 2, **changed: Any) -> list[dict[str, Any]]:
    """The joints of the whole arm, one of them changed."""
    return [{**own, **(changed if k == place else {})} for k, own in enumerate(document()["joints"])]


def test_each_joint_has_its_own_columns(tmp_path: Path) -> None:
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


def test_limits_come_from_the_urdf(tmp_path: Path) -> None:
    """What is planned stays within the URDF's limits, unless the joint has its own."""
    joints = with_joint(plan={"velocity": "1 rad/s"})
    robot = load_robot(write(tmp_path, document(joints=joints)))
    plans = {joint.experiment.joint.name: joint.experiment.plan for joint in robot.joints}
    assert plans["turret"].position == (-2.9, 2.9)
    assert (plans["turret"].velocity, plans["turret"].torque) == (2.5, 60.0)
    assert (plans["elbow"].velocity, plans["elbow"].torque) == (1.0, 35.0)


def test_what_a_joint_says_holds_for_it_alone(tmp_path: Path) -> None:
    """A joint's own keys replace those beside joints, part by part where they have parts."""
    joints = with_joint(fit={"decimation": 3}, motor={"resistance": "2 ohm"}, inertia="0.2 kg*m**2")
    robot = load_robot(write(tmp_path, document(joints=joints)))
    elbow, turret = (pick(robot, name).experiment for name in ("elbow", "turret"))
    assert (elbow.fit.decimation, elbow.fit.position_cutoff) == (3, 20.0)
    assert elbow.motor is not None
    assert (elbow.motor.k_t, elbow.motor.R) == (8.4, 2.0)
    assert (turret.fit.decimation, turret.inertia) == (6, None)


def test_a_run_may_be_of_one_joint(tmp_path: Path) -> None:
    """A run that names a joint is fitted for it alone; the others move in it too, each by its own columns."""
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


def test_a_run_of_one_joint_moves_all(tmp_path: Path) -> None:
    """Where each joint stood in a run of another one is read; those that are not identified need no run of their own."""
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


ARM = {"urdf": "arm.urdf"}
LOAD = {"mass": "1 kg", "link": "tool"}
TORQUE = {
    **{key: x for key, x in SIGNALS.items() if key != "current"},
    "torque": {"column": "i_{joint}", "unit": "N*m"},
}
BAD: dict[str, tuple[dict[str, Any], str]] = {
    "joints no list": ({"joints": {"elbow": 1}}, r"joints: got \{'elbow': 1\}; expected a list"),
    "no joints": ({"joints": None}, "joints: got None"),
    "joints empty": ({"joints": []}, r"joints: got \[\]"),
    "names alone": ({"joints": ["elbow"]}, "joints: got"),
    "named twice": ({"joints": with_joint(name="turret")}, "joints: 'turret' is named twice"),
    "no name": ({"joints": [{"index": 1}]}, "joints.0: name: missing"),
    "none of the URDF": ({"joints": with_joint(name="knee")}, r"joints\.2: name: joint 'knee' is none of arm\.urdf"),
    "control character": ({"robot": None, "joints": with_joint(name="a\x07b")}, r"holds U\+0007"),
    "none identified": ({"joints": [{**x, "identify": False} for x in with_joint()]}, "joints: each has identify: false"),
    "identify no boolean": ({"joints": with_joint(identify="no")}, r"joints\.2: identify: got 'no'"),
    "negative index": ({"joints": with_joint(index=-1)}, r"joints\.2: index: got -1"),
    "index no number": ({"joints": with_joint(index="2")}, r"joints\.2: index: got '2'"),
    "unknown key of a joint": ({"joints": with_joint(colour="red")}, r"joints\.2: unknown key 'colour'"),
    "unknown key of the robot": ({"robot": {**ARM, "mass": 1}}, "robot: unknown key 'mass'"),
    "unknown key": ({"colour": 1}, "unknown key 'colour'"),
    "joint beside joints": ({"joint": {"name": "elbow"}}, "got joint beside joints"),
    "kind against the URDF": ({"joints": with_joint(kind="prismatic")}, r"kind: got 'prismatic'; arm\.urdf has elbow revolute"),
    "robot no keys": ({"robot": "arm.urdf"}, "robot: got 'arm.urdf'"),
    "robot without URDF": ({"robot": {"gravity": [0, 0, 1]}}, "robot: urdf: missing"),
    "no such URDF": ({"robot": {"urdf": "none.urdf"}}, r"none\.urdf: no such file"),
    "gravity of two": ({"robot": {**ARM, "gravity": [0, 0]}}, r"robot: gravity\.2: missing"),
    "gravity nan": ({"robot": {**ARM, "gravity": [0, 0, float("nan")]}}, r"robot: gravity\.2: got nan"),
    "gravity in words": ({"robot": {**ARM, "gravity": "down"}}, "robot: gravity: got 'down'"),
    "gravity of a star": ({"robot": {**ARM, "gravity": [0, 0, 1e9]}}, r"robot: gravity\.2: got 1000000000"),
    "negative payload": ({"robot": {**ARM, "payload": {**LOAD, "mass": "-1 kg"}}}, r"robot: payload\.mass: got '-1 kg'"),
    "payload without unit": ({"robot": {**ARM, "payload": {**LOAD, "mass": 1}}}, r"robot: payload\.mass: got 1;"),
    "payload nowhere": ({"robot": {**ARM, "payload": {"mass": "1 kg"}}}, r"robot: payload\.link: missing"),
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
    "constant in words": ({"joints": with_joint(torque_constant="big")}, r"joints\.2: motor\.torque_constant: got 'big'"),
    "constant without unit": ({"joints": with_joint(torque_constant=3.0)}, r"joints\.2: torque_constant: got 3\.0"),
    "run of no joint": ({"runs": [{**TRACKING, "joint": "knee"}]}, r"runs\.0: joint: got 'knee'; expected one of turret"),
    "no run of a joint": ({"runs": [{**TRACKING, "joint": "elbow"}]}, r"joints\.0: each of the runs is of another joint"),
    "runs no list": ({"runs": "log.npz"}, "runs: got 'log.npz'"),
}  # fmt: skip  # a table


def test_every_bad_key_is_named_in_one_sentence(tmp_path: Path) -> None:
    """With the file, the key, what was got, and what to do, on one line."""

    def load(changed: dict[str, Any]) -> Robot:
        """The robot of a file with these keys changed."""
        return load_robot(write(tmp_path, document(**changed)))

    assert_refused(((partial(load, changed), told) for changed, told in BAD.values()), str(tmp_path))
