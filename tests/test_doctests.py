"""The examples in the docstrings of what `bristle` offers, run where `wrist.yaml` and its log `points.csv` lie."""

import doctest
from pathlib import Path

import pytest

import bristle
from bristle import api
from bristle.model.laws import registry

EXAMPLES = sorted(name for name in bristle.__all__ if callable(getattr(bristle, name)) and name[0].islower())

POINTS = """v [rad/s],tau [Nm]
-1,-0.059
-0.3,-0.0312
-0.08,-0.0241
-0.02,-0.0252
0.02,0.0251
0.08,0.0241
0.3,0.0312
1,0.059
"""
WRIST = """joint: {name: points}
signals:
  velocity: {column: "v [rad/s]", unit: rad/s}
  torque: {column: "tau [Nm]", unit: N*m}
runs: [{files: points.csv, experiment: points}]
fit: {directions: symmetric}
"""


@pytest.mark.usefixtures("few_motions", "few_studies")
@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_runs(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It prints what it says."""
    if name == "fleet":
        pytest.importorskip("distributed", reason="needs the extra fleet")
    (tmp_path / "points.csv").write_text(POINTS, encoding="utf-8")
    (tmp_path / "wrist.yaml").write_text(WRIST, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(registry, "_PARTS", registry._PARTS.copy())
    found = doctest.DocTestFinder(recurse=False).find(getattr(bristle, name), name, globs={}, module=api)
    ran = [doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE).run(test) for test in found]
    assert sum(result.attempted for result in ran) > 1
    assert not any(result.failed for result in ran)
