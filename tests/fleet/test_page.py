import csv
import io
import math
import re
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import bristle
from bristle.page import output_folder
from bristle.page.page import Drawing, drawn
from bristle.page.report import Report
from bristle.questions.fleet import figures, tables
from bristle.questions.fleet import report as reports
from bristle.questions.fleet.findings import Findings, findings, headline
from bristle.questions.fleet.report import report
from bristle.questions.fleet.tables import change, day, estimate, probability, totals
from simulated_fleet import FleetDesign, fleet_estimates, fleet_truth

from ..pages import Elements, assert_tables_are_named, page_text
from .plausible import HOSTILE, empty, plausible


@pytest.fixture(scope="module")
def found() -> Findings:
    return plausible(units=8, failed=45)


@pytest.fixture(scope="module")
def folder(found: Findings, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return report(found).write(tmp_path_factory.mktemp("fleet") / "page").parent


def table_rows(page: str, title: str) -> list[list[str]]:
    (body,) = re.findall(rf"<caption>{re.escape(title)}.*?<tbody>(.*?)</tbody>", page, re.DOTALL)
    return [re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row, re.DOTALL) for row in body.split("</tr>")[:-1]]


def test_hostile_names_and_quality_on_pages(folder: Path, tmp_path: Path, found: Findings) -> None:
    """A name that ends a script and loads an image begins no tag, and stands in tables, headings and figures as it is."""
    for name in ("index", "units", "quality"):
        page = page_text(folder / f"{name}.html")
        shown = Elements(page)
        assert not shown.tags & {"img", "b"}
        assert shown.runs == set()
        assert "&lt;/script&gt;&lt;img src=x" in page
    rows = table_rows(page_text(folder / "index.html"), "Joints, by rank")
    assert [row[1] for row in rows if "&lt;img" in row[1]]
    assert next(row[2] for row in rows if "Zelle" in row[2]).endswith("手首")
    # written again every file is the same
    again = report(plausible(units=8, failed=45)).write(tmp_path / "page").parent
    files = [{x.relative_to(top): x.read_bytes() for x in top.rglob("*") if x.is_file()} for top in (folder, again)]
    assert files[0] == files[1]
    # the figure has cautions, critical warnings and failures, no notes; the table has all, with their entries
    with (folder / "figures" / "quality.csv").open(encoding="utf-8") as file:
        assert {line["series"] for line in csv.DictReader(file)} == {"clipped", "torque-drifts", "failed"}
    page = page_text(folder / "quality.html")
    assert {"too-short", "failed"} <= {re.sub("<.*?>", "", row[0]) for row in table_rows(page, "Warnings, the most")}
    for code in ("clipped", "torque-drifts"):
        assert f'href="#warning-{code}"' in page
        assert f'<dt id="warning-{code}">' in page
    # headline, SIMULATED, notes with their codes' entries, the ranked joints, and of the first what to think of new warnings
    page = page_text(folder / "index.html")
    assert "<strong>SIMULATED data.</strong>" in page
    assert "of 16 joints changed, at a false discovery rate of 5 %" in page
    for code in ("warned-since", "clipped", "torque-drifts"):
        assert f'<dt id="warning-{code}">' in page
    assert '<a class="code" href="#warning-warned-since">' in page
    rows = table_rows(page, "Joints, by rank")
    assert [row[0] for row in rows] == [str(k) for k in range(1, 17)]
    assert rows[0][3] == "changed"
    assert re.sub("\\s", " ", rows[0][5]) in {"α₀ (+)", "α₀ (−)"}
    assert [row[8].count('href="#warning-') for row in rows if row[8]] == [2]
    assert "They point at the log" in page
    types = table_rows(page_text(folder / "units.html"), "Types, parameters and directions")
    assert types[0][7].startswith(("-1.", "-0.9"))
    failures = table_rows(page_text(folder / "quality.html"), "Sessions without a result")
    assert failures[0][3] == "&lt;i&gt;file 0&lt;/i&gt;: ends in line 812; log it again"
    # each table of the findings is a CSV file of its columns and rows, in which no text is a formula
    assert_tables_are_named(folder)
    frames = report(found).frames
    assert set(frames) == {"joints", "changes", "units", "types", "quality", "warned", "failures"}
    assert {path.stem for path in (folder / "tables").iterdir()} == set(frames)
    for name, frame in frames.items():
        read = list(csv.DictReader(io.StringIO((folder / "tables" / f"{name}.csv").read_text(encoding="utf-8"))))
        assert len(read) == len(frame) == len(getattr(found, name))
        assert list(read[0]) == list(frame.columns)
        assert [row["joint"] for row in read] == list(frame["joint"]) if "joint" in frame else True
    assert read[0]["file"] == "'=cut <off>.csv"
    written = (folder / "tables" / "joints.csv").read_text(encoding="utf-8")
    assert [float(row["percent"]) for row in csv.DictReader(io.StringIO(written))] == list(found.joints["percent"])


