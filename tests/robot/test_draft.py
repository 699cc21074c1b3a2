"""The draft of a robot's file: from names of columns, from columns that are told, and what is refused."""

from functools import partial
from pathlib import Path

import pandas as pd
import pytest

import bristle
import simulated_arm as arm

from ..bags import START, state, write_bag
from ..data.experiments import assert_refused
from .arms import NAMES, NO_PINOCCHIO, load_robot

pytest.importorskip("pinocchio", reason=NO_PINOCCHIO)
FOLDER = arm.FOLDER
LOGS = (FOLDER / "arm.urdf", FOLDER / "motion.csv", FOLDER / "held_out.csv")


def test_names_of_columns_are_enough(tmp_path: Path) -> None:
    """Of the embedded arm the URDF and two logs give a file that loads: every joint, each column by the joint's name, the last log held out."""
    text, said = bristle.draft(*LOGS, folder=FOLDER)
    assert 'position: {column: "q_{joint}", unit: rad}' in text
    assert 'current: {column: "i_{joint}", unit: A}' in text
    path = tmp_path / "robot.yaml"
    path.write_text(text.replace('"arm.urdf"', f'"{(FOLDER / "arm.urdf").as_posix()}"'), encoding="utf-8")
    robot = load_robot(path)
    assert robot.names == NAMES
    assert all(joint.free for joint in robot.joints)
    assert [run.hold_out for run in robot.joints[0].experiment.runs] == [False, True]
    assert any("held out" in sentence for sentence in said)
    assert not any("critical" in sentence or "goes better" in sentence for sentence in said)


def test_an_empty_velocity_of_a_bag_is_left_out(tmp_path: Path) -> None:
    """Of joint states without velocities the draft names position and effort, and not what the bag has not."""
    pytest.importorskip("rosbags", reason="the extra `ros` is not installed")
    log = pd.read_csv(LOGS[2])
    position = log[[f"q_{name}" for name in NAMES]].to_numpy()
    current = log[[f"i_{name}" for name in NAMES]].to_numpy()
    states = [
        state(START + round(1e9 * t), NAMES, q.tolist(), [], i.tolist())
        for t, q, i in zip(log["time"], position, current, strict=True)
    ]
    bag = write_bag(tmp_path / "bag", "mcap", states[:400])  # too short for any number
    text, _ = bristle.draft(FOLDER / "arm.urdf", bag, folder=tmp_path)
    assert "effort" in text
    assert "velocity" not in text.split("runs:")[0].split("signals:")[1]


def test_numbered_columns_are_found(tmp_path: Path) -> None:
    """Columns q0 ... q5 beside one another are the joints' in the order of the URDF; a torque is no current, so that no constant is asked for."""
    frame = pd.read_csv(LOGS[2])
    numbered = {f"q_{name}": f"position[{k}]" for k, name in enumerate(NAMES)}
    numbered |= {f"i_{name}": f"effort[{k}]" for k, name in enumerate(NAMES)}
    log = tmp_path / "log.csv"
    frame.rename(columns=numbered).to_csv(log, index=False)
    text, said = bristle.draft(LOGS[0], log, told=bristle.Told(columns={"torque": "7-12"}), folder=tmp_path)
    assert "position: {columns: 1-6, unit: rad}" in text
    assert "torque: {columns: 7-12, unit: N*m}" in text
    assert "torque_constant" not in text
    assert any("times as large as the URDF has it" in sentence for sentence in said)  # amperes taken for N*m


def test_a_swapped_log_is_told_at_once(tmp_path: Path) -> None:
    """Where the columns of two joints are exchanged the draft says so, before anything is identified."""
    frame = pd.read_csv(LOGS[2])
    swap = {"shoulder": "elbow", "elbow": "shoulder"}
    names = {f"{s}_{a}": f"{s}_{b}" for a, b in swap.items() for s in "qi"}
    log = tmp_path / "log.csv"
    frame.rename(columns=names).to_csv(log, index=False)
    _, said = bristle.draft(LOGS[0], log, folder=tmp_path)
    assert any("shoulder takes the columns of elbow" in sentence for sentence in said)


def test_what_cannot_be_drafted_is_refused(tmp_path: Path) -> None:
    """In one sentence that says what to add."""
    log = tmp_path / "log.csv"
    log.write_text("a,b\n1,1\n2,2\n3,3\n")
    of_nothing = (partial(bristle.draft, LOGS[0], folder=tmp_path), "got a URDF alone")
    told = "no columns of torque, current or voltage are unmistakable"
    assert_refused([of_nothing, (partial(bristle.draft, LOGS[0], log, folder=tmp_path), told)])
