from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import scipy.io

from bristle.data.experiment.column_names import guess_columns
from bristle.data.experiment.draft import DraftedRun, Told, draft_experiment, told_by
from bristle.data.experiment.load import Experiment, load_experiment, read_runs
from bristle.errors import InputError

from .experiments import assert_refused, present

_T = np.arange(200) * 0.01
_Q, _TAU = np.sin(_T), np.cos(_T)


def _draft(data: Path, **told: object) -> tuple[str, tuple[str, ...]]:
    draft = draft_experiment([data], Told(**told), data.parent)  # type: ignore[arg-type]  # as the test has it
    text = draft.text([DraftedRun("points" if draft.of_points else "ramp")])
    (data.parent / "draft.yaml").write_text(text)
    return text, draft.guessed


def _load(folder: Path) -> Experiment:
    return load_experiment(folder / "draft.yaml")


def _csv(path: Path, header: str, *columns: np.ndarray) -> Path:
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="")
    return path


def test_usual_names_need_no_help(tmp_path: Path) -> None:
    """A log with usual names gives a draft that loads and reads as it is; a unit in a name is taken, and one that is assumed is listed."""
    for header in ("t,q,tau", "Time,Position,Effort", "time_s,q_rad,tau_Nm", "Time [s],angle (rad),Torque [Nm]"):
        _, guessed = _draft(_csv(tmp_path / "ramp.csv", header, _T, _Q, _TAU))
        np.testing.assert_allclose(present(read_runs(_load(tmp_path))[0].record.torque), _TAU)
        assert any(sentence.startswith("torque: column ") for sentence in guessed)
    _, unknown = _draft(_csv(tmp_path / "sine.csv", "t_ms,q_deg,tau", 1000 * _T, np.degrees(_Q), _TAU))
    np.testing.assert_allclose(present(read_runs(_load(tmp_path))[0].record.position), _Q, atol=1e-12)
    assert [u for u in unknown if u.startswith("unit of")] == ['unit of torque (column "tau"): assumed N*m']


@pytest.mark.parametrize("suffix", [".mat", ".npz", ".parquet"])
def test_containers(tmp_path: Path, suffix: str) -> None:
    """MAT (with its structs), NPZ and Parquet files are drafted as CSV is."""
    path = tmp_path / f"log{suffix}"
    columns = {"t": _T, "q": _Q, "tau": _TAU}
    if suffix == ".mat":
        scipy.io.savemat(path, {"data": columns})
    elif suffix == ".npz":
        np.savez(path, t=_T, q=_Q, tau=_TAU)
    else:
        pytest.importorskip("pyarrow", reason="the extra `parquet` is not installed")
        pd.DataFrame(columns).to_parquet(path)
    _draft(path)
    assert read_runs(_load(tmp_path))[0].record.time.size == _T.size


_NAMES: dict[str, tuple[str, str | None] | None] = {
    "motor_current_A": ("current", "A"),
    "joint_pos_deg": ("position", "deg"),
    "tau_Nm": ("torque", "N*m"),
    "dq": ("velocity", None),
    "jointVelDeg_s": ("velocity", "deg/s"),
    "Position (deg)": ("position", "deg"),
    "actual_qd_0": ("velocity", None),
    "current_position": ("position", None),
    "v [V]": ("voltage", "V"),
    "torque_current": ("current", None),
    "v_mm_s": ("velocity", "mm/s"),
    "speed_rpm": ("velocity", "rpm"),
    "speed [1/min]": ("velocity", "rpm"),
    "data.run{2}.qm": ("position", None),
    "motor_torque_mNm": ("torque", "mNm"),
    "timestamp": ("time", None),
    "tau_cmd": ("torque", None),
    "temperature": None,
    "q_ref": ("command", None),
    "goal_position [deg]": ("command", "deg"),
    "goal": ("command", None),
    "positions": ("position", None),
    "efforts [Nm]": ("torque", "N*m"),
    "torque_enable": None,
    "position_error": None,
    "Torque [parsec]": None,
    "target_velocity": ("velocity_command", None),
    "current[0] (mA)": ("current", "mA"),
    "position[0]": ("position", None),
    "effort[2] [Nm]": ("torque", "N*m"),
    "ActTorque [%]": ("torque", "percent"),
}


