import importlib.util
import re
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import bristle
import simulated_arm as arm
from bristle.data.robot.robot_file import Robot
from bristle.findings import Severity
from bristle.identification.identify import identify_joint
from bristle.identification.known_joint import chosen
from bristle.identification.robot.measured import against_urdf, measure_robot
from simulated_arm import ArmLog, simulate_arm

from ..bags import START, state, write_bag
from ..conftest import present
from ..data.experiments import assert_refused
from .arms import NAMES, NO_PINOCCHIO, SIGNALS, document, load_robot, write

pytest.importorskip("pinocchio", reason=NO_PINOCCHIO)
SEED = 7
PLAIN = {"fit": {"position_cutoff": "20 Hz", "decimation": 6, "law": "coulomb-viscous"}}
"""Without a Stribeck term, which takes most of the time and which these tests do not ask for."""


@pytest.fixture(scope="module")
def log() -> ArmLog:
    return simulate_arm(SEED, held_out=True)


def robot_of(folder: Path, log: ArmLog, *replaced: tuple[str, Any], **changed: Any) -> Robot:
    """The arm with its log, some keys of its file changed, and and what matches some patterns in its URDF."""
    path = write(folder, document(**{**PLAIN, **changed}), log)
    urdf = folder / "arm.urdf"
    text = urdf.read_text(encoding="utf-8")
    for pattern, new in replaced:
        text = re.sub(pattern, new, text)
    urdf.write_text(text, encoding="utf-8")
    return load_robot(path)


def codes(robot: Robot) -> dict[str, set[str]]:
    """By joint, what the log says against the URDF."""
    return {name: {w.code for w in found} for name, found in against_urdf(robot).items()}


def only(name: str, **own: Any) -> list[dict[str, Any]]:
    return [{**x, **(own if x["name"] == name else {"identify": False})} for x in document()["joints"]]


def in_order(names: tuple[str, ...]) -> dict[str, Any]:
    """Signals whose columns stand in the order of some names."""
    return {
        **SIGNALS,
        "position": {"columns": [f"q_{name}" for name in names], "unit": "rad"},
        "current": {"columns": [f"i_{name}" for name in names], "unit": "A"},
    }


def known(name: str) -> arm.ArmJoint:
    """What the arm was simulated with."""
    return next(joint for joint in arm.JOINTS if joint.name == name)


def test_orders_gravity_constants_and_masses(tmp_path: Path, log: ArmLog) -> None:
    """Nothing is said of order, gravity, limits or scale where all is as declared; what the links have to be accelerated with is known."""
    found = measure_robot(robot_of(tmp_path, log))
    assert [m.experiment.joint.name for m in found] == list(NAMES)
    assert all(m.findings == () for m in found)
    inertia = {m.experiment.joint.name: m.link_inertia or 0.0 for m in found}
    assert inertia["shoulder"] > inertia["elbow"] > inertia["wrist_pitch"] > inertia["flange"] > 0
    # a wrong order of columns, and gravity upside down, are said of every joint, with what would be right
    swapped = in_order((NAMES[0], NAMES[2], NAMES[1], *NAMES[3:]))
    pair = {"shoulder takes the columns of elbow", "elbow takes the columns of shoulder"}
    currents = {"shoulder takes the torque or current of elbow", "elbow takes the torque or current of shoulder"}
    cases: list[tuple[dict[str, Any], str, Any]] = [
        ({"signals": in_order(NAMES[::-1])}, "joint-order", None),
        ({"signals": swapped}, "joint-order", pair),
        ({"signals": {**SIGNALS, "current": swapped["current"]}}, "joint-order", currents),
        ({"robot": {"urdf": "arm.urdf", "gravity": [0, 0, 9.81]}}, "gravity-direction", (0.0, 0.0, -9.81)),
    ]
    for changed, code, right in cases:
        for found in against_urdf(robot_of(tmp_path, log, **changed)).values():
            (warning,) = (w for w in found if w.code in {"joint-order", "gravity-direction"})
            assert (warning.code, warning.severity) == (code, Severity.CRITICAL)
            if code == "gravity-direction":
                assert warning.numbers["better"] == right
            else:
                assert right is None or set(warning.numbers["swaps"]) == right
    # it lies in its own interval, which is narrower than 1 %, and the torque is the current times it
    joints = only("elbow", torque_constant="free")
    (elbow,) = measure_robot(robot_of(tmp_path, log, joints=joints, fit=document()["fit"]))
    constant, true = elbow.torque_constant, known("elbow").torque_constant
    assert constant is not None
    assert constant.interval is not None
    assert constant.interval[0] <= true <= constant.interval[1]
    assert constant.interval[1] - constant.interval[0] < 0.01 * true
    torque = present(elbow.runs[0].record.torque)
    assert torque == pytest.approx(log.current[:, 2] * (constant.value or 0.0))
    assert list(elbow.runs[0].record.torque_shifts)
    # with every mass a fifth too small, the shoulder with its known constant says so
    lighter = (r'mass value="([0-9.]+)"', lambda mass: f'mass value="{0.8 * float(mass[1])}"')
    (said,) = (w for w in against_urdf(robot_of(tmp_path, log, lighter))["shoulder"] if w.code == "links-scale")
    assert said.numbers["scale"] == pytest.approx(1.25, rel=0.1)


