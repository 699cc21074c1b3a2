"""What moving runs showed, as the page has it."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from bristle.identification.results import Joint
from bristle.questions.joint_report.next_measurements import next_measurements

from ..pages import page_text, report_text
from ..sameness import of_kind
from .conftest import HOSTILE, listed, sections_of, write_report
from .moving import CORRELATED, DIFFER, IPOPT, NOT_SHOWN, UNSEEN, moving, tracked


@pytest.fixture(scope="module")
def moved() -> Joint:
    """The gripper with every stage."""
    return moving()


def written(joint: Joint, folder: Path) -> str:
    """The pages of a report of one joint."""
    write_report([joint], folder)
    return report_text(folder)


def test_section_shows_fits_figures_and_comparison(moved: Joint, tmp_path: Path) -> None:
    """The pages have each fit with its errors and starts, bias that matters and none that does not, hold-outs, verdicts and captions."""
    text = written(moved, tmp_path / "out")
    section = page_text(tmp_path / "out" / "moving.html")
    for words in ("Moving runs", "Joint fit", "Relative error 1.25 %", "3 of 4 starts", "Initialised at the other stages",
                  "1701 samples, 2 segments", "-0.02 N·m/rad (-0.3 standard errors)", "held.csv", str(IPOPT),
                  "thinned to 400 points"):  # fmt: skip  # words
        assert words in section
    for words in (str(DIFFER), str(NOT_SHOWN), "from 4.75 to 7.75 s", "segment 2 of 2", "parametric bootstrap"):
        assert words in text
    assert "0.0001 N·m/rad" not in section
    captions = re.findall(r"<figcaption[^>]*>(.*?)</figcaption>", section, flags=re.DOTALL)
    assert ["<strong>SIMULATED" in caption for caption in captions] == [True]
    assert set(re.findall(r'href="#([^"]+)"', text)) <= set(re.findall(r'id="([^"]+)"', text))


def test_all_parameters_stand_first(moved: Joint, joint: Joint) -> None:
    """The parameters of the joint are all six per direction, and the verdict counts them once; with static fits alone nothing changes."""
    shown = sections_of(moved, "joints.html")
    table, alone = shown["Parameters of gripper rotation"].table, shown["From static and slow runs alone"].table
    assert table is not None
    assert alone is not None
    assert len(table.cells.rows) == 13
    assert table.cells.columns[:3] == ("direction", "parameter", "source")
    assert dict(shown["How each fit ended"].facts)["truth"] == "12 of 12 true values lie inside their 95 % intervals."
    assert len(alone.cells.rows) == 12
    assert "From static and slow runs alone" not in sections_of(joint, "joints.html")


def test_a_joint_without_moving_runs_has_no_section(slow: Joint, tmp_path: Path) -> None:
    """No section, no link to it, no figure."""
    text = written(slow, tmp_path / "out")
    assert "rotation-tracking" not in text
    assert "rotation--tracking" not in text
    assert not list((tmp_path / "out" / "figures").glob("*-tracking*"))


def test_warnings_are_listed_and_counted(moved: Joint) -> None:
    """Warnings of the fit, of a parameter, and stages that differ stand in the list with what they are about."""
    found = listed(moved.with_subjects())
    assert found[str(CORRELATED)] == "moving runs"
    assert found[str(UNSEEN)] == "moving runs alpha_1-"
    assert found[str(DIFFER)] == "static stage and moving runs alpha_0-"


def test_moving_runs_alone_make_a_report(moved: Joint, tmp_path: Path) -> None:
    """Without any other stage the page has the section and all parameters, no column for a joint fit and no comparison; its links land."""
    alone = replace(moved, static={}, crosscheck={}, presliding=None, joint_fit=None, consistency=(), segments=())
    text = written(alone, tmp_path / "out")
    assert "Do the stages agree?" not in text
    assert "joint fit, 95 %" not in text
    assert "alone</summary>" not in text
    assert set(re.findall(r'href="#([^"]+)"', text)) <= set(re.findall(r'id="([^"]+)"', text))


def test_hold_out_of_moving_runs_is_one(moved: Joint) -> None:
    """Nobody is asked to hold back a run where a moving run was held back."""
    static = {d: replace(fit, hold_out=()) for d, fit in moved.static.items()}
    assert not of_kind(next_measurements(replace(moved, static=static)), "hold-back")
    bare = replace(moved, static=static, tracking=tracked(hold_out=()), joint_fit=None)
    assert of_kind(next_measurements(bare), "hold-back")


def test_two_writes_give_the_same_bytes_and_names_stay_text(tmp_path: Path) -> None:
    """With moving runs too a report is a function of its joint, and markup in names and files is text in every place."""
    joint = moving(HOSTILE, HOSTILE)
    for name in ("a", "b"):
        written(joint, tmp_path / name)
    trees = [
        {p.relative_to(tmp_path / n): p.read_bytes() for p in (tmp_path / n).rglob("*") if p.is_file()} for n in "ab"
    ]
    assert trees[0] == trees[1]
    text = report_text(tmp_path / "a")
    assert "<script" not in text
    assert text.count("&lt;script&gt;") > 10
    for path in (tmp_path / "a").glob("*.html"):
        ids = re.findall(r'\sid="([^"]+)"', page_text(path))
        assert len(ids) == len(set(ids))


def test_a_fit_that_predicts_the_position_says_so(moved: Joint, tmp_path: Path) -> None:
    """Words, unit and captions are those of a simulated position; nothing calls it a torque."""
    changes: dict[str, Any] = {"quantity": "position", "windows": 34, "starts_of_runs": (0,)}
    alone = replace(moved, tracking=tracked(**changes), joint_fit=None, consistency=())
    written(alone, tmp_path / "out")
    section = page_text(tmp_path / "out" / "moving.html")
    words = re.sub(r"<svg.*?</svg>", "", section, flags=re.DOTALL)
    for said in (
        "the motor is simulated",
        "rms residual 0.0004 rad",
        "simulated in 34 windows",
        "Measured position",
        "only the initial values were fitted",
    ):
        assert said in words
    assert "torque" not in words
