from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bristle.data.experiment.load import Experiment, read_runs
from bristle.data.record import Record
from bristle.errors import InputError

from ..conftest import present
from . import experiments
from .experiments import assert_refused, write_log

K_T, R, RATIO = 0.05, 2.0, 100.0
T = np.arange(1000) * 1e-3
Q, W = np.sin(2 * T) + T, 2 * np.cos(2 * T) + 1
TAU = 0.5 * np.sign(W) + 0.3 * W


def columns(ratio: float) -> dict[str, np.ndarray]:
    """What a motor with this gear logs, in SI, beside what the joint does."""
    current = TAU / (ratio * K_T)
    return {
        "t": T, "q": Q, "w": W, "tau": TAU, "qm": ratio * Q, "wm": ratio * W, "taum": TAU / ratio, "i": current, "u": R * current + K_T * ratio * W,
        "counts": np.round(ratio * Q / (2 * np.pi) * 4096), "turned": np.mod(ratio * Q, 2 * np.pi),
    }  # fmt: skip  # a table


def experiment(
    folder: Path, gear: Any, *, ratio: float = RATIO, kind: str = "revolute", more: Any = None, **signals: Any
) -> Experiment:
    """An experiment of one tracking run with these signals, each `column unit`, and this gear."""
    write_log(folder, "log.csv", **columns(ratio))
    named = {
        name: s if isinstance(s, dict) else dict(zip(("column", "unit"), s.split(), strict=True))
        for name, s in signals.items()
    }
    data = {
        "joint": {"name": "axis", "kind": kind},
        "motor": {"torque_constant": f"{K_T} N*m/A", "resistance": f"{R} ohm", "gear": gear},
        "signals": {"time": {"column": "t", "unit": "s"}, **named},
    }
    return experiments.experiment(folder, **data | (more or {}))


def record(folder: Path, gear: Any, **more: Any) -> Record:
    return read_runs(experiment(folder, gear, **more))[0].record


MOTOR = {"position": "motor", "velocity": "motor", "torque": "motor"}


@settings(max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.floats(0.01, 1500), st.sampled_from([1, -1]), st.sampled_from(["i A current", "u V voltage", "taum N*m torque"])
)
def test_the_motor_side_is_the_joint_side(tmp_path: Path, size: float, sign: int, drive: str) -> None:
    """Whatever the ratio, reversed ones too, position, velocity and torque from current, voltage or a sensor at the motor are those of the joint."""
    ratio = sign * size
    column, unit, name = drive.split()
    found = record(
        tmp_path, {"ratio": ratio, **MOTOR}, ratio=ratio, position="qm rad", velocity="wm rad/s",
        **{name: f"{column} {unit}"},
    )  # fmt: skip  # a list of values
    for got, wanted in ((found.position, Q), (found.velocity, W), (found.torque, TAU)):
        assert got is not None
        np.testing.assert_allclose(got, wanted, atol=1e-9 * max(1, size))
    assert [n for n in found.notes if n.code == "gear-taken"]


def test_sides_may_differ(tmp_path: Path) -> None:
    """An encoder at the joint beside a current of the motor, and a torque at the joint beside an encoder of the motor."""
    link = record(tmp_path, {"ratio": RATIO, "position": "joint"}, position="q rad", current="i A")
    sensor = record(
        tmp_path, {"ratio": RATIO, "position": "motor", "torque": "joint"}, position="qm rad", torque="tau N*m"
    )
    for found in (link, sensor):
        np.testing.assert_allclose(present(found.position), Q, atol=1e-9)
        np.testing.assert_allclose(present(found.torque), TAU, atol=1e-9)
    # a velocity of the joint declared as the motor's differs from the position by the ratio, and the warning names the side
    (found,) = record(
        tmp_path, {"ratio": RATIO, **MOTOR}, position="qm rad", velocity="w rad/s", current="i A"
    ).warnings
    assert found.code == "velocity-factor"
    assert "the other side for velocity under motor.gear" in str(found)
    # no ratio, one that is none, signals of an unknown side, and a current without k_t: one sentence each.
    # Of a joint that slides a bare ratio is refused, as what has another dimension
    constants = {"torque_constant": f"{K_T} N*m/A", "resistance": f"{R} ohm"}
    sides, asks = "position: motor, velocity: motor, torque: motor", []
    current: dict[str, Any] = {"position": "qm rad", "velocity": "wm rad/s", "current": "i A"}
    for text, says in _BAD.items():
        motor = {
            key: x for key, x in (constants | yaml.safe_load(text.replace("SIDES", sides))).items() if x is not None
        }
        asks.append((partial(experiment, tmp_path, None, more={"motor": motor}, **current), says))
    slides: dict[str, Any] = {name: current[name] for name in ("position", "current")}
    for ratio in (100, "5 m", 0, "inf rad/m"):
        gear = {"ratio": ratio, "position": "motor"}
        asks.append((partial(experiment, tmp_path, gear, kind="prismatic", **slides), r"motor\.gear\.ratio: "))
    assert_refused(asks)


