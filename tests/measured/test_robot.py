"""UR10e, six joints moving together: torque constants free, one motion fitted, another held out."""

from collections.abc import Sequence
from pathlib import Path

import pytest

from bristle.data.robot.robot_file import Robot, robot_of
from bristle.findings import Severity
from bristle.identification.identify import identify_joint
from bristle.identification.robot.measured import against_urdf, measure_robot
from bristle.identification.static.fit import fit_moving

NAMES = ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint")
MOST = dict(zip(NAMES, (14, 10, 6, 15, 24, 16), strict=True))
"""Relative error of the held-out motion, percent, at the most."""
PUBLISHED = dict(zip(NAMES, (10.0, 10.70, 8.46, 9.00, 9.48, 10.12), strict=True))
"""Torque constants by those who recorded the data, N*m/A."""

pytest.importorskip("pinocchio", reason="Pinocchio is not installed (pip install 'bristle[robot]')")


def robot(folder: Path, order: Sequence[int] = range(6), up: float = -9.81) -> Robot:
    """The arm, the columns of each signal in an order, gravity along z, m/s**2."""
    ur10e = folder / "ur10e"

    def columns(first: int, unit: str) -> dict[str, object]:
        return {"columns": [first + k for k in order], "unit": unit}

    data: dict[str, object] = {
        "robot": {"urdf": str(ur10e / "ur10e.urdf"), "gravity": [0, 0, up]},
        "joints": [{"name": name, "torque_constant": "free"} for name in NAMES],
        "signals": {
            "time": {"column": 0, "unit": "s"},
            "position": columns(1, "rad"),
            "velocity": columns(7, "rad/s"),
            "current": columns(13, "A"),
        },
        "runs": [
            {"files": "trajectory_12_harmonics.csv", "experiment": "tracking"},
            {"files": "trajectory_8_harmonics.csv", "experiment": "tracking", "hold_out": True},
        ],
    }
    return robot_of(data, ur10e / "robot.yaml")


def test_six_joints_that_move_together(measured_data: Path) -> None:
    """The static law with the links' torque, fitted on 12 harmonics, predicts the motion of 8 harmonics within the error that is asked for."""
    # the constants of joints 1 to 4 are within 20 % of the published; those of 5 and 6 are not identifiable, and their
    # friction is in A. With the columns and gravity as they are no joint has a critical finding. Wrist 2, in A: beside
    # LuGre the links' torque is told, which the static law hides, and its fit, through a low pass that is widened, predicts the
    # other motion within 7 %; at 100 Hz sigma_1 is not identifiable, nor sigma_0 forwards, and say why; Coulomb friction
    # is. So it is of the elbow, and of both its bristles
    joints = {m.experiment.joint.name: m for m in measure_robot(robot(measured_data))}
    errors = {}
    for name, measured in joints.items():
        fits = fit_moving(measured.experiment, measured.moving(hold_out=False), measured.moving(hold_out=True))
        (errors[name],) = {h.relative_error for fit in fits.values() for h in fit.hold_out}
    assert errors.keys() == MOST.keys()
    assert not {name: error for name, error in errors.items() if error > MOST[name]}
    constants = {name: m.torque_constant for name, m in joints.items() if m.torque_constant}
    told_by = {name: constants[name].value for name in NAMES[:4]}
    assert told_by == pytest.approx({name: PUBLISHED[name] for name in NAMES[:4]}, rel=0.2)
    assert [constants[name].value for name in NAMES[4:]] == [None] * 2
    assert [[w.code for w in constants[name].warnings] for name in NAMES[4:]] == [["constant-unseen"]] * 2
    assert [joints[name].experiment.joint.kind for name in NAMES] == ["revolute"] * 4 + ["revolute in A"] * 2
    assert not [w for measured in joints.values() for w in measured.findings if w.severity is Severity.CRITICAL]
    wrist = identify_joint(joints["wrist_2_joint"])
    assert wrist.torque_constant == constants["wrist_2_joint"]
    assert wrist.tracking is not None
    told = {str(name): e for name, e in wrist.tracking.parameters.items()}
    assert told["links"].value is not None
    assert wrist.tracking.hold_out[0].relative_error <= 7
    unseen = [told[name] for name in ("sigma_0+", "sigma_1+", "sigma_1-")]
    assert all(e.value is None and e.warnings for e in unseen)
    assert all(told[f"alpha_0{d}"].value is not None for d in "+-")
    elbow = identify_joint(joints["elbow_joint"])
    assert elbow.torque_constant == constants["elbow_joint"]
    assert elbow.tracking is not None
    bristles = [e for name, e in elbow.tracking.parameters.items() if name.name in ("sigma_0", "sigma_1")]
    assert bristles
    assert all(e.value is None and e.warnings for e in bristles)
    # joints 2 and 3 swapped, and gravity upside down are each found by the log, for every joint
    for other, code in (
        (robot(measured_data, order=(0, 2, 1, 3, 4, 5)), "joint-order"),
        (robot(measured_data, up=9.81), "gravity-direction"),
    ):
        found = {m.experiment.joint.name: m.findings for m in measure_robot(other)}
        assert found.keys() == set(NAMES)
        assert all((code, Severity.CRITICAL) in [(w.code, w.severity) for w in own] for own in found.values())
    # without the arm each joint is told how much of its torque the others' motion makes: most of it for the shoulder's lift and the elbow
    whole = robot(measured_data)
    found = against_urdf(Robot(path=whole.path, joints=whole.joints, urdf=None))
    shares = {name: w.numbers["share"] for name, own in found.items() for w in own if w.code == "links-not-removed"}
    assert shares.keys() == set(NAMES)
    assert shares["shoulder_lift_joint"] > 70
    assert shares["elbow_joint"] > 80
