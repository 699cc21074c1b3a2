"""How the benchmarks time: the least of several calls, taken in turns, so that what else the machine does falls on all alike."""

from collections.abc import Callable
from time import perf_counter
from typing import Any

Call = Callable[[], Any]


def least(calls: dict[str, Call], repeats: int, number: int = 1) -> dict[str, float]:
    """The least time of each call, s, over turns of `number` calls in a row; each is called once before, to warm up."""
    for call in calls.values():
        call()
    times = dict.fromkeys(calls, float("inf"))
    for _ in range(repeats):
        for name, call in calls.items():
            start = perf_counter()
            for _ in range(number):
                call()
            times[name] = min(times[name], (perf_counter() - start) / number)
    return times


def once(call: Call) -> float:
    """The time of a single call, s, for what takes long."""
    start = perf_counter()
    call()
    return perf_counter() - start
