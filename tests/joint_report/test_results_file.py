import json
import math
import os
from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

from bristle.estimation.interval_comparison import they_differ
from bristle.findings import CAUTION, NOTE, Finding
from bristle.identification.document import joints_of, parsed, validated, with_samples
from bristle.identification.results import Joint, adapter
from bristle.model.parameters import Direction, ParameterName
from bristle.page.wording import in_print
from bristle.questions.joint_report import results_file, tables
from bristle.questions.joint_report.sentences import agreement
from bristle.questions.joint_report.text import fit_report

from ..conftest import present
from ..names import named
from ..sameness import held as as_lines
from .conftest import TABLE_1, closed_cycle, loaded, nothing_seen, only, slow_fit
from .moving import NOT_SHOWN, VALUES, compared, moving, tracked, without

HERE = Path(__file__).parent
DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture(scope="module")
def moved() -> Joint:
    return moving()


@pytest.fixture(scope="module")
def gaps(slow: Joint, moved: Joint) -> Joint:
    """Runs of which much does not exist, and whose numbers are none or infinite."""
    fit = tracked(
        condition=math.inf, relative_error=math.inf, count_bias=named({"inertia": math.nan}),
        covariance=np.full((len(VALUES), len(VALUES)), np.nan),
    )  # fmt: skip  # a list of changes
    steep = replace(closed_cycle("x.csv"), secant=None)
    unseen = only(slow, fits={"+": nothing_seen()}, breakaway={}, loops=(closed_cycle("a.csv"), steep)).presliding
    truth = {"both": TABLE_1["+"]._replace(sigma_1=math.nan)}
    return replace(moved, name="gaps", tracking=fit, joint_fit=None, consistency=(), presliding=unseen, truth=truth)


def test_json_satisfies_its_schema_and_holds_no_nan(
    joint: Joint, slow: Joint, moved: Joint, gaps: Joint, slide: Joint
) -> None:
    """Joints with everything, with parts and with nearly nothing validate, and no token of the file is NaN or Infinity."""
    # what is missing is null, a missing value with its reason; open bounds are the strings of the schema
    tokens: list[str] = []
    joints = [joint, replace(slow, name="slow"), replace(moved, name="moved"), gaps, slide]
    found = json.loads(results_file.to_json(joints), parse_constant=tokens.append)
    assert list(jsonschema.Draft202012Validator(results_file.schema()).iter_errors(found)) == []
    assert tokens == []
    assert list(found["joints"]) == [x.name for x in joints]
    for fit in (found["joints"]["slide"]["static"]["both"], found["joints"]["gaps"]["presliding"]["fits"]["+"]):
        assert fit.get("rms") is None
        assert fit["warnings"] or fit["sigma_0"]["warnings"]
    for parameter in found["joints"]["slide"]["static"]["both"]["parameters"].values():
        assert parameter["standard_error"] is None
        assert bool(parameter["warnings"]) == (parameter["value"] is None)
    assert found["joints"]["slide"]["static"]["both"]["parameters"]["alpha_2"]["interval"] == ["-inf", "inf"]
    assert (found["joints"][joint.name]["tracking"], found["joints"][joint.name]["presliding"]) == (None, None)
    assert found["joints"]["gaps"]["truth"]["both"]["sigma_1"] is None
    bias, edges = found["joints"]["gaps"]["presliding"]["fits"]["+"]["bias_mean"], fit["sigma_0"]
    assert (bias, edges["value"], edges["interval"]) == (None, None, [12.5, "inf"])
    run = found["joints"]["gaps"]["tracking"]
    assert (run["condition"], run["relative_error"], run["count_bias"]) == ("inf", "inf", {"inertia": None})
    assert {x for row in run["covariance"] for x in row} == {None}
    # docs/results.schema.json is what `schema()` gives; BRISTLE_REGENERATE=1 rewrites it
    text = json.dumps(results_file.schema(), indent=2) + "\n"
    path = DOCS / "results.schema.json"
    if os.environ.get("BRISTLE_REGENERATE"):
        path.write_text(text, encoding="utf-8")
    assert path.read_text(encoding="utf-8") == text
    # the schema is not empty words: a parameter without its unit is refused
    document = json.loads(results_file.to_json([joint]))
    del document["joints"][joint.name]["static"]["+"]["parameters"]["alpha_0"]["unit"]
    with pytest.raises(jsonschema.ValidationError, match="unit"):
        jsonschema.validate(document, results_file.schema())


