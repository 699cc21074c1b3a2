import math
import os
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import scipy.io
import yaml
from hypothesis import given
from hypothesis import strategies as st

from bristle.data.constant_velocity.segments import Thresholds
from bristle.data.experiment.column_names import guess_columns
from bristle.data.experiment.draft import DraftedRun, Told, draft_experiment, told_by
from bristle.data.experiment.load import Experiment, load_experiment, read_runs
from bristle.data.experiment.schema import PlusMinus
from bristle.data.experiment.yaml_file import parse
from bristle.errors import InputError

from ..conftest import present
from .experiments import assert_refused, experiment, signals_with


def written(text: str) -> dict[str, Any]:
    """Keys of an experiment file as they are written, where `signals.torque` changes one signal of those that there are."""
    keys: dict[str, Any] = yaml.safe_load(text)
    signals = {key.removeprefix("signals."): keys.pop(key) for key in [*keys] if str(key).startswith("signals.")}
    return keys | ({"signals": signals_with(**signals)} if signals else {})


def test_experiment_files_are_in_si_or_refused(tmp_path: Path) -> None:
    """Each quantity of the file arrives in SI, with the defaults for what is not given."""
    e = experiment(
        tmp_path, motor={"torque_constant": "350 mNm/A", "resistance": "2.1 ohm"}, inertia="0.0089 ± 0.0004 kg*m^2",
        encoder_resolution="4096 counts/rev", segments={"minimum_duration": "500 ms", "minimum_velocity": "1 deg/s"},
        fit={"position_cutoff": "0.05 kHz"},
        truth={"+": {"alpha_0": "0.4 N*m", "alpha_1": "100 mNm", "alpha_2": "0.7 N*m*s/rad", "v_s": "0.1 rad/s"}},
        simulated=True, assumptions=["k_t is assumed"],
    )  # fmt: skip  # a list of values
    assert e.motor is not None
    assert e.motor[:3] == pytest.approx((0.35, 2.1, 0.0))
    assert math.isnan(e.motor.J)
    assert e.inertia == PlusMinus(value=0.0089, standard_error=0.0004)
    assert e.encoder_resolution == pytest.approx(2 * np.pi / 4096)
    assert isinstance(e.segments, Thresholds)
    assert e.segments.minimum_duration == 0.5
    assert e.segments.minimum_velocity == pytest.approx(np.pi / 180)
    assert (e.fit.position_cutoff, e.fit.decimation, e.fit.set_up, e.fit.regressors) == (50.0, None, "auto", None)
    assert e.truth["+"][:4] == pytest.approx((0.4, 0.1, 0.7, 0.1))
    assert math.isnan(e.truth["+"].sigma_0)
    assert e.path == tmp_path / "experiment.yaml"
    # each mistake in a file is one sentence that opens with the file and names the key and the fix
    asks = [(partial(experiment, tmp_path, **written(text)), says) for text, says in _BAD.items()]
    assert_refused(asks, str(tmp_path / "experiment.yaml"))
    # malformed, hostile, huge and empty YAML is one short sentence within seconds, with the line where there is one
    asks = []
    for k, (text, says) in enumerate(_MALFORMED):
        (tmp_path / f"{k}.yaml").write_text(text)
        asks.append((partial(load_experiment, tmp_path / f"{k}.yaml"), says))
    (tmp_path / "binary.yaml").write_bytes(b"\xff\x00")
    paths = {"none.yaml": "no such file", ".": "is a folder", "binary.yaml": "not text"}
    asks += [(partial(load_experiment, tmp_path / name), says) for name, says in paths.items()]
    assert_refused(asks, str(tmp_path))
    # names too long, with a NUL, or patterns that search for ever, and files with unprintable names, are one short sentence
    for name in ("ramp\x1b[2J.csv", os.fsdecode(b"slow\xff.csv"), "a" * 120):
        (tmp_path / name).write_text("t\n1\n")
    says = {
        "a" * 300: "runs: files 'aaa.*: the file search failed", "a\0b.csv": r"'a\\x00b.csv' is not a file",
        "**/a/**/b/**/*.csv": r"has \*\* more than once", "*" * 2000 + "x": r"has \*\* more than once",
        "*a" * 60 + "b": "matches no file", "ramp*": r"file name 'ramp\\x1b\[2J.csv' holds U\+001B",
        "slow*": r"file name 'slow\\udcff.csv' holds U\+DCFF",
    }  # fmt: skip  # a list of values
    read = {files: experiment(tmp_path, runs=[{"files": files, "experiment": "tracking"}]) for files in says}
    assert_refused((partial(read_runs, read[files]), told) for files, told in says.items())
    # what YAML cannot read is one sentence: the line, what was got, and where to look
    unread = {
        "a: [1, , 2]": 1,
        "a: 1\n  b: 2": 2,
        "a: {b: c\nd: e": 2,
        "\ta: 1": 1,
        "a: 'x": 1,
        "- a\nb: c": 2,
        "a: !!python/object:os.system x": 1,
    }
    says = (
        r"^e.yaml: line {}, column .*: got .*, which is not YAML .*; check its indentation, colons, brackets and quotes"
    )
    assert_refused((partial(parse, text, "e.yaml"), says.format(line)) for text, line in unread.items())


