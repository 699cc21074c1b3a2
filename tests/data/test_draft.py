import re
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from bristle.data.experiment.draft import draft_experiment
from bristle.data.experiment.load import Experiment, load_experiment, read_runs
from bristle.errors import InputError

_T = np.arange(200) * 0.01
_Q, _TAU = np.sin(_T), np.cos(_T)


def _draft(data: Path) -> tuple[str, tuple[str, ...]]:
    text, unknown = draft_experiment(data)
    (data.parent / "draft.yaml").write_text(text)
    return text, unknown


def _load(folder: Path) -> Experiment:
    return load_experiment(folder / "draft.yaml")


def _csv(path: Path, header: str, *columns: np.ndarray) -> Path:
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="")
    return path


@pytest.mark.parametrize(
    "header", ["t,q,tau", "Time,Position,Effort", "time_s,q_rad,tau_Nm", "Time [s],angle (rad),Torque [Nm]"]
)
def test_usual_names_need_no_help(tmp_path: Path, header: str) -> None:
    """A log with usual names gives a draft that loads and reads as it is."""
    text, unknown = _draft(_csv(tmp_path / "ramp.csv", header, _T, _Q, _TAU))
    record = read_runs(_load(tmp_path))[0].record
    assert "FILL IN" not in text
    assert record.torque is not None
    np.testing.assert_allclose(record.torque, _TAU)
    assert any(sentence.startswith("experiment: assumed ramp") for sentence in unknown)


def test_units_in_names_are_used(tmp_path: Path) -> None:
    """A unit in a column's name is taken, and only a unit that is assumed is listed as such."""
    _, unknown = _draft(_csv(tmp_path / "sine.csv", "t_ms,q_deg,tau", 1000 * _T, np.degrees(_Q), _TAU))
    run = read_runs(_load(tmp_path))[0]
    assert run.kind == "tracking"
    assert run.record.position is not None
    np.testing.assert_allclose(run.record.position, _Q, atol=1e-12)
    assert [u for u in unknown if "unit" in u] == ['unit of torque (column "tau"): assumed N*m']


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
        pytest.importorskip("pandas").DataFrame(columns).to_parquet(path)
    _draft(path)
    assert read_runs(_load(tmp_path))[0].record.time.size == _T.size


def test_blanks_are_marked_and_said(tmp_path: Path) -> None:
    """A file without a header guesses nothing; the draft is refused until its blanks are filled in, and then reads."""
    text, unknown = _draft(_csv(tmp_path / "log.csv", "", _Q, _TAU))
    assert {u.split(":")[0] for u in unknown} >= {"time", "position", "torque"}
    with pytest.raises(ValueError, match=r"runs\.0: no torque"):
        _load(tmp_path)
    text = re.sub(r"# FILL IN, without the #: (\w+): .*", r"\1: {column: 0, unit: rad}", text)
    text = text.replace("time: {column: 0, unit: rad}", "time: {rate: 100 Hz}").replace(
        "torque: {column: 0, unit: rad}", "torque: {column: 1, unit: N*m}"
    )
    (tmp_path / "draft.yaml").write_text(text)
    np.testing.assert_allclose(read_runs(_load(tmp_path))[0].record.time, _T)


def test_voltage_asks_for_the_motor(tmp_path: Path) -> None:
    """Where only voltage is logged, the draft marks the motor's constants, and is refused without them."""
    text, unknown = _draft(_csv(tmp_path / "log.csv", "t,q,v_in", _T, _Q, _TAU))
    assert any(u.startswith("motor") for u in unknown)
    with pytest.raises(ValueError, match=r"torque from voltage needs motor\.torque_constant"):
        _load(tmp_path)
    (tmp_path / "draft.yaml").write_text(text.replace("# motor:", "motor:"))
    assert _load(tmp_path).motor is not None


def test_points_and_sliding_joints(tmp_path: Path) -> None:
    """Velocity and force alone are taken for points of a prismatic joint, and that is said."""
    _, unknown = _draft(_csv(tmp_path / "pairs.csv", "velocity_mm_s,force_N", 1 + _T, _TAU))
    run = read_runs(_load(tmp_path))[0]
    assert (run.kind, _load(tmp_path).joint.kind) == ("points", "prismatic")
    assert run.record.velocity is not None
    assert run.record.velocity[0] == pytest.approx(1e-3)
    assert any("assumed points" in u for u in unknown)


def test_hostile_names_stay_names(tmp_path: Path) -> None:
    """Quotes, colons, backslashes and letters beyond the basic plane in names of files and columns do not leave their place in the YAML."""
    path = _csv(tmp_path / 'a"b: [c]\\n#.csv', 't [s],"pos_\U0001f600 [rad]","x: {y"', _T, _Q, _TAU)
    text, _ = draft_experiment(path)
    text = text.replace("# FILL IN, without the #: torque: {column: tau, ", 'torque: {column: "x: {y", ')
    text = text.replace(
        "# FILL IN, without the #: position: {column: q, unit: deg, wraps: true}", "position: {column: 1, unit: rad}"
    )
    (tmp_path / "draft.yaml").write_text(text)
    assert read_runs(_load(tmp_path))[0].record.time.size == _T.size
    assert '"pos_\\U0001F600 [rad]"' in text


def test_a_file_name_with_a_line_end_is_refused(tmp_path: Path) -> None:
    """A file name that holds a control character is refused by the draft, as by the experiment file that would name it."""
    path = _csv(tmp_path / "a\nb.csv", "t,q", _T, _Q)
    with pytest.raises(InputError, match=r"U\+000A"):
        draft_experiment(path)


def test_a_draft_of_very_many_columns_is_short(tmp_path: Path) -> None:
    """A wide file gives a draft that can be loaded: what was found, and the first names; a name that repeats or is very long is never guessed."""
    names = [
        "t [s]",
        "q [rad]",
        "tau [Nm]",
        *(f"c{k}" for k in range(3000)),
        "v" * 5000 + "[" * 5000,
        *["dq [rad/s]"] * 3000,
    ]
    path = tmp_path / "wide.csv"
    rows = [
        ",".join([f"{t}", f"{q}", f"{tau}", *["0"] * (len(names) - 3)])
        for t, q, tau in zip(_T[:3], _Q[:3], _TAU[:3], strict=True)
    ]
    path.write_text("\n".join([",".join(names), *rows]))
    text, _ = draft_experiment(path)
    assert len(text) < 10_000
    assert "velocity" not in text.split("signals:")[1]
    (tmp_path / "draft.yaml").write_text(text)
    assert _load(tmp_path).signals.torque is not None


def test_bad_files_are_refused(tmp_path: Path) -> None:
    """What cannot be read cannot be drafted: one sentence."""
    with pytest.raises(ValueError, match="no such file"):
        draft_experiment(tmp_path / "none.csv")
    (tmp_path / "empty.csv").write_text("")
    with pytest.raises(ValueError, match="empty"):
        draft_experiment(tmp_path / "empty.csv")
