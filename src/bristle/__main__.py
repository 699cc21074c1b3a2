"""The process `bristle`, or `python -m bristle`, and its exit code.

0 a result, 1 a defect of bristle, 2 bad input, 3 a joint that is not to be used, with --strict, 130 interrupted.
"""

import sys
from typing import Any, NoReturn

from bristle.errors import InputError, one_line, reason
from bristle.terminal import complain, discard, open_streams, print_lines
from bristle.workers import pin

_LONGEST = 500  # characters of an error's sentence: one of ours is shorter, the system's or click's may not be


def main() -> NoReturn:
    """Run the command line and end the process with its exit code."""
    try:
        code = _run()  # which imports, and an interrupt meanwhile is one as well
    except KeyboardInterrupt:
        code = 130
    if code == 130:  # by an exception or, in newer versions of typer, as an exit code
        complain("interrupted")
    sys.exit(code)


def _run() -> int:
    """Run the command line; its exit code."""
    import typer

    from bristle.cli import app

    # What click raises at a wrong option or argument; typer brings a click of its own, which has no name outside it.
    wrong_use: Any = next(c for c in typer.BadParameter.__mro__ if c.__name__ == "ClickException")
    open_streams()
    pin()
    code = 2
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
        complain(f"bristle: {one_line(reason(bad), _LONGEST)}")
    except wrong_use as wrong:
        complain(f"bristle: {one_line(wrong.format_message(), _LONGEST)}")
    print_lines([], done=True)
    return code


if __name__ == "__main__":
    main()
