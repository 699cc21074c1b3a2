import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from bristle.arrays import Array
from bristle.data.experiment.schema import FitOptions
from bristle.findings import NOTE, Finding
from bristle.identification.curve import curve
from bristle.identification.fits import RunScatter
from bristle.identification.results import Joint
from bristle.identification.static.fit import PointInfo, fit_static
from bristle.identification.static.problem import from_points
from bristle.page.wording import MISSING
from bristle.questions.joint_report import interval_sections, results_file, tables
from bristle.questions.joint_report.report import report

from ..conftest import present
from ..pages import page_text
from .conftest import TABLE_1, sections_of, write_report


def built(velocity: Array, noise: float, seed: int = 1, options: FitOptions | None = None) -> Joint:
    """A joint of one direction with simulated points."""
    torque = curve(velocity, TABLE_1["+"].stribeck) + noise * np.random.default_rng(seed).standard_normal(velocity.size)
    fits = fit_static(from_points(velocity, torque, ("+",)), options or FitOptions(), "revolute", PointInfo())[0]
    return Joint(name="wrist", kind="revolute", inputs=(), segments=(), static=fits, crosscheck={}, simulated=True)


SPEEDS = np.geomspace(0.0108, 0.8, 16)


@pytest.fixture(scope="module")
def good() -> Joint:
    """16 log speeds, little noise."""
    return built(SPEEDS, 1e-4)


@pytest.fixture(scope="module")
def open_() -> Joint:
    """Speeds from v_s up, and the term asked for by hand: v_s has no lower end, alpha_1 no upper one."""
    joint = built(np.geomspace(0.075, 0.8, 16), 4e-4, seed=5, options=FitOptions(set_up="as-written"))
    assert (joint.static["+"].uncertainty["v_s"].profile or (1,))[0] == 0
    return joint


def test_intervals_in_tables_and_figures(good: Joint, open_: Joint, slide: Joint) -> None:
    """Each estimate's interval is its profile's, so that page, table and results.json give one interval only."""
    # each panel: unit on its axis, three bars at the very ends, open ones at the frame's edge, the cost, the estimate dashed; all is finite
    for joint in (good, open_):
        fit = joint.static["+"]
        assert set(fit.uncertainty) == {"alpha_0", "alpha_1", "alpha_2", "v_s"}
        (draw,) = interval_sections.figures(joint).values()
        for ax, (name, e) in zip((ax for ax in draw().axes if ax.has_data()), fit.parameters.items(), strict=True):
            own, (low, high) = fit.uncertainty[name], ax.get_xlim()
            assert e.interval == own.profile
            assert set(own.warnings) <= set(e.warnings)
            assert np.isfinite([low, high]).all()
            assert re.search(r"\([^()]+\)$", ax.get_xlabel())
            lines = {str(line.get_label()): np.asarray(line.get_xdata(), dtype=float) for line in ax.lines}
            for way in tables.WAYS:
                assert way not in lines or lines[way] == pytest.approx(np.clip(getattr(own, way), low, high))
            assert {"covariance", "profile"} <= lines.keys()
            assert lines["cost (1: threshold)"] == pytest.approx(np.sort(own.curve[0]), nan_ok=True)
            assert lines["_estimate"].tolist() == [e.value, e.value]
            assert low <= (e.value or 0.0) <= high
            assert joint is open_ or all(low <= end <= high for way in tables.WAYS for end in getattr(own, way))
    # one figure per fit and direction; a joint without fits has none, and no page
    joint = replace(good, static={"+": good.static["+"], "-": replace(good.static["+"], direction="-")})
    assert set(interval_sections.figures(joint)) == {"static-positive", "static-negative"}
    assert interval_sections.figures(slide) == {}
    assert all(x.file != "uncertainty.html" for x in report([slide], title="t", seed=0).pages)


def test_open_ends_and_missing_ways_are_words_in_the_page(open_: Joint, tmp_path: Path, good: Joint) -> None:
    """An open end is written as infinity, a way that there is not as a dash; nowhere in page, CSV or JSON stands nan or None."""
    none = Finding("no-bootstrap", NOTE, "No bootstrap: <b>few</b> blocks are too few to resample.")
    fit = open_.static["+"]
    own = replace(fit.uncertainty["alpha_0"], bootstrap=None, warnings=(none,))
    joint = replace(open_, static={"+": replace(fit, uncertainty={**fit.uncertainty, "alpha_0": own})})
    table = present(sections_of(joint, "uncertainty.html")["Static"].table)
    cells = {cell for row in table.cells.rows for cell in row}
    assert MISSING in cells
    assert any(str(cell).endswith("∞]") for cell in cells)
    write_report([joint], tmp_path)
    text = re.sub(r"<svg.*?</svg>", "", page_text(tmp_path / "uncertainty.html"), flags=re.DOTALL)
    assert not re.search(r"\bnan\b|\bNone\b|\bNaN\b|<b>few", text)
    assert "&lt;b&gt;few" in text
    (file,) = tmp_path.rglob("uncertainty.csv")
    read = pd.read_csv(file).set_index("parameter")
    assert read["profile_upper"]["alpha_1"] == np.inf
    assert read["bootstrap_lower"].isna().to_dict() == dict.fromkeys(read.index, False) | {"alpha_0": True}
    assert "nan" not in file.read_text(encoding="utf-8").lower()
    assert "NaN" not in results_file.to_json([joint])
    # before and after widening with each run's estimate
    assert tables.repeats([good]).empty
    by_run = {"one.csv": 0.0190, "two.csv": 0.0200}
    x = RunScatter(before=2.34, widened=2.34, stretched=10.0, by_run=by_run)
    joint = replace(good, static={"+": replace(good.static["+"], repeats={"alpha_0": x})})
    frame = tables.repeats([joint])
    assert list(frame["file"]) == list(by_run)
    assert frame[["value", "before", "widened"]].iloc[0].tolist() == [0.0190, 2.34, 2.34]
    table = present(sections_of(joint, "uncertainty.html")["Each run fitted apart"].table)
    assert table.cells.rows == (("static", "alpha_0+", "2.34", "2.34", "0.019, 0.02"),)
