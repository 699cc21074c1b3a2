import json
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import bristle
from bristle.data.record import Record
from bristle.data.units import to_si
from bristle.errors import InputError
from bristle.questions.export.export import TARGETS

from .conftest import run
from .fuzz.inputs import logs

BOTH = """
joint: {name: wrist}
signals:
  velocity: {column: v, unit: rad/s}
  torque: {column: tau, unit: N*m}
runs:
  - {files: points.csv, experiment: points}
  - files: tracking.csv
    experiment: tracking
    signals: {time: {column: t, unit: s}, position: {column: q, unit: rad}}
"""
ASKS: tuple[tuple[str, ...], ...] = (
    *(("export", "--to", to) for to in TARGETS),
    ("explore", "-o", "x.html"), ("plan",), ("adapt", "-o", "out"), ("sensitivity", "--samples", "0", "-o", "out"),
)  # fmt: skip  # a list
"""What makes a joint of results."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Points and a moving run, and `good.json`, the results of them."""
    here = tmp_path_factory.mktemp("bad")
    for kind in ("points", "tracking"):
        pd.DataFrame(logs()[kind]).to_csv(here / f"{kind}.csv", index=False)
    (here / "e.yaml").write_text(BOTH, encoding="utf-8")
    (here / "good.json").write_text(bristle.identify(here / "e.yaml").to_json(here), encoding="utf-8")
    return here


@pytest.fixture(autouse=True)
def _inside(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)


def estimates(value: Any) -> Iterator[tuple[str, dict[str, Any]]]:
    """Every estimate of a document, with the name under which it stands there."""
    for key, held in value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ():
        if isinstance(held, dict) and {"value", "interval", "unit"} <= held.keys():
            yield str(key).rstrip("+-"), held
        yield from estimates(held)


def spoilt(parameter: str, value: Callable[[dict[str, Any]], float]) -> str:
    """The name of a results file in which a parameter has another value in every stage."""
    document = json.loads(Path("good.json").read_text(encoding="utf-8"))
    for name, estimate in list(estimates(document["joints"])):
        if name == parameter and estimate["value"] is not None:
            estimate["value"] = value(estimate)
    Path("bad.json").write_text(json.dumps(document), encoding="utf-8")
    return "bad.json"


def one_sentence(*arguments: object, says: str) -> str | None:
    """What is wrong with how a command ends: not with 2, not in one sentence, or in another one."""
    ran = run(*arguments)
    right = ran.code == 2 and len(ran.said) == 1 and says in ran.said[0]
    return None if right else f"{arguments}: {ran.code}, {ran.out[-200:]} {ran.err[-200:]}"


def test_bad_numbers_in_a_results_file() -> None:
    """Every export, the explorer, plans, loops and sensitivities refuse it by the one sentence, and write nothing."""
    file, before = spoilt("sigma_0", lambda _: -1.0), set(Path().iterdir())
    says = " = -1 N*m/rad; expected more than 0: look at its fit in the report"
    assert not [fault for ask in ASKS if (fault := one_sentence(ask[0], file, *ask[1:], says=says))]
    assert set(Path().iterdir()) == before
    # Stribeck velocity and inertia are above zero, the others of the law not below, and none is outside its own interval
    cases: list[tuple[str, Callable[[dict[str, Any]], float], str]] = [
        ("v_s", lambda _: 0.0, "got v_s+ = 0 rad/s; expected more than 0"),
        ("inertia", lambda _: -1e-3, "got inertia = -0.001 kg*m**2; expected more than 0"),
        ("sigma_1", lambda _: -1.0, " = -1 N*m*s/rad; expected at least 0"),
        ("alpha_2", lambda e: 3 * e["interval"][1], "expected a value within its own interval"),
    ]
    faults = []
    for name, value, says in cases:
        file = spoilt(name, value)
        for ask in (("export", file, "--to", "urdf"), ("explore", file, "-o", "x.html")):
            faults += [fault] if (fault := one_sentence(*ask, says=says)) else []
    assert not faults
    assert run("export", "good.json", "--to", "urdf", "-o", "good.urdf").code == 0
    # its text, its report and its comparison are there; of the report only the page to play with is not
    bad = bristle.read_results(spoilt("sigma_0", lambda _: 0.0))
    assert "sigma_0+" in bad.text()
    assert "sigma_0+" in bad.text(full=True)
    assert bristle.compare("good.json", "bad.json").changes
    assert run("report", "bad.json", "-o", "shown").code == 0
    assert Path("shown/index.html").exists()
    assert not Path("shown/explore.html").exists()
    # `identify` of them is refused, as are results of an older version, which had no samples
    assert one_sentence("identify", "good.json", says="is a results file, identified already") is None
    good = json.loads(Path("good.json").read_text(encoding="utf-8"))
    Path("old.json").write_text(
        json.dumps({name: x for name, x in good.items() if name != "samples"}), encoding="utf-8"
    )
    says = "old.json: is not a results file of schema bristle-results/3 (samples: "
    assert refusal(lambda: bristle.read_results("old.json")).startswith(says)


