import math
import os
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bristle.data.constant_velocity.segments import Thresholds
from bristle.data.experiment.load import load_experiment, read_runs
from bristle.data.experiment.schema import FitOptions, PlusMinus
from bristle.data.experiment.yaml_file import parse
from bristle.errors import InputError

from .experiments import assert_refused, experiment, signals_with


def written(text: str) -> dict[str, Any]:
    """Keys of an experiment file as they are written, where `signals.torque` changes one signal of those that there are."""
    keys: dict[str, Any] = yaml.safe_load(text)
    signals = {key.removeprefix("signals."): keys.pop(key) for key in [*keys] if str(key).startswith("signals.")}
    return keys | ({"signals": signals_with(**signals)} if signals else {})


def test_everything_in_si(tmp_path: Path) -> None:
    """Each quantity of the file arrives in SI, with the defaults for what is not given."""
    e = experiment(
        tmp_path,
        motor={"torque_constant": "350 mNm/A", "resistance": "2.1 ohm"},
        inertia="0.0089 ± 0.0004 kg*m^2",
        encoder_resolution="4096 counts/rev",
        segments={"minimum_duration": "500 ms", "minimum_velocity": "1 deg/s"},
        fit={"position_cutoff": "0.05 kHz"},
        truth={"+": {"alpha_0": "0.4 N*m", "alpha_1": "100 mNm", "alpha_2": "0.7 N*m*s/rad", "v_s": "0.1 rad/s"}},
        simulated=True,
        assumptions=["k_t is assumed"],
    )
    assert e.motor is not None
    assert e.motor[:3] == pytest.approx((0.35, 2.1, 0.0))
    assert math.isnan(e.motor.J)
    assert e.inertia == PlusMinus(value=0.0089, standard_error=0.0004)
    assert e.encoder_resolution == pytest.approx(2 * np.pi / 4096)
    assert isinstance(e.segments, Thresholds)
    assert (e.segments.minimum_duration, e.segments.torque_limit) == (0.5, None)
    assert e.segments.minimum_velocity == pytest.approx(np.pi / 180)
    assert (e.fit.position_cutoff, e.fit.decimation, e.fit.set_up, e.fit.regressors) == (50.0, None, "auto", None)
    assert e.truth["+"][:4] == pytest.approx((0.4, 0.1, 0.7, 0.1))
    assert math.isnan(e.truth["+"].sigma_0)
    assert e.path == tmp_path / "experiment.yaml"
    assert (
        FitOptions(position_cutoff=40.0).position_cutoff == 40.0
    )  # outside a file, where no unit can be written wrongly


