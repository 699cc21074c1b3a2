"""The pages of a fleet: what stands on them whatever names say, how large they get, their figures, and the tables beside them."""

import csv
import io
import re
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
from bristle.questions.fleet.findings import Findings, findings
from bristle.questions.fleet.report import report
from simulated_fleet import FleetDesign, fleet_estimates, fleet_truth

from ..pages import Elements, assert_tables_are_named, page_text
from .plausible import EXOTIC, HOSTILE, empty, plausible


@pytest.fixture(scope="module")
def found() -> Findings:
    """A small fleet with hostile names."""
    return plausible(units=8, failed=45)


@pytest.fixture(scope="module")
def folder(found: Findings, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Its pages, with figures and tables."""
    return report(found, "out put").write(tmp_path_factory.mktemp("fleet") / "page").parent


def table_rows(page: str, title: str) -> list[list[str]]:
    """The cells of the table of a title, as HTML."""
    (body,) = re.findall(rf"<caption>{re.escape(title)}.*?<tbody>(.*?)</tbody>", page, re.DOTALL)
    return [re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row, re.DOTALL) for row in body.split("</tr>")[:-1]]


def test_pages_of_a_large_fleet_are_at_most_three_megabytes(monkeypatch: pytest.MonkeyPatch) -> None:
    """1200 joints with 8 parameters and directions, in 40 sessions, with reports' commands; a figure of 4 parameters in 10 000 sessions."""
    monkeypatch.setattr(reports, "_DRAWN", 1)
    large = report(plausible(200, 6, 40, ("alpha_0", "alpha_1", "alpha_2", "v_s"), failed=3000), "reports/plant")
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


def test_a_larger_fleet_says_what_is_left_out(found: Findings, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Beyond the caps tables and figures hold the first ranks, the page says so, and the CSV files are whole."""
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


def test_hostile_names_stay_text(folder: Path) -> None:
    """A name that ends a script and loads an image begins no tag, and stands in tables, headings and figures as it is."""
    for name in ("index", "units", "quality"):
        page = page_text(folder / f"{name}.html")
        read = Elements(page)
        assert not read.tags & {"img", "b"}
        assert read.runs == set()
        assert "&lt;/script&gt;&lt;img src=x" in page
    rows = table_rows(page_text(folder / "index.html"), "Joints, by rank")
    assert [row[1] for row in rows if "&lt;img" in row[1]]
    assert next(row[2] for row in rows if "Zelle" in row[2]).endswith("手首")


def test_equal_findings_give_equal_bytes(folder: Path, tmp_path: Path) -> None:
    """Written again every file is the same."""
    again = report(plausible(units=8, failed=45), "out put").write(tmp_path / "page").parent
    read = [{x.relative_to(top): x.read_bytes() for x in top.rglob("*") if x.is_file()} for top in (folder, again)]
    assert read[0] == read[1]


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


def test_what_is_no_number_or_open_is_drawn_as_far_as_it_is_one(found: Findings) -> None:
    """A session without a value, an open interval, a parameter without a test or a number: each has a figure, and no axis is infinite."""
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


def test_quality_over_time_leaves_notes_out(folder: Path) -> None:
    """The figure has cautions, critical warnings and failed sessions, and no notes; the table has all, with their entries."""
    with (folder / "figures" / "quality.csv").open(encoding="utf-8") as file:
        assert {line["series"] for line in csv.DictReader(file)} == {"clipped", "torque-drifts", "failed"}
    page = page_text(folder / "quality.html")
    assert {"too-short", "failed"} <= {re.sub("<.*?>", "", row[0]) for row in table_rows(page, "Warnings, the most")}
    for code in ("clipped", "torque-drifts"):
        assert f'href="#warning-{code}"' in page
        assert f'<dt id="warning-{code}">' in page


def test_reports_are_commands_until_they_are_there(found: Findings, tmp_path: Path) -> None:
    """Each joint has the command that makes its report in a shell, and a link once the report stands below the page."""
    folders = tables.report_folders(found.joints)
    assert len(set(folders.values())) == len(found.joints)
    slug = folders["robot-006", EXOTIC]
    assert re.fullmatch(r"[a-z0-9-]+-2026-07-20-0800", slug)
    rows = table_rows(report(found, str(tmp_path), "/logs").html(), "Joints, by rank")
    (said,) = [row[-1] for row in rows if row[1] == "robot-006" and "Zelle" in row[2]]
    assert said == f"bristle report &#39;/logs/logs/0010 ü.yaml&#39; -o {tmp_path}/reports/{slug}"
    (tmp_path / "reports" / slug).mkdir(parents=True)
    (tmp_path / "reports" / slug / "index.html").write_text("a report", encoding="utf-8")
    rows = table_rows(report(found, str(tmp_path)).html(), "Joints, by rank")
    links = [row[-1] for row in rows if not row[-1].startswith("bristle report")]
    assert links == [f'<a href="reports/{slug}/index.html">report</a>']


def test_commands_are_safe_in_a_shell() -> None:
    """A file or folder that begins with a hyphen gets ./ before it, one with a quote stays one word; behind a URL there is none."""
    joints = pd.DataFrame({"unit": ["a"], "joint": ["b"], "latest": [pd.NaT], "file": ["--it's; rm x.yaml"]})
    (command,) = tables.report_commands(joints, "-out/").values()
    assert command == "bristle report './--it'\"'\"'s; rm x.yaml' -o ./-out/reports/a-b"
    (command,) = tables.report_commands(joints.assign(file="x.yaml"), "/out", "the logs").values()
    assert command == "bristle report 'the logs/x.yaml' -o /out/reports/a-b"
    assert tables.report_commands(joints.assign(file="s3://logs/x.yaml"), "out") == {}


def test_joints_of_one_file_share_a_report() -> None:
    """A robot's joints, measured in one file, have one folder, named by the robot; two robots that are called alike have two."""
    rows = [("R 1", "J1", "r.yaml"), ("R 1", "J2", "r.yaml"), ("R-1", "J1", "s.yaml"), ("R 1", "J3", "t.yaml")]
    joints = pd.DataFrame(rows, columns=["unit", "joint", "file"]).assign(latest=pd.Timestamp("2026-05-04 08:30"))
    folders = tables.report_folders(joints)
    assert folders["R 1", "J1"] == folders["R 1", "J2"] == "r-1-2026-05-04-0830"
    assert folders["R 1", "J3"] == "r-1-j3-2026-05-04-0830"
    assert folders["R-1", "J1"] == "r-1-j1-2026-05-04-0830"


def test_tables_beside_the_page_are_whole(found: Findings, folder: Path) -> None:
    """Each table of the findings is a CSV file of its columns and rows, in which no text is a formula."""
    assert_tables_are_named(folder)
    frames = report(found).frames
    assert set(frames) == {"joints", "changes", "units", "types", "quality", "warned", "failures"}
    assert {path.stem for path in (folder / "tables").iterdir()} == set(frames)
    for name, frame in frames.items():
        rows = list(csv.DictReader(io.StringIO((folder / "tables" / f"{name}.csv").read_text(encoding="utf-8"))))
        assert len(rows) == len(frame) == len(getattr(found, name))
        assert list(rows[0]) == list(frame.columns)
        assert [row["joint"] for row in rows] == list(frame["joint"]) if "joint" in frame else True
    assert rows[0]["file"] == "'=cut <off>.csv"
    written = (folder / "tables" / "joints.csv").read_text(encoding="utf-8")
    assert [float(row["percent"]) for row in csv.DictReader(io.StringIO(written))] == list(found.joints["percent"])


def test_what_must_be_said_stands_first(folder: Path) -> None:
    """Headline, SIMULATED, notes with their codes' entries, the ranked joints, and of the first what to think of new warnings."""
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


def test_findings_of_nothing_are_a_page(tmp_path: Path) -> None:
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


def test_findings_of_a_simulated_fleet_are_a_page() -> None:
    """What `findings` gives of estimates is what the page takes: every joint and type, and figures though no joint changed."""
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
