import json
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from bristle.questions.joint_report.text import fit_report

from bristle.arrays import Array
from bristle.data.experiment.schema import FitOptions
from bristle.findings import NOTE, Finding
from bristle.identification.curve import curve
from bristle.identification.fits import RunScatter, StaticFit
from bristle.identification.results import Joint
from bristle.identification.static.fit import PointInfo, fit_static
from bristle.identification.static.problem import from_points
from bristle.model.parameters import Kind
from bristle.page.wording import MISSING
from bristle.questions.joint_report import interval_sections, results_file, tables
from bristle.questions.joint_report.report import report

from ..pages import report_text
from .conftest import TABLE_1, sections_of, write_report

UNITS = {"revolute": ("N*m", "N*m", "N*m*s/rad", "rad/s"), "prismatic": ("N", "N", "N*s/m", "m/s")}


def fits(
    velocity: Array, noise: float, kind: Kind = "revolute", seed: int = 1, options: FitOptions | None = None
) -> Mapping[str, StaticFit]:
    torque = curve(velocity, TABLE_1["+"].stribeck) + noise * np.random.default_rng(seed).standard_normal(velocity.size)
    directions = ("+",) if velocity.min() > 0 else ("+", "-")
    return fit_static(from_points(velocity, torque, directions), options or FitOptions(), kind, PointInfo())[0]


def built(static: Mapping[str, StaticFit], kind: Kind = "revolute", name: str = "wrist") -> Joint:
    return Joint(name=name, kind=kind, inputs=(), segments=(), static=static, crosscheck={}, simulated=True)


SPEEDS = np.geomspace(0.0108, 0.8, 16)


@pytest.fixture(scope="module")
def good() -> Joint:
    """16 log speeds, little noise."""
    return built(fits(SPEEDS, 1e-4))


@pytest.fixture(scope="module")
def open_() -> Joint:
    """Speeds from v_s up, and the term asked for by hand: v_s has no lower end, alpha_1 no upper one."""
    joint = built(fits(np.geomspace(0.075, 0.8, 16), 4e-4, seed=5, options=FitOptions(set_up="as-written")))
    assert (joint.static["+"].uncertainty["v_s"].profile or (1,))[0] == 0
    return joint


def test_intervals_in_tables_and_figures(good: Joint, open_: Joint, slide: Joint) -> None:
    """Each estimate's interval is its profile's, so that page, table and results.json give one interval only."""
    for joint in (good, open_):
        fit = joint.static["+"]
        assert set(fit.uncertainty) == {"alpha_0", "alpha_1", "alpha_2", "v_s"}
        for name, own in fit.uncertainty.items():
            assert fit.parameters[name].interval == own.profile
            assert set(own.warnings) <= set(fit.parameters[name].warnings)
    # open ends reach the frame's edge; every axis is finite and holds its estimate
    for draw in interval_sections.figures(open_).values():
        for ax, (name, own) in zip(
            (ax for ax in draw().axes if ax.has_data()), open_.static["+"].uncertainty.items(), strict=True
        ):
            low, high = ax.get_xlim()
            assert np.isfinite([low, high]).all()
            assert low <= (open_.static["+"].parameters[name].value or 0.0) <= high
            (bar,) = (line for line in ax.lines if line.get_label() == "profile")
            assert np.asarray(bar.get_xdata(), dtype=float) == pytest.approx(np.clip(own.profile or (), low, high))
    # a joint without fits, and no joint at all: the columns and no row, and no figure
    for joints in ([], [slide]):
        frame = tables.uncertainty(joints)
        assert frame.empty
        assert list(frame.columns)[:4] == ["joint", "fit", "direction", "parameter"]
    assert interval_sections.figures(slide) == {}
    assert all(x.file != "uncertainty.html" for x in report([slide], title="t", seed=0).pages)
    # one figure per fit and direction; each panel: unit on its axis, three bars at the very ends, threshold at one, the estimate dashed
    joint = built({"+": good.static["+"], "-": replace(good.static["+"], direction="-")})
    drawn = interval_sections.figures(joint)
    assert set(drawn) == {"static-positive", "static-negative"}
    axes = [ax for ax in drawn["static-positive"]().axes if ax.has_data()]
    assert len(axes) == 4
    for ax, (name, own) in zip(axes, good.static["+"].uncertainty.items(), strict=True):
        assert re.search(r"\([^()]+\)$", ax.get_xlabel())
        lines = {str(line.get_label()): np.asarray(line.get_xdata(), dtype=float) for line in ax.lines}
        for way in tables.WAYS:
            assert lines[way] == pytest.approx(getattr(own, way))
        assert lines["cost (1: threshold)"] == pytest.approx(own.curve[0])
        value = good.static["+"].parameters[name].value
        assert any(line.get_xdata()[0] == value for line in ax.lines if len(line.get_xdata()) == 2)  # type: ignore[arg-type,index]
        low, high = ax.get_xlim()
        assert all(low <= end <= high for way in tables.WAYS for end in getattr(own, way))


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_the_table_has_a_row_per_parameter_with_units_and_all_ends(kind: Kind) -> None:
    """Fit, direction, parameter, value, unit, six ends as numbers: those of the fit."""
    joint = built(fits(SPEEDS, 1e-4, kind), kind)
    frame = tables.uncertainty([joint, replace(joint, name="other")])
    assert list(frame["joint"].unique()) == ["wrist", "other"]
    own = frame[frame["joint"] == "wrist"].set_index("parameter")
    order = ("alpha_0", "alpha_1", "alpha_2", "v_s")
    assert tuple(own.loc[list(order), "unit"]) == UNITS[kind]
    for name in order:
        three = joint.static["+"].uncertainty[name]
        for way in tables.WAYS:
            assert (own.loc[name, f"{way}_lower"], own.loc[name, f"{way}_upper"]) == getattr(three, way)
        assert own.loc[name, "value"] == joint.static["+"].parameters[name].value
    assert all(frame[c].dtype == float for c in frame.columns if c.endswith(("lower", "upper")))


