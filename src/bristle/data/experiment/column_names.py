"""Signals and units guessed from the names of columns."""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from functools import cache
from typing import NamedTuple

from bristle.data.experiment.signals import COMMANDS
from bristle.data.units import fits
from bristle.model.parameters import unit as unit_of

_NAMES = {
    "time": ("t", "time", "timestamp", "timestamps", "stamp", "zeit", "zeitstempel"),
    "position": (
        "q", "qm", "pos", "position", "positions", "angle", "theta", "phi", "displacement", "stroke", "winkel", "lage", "weg",
    ),
    "velocity": (
        "dq", "qd", "vel", "velocity", "velocities", "speed", "omega", "qdot", "velo", "geschwindigkeit", "drehzahl",
    ),
    "torque": ("tau", "torque", "torques", "trq", "effort", "efforts", "force", "moment", "drehmoment", "kraft"),
    "current": ("i", "iq", "i_q", "current", "curr", "amps", "strom"),
    "voltage": ("u", "v_in", "voltage", "volt", "volts", "spannung"),
}  # fmt: skip  # a list of words
# names that mean a signal only beside a unit of it
_WITH_UNIT = {
    "position": ("x", "y", "p", "enc", "encoder"), "velocity": ("v", "w"), "torque": ("f", "m", "t"), "voltage": ("v",),
}  # fmt: skip  # a list of words
_UNITS = {
    "time": {
        **dict.fromkeys(("s", "sec", "secs", "second", "seconds"), "s"), **dict.fromkeys(("ms", "msec", "millis"), "ms"),
        **dict.fromkeys(("us", "usec", "micros", "µs"), "us"), **dict.fromkeys(("ns", "nsec", "nanos"), "ns"),
    },
    "position": {
        **dict.fromkeys(("rad", "rads", "radian", "radians"), "rad"), **dict.fromkeys(("deg", "degs", "degree", "degrees", "°"), "deg"),
        **dict.fromkeys(("rev", "revs", "turn", "turns"), "rev"), **{name: name for name in ("mrad", "m", "mm", "um", "counts")},
        "ticks": "counts",
    },
    "velocity": {
        f"{a}{sep}s": f"{'deg' if a == '°' else a}/s"
        for a in ("rad", "deg", "mrad", "rev", "m", "mm", "°") for sep in ("", "_", "/", "_per_", "p") if a != "m" or sep not in ("", "p")
    } | {"rads": "rad/s", **dict.fromkeys(("rpm", "1/min", "min^-1", "min-1", "u/min"), "rpm")},
    "torque": {**dict.fromkeys(("nm", "n_m", "n*m", "n.m", "n-m", "n·m"), "N*m"), "mnm": "mNm", "n": "N", "kn": "kN", "%": "percent"},
    "current": {"%": "percent", **dict.fromkeys(("a", "amp", "amps", "ampere"), "A"), **dict.fromkeys(("ma", "milliamps"), "mA")},
    "voltage": {**dict.fromkeys(("v", "volt", "volts"), "V"), **dict.fromkeys(("mv", "millivolts"), "mV")},
}  # fmt: skip  # a table
_LONG = "|".join(name for names in _NAMES.values() for name in names if len(name) > 2)
_COMPOUND = re.compile(rf"(ist|soll|motor)?({_LONG})(istwert|sollwert|wert)?")  # German, as Lageistwert
_SECONDS = {"sec": ("nanosec", "nsec"), "secs": ("nanosecs", "nsecs")}  # of stamps in two columns
DRIVES = ("torque", "current", "voltage")  # the first that is there drives the joint
_OF_DQ = ("current", "voltage")  # `i_d` is along the magnet, and not desired
_MEASURED = 1.8  # least score of a name that is not a command's
LONGEST = 100  # characters of a column's name that may be a usual one
# words that leave a short name what it is
_BESIDE = frozenset((
    "joint", "motor", "link", "axis", "drive", "actuator", "servo", "arm", "load", "output", "out", "angular", "linear",
    "actual", "act", "meas", "measured", "m", "raw", "filt", "filtered", "sensor", "enc", "encoder",
    "ist", "istwert", "wert",
))  # fmt: skip  # a list of words
# words of commands: a torque, current or voltage may be one, for want of a measured one
_ASKED = frozenset((
    "ref", "reference", "des", "desired", "cmd", "command", "commanded", "target", "goal", "set", "setpoint", "sp",
    "ff", "feedforward", "demand", "d", "soll", "sollwert",
))  # fmt: skip  # a list of words
# words of a column that is no signal of the joint
_OTHER = frozenset((
    "err", "error", "limit", "enable", "enabled", "mode", "max", "min", "std", "temp", "temperature", "status", "flag", "id", "count", "dt",
    "tcp", "battery", "bus", "supply",
))  # fmt: skip  # a list of words


