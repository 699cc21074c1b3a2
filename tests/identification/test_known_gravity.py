from pathlib import Path

import numpy as np
import pytest

import bristle
from bristle.arrays import Array
from bristle.errors import InputError
from bristle.identification.results import Joint
from bristle.identification.verdict import Trust, verdict
from bristle.model.parameters import Lugre

from .conftest import codes, drafted, white, written
from .test_decisions import sines, tracked

TRUTH = Lugre(0.06, 0.0, 0.03, 0.05, 300.0, 0.3)
INERTIA, GRAVITY, HANGS = 0.02, 0.8, 0.4
EFFORTS = {"current": 0.35, "voltage": 0.12, "command": 12.0}  # signals, and N*m per unit of each


def swung() -> tuple[Array, Array, Array, Array]:
    """A joint that swings some radians, at 250 Hz: time, position, velocity and the torque of its drive, (n,)."""
    t, q, v, a = sines(250.0, 24.0, [(1.2, 0.21, 0.2), (0.5, 0.53, 1.0), (0.2, 1.1, 2.0)])
    torque = bristle.simulate(v, t[1], TRUTH) + INERTIA * a + GRAVITY * np.sin(q - HANGS)
    return t, q, v, torque + white(t.size, 0.005)


def logged(folder: Path, signal: str, damping: float = 0.0) -> Path:
    """A CSV with the position and that signal; a drive that is told a position damps as well, N*m*s/rad."""
    t, q, v, torque = swung()
    effort = (torque + damping * v) / EFFORTS[signal]
    column = {"goal": q + effort} if signal == "command" else {signal: effort}
    return written(folder / "log.csv", t=t, q=q, **column)


def within(joint: Joint, **truth: float) -> None:
    """Parameters of the moving runs are within 1.5 of their intervals of the truth, which are narrower than a third of it."""
    found, wrong = tracked(joint), {}
    for name, x in truth.items():
        value, interval = found[name].value, found[name].interval
        if value is None or interval is None or not abs(value - x) <= 0.75 * np.ptp(interval) <= 0.25 * x:
            wrong[name] = (value, interval, x)
    assert wrong == {}


def test_a_drive_of_unknown_gain_tells_ratios(tmp_path: Path) -> None:
    """Its command alone: all is in rad of position error, as a share of kp, and its damping is in alpha_2; how to get N m is said."""
    log, kp = logged(tmp_path, "command", damping=0.4), EFFORTS["command"]
    joint = drafted(log)
    units = tuple(tracked(joint)[name].unit for name in ("alpha_2", "inertia"))
    assert (joint.kind, *units) == ("revolute in rad", "s", "s**2")
    within(joint, alpha_0=0.06 / kp, alpha_2=(0.03 + 0.4) / kp, inertia=INERTIA / kp)
    assert verdict(joint).trust is Trust.USE
    (said,) = (w for w in joint.warnings if w.code == "no-torque-constant")
    assert "as a share of kp, and alpha_2 holds what the drive damps: write `motor: {kp: 20 N*m/rad}`" in said.message
    text = bristle.Results(joints=(joint,)).text()
    assert "fitted position error within" in " ".join(text.split())
    with pytest.raises(InputError, match=r"known as a position error alone, and urdf takes N\*m or N; give motor.kp"):
        bristle.export(bristle.Results(joints=(joint,)), "urdf")
    assert b"0.005" in bristle.export(bristle.Results(joints=(joint,)), "json").content
    # a joint that turns about a vertical axis: its friction stays in A, and it is said what is missing
    t, q, _, torque = swung()
    torque -= GRAVITY * np.sin(q - HANGS)
    log = written(tmp_path / "log.csv", t=t, q=q, current=torque / 0.35)
    joint = drafted(log, told=bristle.Told(gravity="0.8 N*m"))
    assert joint.kind == "revolute in A"
    assert "constant-unseen" in codes(joint.warnings)
    assert "chosen scale" not in joint.settings