def test_open_ends_and_missing_ways_are_words_in_the_page(open_: Joint, tmp_path: Path, good: Joint) -> None:
    """An open end is written as infinity, a way that there is not as a dash; nowhere in page, CSV or JSON stands nan or None."""
    none = Finding("no-bootstrap", NOTE, "No bootstrap: <b>few</b> blocks are too few to resample.")
    fit = open_.static["+"]
    own = replace(fit.uncertainty["alpha_0"], bootstrap=None, warnings=(none,))
    joint = replace(open_, static={"+": replace(fit, uncertainty={**fit.uncertainty, "alpha_0": own})})
    table = sections_of(joint, "uncertainty.html")["Static"].table
    assert table is not None
    cells = {cell for row in table.cells.rows for cell in row}
    assert MISSING in cells
    assert any(str(cell).endswith("∞]") for cell in cells)
    write_report([joint], tmp_path)
    html = (tmp_path / "uncertainty.html").read_text(encoding="utf-8")
    part = html[html.index('<section id="wrist--joint">') : html.index('<section id="versions">')]
    text = re.sub(r"<svg.*?</svg>|<img[^>]*>", "", part, flags=re.DOTALL)
    assert not re.search(r"\bnan\b|\bNone\b|\bNaN\b", text)
    assert "∞" in text
    assert "&lt;b&gt;few" in text
    assert "<b>few" not in text
    assert "SIMULATED" in text
    (file,) = tmp_path.rglob("uncertainty.csv")
    read = pd.read_csv(file).set_index("parameter")
    assert read["profile_upper"]["alpha_1"] == np.inf
    assert read["bootstrap_lower"].isna().to_dict() == dict.fromkeys(read.index, False) | {"alpha_0": True}
    assert "nan" not in file.read_text(encoding="utf-8").lower()
    assert "NaN" not in results_file.to_json([joint])
    # before and after widening with each run's estimate; without repeats there is no word of it
    assert tables.repeats([good]).empty
    assert "fitted apart" not in fit_report([good])
    by_run = {"one.csv": 0.0190, "two.csv": 0.0200}
    x = RunScatter(before=2.34, after=1.0, widened=2.34, stretched=10.0, by_run=by_run)
    fit = replace(good.static["+"], repeats={"alpha_0": x})
    joint = replace(good, static={"+": fit})
    assert "alpha_0:     2.34 -> 1.00, 2 runs: 0.019, 0.02" in fit_report([joint])
    frame = tables.repeats([joint])
    assert list(frame["file"]) == list(by_run)
    assert frame[["value", "before", "after", "widened"]].iloc[0].tolist() == [0.0190, 2.34, 1.0, 2.34]
    write_report([joint], tmp_path / "out")
    text = report_text(tmp_path / "out")
    assert "Each run fitted apart" in text
    assert "2.34" in text
    (document,) = json.loads(results_file.to_json([joint]))["joints"].values()
    assert document["static"]["+"]["repeats"]["alpha_0"]["by_run"] == by_run
