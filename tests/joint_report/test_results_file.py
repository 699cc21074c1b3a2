import json
import math
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

from bristle.identification.document import joints_of, parsed, validated, with_samples
from bristle.identification.results import Joint, adapter
from bristle.model.parameters import ParameterName
from bristle.page.wording import MISSING, in_print
from bristle.questions.joint_report import results_file, tables
from bristle.questions.joint_report.sentences import agreement

from ..conftest import present
from ..names import named
from .conftest import TABLE_1, closed_cycle, nothing_seen, only
from .moving import NOT_SHOWN, VALUES, compared, moving, tracked, without

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
    bare, part = found["joints"]["slide"]["static"]["both"], found["joints"]["gaps"]
    assert (bare["rms"], bool(bare["warnings"])) == (None, True)
    for parameter in bare["parameters"].values():
        assert parameter["standard_error"] is None
        assert bool(parameter["warnings"]) == (parameter["value"] is None)
    assert bare["parameters"]["alpha_2"]["interval"] == ["-inf", "inf"]
    assert (found["joints"][joint.name]["tracking"], found["joints"][joint.name]["presliding"]) == (None, None)
    assert part["truth"]["both"]["sigma_1"] is None
    slow_, run = part["presliding"]["fits"]["+"], part["tracking"]
    edges = slow_["sigma_0"]
    found_ = (edges["value"], edges["interval"], bool(edges["warnings"]))
    assert found_ == (None, [12.5, "inf"], True)
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


def test_the_file_is_the_result(slow: Joint, moved: Joint, gaps: Joint, joint: Joint, slide: Joint) -> None:
    """Read back by the classes that wrote it and written again it is the same, where numbers are missing or infinite, too."""
    for own in (slow, moved, gaps):
        text = results_file.to_json([own])
        (read,) = joints_of(validated(with_samples(parsed(text)), adapter()))
        assert results_file.to_json([read]) == text
        assert not read.static["+"].covariance.flags.writeable
    # the rest of the file does not grow with the samples: a joint with thousands of equations is written in a few pages
    document = json.loads(results_file.to_json([moved]))
    (samples,) = document.pop("samples").values()
    assert len(json.dumps(document, indent=1)) < 120_000
    assert {"joint_fit/residuals", "presliding/fits/+/loadings", "static/+/profile"} <= samples.keys()
    # one row per joint, direction and parameter, with the columns that the API promises
    frame = results_file.to_frame([joint, slide])
    assert list(frame.columns) == [
        "joint", "direction", "parameter", "value", "unit", "standard_error", "lower", "upper", "warnings",
    ]  # fmt: skip  # a list of words
    assert len(frame) == sum(len(fit.parameters) for j in (joint, slide) for fit in j.static.values())
    assert math.isinf(frame[frame["parameter"] == "alpha_2"]["upper"].iloc[-1])


