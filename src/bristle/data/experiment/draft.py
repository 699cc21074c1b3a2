"""Draft of a commented experiment file from logs; what cannot be guessed is an error that names the option."""

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from bristle.arrays import Array
from bristle.data.binary_tables import READERS, names_of
from bristle.data.columns import ISO, Key
from bristle.data.encoder import unit_of_counts
from bristle.data.experiment.column_names import DRIVES, LONGEST, ColumnGuess, guess_columns, unit_in
from bristle.data.experiment.schema import RunKind
from bristle.data.experiment.signals import COMMANDS, DRIVE
from bristle.data.ros.bag import is_bag
from bristle.data.ros.names import time_column
from bristle.data.ros.read import bag_columns, joint_states, read_bag
from bristle.data.text_layout import is_stamp, text_layout
from bristle.data.text_table import is_text, naming, read_table
from bristle.data.units import factor, fits, to_si
from bristle.errors import InputError, check_name, short, short_list
from bristle.estimation import levels
from bristle.model.parameters import Kind
from bristle.model.parameters import unit as unit_of

SIGNALS = ("time", "position", "velocity", "torque", "current", "voltage")  # that a column can be, of a robot too
"""Efforts, in the order in which they are taken: each needs one constant more than the one before."""
STATE_FIELDS = {"position": "position", "velocity": "velocity", "torque": "effort"}  # of joint states, by signal
_OF_MOTOR = ("torque_constant", "resistance", "kp", "kd", "torque_limit")
_TABLES = {".csv", ".txt", ".mcap", ".bag", ".db3", *READERS}  # endings by which a word is a file
_LISTED, _SHOWN = 120, 200  # characters of column names in a sentence; columns that the draft lists


@dataclass(frozen=True, slots=True, kw_only=True)
class Told:
    """What the user says of logs that their names and data do not, in the words of an experiment file, by signal."""

    columns: Mapping[str, str] = field(default_factory=dict)
    """Name, or number from 0; `FILE:NAME` of one that is logged in another file, with a time of its own."""
    units: Mapping[str, str] = field(default_factory=dict)
    scales: Mapping[str, str] = field(default_factory=dict)
    rate: str | None = None
    """Samples per second, with a unit, where no column is the time."""
    torque_constant: str | None = None
    resistance: str | None = None
    kp: str | None = None
    kd: str | None = None
    torque_limit: str | None = None
    held: bool | None = None
    """Whether the drive holds its commands between samples."""
    fresh: bool | None = None
    """Whether it compares them with measurements of the moment."""
    encoder_resolution: str | None = None
    """Size of one count, where the encoder is."""
    gear: str | None = None
    """As under `motor`: `ratio: 100, position: motor, velocity: motor`."""
    inertia: str | None = None
    gravity: str | None = None
    """Its largest torque, m g l, or `mass: 1.2 kg, centre: 0.06 m`, or a URDF that tells it of the joint of that name."""
    coasting: bool = False
    """That nothing drives the joint."""
    directions: str | None = None
    name: str | None = None
    """Of the joint."""
    hold_out: tuple[Path, ...] = ()
    """Logs that are kept for validation."""

    @property
    def motor(self) -> dict[str, str]:
        """The options of the motor, by their keys in an experiment file."""
        return {name: value for name in _OF_MOTOR if (value := getattr(self, name)) is not None}


class DraftedRun(NamedTuple):
    """The experiment of a log."""

    kind: RunKind
    why: str = ""
    hold_out: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Draft:
    """An experiment file without the experiments of its logs."""

    head: tuple[str, ...]  # lines on the joint, its motor, its encoder, and the columns of the first file
    signals: tuple[str, ...]  # a line each
    files: tuple[str, ...]  # relative to where the draft will be
    of_points: bool  # whether the files hold velocity-torque pairs
    guessed: tuple[str, ...]  # a sentence each

    def text(self, runs: Sequence[DraftedRun], fit: str = "") -> str:
        """The experiment file, with the experiment of each log, and lines about the fit."""
        lines = [*self.head, "signals:", *(f"  {line}" for line in self.signals), ""]
        lines += [
            "# experiment: ramp | points | presliding | tracking; hold_out: true keeps a run for validation",
            "runs:",
        ]
        for file, run in zip(self.files, runs, strict=True):
            kept, why = ", hold_out: true" * run.hold_out, f"   # {run.why}" if run.why else ""
            lines.append(f"  - {{files: {quoted(file)}, experiment: {run.kind}{kept}}}{why}")
        return "\n".join([*lines, "", fit or "# fit: {directions: separate}   # all optional", ""])


