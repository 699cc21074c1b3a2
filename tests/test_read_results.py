import json
import time
from base64 import b64encode
from collections.abc import Callable, Iterator, Mapping
from copy import deepcopy
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import bristle
from bristle import Results
from bristle.api import identifying, sources
from bristle.data.experiment.load import load_experiment
from bristle.errors import InputError
from bristle.findings import Finding
from bristle.identification.results import Joint

from .conftest import run, speeds, tree, write
from .fuzz.inputs import logs

EVERYTHING = """
joint: {name: wrist}
inertia: 1.3e-3 +/- 1e-4 kg*m**2
signals:
  velocity: {column: v, unit: rad/s}
  torque: {column: tau, unit: N*m}
runs:
  - {files: points.csv, experiment: points}
  - files: tracking.csv
    experiment: tracking
    signals: {time: {column: t, unit: s}, position: {column: q, unit: rad}}
  - files: presliding.csv
    experiment: presliding
    signals: {time: {column: t, unit: s}, position: {column: q, unit: rad}}
fit: {decimation: 2}
"""
Ask = Callable[[Any], str]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An experiment of every kind of run, its logs, and `out/results.json` of it."""
    here = tmp_path_factory.mktemp("read")
    for kind in ("points", "tracking", "presliding"):
        pd.DataFrame(logs()[kind]).to_csv(here / f"{kind}.csv", index=False)
    (here / "wrist.yaml").write_text(EVERYTHING, encoding="utf-8")
    return here


@pytest.fixture(scope="module")
def fresh(folder: Path) -> Results:
    """What `identify` returned; its `results.json` lies in `out`."""
    found = bristle.identify(folder / "wrist.yaml", uncertainty=True)
    (folder / "out").mkdir()
    (folder / "out" / "results.json").write_text(found.to_json(folder / "out"), encoding="utf-8")
    return found


@pytest.fixture
def read(folder: Path, fresh: Results, monkeypatch: pytest.MonkeyPatch) -> Results:
    """The same, read; from here on nothing can be identified."""
    assert fresh.joints

    def no_more(*_: object, **__: object) -> Joint:
        raise AssertionError("identified again")

    monkeypatch.setattr(identifying, "identify_joint", no_more)
    return bristle.read_results(folder / "out" / "results.json")


def leaves(value: Any, at: str = "") -> Iterator[tuple[str, Any]]:
    """Everything that a value holds at any depth, exactly, by the way to it; fields that do not compare included."""
    match value:
        case Finding():
            yield at, (value.code, str(value), value.subject)
        case np.ndarray():
            yield at, (value.shape, value.dtype, value.tobytes(), value.flags.writeable)
        case float():
            yield at, repr(float(value))
        case Mapping():
            yield at, list(value)
            for key in value:
                yield from leaves(value[key], f"{at}/{key}")
        case _ if is_dataclass(value):
            for item in fields(value):
                yield from leaves(getattr(value, item.name), f"{at}/{item.name}")
        case tuple() if not hasattr(value, "_fields"):
            yield at, len(value)
            for k, held in enumerate(value):
                yield from leaves(held, f"{at}/{k}")
        case _:
            yield at, value


def test_what_is_read_is_what_was_written(fresh: Results, read: Results) -> None:
    """Every field of the joint is that of the fresh one, to the last bit, those with an entry per sample too; written again it is the same text."""
    (joint,), (again,) = fresh.joints, read.joints
    assert dict(leaves(again)) == dict(leaves(joint))
    assert read.to_json("x") == fresh.to_json("x")
    # so are the data that questions ask for, which are read from the logs again
    for one, two in zip(read.measured, fresh.measured, strict=True):
        assert dict(leaves(one)) == dict(leaves(two))
    # of the embedded data set no folder is written: the file is the same on every machine
    logs = sources.JointLogs(texts=tuple(text for _, text in sources.open_all(()) if text))
    stems = ("gripper", "wrist", "elbow", "base")
    assert [(x.file, x.folder) for x in logs.written(Path())] == [(f"{stem}.yaml", None) for stem in stems]


def test_the_file_names_nothing_absolute(fresh: Results, folder: Path) -> None:
    """The experiment is named from where the results lie; the same in two places gives the same bytes; a loaded experiment is a file's."""
    (known,) = json.loads(fresh.to_json(folder / "out"))["experiments"]
    assert (known["file"], known["folder"], known["text"]) == ("wrist.yaml", "..", EVERYTHING)
    assert str(folder) not in fresh.to_json(folder / "out")
    path = write(folder / "loaded", speeds())
    loaded = bristle.identify(load_experiment(path))
    assert loaded.to_json(folder) == bristle.identify(path).to_json(folder)
    path.write_text(path.read_text("utf-8") + "simulated: true\n", encoding="utf-8")
    assert json.loads(bristle.identify(loaded.measured[0].experiment).to_json())["experiments"] == []


