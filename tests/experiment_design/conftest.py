"""The plan that several tests look at."""

from pathlib import Path

import numpy as np
import pytest

import bristle
from bristle.arrays import Array
from bristle.questions.experiment_design.plan import Plan
from bristle.questions.experiment_design.velocities import DesignProblem

from ..conftest import few_motions_tried


@pytest.fixture(scope="session")
def gripper(edro_results: Path) -> Plan:
    """The plan for gripper rotation of the embedded default, which all kinds of runs were made of, as its report has it."""
    with few_motions_tried(40):
        return bristle.plan(edro_results, joint="gripper rotation")


def spaced_speeds(problem: DesignProblem, count: int, kind: str) -> Array:
    """As many speeds over the problem's range, spaced evenly (`even`) or evenly in log(v) (`log`), rad/s, (count,)."""
    return np.asarray((np.linspace if kind == "even" else np.geomspace)(problem.low, problem.high, count))
