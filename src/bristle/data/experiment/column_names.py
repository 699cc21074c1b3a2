"""Signals and units guessed from the names of columns."""

import re
from collections import Counter
from collections.abc import Sequence
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
_MEASURED = 2.0  # least score of a name that is not a command's
LONGEST = 100  # characters of a column's name that may be a usual one
# words that leave a short name what it is
_BESIDE = frozenset((
    "joint", "motor", "link", "axis", "drive", "actuator", "servo", "arm", "load", "output", "out", "angular", "linear",
    "actual", "act", "meas", "measured", "m", "raw", "filt", "filtered", "sensor", "enc", "encoder",
))  # fmt: skip  # a list of words
# words of commands: a torque, current or voltage may be one, for want of a measured one
_ASKED = frozenset((
    "ref", "reference", "des", "desired", "cmd", "command", "commanded", "target", "goal", "set", "setpoint", "sp",
    "ff", "feedforward", "demand",
))  # fmt: skip  # a list of words
# words of a column that is no signal of the joint
_OTHER = frozenset((
    "err", "error", "limit", "enable", "enabled", "mode", "max", "min", "std", "temp", "temperature", "status", "flag", "id", "count", "dt",
))  # fmt: skip  # a list of words


class ColumnGuess(NamedTuple):
    """A column that is taken for a signal."""

    column: str
    unit: str | None  # none: not in the column's name
    others: int = 0  # later columns whose names say so as plainly


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
    timed = [name for name in once if units.get(name) and _fits(units[name], "time")]
    if "time" not in guesses and len(timed) == 1:
        guesses["time"] = ColumnGuess(timed[0], units[timed[0]])
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


def _readings(name: str, stated: str) -> list[_Reading]:
    """Signals that a name may mean, with the unit that the file states of it."""
    # the last part of a path, without an index, and the unit in brackets: `Torque[0] [Nm]` as (Torque, Nm)
    bare = re.sub(r"\[\d+\]", "", name) if re.search(r"\w\[\d+\]", name) else name
    if re.fullmatch(r"/[\w./]+", bare):
        bare = bare.rsplit("/", 1)[-1]
    bare = bare.rsplit(".", 1)[-1] if re.fullmatch(r"[\w.{}()]+", bare) else bare
    match = re.fullmatch(r"\s*(.*?)[\s_]*[\[(](.*?)[\])]\s*", bare)
    bare, bracket = (match[1], match[2].strip()) if match else (bare, "")

    # `jointPos_1` as [joint, pos]: in small letters, without the numbers of joints
    parted = re.sub(r"(?<=[a-z]{2})(?=[A-Z][a-z]{2})", "_", bare.strip()).lower()
    words = [word for x in re.split(r"[^\w*/·°.-]+|_", parted) if (word := re.sub(r"\d+$", "", x))]
    readings = []
    of_commands = {name: _UNITS[of] for name, of in COMMANDS.items()}
    for signal, units in {**_UNITS, **of_commands}.items():
        if stated and _fits(stated, signal) and (score := _score(words, signal, stated)):
            readings.append(_Reading(score, signal, stated))
        if bracket:
            cuts = [(words, units[bracket.lower()])] if bracket.lower() in units else []
        else:
            ends = ((words[:-k], "_".join(words[-k:])) for k in (1, 2, 3) if k < len(words))
            cuts = [(words, ""), *((stem, units[end]) for stem, end in ends if end in units)]
        readings += [_Reading(s, signal, unit) for stem, unit in cuts if (s := _score(stem, signal, unit))]
    return readings


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
    elif at is None or rest & _OTHER:
        return 0.0
    elif rest & _ASKED:
        score = 1.0 if signal in ("torque", "current", "voltage") else 0.0
    # 2 letters of a name that means a signal only beside words such as `motor` or `measured`
    elif len(words[at]) > 2 or rest <= _BESIDE:
        score = 2.0 + 0.01 * at
    else:
        return 0.0
    return score + (0.5 if unit and score else 0.0)
