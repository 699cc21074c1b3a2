"""Joints as they are handed over, from the embedded report."""

import subprocess
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest

import bristle
from bristle.model.laws.parts import FASTEST, Law
from bristle.model.laws.registry import competing, law_named
from bristle.model.parameters import SIGNED, Direction, ParameterName, unit
from bristle.questions.export.exported import ExportedJoint, ExportedParameter, Origin, exported

Handed = Callable[..., ExportedJoint]
OTHERS = (*competing()[1:], law_named("free-exponent"), law_named("free-exponent+quadratic"))  # laws beside the paper's
HOSTILE = (
    """a"b'c<d>&e""", "a<b>&amp;", "-->", "--> <motor/>", "]]>", "<!-- x", "*/", "*/ #error", "]]> */ /* ??/", "??/\n*/", "a\nb\r\tc",
    "${x} $(y) %s%n {0} {{ y }}", "\u202eabc\u202c\u200f", "\0\x1b[31m", "x" * 10_000, "关节 ∑ ß ą Ð", "\\input{/etc/passwd}", "\\", "", " ",
    "'''\"\"\"\\", '\\\n#include "/etc/passwd"', "\x85\u2028", "%{", "%}", "#}", "'); system('x'); ('", "__import__('os')", "end", "1 2", "~",
    "null", "2020-01-01", "1e3", "- a: b", "--- x", "#!", "&a *a", "!!python/object:x", "step", "params",
)  # fmt: skip  # a list
"""What a joint may be called."""
SURROGATE = "\ud800"  # the same, of a name that is no text of UTF-8


@cache
def _joint(results_file: Path, name: str) -> ExportedJoint:
    results = bristle.read_results(results_file)
    joint = results.joint(name)
    origin = Origin(bristle="0", results_sha256="0" * 64, experiment="edro.yaml", logs={"ramp.csv": "1" * 64})
    return exported(joint, results.logs.experiment_of(joint), origin)


@pytest.fixture(scope="session")
def handed(edro_results: Path) -> Handed:
    """A joint of the embedded report as it is handed over, with some fields changed."""

    def make(of: str = "gripper rotation", /, **changes: Any) -> ExportedJoint:
        return replace(_joint(edro_results, of), **changes)

    return make


def assumed(joint: ExportedJoint, *names: str) -> ExportedJoint:
    rows = (
        replace(x, source="assumed", standard_error=None, interval=None) if x.parameter.name in names else x
        for x in joint.parameters
    )
    return replace(joint, parameters=tuple(rows))


def scaled(joint: ExportedJoint, J: float = 1.0, **factors: float) -> ExportedJoint:
    """The joint with friction parameters of both directions, and the inertia J, times something."""
    rows = (replace(x, value=x.value * factors.get(x.parameter.name, 1.0)) for x in joint.parameters)
    return replace(joint, parameters=tuple(rows), inertia=joint.inertia and J * joint.inertia)


def row(name: str, d: Direction, value: float, joint: ExportedJoint, source: str) -> ExportedParameter:
    si = unit(name, joint.kind)
    return ExportedParameter(
        parameter=ParameterName(name, d), value=value, unit=si, standard_error=None, interval=None, source=source
    )


def beside(joint: ExportedJoint, **values: float) -> ExportedJoint:
    """The joint with what was identified beside its friction, of no direction, as an offset."""
    rows = (row(name, Direction.SHARED, value, joint, "tracking") for name, value in values.items())
    return replace(joint, parameters=(*joint.parameters, *rows))


def of_law(joint: ExportedJoint, law: Law) -> ExportedJoint:
    """The joint with another law of friction: v_end is a third of its fastest speed, terms are below zero up and above it down."""
    end = joint.fastest / 3
    rows = []
    for d, p, factor in zip(SIGNED, joint.curves, (-0.3, 0.2), strict=True):
        values = {own.name: own.searched[0] * 2.6 for own in law.peak.own}
        values |= {term.coefficient.name: factor * p.alpha_2 / float(term.rate(end)) for term in law.terms}
        values |= {FASTEST: end} if law.terms else {}
        rows += [row(name, d, value, joint, "static") for name, value in values.items()]
    return replace(joint, law=law, parameters=(*joint.parameters, *rows))


def same(joint: ExportedJoint) -> ExportedJoint:
    """With the positive set in both directions."""
    positive = [x for x in joint.parameters if x.parameter.direction is Direction.POSITIVE]
    both = [replace(x, parameter=ParameterName(x.parameter.name, Direction.NEGATIVE)) for x in positive]
    rest = [x for x in joint.parameters if x.parameter.direction not in SIGNED]
    return replace(joint, parameters=(*positive, *both, *rest))


def run(folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)  # noqa: S603  # our own words
