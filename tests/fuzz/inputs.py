"""Inputs that a hostile or an unlucky user gives: experiment files, logs and results, well formed in part, as Hypothesis strategies."""

import copy
import io
import json
import re
from collections.abc import Mapping
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import scipy.io
import yaml
from hypothesis import strategies as st

import bristle
from bristle.arrays import Array
from bristle.model.rollout import rollout
from bristle.simulation.edro import TABLE_1

Columns = Mapping[str, Array]
Draw = Any  # what Hypothesis calls its drawing function


class Case(NamedTuple):
    """One command line and the files that it finds."""

    arguments: tuple[str, ...]
    files: Mapping[str, bytes]

    def __repr__(self) -> str:
        files = {name: data if len(data) < 2000 else data[:2000] + b" ..." for name, data in self.files.items()}
        return f"bristle {' '.join(map(repr, self.arguments))}\n" + "\n".join(f"{n}:\n{d!r}" for n, d in files.items())


_EXTRA = ["h5"] if find_spec("h5py") else []  # formats that an extra reads
_STEP = 5e-3
_GRIPPER = TABLE_1["gripper rotation"].positive
_UNITS = {"t": "s", "q": "rad", "v": "rad/s", "tau": "N*m", "i": "A", "u": "V", "q_des": "rad"}
_SIGNALS = {
    "t": "time", "q": "position", "v": "velocity", "tau": "torque", "i": "current", "u": "voltage", "q_des": "command",
}  # fmt: skip  # a list of values


@cache
def logs() -> Mapping[str, Columns]:
    rng = np.random.default_rng(0)
    speeds = np.geomspace(0.015, 0.8, 12)
    points = np.concatenate([speeds, -speeds])
    t: Array = _STEP * np.arange(600.0)
    wave: Array = np.sum(
        [a * np.sin(2 * np.pi * f * t + f) for a, f in ((0.25, 0.4), (0.06, 1.3), (0.03, 4.1))], axis=0
    )
    held = np.repeat([0.02, 0.3, -0.3, -0.05, 0.1, 0.6, -0.6, -0.02], 75)
    load = 0.015 * np.sin(2 * np.pi * 0.33 * t)
    return {
        "points": {"v": points, "tau": rollout_torque(points) + 2e-5 * rng.standard_normal(points.size)},
        "ramp": _logged(t, held, rollout_torque(held), rng),
        "tracking": _logged(t, wave, rollout(wave, _STEP, _GRIPPER).torque + 1.3e-3 * np.gradient(wave, t), rng),
        "presliding": _logged(t, np.gradient(load / _GRIPPER.sigma_0, t), load, rng, load / _GRIPPER.sigma_0),
    }


def rollout_torque(velocity: Array) -> Array:
    """Steady torque of the gripper, N*m, shape of velocity (rad/s)."""
    p = _GRIPPER
    return np.asarray(
        np.sign(velocity) * (p.alpha_0 + p.alpha_1 * np.exp(-((velocity / p.v_s) ** 2))) + p.alpha_2 * velocity
    )


def _logged(t: Array, v: Array, tau: Array, rng: np.random.Generator, q: Array | None = None) -> Columns:
    noisy = tau + 2e-5 * rng.standard_normal(t.size)
    position = np.cumsum(v) * _STEP if q is None else q
    drives = {"tau": noisy, "i": noisy / 0.35, "u": noisy / 0.35 * 2.1 + 0.35 * v, "q_des": position + noisy / 2}
    return {"t": t, "q": position, "v": v, **drives}


NAMES = st.one_of(
    st.sampled_from([
        "wrist", "", " ", "a-curve", "verdict", "<script>alert(1)</script>", r"\074script\076", r"\q \g<0>", r"$\undefined{",
        "=1+1", "@SUM(A1)", "a\0b", "a\x1bb", "\u202egnp", "\ud800", "../../x", "ä" * 300, "{{ 7*7 }}", "%s%n", "-", "+", "a\nb",
    ]),
    st.text(max_size=12),
)  # fmt: skip  # a list of names
NUMBERS = st.one_of(
    st.sampled_from([0, -1, 1, 2, 1e-300, 1e300, 1e-160, 1e160, 5e-324, 10**400, float("inf"), float("nan"), 1e5]),
    st.floats(width=64),
    st.integers(),
)
_TEXT_UNITS = st.sampled_from([
    "rad", "rad/s", "N*m", "N*m*s/rad", "N*m/rad", "kg*m**2", "s", "Hz", "A", "V", "ohm", "H", "N*m/A", "m", "deg", "rpm", "%", "counts", "",
    "counts/rev", "degC", "dB", "m**2**9", "rad ± 1 rad", "N*m +/- 1e400 N*m", "kg*m**2 +/- 0 kg*m**2", "1/s", "__import__", "e", "µm",
])  # fmt: skip  # a list of units


