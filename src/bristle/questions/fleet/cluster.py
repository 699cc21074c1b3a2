"""Dask clusters: a local or a running one, checks of its workers, and calls spread over them."""

import asyncio
import logging
import secrets
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from itertools import count, islice
from multiprocessing import current_process
from time import monotonic, sleep
from typing import Any

from bristle.errors import InputError, one_line, short
from bristle.questions.fleet.tasks import version_difference, versions
from bristle.workers import cores, pinned

Client = Any  # a `distributed.Client`
_LOOPBACK = "127.0.0.1"
_WAIT = 60.0  # s, for a scheduler or its first worker, and until workers without a result are asked
_POLL = 0.02  # s, between two looks at what has ended
_UNINTERRUPTED = "import signal\nsignal.signal(signal.SIGINT, signal.SIG_IGN)\n"  # of our own workers, at their start
_LEAN = {
    "distributed.worker.profile.enabled": False,
    "distributed.deploy.lost-worker-timeout": "1h",
    "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": 2**28,
    "distributed.nanny.pre-spawn-environ.MALLOC_MMAP_THRESHOLD_": 2**28,
}
"""Workers keep the memory of freed arrays and have no profiler, which makes a task a tenth faster; and a process may
take longer than Dask's 15 s to restart, after which it would be given up."""
_LOGGERS = ("distributed", "tornado", "bokeh")
_UNGUARDED = 'in a script, put the call of bristle.fleet below if __name__ == "__main__":, because the worker processes read the script as well'


class SchedulerLostError(OSError):
    """The scheduler was lost."""

    def __init__(self, client: Client) -> None:
        address = client.scheduler.address if client.scheduler else ""
        super().__init__(f"the scheduler{f' {address}' if address else ''} was lost")


@contextmanager
def told_where_lost(client: Client) -> Iterator[None]:
    """Raise SchedulerLostError where a call of a client fails because its scheduler has ended."""
    from distributed import TimeoutError as DaskTimeoutError
    from distributed.comm import CommClosedError

    try:
        yield
    except (CommClosedError, DaskTimeoutError, TimeoutError) as error:
        raise SchedulerLostError(client) from error
    except (RuntimeError, AttributeError) as error:  # of a client without a scheduler
        if client.status == "running":
            raise
        raise SchedulerLostError(client) from error


def check_installed() -> None:
    """Raise InputError where a package that a fleet needs is not installed."""
    try:
        import distributed  # noqa: F401
        import pyarrow  # noqa: F401
    except ImportError as error:
        raise InputError(
            f"a fleet needs the package {error.name}; install it with pip install 'bristle[fleet]'"
        ) from error


def known_client(client: Client | None) -> Client | None:
    """The client given, or that of this process. Raises InputError where it is no synchronous client."""
    import distributed

    if client is None:
        with suppress(ValueError):
            client = distributed.get_client()
    if client is not None and not isinstance(client, distributed.Client):
        raise InputError(f"client: got {short(client)}; expected a distributed.Client")
    if client is not None and client.asynchronous:
        raise InputError("client: got an asynchronous client; expected one of Client(asynchronous=False)")
    return client


@contextmanager
def local_client(workers: int | None = None, memory: str | None = None) -> Iterator[Client]:
    """A client of a cluster of this machine, with one thread per process, on loopback.

    `workers`: processes, by default one per core; `memory`: most of each, as `2 GiB`, by default its share. Raises
    InputError where the memory is no size, or the processes do not start.
    """
    import dask
    import distributed

    # A starting worker runs the user's script up to here.
    if getattr(current_process(), "_inheriting", False):
        raise SystemExit(_UNGUARDED)
    processes, limit = workers or cores(), _bytes_of(memory)
    with quiet(), pinned(), dask.config.set(_LEAN):
        try:
            cluster = distributed.LocalCluster(
                n_workers=processes, threads_per_worker=1, processes=True, host=_LOOPBACK, memory_limit=limit or "auto",
                dashboard_address=f"{_LOOPBACK}:0", silence_logs=logging.CRITICAL, preload=[_UNINTERRUPTED],
            )  # fmt: skip  # a list of values
        except RuntimeError as error:
            raise InputError(
                f"the worker processes did not start ({one_line(str(error), 100)}); {_UNGUARDED}"
            ) from error
        try:
            with distributed.Client(cluster, set_as_default=False) as client:
                yield client
        finally:
            cluster.close(timeout=10)


def _bytes_of(memory: str | None) -> int | None:
    from dask.utils import parse_bytes

    if memory is None:
        return None
    try:
        found = int(parse_bytes(memory))
    except (ValueError, TypeError, OverflowError) as error:
        raise InputError(f"memory: got {short(memory)}; expected a size such as 2 GiB") from error
    if not 2**26 <= found <= 2**50:
        raise InputError(f"memory: got {short(memory)}; expected at least 64 MiB, such as 2 GiB")
    return found


@contextmanager
def remote_client(scheduler: str, certificates: Mapping[str, str] | None = None) -> Iterator[Client]:
    """A client of a scheduler, perhaps by TLS (`ca`, `cert`, `key`). Raises InputError where none answers."""
    from distributed import Client as DaskClient

    with quiet():
        try:
            security = _security(certificates)
            with ThreadPoolExecutor(1) as thread:  # without an event loop
                thread.submit(lambda: asyncio.run(_greeted(scheduler, security))).result()
            client = DaskClient(scheduler, security=security, timeout=_WAIT / 4, set_as_default=False)
        except (OSError, ValueError, RuntimeError, TypeError) as error:
            why = one_line(str(error) or "no answer in time", 150)
            raise InputError(
                f"{scheduler}: no Dask scheduler answers ({why}); expected an address such as tcp://host:8786"
            ) from error
        with client:
            yield client


