"""A commented experiment file, drafted from a data file.

Columns are guessed by their usual names, and what was not guessed is said.
"""

import os
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from bristle.data.binary_tables import names_of
from bristle.data.experiment.signals import DRIVE
from bristle.data.text_table import BINARY, naming, read_table, text_layout
from bristle.errors import check_name
from bristle.model.parameters import Kind
from bristle.model.parameters import unit as unit_of

_NAMES = {
    "time": ("t", "time", "timestamp", "stamp"),
    "position": ("q", "pos", "position", "angle", "theta"),
    "velocity": ("dq", "qd", "vel", "velocity", "speed", "omega", "qdot"),
    "torque": ("tau", "torque", "effort", "force"),
    "current": ("i", "current"),
    "voltage": ("u", "v_in", "voltage"),
}
_UNITS = {
    "time": {"s": "s", "sec": "s", "ms": "ms", "us": "us", "ns": "ns"},
    "position": {"rad": "rad", "deg": "deg", "mrad": "mrad", "rev": "rev", "m": "m", "mm": "mm", "um": "um"},
    "velocity": {
        **{f"{a}{sep}s": f"{a}/s" for a in ("rad", "deg", "mrad", "rev", "m", "mm") for sep in ("", "_", "/", "_per_")},
        "rpm": "rpm",
    },
    "torque": {"nm": "N*m", "n_m": "N*m", "n*m": "N*m", "mnm": "mNm", "n": "N", "kn": "kN"},
    "current": {"a": "A", "ma": "mA"},
    "voltage": {"v": "V", "mv": "mV"},
}
_LONGEST = 100
"""Characters of a column's name that may be a usual one."""
_SHOWN = 200
"""Columns that the draft lists."""
_LINEAR = {"m", "mm", "um", "m/s", "mm/s", "N", "kN"}
_KINDS = {
    "presliding": "presliding",
    "sigma": "presliding",
    "track": "tracking",
    "sine": "tracking",
    "traj": "tracking",
}
_EXAMPLES = {
    "time": "{column: t, unit: s}   # or {rate: 1 kHz}",
    "position": "{column: q, unit: deg, wraps: true}",
    "torque": "{column: tau, unit: N*m}   # or voltage: / current:, which need motor:",
}


@dataclass(frozen=True, slots=True)
class _Guess:
    column: str
    unit: str | None
    """None: not in the column's name."""


def draft_experiment(data_file: Path, folder: Path | None = None) -> tuple[str, tuple[str, ...]]:
    """The text of an experiment file for a data file, and a sentence on each thing not guessed or only assumed.

    Data files are named relative to `folder`, where the draft will be saved; None: beside the data. What is marked FILL
    IN must be filled in before the draft can be used. Raises InputError where the data file cannot be read.
    """
    check_name(data_file.name, f"{data_file}: the file name")
    names, described = _columns(data_file)
    guesses = _guesses(names)
    drive = next((name for name in DRIVE if name in guesses), None)
    linear = any(g.unit in _LINEAR for g in guesses.values()) or "force" in (
        guesses["torque"].column.lower() if "torque" in guesses else ""
    )
    kind: Kind = "prismatic" if linear else "revolute"
    run, unknown = _run_kind(data_file, guesses)
    unknown += [f"joint.kind; {kind} is assumed"]
    lines = [f"joint: {{name: {_text(data_file.stem[:200])}, kind: {kind}}}   # revolute or prismatic"]
    if drive in ("voltage", "current"):
        lines += [
            "# FILL IN, without the #; at the joint, gear included:",
            "# motor: {torque_constant: 0.35 N*m/A, resistance: 2.1 ohm}",
        ]
        unknown += [f"motor: torque from {drive} needs its constants; fill them in"]
    lines += [
        "# inertia: 0.0089 kg*m^2             # optional; x +/- s is a prior",
        "# encoder_resolution: 4096 counts/rev  # optional",
    ]
    lines += ["", f"# Columns of {_text(data_file.name)}: {described}", "signals:"]
    for name in ("time", "position", "velocity", drive or "torque"):
        wanted = name != "velocity" and not (run == "points" and name in ("time", "position"))
        guess = guesses.get(name)
        if guess is not None:
            lines.append(_signal(name, guess, kind, unknown))
        elif wanted and not (name == "position" and "velocity" in guesses):
            lines.append(f"  # FILL IN, without the #: {name}: {_EXAMPLES[name]}")
            unknown.append(f"{name}: no column has a usual name ({', '.join(_NAMES[name])}); fill it in under signals")
    shown = os.path.relpath(data_file, folder) if folder is not None else data_file.name
    lines += [
        "",
        "# experiment: ramp | points | presliding | tracking; hold_out: true keeps a run for validation",
        "runs:",
    ]
    lines += [f"  - {{files: {_text(Path(shown).as_posix())}, experiment: {run}}}"]
    lines += ["", "# fit: {directions: separate, loss: least-squares}   # all optional", ""]
    return "\n".join(lines), tuple(unknown)