def test_every_warning_knows_its_subject(moved: Joint, slow: Joint) -> None:
    """Told their subjects, results are as before; a warning about a stage names it; told again, nothing changes; files keep it."""
    for joint in (moved, slow):
        told = joint.with_subjects()
        subjects = [warning.subject for warning in told.all_warnings()]
        assert as_lines([*told.all_warnings()]) == as_lines([*joint.all_warnings()])
        assert [x.subject for x in told.with_subjects().all_warnings()] == subjects
        about_joint = len(joint.warnings)
        assert subjects[:about_joint] == [()] * about_joint
        assert all(subjects[about_joint:])
        read = adapter().validate_json(results_file.to_json([told])).joints[joint.name]
        assert [x.subject for x in read.all_warnings()] == subjects
    by_kind = {warning.code: warning.subject for warning in moved.with_subjects().all_warnings()}
    assert by_kind["unseen-wide"] == ("moving runs", "alpha_1-")


def leaves(value: Any) -> Iterator[Any]:
    """What a result holds, its numbers and names in order; of what stays out of the file, nothing."""
    if isinstance(value, Finding):
        yield from (value.code, str(value))
    elif is_dataclass(value):
        for item in fields(value):
            if not item.metadata.get("exclude"):
                yield from leaves(getattr(value, item.name))
    elif isinstance(value, dict):
        for key, held in value.items():
            yield key
            yield from leaves(held)
    elif isinstance(value, tuple) and not isinstance(value, ParameterName):
        for held in value:
            yield from leaves(held)
    elif isinstance(value, np.ndarray):
        yield from (value.shape, *value.ravel())
    else:
        yield value


def test_the_file_and_the_printed_report_are_the_result(
    joint: Joint, slow: Joint, moved: Joint, gaps: Joint, slide: Joint, whole: Joint
) -> None:
    """Read back by the classes that wrote it, every value, name and warning is that of the joint, to the last digit; written again it is the same."""
    for own in (joint, slow, moved, gaps):
        text = results_file.to_json([own])
        (read,) = joints_of(validated(with_samples(parsed(text)), adapter()))
        assert list(leaves(read)) == list(leaves(own)) or own is gaps  # where what is no number is missing by now
        assert results_file.to_json([read]) == text
        assert not read.static["+"].covariance.flags.writeable
    # the rest of the file does not grow with the samples: a joint with thousands of equations is written in a few pages
    document = json.loads(results_file.to_json([moved]))
    (samples,) = document.pop("samples").values()
    assert len(json.dumps(document, indent=1)) < 120_000
    (found,) = document["joints"].values()
    assert {"velocity", "measured", "residuals", "time"}.isdisjoint(found["joint_fit"])
    assert all("loadings" not in fit for fit in found["presliding"]["fits"].values())
    assert {"joint_fit/residuals", "presliding/fits/+/loadings", "static/+/profile"} <= samples.keys()
    assert samples["static/+/segments"][0] in {f"segments/{k}" for k in range(len(moved.segments))}
    # kind, severity, sentence and numbers of any kind stand in the file; kind and numbers come back
    name, inner = ParameterName("alpha_0", Direction.POSITIVE), Finding("cost-stays-low", CAUTION, "the cost stays low")
    said = they_differ(("above", "below"), (("profile", 0.5, math.inf), (str(name), np.float64(1), -math.inf)), inner)
    text = results_file.to_json(
        [replace(slide, warnings=(said, Finding("plan-local", NOTE, "3 others.", {"count": np.int64(3)})))]
    )
    written, counted = json.loads(text)["joints"]["slide"]["warnings"]
    assert (written["code"], written["severity"], written["message"]) == ("intervals-differ", "note", str(said))
    assert written["numbers"]["ends"] == [["profile", 0.5, "inf"], ["alpha_0+", 1.0, "-inf"]]
    assert written["numbers"]["reason"] == str(inner)
    assert counted["numbers"] == {"count": 3}
    (read,) = adapter().validate_json(text, strict=True).joints.values()
    back, _ = read.warnings
    assert (back.code, str(back)) == (said.code, str(said))
    assert back.numbers == {
        "sides": ("above", "below"), "ends": (("profile", 0.5, math.inf), ("alpha_0+", 1.0, -math.inf)), "reason": str(inner),
    }  # fmt: skip  # one value
    # one row per joint, direction and parameter, with the columns that the API promises
    frame = results_file.to_frame([joint, slide])
    assert list(frame.columns) == [
        "joint", "direction", "parameter", "value", "unit", "standard_error", "lower", "upper", "warnings",
    ]  # fmt: skip  # a list of words
    assert len(frame) == sum(len(fit.parameters) for j in (joint, slide) for fit in j.static.values())
    assert math.isinf(frame[frame["parameter"] == "alpha_2"]["upper"].iloc[-1])
    # of static fits, slow loading and moving runs, word for word; BRISTLE_REGENERATE=1 rewrites them
    fits = {"+": slow_fit("+"), "-": nothing_seen("-")}
    reports = {
        "fit": [joint, slide], "presliding": [replace(only(slow, fits=fits), static={}, crosscheck={})],
        "tracking": [replace(whole, static={}, crosscheck={}, presliding=None)],
    }  # fmt: skip  # a table
    for name, joints in reports.items():
        golden, text = Path(__file__).parent / f"{name}_report.txt", fit_report(joints)
        if os.environ.get("BRISTLE_REGENERATE"):
            golden.write_text(text, encoding="utf-8")
        assert text == golden.read_text(encoding="utf-8"), name