@st.composite
def quantities(draw: Draw) -> str:
    number = draw(
        st.one_of(NUMBERS.map(repr), st.sampled_from(["1e400", "-1e400", "0.35", "1", "9" * 300, "1" * 5000 + "x"]))
    )
    return f"{number}{draw(st.sampled_from(['', ' ', '  ']))}{draw(_TEXT_UNITS)}"


ODD = st.one_of(
    NUMBERS, NAMES, quantities(), st.none(), st.booleans(), st.lists(NUMBERS, max_size=3), st.binary(max_size=4), st.dates(),
    st.dictionaries(st.one_of(NAMES, st.integers()), NUMBERS, max_size=2), st.text(alphabet="(.*+ ", max_size=400),
)  # fmt: skip  # a list of strategies
_POSITIVE = st.one_of(st.floats(1e-4, 1e4), st.sampled_from([1e-300, 1e300, 1e-12, 1e12, 1.0]))


PLAUSIBLE: Mapping[str, Any] = yaml.safe_load("""
joint: {kind: prismatic}
motor: {torque_constant: 0.35 +/- 0.01 N*m/A, resistance: 2.1 +/- 0.1 ohm, inductance: 3 mH, inertia: 1e-6 kg*m**2, kp: 2 +/- 0.1 N*m/rad,
  kd: 0.1 N*m*s/rad, torque_limit: 0.02 N*m, gear: {ratio: -10, position: motor, velocity: joint, torque: joint}}
coasting: {gravity: 0.1 N*m}
gravity: {mass: 0.4 +/- 0.1 kg, centre: 90 mm}
inertia: 0.0013 +/- 0.001 kg*m**2
encoder_resolution: 4096 counts/rev
segments: {minimum_duration: 0.1 s, velocity_tolerance: 0.1, minimum_velocity: 0.01 rad/s}
cleaning: {backward: drop, gap: 5, times: as-written}
fit: {directions: symmetric, set_up: as-written, law: lorentzian+quadratic, stray: drop, regressors: [inertia, offset, gravity, quadratic],
  exclude: [{file: points.csv, rows: 2-5}], position_cutoff: 10 Hz, breakaway_displacement: 0.01 rad, decimation: 10, predict: position,
  fixed: {alpha_0+: 0.02 N*m, alpha_1: 0.01 N*m, v_s: 0.07 rad/s, sigma_0: 6 N*m/rad, sigma_1: 0.02 N*m*s/rad}}
signals: {torque: {scale: 2 +/- 0.1, delay: 1 ms, time: {column: t, unit: ms}}, position: {wraps: 1 rad}, command: {held: true, delay: 1 ms},
  time: {rate: 200 Hz}}
simulated: true
assumptions: [assumed]
truth: {both: {alpha_0: 0.02 N*m, alpha_1: 0.005 N*m, alpha_2: 0.04 N*m*s/rad, v_s: 0.07 rad/s}}
adapt: {amplitude: 0.1 rad, frequency: 1 Hz, gamma: [1, 2], start: {alpha_0: 0.3}}
plan: {position: [-1 rad, 1 rad], velocity: 1 rad/s, time: 30 s, rate: 100 Hz}
""")
"""Keys that an experiment file may well have, of which some are put into one, with extremes for their numbers."""
_NUMBER = re.compile(r"(?<![\w*.])\d[\d.e-]*")


@st.composite
def extreme(draw: Draw, value: Any) -> Any:
    """The value, or one like it with another number."""
    if isinstance(value, dict):
        kept = draw(st.lists(st.sampled_from(sorted(value)), min_size=1, max_size=3, unique=True))
        return {key: draw(extreme(value[key])) for key in kept}
    if isinstance(value, list):
        return [draw(extreme(x)) for x in value[: draw(st.integers(0, len(value)))]]
    if isinstance(value, bool) or draw(st.booleans()):
        return value
    if isinstance(value, int | float):
        return draw(st.one_of(NUMBERS, _POSITIVE))
    return _NUMBER.sub(lambda _: repr(draw(_POSITIVE)), value)