_BAD: dict[str, str] = {
    "joint: {name: a, knd: revolute}": r"unknown key 'joint\.knd'; did you mean 'kind'\?",
    "int: {}": r"unknown key 'int'; did you mean 'joint'",  # a type's name is no key
    "path: x": "unknown key 'path'",
    "joint: {name: a, kind: ball}": r"joint\.kind: got 'ball'; expected 'revolute' or 'prismatic'",
    "joint: {name: a, kind: prismatic}": r"signals\.position: unit 'rad' is not a unit of m",
    'joint: {name: "a\\x9b"}': r"joint\.name: the text 'a\\x9b' holds U\+009B",
    "inertia: 0.01": r"inertia: got 0\.01; expected a number with its unit",
    "inertia: -1 kg*m^2": "inertia: .*expected a positive inertia",
    "inertia: 0.05 +/- 1e400 kg*m^2": "inertia: got .*expected a finite size",
    "motor: {torque_constant: 0.35 +/- 0.4 N*m/A}": (
        r"motor\.torque_constant: got '0\.35 \+/- 0\.4 N\*m/A'; expected an error that is smaller than the constant"
    ),
    "signals.torque: {column: 1, unit: Nmm2x}": r"signals\.torque: unit 'Nmm2x' is not known",
    "signals.torque: {column: -1, unit: N*m}": r"signals\.torque\.column: got -1; expected .* counted from 0",
    "signals.torque: {column: 1, unit: A, scale: 7.6 N*m/A +/- 0.1 ohm}": (
        r"signals\.torque: unit 'ohm' is not a unit of N\*m/A"
    ),
    "signals.torque: {column: 1, unit: A, scale: -7.6 +/- 8 N*m/A}": (
        r"signals\.torque: scale '-7\.6 \+/- 8 N\*m/A': expected a number, with an error that is smaller than it"
    ),
    "signals.torque: {column: 1, unit: N*m, scale: 1.0e+300}": (
        r"signals\.torque: unit 'N\*m' times scale 1e\+300 is 1e\+300 N\*m; expected between"
    ),
    "signals.torque:": r"runs\.0: no torque",
    "signals.command: {column: 1, unit: rad}": "signals: got torque and command; expected exactly one of .*, or command",
    "{signals.torque: null, signals.command: {column: 1, unit: rad}, motor: {kd: 1 N*m*s/rad}}": r"needs motor\.kp .* a share of kp",
    "gravity: 1 N*m": r"runs\.0: gravity: a known gravity scales a voltage, a current or a command without constants under motor",
    "gravity: {mass: 1 kg, centre: -1 m}": r"gravity\.centre: got '-1 m'; expected greater than 0",
    "{signals.torque: null, signals.velocity_command: {column: 1, unit: rad/s, delay: 1 ms}}": "velocity_command: got a delay; expected",
    "motor: {kp: 20 +/- 1 N*m/rad, kd: 1 +/- 0.1 N*m*s/rad}": r"motor\.kd: got an error; expected an error of kp alone",
    "signals.torque: {column: 1, unit: N*m, scale: 35 N*m/V}": "expected unit: V, of which this scale makes N",
    "signals.velocity: {column: 1, unit: Hz}": r"signals\.velocity: unit 'Hz' is not a unit of rad/s",
    "signals.position: {column: 1, unit: counts}": r"needs encoder_resolution \(--encoder-resolution\)",
    "signals.position: {column: 1, unit: rad, scale: 2 +/- 0.1}": (
        r"signals\.position: scale: got '2 \+/- 0\.1'; expected no error: only that of torque, voltage or current"
    ),
    "signals.position: {column: 1, unit: rad, wraps: 3 s}": r"signals\.position: unit 's' is not a unit of rad",
    "signals.time: {column: t, unit: s, rate: 1 Hz}": r"signals\.time: expected either",
    "runs: []": "runs: got .*; expected at least one entry$",
    "runs: [{files: a, experiment: rampe}]": r"runs\.0\.experiment: got 'rampe'; expected 'ramp'.*'tracking'$",
    'runs: [{files: a, experiment: ramp, load: "5 kg\\u2067"}]': r"runs\.0\.load: .* holds U\+2067",
    "truth: {both: {}, '+': {}}": "truth",
    "fit: {3: 4}": r"fit\.3: got 3; expected a key that is text",
    "fit: {regressors: [offset]}": "fit.*offset cannot be told .* directions: symmetric",
    "fit: {position_cutoff: 1e300 Hz}": r"fit\.position_cutoff: .*expected a finite size",
    "fit: {fixed: {sigma_0: 0 N*m/rad}}": r"fit\.fixed: sigma_0: got 0; expected a value > 0",
    "fit: {fixed: {offset: 1e400 N*m}}": r"fit\.fixed: got '1e400 N\*m'; .* finite",
    "fit: {fixed: {alpha_0: 1 N*m, alpha_0+: 2 N*m}}": r"fit\.fixed: got both alpha_0 and alpha_0\+",
    "fit: {fixed: {alpha_0+-: 1 N*m}}": r"fit\.fixed: got 'alpha_0\+-'; expected one of",
}


