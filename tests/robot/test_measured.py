"""What the joints of a robot tell together: the order of joints, gravity's direction, torque constants, links without a URDF."""

import re
from pathlib import Path
from typing import Any

import pytest

from bristle.findings import Severity
from bristle.identification.identify import identify_joint
from bristle.identification.measured import Measured
from bristle.identification.robot.measured import measure_robot
from bristle.simulation import arm
from bristle.simulation.arm import ArmLog, simulate_arm

from .arms import NAMES, NO_PINOCCHIO, SIGNALS, document, load_robot, write

pytest.importorskip("pinocchio", reason=NO_PINOCCHIO)
SEED = 7
PLAIN = {"fit": {"position_cutoff": "20 Hz", "decimation": 6, "model": "coulomb-viscous"}}
"""Without a Stribeck term, which takes most of the time and which these tests do not ask for."""


@pytest.fixture(scope="module")
def log() -> ArmLog:
    """A short log of the arm, which no other test has seen."""
    return simulate_arm(SEED, held_out=True)


def measured(folder: Path, log: ArmLog, **changed: Any) -> tuple[Measured, ...]:
    """What the joints of the arm measured, with some keys of its file changed."""
    return measure_robot(load_robot(write(folder, document(**{**PLAIN, **changed}), log)))


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
    found = measured(tmp_path, log)
    assert [m.experiment.joint.name for m in found] == list(NAMES)
    assert all(m.findings == () for m in found)
    inertia = {m.experiment.joint.name: m.link_inertia or 0.0 for m in found}
    assert inertia["shoulder"] > inertia["elbow"] > inertia["wrist_pitch"] > inertia["flange"] > 0


@pytest.mark.parametrize(
    ("label", "kind", "changed"),
    [
        ("reversed", "joint-order", {"signals": in_order(NAMES[::-1])}),
        ("2 and 3 swapped", "joint-order", {"signals": in_order((NAMES[0], NAMES[2], NAMES[1], *NAMES[3:]))}),
        (
            "currents alone swapped",
            "joint-order",
            {
                "signals": {
                    **SIGNALS,
                    "current": {**in_order((NAMES[0], NAMES[2], NAMES[1], *NAMES[3:]))["current"]},
                }
            },
        ),
        ("upside down", "gravity-direction", {"robot": {"urdf": "arm.urdf", "gravity": [0, 0, 9.81]}}),
    ],
)
def test_what_is_not_as_declared_is_critical(
    tmp_path: Path, log: ArmLog, label: str, kind: str, changed: dict[str, Any]
) -> None:
    """A wrong order of columns, and gravity upside down, are said of every joint, with what would be right."""
    found = measured(tmp_path, log, **changed)
    for m in found:
        (warning,) = (w for w in m.findings if w.code in {"joint-order", "gravity-direction"})
        assert (warning.code, warning.severity) == (kind, Severity.CRITICAL), label
    if kind == "gravity-direction":
        assert warning.numbers["better"] == (0.0, 0.0, -9.81)
    elif label == "currents alone swapped":
        assert "shoulder takes the torque or current of elbow" in warning.numbers["swaps"]
    elif label == "2 and 3 swapped":
        assert set(warning.numbers["swaps"]) == {
            "shoulder takes the columns of elbow", "elbow takes the columns of shoulder",
        }  # fmt: skip  # a list of values


def test_a_free_torque_constant_is_found(tmp_path: Path, log: ArmLog) -> None:
    """It lies in its own interval, which is narrower than 1 %, and the torque is the current times it."""
    (elbow,) = measured(tmp_path, log, joints=only("elbow", torque_constant="free"), fit=document()["fit"])
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
    path = write(tmp_path, document(**PLAIN, joints=free), log)
    urdf = tmp_path / "arm.urdf"
    lighter = re.sub(
        r'mass value="([0-9.]+)"', lambda m: f'mass value="{0.8 * float(m[1])}"', urdf.read_text(encoding="utf-8")
    )
    urdf.write_text(lighter, encoding="utf-8")
    found = {m.experiment.joint.name: m.findings for m in measure_robot(load_robot(path))}
    assert "links-scale" in [w.code for w in found["shoulder"]]
    (doubt,) = (w for w in found["elbow"] if w.code == "constant-by-masses")
    assert doubt.numbers["scale"] == pytest.approx(1.25, rel=0.1)


def test_links_that_weigh_nothing_tell_no_constant(tmp_path: Path, log: ArmLog) -> None:
    """Then the constant is not identifiable, and friction is a number of amperes."""
    folder = tmp_path / "light"
    folder.mkdir()
    path = write(folder, document(**PLAIN, joints=only("flange", torque_constant="free")), log)
    urdf = folder / "arm.urdf"
    urdf.write_text(urdf.read_text(encoding="utf-8").replace('mass value="0.4"', 'mass value="1e-6"'), encoding="utf-8")
    (flange,) = measure_robot(load_robot(path))
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
    found = {m.experiment.joint.name: m.findings for m in measured(tmp_path, log, robot=None)}
    for name in ("shoulder", "elbow", "wrist_pitch"):
        (warning,) = found[name]
        assert (warning.code, warning.severity) == ("links-not-removed", Severity.CRITICAL)
    assert found["shoulder"][0].numbers["share"] > 20


def test_a_torque_that_no_drive_has_is_said(tmp_path: Path, log: ArmLog) -> None:
    """A torque within the effort of the URDF is not mentioned, one of twice it is a caution, and one far beyond, as of mA read as A, critical."""
    path = write(tmp_path, document(**PLAIN), log)
    urdf = tmp_path / "arm.urdf"
    whole, most = urdf.read_text(encoding="utf-8"), 0.0
    for effort, kind in (("35", None), ("1e-3", "effort-far-beyond"), ("half", "effort-beyond")):
        allowed = repr(most / 2) if effort == "half" else effort
        urdf.write_text(whole.replace('effort="35"', f'effort="{allowed}"'), encoding="utf-8")
        (elbow,) = (m for m in measure_robot(load_robot(path)) if m.experiment.joint.name == "elbow")
        said = [w for w in elbow.findings if w.code in {"effort-beyond", "effort-far-beyond"}]
        assert [w.code for w in said] == [kind] * (kind is not None)
        most = said[0].numbers["most"] if said else most


def test_what_the_urdf_does_not_allow_is_said(tmp_path: Path, log: ArmLog) -> None:
    """Positions beyond a joint's limits, and links of another mass, are named for the joints that show them."""
    folder = tmp_path / "other"
    folder.mkdir()
    path = write(folder, document(**PLAIN), log)
    urdf = folder / "arm.urdf"
    text = urdf.read_text(encoding="utf-8").replace('lower="-2.6" upper="2.6"', 'lower="-0.2" upper="0.5"')
    urdf.write_text(text.replace('mass value="2.3"', 'mass value="5.3"'), encoding="utf-8")
    found = {m.experiment.joint.name: {w.code for w in m.findings} for m in measure_robot(load_robot(path))}
    assert "beyond-urdf" in found["elbow"]
    assert "beyond-urdf" not in found["shoulder"]
    assert "links-scale" in found["elbow"]
