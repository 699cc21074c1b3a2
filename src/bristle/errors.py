"""The one exception that says a user's input cannot be used."""

import stat
import unicodedata
from collections.abc import Iterable
from pathlib import Path

LONGEST = 450  # characters of a sentence; what is longer loses its middle


class InputError(ValueError):
    """Bad input, in one line of at most `LONGEST` characters: what was got, what was expected, what to do.

    The command line ends with 2 at this and at an OSError; any other exception, a ValueError too, is a defect of
    bristle.
    """

    def __init__(self, sentence: str) -> None:
        super().__init__(one_line(sentence))


def one_line(text: str, longest: int = LONGEST) -> str:
    """A text as one printable line, control characters escaped; a long one loses its middle."""
    words = " ".join(text.split())
    line = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in words)
    return line if len(line) <= longest else f"{line[: longest * 2 // 3]} ... {line[5 - longest // 3 :]}"


def reason(error: object) -> str:
    """The sentence of an exception; of one of the system the file and why."""
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    return str(error)


def check_regular(path: Path, shown: str | None = None) -> None:
    """Raise InputError, opening with `shown` or the path, for a pipe or so, and OSError where nothing is there."""
    mode = path.stat().st_mode
    if not stat.S_ISREG(mode):
        what = next((name for test, name in _NOT_REGULAR.items() if test(mode)), "no regular file")
        raise InputError(f"{shown or path}: is {what}; expected a file")


_NOT_REGULAR = {
    stat.S_ISDIR: "a folder", stat.S_ISFIFO: "a pipe", stat.S_ISCHR: "a device", stat.S_ISBLK: "a device", stat.S_ISSOCK: "a socket",
}  # fmt: skip  # a table


# turn the direction of the text after them, so that a name could pass for another
_BIDI = frozenset("\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")


def check_name(text: str, what: str) -> str:
    """The text. Raises InputError, opening with `what`, where it holds a control character or a change of direction."""
    bad = next((c for c in text if c in _BIDI or unicodedata.category(c) in ("Cc", "Cs", "Zl", "Zp")), None)
    if bad is not None:
        why = f"holds U+{ord(bad):04X}, a control character"
        raise InputError(f"{what} {short(text)} {why}; expected letters that can be shown on one line")
    return text


def unreadable(path: Path | str, error: OSError) -> str:
    """The reason why a file cannot be read."""
    if isinstance(error, FileNotFoundError):
        where = "relative to the folder of the experiment file (or to where you are)"
        return f"{path}: no such file; check the path, which is {where}"
    if isinstance(error, IsADirectoryError):
        return f"{path}: is a folder; expected a file"
    return f"{path}: cannot be read ({error.strerror or error})"


def read_at_most(path: Path, most: int, expected: str) -> bytes:
    """The bytes of a regular file. Raises InputError where it cannot be read, or is longer than `most`."""
    try:
        check_regular(path)
        with path.open("rb") as file:
            content = file.read(most + 1)
    except OSError as error:
        raise InputError(unreadable(path, error)) from error
    if len(content) > most:
        raise InputError(f"{path}: is larger than {most} bytes; expected {expected}")
    return content


def short(value: object) -> str:
    """A value as quoted in a sentence."""
    text = " ".join(repr(value[:100] if isinstance(value, str | bytes) else value).split())
    return text if len(text) <= 60 else text[:57] + "..."


def short_list(names: Iterable[object]) -> str:
    """A list as quoted in a sentence: its beginning, where it is long."""
    text = ""
    for name in names:
        if len(text) > 200:
            return f"{text}, ..."
        text += f"{', ' if text else ''}{str(name)[:60]}"
    return text or "none"
