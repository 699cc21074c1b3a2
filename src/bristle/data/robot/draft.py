"""Draft of a robot's file: joints from its URDF, columns from a bag's joint states, from names, or as told."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from bristle.data.experiment.column_names import DRIVES, guess_columns
from bristle.data.experiment.draft import SIGNALS, STATE_FIELDS, Told, is_there, quoted, relative
from bristle.data.robot.robot_file import FREE
from bristle.data.robot.urdf import Urdf, UrdfJoint, read_urdf
from bristle.data.ros.bag import is_bag
from bristle.data.ros.read import joint_states
from bristle.data.text_layout import text_layout
from bristle.data.text_table import is_text, naming
from bristle.errors import InputError, short_list
from bristle.model.parameters import unit as unit_of

OF_ROBOTS = ("columns", "units", "scales", "rate", "torque_constant")  # of `Told`; the rest is of one joint
_NUMBERED = re.compile(r"(.*?)[\[_ ]?([0-9]{1,3})\]?")


def draft_robot(urdf_path: Path, logs: Sequence[Path], told: Told, folder: Path | None) -> tuple[str, tuple[str, ...]]:
    """The text of a robot's file for its URDF and logs of all its joints, and a sentence on each guess.

    Files are named relative to `folder`, where the text will be saved; None: beside the URDF. Raises InputError where
    there is no log, or the columns of a signal can neither be guessed nor were told.
    """
    if not logs:
        remedy = "name a log of the joints as well, as in bristle new arm.urdf motion.csv"
        raise InputError(f"{urdf_path}: got a URDF alone; {remedy}")
    urdf, base = read_urdf(urdf_path), folder or urdf_path.parent
    templates, joints, said = _columns(urdf, logs[0], told)
    drive = next((name for name in DRIVES if name in templates), None)
    if drive is None or "position" not in templates:
        missing = "position" if drive else "torque, current or voltage"
        raise InputError(
            f"{logs[0]}: no columns of {missing} are unmistakable; name them, as in --column position=1-{len(urdf.joints)} "
            f"--column current=7-12, or with the joint's name: --column 'position=q_{{joint}}'"
        )
    units = {name: told.units.get(name, unit_of(name)) for name in templates}
    said += [f"{name}: unit {units[name]}" for name in templates if name not in told.units]
    constant = told.torque_constant or FREE
    lines = [
        f"robot: {{urdf: {quoted(relative(urdf_path, base))}, gravity: [0, 0, -9.81]}}   # m/s^2, in the frame of the base",
        "joints:",
        *(f"  - {_entry(joint, constant * (drive == 'current'), templates, units, told)}" for joint in joints),
        "",
        "signals:   # {joint} stands for the joint's name; columns: 1-6 for one column each",
        *(f"  {x}: {_signal(templates[x], units[x], told.scales.get(x))}" for x in SIGNALS if x in templates),
        *([f"  time: {{rate: {told.rate}}}"] if told.rate and "time" not in templates else []),
        "",
        "runs:",
        *(f"  - {{files: {quoted(relative(log, base))}, experiment: tracking}}" for log in logs),
        "",
    ]
    if len(logs) > 1:
        lines[-2] = f"{lines[-2][:-1]}, hold_out: true}}"
        said.append(f"runs: {logs[-1].name} is held out, for validation")
    if drive == "current" and constant == FREE:
        how = "it comes out of the links' torque where that is large enough"
        said.append(f"torque_constant: free: {how}; write it down if you know it")
    if drive == "torque" and "effort" in templates["torque"]:
        how = "where it is a current, give --column current= and its unit"
        said.append(f"torque: effort is taken as a torque in N*m; {how}")
    return "\n".join(lines), tuple(said)


def _columns(urdf: Urdf, log: Path, told: Told) -> tuple[dict[str, str], list[UrdfJoint], list[str]]:
    """The columns of each signal, the joints that have them, and sentences on both."""
    if not is_bag(log):
        templates, there = _of_names(log, [j.name for j in urdf.joints])
    else:
        with naming(str(log)):
            topic, there = joint_states(log)
            templates = {"time": f"{topic}.header.stamp"}
            templates |= {signal: f"{topic}.{field}[{{joint}}]" for signal, field in STATE_FIELDS.items()}
            # many drivers leave it empty; the position's derivative takes its place
            if there and not is_there(log, templates["velocity"].format(joint=there[0])):
                del templates["velocity"]
    said = [f"{name}: columns {column}" for name, column in templates.items() if name not in told.columns]
    templates |= told.columns
    if any(name in told.columns for name in DRIVES):
        templates = {name: x for name, x in templates.items() if name not in DRIVES or name in told.columns}
    joints = [joint for joint in urdf.joints if not there or joint.name in there]
    if not joints:
        own = short_list(j.name for j in urdf.joints)
        raise InputError(f"{log}: has joints {short_list(there)}, none of which {urdf.file} has; it has {own}")
    absent = [joint.name for joint in urdf.joints if joint not in joints]
    if absent:
        said.append(f"joints: {short_list(absent)} not in the log, and taken as at rest at zero")
    return templates, joints, said


def _of_names(log: Path, joints: Sequence[str]) -> tuple[dict[str, str], tuple[str, ...]]:
    """The time, and columns whose names hold those of the joints, or count them; and the joints that are named."""
    with naming(str(log)):
        names = list(text_layout(log).names) if is_text(log) else []
    found: dict[str, str] = {}
    for name in names:
        joint = max((j for j in joints if j in name), key=len, default=None)
        stem = None if joint is None else name.replace(joint, "{joint}")
        if stem is not None:
            signal = _meant(name.replace(str(joint), "").strip("_. /[]"))
            found.setdefault(signal, stem) if signal else None
    named = tuple(j for j in joints if any(x.replace("{joint}", j) in names for x in found.values()))
    if not found:  # groups of columns q_0 q_1 ..., with one for each joint
        groups: dict[str, list[int]] = {}
        for k, name in enumerate(names):
            if match := _NUMBERED.fullmatch(name):
                groups.setdefault(match[1], []).append(k)
        for stem, at in groups.items():
            if len(at) == len(joints) == at[-1] + 1 - at[0] and (signal := _meant(stem)):
                found[signal] = f"{at[0]}-{at[-1]}"
    time = next((guess.column for signal, guess in guess_columns(names).items() if signal == "time"), None)
    return ({"time": time} if time else {}) | found, named


def _meant(stem: str) -> str | None:
    """The signal that a name without its joint means."""
    return next((signal for signal in guess_columns([stem]) if signal != "time"), None)


def _entry(joint: UrdfJoint, constant: str, templates: Mapping[str, str], units: Mapping[str, str], told: Told) -> str:
    own = f", torque_constant: {constant}" if constant else ""
    slides = {
        name: _signal(templates[name], unit_of(name, "prismatic"), told.scales.get(name))
        for name, unit in units.items()
        if unit == unit_of(name) != unit_of(name, "prismatic") and not _is_range(templates[name])
    }
    if slides and joint.kind == "prismatic":
        own += f", signals: {{{', '.join(f'{name}: {x}' for name, x in slides.items())}}}"
    return f"{{name: {quoted(joint.name)}{own}}}"


def _is_range(columns: str) -> bool:
    return re.fullmatch(r"[0-9]+-[0-9]+", columns) is not None


def _signal(columns: str, unit: str, scale: str | None) -> str:
    key = f"column: {columns if columns.isdecimal() else quoted(columns)}"
    return f"{{{f'columns: {columns}' if _is_range(columns) else key}, unit: {unit}{f', scale: {scale}' if scale else ''}}}"
