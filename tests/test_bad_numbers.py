"""Numbers that no joint has, masked arrays, older results and options beyond reason: one sentence each, and no number that is wrong in silence."""

import json
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import bristle
from bristle.data.record import Record
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


def test_no_question_takes_a_number_that_no_joint_has() -> None:
    """Every export, the explorer, plans, loops and sensitivities refuse it by the one sentence, and write nothing."""
    file, before = spoilt("sigma_0", lambda _: -1.0), set(Path().iterdir())
    says = " = -1 N*m/rad; expected more than 0: look at its fit in the report"
    assert not [fault for ask in ASKS if (fault := one_sentence(ask[0], file, *ask[1:], says=says))]
    assert set(Path().iterdir()) == before


def test_which_numbers_no_joint_has() -> None:
    """Stiffness, Stribeck velocity and inertia are above zero, the others of the law not below, and none is outside its own interval."""
    cases: list[tuple[str, Callable[[dict[str, Any]], float], str]] = [
        ("sigma_0", lambda _: 0.0, " = 0 N*m/rad; expected more than 0"),
        ("v_s", lambda _: 0.0, "got v_s+ = 0 rad/s; expected more than 0"),
        ("inertia", lambda _: 0.0, "got inertia = 0 kg*m**2; expected more than 0"),
        ("inertia", lambda _: -1e-3, "got inertia = -0.001 kg*m**2; expected more than 0"),
        ("sigma_1", lambda _: -1.0, " = -1 N*m*s/rad; expected at least 0"),
        ("alpha_0", lambda _: -0.01, "got alpha_0+ = -0.01 N*m; expected more than 0"),
        ("alpha_2", lambda e: 3 * e["interval"][1], "expected a value within its own interval"),
    ]
    faults = []
    for name, value, says in cases:
        file = spoilt(name, value)
        for ask in (("export", file, "--to", "urdf"), ("explore", file, "-o", "x.html")):
            faults += [fault] if (fault := one_sentence(*ask, says=says)) else []
    assert not faults
    assert run("export", "good.json", "--to", "urdf", "-o", "good.urdf").code == 0


def test_a_bad_fit_is_read_shown_and_compared() -> None:
    """Its text, its report and its comparison are there; of the report only the page to play with is not."""
    bad = bristle.read_results(spoilt("sigma_0", lambda _: 0.0))
    assert "sigma_0+" in bad.text()
    assert "sigma_0+" in bad.text(full=True)
    assert bristle.compare("good.json", "bad.json").changes
    assert run("report", "bad.json", "-o", "shown").code == 0
    assert Path("shown/index.html").exists()
    assert not Path("shown/explore.html").exists()


def test_results_are_not_identified_again() -> None:
    """`identify` of them is refused; what asks about them is answered."""
    assert one_sentence("identify", "good.json", says="is a results file, identified already") is None
    assert run("sensitivity", "good.json", "--samples", "0", "-o", "sensitivity").code == 0


def test_a_validation_needs_a_law() -> None:
    """Points are simulated from no law without a Stribeck velocity."""
    with pytest.raises(InputError, match=r"wrist: got v_s\+ = 0; expected more than 0"):
        bristle.validate(spoilt("v_s", lambda _: 0.0), repetitions=20, starts=1)


@pytest.mark.parametrize("known", [{}, {"samples": None}, {"samples": None, "experiments": []}, {"samples": {}}])
def test_results_without_samples_are_refused(known: dict[str, object]) -> None:
    """An older version wrote none: every question of them says in a sentence that they are no results of this one."""
    good = json.loads(Path("good.json").read_text(encoding="utf-8"))
    bare = {name: held for name, held in good.items() if name not in ("samples", "experiments")}
    Path("old.json").write_text(json.dumps((good if known else bare) | known), encoding="utf-8")
    says = "old.json: is not a results file of schema bristle-results/3 (samples: "
    assert refusal(lambda: bristle.read_results("old.json")).startswith(says)
    more = (("report", "-o", "out"), ("validate", "-o", "out"), ("inspect",))
    assert not [fault for ask in (*ASKS, *more) if (fault := one_sentence(ask[0], "old.json", *ask[1:], says=says))]


def refusal(ask: Callable[[], object]) -> str:
    """The sentence by which a call is refused; empty where it is not, and where it fails otherwise what it failed with."""
    try:
        ask()
    except InputError as error:
        return str(error)
    except Exception as error:  # noqa: BLE001  # which is what must not be
        return f"{type(error).__name__}: {error}"
    return ""


def test_masked_values_are_missing_ones() -> None:
    """Each call that takes arrays refuses values that a mask hides by the sentence that it has for nan."""
    t = np.arange(0.0, 4.0, 0.01)
    whole, hidden = np.sin(t), np.isin(np.arange(t.size), [3, 4, 5])
    masked, gone = np.ma.array(np.where(hidden, 0.3, whole), mask=hidden), np.where(hidden, np.nan, whole)
    asks: dict[str, Callable[[Any], object]] = {
        "fit": lambda x: bristle.fit(whole, x),
        "fit velocity": lambda x: bristle.fit(x, whole),
        "fit_presliding": lambda x: bristle.fit_presliding(t, x, whole),
        "fit_dynamic": lambda x: bristle.fit_dynamic(t, whole, x),
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


def test_what_is_no_joint_is_refused() -> None:
    """Kinds that there are none of, numbers and fits in the place of results: each is one sentence that says what was expected."""
    v = np.r_[np.geomspace(0.02, 0.8, 12), -np.geomspace(0.02, 0.8, 12)]
    fit = bristle.fit(v, 0.3 * np.sign(v) + 0.4 * v + 1e-3 * np.cos(9e3 * v))
    t: Any = np.arange(0.0, 4.0, 0.01)
    some: Any = 5
    evil: Any = "evil"
    asks: dict[str, tuple[Callable[[], object], str]] = {
        "fit": (lambda: bristle.fit(v, v, kind=evil), "kind: got 'evil'; expected 'revolute' or 'prismatic'"),
        "fit_dynamic": (lambda: bristle.fit_dynamic(t, t, t, kind=evil, inertia=0.1), "kind: got 'evil'"),
        "fit_presliding": (lambda: bristle.fit_presliding(t, t, t, kind=evil), "kind: got 'evil'"),
        "find_segments": (lambda: bristle.find_segments(t, t, t, kind=evil), "kind: got 'evil'"),
        "compare": (lambda: bristle.compare(fit, fit), "expected results as identify gave them, or the path"),  # type: ignore[arg-type]
        "plan": (lambda: bristle.plan(some), "got 5, int; expected an experiment, or the path of its file"),
        "identify": (lambda: bristle.identify(some), "got 5, int; expected an experiment"),
        "inspect": (lambda: bristle.inspect(some), "got 5, int; expected an experiment"),
        "explore": (lambda: bristle.explore(some), "got 5, int; expected an experiment"),
        "export": (lambda: bristle.export(some, "c"), "got 5, int; expected an experiment"),
        "read_results": (lambda: bristle.read_results(some), "got 5, int; expected the path of a results.json"),
    }
    said = {name: refusal(ask) for name, (ask, _) in asks.items()}
    assert not {
        name: said[name] for name, (_, expected) in asks.items() if expected not in said[name] or "Error:" in said[name]
    }