_FEW = "joint: {name: a}\nruns: [{files: a, experiment: ramp}]\n"


_MALFORMED = [
    ("joint: {name: a", "line 1"),
    ("a: &x [1]\nb: *x", r"line 1.*anchors"),
    ("joint: {}\njoint: {}", "line 2.*'joint' is given twice"),
    ("[" * 100_000, "nested too deeply"),
    ("", "expected keys"),
    ("? [a]\n: 1", "line 1|cannot read|unknown key|in quotes"),
    ("x: " + "9" * 1_000_001, "larger than"),
    ("a: \x00", "not YAML"),
    ("".join(f"k{k}: 1\n" for k in range(50_000)), "line 5000.*more than 10000"),
    ("a: [" + "1," * 100_000 + "]", "more than 10000"),
    ("a: " + "1" * 500_000, "an integer of 500000 digits"),
    ("a: 0x" + "f" * 5_000, "an integer of 5002 digits"),
    ("joint: {name: a}\nruns:\n" + "- {x: 1}\n" * 3_000, r"unknown key 'runs\.0\.x'.*and 8999 more"),
    (_FEW + "fit: {fixed: {sigma_0: '" + "1" * 500_000 + "'}}", "fit.fixed: got"),
    (_FEW + "inertia: '" + "1 kg +/- " * 50_000 + "'", "inertia: got"),
    (_FEW + "signals: {torque: {column: a, unit: '" + "m*" * 200_000 + "'}}", "signals.torque: unit .* is not known"),
    ("joint: {name: a}\nruns: [{experiment: ramp, files: '" + "${a" * 100_000 + "'}]", "runs.0.files: got .*at most 4096"),
    ("? {a: b}\n: 1", "line 1"),
]  # fmt: skip  # a table


@given(st.text(max_size=2000))
def test_a_sentence_is_short_and_shown(text: str) -> None:
    """Whatever an error quotes, it is one line of at most 500 characters that a terminal shows."""
    said = str(InputError(f"beginning {text} end"))
    assert said.startswith("beginning ")
    assert said.endswith(" end")
    assert said.isprintable()
    assert len(said) <= 500


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


