import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import bristle
from bristle.arrays import Array
from bristle.questions.experiment_design.plan import Plan
from bristle.questions.experiment_design.report import report

from ..conftest import few_motions_tried, speeds, write

NUMBER = re.compile(r"\d (%|s|runs|times|(rad|m)(/s)?|N(·m)?)(?![\w/])")
"""A number with its unit, or with what it counts."""


@pytest.fixture(scope="module", autouse=True)
def quick() -> Iterator[None]:
    """Few motions are tried: what is tested holds for any number."""
    with few_motions_tried():
        yield


def captions(plan: Plan) -> dict[str, str]:
    """What the caption of each figure begins with, by the name of its file."""
    return {figure.name: figure.caption for section in report(plan).sections for figure in section.drawings}


def of_points(folder: Path, aim: str, *, both: bool, kind: str = "revolute", fit: str = "") -> Plan:
    path = write(folder, speeds(both=both))
    text = path.read_text() + fit
    if kind == "prismatic":
        text = text.replace("{name: ", "{kind: prismatic, name: ").replace("rad/s", "m/s").replace("N*m", "N")
    path.write_text(text)
    return bristle.plan(path, velocities=4, aim=aim)


@pytest.mark.parametrize(
    ("aim", "both", "kind", "fit"),
    [
        ("v_s", False, "revolute", ""),
        ("all", True, "prismatic", ""),
        ("alpha_0", True, "revolute", "fit: {directions: symmetric}\n"),
        ("inertia", True, "revolute", "plan: {minimum_velocity: 0.5 rad/s}\n"),
    ],
)
def test_each_caption_begins_with_a_number(tmp_path: Path, aim: str, both: bool, kind: str, fit: str) -> None:
    """Of points in one direction, for one parameter, of a slide, of one law for both directions: each figure says a number with a unit at once."""
    found = [*captions(of_points(tmp_path, aim, both=both, kind=kind, fit=fit)).values()]
    assert len(found) == 4
    assert all(NUMBER.search(finding) for finding in found), found
    assert not re.search("nan|inf|None|e[+-]0", " ".join(found))
    assert kind == "revolute" or "rad" not in " ".join(found)


def said(plan: Plan, figure: str) -> str:
    return captions(plan)[f"plan-{figure}"]


def relative(plan: Plan, errors: Array) -> Array:
    """Percent of the value."""
    return np.asarray(100 * errors / np.abs(plan.start.estimate))


def test_findings_are_those_of_the_results(gripper: Plan) -> None:
    """Errors, ratios, runs and limits in the captions are those of the plan: the widest, the most, the first and the last."""
    then = relative(gripper, gripper.standard_errors["with motion"])
    now = relative(gripper, gripper.standard_errors["now"])
    widest = int(np.argmax(then))
    numbers = [float(x) for x in re.findall(r"([\d.]+) %", said(gripper, "intervals"))]
    assert numbers == pytest.approx([then[widest], now[widest]], rel=0.05)
    for own, part in zip(gripper.velocities, said(gripper, "velocities").split("; "), strict=True):
        assert f": {own.chosen.speeds.size} runs at {np.unique(own.chosen.speeds).size} speeds, " in part
        assert f"{own.chosen.speeds.min():.3g} to {own.chosen.speeds.max():.3g} rad/s" in part
    peak = float(np.abs(gripper.references[-1].velocity).max())
    assert said(gripper, "motion").startswith(
        f"Peak velocity {peak:.3g} rad/s, {gripper.limits.velocity:.3g} rad/s allowed"
    )
    assert said(gripper, "whole").startswith(
        f"The plan takes {gripper.duration:.3g} s: 24 runs at constant velocity, 2 of"
    )
    # a parameter that the plan leaves open is named in place of the widest; one that it does not improve has the same error twice
    errors = gripper.standard_errors["with motion"].copy()
    errors[[0, 2]] = np.inf, 3 * gripper.start.estimate[2]
    opened = replace(gripper, standard_errors={**gripper.standard_errors, "with motion": errors})
    assert (
        said(opened, "intervals") == "Standard error over 200 %, not identifiable, even after the plan: α₀ (+), α₂ (+)."
    )
    assert said(replace(opened, aim="sigma_0"), "intervals").count("% of σ₀") == 2
    same = replace(gripper, standard_errors=dict.fromkeys(gripper.standard_errors, gripper.standard_errors["now"]))
    numbers = re.findall(r"([\d.]+) %", said(same, "intervals"))
    assert numbers[0] == numbers[1]
