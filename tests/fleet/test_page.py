import csv
import io
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import bristle
from bristle.page import output_folder
from bristle.questions.fleet import figures, tables
from bristle.questions.fleet import report as reports
from bristle.questions.fleet.findings import Findings, headline
from bristle.questions.fleet.report import report
from bristle.questions.fleet.tables import change, day, estimate, probability

from ..pages import Elements, assert_tables_are_named, page_text
from .hostile import hostile_fleet


@pytest.fixture(scope="module")
def found() -> Findings:
    return hostile_fleet()


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
    # written again every file is the same
    again = report(hostile_fleet()).write(tmp_path / "page").parent
    files = [{x.relative_to(top): x.read_bytes() for x in top.rglob("*") if x.is_file()} for top in (folder, again)]
    assert files[0] == files[1]
    # headline, SIMULATED, notes with their codes' entries, the ranked joints, and of the first what to think of new warnings
    page = page_text(folder / "index.html")
    assert "<strong>SIMULATED data.</strong>" in page
    assert f"{found.changed} of 16 joints changed, at a false discovery rate of 5 %" in page
    for code in ("warned-since", "clipped", "torque-drifts"):
        assert f'<dt id="warning-{code}">' in page
    rows = table_rows(page, "Joints, by rank")
    assert [row[0] for row in rows] == [str(k) for k in range(1, 17)]
    assert rows[0][1].startswith("&lt;/script&gt;&lt;img")
    assert rows[0][2].endswith("手首")
    assert rows[0][3].startswith("changed")
    assert re.sub("\\s", " ", rows[0][5]) in {"α₀ (+)", "α₀ (−)"}
    assert [row[8].count('href="#warning-') for row in rows if row[8]] == [2]
    assert [row[-1] for row in rows if row[1] == "robot-006"] == 2 * ["006 ü.yaml"]
    assert "They point at the log" in page
    outside = table_rows(page_text(folder / "units.html"), "Values of units")[0]
    assert [outside[k] for k in (0, 1, 3)] == ["robot-002", "J2", "outside"]
    # the figure has cautions, critical warnings and failures, no notes; the table has all, with their entries
    with (folder / "figures" / "quality.csv").open(encoding="utf-8") as file:
        assert {line["series"] for line in csv.DictReader(file)} == {"clipped", "torque-drifts", "failed"}
    page = page_text(folder / "quality.html")
    codes = {re.sub("<.*?>", "", row[0]): row[2] for row in table_rows(page, "Warnings, the most")}
    assert codes == {"too-short": "124", "clipped": "4", "torque-drifts": "4", "failed": "3"}
    assert '<dt id="warning-clipped">' in page
    failures = table_rows(page, "Sessions without a result")
    assert failures[0][3] == "&lt;i&gt;file 0&lt;/i&gt;: ends in line 812; log it again"
    # each table of the findings is a CSV file of its columns and rows, in which no text is a formula
    assert_tables_are_named(folder)
    frames = report(found).frames
    assert {path.stem for path in (folder / "tables").iterdir()} == set(frames)
    for name, frame in frames.items():
        read = list(csv.DictReader(io.StringIO((folder / "tables" / f"{name}.csv").read_text(encoding="utf-8"))))
        assert len(read) == len(frame) == len(getattr(found, name))
        assert list(read[0]) == list(frame.columns)
        if name == "joints":
            assert [float(row["percent"]) for row in read] == list(found.joints["percent"])
    assert read[0]["file"] == "'=cut <off>.csv"


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
        part = part.sort_values("session")
        own_lines = [x for x in lines if x["panel"].startswith(f"{k}:") and x["y"]]
        names = ("value", "adjusted", "95 % interval", "before", "after", "limits")
        of = {name: [(x["x"], float(x["y"])) for x in own_lines if x["series"] == name] for name in names}
        times = [f"{x:%Y-%m-%dT%H:%M}" for x in part["session"].dt.round("min")]
        assert [x for x, _ in of["value"]] == times
        drawn = {name: [y for _, y in of[name]] for name in names}
        expected = {name: list(part[name]) for name in ("value", "adjusted")}
        expected["95 % interval"] = [y for pair in zip(part["lower"], part["upper"], strict=True) for y in pair]
        expected |= {"before": 2 * [one.before], "after": 2 * [one.after]}
        for name, wanted in expected.items():
            assert drawn[name] == pytest.approx(wanted, rel=1e-6), name
        assert [x for x, _ in of["after"]] == [times[4], times[-1]]
        assert min(drawn["limits"]) == pytest.approx(part["limit_low"].min(), rel=1e-6)
    (step,) = {x["x"] for x in lines if x["series"] == "step"}
    assert times[3] < step < times[4]
    panels = {line["panel"].partition(" vs ")[0][3:] for line in lines}
    assert panels == {f"Coulomb friction α₀ ({d}) (N·m)" for d in "+−"}
    # no value, an open interval, no test or no number: each has a figure, and no axis is infinite
    rows = part.copy()
    rows.loc[rows.index[3], ["value", "lower", "upper", "adjusted"]] = np.nan
    rows.loc[rows.index[4], "upper"] = np.inf
    gone = rows.assign(**dict.fromkeys(("value", "lower", "upper", "adjusted", "limit_low", "limit_high"), np.nan))
    several = {"some": rows, "gone": gone, "one": rows.iloc[:1]}
    courses = [figures.Course(name, part, None) for name, part in several.items()]
    figure = figures.joint_figure("joint", rows["session"].iloc[0], courses, simulated=False)
    low, high = figure.axes[0].get_ylim()
    assert low < rows["value"].min() < rows["value"].max() < high < 2 * rows["value"].max()
    assert all(np.isfinite(ax.get_ylim()).all() for ax in figure.axes)