def test_drafts_of_usual_logs(tmp_path: Path) -> None:
    """A log with usual names gives a draft that loads and reads as it is; a unit in a name is taken, and one that is assumed is listed."""
    for header in ("t,q,tau", "Time,Position,Effort", "time_s,q_rad,tau_Nm", "Time [s],angle (rad),Torque [Nm]"):
        _, guessed = _draft(_csv(tmp_path / "ramp.csv", header, _T, _Q, _TAU))
        np.testing.assert_allclose(present(read_runs(_load(tmp_path))[0].record.torque), _TAU)
        assert any(sentence.startswith("torque: column ") for sentence in guessed)
    _, unknown = _draft(_csv(tmp_path / "sine.csv", "t_ms,q_deg,tau", 1000 * _T, np.degrees(_Q), _TAU))
    np.testing.assert_allclose(present(read_runs(_load(tmp_path))[0].record.position), _Q, atol=1e-12)
    assert [u for u in unknown if u.startswith("unit of")] == ['unit of torque (column "tau"): assumed N*m']
    # where torque, position or time are missing, or a motor's constants, one sentence names the option that tells it
    says = {
        "t,q,x1": r"no column is named as a torque.* --column torque=NAME",
        "t,x1,tau": r"no column is named as a position or a velocity.* --column position=NAME",
        "x1,q,tau": r"no column is named as the time.* --rate",
    }
    for header, told in says.items():
        assert_refused([(partial(_draft, _csv(tmp_path / "log.csv", header, _T, _Q, _TAU)), told)])
    volts = partial(_draft, _csv(tmp_path / "volts.csv", "t,q,v_in", _T, _Q, _TAU))
    for constant, lacks in (
        ({"torque_constant": "1 N*m/A"}, r"torque from voltage needs motor\.resistance \(--resistance\)"),
        ({"resistance": "2 ohm"}, r"motor\.torque_constant: missing; add this key"),
    ):
        volts(**constant)
        assert_refused([(partial(_load, tmp_path), lacks)])
    assert "torque: as a voltage, in V, because no torque constant was given" in volts()[1][1]
    _csv(tmp_path / "log.csv", "x1,q,tau", _T, _Q, _TAU)
    _draft(tmp_path / "log.csv", columns={"torque": "tau_2", "time": "x1"})
    told = "no column named 'tau_2'; there are: x1, q, tau"
    assert_refused([(partial(read_runs, _load(tmp_path)), told)])
    # a file without a header reads by columns, units, scales and a rate that were told: in SI, with the torque from the current, or percents
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
    # a position that jumps by a full turn in its unit is drafted with wraps, and comes back whole
    q = 3.0 * _T
    for header, turn in (("t,q_rad,tau", 2 * np.pi), ("t,q_deg,tau", 360.0), ("t,enc_ticks,tau", 1e9)):
        log = _csv(tmp_path / "log.csv", header, _T, q * turn / (2 * np.pi) % turn, _TAU)
        _draft(log, encoder_resolution="1e9 counts/rev" if turn == 1e9 else None)
        record = read_runs(_load(tmp_path))[0].record
        np.testing.assert_allclose(np.diff(present(record.position)), np.diff(q), atol=1e-9)
    # velocity and force alone are taken for points of a prismatic joint, and that is said
    _draft(_csv(tmp_path / "pairs.csv", "velocity_mm_s,force_N", 1 + _T, _TAU))
    run = read_runs(_load(tmp_path))[0]
    assert (run.kind, _load(tmp_path).joint.kind) == ("points", "prismatic")
    assert present(run.record.velocity)[0] == pytest.approx(1e-3)


def test_what_names_and_options_tell_of_a_draft(tmp_path: Path) -> None:
    """A signal and its unit are read off a column's name; errors, switches and other quantities are no signal."""
    found = {name: [(signal, x.unit) for signal, x in guess_columns([name]).items()] for name in _NAMES}
    assert found == {name: [guess] if guess else [] for name, guess in _NAMES.items()}
    # what was measured goes before what was asked for; of six joints the first is taken, and the others are counted. A bare v is a velocity
    # where another column drives the joint, and nothing where it could be the voltage that does
    for names, signal, column, others in _CHOSEN:
        found = guess_columns(names.split()).get(signal)
        assert (names, found and (found.column, found.others)) == (names, column and (column, others))
    # an option without signal or value is refused; so are a signal told twice, and two drives
    options = ("torque", "torque=", "speed=v", "=v", "")
    asks = [(partial(told_by, [option], "--unit"), r"--unit: got .*; expected SIGNAL=") for option in options]
    asks.append((partial(told_by, ["torque=a", "torque=b"], "--column"), "torque is told twice"))
    asks.append((partial(told_by, ["torque=a", "current=b"], "--column"), "expected one of them"))
    assert_refused(asks)
    # what cannot be read cannot be drafted, nor what the experiment file could not name: one sentence
    (tmp_path / "empty.csv").write_text("")
    _csv(tmp_path / "a\nb.csv", "t,q", _T, _Q)
    says = {"none.csv": "no such file", "empty.csv": "empty", "a\nb.csv": r"U\+000A"}
    assert_refused((partial(draft_experiment, [tmp_path / name]), told) for name, told in says.items())
    # quotes, colons, backslashes and letters beyond the basic plane in names of files and columns do not leave their place in the YAML
    path = _csv(tmp_path / 'a"b: [c]\\n#.csv', 't [s],"pos_\U0001f600 [rad]","x: {y"', _T, _Q, _TAU)
    hostile = "N*m, scale: 2}\n#"
    text, _ = _draft(path, columns={"torque": "x: {y", "position": "1"})
    assert read_runs(_load(tmp_path))[0].record.time.size == _T.size
    assert '"pos_\\U0001F600 [rad]"' in text
    with pytest.raises(InputError, match="is not known; expected a unit"):
        _load(_draft(path, columns={"torque": "x: {y"}, units={"torque": hostile}) and tmp_path)
    # a wide file's draft can be loaded: what was found, and the first names; repeated or long names are not guessed
    names = ["t [s]", "q [rad]", "tau [Nm]", *(f"c{k}" for k in range(3000))]
    names += ["v" * 5000 + "[" * 5000, *["dq [rad/s]"] * 3000]
    path = tmp_path / "wide.csv"
    zeros = ",0" * (len(names) - 3)
    path.write_text("\n".join([",".join(names), *(f"{k},{k**2},{1 - k}{zeros}" for k in range(3))]))
    text, _ = _draft(path)
    assert len(text) < 10_000
    assert "velocity" not in text.split("signals:")[1]
    assert _load(tmp_path).signals.torque is not None