def draft_experiment(files: Sequence[Path], told: Told | None = None, folder: Path | None = None) -> Draft:
    """The draft of an experiment file for logs of one joint, with the columns of the first.

    Data files are named relative to `folder`, where the draft will be saved; None: beside the first. Raises InputError
    where a file cannot be read, or something that is needed was neither told nor can be guessed.
    """
    told, first = told or Told(), files[0]
    folder = folder or first.parent
    for file in files:
        check_name(file.name, f"{file}: the file name")
    if (count := told.encoder_resolution) is not None and count.isascii() and count.isdigit():
        told = replace(told, encoder_resolution=f"{count} counts/rev")
    apart, told = _apart(told)
    log = _Log(first, replace(told, columns={name: x for name, x in told.columns.items() if name not in apart}))
    beside = dict[str, _Log]()
    for name, path in apart.items():
        beside[name] = _Log(path, replace(told, columns={name: told.columns[name]}, rate=None))
        if "time" not in beside[name].guesses:
            why = "no column is named as the time, which a signal of another file needs"
            raise InputError(f"{path}: {why}; write it into the draft of bristle new")
    alone = len(files) == 1 and told.rate is None and "time" not in log.told
    if alone and (slower := _slower(log, beside)):
        # at the times of the slower clock: interpolation between its samples would correlate their noise
        moves: dict[str, str] = {x: f"{first}:{log.guesses[x].column}" for x in STATE_FIELDS if x in log.guesses}
        told = replace(told, columns={**moves, **told.columns}, name=told.name or _common(files))
        turned = draft_experiment([slower], told, folder)
        said = f"runs: {slower.name}, whose samples are further apart, with the signals of {first.name} at its times"
        return replace(turned, guessed=(*turned.guessed, said))
    guesses = log.guesses | {name: x.guesses[name] for name, x in beside.items()}
    drive = _drive(log, guesses, told)
    of_points = _of_points(log, guesses, told) and not told.coasting
    slides = "torque" in guesses and "force" in guesses["torque"].column.lower()
    for name in ("position", "velocity", "torque"):
        unit = name in guesses and (told.units.get(name) or guesses[name].unit)
        slides = slides or bool(unit and fits(unit, unit_of(name, "prismatic")))
    slides = slides or bool(_OF_SCREW.search(told.gear or ""))
    kind: Kind = "prismatic" if slides else "revolute"
    guessed = [f"joint.kind: {kind}, by the units", *_assumed(log, guesses, told, drive, kind)]
    guesses, counted = _counted(log, guesses, told, beside) if kind == "revolute" else (guesses, ())
    guessed += counted
    lines = [] if told.rate is None else [f"time: {{rate: {quoted(told.rate)}}}"]
    drives = [*COMMANDS] if drive == "command" and told.motor else [drive]
    for name in ("velocity", *drives) if of_points else ("time", "position", "velocity", *drives):
        if (guess := guesses.get(name)) is not None:
            source, ends = beside.get(name, log), ""
            if name in beside:
                time = source.guesses["time"]
                ends += f", file: {quoted(relative(source.path, folder))}, time: {{column: {quoted(time.column)}, unit: {quoted(time.unit or 's')}}}"
            ends += f", plus: {{column: {quoted(guess.plus)}, unit: ns}}" if guess.plus else ""
            where = [source.path] if name in beside else files
            wraps = name == "position" and kind == "revolute" and _wraps(where, guess, told)
            ends += ", wraps: true" * wraps
            asked = {x: getattr(told, x) for x in (("held", "fresh") if name == "command" else ())}
            ends += "".join(f", {x}: {str(value).lower()}" for x, value in asked.items() if value is not None)
            lines.append(_signal(name, guess, kind, told, source, guessed) + f"{ends}}}")
            guessed += ["position: wraps at a full turn, because it jumps by one"] * wraps
    return Draft(
        head=_head(files, kind, told, log),
        signals=tuple(lines),
        files=tuple(relative(file, folder) for file in files),
        of_points=of_points,
        guessed=tuple(guessed),
    )