@pytest.mark.slow
def test_what_needs_no_logs_asks_for_none(fresh: Results, folder: Path, tmp_path: Path) -> None:
    """Where the logs are gone, the page, tables and text are those of the fresh results, byte for byte; what needs them says so in a sentence."""
    there, here = tmp_path / "there" / "out", tmp_path / "here" / "out"
    there.mkdir(parents=True)
    (there / "results.json").write_text((folder / "out" / "results.json").read_text("utf-8"), encoding="utf-8")
    read = bristle.read_results(there / "results.json")
    assert read.text() == fresh.text()
    assert read._repr_html_() == fresh._repr_html_()
    read.write(here)
    fresh.write(tmp_path / "fresh")
    made, wanted = tree(here), tree(tmp_path / "fresh")
    assert {name for name in {*made, *wanted} if made.get(name) != wanted.get(name)} == {"results.json"}
    bristle.validate(read, repetitions=20, starts=1)
    with pytest.raises(InputError, match=r"points\.csv' is not a file"):
        bristle.plan(read)


def test_a_changed_log_is_told(tmp_path: Path, fresh: Results) -> None:
    """A log that is not as it was, or is missing, is one sentence; nothing is opened before a question needs it; moved together all is found."""
    (tmp_path / "a" / "reports").mkdir(parents=True)
    found = bristle.identify(write(tmp_path / "a", speeds()))
    found.write(tmp_path / "a" / "reports" / "wrist")
    (tmp_path / "a").rename(tmp_path / "b")
    path, log = tmp_path / "b" / "reports" / "wrist" / "results.json", tmp_path / "b" / "wrist.csv"
    (tmp_path / "b" / "wrist.yaml").unlink()
    assert bristle.inspect(path).segments == found.measured[0].segments
    log.write_text(log.read_text("utf-8") + "0.5,0.04\n", encoding="utf-8")
    read = bristle.read_results(path)
    with pytest.raises(InputError, match=r"wrist: wrist\.csv was changed, or added, since the joint was identified"):
        bristle.inspect(read)
    log.unlink()
    with pytest.raises(InputError, match=r"wrist\.csv' is not a file"):
        bristle.inspect(path)
    # what is no base64, has another shape, leads nowhere or is of another type is one sentence, soon. A text of an experiment that is none
    # is told when a question needs the logs, and not before
    path, good = tmp_path / "results.json", json.loads(fresh.to_json())
    wrong = list[tuple[object, ...]]()
    for way, value, says in FOREIGN:
        path.write_text(spoilt(good, way, value), encoding="utf-8")
        begun = time.monotonic()
        ran = run("plan", path)
        if ran.code != 2 or len(ran.said) != 1 or says not in ran.err or time.monotonic() - begun > 5:
            wrong.append((way, says, ran))
    path.write_text(spoilt(good, EXPERIMENTS, foreign(text="!!python/object/apply:os.system [ls]")), encoding="utf-8")
    ran = run("plan", path)
    assert (ran.code, len(ran.said), "which is not YAML" in ran.err) == (2, 1, True)
    assert bristle.read_results(path).to_frame().equals(fresh.to_frame())
    assert wrong == []