def test_names_as_people_write_them() -> None:
    """A signal and its unit are read off a column's name; errors, switches and other quantities are no signal."""
    found = {name: [(signal, x.unit) for signal, x in guess_columns([name]).items()] for name in _NAMES}
    assert found == {name: [guess] if guess else [] for name, guess in _NAMES.items()}


_CHOSEN = [
    ("tau_cmd tau_meas", "torque", "tau_meas", 0), ("q1 q2 q3 q4 q5 q6", "position", "q1", 5), ("t q v tau", "velocity", "v", 0),
    ("t q v", "velocity", None, 0), ("target_moment actual_current", "torque", None, 0), ("v dq tau", "velocity", "dq", 0),
]  # fmt: skip  # a table


def test_of_several_columns_the_plainest_is_taken() -> None:
    """What was measured goes before what was asked for; of six joints the first is taken, and the others are counted.

    A bare v is a velocity where another column drives the joint, and nothing where it could be the voltage that does.
    """
    for names, signal, column, others in _CHOSEN:
        found = guess_columns(names.split()).get(signal)
        assert (names, found and (found.column, found.others)) == (names, column and (column, others))


def test_what_cannot_be_guessed_is_refused(tmp_path: Path) -> None:
    """Where torque, position or time are missing, or a motor's constants, one sentence names the option that tells it."""
    says = {
        "t,q,x1": r"no column is named as a torque.* --column torque=NAME",
        "t,x1,tau": r"no column is named as a position or a velocity.* --column position=NAME",
        "x1,q,tau": r"no column is named as the time.* --rate",
    }
    for header, told in says.items():
        assert_refused([(partial(_draft, _csv(tmp_path / "log.csv", header, _T, _Q, _TAU)), told)])
    volts = partial(_draft, _csv(tmp_path / "volts.csv", "t,q,v_in", _T, _Q, _TAU))
    for given, lacks in (
        ({"torque_constant": "1 N*m/A"}, r"torque from voltage needs motor\.resistance \(--resistance\)"),
        ({"resistance": "2 ohm"}, r"motor\.torque_constant: missing; add this key"),
    ):
        volts(**given)
        assert_refused([(partial(_load, tmp_path), lacks)])
    assert "torque: as a voltage, in V, because no torque constant was given" in volts()[1][1]
    _csv(tmp_path / "log.csv", "x1,q,tau", _T, _Q, _TAU)
    _draft(tmp_path / "log.csv", columns={"torque": "tau_2", "time": "x1"})
    told = "no column named 'tau_2'; there are: x1, q, tau"
    assert_refused([(partial(read_runs, _load(tmp_path)), told)])


def test_what_is_told_is_not_guessed(tmp_path: Path) -> None:
    """A file without a header reads by columns, units, scales and a rate that were told: in SI, with the torque from the current, or percents."""
    percent = _csv(tmp_path / "log.csv", "t,q,torque [%]", _T, _Q, 100 * _TAU)
    _draft(percent, scales={"torque": "2 N*m"})
    np.testing.assert_allclose(present(read_runs(_load(tmp_path))[0].record.torque), 2 * _TAU)
    _draft(percent)
    assert_refused([(partial(_load, tmp_path), r"what 100 % are, as in scale: 0.5 N\*m")])
    data = _csv(tmp_path / "log.csv", "", np.degrees(_Q), 1000 * _TAU)
    _, guessed = _draft(
        data, columns={"position": "0", "current": "1"}, units={"position": "deg", "current": "mA"}, scales={"current": "-1"},
        rate="100 Hz", torque_constant="0.5 +/- 0.01 N*m/A",
    )  # fmt: skip  # a list of options
    record = read_runs(_load(tmp_path))[0].record
    np.testing.assert_allclose(present(record.position), _Q, atol=1e-12)
    np.testing.assert_allclose(present(record.torque), -0.5 * _TAU, atol=1e-12)
    np.testing.assert_allclose(record.time, _T)
    assert guessed == ("joint.kind: revolute, by the units",)


def test_options_name_a_signal() -> None:
    """An option without a signal, or without a value, is refused with what was expected; so are a signal told twice, and two drives."""
    options = ("torque", "torque=", "speed=v", "=v", "")
    asks = [(partial(told_by, [option], "--unit"), r"--unit: got .*; expected SIGNAL=") for option in options]
    asks.append((partial(told_by, ["torque=a", "torque=b"], "--column"), "torque is told twice"))
    asks.append((partial(told_by, ["torque=a", "current=b"], "--column"), "expected one of them"))
    assert_refused(asks)