def _head(files: Sequence[Path], kind: Kind, told: Told, log: "_Log") -> tuple[str, ...]:
    def braced(text: str) -> str:
        """A mapping in braces, which it may have already; else a quoted value."""
        return f"{{{text.strip().removeprefix('{').removesuffix('}')}}}" if ":" in text else quoted(text)

    motor = [f"{name}: {quoted(value)}" for name, value in told.motor.items()]
    motor += [f"gear: {braced(told.gear)}"] if told.gear else []
    known = [f"gravity: {braced(told.gravity)}"] if told.gravity else []
    inertia = f"inertia: {quoted(told.inertia)}" if told.inertia else ""
    lines = [f"joint: {{name: {quoted(told.name or _common(files))}, kind: {kind}}}   # revolute or prismatic"]
    lines += [f"motor: {{{', '.join(motor)}}}   # at the joint, gear included"] if motor else []
    if told.coasting:
        known += [inertia] if inertia else []
        lines.append(f"coasting: {{{', '.join(known)}}}" if known else "coasting: true")
    else:
        lines += known
    of_joint = "" if told.coasting else inertia
    count = f"encoder_resolution: {quoted(told.encoder_resolution)}" if told.encoder_resolution else ""
    return (
        *lines,
        of_joint or "# inertia: 0.0089 kg*m^2             # optional; x +/- s is a prior",
        count or "# encoder_resolution: 4096 counts/rev  # optional",
        "",
        f"# Columns of {quoted(files[0].name)}: {log.described}",
    )


def _assumed(log: "_Log", guesses: Mapping[str, ColumnGuess], told: Told, drive: str, kind: Kind) -> Iterator[str]:
    """Sentences on a time without a unit, and on a drive without constants."""
    unit = told.units.get(drive) or (guesses[drive].unit if drive in guesses else None)
    if unit in ("%", "percent") and drive in told.scales:
        yield f"{drive}: in percent, of which 100 % are {told.scales[drive]} (--scale)"
    if log.by_step:
        yield f"unit of time: {log.by_step}, because a log has many samples a second"
    if drive in ("current", "voltage") and told.motor.keys().isdisjoint(("torque_constant", "resistance")):
        of, constants = ("A", "") if drive == "current" else ("V", " --resistance '2.1 ohm'")
        yield f"torque: as a {drive}, in {of}, because no torque constant was given (--torque-constant '0.35 N*m/A'{constants} gives N*m)"
    if drive == "command" and not told.motor:
        of = unit_of("position", kind)
        yield f"torque: as a position error, in {of}, because no gain was given (--kp '20 N*m/rad', and --kd, gives N*m)"
        if "velocity_command" in guesses:
            yield f"velocity_command: column {guesses['velocity_command'].column} is left out, because no kd was given"


def _apart(told: Told) -> tuple[dict[str, Path], Told]:
    """The files of signals that are told as `FILE:COLUMN`, and `told` with the columns alone.

    Raises InputError where such a file does not exist.
    """
    parts = {name: column.rpartition(":") for name, column in told.columns.items()}
    apart = {name: Path(file) for name, (file, _, _) in parts.items() if file and Path(file).is_file()}
    for name, column in told.columns.items():
        file = Path(parts[name][0] or column)
        if name not in apart and file.suffix.lower() in _TABLES:
            why = "is a file; name a column of it" if file.is_file() else "does not exist"
            expected = f"expected FILE:COLUMN, as in {name}={file}:{name}"
            raise InputError(f"--column {name}={column}: {short(str(file))} {why}; {expected}")
    return apart, replace(told, columns={**told.columns, **{name: parts[name][2] for name in apart}})


def _slower(log: "_Log", beside: Mapping[str, "_Log"]) -> Path | None:
    """The other file, if there is one and its samples are a fifth further apart than the log's."""
    logs = [log, *{x.path: x for x in beside.values()}.values()]
    if len(logs) != 2 or "time" not in log.guesses or any(x.is_dated(x.guesses["time"]) for x in logs):
        return None
    times = (x.values(x.guesses["time"]) * factor(x.guesses["time"].unit or "s", "s") for x in logs)
    step, other = (float(np.median(np.diff(t))) if t.size > 1 else 0.0 for t in times)
    return logs[1].path if other > levels.SLOWER_FILE * step > 0 else None


