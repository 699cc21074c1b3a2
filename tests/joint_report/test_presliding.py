"""What presliding runs showed, as tables and text."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np

from bristle.identification.results import Joint
from bristle.questions.joint_report import results_file, tables
from bristle.questions.joint_report.text import fit_report

from .conftest import (
    TABLE_1,
    loaded,
    nothing_seen,
    only,
    slow_fit,
)

GOLDEN = Path(__file__).parent / "presliding_report.txt"


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