def test_a_position_that_wraps_is_declared(tmp_path: Path) -> None:
    """A position that jumps by a full turn in its unit is drafted with wraps, and comes back whole."""
    q = 3.0 * _T
    for header, turn in (("t,q_rad,tau", 2 * np.pi), ("t,q_deg,tau", 360.0)):
        _draft(_csv(tmp_path / "log.csv", header, _T, q * turn / (2 * np.pi) % turn, _TAU))
        record = read_runs(_load(tmp_path))[0].record
        np.testing.assert_allclose(np.diff(present(record.position)), np.diff(q), atol=1e-9)


def test_counts_tell_the_unit_of_an_angle(tmp_path: Path) -> None:
    """Positions whose unit nothing says are in the one in which a turn has a power of two of counts; velocities go with them."""
    for unit, turn in (("rad", 2 * np.pi), ("rev", 1.0), ("deg", 360.0)):
        counts = np.round(4096 * _Q / (2 * np.pi)) / 4096 * turn
        _, guessed = _draft(
            _csv(tmp_path / "log.csv", "t,pos,vel,tau", _T, counts, np.cos(_T) * turn / 2 / np.pi, _TAU)
        )
        signals = _load(tmp_path).signals
        assert (signals.position and signals.position.unit, signals.velocity and signals.velocity.unit) == (
            unit,
            f"{unit}/s",
        )
        assert any("a turn has 4096 counts" in sentence for sentence in guessed) == (unit != "rad")


def test_points_and_sliding_joints(tmp_path: Path) -> None:
    """Velocity and force alone are taken for points of a prismatic joint, and that is said."""
    _draft(_csv(tmp_path / "pairs.csv", "velocity_mm_s,force_N", 1 + _T, _TAU))
    run = read_runs(_load(tmp_path))[0]
    assert (run.kind, _load(tmp_path).joint.kind) == ("points", "prismatic")
    assert run.record.velocity is not None
    assert run.record.velocity[0] == pytest.approx(1e-3)


def test_hostile_names_stay_names(tmp_path: Path) -> None:
    """Quotes, colons, backslashes and letters beyond the basic plane in names of files and columns do not leave their place in the YAML."""
    path = _csv(tmp_path / 'a"b: [c]\\n#.csv', 't [s],"pos_\U0001f600 [rad]","x: {y"', _T, _Q, _TAU)
    hostile = "N*m, scale: 2}\n#"
    text, _ = _draft(path, columns={"torque": "x: {y", "position": "1"})
    assert read_runs(_load(tmp_path))[0].record.time.size == _T.size
    assert '"pos_\\U0001F600 [rad]"' in text
    with pytest.raises(InputError, match="is not known; expected a unit"):
        _load(_draft(path, columns={"torque": "x: {y"}, units={"torque": hostile}) and tmp_path)


def test_a_draft_of_very_many_columns_is_short(tmp_path: Path) -> None:
    """A wide file gives a draft that can be loaded: what was found, and the first names; a name that repeats or is very long is never guessed."""
    names = ["t [s]", "q [rad]", "tau [Nm]", *(f"c{k}" for k in range(3000))]
    names += ["v" * 5000 + "[" * 5000, *["dq [rad/s]"] * 3000]
    path = tmp_path / "wide.csv"
    zeros = ",0" * (len(names) - 3)
    path.write_text("\n".join([",".join(names), *(f"{k},{k**2},{1 - k}{zeros}" for k in range(3))]))
    text, _ = _draft(path)
    assert len(text) < 10_000
    assert "velocity" not in text.split("signals:")[1]
    assert _load(tmp_path).signals.torque is not None


def test_bad_files_are_refused(tmp_path: Path) -> None:
    """What cannot be read cannot be drafted, nor what the experiment file could not name: one sentence."""
    (tmp_path / "empty.csv").write_text("")
    _csv(tmp_path / "a\nb.csv", "t,q", _T, _Q)
    says = {"none.csv": "no such file", "empty.csv": "empty", "a\nb.csv": r"U\+000A"}
    assert_refused((partial(draft_experiment, [tmp_path / name]), told) for name, told in says.items())