def _columns(path: Path) -> tuple[tuple[str, ...], str]:
    """Names of the columns, and what is told of them in the draft."""
    with naming(str(path)):
        read_table(path, ())
        if path.suffix.lower() in BINARY:
            names = names_of(path)
            return names, _list(names) or "none that is a vector of numbers"
        layout = text_layout(path)
    if layout.names:
        return layout.names, _list(layout.names)
    some = layout.first[:_SHOWN]
    numbered = ", ".join(f"{k} (first value {_text(cell[:_LONGEST])})" for k, cell in enumerate(some) if cell)
    return (), f"no header; {numbered}{', ...' if len(layout.first) > _SHOWN else ''}"


def _list(names: tuple[str, ...]) -> str:
    return ", ".join([*(_text(name[:_LONGEST]) for name in names[:_SHOWN]), *["..."] * (len(names) > _SHOWN)])


def _guesses(names: tuple[str, ...]) -> dict[str, _Guess]:
    """The first column with a usual name, signal by signal; a column that repeats is none."""
    guesses: dict[str, _Guess] = {}
    once = [name for name, count in Counter(names).items() if count == 1 and len(name) <= _LONGEST]
    for name in once:
        bare, unit = _split(name)
        for signal, usual in _NAMES.items():
            for stem, suffix in _readings(bare, unit):
                known = _UNITS[signal].get(suffix) if suffix else None
                if stem in usual and (known or not suffix) and signal not in guesses:
                    guesses[signal] = _Guess(name, known)
    return guesses


def _split(name: str) -> tuple[str, str]:
    """`Torque [Nm]` as (torque, nm): the name after the last dot, and the unit in brackets."""
    last = name.rsplit(".", 1)[-1] if re.fullmatch(r"[\w.{}()]+", name) else name
    match = re.fullmatch(r"\s*(.*?)[\s_]*[\[(](.*?)[\])]\s*", last)
    bare, unit = (match[1], match[2]) if match else (last, "")
    return bare.strip().lower(), unit.strip().lower()


def _readings(bare: str, unit: str) -> list[tuple[str, str]]:
    """Each way to part a name from a unit: `dq_rad_s` is `dq_rad_s`, or `dq_rad` in s, or `dq` in rad_s."""
    if unit:
        return [(bare, unit)]
    cuts = [k for k, letter in enumerate(bare) if letter == "_"]
    return [(bare, ""), *((bare[:k], bare[k + 1 :]) for k in cuts)]


def _run_kind(path: Path, guesses: dict[str, _Guess]) -> tuple[str, list[str]]:
    if "velocity" in guesses and "torque" in guesses and not {"time", "position"} & set(guesses):
        return "points", ["experiment: assumed points, for there is neither time nor position"]
    stem = path.stem.lower()
    kind = next((kind for word, kind in _KINDS.items() if word in stem), "ramp")
    return kind, [f"experiment: assumed {kind}; expected one of ramp, points, presliding, tracking"]


def _signal(name: str, guess: _Guess, kind: Kind, unknown: list[str]) -> str:
    unit = guess.unit or (unit_of(name, kind))
    assumed = ""
    if guess.unit is None:
        assumed = "   # unit assumed: check it"
        unknown.append(f"unit of {name} (column {_text(guess.column)}): assumed {unit}")
    return f"  {name}: {{column: {_text(guess.column)}, unit: {unit}}}{assumed}"


def _text(text: str) -> str:
    """The text as YAML on one line, in quotes."""
    import yaml

    return yaml.safe_dump(text, default_style='"', width=float("inf")).rstrip("\n")