@pytest.fixture(scope="module")
def whole() -> Joint:
    return moving()


def test_tables_of_slow_loading(slow: Joint, joint: Joint) -> None:
    """A direction that only presliding knows comes after all others."""
    frame = results_file.to_frame([slow])
    names = ["alpha_0", "alpha_1", "alpha_2", "v_s", "sigma_0", "sigma_1"]
    assert list(frame["parameter"]) == 2 * names
    assert list(frame["direction"]) == 6 * ["+"] + 6 * ["-"]
    assert list(frame[frame["parameter"] == "sigma_0"]["value"]) == [TABLE_1[d].sigma_0 for d in ("+", "-")]
    both = replace(slow, static={"both": slow.static["+"]})
    assert list(results_file.to_frame([both])["direction"]) == 4 * ["both"] + 2 * ["+"] + 2 * ["-"]
    # simulated: true and error beside sigma_0 and sigma_1; a truth that is nan is missing in table and file; one of both is that of each
    frame = tables.parameters([slow]).set_index(["direction", "parameter"])
    assert frame.loc[("-", "sigma_0"), "error_percent"] == 0.0
    assert frame.loc[("+", "sigma_0"), "inside"] is True
    half = replace(slow, truth={"both": TABLE_1["+"]._replace(sigma_1=float("nan"))})
    frame = tables.parameters([half]).set_index(["direction", "parameter"])
    assert frame.loc[("-", "sigma_0"), "true"] == TABLE_1["+"].sigma_0
    assert np.isnan(float(str(frame.loc[("-", "sigma_1"), "true"])))
    assert frame.loc[("-", "sigma_1"), "inside"] is None
    # two rows per direction, each with its error against the truth
    frame = tables.all_tables([slow])["presliding"]
    assert list(frame.columns) == [
        "joint", "direction", "method", "value", "unit", "standard_error", "lower", "upper", "true", "error_percent", "inside",
    ]  # fmt: skip  # a list of words
    assert list(frame["method"]) == 2 * ["printed", "edges"]
    np.testing.assert_allclose(frame["error_percent"], 2 * [-50.0, 0.0], atol=1e-9)
    # one row per loading that broke away, with its distance from the median, and one per closed cycle; every unit is in the table of units
    made = tables.all_tables([slow])
    np.testing.assert_allclose(made["breakaway"]["from_median_percent"], [-20.0, 0.0], atol=1e-9)
    assert list(made["hysteresis"]["loss"]) == [3e-5, 4e-5, 5e-5, 6e-5]
    units = made["units"].set_index("column")["unit"]
    assert (units["loss"], units["slope"], units["breakaway"]) == ("J", "N*m/rad", "N*m")
    # no runs: the three tables are empty, with the same columns
    made = tables.all_tables([joint])
    assert [len(made[name]) for name in ("presliding", "breakaway", "hysteresis")] == [0, 0, 0]
    assert list(made["presliding"].columns) == list(tables.presliding([loaded()]).columns)


