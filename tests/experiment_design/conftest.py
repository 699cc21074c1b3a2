"""The plan that several tests look at."""

from pathlib import Path

import pytest

import bristle
from bristle.questions.experiment_design.plan import Plan

from ..conftest import few_motions_tried


@pytest.fixture(scope="session")
def gripper(edro_results: Path) -> Plan:
    """The plan for gripper rotation of the embedded default, which all kinds of runs were made of, as its report has it."""
    with few_motions_tried(40):
        return bristle.plan(edro_results, joint="gripper rotation")
