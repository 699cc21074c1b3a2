"""One round of fuzzing: cases drawn from one seed until there are enough, or time is up."""

import time
from collections.abc import Callable

from hypothesis import HealthCheck, given, seed, settings

from .inputs import Case, cases
from .runner import Server

Found = Callable[[Case, AssertionError], None]


def fuzz(
    running: Server,
    results: str,
    end: float,
    *,
    first: int = 0,
    least: int = 0,
    most: int = 400,
    found: Found | None = None,
) -> None:
    """Try at least and at most so many cases of one seed, until `end` (by time.monotonic).

    What fails is made small and raised, by Hypothesis; or, where `found` is given, told to that, and the next is tried.
    """
    failed = False

    @seed(first)
    @settings(max_examples=most, deadline=None, database=None, suppress_health_check=list(HealthCheck))
    @given(cases(results))
    def tried(case: Case) -> None:
        nonlocal failed
        # what failed is made small even when time is up
        if failed or time.monotonic() < end or running.runs < least:
            try:
                running.check(case)
            except AssertionError as defect:
                if found is None:
                    failed = True
                    raise
                found(case, defect)

    tried()