class ColumnGuess(NamedTuple):
    """A column that is taken for a signal."""

    column: str
    unit: str | None  # none: not in the column's name
    others: int = 0  # later columns whose names say so as plainly
    plus: str | None = None  # the column of nanoseconds beside a time in whole seconds


def guess_columns(names: Sequence[str], stated: Sequence[str] = ()) -> dict[str, ColumnGuess]:
    """The column whose name most plainly means each signal; names that repeat are left out.

    A name is cut into words, and perhaps a unit behind them: `motor_current_A`, `jointPosDeg`, `Torque [Nm]`. `stated`
    are the units that a file states of its columns, empty where it states none; a column alone in a unit of time is the
    time.
    """
    once = [name for name, count in Counter(names).items() if count == 1 and len(name) <= LONGEST]
    units = dict(zip(names, stated, strict=False))
    best = [max(_readings(name, units.get(name, "")), default=None) for name in once]
    guesses: dict[str, ColumnGuess] = {}
    scores = dict[str, float]()
    for signal in (*_NAMES, *COMMANDS):
        found = [(x.score, name, x.unit) for name, x in zip(once, best, strict=True) if x and x.signal == signal]
        if found:
            score, name, unit = max(found, key=lambda x: x[0])  # the first of those that are alike
            scores[signal] = score
            guesses[signal] = ColumnGuess(name, unit or None, sum(x[0] == score for x in found) - 1)
    if scores.get("torque", _MEASURED) < _MEASURED <= scores.get("current", 0.0):
        del guesses["torque"]  # that was asked for, beside a current that was measured
    # else the only column in a unit of a signal that no name means
    taken = {guess.column for guess in guesses.values()}
    drives = () if guesses.keys() & {*DRIVES, *COMMANDS} else DRIVES
    for signal in (x for x in ("time", "position", "velocity", *drives) if x not in guesses):
        left = [name for name in once if name not in taken and not _is_other(name)]
        measured = [(name, own) for name in left if (own := unit_in(name, signal, units.get(name, "")))]
        if len(measured) == 1 and not guesses.keys() & {*drives}:
            guesses[signal] = ColumnGuess(*measured[0])
    if "time" not in guesses:
        ends = {tuple(words): name for name in once if (words := _words(name)[0])}
        split = ((words, ends.get((*words[:-1], fine))) for words in ends for fine in _SECONDS.get(words[-1], ()))
        pairs = [(ends[words], rest) for words, rest in split if rest is not None]
        guesses |= {"time": ColumnGuess(pairs[0][0], "s", plus=pairs[0][1])} if pairs else {}
    v = next((name for name in once if name.strip().lower() == "v"), None)
    if v is not None and "velocity" not in guesses and guesses.keys() & {"torque", "current"}:
        guesses["velocity"] = ColumnGuess(v, None)  # and no voltage, for what drives the joint is there
    return guesses


class _Reading(NamedTuple):
    """A signal that a name may mean; the higher the score, the more plainly."""

    score: float
    signal: str
    unit: str


@cache
def _fits(unit: str, signal: str) -> bool:
    """Whether a unit fits a signal of a joint that turns or slides."""
    return any(fits(unit, unit_of(COMMANDS.get(signal, signal), kind)) for kind in ("revolute", "prismatic"))


