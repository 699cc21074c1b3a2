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
from bristle.questions.joint_report import results_file

from ..names import named
from ..sameness import held as as_lines
from .conftest import TABLE_1, closed_cycle, nothing_seen, only
from .moving import VALUES, moving, tracked

HERE = Path(__file__).parent
DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture(scope="module")
def moved() -> Joint:
    """Gripper rotation with every kind of run."""
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
    """Joints with everything, with parts and with nearly nothing validate, and no token of the file is NaN or Infinity.

    What is missing is null, a missing value with its reason; open bounds are the strings of the schema.
    """
    tokens: list[str] = []
    joints = [joint, replace(slow, name="slow"), replace(moved, name="moved"), gaps, slide]
    found = json.loads(results_file.to_json(joints), parse_constant=tokens.append)
    assert list(jsonschema.Draft202012Validator(results_file.schema()).iter_errors(found)) == []
    assert tokens == []
    assert list(found["joints"]) == [x.name for x in joints]
    for fit in (found["joints"]["slide"]["static"]["both"], found["joints"]["gaps"]["presliding"]["fits"]["+"]):
        assert fit.get("rms") is None
        assert fit["warnings"] or fit["edges"]["warnings"]
    for parameter in found["joints"]["slide"]["static"]["both"]["parameters"].values():
        assert parameter["standard_error"] is None
        assert bool(parameter["warnings"]) == (parameter["value"] is None)
    assert found["joints"]["slide"]["static"]["both"]["parameters"]["alpha_2"]["interval"] == ["-inf", "inf"]
    assert (found["joints"][joint.name]["tracking"], found["joints"][joint.name]["presliding"]) == (None, None)
    assert found["joints"]["gaps"]["truth"]["both"]["sigma_1"] is None
    bias, edges = found["joints"]["gaps"]["presliding"]["fits"]["+"]["bias_mean"], fit["edges"]
    assert (bias, edges["value"], edges["interval"]) == (None, None, [12.5, "inf"])
    run = found["joints"]["gaps"]["tracking"]
    assert (run["condition"], run["relative_error"], run["count_bias"]) == ("inf", "inf", {"inertia": None})
    assert {x for row in run["covariance"] for x in row} == {None}


def test_schema_in_the_docs_is_the_one_in_the_code() -> None:
    """docs/results.schema.json is what `schema()` gives; BRISTLE_REGENERATE=1 rewrites it."""
    text = json.dumps(results_file.schema(), indent=2) + "\n"
    path = DOCS / "results.schema.json"
    if os.environ.get("BRISTLE_REGENERATE"):
        path.write_text(text, encoding="utf-8")
    assert path.read_text(encoding="utf-8") == text


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
    assert by_kind["unseen-far"] == ("moving runs", "alpha_1-")


def test_schema_refuses_a_result_without_a_unit(joint: Joint) -> None:
    """The schema is not empty words: a parameter without its unit is refused."""
    document = json.loads(results_file.to_json([joint]))
    del document["joints"][joint.name]["static"]["+"]["parameters"]["alpha_0"]["unit"]
    with pytest.raises(jsonschema.ValidationError, match="unit"):
        jsonschema.validate(document, results_file.schema())


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


def test_the_file_is_the_result(joint: Joint, slow: Joint, moved: Joint, gaps: Joint) -> None:
    """Read back by the classes that wrote it, every value, name and warning is that of the joint, to the last digit; written again it is the same."""
    for own in (joint, slow, moved, gaps):
        text = results_file.to_json([own])
        (read,) = joints_of(validated(with_samples(parsed(text)), adapter()))
        assert list(leaves(read)) == list(leaves(own)) or own is gaps  # where what is no number is missing by now
        assert results_file.to_json([read]) == text
        assert not read.static["+"].covariance.flags.writeable


def test_a_warning_is_written_as_a_value_and_read_back(slide: Joint) -> None:
    """Kind, severity, sentence and numbers, with diagnostics, lists, NumPy's numbers, names and infinities among them; kind and numbers come back."""
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


def test_arrays_of_samples_stand_apart(moved: Joint) -> None:
    """The rest of the file does not grow with the samples: a joint with thousands of equations is written in a few pages."""
    document = json.loads(results_file.to_json([moved]))
    (samples,) = document.pop("samples").values()
    assert len(json.dumps(document, indent=1)) < 120_000
    (found,) = document["joints"].values()
    assert {"velocity", "measured", "residuals", "time"}.isdisjoint(found["joint_fit"])
    assert all("loadings" not in fit for fit in found["presliding"]["fits"].values())
    assert {"joint_fit/residuals", "presliding/fits/+/loadings", "static/+/profile"} <= samples.keys()
    assert samples["static/+/segments"][0] in {f"segments/{k}" for k in range(len(moved.segments))}


def test_frame_is_tidy(joint: Joint, slide: Joint) -> None:
    """One row per joint, direction and parameter, with the columns that the API promises."""
    frame = results_file.to_frame([joint, slide])
    assert list(frame.columns) == [
        "joint", "direction", "parameter", "value", "unit", "standard_error", "lower", "upper", "warnings",
    ]  # fmt: skip  # a list of words
    assert len(frame) == sum(len(fit.parameters) for j in (joint, slide) for fit in j.static.values())
    assert math.isinf(frame[frame["parameter"] == "alpha_2"]["upper"].iloc[-1])