def test_constants_of_the_motor_at_the_joint(tmp_path: Path) -> None:
    """k_t goes with the ratio and J with its square, R and L stay; the constant that has an error is the motor's own, and so is its effect."""
    motor = {"torque_constant": "0.05 +/- 0.001 N*m/A", "resistance": "2 ohm", "inductance": "3 mH", "inertia": "1e-6 kg*m**2",
             "gear": {"ratio": -RATIO, **MOTOR}}  # fmt: skip  # a table
    e = experiment(
        tmp_path, None, ratio=-RATIO, more={"motor": motor}, position="qm rad", velocity="wm rad/s", voltage="u V"
    )
    assert e.motor == pytest.approx((RATIO * K_T, R, 3e-3, 1e-6 * RATIO**2))
    assert [str(c) for c in e.torque_constants] == ["torque_constant 0.05 +/- 0.001 N*m/A", "resistance 2 ohm"]
    (shift,) = read_runs(e)[0].record.torque_shifts.values()
    torques = []
    for k_t in (0.0501, 0.0499):
        at = {"motor": motor | {"torque_constant": f"{k_t} N*m/A"}}
        torque = record(
            tmp_path, None, ratio=-RATIO, more=at, position="qm rad", velocity="wm rad/s", voltage="u V"
        ).torque
        assert torque is not None
        torques.append(torque)
    np.testing.assert_allclose(shift, (torques[0] - torques[1]) / 0.0002 * 0.001, rtol=1e-6)
    # counts of an encoder at the motor are so much finer at the joint; a turn that wraps is the motor's
    more: dict[str, Any] = {"encoder_resolution": "4096 counts/rev"}
    gear = {"ratio": RATIO, "position": "motor"}
    e = experiment(tmp_path, gear, more=more, position="counts counts", current="i A")
    assert e.encoder_resolution == pytest.approx(2 * np.pi / 4096 / RATIO)
    found = read_runs(e)[0].record
    np.testing.assert_allclose(present(found.position), Q, atol=2 * np.pi / 4096 / RATIO)
    assert found.warnings == ()
    wrapped = record(tmp_path, gear, position={"column": "turned", "unit": "rad", "wraps": True}, current="i A")
    np.testing.assert_allclose(present(wrapped.position), Q, atol=1e-9)
    with pytest.raises(InputError, match="position jumps by a full turn between samples"):
        record(tmp_path, gear, position="turned rad", current="i A")
    # a joint that slides has the angle of its motor per length, or its lead: m, N and kg at the joint, rad, N*m and kg*m**2 at the motor
    for ratio in (f"{RATIO} rad/m", f"{2000 * np.pi / RATIO!r} mm/rev"):
        gear = {"ratio": ratio, "position": "motor"}
        more["motor"] = {"torque_constant": f"{K_T} N*m/A", "inertia": "1e-6 kg*m**2", "gear": gear}
        e = experiment(tmp_path, None, kind="prismatic", more=more, position="qm rad", current="i A")
        assert e.motor is not None
        assert (e.motor.k_t, e.motor.J) == pytest.approx((K_T * RATIO, 1e-6 * RATIO**2))
        assert e.encoder_resolution == pytest.approx(2 * np.pi / 4096 / RATIO)
        found = read_runs(e)[0].record
        np.testing.assert_allclose(present(found.position), Q, rtol=1e-9)
        np.testing.assert_allclose(present(found.torque), TAU, rtol=1e-9)