def unit_in(name: str, signal: str, stated: str = "") -> str | None:
    """The unit of a signal that a column's name ends with, or that the file states of it; None where there is none."""
    if stated:
        return stated if _fits(stated, signal) else None
    return next((unit for of, _, unit in _cuts(name) if of == signal and unit), None)


def _is_other(name: str) -> bool:
    """Whether a name has words of commands, or of no signal of the joint."""
    return not (_OTHER | _ASKED).isdisjoint(_words(name)[0])


def _words(name: str) -> tuple[list[str], str]:
    """The words of a name, and the unit in brackets: `jointPos_1 [deg]` as [joint, pos] and deg."""
    # the last part of a path, without an index, and the unit in brackets: `Torque[0] [Nm]` as (Torque, Nm)
    bare = re.sub(r"\[\d+\]", "", name) if re.search(r"\w\[\d+\]", name) else name
    if re.fullmatch(r"/[\w./]+", bare):
        bare = bare.rsplit("/", 1)[-1]
    bare = bare.rsplit(".", 1)[-1] if re.fullmatch(r"[\w.{}()]+", bare) else bare
    match = re.fullmatch(r"\s*(.*?)[\s_]*[\[(](.*?)[\])]\s*", bare)
    bare, bracket = (match[1], match[2].strip()) if match else (bare, "")
    # in small letters, without the numbers of joints
    parted = re.sub(r"(?<=[a-z]{2})(?=[A-Z][a-z]{2})", "_", bare.strip()).lower()
    words = [word for x in re.split(r"[^\w*/·°.-]+|_", parted) if (word := re.sub(r"\d+$", "", x))]
    compounds = ((word, _COMPOUND.fullmatch(word)) for word in words)
    return [part for word, parts in compounds for part in (parts.groups() if parts else [word]) if part], bracket


def _cuts(name: str) -> Iterator[tuple[str, list[str], str]]:
    """Each signal, with the words of a name and a unit of that signal behind them, or none."""
    words, bracket = _words(name)
    of_commands = {name: _UNITS[of] for name, of in COMMANDS.items()}
    for signal, units in {**_UNITS, **of_commands}.items():
        if bracket:
            if bracket.lower() in units:
                yield signal, words, units[bracket.lower()]
            continue
        yield signal, words, ""
        ends = ((words[:-k], "_".join(words[-k:])) for k in (1, 2, 3) if k < len(words))
        yield from ((signal, stem, units[end]) for stem, end in ends if end in units)


def _readings(name: str, stated: str) -> list[_Reading]:
    """Signals that a name may mean, with the unit that the file states of it."""
    found = [_Reading(s, signal, unit) for signal, stem, unit in _cuts(name) if (s := _score(stem, signal, unit))]
    by_file = ((signal, _words(name)[0]) for signal in (*_UNITS, *COMMANDS) if stated and _fits(stated, signal))
    return [*(_Reading(s, signal, stated) for signal, words in by_file if (s := _score(words, signal, stated))), *found]


def _score(words: list[str], signal: str, unit: str) -> float:
    """How plainly words mean a signal; 0: not at all."""
    if signal in COMMANDS:
        stem = [word for word in words if word not in _ASKED]
        alone = signal == "command" and not set(words) - _ASKED - _BESIDE
        return 0.0 if len(stem) == len(words) else 1.0 if alone else _score(stem, COMMANDS[signal], unit)
    usual = (*_NAMES[signal], *(_WITH_UNIT.get(signal, ()) if unit else ()))
    at = max((k for k, word in enumerate(words) if word in usual), default=None)
    rest = set(words) - set(usual)
    if "_".join(words) in usual:
        score = 3.0
    elif at is None or rest & _OTHER or ("d" in rest and signal in _OF_DQ):
        return 0.0
    elif rest & _ASKED:
        score = 1.0 if signal in DRIVES else 0.0
    # 2 letters of a name that means a signal only beside words such as `motor` or `measured`
    elif len(words[at]) > 2 or rest <= _BESIDE:
        score = 2.0 + 0.01 * at - 0.1 * (not rest <= _BESIDE)
    else:
        return 0.0
    return score + (0.5 if unit and score else 0.0)
