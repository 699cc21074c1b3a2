"""Measured logs of real drives, kept outside the project: the folder is named by BRISTLE_DATA."""

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def measured_data() -> Path:
    folder = os.environ.get("BRISTLE_DATA")
    if not folder:
        pytest.skip("BRISTLE_DATA does not name the folder of measured logs")
    return Path(folder)
