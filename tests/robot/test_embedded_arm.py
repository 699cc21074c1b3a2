"""The embedded robot (simulated, seed 0): what bristle must find in it, once, from its file; and that its files are those of its code."""

import importlib.util

import numpy as np
import pytest

import bristle
import simulated_arm as arm
from bristle.findings import Severity
from bristle.identification.known_joint import chosen

from .arms import NAMES, NO_PINOCCHIO

pytest.importorskip("pinocchio", reason=NO_PINOCCHIO)
FOLDER = arm.FOLDER
LARGEST = 1_500_000  # bytes of all files together


def test_friction_of_every_joint_is_found() -> None:
    """Coulomb and viscous friction of all joints, both directions: within 3 errors of the truth, and these below 5 %.

    The Stribeck term is right too, or not identifiable; torque constants that were free are found; nothing critical is said.
    """
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
        assert joint.moving is not None
        assert [held.relative_error < 1.5 for held in joint.moving.hold_out] == [True]
        constant = joint.torque_constant
        assert (constant is not None) == known.free
        if constant is not None:
            assert constant.value == pytest.approx(known.torque_constant, abs=3 * (constant.standard_error or 0.0))
            assert constant.value == pytest.approx(known.torque_constant, rel=0.01)
    assert asked == 24
    assert inside >= 20
    about_robots = {"joint-order", "gravity-direction", "links-scale", "links-oppose", "beyond-urdf"}
    assert not [w for w in results.warnings if w.severity is Severity.CRITICAL or w.code in about_robots]


def test_the_files_are_those_of_the_code() -> None:
    """The robot's file is what make.py writes, the logs are as long as the motion and within the URDF's limits, and all is small."""
    spec = importlib.util.spec_from_file_location("make_arm", FOLDER / "make.py")
    assert spec is not None
    assert spec.loader is not None
    make = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(make)
    assert make.robot() == (FOLDER / "robot.yaml").read_text(encoding="utf-8")
    log = arm.simulate_arm(0, held_out=True)
    table = np.loadtxt(FOLDER / "held_out.csv", delimiter=",", skiprows=1)
    assert table == pytest.approx(np.column_stack([log.time, log.position, log.current]), abs=1e-4)
    assert sum(path.stat().st_size for path in FOLDER.iterdir() if path.is_file()) < LARGEST
