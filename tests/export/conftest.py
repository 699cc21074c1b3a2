"""Joints as they are handed over, from the embedded report."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest

import bristle
from bristle.model.laws.parts import FASTEST, Law
from bristle.model.laws.registry import competing, law_named
from bristle.model.parameters import SIGNED, ParameterName, unit
from bristle.questions.export.exported import ExportedJoint, ExportedParameter, Origin, exported

RESULTS = Path(__file__).parents[2] / "reports" / "edro" / "results.json"
Handed = Callable[..., ExportedJoint]
OTHERS = (*competing()[1:], law_named("free-exponent"), law_named("free-exponent+quadratic"))
"""Laws beside the paper's."""


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


def of_law(joint: ExportedJoint, law: Law) -> ExportedJoint:
    """The joint with another law of friction: v_end is a third of its fastest speed, terms are below zero up and above it down."""
    end = joint.fastest / 3
    rows = []
    for d, p, factor in zip(SIGNED, joint.curves, (-0.3, 0.2), strict=True):
        values = {own.name: own.searched[0] * 2.6 for own in law.peak.own}
        values |= {term.coefficient.name: factor * p.alpha_2 / float(term.rate(end)) for term in law.terms}
        values |= {FASTEST: end} if law.terms else {}
        rows += [
            ExportedParameter(
                parameter=ParameterName(name, d), value=value, unit=unit(name, joint.kind), standard_error=None,
                interval=None, source="static",
            )
            for name, value in values.items()
        ]  # fmt: skip  # a list of values
    return replace(joint, law=law, parameters=(*joint.parameters, *rows))