def test_links_that_weigh_nothing_tell_no_constant(tmp_path: Path, log: ArmLog) -> None:
    """Then the constant is not identifiable, and friction is a number of amperes."""
    joints = only("flange", torque_constant="free")
    (flange,) = measure_robot(robot_of(tmp_path, log, (r'mass value="0\.4"', 'mass value="1e-6"'), joints=joints))
    assert present(flange.torque_constant).value is None
    assert [w.code for w in flange.findings] == ["constant-unseen"]
    joint = identify_joint(flange)
    assert joint.kind == "revolute in A"
    estimate = joint.static["+"].parameters["alpha_0"]
    assert estimate.unit == "A"
    assert estimate.value == pytest.approx(known("flange").friction.positive.alpha_0 / 4.2, rel=0.2)
    # a critical warning says so of each joint that bears others, with how much of its torque it may be
    found = {m.experiment.joint.name: m.findings for m in measure_robot(robot_of(tmp_path, log, robot=None))}
    for name in ("shoulder", "elbow", "wrist_pitch"):
        (warning,) = found[name]
        assert (warning.code, warning.severity) == ("links-not-removed", Severity.CRITICAL)
    assert found["shoulder"][0].numbers["share"] > 20
    # positions beyond a joint's limits, and links of another mass, are named for the joints that show them. A torque within the effort of
    # the URDF is not mentioned, one of twice it is a caution, and one far beyond, as of mA read as A, critical
    limits, mass = ('lower="-2.6" upper="2.6"', 'lower="-0.2" upper="0.5"'), ('mass value="2.3"', 'mass value="5.3"')
    found = codes(robot_of(tmp_path, log, limits, mass))
    assert {"beyond-urdf", "links-scale"} <= found["elbow"]
    assert "beyond-urdf" not in found["shoulder"]
    assert "effort-far-beyond" not in found["elbow"]
    (far,) = against_urdf(robot_of(tmp_path, log, ('effort="35"', 'effort="1e-3"'), joints=only("elbow")))["elbow"]
    assert (far.code, far.severity) == ("effort-far-beyond", Severity.CRITICAL)
    half = f'effort="{max(-far.numbers["low"], far.numbers["high"]) / 2!r}"'
    assert codes(robot_of(tmp_path, log, ('effort="35"', half), joints=only("elbow"))) == {"elbow": {"beyond-urdf"}}


FOLDER = arm.FOLDER
LARGEST = 1_500_000  # bytes of all files together