@pytest.mark.parametrize("side", ["motor", "joint"])
def test_commands_are_the_torque_that_the_drive_makes(tmp_path: Path, side: str) -> None:
    """K_p (q_d - q) + K_d (dq_d - dq) within the limit, with gains of the side that the drive is on, over a position that wraps."""
    # without a velocity it is that of the position; a delay of the command is one of the torque
    motor = side == "motor"
    by = RATIO if motor else 1.0
    q_d, dq_d = Q + 0.02 * np.sin(5 * T), 0.5 * W
    write_log(
        tmp_path, "log.csv", t=T, q=np.mod(by * Q, 2 * np.pi), w=by * W, q_d=np.mod(by * q_d, 2 * np.pi), dq_d=by * dq_d
    )
    K_p, K_d, limit = 60 / by**2, 0.5 / by**2, 1.0 / by
    signals: dict[str, Any] = {
        "time": {"column": "t", "unit": "s"}, "position": {"column": "q", "unit": "rad", "wraps": True},
        "velocity": {"column": "w", "unit": "rad/s"}, "command": {"column": "q_d", "unit": "rad"},
        "velocity_command": {"column": "dq_d", "unit": "rad/s"},
    }  # fmt: skip  # a table
    gains: dict[str, Any] = {"kp": f"{K_p!r} N*m/rad", "kd": f"{K_d!r} N*m*s/rad", "torque_limit": f"{limit!r} N*m"}
    gains |= {"gear": {"ratio": by, "position": side, "velocity": side}} if motor else {}

    def torque(**more: Any) -> np.ndarray:
        given = {name: s for name, s in (signals | more).items() if s is not None}
        whole = experiments.experiment(tmp_path, joint={"name": "axis"}, motor=gains, signals=given)
        return present(read_runs(whole)[0].record.torque)

    free = 60 * (q_d - Q) + 0.5 * (dq_d - W)
    expected = np.clip(free, -1.0, 1.0)
    assert np.abs(free).max() > 1.2
    np.testing.assert_allclose(torque(), expected, atol=1e-9)
    np.testing.assert_allclose(torque(velocity=None), expected, atol=5e-3)
    np.testing.assert_allclose(torque(velocity_command=None), np.clip(60 * (q_d - Q) - 0.5 * W, -1.0, 1.0), atol=1e-9)
    mean = (q_d + np.roll(q_d, 1)) / 2, (dq_d + np.roll(dq_d, 1)) / 2
    held = np.clip(60 * (mean[0] - Q) + 0.5 * (mean[1] - W), -1.0, 1.0)  # half a sample old
    np.testing.assert_allclose(torque(command={**signals["command"], "held": True})[1:], held[1:], atol=1e-9)
    late = torque(command={**signals["command"], "delay": "-10 ms"})
    np.testing.assert_allclose(late[10:], expected[:-10], atol=1e-9)


_BAD: dict[str, str] = {
    "gear: 100": r"motor\.gear: got 100; expected keys with values, of ratio, position, velocity",
    "gear: {ratio: 0, SIDES}": r"motor\.gear\.ratio: got 0; expected turns of the motor for one turn",
    "gear: {ratio: .inf, SIDES}": r"motor\.gear\.ratio: got inf; expected turns",
    "gear: {ratio: 100 rad/m, SIDES}": r"motor\.gear\.ratio: got '100 rad/m'; expected turns",
    "gear: {ratio: true, SIDES}": r"motor\.gear\.ratio: got True; expected turns",
    "gear: {ratio: 100}": r"runs\.0: motor\.gear does not say on which side position was logged; add position: motor, or",
    "gear: {SIDES}": r"motor\.gear\.ratio: missing",
    "gear: {ratio: 100, position: link}": r"motor\.gear\.position: got 'link'; expected 'motor' or 'joint'",
    "{torque_constant: null, resistance: null, gear: {ratio: 2, position: motor}}": r"torque from current needs motor\.torque_constant",
}