def refusal(ask: Callable[[], object]) -> str:
    """The sentence by which a call is refused; empty where it is not, and where it fails otherwise what it failed with."""
    try:
        ask()
    except InputError as error:
        return str(error)
    except Exception as error:  # noqa: BLE001  # which is what must not be
        return f"{type(error).__name__}: {error}"
    return ""


def test_masked_values_and_values_of_no_kind() -> None:
    """Each call that takes arrays refuses values that a mask hides by the sentence that it has for nan."""
    t: Any = np.arange(0.0, 4.0, 0.01)
    whole, hidden = np.sin(t), np.isin(np.arange(t.size), [3, 4, 5])
    masked, gone = np.ma.array(np.where(hidden, 0.3, whole), mask=hidden), np.where(hidden, np.nan, whole)
    asks: dict[str, Callable[[Any], object]] = {
        "fit": lambda x: bristle.fit(whole, x),
        "fit_dynamic time": lambda x: bristle.fit_dynamic(x, whole, whole),
        "find_segments": lambda x: bristle.find_segments(t, whole, whole, velocity=x),
        "simulate": lambda x: bristle.simulate(x, 0.01, bristle.Lugre(0.02, 0.006, 0.04, 0.07, 6.0, 0.02)),
        "Record": lambda x: Record(file="f", time=t, torque=x),
    }
    said = {name: tuple(refusal(partial(ask, x)) for x in (masked, gone)) for name, ask in asks.items()}
    assert not {name: both for name, both in said.items() if both[0] != both[1] or not both[0] or "Error" in both[0]}
    assert "torque is missing or not finite in 3 of 400 rows, first in row 3 (from 0)" in said["fit"][0]
    instants = np.ma.array(np.datetime64("2026-01-01") + (1000 * t).astype("m8[ms]"), mask=hidden)
    assert "time is missing or not finite in 3 of 400" in refusal(lambda: bristle.find_segments(instants, whole, whole))
    law = bristle.Lugre(0.02, 0.006, 0.04, 0.07, 6.0, 0.02)
    assert (np.isnan(bristle.friction(masked, law)) == hidden).all()
    # kinds that there are none of, numbers and fits in the place of results: each is one sentence that says what was expected
    v = np.r_[np.geomspace(0.02, 0.8, 12), -np.geomspace(0.02, 0.8, 12)]
    fit = bristle.fit(v, 0.3 * np.sign(v) + 0.4 * v + 1e-3 * np.cos(9e3 * v))
    some: Any = 5
    evil: Any = "evil"
    wrong: dict[str, tuple[Callable[[], object], str]] = {
        "fit": (lambda: bristle.fit(v, v, kind=evil), "kind: got 'evil'; expected 'revolute' or 'prismatic'"),
        "fit_dynamic": (lambda: bristle.fit_dynamic(t, t, t, kind=evil, inertia=0.1), "kind: got 'evil'"),
        "compare": (lambda: bristle.compare(fit, fit), "expected results as identify gave them, or the path"),  # type: ignore[arg-type]
        "plan": (lambda: bristle.plan(some), "got 5, int; expected an experiment, or the path of its file"),
        "read_results": (lambda: bristle.read_results(some), "got 5, int; expected the path of a results.json"),
    }
    told = [(refusal(ask), expected) for ask, expected in wrong.values()]
    assert [x for x in told if x[1] not in x[0] or "Error:" in x[0]] == []