@st.composite
def tables(draw: Draw, kind: str) -> Columns:
    columns = dict(logs()[kind])
    for _ in range(draw(st.integers(0, 2))):
        columns = draw(_spoilt(columns))
    return columns


@st.composite
def _spoilt(draw: Draw, columns: Columns) -> Columns:
    name, rng = draw(st.sampled_from(sorted(columns))), np.random.default_rng(draw(st.integers(0, 99)))
    x = np.array(columns[name], dtype=float)
    rows, step = np.arange(x.size), (np.ptp(x) if x.size else 0) or 1.0
    cells = rng.integers(0, max(x.size, 1), draw(st.sampled_from([0, 1, 3, 300]))) % max(x.size, 1)
    with np.errstate(all="ignore"):
        changes = (
            x * draw(st.sampled_from([1e-300, 1e-160, 1e-9, 1e-3, 57.3, -1.0, 1e6, 1e160, 1e300, 0.0])),
            x + draw(st.sampled_from([1e-9, 1e-2, 1e3])) * rng.standard_normal(x.size),
            x + draw(st.sampled_from([1e-3, 1.0, 1e15])), np.round(x / step * 10) * step / 10, np.abs(x),
            np.full(x.size, draw(st.sampled_from([0.0, 1.0, -1e-9, 1e9]))),
            np.where(np.isin(rows, cells), draw(NUMBERS.map(float_or_inf)), x),
        )  # fmt: skip  # a list of values
    cut = rows[: draw(st.sampled_from([0, 1, 2, 3, 7, 40]))]
    kept = draw(st.sampled_from([rows, rows, rows, np.repeat(rows, 2), cut, rng.permutation(rows)]))
    return {key: np.asarray(value)[kept] for key, value in {**columns, name: draw(st.sampled_from(changes))}.items()}


def float_or_inf(x: float) -> float:
    """The number as a float; infinity where it is too large for one."""
    try:
        return float(x)
    except OverflowError:
        return float("inf")


@st.composite
def encoded(draw: Draw, columns: Columns, suffix: str) -> bytes:
    """A table as the bytes of a file of that kind, perhaps damaged."""
    frame, buffer = pd.DataFrame(columns), io.BytesIO()
    if suffix == "csv":
        above = draw(
            st.sampled_from([*[""] * 20, "# log\n", "s;rad;N*m\n", "\n\n", "a,b\n", "\ufeff", '"', "9" * 3000 + "x\n"])
        )
        table = frame.to_csv(index=False, sep=draw(st.sampled_from(",;\t")), header=draw(st.integers(0, 9)) > 0)
        buffer.write((above + table).encode(draw(st.sampled_from(["utf-8", "utf-8", "utf-16"]))))
    elif suffix == "npz":
        arrays: dict[str, Any] = dict(columns)
        np.savez(buffer, **arrays)
    elif suffix == "json":
        orient: Any = draw(st.sampled_from(["records", "list"]))
        buffer.write(json.dumps(frame.to_dict(orient=orient), default=float).encode())
    elif suffix == "mat":
        file: Any = buffer  # scipy-stubs knows of paths alone
        scipy.io.savemat(file, dict(columns), format=draw(st.sampled_from(["5", "4"])))
    elif suffix == "h5":
        import h5py

        with h5py.File(buffer, "w") as group:
            for name, values in columns.items():
                group[name] = values
    else:
        (frame.set_index(str(frame.columns[0])) if draw(st.booleans()) else frame).to_parquet(buffer)
    data = buffer.getvalue()
    return draw(damaged(data)) if draw(st.integers(0, 5)) == 0 else data


@st.composite
def damaged(draw: Draw, data: bytes) -> bytes:
    out = bytearray(data)
    pieces = st.one_of(st.binary(max_size=8), st.sampled_from([b"1" * 4000, b"\n", b"&a ", b": ", b"- ", b"{", b"nan"]))
    for _ in range(draw(st.integers(1, 4))):
        at, length = draw(st.integers(0, len(out))), draw(st.sampled_from([0, 1, 10, 1000, 10**9]))
        out[at : at + length] = draw(st.one_of(pieces, st.just(bytes(out[at : at + 200]))))
    return bytes(out)


