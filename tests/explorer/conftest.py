"""The pages that the tests of the explorer look at: the embedded set's, and that of a joint with hostile names."""

from pathlib import Path
from typing import NamedTuple

import pytest

import bristle
from bristle.questions.explorer.page import Explorer

from ..conftest import experiment, speeds, table

HOSTILE = "</script><img src=x onerror=\"document.title='run'\"><!-- {{ 7*7 }} \\u003c"
"""A joint's name that ends a script, loads an image and opens a comment."""
HOSTILE_FILE = "<img src=x onerror=document.title='run'>.csv"


class Explored(NamedTuple):
    """What was identified, and its page."""

    results: bristle.Results
    page: Explorer


@pytest.fixture(scope="session")
def edro() -> Explored:
    """The embedded set's, as its report has it."""
    results = bristle.read_results(Path(__file__).parents[2] / "reports" / "edro" / "results.json")
    return Explored(results, bristle.explore(results))


@pytest.fixture(scope="session")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Explored:
    """A joint of points; its name, and that of its data file, are hostile."""
    folder = tmp_path_factory.mktemp("hostile")
    (folder / HOSTILE_FILE).write_text(table(speeds()), encoding="utf-8")
    path = folder / "wrist.yaml"
    path.write_text(experiment(joint=HOSTILE, data=HOSTILE_FILE), encoding="utf-8")
    results = bristle.identify(path)
    return Explored(results, bristle.explore(results))