POINTS = """
joint: {name: wrist}
signals: {velocity: {column: v, unit: rad/s}, torque: {column: tau, unit: N*m}}
runs: [{files: points.csv, experiment: points}]
"""
MOVING = """
joint: {name: wrist}
signals:
  time: {column: t, unit: s}
  position: {column: q, unit: rad}
  velocity: {column: v, unit: rad/s}
  torque: {column: tau, unit: N*m}
runs: [{files: tracking.csv, experiment: tracking}]
"""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with points and a moving run, in which one is."""
    for kind in ("points", "tracking"):
        pd.DataFrame(logs()[kind]).to_csv(tmp_path / f"{kind}.csv", index=False)
    (tmp_path / "e.yaml").write_text(POINTS, encoding="utf-8")
    (tmp_path / "m.yaml").write_text(MOVING, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_options_that_are_taken_warn_of_nothing(here: Path) -> None:
    """A value far off is taken without a word of NumPy's: warnings are errors here."""
    (here / "m.yaml").write_text(f"{MOVING}fit: {{fixed: {{alpha_1: 1e20 N*m}}}}\n", encoding="utf-8")
    assert run("identify", "m.yaml").code == 0
    # points of no torque, and one whose speed is rounding, are read and fitted, or refused in a sentence; no warning, no traceback
    for torque in (0.0, 1e-18):
        frame = pd.DataFrame(logs()["points"])
        frame["tau"] = torque * np.sign(frame["v"])
        frame.loc[3, "v"] = 5e-324
        frame.to_csv(here / "points.csv", index=False)
        for command in (("identify", "e.yaml"), ("sensitivity", "e.yaml", "--samples", "0", "-o", "out")):
            assert run(*command).code in {0, 2}
        assert "1 point" not in run("inspect", "e.yaml").err


def test_links_and_powers_without_end(here: Path) -> None:
    """Two links that lead back up do not hold a glob up, which leaves out hidden folders; a power of powers is refused at once."""
    for folder in (here / "logs" / "a", here / "logs" / "a" / ".hidden"):
        folder.mkdir(parents=True)
        (folder / "points.csv").write_bytes((here / "points.csv").read_bytes())
    for name in ("l1", "l2"):
        (here / "logs" / "a" / name).symlink_to("..")
    (here / "e.yaml").write_text(POINTS.replace("points.csv", f"{here}/logs/**/*.csv"), encoding="utf-8")
    assert run("inspect", "e.yaml").out.count("24 rows") == 1
    begun = time.monotonic()
    for power in ("9⁹⁹⁹⁹⁹⁹⁹⁹", "((((((((9**9)**9)**9)**9)**9)**9)**9)**9)", "9⁻⁹⁹⁹⁹", "(2**9)**9*(2**9)**9"):
        with pytest.raises(InputError, match="is not known"):
            to_si(f"1 N*m*{power}", "N*m")
    assert time.monotonic() - begun < 5


@pytest.mark.parametrize("last", [0.0, 1e-190])
def test_a_torque_of_next_to_nothing_warns_of_nothing(here: Path, last: float) -> None:
    """A moving run whose torque is zero, or nearly, throughout or but for one row, ends with a result or a sentence; warnings are errors here."""
    tau = np.append(np.zeros(logs()["tracking"]["tau"].size - 1), last)
    pd.DataFrame({**logs()["tracking"], "tau": tau}).to_csv(here / "tracking.csv", index=False)
    for text in (MOVING, MOVING.replace("  velocity: {column: v, unit: rad/s}\n", "")):
        (here / "m.yaml").write_text(text, encoding="utf-8")
        assert run("identify", "m.yaml").code in (0, 2)
