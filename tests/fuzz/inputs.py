"""Inputs that a hostile or an unlucky user gives: experiment files, logs and results, well formed in part, as Hypothesis strategies."""

import copy
import io
import json
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


_FLEETS = ["fleet"] if find_spec("distributed") else []  # commands that an extra brings
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


def _of(unit: str) -> st.SearchStrategy[str]:
    return _POSITIVE.map(lambda x: f"{x!r} {unit}")


def _of_or_uncertain(unit: str) -> st.SearchStrategy[str]:
    return st.one_of(_of(unit), st.tuples(_POSITIVE, _POSITIVE).map(lambda x: f"{x[0]!r} +/- {x[1]!r} {unit}"))


PLAUSIBLE: Mapping[str, st.SearchStrategy[Any]] = {
    "joint.kind": st.sampled_from(["revolute", "prismatic"]),
    "joint.name": NAMES,
    "motor.torque_constant": _of_or_uncertain("N*m/A"),
    "motor.resistance": _of_or_uncertain("ohm"),
    "motor.inductance": _of("H"),
    "motor.inertia": _of("kg*m**2"),
    "motor": st.sampled_from([None, {"kp": "2 N*m/rad"}, {"kp": "2 +/- 0.1 N*m/rad", "kd": "0.1 N*m*s/rad", "torque_limit": "0.02 N*m"}]),
    "motor.kp": _of_or_uncertain("N*m/rad"),
    "motor.kd": _of_or_uncertain("N*m*s/rad"),
    "motor.torque_limit": _of("N*m"),
    "coasting": st.one_of(st.booleans(), _of_or_uncertain("N*m").map(lambda x: {"gravity": x}), _of("kg*m**2").map(lambda x: {"inertia": x})),
    "gravity": st.one_of(_of_or_uncertain("N*m"), st.tuples(_of_or_uncertain("kg"), _of("m")).map(lambda x: {"mass": x[0], "centre": x[1]})),
    "signals.command.held": st.booleans(),
    "signals.command.delay": _of("s"),
    "motor.gear": st.fixed_dictionaries(
        {"ratio": st.one_of(NUMBERS, _POSITIVE, quantities())},
        optional=dict.fromkeys(("position", "velocity", "torque"), st.sampled_from(["motor", "joint"])),
    ),
    "inertia": _of_or_uncertain("kg*m**2"),
    "encoder_resolution": st.one_of(_of("rad"), st.just("4096 counts/rev")),
    "segments.minimum_duration": _of("s"),
    "segments.velocity_tolerance": st.floats(0.001, 0.999),
    "segments.torque_limit": _of("N*m"),
    "segments.minimum_velocity": _of("rad/s"),
    "cleaning.non_finite": st.sampled_from(["drop", "refuse"]),
    "cleaning.gap": _POSITIVE,
    "fit.directions": st.sampled_from(["separate", "symmetric"]),
    "fit.set_up": st.sampled_from(["auto", "as-written"]),
    "fit.law": st.sampled_from(["auto", "paper", "coulomb-viscous", "lorentzian+quadratic"]),
    "fit.stray": st.sampled_from(["report", "drop"]),  # as earlier versions had it
    "fit.regressors": st.lists(st.sampled_from(["inertia", "offset", "gravity", "quadratic"]), max_size=4),
    "fit.exclude": st.tuples(st.sampled_from(["points.csv", "tracking.csv"]), st.sampled_from([2, "2", "2-5", "3-1", "0"])).map(
        lambda x: [{"file": x[0], "rows": x[1]}]
    ),
    "fit.position_cutoff": _of("Hz"),
    "fit.breakaway_displacement": _of("rad"),
    "fit.fixed": st.dictionaries(
        st.sampled_from(["alpha_0", "alpha_0+", "alpha_1-", "v_s", "sigma_0", "sigma_1", "sigma_1+", "inertia", "offset", "gravity_sin"]),
        quantities(), max_size=2,
    ),
    "fit.decimation": st.sampled_from([1, 2, 5, 10, 300, 10_000]),
    "signals.torque.scale": st.one_of(_POSITIVE, _of_or_uncertain("N*m/A"), NUMBERS),
    "signals.torque.delay": _of("s"),
    "signals.torque.time": st.one_of(st.sampled_from(["t", 0, 1]), st.just({"column": "t", "unit": "ms"}), NAMES),
    "signals.position.wraps": st.one_of(st.booleans(), _of("rad")),
    "signals.time": st.one_of(_of("Hz").map(lambda x: {"rate": x}), st.just({"column": 0, "unit": "ms"})),
    "simulated": st.booleans(),
    "assumptions": st.lists(NAMES, max_size=2),
    "truth": st.just({"both": {"alpha_0": "0.02 N*m", "alpha_1": "0.005 N*m", "alpha_2": "0.04 N*m*s/rad", "v_s": "0.07 rad/s"}}),
    "adapt.amplitude": _of("rad"),
    "adapt.frequency": _of("Hz"),
    "adapt.gamma": st.lists(NUMBERS, max_size=3),
    "adapt.start": st.dictionaries(NAMES, NUMBERS, max_size=2),
    "plan.position": st.tuples(_of("rad"), _of("rad")).map(list),
    "plan.velocity": _of("rad/s"),
    "plan.time": _of("s"),
    "plan.rate": _of("Hz"),
}  # fmt: skip  # a table
"""Values that the experiment file's keys may well have, and extremes of them."""


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
    how = draw(
        st.sampled_from(["scale", "cells", "noise", "constant", "rows", "coarse", "cut", "sign", "order", "offset"])
    )
    rows = np.arange(x.size)
    if how == "scale":
        with np.errstate(over="ignore"):
            x = x * draw(st.sampled_from([1e-300, 1e-160, 1e-80, 1e-9, 1e-3, 57.3, 1e6, 1e80, 1e160, 1e300, 0.0]))
    elif how == "cells" and x.size:
        x[rng.integers(0, x.size, draw(st.sampled_from([1, 3, x.size // 2])))] = draw(NUMBERS.map(float_or_inf))
    elif how == "noise":
        x = x + draw(st.sampled_from([1e-9, 1e-2, 1.0, 1e3])) * rng.standard_normal(x.size)
    elif how == "constant":
        x = np.full(x.size, draw(st.sampled_from([0.0, 1.0, -1e-9, 1e9])))
    elif how == "coarse" and x.size:
        step = draw(st.sampled_from([1.0, 0.1, 1e-2])) * (np.ptp(x) or 1.0)
        x = np.round(x / step) * step if np.isfinite(step) and step > 0 else x
    elif how == "sign":
        x = np.abs(x) if draw(st.booleans()) else -x
    elif how == "offset":
        x = x + draw(st.sampled_from([1e-3, 1.0, 1e6, 1e15]))
    elif how == "rows":
        rows = np.repeat(rows, 2)
    elif how == "cut":
        rows = rows[: draw(st.sampled_from([0, 1, 2, 3, 7, 40]))]
    elif how == "order":
        rows = rng.permutation(rows)
    out = {**columns, name: x}
    return {key: np.asarray(value)[rows] for key, value in out.items()}


def float_or_inf(x: float) -> float:
    """The number as a float; infinity where it is too large for one."""
    try:
        return float(x)
    except OverflowError:
        return float("inf")


@st.composite
def encoded(draw: Draw, columns: Columns, suffix: str) -> bytes:
    """A table as the bytes of a file of that kind, perhaps damaged."""
    frame = pd.DataFrame(columns)
    buffer = io.BytesIO()
    if suffix == "csv":
        text = frame.to_csv(
            index=False, sep=draw(st.sampled_from([",", ";", "\t"])), header=draw(st.integers(0, 9)) > 0
        )
        if draw(st.integers(0, 7)) == 0:
            text = (
                draw(st.sampled_from(["# log\n", "s;rad;N*m\n", "\n\n", "a,b\n", "\ufeff", '"', "9" * 3000 + "x\n"]))
                + text
            )
        buffer.write(text.encode(draw(st.sampled_from(["utf-8", "utf-8", "utf-16"]))))
    elif suffix == "npz":
        arrays: dict[str, Any] = dict(columns)
        np.savez(buffer, **arrays)
    elif suffix == "json":
        orient: Any = draw(st.sampled_from(["records", "list"]))
        shown = frame.to_dict(orient=orient)
        buffer.write(json.dumps(shown, default=float).encode())
    elif suffix == "mat":
        file: Any = buffer  # scipy-stubs knows of paths alone
        scipy.io.savemat(file, dict(columns), format=draw(st.sampled_from(["5", "4"])))
    elif suffix == "h5":
        import h5py

        with h5py.File(buffer, "w") as group:
            for name, values in columns.items():
                group[name] = values
    else:
        if draw(st.booleans()):
            frame = frame.set_index(str(frame.columns[0]))
        frame.to_parquet(buffer)
    data = buffer.getvalue()
    return draw(damaged(data)) if draw(st.integers(0, 5)) == 0 else data


@st.composite
def damaged(draw: Draw, data: bytes) -> bytes:
    out = bytearray(data)
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, max(len(out) - 1, 0)))
        how = draw(st.sampled_from(["change", "insert", "remove", "cut", "double"]))
        if how == "change" and out:
            out[at] = draw(st.integers(0, 255))
        elif how == "insert":
            out[at:at] = draw(
                st.one_of(
                    st.binary(max_size=8), st.sampled_from([b"1" * 4000, b"\n", b"&a ", b": ", b"- ", b"{", b"nan"])
                )
            )
        elif how == "remove":
            del out[at : at + draw(st.sampled_from([1, 10, 1000]))]
        elif how == "cut":
            del out[at:]
        else:
            out[at:at] = out[at : at + 200]
    return bytes(out)


@st.composite
def experiments(draw: Draw) -> dict[str, bytes]:
    kinds = draw(
        st.lists(
            st.sampled_from(["points", "points", "ramp", "tracking", "presliding"]), min_size=1, max_size=2, unique=True
        )
    )
    suffix = draw(st.sampled_from(["csv", "csv", "csv", "npz", "mat", "json", "parquet", *_EXTRA]))
    drive = "tau" if "points" in kinds else draw(st.sampled_from(["tau", "tau", "i", "u", "q_des"]))
    used = (
        ("v", drive)
        if kinds == ["points"]
        else ("t", "q", "v", drive)
        if draw(st.booleans()) or "points" in kinds
        else ("t", "q", drive)
    )
    document: dict[str, Any] = {
        "joint": {"name": draw(st.one_of(st.just("wrist"), st.just("wrist"), NAMES))},
        "motor": {"kp": "2 N*m/rad"}
        if drive == "q_des"
        else {"torque_constant": "0.35 N*m/A", "resistance": "2.1 ohm"},
        "signals": {_SIGNALS[c]: {"column": c, "unit": _UNITS[c]} for c in used},
        "runs": [{"files": f"{kind}.{suffix}", "experiment": kind} for kind in kinds],
    }
    if kinds != ["points"] and "points" in kinds:
        document["runs"][kinds.index("points")]["signals"] = {"time": {"rate": "1 Hz"}}
    for _ in range(draw(st.sampled_from([0, 0, 1, 1, 2, 3]))):
        key = draw(st.sampled_from(sorted(PLAUSIBLE)))
        _put(document, key.split("."), draw(PLAUSIBLE[key]))
    if draw(st.integers(0, 3)) == 0:
        key = draw(
            st.one_of(
                st.sampled_from(sorted(PLAUSIBLE)),
                st.sampled_from(["runs", "signals", "fit", "signals.velocity.unit", "x", "fit.gird"]),
            )
        )
        _put(document, key.split("."), draw(ODD))
    text = yaml.safe_dump(document, allow_unicode=draw(st.booleans())).encode("utf-8", "surrogatepass")
    files = {"e.yaml": draw(damaged(text)) if draw(st.integers(0, 9)) == 0 else text}
    for kind in kinds:
        files[f"{kind}.{suffix}"] = draw(encoded(draw(tables(kind)), suffix))
    return files


def _put(document: dict[str, Any], path: list[str], value: Any) -> None:
    for part in path[:-1]:
        inner = document.get(part)
        if not isinstance(inner, dict):
            inner = document[part] = {}
        document = inner
    document[path[-1]] = value


def _estimates(node: Any) -> list[dict[str, Any]]:
    inner = node.values() if isinstance(node, dict) else node if isinstance(node, list) else ()
    own = [node] if isinstance(node, dict) and {"value", "interval"} <= node.keys() else []
    return [*own, *(found for child in inner for found in _estimates(child))]


@st.composite
def results(draw: Draw, whole: str) -> bytes:
    """A results file with a few of its values changed, numbers that no joint has among them, or bytes of it damaged."""
    document = json.loads(whole)
    if draw(st.integers(0, 3)) == 0:
        forged, number = (
            draw(st.sampled_from(_estimates(document))),
            draw(st.sampled_from([0.0, -1.0, -1e-9, 1e300, 5e-324])),
        )
        forged |= {"value": number, "interval": draw(st.sampled_from([[number, number], forged["interval"], None]))}
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
    unit = draw(st.one_of(st.sampled_from([*_UNITS.values(), "deg", "rpm", "ms"]), _TEXT_UNITS))
    known: dict[str, st.SearchStrategy[str]] = {
        "column": names.map(lambda x: f"{signal}={x}"), "unit": st.just(f"{signal}={unit}"), "scale": quantities().map(lambda x: f"{signal}={x}"),
        "rate": _of("Hz"), "torque-constant": _of_or_uncertain("N*m/A"), "resistance": _of("ohm"), "kp": _of_or_uncertain("N*m/rad"),
        "kd": _of("N*m*s/rad"), "torque-limit": _of("N*m"), "gear": st.just("ratio: 10, position: motor"), "inertia": _of("kg*m**2"),
        "gravity": st.one_of(_of_or_uncertain("N*m"), st.sampled_from(["mass: 1 kg, centre: 2 mm", "{mass: 1 kg}", "arm.urdf", "e.yaml.urdf"])),
        "directions": st.sampled_from(["auto", "symmetric", "separate", "up"]), "name": NAMES, "hold-out": st.sampled_from(files),
    }  # fmt: skip  # a table
    flag = draw(st.sampled_from([*known, "coasting", "held", "not-held"]))
    if flag not in known:
        return f"--{flag}"
    value = draw(known[flag]) if draw(st.integers(0, 4)) else draw(st.one_of(NAMES, quantities()))
    return f"--{flag}={value}"


JSON = st.one_of(
    NUMBERS, NAMES, st.none(), st.booleans(), st.just([]), st.just({}), st.lists(NUMBERS, max_size=3),
    st.sampled_from(["inf", "-inf", "nan", "static", [[1.0]], [[None, 1e308], [1e-308, 0]]]),
)  # fmt: skip  # a list of strategies


@st.composite
def cases(draw: Draw, good_results: str) -> Case:
    what = draw(st.sampled_from(["experiment"] * 18 + ["compare", "new", "log", "read"] * 4 + _FLEETS))
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
    if what == "fleet":
        there = draw(st.sampled_from([{}, {}, {}, {"out/tasks/notes.txt": b"mine"}, {"out/ledger.json": b"mine"}]))
        return Case(
            ("fleet", "catalog.csv", "-o", "out", "--workers", "1"), {**files, **there, "catalog.csv": draw(catalogs())}
        )
    if what == "log":
        log = draw(st.sampled_from(sorted(name for name in files if name != "e.yaml")))
        told = draw(st.lists(options(sorted(files)), max_size=3))
        return Case(("identify", log, *told, "-o", "out.json"), files)
    if what == "new":
        return Case(("new", draw(st.sampled_from(sorted(files))), "-o", "out.yaml"), files)
    command = draw(st.sampled_from(_COMMANDS))
    return Case(command, files)


@st.composite
def catalogs(draw: Draw) -> bytes:
    """A catalog of a fleet as CSV, most rows of which name the experiment file."""
    columns = [
        "file",
        "unit",
        "session",
        *draw(st.lists(st.sampled_from(["joint", "type", "temperature", "load", "tags", "x"]), max_size=3)),
    ]
    odd = st.one_of(
        NAMES,
        NUMBERS.map(repr),
        st.sampled_from(["zip://e.yaml::e.yaml", "s3://", "http://[", "memory://x.yaml", "file://e.yaml"]),
    )
    good = {
        "file": st.just("e.yaml"),
        "unit": st.sampled_from(["r1", "r2"]),
        "session": st.dates().map(str),
        "temperature": st.just("21"),
    }
    usual = st.integers(0, 7)
    rows = [
        {name: draw(good.get(name, odd) if draw(usual) else odd) for name in columns}
        for _ in range(draw(st.integers(0, 4)))
    ]
    table = pd.DataFrame(
        rows, columns=columns if not rows else None, dtype=object
    )  # strings of pandas have no lone surrogate
    return table.to_csv(index=False).encode("utf-8", "surrogatepass")


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