def test_tables_of_slow_loading(slow: Joint, joint: Joint) -> None:
    """A direction that only presliding knows comes after all others."""
    frame = results_file.to_frame([slow])
    names = ["alpha_0", "alpha_1", "alpha_2", "v_s", "sigma_0", "sigma_1"]
    assert list(frame["parameter"]) == 2 * names
    assert list(frame[frame["parameter"] == "sigma_0"]["value"]) == [TABLE_1[d].sigma_0 for d in ("+", "-")]
    both = replace(slow, static={"both": slow.static["+"]})
    assert list(results_file.to_frame([both])["direction"]) == 4 * ["both"] + 2 * ["+"] + 2 * ["-"]
    # simulated: true and error beside sigma_0 and sigma_1; a truth that is nan is missing in table and file; one of both is that of each
    half = replace(slow, truth={"both": TABLE_1["+"]._replace(sigma_1=float("nan"))})
    frame = tables.parameters([half]).set_index(["direction", "parameter"])
    assert frame.loc[("-", "sigma_0"), "true"] == TABLE_1["+"].sigma_0
    assert frame["inside"].isna()[("-", "sigma_1")]
    # two rows per direction, each with its error against the truth; a row per loading that broke away, with its distance from the median,
    # and per closed cycle
    made, none = tables.all_tables([slow]), tables.all_tables([joint])
    frame = made["presliding"]
    assert list(frame["method"]) == 2 * ["printed", "edges"]
    np.testing.assert_allclose(frame["error_percent"], 2 * [-50.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(made["breakaway"]["from_median_percent"], [-20.0, 0.0], atol=1e-9)
    assert list(made["hysteresis"]["loss"]) == [3e-5, 4e-5, 5e-5, 6e-5]
    # on the page value, error and unit are one number, and the interval has as many digits; a value that is missing is a dash
    shown = tables.rounded(frame)
    assert list(shown.columns)[:5] == ["joint", "direction", "method", "value", "95 % interval"]
    assert tuple(shown.loc[1, ["value", "95 % interval"]]) == ("6.184 ± 0.062 N·m/rad", "[6.061, 6.308]")
    doubtful = frame.assign(value=np.nan, systematic=0.5)
    assert set(tables.rounded(doubtful)["value"]) == {MISSING}
    assert tables.rounded(frame.assign(systematic=0.5)).loc[1, "value"] == "6.184 ± 0.062 ± 0.5 (systematic) N·m/rad"
    # no runs: the tables are empty, with the same columns
    for name in ("presliding", "breakaway", "hysteresis", "tracking", "consistency"):
        assert (len(none[name]), list(none[name].columns)) == (0, list(made[name].columns))


def test_frame_gains_rows_and_last_columns(moved: Joint, joint: Joint) -> None:
    """The joint fit (without one, the moving runs) stands after the other stages, named in `source`; static fits alone have their old columns."""
    # `use` marks one row of each parameter, that of `chosen`
    frame = results_file.to_frame([moved])
    assert list(frame.columns) == [*results_file.to_frame([joint]).columns, "source", "use"]
    used = frame[frame["use"]]
    assert not used.duplicated(["direction", "parameter"]).any()
    assert set(used["source"]) == {"joint"}
    assert set(used["parameter"]) == set(frame["parameter"])
    assert list(frame["source"]) == 2 * (4 * ["static"] + 2 * ["presliding"]) + 13 * ["joint"]
    assert list(frame["direction"])[12:] == 6 * ["+"] + 6 * ["-"] + ["shared"]
    assert frame["value"].iloc[-1] == present(moved.joint_fit).parameters[ParameterName.parse("inertia")].value
    alone = results_file.to_frame([replace(moved, joint_fit=None)])
    assert list(alone["source"])[12:] == 13 * ["tracking"]
    # a row per fit and parameter: error against the truth, whether the interval holds it, and what counts added
    made = tables.all_tables([moved])
    row = made["tracking"].set_index(["fit", "direction", "parameter"]).to_dict("index")
    assert row["tracking", "+", "sigma_0"]["error_percent"] == pytest.approx(5.0)
    assert row["tracking", "+", "sigma_0"]["count_bias"] == -0.02
    inside = (("tracking", "+", "sigma_0"), ("joint", "-", "sigma_1"), ("joint", "shared", "inertia"))
    assert [row[key]["inside"] for key in inside] == [False, True, None]
    assert math.isnan(row["tracking", "-", "alpha_1"]["value"])
    # each comparison with its unit, each hold-out run per fit
    assert list(made["consistency"]["unit"]) == ["N*m", "N*m", "N*m", "N*m/rad"]
    assert list(made["consistency"]["difference_in_se"].fillna(99.0)) == [0.5, -3.2, 99.0, 1.0]
    assert list(made["hold_out"]["fit"]) == ["+", "-", "tracking", "joint"]
    assert list(made["hold_out"]["relative_error_of_fit"])[2:] == [1.25, 1.3]


def test_table_1_and_the_stages_that_agree(moved: Joint, joint: Joint) -> None:
    """All six parameters per direction and what they share, once each, from the joint fit, with the truth."""
    fit, names = present(moved.joint_fit), list(TABLE_1["+"]._fields)

    def sources(**changes: Any) -> list[tuple[str, str, str]]:
        columns = ["source", "direction", "parameter"]
        return list(tables.table_1([replace(moved, **changes)])[columns].itertuples(index=False, name=None))

    of_joint = [*(("joint", d, name) for d in "+-" for name in names), ("joint", "shared", "inertia")]
    assert sources() == of_joint
    frame = tables.table_1([moved])
    np.testing.assert_allclose(frame["error_percent"][:12], 1.0)
    assert frame["inside"][:12].all()
    # without a joint fit the moving runs, to whose curve no other stage adds what they do not show; else static and presliding
    assert sources(joint_fit=None) == [("tracking", d, name) for _, d, name in of_joint]
    before = sources(joint_fit=None, tracking=None)
    assert [source for source, *_ in before] == 2 * (4 * ["static"] + 2 * ["presliding"])
    # what the moving runs know of both directions together replaces a stage's value of each, and of each that of both
    together = {ParameterName.parse(name): fit.parameters[ParameterName.parse(f"{name}+")] for name in names}
    assert sources(joint_fit=tracked(parameters=together), tracking=None) == [("joint", "both", name) for name in names]
    static: dict[str, Any] = {"static": {"both": moved.static["+"]}, "presliding": None}
    assert sources(**static) == of_joint
    assert sources(**static, joint_fit=without(fit, "alpha_1-"), tracking=None) == of_joint
    # it counts what agrees, names the largest difference and what cannot be compared; without comparisons it is empty
    assert in_print(agreement(moved)) == (
        "2 of 3 parameters agree between their own stage and the moving data; the largest difference is 3.2 standard errors (α₀ (−)); "
        "1 more not identifiable from the tracking runs."
    )
    unseen = replace(moved, consistency=(compared("alpha_1-", None, NOT_SHOWN),))
    assert agreement(unseen) == "The moving data show none of the parameters that the other stages know."
    assert agreement(joint) is None
