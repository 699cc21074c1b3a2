"""What presliding runs showed as results.json, tables and text."""

import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np

from bristle.identification.fits import Presliding
from bristle.identification.results import Joint
from bristle.page.wording import METHODS
from bristle.questions.joint_report import results_file, sentences, tables
from bristle.questions.joint_report.text import fit_report

from .conftest import (
    QUANTUM,
    TABLE_1,
    closed_cycle,
    loaded,
    nothing_seen,
    only,
    outlier,
    slow_fit,
)

GOLDEN = Path(__file__).parent / "presliding_report.txt"


def read(joint: Joint) -> dict[str, Any]:
    """The joint as results.json holds it, after it was held to the schema."""
    document = json.loads(results_file.to_json([joint]))
    jsonschema.Draft202012Validator(results_file.schema()).validate(document)
    found: dict[str, Any] = document["joints"][joint.name]
    return found


# results.json


def test_json_holds_every_estimate_of_both_directions(slow: Joint) -> None:
    """Each direction has its four estimates, sigma_1, level, bias and breakaway, with every digit; the file validates."""
    whole = read(slow)["presliding"]
    found = whole["fits"]
    assert list(found) == ["+", "-"]
    for d, fit in (slow.presliding or Presliding(fits={}, breakaway={})).fits.items():
        assert {name: found[d][name]["value"] for name in METHODS} == {
            name: e.value for name, e in sentences.methods(fit).items()
        }
        assert found[d]["sigma_1"]["value"] == TABLE_1[d].sigma_1
        assert [found[d][f"bias_{x}"] for x in ("on_edge", "mean", "spread")] == [-0.024, -0.51, 0.28]
        level = (found[d]["level"], found[d]["level_standard_error"], found[d]["level_source"]["code"])
        assert level == (fit.level, 2e-4, "of-static-fit")
        assert (found[d]["recommended"], found[d]["quantum"], found[d]["counts"]) == ("edges", QUANTUM, 60)
    assert {d: e["value"] for d, e in whole["breakaway"].items()} == {"+": 0.025}


def test_json_holds_every_closed_cycle(slow: Joint) -> None:
    """One entry per loop; a slope that is none is null."""
    steep = replace(closed_cycle("x.csv"), secant=None)
    found = read(only(slow, loops=(closed_cycle("a.csv"), steep)))["presliding"]["loops"]
    assert found[0] == {
        "file": "a.csv", "start": 100, "stop": 500, "torque_amplitude": 0.01, "displacement_amplitude": 0.002,
        "loss": 3e-5, "secant": 5.0, "slope": 4.1, "inverse_slope": 6.1, "counts": 20,
    }  # fmt: skip  # one entry
    assert found[1]["secant"] is None


def test_json_without_presliding_runs_has_empty_entries(joint: Joint) -> None:
    """No runs: null, which validates."""
    assert read(joint)["presliding"] is None


def test_json_says_why_what_does_not_exist_is_null(slow: Joint) -> None:
    """Without a sigma_0 the value is null with a warning, and the bias of (14) is null; the open bound is "inf"."""
    found = read(only(slow, fits={"+": nothing_seen()}, breakaway={}))["presliding"]["fits"]["+"]
    assert [found[f"bias_{x}"] for x in ("on_edge", "mean", "spread")] == [None, None, None]
    assert (found["edges"]["value"], found["edges"]["interval"]) == (None, [12.5, "inf"])
    assert found["edges"]["warnings"]


def test_json_holds_the_warnings_of_the_runs_as_a_whole(slow: Joint) -> None:
    """What no direction owns stands among the warnings of the presliding runs."""
    assert [x["message"] for x in read(slow)["presliding"]["warnings"]] == [str(outlier("slow_2.csv"))]


# tables and text


