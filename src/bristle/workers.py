"""Work shared out among processes, with the same results, byte for byte, whatever their number."""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

Share = Callable[..., Iterable[Any]]
"""Makes the parts of a work, as `map` does: what comes of them in the order of the parts. Among processes all parts begin
at once, whoever waits for them; functions and parts must be picklable."""
REPORT = (
    "bristle.api.experiments",
    "bristle.questions.joint_report.report",
    "bristle.questions.compensation.report",
    "bristle.questions.explorer.page",
)
"""Modules that make a report."""
_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")

_interrupts = list[int]()


def cores() -> int:
    """Processes that the machine carries, or that this one may use of it."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def threads() -> int:
    """Threads that a part of the work may have: as many as there are cores, but one where processes share it already."""
    from multiprocessing import parent_process

    return 1 if parent_process() else cores()


def pin() -> None:
    """One thread for linear algebra, here where NumPy is not loaded yet and in processes that start: more help little, and may round otherwise."""
    for name in _ONE_THREAD:
        os.environ.setdefault(name, "1")


@contextmanager
def sharing(workers: int, *modules: str) -> Iterator[Share]:
    """What shares work out among so many processes: `map`, where that is fewer than two.

    On Linux `modules` are loaded once for all processes, while the caller goes on. Where the work fails or is interrupted
    the processes end at once, and they end where the caller is killed.

    Raises OSError where a process is killed.
    """
    if workers < 2:
        yield map
        return
    from concurrent.futures import ProcessPoolExecutor
    from concurrent.futures.process import BrokenProcessPool
    from multiprocessing import active_children

    others = set(active_children())
    with pinned(), ProcessPoolExecutor(workers, prepared(*modules), _begin) as pool:
        try:
            yield pool.map
        except BaseException as error:
            # A worker may end in the middle of a message: with no writer left, who reads it sees the end and waits no longer.
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
                raise OSError(
                    "a worker process was killed, perhaps for want of memory; take fewer --workers"
                ) from error
            raise


def prepared(*modules: str) -> Any:
    """How processes start: on Linux from one that begins now to load the modules (the sooner the better), elsewhere each anew."""
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


@contextmanager
def interruptible() -> Iterator[None]:
    """Ctrl-C raises KeyboardInterrupt meanwhile, and once more at the next `heed` where somebody caught that, as a bare `except` does."""

    def raise_it(*_: object) -> None:
        """And remember it."""
        _interrupts.append(signal.SIGINT)
        raise KeyboardInterrupt

    if (
        signal.getsignal(signal.SIGINT) is not signal.default_int_handler
        or threading.current_thread() is not threading.main_thread()
    ):
        yield  # somebody else's
        return
    signal.signal(signal.SIGINT, raise_it)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        _interrupts.clear()


def heed() -> None:
    """Raise KeyboardInterrupt where there was one and the work went on all the same: asked before anything is written."""
    if _interrupts:
        raise KeyboardInterrupt


@contextmanager
def pinned() -> Iterator[None]:
    """`pin` for the processes that begin meanwhile; the caller's environment is as it was afterwards."""
    new = [name for name in _ONE_THREAD if name not in os.environ]
    pin()
    try:
        yield
    finally:
        for name in new:
            os.environ.pop(name, None)


def _begin() -> None:
    """A worker leaves an interrupt to its parent, and ends with it."""
    import gc
    from multiprocessing import parent_process

    def end_with(parent: Any) -> None:
        parent.join()
        os._exit(1)

    gc.freeze()  # what is loaded stays
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if (parent := parent_process()) is not None:
        threading.Thread(target=end_with, args=(parent,), daemon=True).start()


def called(part: "partial[Any]") -> Any:
    """What a part comes to that is a call by itself: `share(called, parts)`."""
    return part()