_BAD: dict[str, str] = {
    "sigals: {}": r"unknown key 'sigals'; did you mean 'signals'\?",
    "joint: {name: a, knd: revolute}": r"unknown key 'joint\.knd'; did you mean 'kind'\?",
    "int: {}": r"unknown key 'int'; did you mean 'joint'",  # a type's name is no key
    "path: x": "unknown key 'path'",
    "joint: {}": r"joint\.name: missing",
    "joint: {name: a, kind: ball}": r"joint\.kind: got 'ball'; expected 'revolute' or 'prismatic'",
    "joint: {name: a, kind: prismatic}": r"signals\.position: unit 'rad' is not a unit of m",
    'joint: {name: "a\\x9b"}': r"joint\.name: the text 'a\\x9b' holds U\+009B",
    "inertia: 0.01": r"inertia: got 0\.01; expected a number with its unit",
    "inertia: -1 kg*m^2": "inertia: .*expected a positive inertia",
    "inertia: 1 ± 0 kg*m^2": "inertia: .*positive standard error",
    "inertia: 1e400 kg*m^2": "inertia: got '1e400 .*expected a finite size",
    "inertia: 0.05 +/- 1e400 kg*m^2": "inertia: got .*expected a finite size",
    "inertia: 1 Qm**9*Qm**9": "inertia: unit .* is too large or too small",
    "motor: {torque_constant: 3 ohm}": r"motor\.torque_constant: unit 'ohm' is not a unit of N\*m/A",
    "motor: {torque_constant: 0 N*m/A}": r"motor\.torque_constant: got '0 N\*m/A'; expected greater than 0",
    "motor: {torque_constant: 0.35 +/- 0.4 N*m/A}": (
        r"motor\.torque_constant: got '0\.35 \+/- 0\.4 N\*m/A'; expected an error that is smaller than the constant"
    ),
    "signals.torque: {column: 1, unit: Nmm2x}": r"signals\.torque: unit 'Nmm2x' is not known",
    "signals.torque: {column: true, unit: N*m}": r"signals\.torque\.column: got True",
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
    "{signals.torque: null, signals.voltage: {column: 1, unit: V}, motor: {torque_constant: 1 N*m/A}}": r"needs motor\.resistance",
    "signals.current: {column: 1, unit: A}": "signals: got torque and current; expected exactly one",
    "signals.command: {column: 1, unit: rad}": "signals: got torque and command; expected exactly one of .*, or command",
    "{signals.torque: null, signals.command: {column: 1, unit: rad}, motor: {kd: 1 N*m*s/rad}}": r"needs motor\.kp .* a share of kp",
    "{signals.torque: null, signals.command: {column: 1, unit: rad}, signals.velocity_command: {column: 1, unit: rad/s}}": r"needs motor\.kp",
    "gravity: 1 N*m": r"runs\.0: gravity: a known gravity scales a voltage, a current or a command without constants under motor",
    "gravity: {mass: 1 kg, centre: -1 m}": r"gravity\.centre: got '-1 m'; expected greater than 0",
    "{signals.torque: null, signals.velocity_command: {column: 1, unit: rad/s}}": r"runs\.0: .* needs motor\.kd",
    "{signals.torque: null, signals.velocity_command: {column: 1, unit: rad/s, delay: 1 ms}}": "velocity_command: got a delay; expected",
    "motor: {kp: 20 +/- 1 N*m/rad, kd: 1 +/- 0.1 N*m*s/rad}": r"motor\.kd: got an error; expected it with kp",
    "signals.torque: {column: 1, unit: N*m, scale: 35 N*m/V}": "expected unit: V, of which this scale makes N",
    "signals.velocity: {column: 1, unit: Hz}": r"signals\.velocity: unit 'Hz' is not a unit of rad/s",
    "signals.position: {column: 1, unit: counts}": "needs encoder_resolution",
    "signals.position: {column: 1, unit: rad, scale: 2 +/- 0.1}": (
        r"signals\.position: scale: got '2 \+/- 0\.1'; expected no error: only that of torque, voltage or current"
    ),
    "signals.position: {column: 1, unit: rad, wraps: 3 s}": r"signals\.position: unit 's' is not a unit of rad",
    "signals.position:": r"runs\.0: no position",
    "signals.time:": r"runs\.0: no time",
    "signals.time: {column: t, unit: s, rate: 1 Hz}": r"signals\.time: expected either",
    "runs: []": "runs: got .*; expected at least one entry$",
    "runs: [{files: a, experiment: rampe}]": r"runs\.0\.experiment: got 'rampe'; expected 'ramp'.*'tracking'$",
    'runs: [{files: a, experiment: ramp, load: "5 kg\\u2067"}]': r"runs\.0\.load: .* holds U\+2067",
    'assumptions: ["a\\u2028b"]': r"assumptions\.0: .* holds U\+2028",
    "truth: {both: {}, '+': {}}": "truth",
    "fit: {3: 4}": r"fit\.3: got 3; expected a key that is text",
    "fit: {regressors: [offset]}": "fit.*offset cannot be told .* directions: symmetric",
    "fit: {position_cutoff: 1e999 Hz}": r"fit\.position_cutoff: .*finite",
    "fit: {position_cutoff: 1e300 Hz}": r"fit\.position_cutoff: .*expected a finite size",
    "fit: {fixed: {sigma_0: 0 N*m/rad}}": r"fit\.fixed: sigma_0: got 0; expected a value > 0",
    "fit: {fixed: {alpha_2-: -1 N*m*s/rad}}": r"fit\.fixed: alpha_2-: got -1; .* >= 0",
    "fit: {fixed: {inertia: -1 kg*m**2}}": r"fit\.fixed: inertia: got -1; .* > 0",
    "fit: {fixed: {offset: 1e400 N*m}}": r"fit\.fixed: got '1e400 N\*m'; .* finite",
    "fit: {fixed: {alpha_0: 1 N*m, alpha_0+: 2 N*m}}": r"fit\.fixed: got both alpha_0 and alpha_0\+",
    "fit: {fixed: {alpha_0+-: 1 N*m}}": r"fit\.fixed: got 'alpha_0\+-'; expected one of",
}


