"""The plan that several tests look at."""

import pytest

import bristle
from bristle.questions.experiment_design.plan import Plan
from bristle.simulation.edro import experiments

from ..conftest import few_motions_tried


@pytest.fixture(scope="session")
def gripper() -> Plan:
    """The plan for gripper rotation of the embedded default, which all kinds of runs were made of."""
    with few_motions_tried(40):
        return bristle.plan(experiments()[0])
