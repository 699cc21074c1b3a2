"""What moving runs showed as results.json, tables and text."""

import json
import math
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

from bristle.identification.fits import TrackingFit
from bristle.identification.results import Joint
from bristle.model.parameters import ParameterName
from bristle.page.wording import in_print
from bristle.questions.joint_report import results_file, tables
from bristle.questions.joint_report.sentences import agreement
from bristle.questions.joint_report.text import fit_report

from ..names import named
from .conftest import TABLE_1
from .moving import DIFFER, IPOPT, NOT_SHOWN, UNSEEN, VALUES, compared, moving, tracked, without

GOLDEN = Path(__file__).parent / "tracking_report.txt"


@pytest.fixture(scope="module")
def moved() -> Joint:
    """The gripper with every stage."""
    return moving()


def of(fit: TrackingFit | None) -> TrackingFit:
    """The fit that is known to be there."""
    assert fit is not None
    return fit


def read(joint: Joint) -> dict[str, Any]:
    """The joint as results.json holds it, after it was held to the schema."""
    document = json.loads(results_file.to_json([joint]))
    jsonschema.Draft202012Validator(results_file.schema()).validate(document)
    found: dict[str, Any] = document["joints"][joint.name]
    return found


# results.json


def test_json_holds_both_fits_with_every_digit(moved: Joint) -> None:
    """Parameters keep their signed names and their values; free names, covariance, starts, count bias and hold-outs are those of the fit."""
    found = read(moved)
    for key, fit in (("tracking", of(moved.tracking)), ("joint_fit", of(moved.joint_fit))):
        own = found[key]
        assert {name: p["value"] for name, p in own["parameters"].items()} == {
            str(name): e.value for name, e in fit.parameters.items()
        }
        assert own["names"] == list(map(str, fit.names))
        np.testing.assert_array_equal(own["covariance"], fit.covariance)
        assert own["count_bias"] == {str(name): x for name, x in fit.count_bias.items()}
        assert own["hold_out"] == [{"file": "held.csv", "relative_error": 1.5}]
        assert (own["n"], own["starts"], own["reached"], own["condition"]) == (fit.n, fit.starts, fit.reached, 8.9)
    assert found["tracking"]["crosscheck"] is None
    assert found["joint_fit"]["crosscheck"]["verdict"]["code"] == IPOPT.code
    assert found["tracking"]["parameters"]["alpha_1-"]["warnings"][0]["message"] == str(UNSEEN)


def test_json_compares_the_stages(moved: Joint) -> None:
    """One entry per comparison; what the moving runs do not show is null, and the verdict says so."""
    found = read(moved)["consistency"]
    assert [x["parameter"] for x in found] == ["alpha_0+", "alpha_0-", "alpha_1-", "sigma_0+"]
    assert (found[1]["difference_in_se"], found[1]["verdict"]["message"]) == (-3.2, str(DIFFER))
    assert (found[2]["tracking_value"], found[2]["tracking_error"], found[2]["difference_in_se"]) == (None, None, None)
    assert found[3]["stage"] == "presliding"
    assert found[0]["joint_error"] == 0.005 * VALUES["alpha_0+"]


def test_json_without_moving_runs_has_null(joint: Joint) -> None:
    """No runs: null, null and an empty list, which validate."""
    found = read(joint)
    assert (found["tracking"], found["joint_fit"], found["consistency"]) == (None, None, [])


def test_json_holds_no_infinity_and_no_nan(moved: Joint) -> None:
    """An infinite condition or relative error is "inf"; a covariance that does not exist and a bias of nan are null."""
    fit = tracked(
        condition=float("inf"), relative_error=float("inf"), count_bias=named({"inertia": float("nan")}),
        covariance=np.full((len(VALUES), len(VALUES)), np.nan),
    )  # fmt: skip  # a list of changes
    found = read(replace(moved, tracking=fit))["tracking"]
    assert (found["condition"], found["relative_error"]) == ("inf", "inf")
    assert found["count_bias"] == {"inertia": None}
    assert {x for row in found["covariance"] for x in row} == {None}
    assert read(replace(moved, tracking=tracked(condition=float("nan"))))["tracking"]["condition"] is None


# tables


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


# text


def test_report_is_the_golden_file(moved: Joint) -> None:
    """The blocks of the printed report are tracking_report.txt, word for word; BRISTLE_REGENERATE=1 rewrites it."""
    text = fit_report([replace(moved, static={}, crosscheck={}, presliding=None)])
    if os.environ.get("BRISTLE_REGENERATE"):
        GOLDEN.write_text(text, encoding="utf-8")
    assert text == GOLDEN.read_text(encoding="utf-8")


def test_agreement_is_one_sentence(moved: Joint, joint: Joint) -> None:
    """It counts what agrees, names the largest difference and what cannot be compared; without comparisons it is empty."""
    assert in_print(agreement(moved)) == (
        "2 of 3 parameters agree between their own stage and the moving data; the largest difference is 3.2 standard errors (α₀ (−)); "
        "1 more not identifiable from the tracking runs."
    )
    unseen = replace(moved, consistency=(compared("alpha_1-", None, NOT_SHOWN),))
    assert agreement(unseen) == "The moving data show none of the parameters that the other stages know."
    assert agreement(joint) is None
