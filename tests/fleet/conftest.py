"""A Dask cluster inside this process, one for all tests of a run."""

import logging
from collections.abc import Iterator
from typing import Any

import pytest


@pytest.fixture(scope="session")
def client() -> Iterator[Any]:
    distributed = pytest.importorskip("distributed", reason="needs the extra fleet")
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    local = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0", silence_logs=logging.CRITICAL
    )  # fmt: skip  # a call
    with local as cluster, distributed.Client(cluster, set_as_default=False) as client:
        yield client
