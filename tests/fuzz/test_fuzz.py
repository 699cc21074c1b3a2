import time

import pytest

from .runner import fuzz, server

BUDGET = 20.0  # seconds that the suite spends here


@pytest.mark.slow
def test_any_input_ends_with_a_result_or_one_sentence() -> None:
    """Exit code 0, 2 or 3; at 2 one sentence of bounded length and nothing written; inputs unchanged; within 20 s and 2 GiB; pages without script."""
    # at least a quarter of the inputs pass the reader, so that what comes after it is tried as well. Longer: `python -m
    # tests.fuzz --minutes 60`
    with server() as running:
        fuzz(running, time.monotonic() + BUDGET, least=60)
        assert running.runs >= 60
        assert running.past >= running.runs / 4, str(running)