def relative(path: Path, folder: Path) -> str:
    """The path of a file relative to a folder, as drafts name it."""
    return Path(os.path.relpath(path, folder)).as_posix()


def _common(files: Sequence[Path]) -> str:
    """The common beginning of the names of all files, or the name of the first."""
    alike = os.path.commonprefix([file.stem for file in files])  # noqa: RUF071  # letter by letter, as is meant
    return (alike.rstrip("_-. ") or files[0].stem)[:200]


class _Log:
    """A log: the names, units and contents of its columns, and which signals they are."""

    def __init__(self, path: Path, told: Told | None = None) -> None:
        self.path, self.told, self.layout = path, told.columns if told else {}, None
        with naming(str(path)):
            read_table(path, ())
            if is_text(path):
                self.layout = text_layout(path)
                self.names = self.layout.names
            else:
                self.names = bag_columns(path) if is_bag(path) else names_of(path)
        self.stated = self.layout.units if self.layout else ()  # units of a text file's columns, empty where not stated
        self.described = ", ".join(
            [*(quoted(name[:LONGEST]) for name in self.names[:_SHOWN]), *["..."] * (len(self.names) > _SHOWN)]
        )
        if self.layout and not self.names:
            first = self.layout.first
            some = [f"{k} (first value {quoted(x[:LONGEST])})" for k, x in enumerate(first[:_SHOWN]) if x]
            self.described = f"no header; {', '.join(some)}{', ...' if len(first) > _SHOWN else ''}"
        self.described = self.described or "none that is a vector of numbers"
        self.there = self.described if len(self.described) <= _LISTED else f"{self.described[:_LISTED]} ..."
        self.guesses, self.by_step = self._guesses(told) if told else ({}, None)

    def _guesses(self, told: Told) -> tuple[dict[str, ColumnGuess], str | None]:
        """Columns by signal, by name, of a bag's only joint, or as told; and the unit of time, where its steps tell it."""
        if is_bag(self.path):
            with naming(str(self.path)):
                guesses = _bag_guesses(self.path, told.columns)
        else:
            guesses = guess_columns(self.names, self.stated)
        for signal, column in told.columns.items():  # with the unit that its name has, or the file states
            known, number = column in self.names, int(column) if column.isdecimal() and len(column) < 6 else None
            place = self.names.index(column) if known else number
            unit = self.stated[place] if place is not None and place < len(self.stated) else ""
            guesses[signal] = ColumnGuess(column, (unit_in(column, signal, unit) if known else None) or unit or None)
        if told.rate is None and not self.names and "time" not in guesses and self.rises():
            guesses["time"] = _FIRST
        if "time" not in guesses or "time" in told.units:
            return guesses, None
        if self.is_dated(guesses["time"]):
            guesses["time"] = guesses["time"]._replace(unit=ISO)
        if guesses["time"].unit:
            return guesses, None

        time = self.values(guesses["time"])
        step = float(np.median(np.abs(np.diff(time)))) if time.size > 1 else 0.0
        by_step = next((unit for unit, least in reversed(levels.TIME_UNITS.items()) if step >= least), None)
        guesses["time"] = guesses["time"]._replace(unit=by_step)
        return guesses, by_step

    def _column(self, guess: ColumnGuess) -> int | str:
        return int(guess.column) if guess.column.isdecimal() and guess.column not in self.names else guess.column

    def values(self, guess: ColumnGuess) -> Array:
        """The finite numbers of a column, (n,)."""
        key = Key(self._column(guess))
        values: Array = np.asarray(read_table(self.path, [key]).columns[key], float).ravel()
        return np.compress(np.isfinite(values), values)

    def is_dated(self, guess: ColumnGuess) -> bool:
        """Whether a column of a text file holds dates or times of day."""
        column = self._column(guess)
        if self.layout is None or (isinstance(column, str) and column not in self.names):
            return False
        place = column if isinstance(column, int) else self.names.index(column)
        return place < len(self.layout.first) and is_stamp(self.layout.first[place])

    def rises(self) -> bool:
        """Whether the first column of a text file grows in steps that could be those of seconds."""
        if self.layout is None or self.is_dated(_FIRST):
            return self.layout is not None
        steps = np.zeros(0)
        with suppress(InputError):  # it may hold words
            steps = np.diff(self.values(_FIRST))
        usual, (least, most) = np.median(steps) if steps.size else 0.0, levels.TIME_STEPS
        within = least < usual < most and steps.max() < levels.LONGEST_STEP * usual
        return bool(within and steps.min() > 0)