def test_a_joint_is_drawn_as_it_was_found(found: Findings, folder: Path) -> None:
    """The first figure has the parameters of the first joint that changed: values, intervals, limits and adjusted ones, and the step."""
    row = found.joints.iloc[0]
    with (folder / "figures" / "joint-1.csv").open(encoding="utf-8") as file:
        lines = list(csv.DictReader(file))
    own = found.changes[(found.changes["unit"] == row["unit"]) & (found.changes["joint"] == row["joint"])]
    own = own[own["changed"]].sort_values("p")
    assert len({line["panel"] for line in lines}) == len(own) == 2
    for k, one in enumerate(own.itertuples(), 1):
        part = found.series.merge(found.changes.loc[[one.Index], ["unit", "joint", "parameter", "direction"]])
        own_lines = [x for x in lines if x["panel"].startswith(f"{k}:") and x["y"]]
        names = ("value", "adjusted", "95 % interval", "before", "after", "limits")
        of = {name: [(x["x"], float(x["y"])) for x in own_lines if x["series"] == name] for name in names}
        times = [f"{x:%Y-%m-%dT%H:%M}" for x in part["session"]]
        assert [x for x, _ in of["value"]] == times
        for name, wanted in (("value", part["value"]), ("adjusted", part["adjusted"])):
            assert [y for _, y in of[name]] == pytest.approx(list(wanted), rel=1e-6)
        ends = [y for pair in zip(part["lower"], part["upper"], strict=True) for y in pair]
        assert [y for _, y in of["95 % interval"]] == pytest.approx(ends, rel=1e-6)
        assert [y for _, y in of["before"]] == pytest.approx([one.before] * 2, rel=1e-6)
        assert [y for _, y in of["after"]] == pytest.approx([one.after] * 2, rel=1e-6)
        assert [x for x, _ in of["after"]] == [times[4], times[-1]]
        assert min(y for _, y in of["limits"]) == pytest.approx(part["limit_low"].min(), rel=1e-6)
    (step,) = {x["x"] for x in lines if x["series"] == "step"}
    assert times[3] < step < times[4]
    panels = {line["panel"].partition(" vs ")[0][3:] for line in lines}
    assert panels == {f"Coulomb friction α₀ ({d}) (N·m)" for d in "+−"}
    page = page_text(folder / "index.html")
    verdicts = [row[-1] for row in table_rows(page[: page.index("figure-joint-2")], "All parameters of")]
    assert verdicts == ["yes", "yes", "no", "no"]
    # no value, an open interval, no test or no number: each has a figure, and no axis is infinite
    rows = found.series.iloc[:8].copy()
    rows.loc[rows.index[3], ["value", "lower", "upper", "adjusted"]] = np.nan
    rows.loc[rows.index[4], "upper"] = np.inf
    gone = rows.assign(**dict.fromkeys(("value", "lower", "upper", "adjusted", "limit_low", "limit_high"), np.nan))
    several = {"some": rows, "gone": gone, "one": rows.iloc[:1]}
    courses = [figures.Course(name, part, None) for name, part in several.items()]
    figure = figures.joint_figure("joint", rows["session"].iloc[0], courses, simulated=False)
    low, high = figure.axes[0].get_ylim()
    assert low < rows["value"].min() < rows["value"].max() < high < 2 * rows["value"].max()
    assert all(np.isfinite(ax.get_ylim()).all() for ax in figure.axes)


