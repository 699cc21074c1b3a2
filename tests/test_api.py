import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import FrozenInstanceError, fields, is_dataclass, replace
from pathlib import Path

import numpy as np
import pytest

import bristle
from bristle import Results, api
from bristle.api import identifying
from bristle.api.sources import JointLogs
from bristle.data.experiment.load import load_experiment
from bristle.identification.fits import StaticFit
from bristle.identification.measured import Measured

from .conftest import FEW, speeds, write

COLUMNS = ["joint", "direction", "parameter", "value", "unit", "standard_error", "lower", "upper", "warnings"]


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Results:
    """One joint, well identified in both directions."""
    return bristle.identify(write(tmp_path_factory.mktemp("clean"), speeds()))


def test_the_package_offers_the_api() -> None:
    """`bristle` offers what it lists, each the library's own, and refuses any other name as Python does."""
    names = set(bristle.__all__) - {"__version__"}
    assert not [name for name in names if getattr(bristle, name) is not getattr(api, name)]
    with pytest.raises(AttributeError, match="nothing_such"):
        _ = bristle.nothing_such


def test_joints_of_one_name_are_refused(tmp_path: Path) -> None:
    """Two experiments that name the same joint are refused before anything is read, and the name is said."""
    joints = {"a": "wrist", "b": "elbow", "c": "wrist"}
    paths = [write(tmp_path, FEW, joint=joint, stem=stem) for stem, joint in joints.items()]
    for data in tmp_path.glob("*.csv"):
        data.unlink()
    with pytest.raises(ValueError, match=r"joint\.name: 2 experiments name their joint 'wrist'"):
        bristle.identify(*paths)
    with pytest.raises(ValueError, match=r"joint\.name"):
        bristle.identify(paths[1], paths[1])


def test_joints_keep_their_order(tmp_path: Path) -> None:
    """Joints come out in the order in which their experiments went in: in the results, the JSON, the table and the text."""
    names = ["wrist", "base", "Elbow", "arm"]
    results = bristle.identify(*(write(tmp_path, FEW, joint=name, stem=name) for name in names))
    assert [joint.name for joint in results.joints] == names
    assert list(json.loads(results.to_json())["joints"]) == names
    assert list(results.to_frame()["joint"].unique()) == names
    assert re.findall(r"^\[\[(\w+)\]\]", results.text(full=True), re.MULTILINE) == names
    assert re.findall(r"^(\w+) \(revolute\)", str(results), re.MULTILINE) == names
    assert list(dict.fromkeys(warning.subject[0] for warning in results.warnings)) == names


def test_a_source_is_a_path_its_text_or_the_experiment(tmp_path: Path) -> None:
    """An experiment gives the same results as a path, as that path's text, and loaded."""
    path = write(tmp_path, FEW)
    one, two, three = (bristle.identify(source).to_json() for source in (path, str(path), load_experiment(path)))
    assert one == two == three


def test_table_holds_every_estimate(clean: Results) -> None:
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


def test_what_is_missing_is_nan_with_a_warning(tmp_path: Path) -> None:
    """Where nothing can be estimated the table has the same rows, each nan and with a warning that says why, and the JSON null."""
    results = bristle.identify(write(tmp_path, FEW))
    frame = results.to_frame()
    assert list(frame.columns) == COLUMNS
    assert len(frame) == 8
    assert frame[["value", "standard_error", "lower", "upper"]].isna().all(axis=None)
    assert frame["warnings"].str.contains("points for").all()
    for fit in json.loads(results.to_json())["joints"]["wrist"]["static"].values():
        assert all(p["value"] is None and p["warnings"] for p in fit["parameters"].values())


def parts(value: object) -> Iterator[object]:
    """Everything that results hold, at any depth, arrays and the results themselves included."""
    yield value
    inside: Iterator[object] = iter(())
    if is_dataclass(value):
        inside = (getattr(value, f.name) for f in fields(value))
    elif isinstance(value, Mapping):
        inside = iter(value.values())
    elif isinstance(value, tuple):
        inside = iter(value)
    for item in inside:
        yield from parts(item)


def check_immutable(result: object) -> list[object]:
    """No dataclass in it can be assigned to, no array written to, and nothing in it is a list or a set; returns its parts."""
    found = list(parts(result))
    for part in found:
        assert not isinstance(part, list | set | bytearray)
        if is_dataclass(part):
            with pytest.raises(FrozenInstanceError):
                setattr(part, fields(part)[0].name, None)
        if isinstance(part, np.ndarray):
            assert not part.flags.writeable
    return found


def test_results_cannot_be_changed(clean: Results) -> None:
    """Results are frozen through and through, the runs and segments behind them too; writing into one of their arrays is an error."""
    found = check_immutable(replace(clean, logs=JointLogs()))
    check_immutable(tuple(x for measured in clean.measured for x in (measured.runs, measured.segments)))
    assert sum(isinstance(part, StaticFit) for part in found) == 2
    assert sum(isinstance(part, np.ndarray) for part in found) > 10
    with pytest.raises(ValueError, match="read-only"):
        clean.joints[0].static["+"].covariance[0, 0] = 0.0


def test_inspect_reads_and_fits_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`inspect` gives runs and segments, frozen too, and never comes near a fit."""
    monkeypatch.delattr("bristle.identification.static.fit.fit_static")
    measured = bristle.inspect(write(tmp_path, FEW))
    assert isinstance(measured, Measured)
    assert [segment.velocity for found in measured.segments for segment in found] == FEW.tolist()
    check_immutable((measured.runs, measured.segments))


def test_one_joint_of_a_results_file_is_taken(tmp_path: Path, clean: Results) -> None:
    """A results file of several joints gives the one that is named, as `bristle validate --joint` needs it, or says what there is."""
    (joint,) = clean.joints
    file = tmp_path / "results.json"
    file.write_text(Results(joints=(joint, replace(joint, name="elbow")), logs=clean.logs).to_json(), encoding="utf-8")
    assert [x.name for x in identifying.identified(file, joint="elbow").joints] == ["elbow"]
    with pytest.raises(ValueError, match="one of wrist, elbow"):
        identifying.identified(file, joint="knee")


def test_results_of_several_joints_are_no_joint(clean: Results) -> None:
    """What asks about one joint refuses results of two, and such as hold no data, with what it got."""
    (joint,) = clean.joints
    two = Results(joints=(joint, replace(joint, name="elbow")), logs=clean.logs)
    with pytest.raises(ValueError, match="got 2 joints; expected one: say which with joint, one of wrist, elbow"):
        bristle.plan(two)
    with pytest.raises(ValueError, match="got results without their logs"):
        bristle.plan(Results(joints=(joint,)))