ROBOT = """
joints: [{name: shoulder}, {name: elbow}]
signals:
  time: {column: t, unit: s}
  position: {columns: [q0, q1], unit: rad}
  velocity: {columns: [v0, v1], unit: rad/s}
  torque: {columns: [T0, T1], unit: N*m}
runs: [{files: robot.csv, experiment: tracking}]
fit: {decimation: 2}
"""


def test_a_robot_is_read_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a robot each joint is that of the fresh results, and questions name it; the robot's file is kept once, for all."""
    log = logs()["tracking"]
    columns = {f"{short}{k}": log[name] for k in (0, 1) for short, name in (("q", "q"), ("v", "v"), ("T", "tau"))}
    pd.DataFrame({"t": log["t"], **columns}).to_csv(tmp_path / "robot.csv", index=False)
    (tmp_path / "robot.yaml").write_text(ROBOT, encoding="utf-8")
    fresh = bristle.identify(tmp_path / "robot.yaml")
    path = tmp_path / "results.json"
    path.write_text(fresh.to_json(tmp_path), encoding="utf-8")
    (tmp_path / "robot.yaml").unlink()
    monkeypatch.delattr("bristle.api.identifying.identify_joint")
    read = bristle.read_results(path)
    assert [dict(leaves(joint)) for joint in read.joints] == [dict(leaves(joint)) for joint in fresh.joints]
    assert [x["joints"] for x in json.loads(read.to_json(tmp_path))["experiments"]] == [["shoulder", "elbow"]]
    asked = [bristle.report_of(bristle.sensitivity(x, joint="elbow", samples=0)).text() for x in (path, read, fresh)]
    assert asked[0] == asked[1] == asked[2]


def spoilt(good: dict[str, Any], way: tuple[str, ...], value: Any) -> str:
    document = deepcopy(good)
    node: Any = document
    for step in way[:-1]:
        node = node[step]
    node[way[-1]] = value
    return json.dumps(document)


RESIDUALS = ("samples", "wrist", "static/+/residuals")


def foreign(**changed: object) -> list[dict[str, object]]:
    """An experiment as a results file has it, with something changed."""
    return [{"file": "a.yaml", "folder": ".", "text": "", "beside": {}, "joints": ["wrist"]} | changed]


FIT, EXPERIMENTS = ("joints", "wrist", "static", "+"), ("experiments",)
FOREIGN: list[tuple[tuple[str, ...], Any, str]] = [
    (RESIDUALS, {"shape": [12], "float64": "!!"}, "is not base64"),
    (RESIDUALS, {"shape": [12], "float64": "AAAA"}, "has 3 bytes, which are not float64"),
    (RESIDUALS, {"shape": [10**17, 10**17], "float64": ""}, "has 0 bytes"),
    (RESIDUALS, {"shape": [1], "float64": "AAAAAAAAAAA="}, "has shape (1,); expected (n) as beside it"),
    (RESIDUALS, {"shape": [12], "float64": b64encode(np.full(12, 1e200).tobytes()).decode()}, "has a number beyond 1e+100"),
    (RESIDUALS, "static/+/no", "Input should be an object"),
    (RESIDUALS, "segments/0", "Input should be an object"),
    (("samples", "wrist", "static/+/segments"), ["static/+"], "Input should be an object"),
    (("samples", "wrist", "static/+/n"), 3, "is not a field of the joint"),
    (("samples", "elbow"), {}, "is not a joint"),
    (("samples", "wrist"), None, "holds no samples"),
    (EXPERIMENTS, foreign(file="../../etc/passwd"), "the name of a file"),
    (EXPERIMENTS, foreign(folder="b\0"), "control character"),
    (EXPERIMENTS, foreign(text="x" * 2_000_000), "expected at most"),
    ((*FIT, "n"), "x", "Input should be"),
    ((*FIT, "parameters"), {}, "is none of the fit's parameters"),
    ((*FIT, "law"), "free-exponent", "has no "),
    ((*FIT, "parameters", "alpha_0", "unit"), "N", "alpha_0: got the unit 'N'; expected N*m"),
    (("schema",), "bristle-results/9", "schema"),
]  # fmt: skip  # a table