def test_tables_and_figures_have_caps(found: Findings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each joint has the file of its latest session."""
    rows = table_rows(report(found).html(), "Joints, by rank")
    (said,) = [row[-1] for row in rows if row[1] == "robot-006" and "Zelle" in row[2]]
    assert said == "logs/0010 ü.yaml"
    # beyond the caps tables and figures hold the first ranks, the page says so, and the CSV files are whole
    monkeypatch.setattr(tables, "MOST", 12)
    monkeypatch.setattr(reports, "_DRAWN", 2)
    report(found).write(tmp_path / "out")
    pages = {name: page_text(tmp_path / "out" / f"{name}.html") for name in ("index", "units", "quality")}
    for name, title, count, of in (
        ("index", "Joints, by rank", 16, "joints"),
        ("units", "Values of units", 64, "units"),
        ("quality", "Sessions without a result", 45, "failures"),
    ):
        assert f"This page has the first 12 of {count} rows; tables/{of}.csv has all." in pages[name]
        assert len(table_rows(pages[name], title)) == 12
        assert (tmp_path / "out" / "tables" / f"{of}.csv").read_bytes().count(b"\n") == count + 1
    assert "Figures show the first 2 of the 4 joints that changed" in pages["index"]
    assert pages["index"].count("<figure") == 2


def test_pages_of_nothing_and_of_a_large_fleet(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a joint, a value or a warning there is a page that says so; it is written anew in its folder, but not over what is not bristle's."""
    output_folder.claim(tmp_path, output_folder.FLEET)
    for name, text in (("results/part-0.parquet", "data"), ("tables/joints.csv", "mine")):
        (tmp_path / name).parent.mkdir()
        (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(bristle.InputError, match=r"tables/joints\.csv: is there already, and bristle did not make it"):
        report(empty()).write(tmp_path)
    (tmp_path / "tables" / "joints.csv").unlink()
    for _ in range(2):
        report(empty()).write(tmp_path)
    assert report(empty()).text() == "No joint was tested for a change; the notes say why."
    assert (tmp_path / "results" / "part-0.parquet").read_bytes() == b"data"
    assert "No joint was tested for a change" in page_text(tmp_path / "index.html")
    page = page_text(tmp_path / "quality.html")
    assert "No session has a warning." in page
    assert "None: every session was identified and used." in page
    # what `findings` gives of estimates is what the page takes: every joint and type, and figures though no joint changed
    design = FleetDesign(robots=12, joints=2, sessions=5, worn=0.0, swing=10.0)
    rng = np.random.default_rng(3)
    found = findings(fleet_estimates(design, fleet_truth(design, rng), rng))
    made = report(found)
    page = made.html()
    assert found.changed == 0
    assert len(table_rows(page, "Joints, by rank")) == 24
    assert "No change is named; the most likely step is" in page
    assert page.count("<figure") == reports._LEAST_DRAWN
    (types,) = [x.table for x in made.pages[0].sections if x.title == "Types"]
    assert types is not None
    assert len(types.cells.rows) == len(found.types) == 16
    # 1200 joints, 8 parameters and directions, 40 sessions; a figure of 4 parameters in 10 000 sessions
    monkeypatch.setattr(reports, "_DRAWN", 1)
    large = report(plausible(200, 6, 40, ("alpha_0", "alpha_1", "alpha_2", "v_s"), failed=3000))
    assert len(large.html()) <= 1.5e6
    for page in large.pages:
        assert len(Report(large.title, page.sections, about="").html()) <= 1.5e6
    long = plausible(2, 1, 10_000, ("alpha_0",))
    rows = long.series[(long.series["unit"] == HOSTILE) & (long.series["direction"] == "+")]
    course = figures.Course("alpha", rows, None)
    files = dict[str, bytes]()
    draw = partial(figures.joint_figure, "joint", rows["session"].iloc[0], 4 * [course], simulated=True)
    drawn([Drawing(draw, "figure", "a joint")], files, lambda _: None)
    assert len(files["figures/figure.svg"]) <= 5e5


def text(found: Findings) -> str:
    return report(found).text()


def test_the_text_of_a_fleet() -> None:
    """Headline, changed joints, values outside, data quality, failures and notes, in this order, each with its numbers."""
    found = plausible(units=3, joints=2, sessions=6)
    joints = found.joints.copy()
    joints[["unit", "joint"]] = [[f"r{k}", "J1"] for k in range(6)]
    units = found.units[found.units["unit"] != HOSTILE].assign(joint="J1", type="T1")
    failures = found.failures.assign(unit="r0", joint="J1")
    first = headline(joints.assign(percent=15.0), 0.05)
    warned = found.warned.assign(unit="r0", joint="J1")
    told = replace(found, joints=joints, headline=first, units=units, failures=failures, warned=warned)
    lines = text(told).splitlines()
    assert lines[:2] == [
        "2 of 6 joints changed, at a false discovery rate of 5 %; the clearest: r0 J1, alpha_0- by +15 % since 2026-04-27; "
        "1 other changed as well.",
        "SIMULATED data.",
    ]
    assert lines[2] == "Joints that changed (2), with 95 % interval and adjusted p:"
    row = found.joints.iloc[0]
    size = change(row["percent"], row["percent_lower"], row["percent_upper"])
    named = f"  r0 J1  alpha_0{row['direction']}  {size} %"
    assert lines[3] == f"{named}  since 2026-04-27  p {probability(row['adjusted_p'])}"
    assert [line for line in lines if line.startswith("      new")] == ["      new warnings: clipped torque-drifts"]
    (at,) = [k for k, line in enumerate(lines) if line.startswith("Values outside their type (2)")]
    assert all("N*m" in line and "% from type" in line and "+/-" in line for line in lines[at + 1 : at + 3])
    assert lines[at + 3].startswith("Data quality, percent of 30 joint-sessions: ")
    assert "too-short" not in lines[at + 3]
    assert lines[at + 4] == "Warnings that began and stayed (1):"
    assert lines[at + 5].endswith("clipped  since 2026-01-05  in 2 of 3 sessions")
    assert lines[at + 6] == (
        "3 sessions failed or left out; the first: r0 J1 of 2026-01-05: <i>file 0</i>: ends in line 812; log it again"
    )
    assert lines[at + 7].endswith("a failing sensor is not wear. [warned-since]")
    assert lines[at + 8 :] == ["What a code in brackets means: bristle explain CODE"]
    # of many joints 20 are listed, of many values outside 10, and the counts are those of all
    lines = text(plausible(units=60, joints=9)).splitlines()
    assert "Joints that changed (108, the first 20), with 95 % interval and adjusted p:" in lines
    assert "Values outside their type (154, the first 10), with adjusted p:" in lines
    assert sum(" since 2026-" in line for line in lines[2:]) == 20 + 1  # and where a warning began
    # whatever a unit is called, a line has no control character, and the name takes 24 columns at most
    found = plausible(units=1, joints=1)
    joints = found.joints.assign(unit="a\x1b[31m\n" + 50 * "b", joint="J\t1")
    lines = text(replace(found, joints=joints)).splitlines()
    assert all(line.isprintable() for line in lines)
    assert not any(26 * "b" in line for line in lines[2:])
    # a change is rounded as its interval, to the second digit of a quarter of its width; an open interval is left out
    cases = (
        ((15.234, 12.1, 18.3), "+15.2 [12.1, 18.3]"), ((-0.4, -2.2, 1.4), "-0.40 [-2.20, 1.40]"),
        ((250.3, 100.0, 400.0), "+250 [100, 400]"), ((12.0, -math.inf, math.inf), "+12"), ((math.nan, 0.0, 1.0), "–"),
    )  # fmt: skip  # a list of values
    assert [change(*given) for given, _ in cases] == [wanted for _, wanted in cases]
    assert [estimate(*given) for given, _ in cases] == [wanted.removeprefix("+") for _, wanted in cases]
    # two digits; below 1e-30 no more than that; a dash where there is none
    assert [probability(p) for p in (0.04321, 1e-40, math.nan, 1.0)] == ["0.043", "< 1e-30", "–", "1"]
    assert (day(pd.Timestamp("2026-05-04 23:59")), day(pd.NaT)) == ("2026-05-04", "–")
    # a code's percent is of the joint-sessions of all periods, also of those in which it does not occur
    quality = pd.DataFrame(
        {
            "period": pd.to_datetime(["2026-01-01", "2026-01-01", "2026-02-01"]), "code": ["gaps", "clipped", "clipped"],
            "severity": "caution", "joint_sessions": [3, 1, 4], "of": [10, 10, 30], "percent": [30.0, 10.0, 13.3],
        }
    )  # fmt: skip  # a table
    whole = totals(quality)
    assert list(whole["code"]) == ["clipped", "gaps"]
    assert np.allclose(whole["percent"], [12.5, 7.5])
