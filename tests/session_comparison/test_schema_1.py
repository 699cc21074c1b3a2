"""Files of schema 1, which nothing writes any more: they are compared with files of today, and refused as those are."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bristle
from bristle.diagnostics import Kind
from bristle.identification.fits import Estimate
from bristle.identification.results import Joint
from bristle.questions.joint_report.results_file import to_json
from bristle.questions.session_comparison import results_file

from ..joint_report.moving import moving
from .test_compare import run, warning

OLD = Path(__file__).parent / "data" / "results_1.json"
"""Table 1's gripper with every stage, as the last version of schema 1 wrote it."""


@pytest.fixture
def same() -> Joint:
    """The very joint that `OLD` holds."""
    return moving()


def numbers(e: Estimate) -> dict[str, float]:
    """What is known of it."""
    low, high = e.interval or (None, None)
    found = {"value": e.value, "error": e.standard_error, "low": low, "high": high}
    return {name: x for name, x in found.items() if x is not None}


def with_outcome(document: dict[str, Any], outcome: object) -> str:
    """The document, whose joint fit ended otherwise."""
    for joint in document["joints"].values():
        joint["joint_fit"]["outcome"] = outcome
    return json.dumps(document)


def test_a_file_of_schema_1_is_compared_with_one_of_schema_2(tmp_path: Path, same: Joint) -> None:
    """Of one joint both have the same fits, numbers and inputs: nothing differs, in either order."""
    (tmp_path / "new.json").write_text(to_json([same]), encoding="utf-8")
    old, new = (results_file.read_session(path)[same.name] for path in (OLD, tmp_path / "new.json"))
    assert [fit.source for fit in old.fits] == [
        "joint",
        "tracking",
        "static +",
        "static -",
        "presliding +",
        "presliding -",
    ]
    assert (old.kind, old.simulated, old.inputs) == (new.kind, new.simulated, new.inputs)
    for a, b in zip(old.fits, new.fits, strict=True):
        assert (a.source, a.names, a.freedom, a.distrusted) == (b.source, b.names, b.freedom, b.distrusted)
        np.testing.assert_allclose(a.covariance, b.covariance, rtol=1e-4, atol=1e-20)
        assert list(a.parameters) == list(b.parameters)
        for one, other in zip(a.parameters.values(), b.parameters.values(), strict=True):
            assert one.unit == other.unit
            assert numbers(one) == pytest.approx(numbers(other), rel=1e-4)
    for pair in ((OLD, tmp_path / "new.json"), (tmp_path / "new.json", OLD)):
        compared = bristle.compare(*pair)
        assert len(compared.changes) == 13
        assert max(abs(c.z or 0.0) for c in compared.changes) < 1e-3
        assert any(x.kind is Kind.FILES_ALL_SHARED for x in compared.warnings)


def test_whether_a_fit_converged_is_told_by_kind_and_in_schema_1_by_its_sentence(tmp_path: Path, same: Joint) -> None:
    """A kind counts, however it is worded; in schema 1 the sentence that it had then; no other sentence does, in either."""
    sentence, path = "The fit did not converge; its numbers are not to be trusted.", tmp_path / "x.json"
    old, new = json.loads(OLD.read_text(encoding="utf-8")), json.loads(to_json([same]))
    for document, outcome, distrusted in (
        (old, sentence, True),
        (old, "The fit converged inside every bound.", False),
        (old, "It did not converge.", False),
        (new, warning("NOT_CONVERGED"), True),
        (new, warning("CONVERGED") | {"text": sentence}, False),
        (new, warning("NO_SUCH_KIND") | {"text": sentence}, False),
    ):
        path.write_text(with_outcome(document, outcome), encoding="utf-8")
        joint = results_file.read_session(path)[same.name]
        assert [bool(fit.distrusted) for fit in joint.fits if fit.source == "joint"] == [distrusted]


@pytest.mark.parametrize(
    ("place", "value", "named"),
    [
        (("static", "+", "parameters", "alpha_0", "value"), "1.5", "alpha_0.value: Input should be a valid number"),
        (("static", "+", "parameters", "alpha_0", "interval"), [2.0, 1.0], "an interval ends before it begins"),
        (("static", "+", "parameters", "alpha_0", "unit"), "\x1b]0;N*m", "U+001B, a control character"),
        (("static", "+", "free"), ["alpha_0"], "a covariance is not of the 1 parameters"),
        (("static", "+", "degrees_of_freedom"), -3, "a fit has -3 degrees of freedom"),
        (("static", "+", "covariance"), [["x"]] * 400_000, "covariance.0.0: Input should be a valid number"),
        (("joint_fit", "outcome"), 3, "joint_fit.outcome: Input should be a valid string"),
        (("joint_fit", "free"), ["a\x1b[31m"] * 13, "U+001B, a control character"),
        (("presliding", "+", "edges", "standard_error"), 1e200, "is beyond 1e+60"),
        (("tracking",), {}, "parameters: Field required"),
        (("kind",), "linear", "kind: Input should be"),
    ],
)
def test_a_hostile_file_of_schema_1_is_refused(tmp_path: Path, place: Sequence[str], value: object, named: str) -> None:
    """The limits and refusals are those of schema 2: exit 2 and one short sentence."""
    document = json.loads(OLD.read_text(encoding="utf-8"))
    (part,) = document["joints"].values()
    for key in place[:-1]:
        part = part[key]
    part[place[-1]] = value
    (tmp_path / "x.json").write_text(json.dumps(document), encoding="utf-8")
    code, _, said = run("compare", OLD, tmp_path / "x.json")
    assert (code, len(said)) == (2, 1)
    assert named in said[0]
    assert len(said[0]) < 600


def test_files_of_schema_1_without_models_are_read(tmp_path: Path) -> None:
    """What schema 1 gained while it was in use is not required."""
    document = json.loads(OLD.read_text(encoding="utf-8"))
    (joint,) = document["joints"].values()
    del joint["models"]
    for fit in joint["static"].values():
        del fit["uncertainty"]
    (tmp_path / "older.json").write_text(json.dumps(document), encoding="utf-8")
    assert bristle.compare(OLD, tmp_path / "older.json").changes
