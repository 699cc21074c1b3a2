"""The plan that several tests look at."""

from pathlib import Path

import pytest

import bristle
from bristle.questions.experiment_design.plan import Plan

from ..conftest import few_motions_tried


@pytest.fixture(scope="session")
def gripper() -> Plan:
    """The plan for gripper rotation of the embedded default, which all kinds of runs were made of, as its report has it."""
    with few_motions_tried(40):
        return bristle.plan(Path(__file__).parents[2] / "reports" / "edro" / "results.json", joint="gripper rotation")
