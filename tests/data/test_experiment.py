import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bristle.data.experiment import Experiment, FitOptions, Inertia, load_experiment
from bristle.data.steady import Thresholds

_BASE: dict[str, Any] = {
    "joint": {"name": "wrist", "kind": "revolute"},
    "signals": {
        "time": {"column": "t", "unit": "s"},
        "position": {"column": "q", "unit": "rad"},
        "torque": {"column": "tau", "unit": "N*m"},
    },
    "runs": [{"files": "log.csv", "experiment": "tracking"}],
}


def _experiment(folder: Path, **changes: Any) -> Experiment:
    path = folder / "experiment.yaml"
    path.write_text(yaml.safe_dump(_BASE | changes, allow_unicode=True), encoding="utf-8")
    return load_experiment(path)


def _signals(**changes: Any) -> dict[str, Any]:
    return {name: s for name, s in ({**_BASE["signals"]} | changes).items() if s is not None}


def test_everything_in_si(tmp_path: Path) -> None:
    """Each quantity of the file arrives in SI, with the defaults for what is not given."""
    e = _experiment(
        tmp_path,
        motor={"torque_constant": "350 mNm/A", "resistance": "2.1 ohm"},
        inertia="0.0089 ± 0.0004 kg*m^2",
        encoder_resolution="4096 counts/rev",
        segments={"minimum_duration": "500 ms", "minimum_velocity": "1 deg/s"},
        fit={"v_s_range": ["1 deg/s", "1 rad/s"], "position_cutoff": "0.05 kHz"},
        truth={"+": {"alpha_0": "0.4 N*m", "alpha_1": "100 mNm", "alpha_2": "0.7 N*m*s/rad", "v_s": "0.1 rad/s"}},
        simulated=True,
        assumptions=["k_t is assumed"],
    )
    assert e.motor is not None
    assert e.motor[:3] == pytest.approx((0.35, 2.1, 0.0))
    assert math.isnan(e.motor.J)
    assert e.inertia == Inertia(value=0.0089, standard_error=0.0004)
    assert e.encoder_resolution == pytest.approx(2 * np.pi / 4096)
    assert isinstance(e.segments, Thresholds)
    assert (e.segments.minimum_duration, e.segments.torque_limit) == (0.5, None)
    assert e.segments.minimum_velocity == pytest.approx(np.pi / 180)
    assert e.fit.v_s_range == pytest.approx((np.pi / 180, 1.0))
    assert (e.fit.position_cutoff, e.fit.velocity_cutoff, e.fit.grid, e.fit.regressors) == (50.0, 10.0, 32, None)
    assert e.truth["+"][:4] == pytest.approx((0.4, 0.1, 0.7, 0.1))
    assert math.isnan(e.truth["+"].sigma_0)
    assert e.path == tmp_path / "experiment.yaml"


def test_options_in_python_are_si_numbers() -> None:
    """Outside a file, where no unit can be written wrongly, numbers stand for SI values."""
    assert FitOptions(position_cutoff=40.0, v_s_range=(0.01, 1.0)).position_cutoff == 40.0