def test_containers(tmp_path: Path) -> None:
    """MAT (with its structs), NPZ and Parquet files are drafted as CSV is; of matrices the first columns, and it is said that there are others."""
    pytest.importorskip("pyarrow", reason="the extra `parquet` is not installed")
    columns = {"t": _T, "q": _Q, "tau": _TAU}
    scipy.io.savemat(tmp_path / "log.mat", {"data": columns})
    np.savez(tmp_path / "log.npz", t=_T, q=np.column_stack([_Q, -_Q]), tau=np.column_stack([_TAU, -_TAU]))
    pd.DataFrame(columns).to_parquet(tmp_path / "log.parquet")
    for suffix in ("mat", "npz", "parquet"):
        _, guessed = _draft(tmp_path / f"log.{suffix}")
        np.testing.assert_allclose(present(read_runs(_load(tmp_path))[0].record.torque), _TAU)
        assert ('position: column "q[0]", the first of 2 that are named so' in guessed) == (suffix == "npz")


_NAMES: dict[str, tuple[str, str | None] | None] = {
    "motor_current_A": ("current", "A"), "joint_pos_deg": ("position", "deg"), "tau_Nm": ("torque", "N*m"),
    "dq": ("velocity", None), "jointVelDeg_s": ("velocity", "deg/s"), "Position (deg)": ("position", "deg"), "encoder_counts": ("position", "counts"),
    "actual_qd_0": ("velocity", None), "current_position": ("position", None), "v [V]": ("voltage", "V"),
    "torque_current": ("current", None), "v_mm_s": ("velocity", "mm/s"), "speed_rpm": ("velocity", "rpm"),
    "speed [1/min]": ("velocity", "rpm"), "data.run{2}.qm": ("position", None), "motor_torque_mNm": ("torque", "mNm"),
    "timestamp": ("time", None), "tau_cmd": ("torque", None), "temperature": None, "q_ref": ("command", None),
    "goal_position [deg]": ("command", "deg"), "goal": ("command", None), "positions": ("position", None),
    "efforts [Nm]": ("torque", "N*m"), "torque_enable": None, "position_error": None, "Torque [parsec]": None,
    "target_velocity": ("velocity_command", None), "current[0] (mA)": ("current", "mA"),
    "position[0]": ("position", None), "effort[2] [Nm]": ("torque", "N*m"), "ActTorque [%]": ("torque", "percent"),
}  # fmt: skip  # a list of values


_CHOSEN = [
    # by a unit alone, but where several columns have one; and German names
    ("t_s z_mm thrust_N", "position", "z_mm", 0), ("t_s z_mm thrust_N", "torque", "thrust_N", 0), ("t a_mm b_mm tau", "position", None, 0),
    ("Lagesollwert Lageistwert Istmoment", "position", "Lageistwert", 0), ("Lagesollwert Istmoment", "torque", "Istmoment", 0),
    ("sec nanosec q tau", "time", "sec", 0), ("sec usec q tau", "time", None, 0),
    ("tau_cmd tau_meas", "torque", "tau_meas", 0), ("q1 q2 q3 q4 q5 q6", "position", "q1", 5), ("t q v tau", "velocity", "v", 0),
    ("t q v", "velocity", None, 0), ("target_moment actual_current", "torque", None, 0), ("v dq tau", "velocity", "dq", 0),
    ("q_d q tau_J_d tau_J", "torque", "tau_J", 0), ("q_d q tau_J_d tau_J", "position", "q", 0), ("q i_d i_q", "current", "i_q", 0),
    ("q i_d", "current", None, 0), ("actual_q_1 actual_qd_1 actual_TCP_speed", "velocity", "actual_qd_1", 0),
]  # fmt: skip  # a table