def test_frame_gains_rows_and_last_columns(whole: Joint, joint: Joint) -> None:
    """The joint fit (without one, the moving runs) stands after the other stages, named in `source`; static fits alone have their old columns."""
    # `use` marks one row of each parameter, that of `chosen`
    frame = results_file.to_frame([whole])
    old = list(results_file.to_frame([joint]).columns)
    assert list(frame.columns) == [*old, "source", "use"]
    used = frame[frame["use"]]
    assert not used.duplicated(["direction", "parameter"]).any()
    assert set(used["source"]) == {"joint"}
    assert set(used["parameter"]) == set(frame["parameter"])
    assert old[-1] == "warnings"
    assert list(frame["source"]) == 2 * (4 * ["static"] + 2 * ["presliding"]) + 13 * ["joint"]
    assert list(frame["direction"])[12:] == 6 * ["+"] + 6 * ["-"] + ["shared"]
    assert frame["value"].iloc[-1] == present(whole.joint_fit).parameters[ParameterName.parse("inertia")].value
    alone = results_file.to_frame([replace(whole, joint_fit=None)])
    assert list(alone["source"])[12:] == 13 * ["tracking"]
    # a row per fit and parameter: error against the truth, whether the interval holds it, and what counts added
    frame = tables.all_tables([whole])["tracking"]
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
    # each comparison with its unit, each hold-out run per fit; without moving runs the tables are empty with the same columns
    made, none = tables.all_tables([whole]), tables.all_tables([joint])
    assert list(made["consistency"]["unit"]) == ["N*m", "N*m", "N*m", "N*m/rad"]
    assert list(made["consistency"]["difference_in_se"].fillna(99.0)) == [0.5, -3.2, 99.0, 1.0]
    assert list(made["tracking_hold_out"]["relative_error_of_fit"]) == [1.25, 1.3]
    for name in ("tracking", "consistency", "tracking_hold_out"):
        assert len(none[name]) == 0
        assert list(none[name].columns) == list(made[name].columns)


def test_table_1_and_the_stages_that_agree(whole: Joint, joint: Joint) -> None:
    """All six parameters per direction and what they share, once each, from the joint fit, with the truth."""
    frame = tables.all_tables([whole])["table_1"]
    names = list(TABLE_1["+"]._fields)
    assert list(frame["parameter"]) == [*names, *names, "inertia"]
    assert list(frame["direction"]) == 6 * ["+"] + 6 * ["-"] + ["shared"]
    assert set(frame["source"]) == {"joint"}
    np.testing.assert_allclose(frame["error_percent"][:12], 1.0)
    assert frame["inside"][:12].all()
    # without a joint fit the moving runs, to whose curve no other stage adds what they do not show; else static and presliding
    alone = tables.all_tables([replace(whole, joint_fit=None)])["table_1"].set_index(["direction", "parameter"])
    assert alone["source"].value_counts().to_dict() == {"tracking": 13}
    assert alone["value"].isna()[("-", "alpha_1")]
    before = tables.all_tables([replace(whole, joint_fit=None, tracking=None)])["table_1"]
    assert list(before["source"]) == 2 * (4 * ["static"] + 2 * ["presliding"])
    # what the moving runs know of both directions together replaces a stage's value of each, and of each that of both
    together = {
        ParameterName.parse(name): present(whole.joint_fit).parameters[ParameterName.parse(f"{name}+")]
        for name in TABLE_1["+"]._fields
    }
    of_both = replace(whole, joint_fit=tracked(parameters=together), tracking=None)
    assert list(tables.all_tables([of_both])["table_1"]["direction"]) == 6 * ["both"]
    static = replace(whole, static={"both": whole.static["+"]}, presliding=None)
    assert set(tables.all_tables([static])["table_1"]["source"]) == {"joint"}
    half = replace(static, joint_fit=without(present(whole.joint_fit), "alpha_1-"), tracking=None)
    rows = tables.all_tables([half])["table_1"]
    assert list(rows[rows["parameter"] == "alpha_1"]["direction"]) == ["+", "-"]
    # it counts what agrees, names the largest difference and what cannot be compared; without comparisons it is empty
    assert in_print(agreement(whole)) == (
        "2 of 3 parameters agree between their own stage and the moving data; the largest difference is 3.2 standard errors (α₀ (−)); "
        "1 more not identifiable from the tracking runs."
    )
    unseen = replace(whole, consistency=(compared("alpha_1-", None, NOT_SHOWN),))
    assert agreement(unseen) == "The moving data show none of the parameters that the other stages know."
    assert agreement(joint) is None
