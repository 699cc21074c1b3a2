"""Runs command lines, each in a process of its own that is forked from one with everything imported: half a second less for each.

Prints the text of a results file as JSON, then reads one JSON object a line, `{"folder": ..., "arguments": [...]}`, and answers with one.
"""

import contextlib
import importlib
import json
import os
import resource
import signal
import sys
import tempfile
import time
import traceback
from pathlib import Path
from typing import Any

from .inputs import good_results

SECONDS, BYTES = 20, 2 * 2**30  # what one input may take, in time of the processor
_PATIENCE = 30.0
"""Times that: a command that waits, and does not work, is ended then; one that works is by its time of the processor, whatever runs beside it."""


def _run(folder: str, arguments: list[str]) -> None:
    """The command in this process, which it ends; its output goes into files beside the folder."""
    process: Any = importlib.import_module("bristle.__main__")
    os.chdir(folder)
    for number, name in ((1, "out"), (2, "err")):
        os.dup2(os.open(f"{folder}.{name}", os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
    resource.setrlimit(resource.RLIMIT_DATA, (BYTES, BYTES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CPU, (2 * SECONDS, 2 * SECONDS))
    sys.argv = ["bristle", *arguments]
    try:
        process.main()
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
    except BaseException:  # noqa: BLE001  # reported as Python would, with its traceback
        traceback.print_exc()
        code = 1
    with contextlib.suppress(OSError, ValueError, AttributeError):
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(code)


def _waited(child: int) -> tuple[int, float, float]:
    """Exit code (128 + n where signal n ended it), seconds and bytes at the most, of a child that is ended where it takes too long."""
    begun, status = time.monotonic(), 0
    pid = 0
    while not pid:
        pid, status, used = os.wait4(child, os.WNOHANG)
        if not pid and time.monotonic() - begun > _PATIENCE * SECONDS:
            os.kill(child, signal.SIGKILL)
            pid, status, used = os.wait4(child, 0)
        elif not pid:
            time.sleep(0.002)
    code = os.waitstatus_to_exitcode(status)
    return (128 - code if code < 0 else code), used.ru_utime + used.ru_stime, used.ru_maxrss * 1024.0


def serve() -> None:
    import bristle.questions.experiment_design.report
    import bristle.questions.method_validation.report
    import bristle.questions.sensitivity.report
    import bristle.questions.session_comparison.report  # noqa: F401  # imported for those that are forked

    with tempfile.TemporaryDirectory() as folder:
        print(json.dumps(good_results(Path(folder))), flush=True)  # which imports and compiles what is used first
    for line in sys.stdin:
        asked = json.loads(line)
        child = os.fork()
        if not child:
            _run(asked["folder"], asked["arguments"])
        code, seconds, size = _waited(child)
        print(json.dumps({"code": code, "seconds": seconds, "bytes": size}), flush=True)


if __name__ == "__main__":
    serve()
