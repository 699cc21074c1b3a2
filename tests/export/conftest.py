"""Joints as they are handed over, from the embedded report."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest

import bristle
from bristle.questions.export.exported import ExportedJoint, Origin, exported

RESULTS = Path(__file__).parents[2] / "reports" / "edro" / "results.json"
Handed = Callable[..., ExportedJoint]


@cache
def _joint(name: str) -> ExportedJoint:
    results = bristle.read_results(RESULTS)
    joint = results.joint(name)
    origin = Origin(bristle="0", results_sha256="0" * 64, experiment="edro.yaml", logs={"ramp.csv": "1" * 64})
    return exported(joint, results.logs.experiment_of(joint)[0], origin)


@pytest.fixture(scope="session")
def handed() -> Handed:
    """A joint of the embedded report as it is handed over, with some fields changed."""

    def make(name: str = "gripper rotation", **changes: Any) -> ExportedJoint:
        return replace(_joint(name), **changes)

    return make
