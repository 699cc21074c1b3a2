import os
import time
from itertools import count

import pytest

from .runner import fuzz, server

SECONDS = float(os.environ.get("BRISTLE_FUZZ_SECONDS", "20"))  # that are spent here


@pytest.mark.slow
def test_any_input_ends_with_a_result_or_one_sentence() -> None:
    """Exit code 0, 2 or 3; at 2 one sentence of bounded length and nothing written; inputs unchanged; within 20 s and 2 GiB; pages without script."""
    # at least a tenth of the inputs end with a result, so that what comes after the reader is tried as well; 400 of each seed
    end, seeds = time.monotonic() + SECONDS, count()
    with server() as running:
        while time.monotonic() < end:
            fuzz(running, end, first=next(seeds), least=60)
        assert running.runs >= 60
        assert running.codes[0] + running.codes[3] >= running.runs / 10, str(running)