@st.composite
def experiments(draw: Draw) -> dict[str, bytes]:
    kind = st.sampled_from(["points", "points", "ramp", "tracking", "presliding"])
    kinds = draw(st.lists(kind, min_size=1, max_size=2, unique=True))
    suffix = draw(st.sampled_from(["csv", "csv", "csv", "npz", "mat", "json", "parquet", *_EXTRA]))
    drive = "tau" if "points" in kinds else draw(st.sampled_from(["tau", "tau", "i", "u", "q_des"]))
    used = ("v", drive) if kinds == ["points"] else ("t", "q", "v", drive)
    if "points" not in kinds and draw(st.booleans()):
        used = ("t", "q", drive)
    constants = {"torque_constant": "0.35 N*m/A", "resistance": "2.1 ohm"}
    document: dict[str, Any] = {
        "joint": {"name": draw(st.one_of(st.just("wrist"), st.just("wrist"), NAMES))},
        "motor": {"kp": "2 N*m/rad"} if drive == "q_des" else constants,
        "signals": {_SIGNALS[c]: {"column": c, "unit": _UNITS[c]} for c in used},
        "runs": [{"files": f"{kind}.{suffix}", "experiment": kind} for kind in kinds],
    }
    if kinds != ["points"] and "points" in kinds:
        document["runs"][kinds.index("points")]["signals"] = {"time": {"rate": "1 Hz"}}
    for _ in range(draw(st.sampled_from([0, 0, 1, 1, 2, 3]))):
        key = draw(st.sampled_from(sorted(PLAUSIBLE)))
        _put(document, key, draw(extreme(PLAUSIBLE[key])))
    if draw(st.integers(0, 3)) == 0:
        key = draw(st.sampled_from([*PLAUSIBLE, "runs", "x"]))
        known = PLAUSIBLE.get(key)
        inner = draw(st.sampled_from([None, *(known if isinstance(known, dict) else ())]))
        _put(document, key, draw(ODD) if inner is None else {inner: draw(ODD)})
    text = yaml.safe_dump(document, allow_unicode=draw(st.booleans())).encode("utf-8", "surrogatepass")
    files = {"e.yaml": draw(damaged(text)) if draw(st.integers(0, 9)) == 0 else text}
    for kind in kinds:
        files[f"{kind}.{suffix}"] = draw(encoded(draw(tables(kind)), suffix))
    return files


def _put(document: dict[str, Any], key: str, value: Any) -> None:
    """Set a key; of one with keys of its own these, one level down too."""
    old = document.get(key)
    if isinstance(old, dict) and isinstance(value, dict):
        for name, inner in value.items():
            _put(old, name, inner)
    else:
        document[key] = value


@st.composite
def results(draw: Draw, whole: str) -> bytes:
    """A results file with a few of its values changed, numbers that no joint has among them, or bytes of it damaged."""
    document = json.loads(whole)
    for _ in range(draw(st.integers(0, 3))):
        node: Any = document
        for _ in range(draw(st.integers(1, 8))):
            keys: list[Any] = sorted(node) if isinstance(node, dict) else list(range(len(node)))
            if not keys:
                break
            key = draw(st.sampled_from(keys))
            if not isinstance(node[key], dict | list) or draw(st.integers(0, 9)) == 0:
                if draw(st.booleans()):
                    node[key] = copy.deepcopy(draw(JSON))  # a later mutation must not reach what others draw
                elif isinstance(node, dict):
                    node[draw(NAMES)] = node.pop(key)
                else:
                    del node[key]
                break
            node = node[key]
    text = json.dumps(document)
    data = text.encode("utf-8", "surrogatepass")
    return draw(damaged(data)) if draw(st.integers(0, 7)) == 0 else data


@st.composite
def options(draw: Draw, files: list[str]) -> str:
    names = st.one_of(st.sampled_from([*_SIGNALS, "q[0]", "q[1]", "9", *(f"{name}:tau" for name in files)]), NAMES)
    signal = draw(st.sampled_from([*_SIGNALS.values(), "velocity_command", "enabled", "x"]))
    of_signals = {
        "column": names,
        "unit": st.sampled_from([*_UNITS.values(), "deg", "rpm", "ms", "m**9"]),
        "scale": quantities(),
    }
    told = {
        "rate": "1 kHz", "torque-constant": "0.35 N*m/A", "resistance": "2 ohm", "kp": "2 N*m/rad", "kd": "1 N*m*s/rad", "torque-limit": "1 N*m",
        "gear": "ratio: 10, position: motor", "inertia": "0.001 kg*m**2", "gravity": "mass: 1 kg, centre: 2 mm", "directions": "symmetric",
        "name": "wrist", "hold-out": files[-1],
    }  # fmt: skip  # a table
    flag = draw(st.sampled_from([*of_signals, *told, "coasting", "held", "not-held"]))
    if flag in of_signals:
        return f"--{flag}={signal}={draw(of_signals[flag])}"
    if flag not in told:
        return f"--{flag}"
    return (
        f"--{flag}={told[flag] if draw(st.booleans()) else draw(st.one_of(NAMES, quantities(), st.just('arm.urdf')))}"
    )