def test_bad_keys_are_refused(tmp_path: Path) -> None:
    """Each mistake in a file is one sentence that opens with the file and names the key and the fix."""
    asks = [(partial(experiment, tmp_path, **written(text)), says) for text, says in _BAD.items()]
    assert_refused(asks, str(tmp_path / "experiment.yaml"))


_FEW = "joint: {name: a}\nruns: [{files: a, experiment: ramp}]\n"


_MALFORMED = [
    ("joint: {name: a", "line 1"),
    ("a: 1\nb: [1,\nc: }", "line 3"),
    ("a: &x [1]\nb: *x", r"line 1.*anchors"),
    ("joint: {}\njoint: {}", "line 2.*'joint' is given twice"),
    ("[" * 100_000, "nested too deeply"),
    ("- 1\n- 2", "expected keys"),
    ("", "expected keys"),
    ("? [a]\n: 1", "line 1|cannot read|unknown key|in quotes"),
    ("a: 0000-99-99", "in quotes|unknown key"),
    ("x: " + "9" * 1_000_001, "larger than"),
    ("a: \x00", "not YAML"),
    ("".join(f"k{k}: 1\n" for k in range(50_000)), "line 5000.*more than 10000"),
    ("a: [" + "1," * 100_000 + "]", "more than 10000"),
    ("a: " + "1" * 500_000, "an integer of 500000 digits"),
    ("a: 0x" + "f" * 5_000, "an integer of 5002 digits"),
    ("a: !!timestamp x", "in quotes"),
    ('"' + "k" * 500_000 + '": 1', "line 1"),
    ("? " + "k" * 500_000 + "\n: 1", "unknown key 'kkk"),
    ("joint: {name: a}\nruns:\n" + "- {x: 1}\n" * 3_000, r"unknown key 'runs\.0\.x'.*and 8999 more"),
    (_FEW + "fit: {fixed: {sigma_0: '" + "1" * 500_000 + "'}}", "fit.fixed: got"),
    (_FEW + "inertia: '" + "1 kg +/- " * 50_000 + "'", "inertia: got"),
    (_FEW + "encoder_resolution: '" + "1 counts / " * 50_000 + "'", "encoder_resolution: got"),
    (_FEW + "signals: {torque: {column: a, unit: '" + "m*" * 200_000 + "'}}", "signals.torque: unit .* is not known"),
    (_FEW + "signals: {torque: {column: a, unit: N, scale: '" + "1" * 200_000 + "'}}", "signals.torque: scale '111"),
    ("joint: {name: a}\nruns: [{experiment: ramp, files: '" + "${a" * 100_000 + "'}]", "runs.0.files: got .*at most 4096"),
    ("? {a: b}\n: 1", "line 1"),
]  # fmt: skip  # a table