_BAD: dict[str, tuple[dict[str, Any], str]] = {
    "unknown key": ({"sigals": {}}, r"unknown key 'sigals'; did you mean 'signals'\?"),
    "unknown nested key": (
        {"joint": {"name": "a", "knd": "revolute"}},
        r"unknown key 'joint\.knd'; did you mean 'kind'\?",
    ),
    "path is ours": ({"path": "x"}, "unknown key 'path'"),
    "missing name": ({"joint": {}}, r"joint\.name: missing"),
    "kind": ({"joint": {"name": "a", "kind": "ball"}}, r"joint\.kind: got 'ball'; expected 'revolute' or 'prismatic'"),
    "bare number": ({"inertia": 0.01}, r"inertia: got 0\.01; expected a number with its unit"),
    "negative": ({"inertia": "-1 kg*m^2"}, "inertia: .*expected a positive inertia"),
    "no spread": ({"inertia": "1 ± 0 kg*m^2"}, "inertia: .*positive standard error"),
    "dimension": ({"motor": {"torque_constant": "3 ohm"}}, r"motor\.torque_constant: unit 'ohm' is no unit of N\*m/A"),
    "not positive": (
        {"motor": {"torque_constant": "0 N*m/A"}},
        r"motor\.torque_constant: got '0 N\*m/A'; expected greater than 0",
    ),
    "prismatic in rad": (
        {"joint": {"name": "a", "kind": "prismatic"}},
        r"signals\.position: unit 'rad' is no unit of m",
    ),
    "unknown unit": (
        {"signals": _signals(torque={"column": 1, "unit": "Nmm2x"})},
        r"signals\.torque: unit 'Nmm2x' is not known",
    ),
    "hertz": (
        {"signals": _signals(velocity={"column": 1, "unit": "Hz"})},
        r"signals\.velocity: unit 'Hz' is no unit of rad/s",
    ),
    "counts": ({"signals": _signals(position={"column": 1, "unit": "counts"})}, "needs encoder_resolution"),
    "two drives": (
        {"signals": _signals(current={"column": 1, "unit": "A"})},
        "signals: got torque and current; expected exactly one",
    ),
    "no drive": ({"signals": _signals(torque=None)}, r"runs\.0: no torque"),
    "no time": ({"signals": _signals(time=None)}, r"runs\.0: no time"),
    "both times": (
        {"signals": _signals(time={"column": "t", "unit": "s", "rate": "1 Hz"})},
        r"signals\.time: expected either",
    ),
    "no position": ({"signals": _signals(position=None)}, r"runs\.0: no position"),
    "no motor": (
        {"signals": _signals(torque=None, voltage={"column": 1, "unit": "V"})},
        r"needs motor\.torque_constant",
    ),
    "boolean column": (
        {"signals": _signals(torque={"column": True, "unit": "N*m"})},
        r"signals\.torque\.column: got True",
    ),
    "negative column": (
        {"signals": _signals(torque={"column": -1, "unit": "N*m"})},
        r"signals\.torque\.column: got -1; expected .* counted from 0",
    ),
    "no runs": ({"runs": []}, "runs: got .*; expected at least one entry$"),
    "run kind": (
        {"runs": [{"files": "a", "experiment": "rampe"}]},
        r"runs\.0\.experiment: got 'rampe'; expected 'ramp'.*'tracking'$",
    ),
    "collinear": ({"fit": {"regressors": ["offset"]}}, "fit.*offset cannot be told .* directions: symmetric"),
    "range": ({"fit": {"v_s_range": ["2 rad/s", "1 rad/s"]}}, "fit.*the smaller value first"),
    "truth": ({"truth": {"both": {}, "+": {}}}, r"truth"),
    "not finite": ({"fit": {"position_cutoff": "1e999 Hz"}}, r"fit\.position_cutoff: .*finite"),
    "wraps": (
        {"signals": _signals(position={"column": 1, "unit": "rad", "wraps": "3 s"})},
        r"signals\.position: unit 's' is no unit of rad",
    ),
}


@pytest.mark.parametrize("case", _BAD)
def test_bad_keys_are_refused(tmp_path: Path, case: str) -> None:
    """Each mistake in a file is one sentence that opens with the file and names the key and the fix."""
    changes, says = _BAD[case]
    with pytest.raises(ValueError, match=says) as caught:
        _experiment(tmp_path, **changes)
    assert str(caught.value).startswith(str(tmp_path / "experiment.yaml"))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("joint: {name: a", "line 1"),
        ("a: 1\nb: [1,\nc: }", "line 3"),
        ("a: &x [1]\nb: *x", r"line 1.*anchors"),
        ("joint: {}\njoint: {}", "line 2.*'joint' is given twice"),
        ("[" * 100_000, "nested too deeply"),
        ("a: !!python/object:os.system x", "line 1"),
        ("- 1\n- 2", "expected keys"),
        ("", "expected keys"),
        ("? [a]\n: 1", "line 1|cannot read|unknown key|in quotes"),
        ("a: 0000-99-99", "in quotes|unknown key"),
        ("x: " + "9" * 1_000_001, "larger than"),
        ("a: \x00", "not YAML"),
    ],
)
def test_malformed_yaml_is_refused(tmp_path: Path, text: str, says: str) -> None:
    """Malformed, hostile and empty YAML is one sentence, with the line where there is one, and cheap."""
    path = tmp_path / "experiment.yaml"
    path.write_text(text)
    with pytest.raises(ValueError, match=says) as caught:
        load_experiment(path)
    assert "\n" not in str(caught.value)


def test_bad_paths_are_refused(tmp_path: Path) -> None:
    """No file, a folder, and bytes that are no text."""
    for path, says in ((tmp_path / "none.yaml", "no such file"), (tmp_path, "is a folder")):
        with pytest.raises(ValueError, match=says):
            load_experiment(path)
    (tmp_path / "binary.yaml").write_bytes(b"\xff\x00")
    with pytest.raises(ValueError, match="not text"):
        load_experiment(tmp_path / "binary.yaml")


_values = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=8)
    | st.sampled_from(["1 rad", "t", "tau", "1e999 m"]),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.sampled_from(["column", "unit", "name", "files", "rate"]), inner, max_size=3)
    ),
    max_leaves=6,
)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.dictionaries(
        st.sampled_from(["joint", "signals", "runs", "fit", "motor", "inertia", "truth", "segments", "cleaning"]),
        _values,
        max_size=3,
    )
)
def test_any_values_are_refused_or_taken(tmp_path: Path, changes: dict[str, Any]) -> None:
    """No values at any key make the loader raise anything but ValueError."""
    assert _outcome(tmp_path, changes).count("\n") == 0


def _outcome(folder: Path, changes: dict[str, Any]) -> str:
    try:
        return _experiment(folder, **changes).joint.name
    except ValueError as error:
        return str(error)