def test_friction_of_every_joint_is_found() -> None:
    """Coulomb and viscous friction of all joints, both directions: within 3 errors of the truth, and these below 5 %."""
    # the Stribeck term is right or not identifiable; free torque constants are found; nothing critical is said
    results = bristle.identify(FOLDER / "robot.yaml")
    assert tuple(joint.name for joint in results.joints) == NAMES
    inside, asked = 0, 0
    for joint, known in zip(results.joints, arm.JOINTS, strict=True):
        truths = dict(zip("+-", known.friction, strict=True))
        for row in chosen(joint):
            name, direction = row.parameter
            e = row.estimate
            if name not in ("alpha_0", "alpha_1", "alpha_2", "v_s"):
                continue
            truth = getattr(truths[str(direction)], name)
            if e.value is None:
                assert name in ("alpha_1", "v_s")
                continue
            assert e.interval is not None
            error = np.hypot(e.standard_error or 0.0, e.systematic or 0.0)
            assert abs(e.value - truth) <= 3 * error, (joint.name, row.parameter)
            if name in ("alpha_0", "alpha_2"):
                assert error <= 0.05 * truth
                assert abs(e.value - truth) <= 0.05 * truth
                inside, asked = inside + (e.interval[0] <= truth <= e.interval[1]), asked + 1
        assert [held.relative_error < 1.5 for held in present(joint.moving).hold_out] == [True]
        constant = joint.torque_constant
        assert (constant is not None) == known.free
        if constant is not None:
            assert constant.value == pytest.approx(known.torque_constant, abs=3 * (constant.standard_error or 0.0))
            assert constant.value == pytest.approx(known.torque_constant, rel=0.01)
    assert asked == 24
    assert inside >= 20
    about_robots = {"joint-order", "gravity-direction", "links-scale", "links-oppose", "beyond-urdf"}
    assert not [w for w in results.warnings if w.severity is Severity.CRITICAL or w.code in about_robots]


def test_files_and_drafts_of_the_embedded_arm(tmp_path: Path) -> None:
    """The robot's file is what make.py writes, the logs are as long as the motion and within the URDF's limits, and all is small."""
    spec = present(importlib.util.spec_from_file_location("make_arm", FOLDER / "make.py"))
    make = importlib.util.module_from_spec(spec)
    present(spec.loader).exec_module(make)
    assert make.robot() == (FOLDER / "robot.yaml").read_text(encoding="utf-8")
    log = arm.simulate_arm(0, held_out=True)
    table = np.loadtxt(FOLDER / "held_out.csv", delimiter=",", skiprows=1)
    assert table == pytest.approx(np.column_stack([log.time, log.position, log.current]), abs=1e-4)
    assert sum(path.stat().st_size for path in FOLDER.iterdir() if path.is_file()) < LARGEST
    # the arm's URDF and two logs give a file that loads: every joint, columns by its name, the last log held out
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
    # columns q0 ... q5 are the joints' in the order of the URDF; for a torque no constant is asked
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


LOGS = (FOLDER / "arm.urdf", FOLDER / "motion.csv", FOLDER / "held_out.csv")


def test_drafts_name_what_a_log_has_and_what_is_swapped(tmp_path: Path) -> None:
    """Where the columns of two joints are exchanged the draft says so, before anything is identified."""
    frame = pd.read_csv(LOGS[2])
    swap = {"shoulder": "elbow", "elbow": "shoulder"}
    names = {f"{s}_{a}": f"{s}_{b}" for a, b in swap.items() for s in "qi"}
    log = tmp_path / "log.csv"
    frame.rename(columns=names).to_csv(log, index=False)
    _, said = bristle.draft(LOGS[0], log, folder=tmp_path)
    assert any("shoulder takes the columns of elbow" in sentence for sentence in said)
    # in one sentence that says what to add
    log = tmp_path / "log.csv"
    log.write_text("a,b\n1,1\n2,2\n3,3\n")
    of_nothing = (partial(bristle.draft, LOGS[0], folder=tmp_path), "got a URDF alone")
    told = "no columns of torque, current or voltage are unmistakable"
    assert_refused([of_nothing, (partial(bristle.draft, LOGS[0], log, folder=tmp_path), told)])
    # of joint states without velocities the draft names position and effort, and not what the bag has not
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