JSON = st.one_of(
    NUMBERS, NAMES, st.none(), st.booleans(), st.just([]), st.just({}), st.lists(NUMBERS, max_size=3),
    st.sampled_from(["inf", "-inf", "nan", "static", [[1.0]], [[None, 1e308], [1e-308, 0]]]),
)  # fmt: skip  # a list of strategies


@st.composite
def cases(draw: Draw, good_results: str) -> Case:
    what = draw(st.sampled_from(["experiment"] * 18 + ["compare", "new", "log", "read"] * 4))
    if what == "compare":
        pair = {"a.json": good_results.encode(), "b.json": draw(results(good_results))}
        names = ("a.json", "b.json") if draw(st.booleans()) else ("b.json", "a.json")
        page = ("-o", "out") if draw(st.integers(0, 9)) == 0 else ()
        return Case(("compare", *names, *page), pair)
    if what == "read":
        files = {
            f"{kind}.csv": pd.DataFrame(logs()[kind]).to_csv(index=False).encode() for kind in ("points", "tracking")
        }
        return Case(draw(st.sampled_from(_READING)), {**files, "r.json": draw(results(good_results))})
    files = draw(experiments())
    if what == "log":
        log = draw(st.sampled_from(sorted(name for name in files if name != "e.yaml")))
        told = draw(st.lists(options(sorted(files)), max_size=3))
        return Case(("identify", log, *told, "-o", "out.json"), files)
    if what == "new":
        return Case(("new", draw(st.sampled_from(sorted(files))), "-o", "out.yaml"), files)
    command = draw(st.sampled_from(_COMMANDS))
    return Case(command, files)


_COMMANDS: list[tuple[str, ...]] = (
    [("identify", "e.yaml", "-o", "out.json")] * 16
    + [("identify", "e.yaml", "--strict"), ("inspect", "e.yaml"), ("inspect", "e.yaml")]
    + [("inspect", "e.yaml", "-o", "out.png"), ("report", "e.yaml", "-o", "out"), ("plan", "e.yaml", "-o", "out.csv")]
    + [("sensitivity", "e.yaml", "--samples", "0", "-o", "out"), ("adapt", "e.yaml", "-o", "out")]
    + [("validate", "e.yaml", "--repetitions", "20", "--starts", "2", "-o", "out")]
)


_EXPORTS = [
    "c.h", "mujoco.xml", "mujoco-frictionloss.xml", "urdf.urdf", "sdf.sdf", "isaac.py", "json.json", "matlab.m",
    "latex.tex",
]  # fmt: skip  # a list of values
"""Targets, with the suffix that each is written with."""
_READING: list[tuple[str, ...]] = [
    ("inspect", "r.json"), ("report", "r.json", "-o", "out"), ("plan", "r.json", "-o", "out.csv"),
    ("sensitivity", "r.json", "--samples", "0", "-o", "out"), ("explore", "r.json", "-o", "out.html"),
    ("adapt", "r.json", "-o", "out"),
    *(("export", "r.json", "--to", Path(x).stem, "-o", f"out{Path(x).suffix}") for x in _EXPORTS),
    ("validate", "r.json", "--repetitions", "20", "--starts", "2", "-o", "out"),
]  # fmt: skip  # a list of values


_EXPERIMENT = """
joint: {name: wrist}
signals:
  velocity: {column: v, unit: rad/s}
  torque: {column: tau, unit: N*m}
runs:
  - {files: points.csv, experiment: points}
  - files: tracking.csv
    experiment: tracking
    signals: {time: {column: t, unit: s}, position: {column: q, unit: rad}}
fit: {decimation: 2}
"""


def good_results(folder: Path) -> str:
    """The text of a results file with static fits and fits of moving runs."""
    for kind in ("points", "tracking"):
        pd.DataFrame(logs()[kind]).to_csv(folder / f"{kind}.csv", index=False)
    (folder / "e.yaml").write_text(_EXPERIMENT, encoding="utf-8")
    return bristle.identify(folder / "e.yaml").to_json(folder)