_OF_SCREW = re.compile(r"ratio:[^,]*(?:/ *(?:mm|cm|m)|(?:mm|cm|m) */)")  # a ratio of turns and a way
_FIRST = ColumnGuess("0", None)  # column of a text file


def _bag_guesses(path: Path, told: Mapping[str, str]) -> dict[str, ColumnGuess]:
    """The columns of a bag by signal: the stamps of the topic that was told, or the states of its only joint."""
    first = next((told[name] for name in ("position", "velocity") if name in told), None)
    if first is not None and any(name in told for name in DRIVES):
        return {"time": ColumnGuess(time_column(path, first), "s")}
    topic, joints = joint_states(path)
    if len(joints) != 1:
        raise InputError(
            f"has joint states of {len(joints)} joints: {short_list(joints)}; name the columns of one, as in "
            f"--column position={topic}.position[{next(iter(joints), 'JOINT')}] --column torque={topic}.effort[...]"
        )
    fields = {signal: f"{topic}.{field}[{joints[0]}]" for signal, field in STATE_FIELDS.items()}
    there = {signal: ColumnGuess(name, None) for signal, name in fields.items() if is_there(path, name)}
    return {"time": ColumnGuess(time_column(path, fields["position"]), "s")} | there


def is_there(path: Path, name: str) -> bool:
    """Whether a column of a bag holds anything."""
    try:
        read_bag(path, [Key(name)])
    except InputError:
        return False
    return True


def _drive(log: _Log, guesses: Mapping[str, ColumnGuess], told: Told) -> str:
    """Name of the effort that drives the joint: torque, current, voltage or command; empty where it coasts.

    Raises InputError where none is known, or the options contradict the log.
    """
    driven = [name for name in (*DRIVES, *COMMANDS) if name in told.columns] + [f"--{name}" for name in told.motor]
    if told.coasting and driven:
        got = f"got --coasting and {driven[0]}"
        raise InputError(f"{log.path}: {got}; expected --coasting of a joint that nothing drives")
    there = [*(name for name in DRIVES if name in guesses), *["command"] * (not COMMANDS.keys().isdisjoint(guesses))]
    partly = ("torque_constant" in told.motor) != ("resistance" in told.motor)
    computable = [name for name in there if name != "voltage" or not partly]
    asked = [name for name in there if name in told.columns or (name == "command" and "kp" in told.motor)]
    drive = "" if told.coasting else next(iter([*asked, *computable, *there]), None)
    if drive is None:
        why = "no column is named as a torque, a current, a voltage or a command"
        names = "--column torque=NAME (of another file FILE:NAME) or command=NAME, or say --coasting"
        raise InputError(f"{log.path}: {why}; name it, as in {names} (there are: {log.there})")
    of_commands = [name for name in ("held", "fresh", "kp", "kd") if getattr(told, name) is not None]
    if of_commands and drive != "command":
        got = f"the log has a {drive}" if drive else "nothing drives the joint"
        remedy = "leave it out, or name --column command=NAME"
        raise InputError(f"{log.path}: --{of_commands[0]} is of commands, and {got}; {remedy}")
    if told.rate is not None and "time" in guesses:
        got = f"got --rate beside column {short(guesses['time'].column)}, which is the time"
        raise InputError(f"{log.path}: {got}; leave --rate out, or name the right column, as in --column time=NAME")
    return drive


def _of_points(log: _Log, guesses: Mapping[str, ColumnGuess], told: Told) -> bool:
    """Whether a file holds velocity-torque pairs. Raises InputError where a log lacks time, or position and velocity."""
    if "position" not in guesses and "velocity" not in guesses:
        names = "name it, as in --column position=NAME --unit position=deg"
        why = f"no column is named as a position or a velocity; {names}"
        raise InputError(f"{log.path}: {why} (there are: {log.there})")
    if told.rate is not None or "time" in guesses:
        return False
    if "velocity" in guesses and log.values(guesses["velocity"]).size <= levels.MOST_POINTS:
        return True
    names = "name it, as in --column time=NAME --unit time=s, or give --rate '1 kHz'"
    raise InputError(f"{log.path}: no column is named as the time; {names} (there are: {log.there})")