async def _greeted(scheduler: str, security: Any) -> None:
    """Connect to a scheduler once: a client would wait for ever for a server that does not answer."""
    from distributed.comm import connect

    known = {} if security is None else security.get_connection_args("client")
    comm = await asyncio.wait_for(connect(scheduler, timeout=_WAIT / 4, **known), _WAIT / 4)
    comm.abort()


def _security(certificates: Mapping[str, str] | None) -> Any:
    from distributed import Security

    by = {"ca": "tls_ca_file", "cert": "tls_client_cert", "key": "tls_client_key"}
    known = {by[name]: file for name, file in (certificates or {}).items()}
    return Security(require_encryption=True, **known) if known else None


@contextmanager
def quiet() -> Iterator[None]:
    """Hide the log lines of Dask and the libraries below it."""
    known = [name for name in logging.root.manager.loggerDict if name.split(".")[0] in _LOGGERS]
    loggers = [logging.getLogger(name) for name in {*known, *_LOGGERS}]
    before = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in zip(loggers, before, strict=True):
            logger.setLevel(level)


def dashboard_of(client: Client) -> str:
    """The address of the dashboard, or an empty string."""
    try:
        return str(client.dashboard_link or "") if "dashboard" in client.scheduler_info()["services"] else ""
    except (AttributeError, KeyError, ValueError, OSError):
        return ""


def threads_of(client: Client) -> int:
    """Threads of all workers."""
    return int(max(1, sum(client.nthreads().values())))


def wait_for_worker(client: Client) -> None:
    """Wait for a worker. Raises InputError after a minute."""
    from distributed import TimeoutError as DaskTimeoutError

    try:
        client.wait_for_workers(1, timeout=_WAIT)
    except (DaskTimeoutError, TimeoutError) as error:
        raise InputError(
            f"the scheduler has no worker after {_WAIT:.0f} s; start one with dask worker ADDRESS"
        ) from error


def check_workers(client: Client, here: Sequence[tuple[str, str]]) -> None:
    """Raise InputError where there is no worker, or one has no bristle or other `versions` than these."""
    wait_for_worker(client)
    for worker, found in client.run(versions, on_error="return").items():
        if isinstance(found, BaseException):
            raise InputError(
                f"the worker {worker} cannot import bristle ({one_line(str(found), 120)}); install bristle[fleet] {dict(here)['bristle']} on all"
            )
        if wrong := version_difference(here, found, worker):
            raise InputError(wrong)


class _UnderWay:
    """Calls that were given to workers, by the key of the latest attempt of each."""

    def __init__(self, client: Client, name: str, function: Callable[..., Any]) -> None:
        from distributed import as_completed

        self.client, self.function, self.looked = client, function, monotonic()
        self.keys = map(f"{name}-{secrets.token_hex(4)}-{{}}".format, count())
        self.ended = as_completed(loop=client.loop, with_results=True, raise_errors=False)
        self.calls: dict[Any, tuple[tuple[Any, ...], Any]] = {}

    def begin(self, arguments: tuple[Any, ...]) -> None:
        """Give a call to the workers."""
        future = self.client.submit(self.function, *arguments, key=next(self.keys), pure=False)
        self.calls[future.key] = arguments, future
        self.ended.add(future)

    def ends(self) -> Iterator[tuple[tuple[Any, ...], Any, Any]]:
        """Arguments, future and result of the next calls that end; waits for one."""
        while not self.ended.has_ready():
            sleep(_POLL)
            if self.client.status != "running":
                raise SchedulerLostError(self.client)
            if monotonic() - self.looked > _WAIT:
                self._again()
        self.looked = monotonic()
        for future, result in self.ended.next_batch(block=False):
            if future.key in self.calls:  # else it was begun again meanwhile
                arguments, _ = self.calls.pop(future.key)
                yield arguments, future, result
                future.release()

    def _again(self) -> None:
        """Begin anew calls that no worker holds: dying workers may lose them without notice."""
        wait_for_worker(self.client)
        self.looked = monotonic()
        if not any(self.client.processing().values()):
            for arguments, future in list(self.calls.values()):
                del self.calls[future.key]
                self.client.cancel([future], force=True)
                self.begin(arguments)


def spread(
    client: Client, name: str, function: Callable[..., Any], calls: Iterable[tuple[Any, ...]], window: int
) -> Iterator[tuple[tuple[Any, ...], Any]]:
    """Call a function on workers, at most `window` times at once; yields the arguments and result or exception of each.

    Lost calls are repeated. Calls of which workers died are repeated last, one by one: others may have died with them.

    Raises SchedulerLostError where the scheduler is lost, and InputError where no worker is left.
    """
    from distributed import KilledWorker

    todo, under_way, deadly = iter(calls), _UnderWay(client, name, function), list[tuple[Any, ...]]()
    try:
        while True:
            for call in islice(todo, window - len(under_way.calls)):
                under_way.begin(call)
            if not under_way.calls:
                break
            for call, future, result in under_way.ends():
                if future.status == "finished":
                    yield call, result
                elif future.status == "lost":
                    under_way.begin(call)
                elif future.status != "error":
                    raise SchedulerLostError(client)
                elif window > 1 and isinstance(future.exception(), KilledWorker):
                    deadly.append(call)
                else:
                    yield call, future.exception()
    finally:
        left = [future for _, future in under_way.calls.values()]
        with suppress(Exception):  # the scheduler may be gone
            if left and client.status == "running":
                client.cancel(left)
    if deadly:
        yield from spread(client, name, function, deadly, 1)
