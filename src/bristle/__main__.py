"""The process: the only argv, the only exit code, as `bristle` and as `python -m bristle`.

0 a result was written, warnings included; 1 our own defect; 2 bad input; 3 critical warnings or cautions, with --strict; 130 interrupted.
"""

import sys
from typing import Any, NoReturn

import typer

from bristle.cli import app
from bristle.errors import InputError, one_line
from bristle.terminal import complain, discard, open_streams, print_lines
from bristle.workers import pin

_WRONG_USE: Any = next(c for c in typer.BadParameter.__mro__ if c.__name__ == "ClickException")
"""What click raises at a wrong option or argument; typer brings a click of its own, which has no name outside it."""

_LONGEST = 500
"""Characters of an error's sentence: one of ours is shorter, the system's or click's may not be."""


def main() -> NoReturn:
    """Run the command line and end the process with its exit code."""
    open_streams()
    pin()
    try:
        code = app(standalone_mode=False) or 0  # the code of a typer.Exit is handed back, not raised
        print_lines([])
    except (KeyboardInterrupt, typer.Abort):
        code = 130
    except (BrokenPipeError, SystemExit) as end:  # who read the help has seen enough; click makes an exit of it
        if isinstance(end, SystemExit) and not isinstance(end.__context__, BrokenPipeError):
            raise
        discard("stdout")
        code = 0
    except (InputError, OSError) as bad:
        code = 2
        complain(f"bristle: {_sentence(bad)}")
    except _WRONG_USE as wrong:
        code = 2
        complain(f"bristle: {one_line(wrong.format_message(), _LONGEST)}")
    if code == 130:  # by an exception or, in newer versions of typer, as an exit code
        complain("interrupted")
    print_lines([], done=True)
    sys.exit(code)


def _sentence(bad: Exception) -> str:
    text = str(bad)
    if isinstance(bad, OSError) and bad.strerror:
        text = f"{bad.filename}: {bad.strerror}" if bad.filename else bad.strerror
    return one_line(text, _LONGEST)


if __name__ == "__main__":
    main()
