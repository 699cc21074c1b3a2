import json
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from bristle.arrays import Array
from bristle.data.experiment.schema import FitOptions
from bristle.findings import CAUTION, NOTE, Finding
from bristle.identification.curve import curve
from bristle.identification.fits import RunScatter, StaticFit
from bristle.identification.results import Joint
from bristle.identification.static.fit import PointInfo, fit_static
from bristle.identification.static.problem import from_points
from bristle.model.parameters import Kind
from bristle.page.wording import MISSING
from bristle.questions.joint_report import interval_sections, results_file, tables
from bristle.questions.joint_report.next_measurements import next_measurements
from bristle.questions.joint_report.report import report
from bristle.questions.joint_report.text import fit_report

from ..pages import report_text
from ..sameness import of_kind
from .conftest import TABLE_1, loaded, nothing_seen, only, sections_of, write_report
from .moving import moving as all_stages
from .moving import tracked

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


CONVERGED = Finding("static-converged", NOTE, "Converged.")
NO_PEAK = Finding("static-no-stribeck", CAUTION, "Stribeck term not identifiable from these data.")


def with_warnings(joint: Joint, v_s: dict[str, Any], **changes: Any) -> Joint:
    """Direction + alone, without stick-slip, with changes to its estimate of v_s and to its fit."""
    fit = joint.static["+"]
    parameters = {**fit.parameters, "v_s": replace(fit.parameters["v_s"], **v_s)}
    return replace(joint, static={"+": replace(fit, parameters=parameters, **changes)}, segments=())


def ranges(joint: Joint) -> list[tuple[float, float]]:
    return [(x.numbers["low"], x.numbers["high"]) for x in next_measurements(joint) if "low" in x.numbers]


def moving(joint: Joint, **changes: Any) -> Joint:
    """As if the static fit of + rested on moving data, which pass through zero."""
    v = np.concatenate([[1.2e-24, 3e-9, 1e-5], joint.static["+"].velocity])
    return with_warnings(
        joint, {"value": 0.01, "standard_error": 0.01, "interval": (0.0, np.inf)}, velocity=v, **changes
    )


def test_advice_follows_from_the_warnings(joint: Joint) -> None:
    """An open interval asks for slower speeds in a concrete range; stick-slip names the run; one direction asks for the other."""
    one = replace(with_warnings(joint, {"interval": (0.0, 0.1)}, hold_out=()), segments=joint.segments)
    below, *others = next_measurements(one)
    assert (below.code, below.subject) == ("unlimited-below", ("static", "+"))
    assert [(x.code, dict(x.numbers)) for x in others] == [
        ("repeat-sticking", {"files": ("run_1.csv",)}),
        ("measure-direction", {"direction": "-"}),
        ("hold-back", {}),
    ]
    none = replace(joint, static={"both": replace(joint.static["+"], outcome=NO_PEAK)}, segments=())
    (said,) = next_measurements(none)
    assert (said.code, said.subject) == ("rises-below", ("static", "both"))
    assert str(said).endswith("five constant speeds from 0.008 to 0.015 rad/s.")
    # without a warning there is no advice about speeds
    assert ranges(replace(joint, segments=())) == []
    # nobody is asked to hold back a run where a moving run was held back, or of slow loading alone
    whole = all_stages()
    static = {d: replace(fit, hold_out=()) for d, fit in whole.static.items()}
    assert not of_kind(next_measurements(replace(whole, static=static)), "hold-back")
    nothing: dict[str, Any] = {"static": {}, "crosscheck": {}, "segments": ()}
    for slow in (loaded(), only(loaded(), fits={"+": nothing_seen()})):
        assert not of_kind(next_measurements(replace(slow, **nothing)), "hold-back")
    bare = replace(whole, static=static, tracking=tracked(hold_out=()), joint_fit=None)
    assert of_kind(next_measurements(bare), "hold-back")
    # moving data pass through zero, but no advice asks for speeds near it; a range has room for five speeds
    for outcome in (CONVERGED, NO_PEAK):
        own = moving(joint, outcome=outcome)
        fastest = float(own.static["+"].velocity.max())
        found = ranges(own)
        assert found
        for low, high in found:
            assert low >= fastest / 100
            assert high >= 1.4 * low
        said = of_kind(next_measurements(own), "rise-not-shown")
        assert bool(said) == (outcome is NO_PEAK)
    # every speed that is proposed is faster than each at which a run of its own direction sticks and slips
    for sticking in (0.0152, 0.0499, 0.101):
        kept = joint.segments[0]
        stuck = replace(kept, velocity=sticking, stick_slip=True)
        other = replace(kept, velocity=-0.7, stick_slip=True)
        for own in (with_warnings(joint, {"interval": (0.0, 0.1)}), moving(joint), moving(joint, outcome=NO_PEAK)):
            found = ranges(replace(own, segments=(stuck, other)))
            assert found
            assert min(low for low, _ in found) > sticking
            assert min(low for low, _ in found) < 0.7
