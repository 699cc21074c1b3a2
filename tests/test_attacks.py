"""Inputs by which a tester broke an earlier version, each of which must end in one sentence, or in a result without a warning."""

import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from bristle.data.units import to_si
from bristle.errors import InputError

from .conftest import run
from .fuzz.inputs import logs

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


def test_no_unit_takes_long() -> None:
    """A power of many digits, or of powers, is refused at once, however it is written, and so is an error; one digit raised is read."""
    powers = ("9⁹⁹⁹⁹⁹⁹⁹⁹", "((((((((9**9)**9)**9)**9)**9)**9)**9)**9)", "9⁻⁹⁹⁹⁹", "(2**9)**9*(2**9)**9")
    for text in (*(f"1 N*m*{power}" for power in powers), "1 kg*m**2 +/- 0 kg*m**2"):
        begun = time.monotonic()
        with pytest.raises(InputError, match="is not known"):
            to_si(text, "N*m")
        assert time.monotonic() - begun < 5, text
    assert to_si("2 kg·m²", "kg*m**2") == 2.0


def test_a_glob_follows_no_links_in_circles(here: Path) -> None:
    """Two links that lead back up do not hold a glob up; it finds files below real folders, not hidden ones, by absolute paths too."""
    (here / "logs" / "a" / ".hidden").mkdir(parents=True)
    for place in ("a", "a/.hidden"):
        (here / "logs" / place / "points.csv").write_bytes((here / "points.csv").read_bytes())
    for name in ("l1", "l2"):
        (here / "logs" / "a" / name).symlink_to("..")
    for pattern in ("logs/**/*.csv", f"{here}/logs/**/*.csv"):
        (here / "e.yaml").write_text(POINTS.replace("points.csv", pattern), encoding="utf-8")
        ran = run("inspect", "e.yaml")
        assert ran.code == 0, ran.err
        assert ran.out.count("24 rows") == 1


def test_options_that_are_taken_warn_of_nothing(here: Path) -> None:
    """A fine grid, and a value far off, are fitted without a word of NumPy's: warnings are errors here."""
    for options in ("fit: {grid: 1000}", "fit: {fixed: {alpha_1: 1e20 N*m}}"):
        (here / "m.yaml").write_text(f"{MOVING}{options}\n", encoding="utf-8")
        assert run("identify", "m.yaml").code == 0


@pytest.mark.parametrize("last", [0.0, 1e-190, 1.0])
def test_a_torque_of_next_to_nothing_warns_of_nothing(here: Path, last: float) -> None:
    """A moving run whose torque is zero, or nearly, throughout or but for one row, ends with a result or a sentence; warnings are errors here."""
    tau = np.append(np.zeros(logs()["tracking"]["tau"].size - 1), last)
    pd.DataFrame({**logs()["tracking"], "tau": tau}).to_csv(here / "tracking.csv", index=False)
    for text in (MOVING, MOVING.replace("  velocity: {column: v, unit: rad/s}\n", "")):
        (here / "m.yaml").write_text(text, encoding="utf-8")
        assert run("identify", "m.yaml").code in (0, 2)


def test_points_without_torque_or_motion_warn_of_nothing(here: Path) -> None:
    """Points of no torque, and one whose speed is rounding, are read and fitted, or refused in a sentence; no warning, no traceback."""
    for torque in (0.0, 1e-18):
        frame = pd.DataFrame(logs()["points"])
        frame["tau"] = torque * np.sign(frame["v"])
        frame.loc[3, "v"] = 5e-324
        frame.to_csv(here / "points.csv", index=False)
        for command in (("identify", "e.yaml"), ("sensitivity", "e.yaml", "--samples", "0", "-o", "out")):
            assert run(*command).code in {0, 2}
        assert "1 point" not in run("inspect", "e.yaml").err
