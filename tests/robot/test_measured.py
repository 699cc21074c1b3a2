"""What the joints of a robot tell together: the order of joints, gravity's direction, torque constants, links without a URDF."""

import re
from pathlib import Path
from typing import Any

import pytest

import simulated_arm as arm
from bristle.data.robot.robot_file import Robot
from bristle.findings import Severity
from bristle.identification.identify import identify_joint
from bristle.identification.robot.measured import against_urdf, measure_robot
from simulated_arm import ArmLog, simulate_arm

from .arms import NAMES, NO_PINOCCHIO, SIGNALS, document, load_robot, write

pytest.importorskip("pinocchio", reason=NO_PINOCCHIO)
SEED = 7
PLAIN = {"fit": {"position_cutoff": "20 Hz", "decimation": 6, "model": "coulomb-viscous"}}
"""Without a Stribeck term, which takes most of the time and which these tests do not ask for."""


@pytest.fixture(scope="module")
def log() -> ArmLog:
    """A short log of the arm, which no other test has seen."""
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
    """The joints of the arm, of which one is identified."""
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


def test_the_right_order_gives_no_warning(tmp_path: Path, log: ArmLog) -> None:
    """Nothing is said of order, gravity, limits or scale where all is as declared; what the links have to be accelerated with is known."""
    found = measure_robot(robot_of(tmp_path, log))
    assert [m.experiment.joint.name for m in found] == list(NAMES)
    assert all(m.findings == () for m in found)
    inertia = {m.experiment.joint.name: m.link_inertia or 0.0 for m in found}
    assert inertia["shoulder"] > inertia["elbow"] > inertia["wrist_pitch"] > inertia["flange"] > 0


def test_what_is_not_as_declared_is_critical(tmp_path: Path, log: ArmLog) -> None:
    """A wrong order of columns, and gravity upside down, are said of every joint, with what would be right."""
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


def test_a_free_torque_constant_is_found(tmp_path: Path, log: ArmLog) -> None:
    """It lies in its own interval, which is narrower than 1 %, and the torque is the current times it."""
    joints = only("elbow", torque_constant="free")
    (elbow,) = measure_robot(robot_of(tmp_path, log, joints=joints, fit=document()["fit"]))
    constant, true = elbow.torque_constant, known("elbow").torque_constant
    assert constant is not None
    assert constant.interval is not None
    assert constant.interval[0] <= true <= constant.interval[1]
    assert constant.interval[1] - constant.interval[0] < 0.01 * true
    torque = elbow.runs[0].record.torque
    assert torque is not None
    assert torque == pytest.approx(log.current[:, 2] * (constant.value or 0.0))
    assert list(elbow.runs[0].record.torque_shifts)


def test_masses_that_one_joint_doubts_are_doubted_where_a_constant_rests_on_them(tmp_path: Path, log: ArmLog) -> None:
    """With every mass a fifth too small, the shoulder with its known constant says so, and the elbow's free constant is cautioned."""
    free = [{**x, **({"torque_constant": "free"} if x["name"] == "elbow" else {})} for x in document()["joints"]]
    lighter = (r'mass value="([0-9.]+)"', lambda mass: f'mass value="{0.8 * float(mass[1])}"')
    found = {m.experiment.joint.name: m.findings for m in measure_robot(robot_of(tmp_path, log, lighter, joints=free))}
    assert "links-scale" in [w.code for w in found["shoulder"]]
    (doubt,) = (w for w in found["elbow"] if w.code == "constant-by-masses")
    assert doubt.numbers["scale"] == pytest.approx(1.25, rel=0.1)


def test_links_that_weigh_nothing_tell_no_constant(tmp_path: Path, log: ArmLog) -> None:
    """Then the constant is not identifiable, and friction is a number of amperes."""
    joints = only("flange", torque_constant="free")
    (flange,) = measure_robot(robot_of(tmp_path, log, (r'mass value="0\.4"', 'mass value="1e-6"'), joints=joints))
    assert flange.torque_constant is not None
    assert flange.torque_constant.value is None
    assert [w.code for w in flange.findings] == ["constant-unseen"]
    joint = identify_joint(flange)
    assert joint.kind == "revolute in A"
    estimate = joint.static["+"].parameters["alpha_0"]
    assert estimate.unit == "A"
    assert estimate.value == pytest.approx(known("flange").friction.positive.alpha_0 / 4.2, rel=0.2)


def test_without_a_urdf_the_links_stay(tmp_path: Path, log: ArmLog) -> None:
    """A critical warning says so of each joint that bears others, with how much of its torque it may be."""
    found = {m.experiment.joint.name: m.findings for m in measure_robot(robot_of(tmp_path, log, robot=None))}
    for name in ("shoulder", "elbow", "wrist_pitch"):
        (warning,) = found[name]
        assert (warning.code, warning.severity) == ("links-not-removed", Severity.CRITICAL)
    assert found["shoulder"][0].numbers["share"] > 20


def test_what_the_urdf_does_not_allow_is_said(tmp_path: Path, log: ArmLog) -> None:
    """Positions beyond a joint's limits, and links of another mass, are named for the joints that show them.

    A torque within the effort of the URDF is not mentioned, one of twice it is a caution, and one far beyond, as of mA read as A, critical.
    """
    limits, mass = ('lower="-2.6" upper="2.6"', 'lower="-0.2" upper="0.5"'), ('mass value="2.3"', 'mass value="5.3"')
    found = codes(robot_of(tmp_path, log, limits, mass))
    assert {"beyond-urdf", "links-scale"} <= found["elbow"]
    assert "beyond-urdf" not in found["shoulder"]
    assert not {"effort-beyond", "effort-far-beyond"} & found["elbow"]
    (far,) = against_urdf(robot_of(tmp_path, log, ('effort="35"', 'effort="1e-3"'), joints=only("elbow")))["elbow"]
    assert (far.code, far.severity) == ("effort-far-beyond", Severity.CRITICAL)
    half = f'effort="{far.numbers["most"] / 2!r}"'
    assert codes(robot_of(tmp_path, log, ('effort="35"', half), joints=only("elbow"))) == {"elbow": {"effort-beyond"}}
