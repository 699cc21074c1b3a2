import json
import math
import os
from pathlib import Path

import jsonschema
import pytest

from bristle.identification.results import Joint
from bristle.questions.joint_report import results_file

HERE = Path(__file__).parent
DOCS = Path(__file__).parents[2] / "docs"


def test_json_satisfies_its_schema_and_holds_no_nan(joint: Joint, slide: Joint) -> None:
    """A joint with everything and one with nearly nothing both validate, and no token of the file is NaN or Infinity."""
    tokens: list[str] = []
    found = json.loads(results_file.to_json([joint, slide]), parse_constant=tokens.append)
    assert list(jsonschema.Draft202012Validator(results_file.schema()).iter_errors(found)) == []
    assert tokens == []
    assert set(found["joints"]) == {joint.name, slide.name}


def test_schema_in_the_docs_is_the_one_in_the_code() -> None:
    """docs/results.schema.json is what `schema()` gives; BRISTLE_REGENERATE=1 rewrites it."""
    text = json.dumps(results_file.schema(), indent=2) + "\n"
    path = DOCS / "results.schema.json"
    if os.environ.get("BRISTLE_REGENERATE"):
        path.write_text(text, encoding="utf-8")
    assert path.read_text(encoding="utf-8") == text


def test_schema_refuses_a_result_without_a_unit(joint: Joint) -> None:
    """The schema is not empty words: a parameter without its unit is refused."""
    document = json.loads(results_file.to_json([joint]))
    del document["joints"][joint.name]["static"]["+"]["parameters"]["alpha_0"]["unit"]
    with pytest.raises(jsonschema.ValidationError, match="unit"):
        jsonschema.validate(document, results_file.schema())


def test_floats_come_back_exactly(joint: Joint) -> None:
    """Every digit of a value survives the file."""
    document = json.loads(results_file.to_json([joint]))
    for direction, fit in joint.static.items():
        for name, estimate in fit.parameters.items():
            read = document["joints"][joint.name]["static"][direction]["parameters"][name]
            assert (read["value"], tuple(read["interval"])) == (estimate.value, estimate.interval)


def test_what_does_not_exist_is_null_with_a_warning_and_infinity_is_a_string(slide: Joint) -> None:
    """No value without a reason; open bounds are the strings of the schema."""
    fit = json.loads(results_file.to_json([slide]))["joints"]["slide"]["static"]["both"]
    assert fit["rms"] is None
    assert fit["doubts"]
    for parameter in fit["parameters"].values():
        assert parameter["standard_error"] is None
        assert parameter["doubts"]
    assert fit["parameters"]["alpha_2"]["interval"] == ["-inf", "inf"]


def test_frame_is_tidy(joint: Joint, slide: Joint) -> None:
    """One row per joint, direction and parameter, with the columns that the API promises."""
    frame = results_file.to_frame([joint, slide])
    assert list(frame.columns) == [
        "joint", "direction", "parameter", "value", "unit", "standard_error", "lower", "upper", "warnings",
    ]  # fmt: skip  # a list of words
    assert len(frame) == sum(len(fit.parameters) for j in (joint, slide) for fit in j.static.values())
    assert math.isinf(frame[frame["parameter"] == "alpha_2"]["upper"].iloc[-1])


def test_fit_report_is_the_golden_file(joint: Joint, slide: Joint) -> None:
    """The printed report is fit_report.txt, word for word; BRISTLE_REGENERATE=1 rewrites it."""
    text = results_file.fit_report([joint, slide])
    if os.environ.get("BRISTLE_REGENERATE"):
        (HERE / "fit_report.txt").write_text(text, encoding="utf-8")
    assert text == (HERE / "fit_report.txt").read_text(encoding="utf-8")
