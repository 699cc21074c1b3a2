"""One round of fuzzing: cases drawn from one seed until there are enough, or time is up."""

import time
from collections.abc import Callable
from pathlib import Path

import pandas as pd
from hypothesis import HealthCheck, given, seed, settings

import bristle

from .inputs import Case, cases, logs
from .runner import Server

_EXPERIMENT = """
joint: {name: wrist}
signals:
  velocity: {column: v, unit: rad/s}
  torque: {column: tau, unit: N*m}
runs:
  - {files: points.csv, experiment: points}
  - files: tracking.csv
    experiment: tracking
    signals: {time: {column: t, unit: s}, position: {column: q, unit: rad}}
fit: {decimation: 2}
"""


Found = Callable[[Case, AssertionError], None]


def good_results(folder: Path) -> str:
    """The text of a results file with static fits and fits of moving runs."""
    for kind in ("points", "tracking"):
        pd.DataFrame(logs()[kind]).to_csv(folder / f"{kind}.csv", index=False)
    (folder / "e.yaml").write_text(_EXPERIMENT, encoding="utf-8")
    return bristle.identify(folder / "e.yaml").to_json()


def fuzz(
    running: Server, results: str, end: float, *, first: int = 0, most: int = 400, found: Found | None = None
) -> None:
    """Try up to so many cases of one seed until `end` (by time.monotonic).

    What fails is made small and raised, by Hypothesis; or, where `found` is given, told to that, and the next is tried.
    """
    failed = False

    @seed(first)
    @settings(max_examples=most, deadline=None, database=None, suppress_health_check=list(HealthCheck))
    @given(cases(results))
    def tried(case: Case) -> None:
        nonlocal failed
        if failed or time.monotonic() < end:  # what failed is made small even when time is up
            try:
                running.check(case)
            except AssertionError as defect:
                if found is None:
                    failed = True
                    raise
                found(case, defect)

    tried()
