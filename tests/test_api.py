import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bristle
from bristle import Results, api
from bristle.api import identifying
from bristle.api.sources import JointLogs
from bristle.data.experiment.load import load_experiment
from bristle.identification.fits import Estimate, StaticFit
from bristle.identification.measured import Measured
from bristle.model.parameters import Direction, Lugre, ParameterName
from bristle.questions.joint_report import results_file
from bristle.simulation.edro import TABLE_1

from .conftest import FEW, present, speeds, write

COLUMNS = ["joint", "direction", "parameter", "value", "unit", "standard_error", "lower", "upper", "warnings"]


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Results:
    return bristle.identify(write(tmp_path_factory.mktemp("clean"), speeds()))


def test_the_package_offers_the_api(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`bristle` offers what it lists, each the library's own, and refuses any other name as Python does."""
    names = set(bristle.__all__) - {"__version__"}
    assert not [name for name in names if getattr(bristle, name) is not getattr(api, name)]
    with pytest.raises(AttributeError, match="nothing_such"):
        _ = bristle.nothing_such
    # `inspect` gives runs and segments, frozen too, and never comes near a fit
    monkeypatch.delattr("bristle.identification.static.fit.fit_static")
    measured = bristle.inspect(write(tmp_path, FEW))
    assert isinstance(measured, Measured)
    assert [segment.velocity for found in measured.segments for segment in found] == FEW.tolist()
    check_immutable((measured.runs, measured.segments))


def test_joints_of_one_name_are_refused(tmp_path: Path) -> None:
    """Two experiments that name the same joint are refused before anything is read, and the name is said."""
    path = write(tmp_path, FEW)
    (tmp_path / "wrist.csv").rename(tmp_path / "away.csv")
    with pytest.raises(ValueError, match=r"joint\.name: 2 experiments name their joint 'wrist'"):
        bristle.identify(path, path)
    # joints come out in the order in which their experiments went in
    names = ["wrist", "base", "Elbow"]
    results = bristle.identify(*(write(tmp_path, FEW, joint=name, stem=name) for name in names))
    assert [joint.name for joint in results.joints] == names
    assert list(json.loads(results.to_json())["joints"]) == names
    assert list(dict.fromkeys(warning.subject[0] for warning in results.warnings)) == names
    # an experiment gives the same results as a path, as that path's text, and loaded
    one, two, three = (bristle.identify(source).to_json() for source in (path, str(path), load_experiment(path)))
    assert one == two == three


def test_tables_and_single_joints_of_results(clean: Results, tmp_path: Path) -> None:
    """The table has a row for each joint, direction and parameter, in order, and the numbers of the estimates."""
    frame = clean.to_frame()
    rows = [
        (joint.name, direction, name, e.value, e.unit, e.standard_error, *(e.interval or ()), "; ".join(map(str, e.warnings)))
        for joint in clean.joints
        for direction, fit in joint.static.items()
        for name, e in fit.parameters.items()
    ]  # fmt: skip  # a row, one line
    assert list(frame.columns) == COLUMNS
    assert [tuple(row) for row in frame.itertuples(index=False)] == rows
    assert len(rows) == 8
    assert (frame["lower"] <= frame["value"]).all()
    assert (frame["value"] <= frame["upper"]).all()
    # where nothing can be estimated the table has the same rows, each nan and with a warning that says why, and the JSON null
    results = bristle.identify(write(tmp_path, FEW))
    frame = results.to_frame()
    assert list(frame.columns) == COLUMNS
    assert len(frame) == 8
    assert frame[["value", "standard_error", "lower", "upper"]].isna().all(axis=None)
    assert frame["warnings"].str.contains("points for").all()
    for fit in json.loads(results.to_json())["joints"]["wrist"]["static"].values():
        assert all(p["value"] is None and p["warnings"] for p in fit["parameters"].values())
    # results are frozen through and through, the runs and segments behind them too; writing into one of their arrays is an error
    found = check_immutable(replace(clean, logs=JointLogs()))
    check_immutable(tuple(x for measured in clean.measured for x in (measured.runs, measured.segments)))
    assert sum(isinstance(part, StaticFit) for part in found) == 2
    assert sum(isinstance(part, np.ndarray) for part in found) > 10
    # of several joints a results file gives the one that is named, as `--joint` needs it, or says what there is
    (joint,) = clean.joints
    file = tmp_path / "results.json"
    file.write_text(Results(joints=(joint, replace(joint, name="elbow")), logs=clean.logs).to_json(), encoding="utf-8")
    assert [x.name for x in identifying.identified(file, joint="elbow").joints] == ["elbow"]
    # what asks about one joint refuses results of two, and such as hold no data, with what it got
    with pytest.raises(ValueError, match="got 2 joints; expected one: say which with joint, one of wrist, elbow"):
        bristle.plan(file)
    with pytest.raises(ValueError, match="got results without their logs"):
        bristle.plan(Results(joints=(joint,)))


def parts(value: object) -> Iterator[object]:
    """Everything that results hold, at any depth, arrays and the results themselves included."""
    yield value
    if is_dataclass(value):
        value = {f.name: getattr(value, f.name) for f in fields(value)}
    if isinstance(value, Mapping | tuple):
        for item in value.values() if isinstance(value, Mapping) else value:
            yield from parts(item)


def check_immutable(result: object) -> list[object]:
    """No dataclass in it can be assigned to, no array written to, and nothing in it is a list or a set; returns its parts."""
    found = list(parts(result))
    for part in found:
        assert not isinstance(part, list | set | bytearray)
        assert not is_dataclass(part) or vars(type(part))["__dataclass_params__"].frozen
        assert not isinstance(part, np.ndarray) or not part.flags.writeable
    return found


STATIC = ("alpha_0", "alpha_1", "alpha_2", "v_s")


@pytest.fixture(scope="module")
def results(edro_results: Path) -> Results:
    return bristle.read_results(edro_results)


def test_nothing_stands_for_the_embedded_joints(results: Results, edro_report: Path) -> None:
    """Without an experiment the four joints of Ed-Ro are identified, in the order of Table 1, and progress is told of each."""
    told = json.loads(edro_report.with_name("edro.told.json").read_text(encoding="utf-8"))
    assert [joint.name for joint in results.joints] == list(TABLE_1)
    expected = [[f"identifying {name}", k, 4] for k, name in enumerate(TABLE_1)]
    assert [step for step in told if step in expected] == expected
    # each joint's second slow cycle is a hysteresis loop, or a warning says how far it drifts; at least two joints show a loop
    shown = [joint.presliding for joint in results.joints if joint.presliding]
    assert len(shown) == 4
    assert all(bool(p.loops) != any(warning.code == "open-cycles" for warning in p.warnings) for p in shown)
    assert sum(bool(p.loops) for p in shown) >= 2
    # what is critical or a caution in the results has the codes that docs/warnings.md lists with a cause, and each of these is there
    page = (Path(__file__).parents[1] / "docs" / "warnings.md").read_text(encoding="utf-8")
    table = page.partition("its cause in the simulation")[2].partition("\n\n")[0]
    listed = {code for row in re.findall(r"^\| (`.*?) \|", table, re.MULTILINE) for code in re.findall(r"[\w-]+", row)}
    assert set(warned(json.loads(results_file.to_json(results.joints)))) == listed


def holds(e: Estimate, true: float) -> bool:
    return e.interval is not None and e.interval[0] <= true <= e.interval[1]


def test_static_parameters_are_found(results: Results) -> None:
    """At least 26 of 32 true values lie in their intervals, alpha_0 and alpha_2 within 2 %; grid and full fit agree to 1 % of a standard error."""
    inside = 0
    for joint in results.joints:
        for d, p in joint.truth.items():
            found = joint.static[d].parameters
            inside += sum(holds(found[name], getattr(p, name)) for name in STATIC)
            assert found["alpha_0"].value == pytest.approx(p.alpha_0, rel=0.02)
            assert found["alpha_2"].value == pytest.approx(p.alpha_2, rel=0.02)
            assert max(map(abs, joint.crosscheck[d].difference_in_se.values())) < 0.01
    assert inside >= 26
    # in 6 of 8 cases the interval holds sigma_0; sigma_1 is a prior
    inside = 0
    for joint in results.joints:
        for d, p in joint.truth.items():
            fit = present(joint.presliding).fits[d]
            inside += holds(fit.sigma_0, p.sigma_0)
            assert fit.sigma_0.value == pytest.approx(p.sigma_0, rel=0.05)
            assert fit.sigma_1.warnings[0].code == "prior"
    assert inside >= 6
    # at least 40 of the 48 true values lie in the intervals of the joint fit, the held-out torque is predicted to 2 %, and the stages agree
    inside = 0
    for joint in results.joints:
        fit = present(joint.joint_fit)
        inside += sum(
            holds(fit.parameters[ParameterName(name, Direction(d))], getattr(p, name))
            for d, p in joint.truth.items()
            for name in Lugre._fields
        )
        assert all(held.relative_error < 2 for held in fit.hold_out)
        assert len(fit.hold_out) == 1
        assert sum(c.verdict.code == "stage-agrees" for c in joint.consistency) >= 8
    assert inside >= 40


def warned(value: Any) -> Iterator[str]:
    """The kind of each diagnostic of a results file that is critical or a caution, wherever it stands."""
    match value:
        case {"severity": severity, "code": str(kind), "message": _}:
            yield from [kind] if severity != "note" else []
        case dict():
            yield from (kind for x in value.values() for kind in warned(x))
        case list():
            yield from (kind for x in value for kind in warned(x))