def test_malformed_yaml_is_refused(tmp_path: Path) -> None:
    """Malformed, hostile, huge and empty YAML is one short sentence within seconds, with the line where there is one."""
    asks = []
    for k, (text, says) in enumerate(_MALFORMED):
        (tmp_path / f"{k}.yaml").write_text(text)
        asks.append((partial(load_experiment, tmp_path / f"{k}.yaml"), says))
    (tmp_path / "binary.yaml").write_bytes(b"\xff\x00")
    paths = {"none.yaml": "no such file", ".": "is a folder", "binary.yaml": "not text"}
    asks += [(partial(load_experiment, tmp_path / name), says) for name, says in paths.items()]
    assert_refused(asks, str(tmp_path))


def test_hostile_file_names_are_refused(tmp_path: Path) -> None:
    """Names too long, with a NUL, or patterns that search for ever, and files with unprintable names, are one short sentence."""
    for name in ("ramp\x1b[2J.csv", os.fsdecode(b"slow\xff.csv"), "a" * 120):
        (tmp_path / name).write_text("t\n1\n")
    says = {
        "a" * 300: "runs: files 'aaa.* cannot be looked for",
        "a\0b.csv": r"'a\\x00b.csv' is not a file",
        "**/a/**/b/**/*.csv": r"has \*\* more than once",
        "*" * 2000 + "x": r"has \*\* more than once",
        "*a" * 60 + "b": "matches no file",
        "ramp*": r"file name 'ramp\\x1b\[2J.csv' holds U\+001B",
        "slow*": r"file name 'slow\\udcff.csv' holds U\+DCFF",
    }
    read = {files: experiment(tmp_path, runs=[{"files": files, "experiment": "tracking"}]) for files in says}
    assert_refused((partial(read_runs, read[files]), told) for files, told in says.items())


@given(st.text(max_size=2000))
def test_a_sentence_is_short_and_shown(text: str) -> None:
    """Whatever an error quotes, it is one line of at most 500 characters that a terminal shows."""
    said = str(InputError(f"beginning {text} end"))
    assert said.startswith("beginning ")
    assert said.endswith(" end")
    assert said.isprintable()
    assert len(said) <= 500


_ATOMS = (
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=8),
    st.sampled_from(["1 rad", "t", "tau", "1e999 m"]),
)
_PARTS, _KEYS = (
    ("column", "unit", "name", "files", "rate"),
    ("joint", "signals", "runs", "fit", "motor", "inertia", "truth", "segments", "cleaning"),
)
_values = st.recursive(
    st.one_of(*_ATOMS),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(_PARTS), inner, max_size=3),
    max_leaves=6,
)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.dictionaries(st.sampled_from(_KEYS), _values, max_size=3))
def test_any_values_are_refused_or_taken(tmp_path: Path, changes: dict[str, Any]) -> None:
    """No values at any key make the loader raise anything but InputError, in one line."""
    try:
        said = experiment(tmp_path, **changes).joint.name
    except InputError as error:
        said = str(error)
    assert "\n" not in said


_SPELT = [
    ("a: [1, , 2]", "line 1", "expected a value"),
    ("a: 1\n  b: 2", "line 2", "expected one key and one value"),
    ("a: {b: c\nd: e", "line 2", "expected a comma or }"),
    ("a: [1, 2\nb: 3", "line 2", "expected a comma or ]"),
    ("\ta: 1", "line 1", "indent with blanks instead of tabs"),
    ("a: 'x", "line 1", "expected the quote to be closed"),
    ("a: - b", "line 1", "begin the list"),
    ("joint: x\n runs: 2", "line 2", "expected one key"),
    ("- a\nb: c", "line 2", "as far to the right"),
    ("a: !!python/object:os.system x", "line 1", "without !"),
]


def test_yaml_is_told_in_plain_words() -> None:
    """What YAML cannot read is one sentence in a user's words: the line, what was got, what was expected, what to do; no word of the parser's."""
    its_own = r"(?!.*(node|token|block|scalar|stream|mapping|constructor))"
    asks = [
        (partial(parse, text, "e.yaml"), f"^{its_own}e.yaml: {at}, column .*: got .*{says}")
        for text, at, says in _SPELT
    ]
    assert_refused(asks)
