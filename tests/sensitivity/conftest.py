"""The study that several tests look at."""

from pathlib import Path

import pytest

import bristle
from bristle.questions.sensitivity.study import SensitivityStudy

from ..conftest import speeds, write


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of a joint of points in both directions; its explored page is written beside it."""
    path = tmp_path_factory.mktemp("sensitivity")
    write(path, speeds(), stem="e")
    return path


@pytest.fixture(scope="session")
def known(folder: Path) -> SensitivityStudy:
    return bristle.sensitivity(folder / "e.yaml", samples=0)