def _wraps(files: Sequence[Path], guess: ColumnGuess, told: Told) -> bool:
    """Whether a position in its unit, or else in rad, jumps by a full turn in one of the files."""
    unit, scale = told.units.get("position") or guess.unit or "rad", told.scales.get("position", 1.0)
    count = None if told.encoder_resolution is None else to_si(told.encoder_resolution, "rad")
    if unit.startswith("count") and count is None:  # which nothing here tells the size of
        return False
    turn = 2 * np.pi / abs(factor(unit, "rad", scale=scale, resolution=count))
    jumps = (np.abs(np.diff(_Log(file).values(guess))) for file in files)
    return any(bool((np.abs(jump / turn - 1) < levels.FULL_TURN).any()) for jump in jumps)


def _counted(
    log: "_Log", guesses: dict[str, ColumnGuess], told: Told, beside: Mapping[str, "_Log"]
) -> tuple[dict[str, ColumnGuess], tuple[str, ...]]:
    """Columns with the unit in which a turn is a power of two of counts, where nothing states one; and a sentence."""
    unsaid = {x: guesses[x] for x in STATE_FIELDS if x in guesses and not (guesses[x].unit or x in told.units)}
    if "position" not in unsaid or "position" in told.scales:
        return guesses, ()
    if (found := unit_of_counts(beside.get("position", log).values(unsaid["position"]))) is None:
        return guesses, ()
    unit, counts = found
    of_each = {"position": unit, "velocity": f"{unit}/s"}
    more = {x: guess._replace(unit=of_each[x]) for x, guess in unsaid.items() if x in of_each}
    units = " and ".join(guess.unit or "" for guess in more.values())
    said = f"unit of {' and '.join(more)}: {units}, in which a turn has {counts} counts, a power of two"
    return guesses | more, (said,)


def _signal(name: str, guess: ColumnGuess, kind: Kind, told: Told, log: _Log, guessed: list[str]) -> str:
    """The line of a signal, without its end; guesses are added to `guessed`."""
    unit = told.units.get(name) or guess.unit or unit_of(COMMANDS.get(name, name), kind)
    shown = quoted(guess.column) if guess.column in log.names or not guess.column.isdecimal() else guess.column
    if name not in told.columns:
        others = f", the first of {guess.others + 1} that are named so" if guess.others else ""
        guessed.append(f"{name}: column {shown}{others if log.names else ', which rises steadily'}")
    if guess.unit == ISO:
        guessed.append(f"unit of time: iso, for column {shown} holds dates or times of day")
    elif guess.unit in log.stated and guess.unit and name not in told.units:
        guessed.append(f"unit of {name}: {guess.unit}, as the file's header states")
    if not (name in told.units or guess.unit):
        guessed.append(f"unit of {name} (column {shown}): assumed {unit}")
    scale = f", scale: {quoted(told.scales[name])}" if name in told.scales else ""
    return f"{name}: {{column: {shown}, unit: {quoted(unit)}{scale}"


def quoted(text: str) -> str:
    """The text as YAML on one line, in quotes; characters that cannot be seen are escaped."""
    import yaml

    return yaml.safe_dump(text, default_style='"', width=float("inf"), allow_unicode=text.isprintable()).rstrip("\n")


def told_by(pairs: Sequence[str], option: str) -> dict[str, str]:
    """Signals and values of an option: `torque=i` as {torque: i}.

    Raises InputError where it is no such pair, there is no such signal, or it is given twice.
    """
    told: dict[str, str] = {}
    signals = (*SIGNALS, *COMMANDS)
    for pair in pairs:
        signal, _, value = pair.partition("=")
        if signal not in signals or not value:
            raise InputError(f"{option}: got {short(pair)}; expected SIGNAL=..., with a signal of {', '.join(signals)}")
        if signal in told:
            raise InputError(f"{option}: {signal} is told twice; keep one")
        told[signal] = value
    drives = [name for name in DRIVE if name in told]
    if option == "--column" and len(drives) > 1:
        raise InputError(f"{option}: got {short_list(drives)}; expected one of them, which the torque comes from")
    return told
