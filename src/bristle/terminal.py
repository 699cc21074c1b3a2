"""What goes to standard output and standard error: the only print."""

import io
import os
import sys
from collections.abc import Iterable


def open_streams() -> None:
    """Make standard streams escape what an encoding lacks, and replace a closed one by nothing."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            discard(name)
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def discard(name: str) -> None:
    """Send a standard stream, and its buffer, to nowhere from now on."""
    stream, number = getattr(sys, name), {"stdout": 1, "stderr": 2}[name]
    if isinstance(stream, io.TextIOWrapper) or stream is None:
        nowhere = os.open(os.devnull, os.O_WRONLY)  # the number itself, if that stream is closed
        os.dup2(nowhere, number)
        if nowhere != number:
            os.close(nowhere)
    if not isinstance(stream, io.TextIOWrapper):
        setattr(sys, name, io.StringIO())


def print_lines(lines: Iterable[str], *, done: bool = False) -> None:
    """Print lines; a closed pipe is no error. Raises OSError where the output is full, unless the work is `done`."""
    text = "".join(f"{line}\n" for line in lines)
    try:
        print(text, end="", flush=True)
    except BrokenPipeError:
        discard("stdout")
    except OSError as error:
        discard("stdout")
        if not done:
            raise OSError(error.errno, error.strerror or str(error), "standard output") from error


def complain(line: str) -> None:
    """Print a line on standard error, if possible."""
    try:
        print(line, file=sys.stderr, flush=True)
    except OSError:
        discard("stderr")
