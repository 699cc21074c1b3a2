"""What goes to standard output and standard error: the only print."""

import io
import os
import sys
from collections.abc import Iterable


def open_streams() -> None:
    """Standard streams that escape what an encoding lacks; a closed one goes nowhere, or the next file opened would get its number."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            discard(name)
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def discard(name: str) -> None:
    """From now on a standard stream goes nowhere, and so does what is in its buffer."""
    stream, number = getattr(sys, name), {"stdout": 1, "stderr": 2}[name]
    nowhere = os.open(os.devnull, os.O_WRONLY)
    if isinstance(stream, io.TextIOWrapper) or stream is None:
        if nowhere != number:
            os.dup2(nowhere, number if stream is None else stream.fileno())
            os.close(nowhere)
    else:
        os.close(nowhere)
    if not isinstance(stream, io.TextIOWrapper):
        setattr(sys, name, io.StringIO())


def print_lines(lines: Iterable[str], *, done: bool = False) -> None:
    """Print lines, all the way; a reader who has seen enough is no error. Raises OSError where the output is full, unless all is `done`."""
    text = "".join(f"{line}\n" for line in lines)
    try:
        print(text, end="", flush=True)
    except BrokenPipeError:
        discard("stdout")
    except OSError as error:
        discard("stdout")
        if not done:
            raise OSError(error.errno, error.strerror or str(error), "standard output") from error


def print_found(lines: Iterable[str]) -> None:
    """Print what was found, in colour on a terminal, as `NO_COLOR` and `TERM` allow; plain text elsewhere."""
    if not sys.stdout.isatty():
        print_lines(lines)
        return
    from rich.console import Console
    from rich.text import Text

    text = Text("\n".join(lines))
    for words, style in _COLOURS.items():
        text.highlight_regex(words, style)
    console = Console(file=sys.stdout, highlight=False, soft_wrap=True)
    with console.capture() as capture:
        console.print(text, end="")
    print_lines(capture.get().splitlines())


_COLOURS = {
    r"(?m)(?<=: )use(?=\. )|(?<=  )use(?=$|  )": "green",
    r"\bcautions?\b": "yellow",
    r"do not use|\bcritical\b|Critical": "red",
    r"(?<=\[)[a-z][a-z0-9]*(-[a-z0-9]+)*(?=\])": "cyan",
    r"SIMULATED": "magenta",
}
"""What stands out on a terminal: whether to use a number, severities, codes of warnings, data that are simulated."""


def complain(line: str) -> None:
    """Print a line on standard error, where that can be."""
    try:
        print(line, file=sys.stderr, flush=True)
    except OSError:
        discard("stderr")
