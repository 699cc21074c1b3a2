"""What bristle must find in its embedded default (simulated, seed 0)."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import bristle
from bristle.api import Results
from bristle.identification.fits import Estimate
from bristle.model.parameters import Direction, Lugre, ParameterName
from bristle.questions.joint_report import results_file
from bristle.simulation.edro import TABLE_1

STATIC = ("alpha_0", "alpha_1", "alpha_2", "v_s")


@pytest.fixture(scope="module")
def results(edro_results: Path) -> Results:
    """All four joints, all stages."""
    return bristle.read_results(edro_results)


def test_nothing_stands_for_the_embedded_joints(results: Results, edro_report: Path) -> None:
    """Without an experiment the four joints of Ed-Ro are identified, in the order of Table 1, and progress is told of each."""
    names, told = (
        list(TABLE_1),
        [*map(tuple, json.loads(edro_report.with_name("edro.told.json").read_text(encoding="utf-8")))],
    )
    assert [joint.name for joint in results.joints] == names
    assert [step for step in told if step[0] in {f"identifying {name}" for name in names}] == [
        (f"identifying {name}", k, 4) for k, name in enumerate(names)
    ]


def holds(e: Estimate, true: float) -> bool:
    """Whether an interval holds the truth."""
    return e.interval is not None and e.interval[0] <= true <= e.interval[1]


def test_static_parameters_are_found(results: Results) -> None:
    """At least 26 of 32 true values lie in their intervals, alpha_0 and alpha_2 within 2 %; grid and full fit agree to 1 % of a standard error."""
    inside = 0
    for joint in results.joints:
        for d, p in joint.truth.items():
            found = joint.static[d].parameters
            inside += sum(holds(found[name], getattr(p, name)) for name in STATIC)
            assert found["alpha_0"].value == pytest.approx(p.alpha_0, rel=0.02)
            assert found["alpha_2"].value == pytest.approx(p.alpha_2, rel=0.02)
            assert max(map(abs, joint.crosscheck[d].difference_in_se.values())) < 0.01
    assert inside >= 26


def test_presliding_finds_the_stiffness(results: Results) -> None:
    """In at least 12 of 16 cases the interval of the edge-to-edge or the all-sample estimate holds the true sigma_0; sigma_1 is called a prior."""
    inside = 0
    for joint in results.joints:
        assert joint.presliding is not None
        for d, p in joint.truth.items():
            fit = joint.presliding.fits[d]
            inside += holds(fit.edges, p.sigma_0) + holds(fit.samples, p.sigma_0)
            assert fit.edges.value == pytest.approx(p.sigma_0, rel=0.05)
            assert fit.sigma_1.warnings[0].code == "prior"
    assert inside >= 12


def test_the_joint_fit_completes_table_1(results: Results) -> None:
    """At least 40 of the 48 true values lie in the intervals of the joint fit, the held-out torque is predicted to 2 %, and the stages agree."""
    inside = 0
    for joint in results.joints:
        fit = joint.joint_fit
        assert fit is not None
        inside += sum(
            holds(fit.parameters[ParameterName(name, Direction(d))], getattr(p, name))
            for d, p in joint.truth.items()
            for name in Lugre._fields
        )
        assert all(held.relative_error < 2 for held in fit.hold_out)
        assert len(fit.hold_out) == 1
        assert sum(c.verdict.code == "stage-agrees" for c in joint.consistency) >= 8
    assert inside >= 40


def test_cycles_close_or_are_said_to_drift(results: Results) -> None:
    """Each joint's second slow cycle is a hysteresis loop, or a warning says how far it drifts; at least two joints show a loop."""
    shown = [joint.presliding for joint in results.joints if joint.presliding]
    assert len(shown) == 4
    assert all(bool(p.loops) != any(warning.code == "open-cycles" for warning in p.warnings) for p in shown)
    assert sum(bool(p.loops) for p in shown) >= 2


def warned(value: Any) -> Iterator[str]:
    """The kind of each diagnostic of a results file that is critical or a caution, wherever it stands."""
    match value:
        case {"severity": severity, "code": str(kind), "message": _}:
            yield from [kind] if severity != "note" else []
        case dict():
            yield from (kind for x in value.values() for kind in warned(x))
        case list():
            yield from (kind for x in value for kind in warned(x))


def test_every_warning_has_a_cause_that_is_listed(results: Results) -> None:
    """What is critical or a caution in the results has the codes that docs/warnings.md lists with a cause, and each of these is there."""
    page = (Path(__file__).parents[1] / "docs" / "warnings.md").read_text(encoding="utf-8")
    table = page.partition("its cause in the simulation")[2].partition("\n\n")[0]
    listed = {code for row in re.findall(r"^\| (`.*?) \|", table, re.MULTILINE) for code in re.findall(r"[\w-]+", row)}
    assert set(warned(json.loads(results_file.to_json(results.joints)))) == listed