@pytest.mark.parametrize("signal", list(EFFORTS))
def test_a_known_gravity_scales_it(tmp_path: Path, signal: str) -> None:
    """With its torque, or a mass and where it is, all is in N m, its scale within three errors; an error of the gravity is in the intervals."""
    log, scale = logged(tmp_path, signal), EFFORTS[signal]
    exact = drafted(log, told=bristle.Told(gravity=f"{GRAVITY} N*m"))
    within(exact, alpha_0=0.06, alpha_2=0.03, inertia=INERTIA)
    told = exact.settings["chosen scale"]
    found, error = (float(x) for x in told.split(" N*m/")[0].rsplit(" ", 3)[1::2])
    assert abs(found - scale) <= 3 * error < 0.05 * scale
    assert ("assumed exact" in told, "alpha_2 holds" in told) == (True, signal != "current")
    kg = GRAVITY / 9.81 / 0.08
    mass = drafted(log, told=bristle.Told(gravity=f"mass: {kg} +/- {0.05 * kg} kg, centre: 80 mm"))
    within(mass, alpha_0=0.06, inertia=INERTIA)
    for name in ("alpha_0", "inertia"):
        estimate = tracked(mass)[name]
        assert estimate.interval is not None
        assert np.ptp(estimate.interval) > 0.19 * float(estimate.value or 0.0)
    assert "assumed exact" not in mass.settings["chosen scale"]
    assert "torque-uncertain" in codes([mass.torque_scale] if mass.torque_scale else [])


def test_which_gravities_are_taken(tmp_path: Path) -> None:
    """Beside a torque, constants of the motor, or points; of a joint that slides; without a centre: a sentence each."""
    log = logged(tmp_path, "current")
    text, _ = bristle.draft(log, told=bristle.Told(gravity="0.8 N*m"))
    whole = 'gravity: "0.8 N*m"'
    beside = "gravity: a known gravity scales a voltage, a current or a command without constants under motor"
    for old, new, says in (
        ('current: {column: "current", unit: "A"}', 'torque: {column: "current", unit: "N*m"}', beside),
        (whole, f"{whole}\nmotor: {{torque_constant: 0.35 N*m/A}}", beside),
        (whole, "gravity: {mass: 1 kg}", r"gravity\.centre: missing"),
        (whole, "gravity: 1 kg", r"not a unit of N\*m"),
        (whole, "gravity: -1 N*m", "greater than 0"),
    ):
        assert old in text
        log.with_suffix(".yaml").write_text(text.replace(old, new), encoding="utf-8")
        with pytest.raises(InputError, match=says):
            bristle.identify(log.with_suffix(".yaml"))
    # of the only joint, or of the one of that name, a quarter turn from where it hangs; a vertical axis has none
    pytest.importorskip("pinocchio", reason="needs the extra robot")
    log, urdf = logged(tmp_path, "current"), tmp_path / "leg.urdf"
    link = (
        '<link name="{0}"><inertial><origin xyz="0.06 0 0.08"/><mass value="0.81549"/>'
        '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )
    joint = (
        '<joint name="{0}" type="revolute"><parent link="base"/><child link="{1}"/><axis xyz="{2}"/>'
        '<limit lower="-3" upper="3" effort="20" velocity="10"/></joint>'
    )
    one = f'<robot name="leg"><link name="base"/>{link.format("a")}{joint.format("hip", "a", "0 1 0")}</robot>'
    urdf.write_text(one, encoding="utf-8")
    text, _ = bristle.draft(log, told=bristle.Told(gravity=str(urdf)))
    assert float(text.split('gravity: "')[1].split()[0]) == pytest.approx(0.81549 * 9.81 * 0.1, rel=1e-5)
    two = one.replace("</robot>", f"{link.format('b')}{joint.format('yaw', 'b', '0 0 1')}</robot>")
    urdf.write_text(two, encoding="utf-8")
    with pytest.raises(InputError, match=r"has 2 joints: hip, yaw; name the one of the log, as in --name hip"):
        bristle.draft(log, told=bristle.Told(gravity=str(urdf)))
    named, _ = bristle.draft(log, told=bristle.Told(gravity=str(urdf), name="hip"))
    assert named.replace('name: "hip"', 'name: "log"') == text
    with pytest.raises(
        InputError, match="gravity makes no torque of yaw, which slides, or turns about a vertical axis"
    ):
        bristle.draft(log, told=bristle.Told(gravity=str(urdf), name="yaw"))
