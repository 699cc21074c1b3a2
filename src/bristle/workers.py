"""Work shared among processes, with the same results, byte for byte, whatever their number."""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

Share = Callable[..., Iterable[Any]]
"""Does the parts of a work, as `map` does; among processes all at once. Functions and parts must be picklable."""
REPORT = (  # modules that make a report
    "bristle.api.experiments",
    "bristle.questions.joint_report.report",
    "bristle.questions.compensation.report",
    "bristle.questions.explorer.page",
)
_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")


def cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def threads() -> int:
    """Number of threads of a part of the work: the cores, but one where processes share it already."""
    from multiprocessing import parent_process

    return 1 if parent_process() else cores()


def pin() -> None:
    """Set one thread for linear algebra, here before NumPy is loaded, and in new processes: more round otherwise."""
    for name in _ONE_THREAD:
        os.environ.setdefault(name, "1")


@contextmanager
def sharing(workers: int, *modules: str, begin: Callable[[], object] = int) -> Iterator[Share]:
    """A `Share` among so many processes: `map`, where that is fewer than two.

    On Linux `modules` are loaded once for all processes, while the caller goes on. Each calls `begin`
    first. Where the work fails or is interrupted the processes end at once, and they end where the caller is killed.
    Raises OSError where a process is killed.
    """
    if workers < 2:
        yield map
        return
    from concurrent.futures import ProcessPoolExecutor
    from concurrent.futures.process import BrokenProcessPool
    from multiprocessing import active_children

    others = set(active_children())
    with pinned(), ProcessPoolExecutor(workers, prepared(*modules), _begin, (begin,)) as pool:
        try:
            yield pool.map
        except BaseException as error:
            # a worker may end in the middle of a message: without a writer its reader waits no longer
            pool._result_queue._writer.close()  # type: ignore[attr-defined]  # no public way to it
            # The pool's own thread may meet futures that were cancelled with the work, which nobody has to hear of.
            hook, threading.excepthook = threading.excepthook, lambda _: None
            try:
                for child in set(active_children()) - others:
                    child.terminate()
                pool.shutdown(cancel_futures=True)
            finally:
                threading.excepthook = hook
            if isinstance(error, BrokenProcessPool):
                why = "a worker process was killed, perhaps for want of memory"
                raise OSError(f"{why}; take fewer --workers") from error
            raise


def prepared(*modules: str) -> Any:
    """The context of processes: on Linux forked from one that begins now to load the modules, elsewhere each anew."""
    from multiprocessing import forkserver, get_context, resource_tracker

    if sys.platform != "linux":
        return get_context("spawn")
    context = get_context("forkserver")
    context.set_forkserver_preload(list(modules))
    resource_tracker.ensure_running()  # which lets interrupts through once it runs
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:  # it and its children inherit that, and leave an interrupt to this process from the beginning
        forkserver.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
    return context


def ahead(workers: int) -> None:
    """Load what makes a report for the processes of a `sharing` to come, while the caller loads it for itself."""
    if workers > 1:
        with pinned():
            prepared(*REPORT)


@contextmanager
def pinned() -> Iterator[None]:
    """`pin` for the processes that begin meanwhile; the caller's environment is restored."""
    new = [name for name in _ONE_THREAD if name not in os.environ]
    pin()
    try:
        yield
    finally:
        for name in new:
            os.environ.pop(name, None)


def _begin(begin: Callable[[], object]) -> None:
    """Have a worker begin, leave an interrupt to its parent, and end with it."""
    import gc
    from multiprocessing import parent_process

    def end_with(parent: Any) -> None:
        parent.join()
        os._exit(1)

    begin()
    gc.freeze()  # what is loaded stays
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if (parent := parent_process()) is not None:
        threading.Thread(target=end_with, args=(parent,), daemon=True).start()


def called(part: "partial[Any]") -> Any:
    """The result of a part that is a call: `share(called, parts)`."""
    return part()