def test_pages_of_much_and_of_nothing(found: Findings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Beyond the caps tables and figures hold the first ranks, the page says so, and the CSV files are whole."""
    monkeypatch.setattr(tables, "MOST", 12)
    monkeypatch.setattr(reports, "_DRAWN", 2)
    report(found).write(tmp_path / "out")
    for name, title, of, whole in (
        ("index", "Joints, by rank", "joints", found.joints),
        ("units", "Values of units", "units", found.units),
    ):
        page = page_text(tmp_path / "out" / f"{name}.html")
        assert f"This page has the first 12 of {len(whole)} rows; tables/{of}.csv has all." in page
        assert len(table_rows(page, title)) == 12
        assert (tmp_path / "out" / "tables" / f"{of}.csv").read_bytes().count(b"\n") == len(whole) + 1
    page = page_text(tmp_path / "out" / "index.html")
    assert f"Figures show the first 2 of the {found.changed} joints that changed" in page
    assert page.count("<figure") == 2
    # without a joint there is a page that says so; it is written anew in its folder, but not over what is not bristle's
    frames = {name: getattr(found, name).iloc[:0] for name in (*report(found).frames, "series")}
    nothing = report(replace(found, headline=headline(frames["joints"], 0.05), notes=(), simulated=False, **frames))
    output_folder.claim(tmp_path / "none", output_folder.FLEET)
    for name, text in (("results/part-0.parquet", "data"), ("tables/joints.csv", "mine")):
        (tmp_path / "none" / name).parent.mkdir()
        (tmp_path / "none" / name).write_text(text, encoding="utf-8")
    with pytest.raises(bristle.InputError, match=r"tables/joints\.csv: is there already, and bristle did not make it"):
        nothing.write(tmp_path / "none")
    (tmp_path / "none" / "tables" / "joints.csv").unlink()
    for _ in range(2):
        nothing.write(tmp_path / "none")
    assert nothing.text() == "No joint was tested for a change; the notes say why."
    assert (tmp_path / "none" / "results" / "part-0.parquet").read_bytes() == b"data"
    page = page_text(tmp_path / "none" / "quality.html")
    assert "No session has a warning." in page
    assert "None: every session was identified." in page


def test_the_text_of_a_fleet(found: Findings) -> None:
    """Headline, changed joints, values outside, data quality, warnings that began and notes, in this order, each with its numbers."""
    lines = report(found).text().splitlines()
    assert lines[:2] == [str(found.headline), "SIMULATED data."]
    assert lines[2] == f"Joints that changed ({found.changed}), with 95 % interval and adjusted p:"
    row = found.joints.iloc[0]
    size = change(row["percent"], row["percent_lower"], row["percent_upper"])
    named = f"alpha_0{row['direction']} {size} % since 2026-08-09 p {probability(row['adjusted_p'])} new warnings: clipped torque-drifts"
    assert named in " ".join(" ".join(lines).split())
    whole = "\n".join(lines)
    order = ("Values outside their type (", "Data quality, percent of 128 joint-sessions: clipped 3.1 %", "Warnings that began and stayed (2):",
             "a failing sensor is not wear. [warned-since]", "bristle explain CODE")  # fmt: skip  # a row
    places = [whole.index(words) for words in order]
    assert places == sorted(places)
    assert "robot-002 J2" in whole[places[0] : places[1]]
    assert "too-short" not in whole
    # whatever a unit is called, a line has no control character, and the name takes 24 columns at most
    odd = found.joints.assign(unit="a\x1b[31m\n" + 50 * "b", joint="J\t1")
    lines = report(replace(found, joints=odd)).text().splitlines()
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
