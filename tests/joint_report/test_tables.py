"""What was found as tables and as text: moving and presliding runs beside the other stages."""

import math
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bristle.identification.fits import TrackingFit
from bristle.identification.results import Joint
from bristle.model.parameters import ParameterName
from bristle.page.wording import in_print
from bristle.questions.joint_report import results_file, tables
from bristle.questions.joint_report.sentences import agreement
from bristle.questions.joint_report.text import fit_report

from .conftest import TABLE_1, loaded, nothing_seen, only, slow_fit
from .moving import NOT_SHOWN, compared, moving, tracked, without


@pytest.fixture(scope="module")
def moved() -> Joint:
    """The gripper with every stage."""
    return moving()


def test_the_printed_report_is_the_golden_file(joint: Joint, slide: Joint, slow: Joint, moved: Joint) -> None:
    """Of static fits, slow loading and moving runs, word for word; BRISTLE_REGENERATE=1 rewrites them."""
    fits = {"+": slow_fit("+"), "-": nothing_seen("-")}
    reports = {
        "fit": [joint, slide], "presliding": [replace(only(slow, fits=fits), static={}, crosscheck={})],
        "tracking": [replace(moved, static={}, crosscheck={}, presliding=None)],
    }  # fmt: skip  # a table
    for name, joints in reports.items():
        golden, text = Path(__file__).parent / f"{name}_report.txt", fit_report(joints)
        if os.environ.get("BRISTLE_REGENERATE"):
            golden.write_text(text, encoding="utf-8")
        assert text == golden.read_text(encoding="utf-8"), name


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


def of(fit: TrackingFit | None) -> TrackingFit:
    """The fit that is known to be there."""
    assert fit is not None
    return fit


def test_frame_gains_rows_and_last_columns(moved: Joint, joint: Joint) -> None:
    """The joint fit (without one, the moving runs) stands after the other stages, named in `source`; static fits alone have their old columns.

    `use` marks one row of each parameter, that of `chosen`.
    """
    frame = results_file.to_frame([moved])
    old = list(results_file.to_frame([joint]).columns)
    assert list(frame.columns) == [*old, "source", "use"]
    used = frame[frame["use"]]
    assert not used.duplicated(["direction", "parameter"]).any()
    assert set(used["source"]) == {"joint"}
    assert set(used["parameter"]) == set(frame["parameter"])
    assert old[-1] == "warnings"
    assert list(frame["source"]) == 2 * (4 * ["static"] + 2 * ["presliding"]) + 13 * ["joint"]
    assert list(frame["direction"])[12:] == 6 * ["+"] + 6 * ["-"] + ["shared"]
    assert frame["value"].iloc[-1] == of(moved.joint_fit).parameters[ParameterName.parse("inertia")].value
    alone = results_file.to_frame([replace(moved, joint_fit=None)])
    assert list(alone["source"])[12:] == 13 * ["tracking"]


def test_tracking_table_has_both_fits_with_the_truth(moved: Joint) -> None:
    """A row per fit and parameter: error against the truth, whether the interval holds it, and what counts added."""
    frame = tables.all_tables([moved])["tracking"]
    assert list(frame.columns) == [
        "joint", "fit", "direction", "parameter", "value", "unit", "standard_error", "lower", "upper", "true", "error_percent", "inside",
        "count_bias",
    ]  # fmt: skip  # a list of words
    row = frame.set_index(["fit", "direction", "parameter"]).to_dict("index")
    assert row["tracking", "+", "sigma_0"]["error_percent"] == pytest.approx(5.0)
    assert row["tracking", "+", "sigma_0"]["inside"] is False
    assert row["tracking", "+", "sigma_0"]["count_bias"] == -0.02
    assert row["joint", "-", "sigma_1"]["inside"] is True
    assert row["joint", "shared", "inertia"]["inside"] is None
    assert math.isnan(row["tracking", "-", "alpha_1"]["value"])


def test_comparisons_and_hold_outs_have_tables(moved: Joint, joint: Joint) -> None:
    """Each comparison with its unit, each hold-out run per fit; without moving runs the tables are empty with the same columns."""
    made, none = tables.all_tables([moved]), tables.all_tables([joint])
    assert list(made["consistency"]["unit"]) == ["N*m", "N*m", "N*m", "N*m/rad"]
    assert list(made["consistency"]["difference_in_se"].fillna(99.0)) == [0.5, -3.2, 99.0, 1.0]
    assert list(made["tracking_hold_out"]["relative_error_of_fit"]) == [1.25, 1.3]
    for name in ("tracking", "consistency", "tracking_hold_out"):
        assert len(none[name]) == 0
        assert list(none[name].columns) == list(made[name].columns)


def test_table_1_is_complete(moved: Joint) -> None:
    """All six parameters per direction and what they share, once each, from the joint fit, with the truth."""
    frame = tables.all_tables([moved])["table_1"]
    names = list(TABLE_1["+"]._fields)
    assert list(frame["parameter"]) == [*names, *names, "inertia"]
    assert list(frame["direction"]) == 6 * ["+"] + 6 * ["-"] + ["shared"]
    assert set(frame["source"]) == {"joint"}
    np.testing.assert_allclose(frame["error_percent"][:12], 1.0)
    assert frame["inside"][:12].all()


def test_table_1_takes_the_best_stage_that_knows(moved: Joint) -> None:
    """Without a joint fit the moving runs, to whose curve no other stage adds what they do not show; else static and presliding."""
    alone = tables.all_tables([replace(moved, joint_fit=None)])["table_1"].set_index(["direction", "parameter"])
    assert alone["source"].value_counts().to_dict() == {"tracking": 13}
    assert alone["value"].isna()[("-", "alpha_1")]
    before = tables.all_tables([replace(moved, joint_fit=None, tracking=None)])["table_1"]
    assert list(before["source"]) == 2 * (4 * ["static"] + 2 * ["presliding"])


def test_table_1_lists_nothing_twice(moved: Joint) -> None:
    """What the moving runs know of both directions together replaces a stage's value of each, and of each that of both."""
    together = {
        ParameterName.parse(name): of(moved.joint_fit).parameters[ParameterName.parse(f"{name}+")]
        for name in TABLE_1["+"]._fields
    }
    of_both = replace(moved, joint_fit=tracked(parameters=together), tracking=None)
    assert list(tables.all_tables([of_both])["table_1"]["direction"]) == 6 * ["both"]
    static = replace(moved, static={"both": moved.static["+"]}, presliding=None)
    assert set(tables.all_tables([static])["table_1"]["source"]) == {"joint"}
    half = replace(static, joint_fit=without(of(moved.joint_fit), "alpha_1-"), tracking=None)
    rows = tables.all_tables([half])["table_1"]
    assert list(rows[rows["parameter"] == "alpha_1"]["direction"]) == ["+", "-"]


def test_agreement_is_one_sentence(moved: Joint, joint: Joint) -> None:
    """It counts what agrees, names the largest difference and what cannot be compared; without comparisons it is empty."""
    assert in_print(agreement(moved)) == (
        "2 of 3 parameters agree between their own stage and the moving data; the largest difference is 3.2 standard errors (α₀ (−)); "
        "1 more not identifiable from the tracking runs."
    )
    unseen = replace(moved, consistency=(compared("alpha_1-", None, NOT_SHOWN),))
    assert agreement(unseen) == "The moving data show none of the parameters that the other stages know."
    assert agreement(joint) is None