def test_frame_has_sigma_after_the_static_rows_of_each_direction(slow: Joint) -> None:
    """sigma_0 is the recommended one; a direction that only presliding knows comes after all others."""
    frame = results_file.to_frame([slow])
    names = ["alpha_0", "alpha_1", "alpha_2", "v_s", "sigma_0", "sigma_1"]
    assert list(frame["parameter"]) == 2 * names
    assert list(frame["direction"]) == 6 * ["+"] + 6 * ["-"]
    assert list(frame[frame["parameter"] == "sigma_0"]["value"]) == [TABLE_1[d].sigma_0 for d in ("+", "-")]
    both = replace(slow, static={"both": slow.static["+"]})
    assert list(results_file.to_frame([both])["direction"]) == 4 * ["both"] + 2 * ["+"] + 2 * ["-"]


def test_parameters_know_the_true_sigma_and_its_absence(slow: Joint) -> None:
    """Simulated: true and error beside sigma_0 and sigma_1; a truth that is nan is missing in table and file; one of both is that of each."""
    frame = tables.parameters([slow]).set_index(["direction", "parameter"])
    assert frame.loc[("-", "sigma_0"), "error_percent"] == 0.0
    assert frame.loc[("+", "sigma_0"), "inside"] is True
    half = replace(slow, truth={"both": TABLE_1["+"]._replace(sigma_1=float("nan"))})
    frame = tables.parameters([half]).set_index(["direction", "parameter"])
    assert frame.loc[("-", "sigma_0"), "true"] == TABLE_1["+"].sigma_0
    assert np.isnan(float(str(frame.loc[("-", "sigma_1"), "true"])))
    assert frame.loc[("-", "sigma_1"), "inside"] is None
    assert read(half)["truth"]["both"]["sigma_1"] is None


def test_presliding_table_has_the_methods_side_by_side(slow: Joint) -> None:
    """Four rows per direction, of which one is recommended, each with its error against the truth."""
    frame = tables.all_tables([slow])["presliding"]
    assert list(frame.columns) == [
        "joint", "direction", "method", "value", "unit", "standard_error", "lower", "upper", "true", "error_percent", "inside", "recommended",
    ]  # fmt: skip  # a list of words
    assert list(frame["method"]) == 2 * ["printed", "corrected", "edges", "samples"]
    assert list(frame[frame["recommended"]]["method"]) == ["edges", "edges"]
    np.testing.assert_allclose(frame["error_percent"], 2 * [-50.0, -45.0, 0.0, 5.0], atol=1e-9)


def test_breakaway_and_hysteresis_tables(slow: Joint) -> None:
    """One row per loading that broke away, with its distance from the median, and one per closed cycle; every unit is in the table of units."""
    made = tables.all_tables([slow])
    np.testing.assert_allclose(made["breakaway"]["from_median_percent"], [-20.0, 0.0], atol=1e-9)
    assert list(made["hysteresis"]["loss"]) == [3e-5, 4e-5, 5e-5, 6e-5]
    units = made["units"].set_index("column")["unit"]
    assert (units["loss"], units["slope"], units["breakaway"]) == ("J", "N*m/rad", "N*m")


def test_tables_without_presliding_runs_have_their_columns(joint: Joint) -> None:
    """No runs: the three tables are empty, with the same columns."""
    made = tables.all_tables([joint])
    assert [len(made[name]) for name in ("presliding", "breakaway", "hysteresis")] == [0, 0, 0]
    assert list(made["presliding"].columns) == list(tables.presliding([loaded()]).columns)


def test_presliding_report_is_the_golden_file(slow: Joint) -> None:
    """The blocks of the printed report are presliding_report.txt, word for word; BRISTLE_REGENERATE=1 rewrites it."""
    text = fit_report(
        [replace(only(slow, fits={"+": slow_fit("+"), "-": nothing_seen("-")}), static={}, crosscheck={})]
    )
    if os.environ.get("BRISTLE_REGENERATE"):
        GOLDEN.write_text(text, encoding="utf-8")
    assert text == GOLDEN.read_text(encoding="utf-8")
