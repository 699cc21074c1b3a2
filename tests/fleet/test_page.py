"""The page of a fleet: its size, what it would load, what it is told, and the tables beside it."""

import base64
import csv
import hashlib
import io
import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import bristle
from bristle.page import output_folder
from bristle.questions.fleet import figures, tables
from bristle.questions.fleet.findings import Findings, findings
from bristle.questions.fleet.page import fleet_files, write_fleet
from bristle.simulation.fleet import FleetDesign, fleet_estimates, fleet_truth

from .plausible import EXOTIC, HOSTILE, empty, plausible, when
from .reading import Parsed, told, unpacked


@pytest.fixture(scope="module")
def found() -> Findings:
    """A small fleet with hostile names."""
    return plausible(units=30, failed=45)


@pytest.fixture(scope="module")
def page(found: Findings) -> bytes:
    """Its page."""
    commands = tables.report_commands(found.joints, "out put")
    return fleet_files(found, reports=[("robot-006", EXOTIC)], commands=commands)["index.html"]


def test_a_large_fleet_is_at_most_five_megabytes() -> None:
    """1200 joints of 8 sessions and 8 parameters and directions, with reports' commands, are at most 5 MB in one file."""
    large = plausible(200, 6, 8, ("alpha_0", "alpha_1", "alpha_2", "v_s"), failed=100)
    files = fleet_files(large, commands=tables.report_commands(large.joints, "reports/plant"))
    assert len(files["index.html"]) <= 5e6
    data = told(files["index.html"])
    assert data["charted"] == 1200
    assert len(unpacked(data["joints"]["rank"])) == 1200
    assert len(unpacked(data["series"]["value"])) == 1200 * 8 * 8


def test_a_larger_fleet_says_what_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beyond the caps tables and charts hold the first ranks, the page says so, and the CSV files are whole."""
    some = plausible(units=30, failed=45)
    for name, most in (("JOINTS", 12), ("UNITS", 25), ("FAILURES", 30), ("TYPES", 3)):
        monkeypatch.setattr(tables, name, most)
        monkeypatch.setattr("bristle.questions.fleet.page." + name, most)
    monkeypatch.setattr(figures, "POINTS", 100)  # three joints of four blocks of eight sessions
    files = fleet_files(some)
    page, data = files["index.html"].decode(), told(files["index.html"])
    assert data["charted"] == 3
    assert "This page has the first 12 of 60 rows; tables/joints.csv has all." in page
    assert "This page has the first 25 of 240 rows; tables/units.csv has all." in page
    assert "This page has the first 30 of 45 rows; tables/failures.csv has all." in page
    assert "on this page for the 3 joints ranked first of 60" in page
    counts = {
        "joints": unpacked(data["joints"]["rank"]),
        "units": unpacked(data["units"]["value"]),
        "failures": data["tables"]["failures"],
    }
    assert {name: len(x) for name, x in counts.items()} == {"joints": 12, "units": 25, "failures": 30}
    assert files["tables/units.csv"].count(b"\n") == 241
    assert set(unpacked(data["series"]["joint"])) == {0, 1, 2}


def test_the_page_loads_nothing(page: bytes) -> None:
    """No element names anything to fetch, styles neither; the policy allows the page's own scripts alone, by their digests."""
    text, read = page.decode(), Parsed(page.decode())
    for tag, given in read.elements:
        assert not {"src", "srcset", "data", "action", "background"} & given.keys(), tag
        assert re.match(r"data:,|#|tables/[a-z]+\.csv$", given.get("href", "#")), given
        assert not [name for name in given if name.startswith("on")], tag
    style = text[text.index("<style>") : text.index("</style>")]
    assert "url(" not in style
    assert "@import" not in style
    (policy,) = [given["content"] for _, given in read.elements if given.get("http-equiv") == "Content-Security-Policy"]
    assert policy.startswith("default-src 'none'; script-src 'sha256-")
    assert "worker-src" not in policy
    digests = re.findall(r"'sha256-([^']+)'", policy)
    assert digests == [base64.b64encode(hashlib.sha256(x.encode()).digest()).decode() for x in read.scripts[1:]]


def test_hostile_names_stay_text(page: bytes) -> None:
    """A name that ends a script and loads an image begins no tag, neither in the page nor in its JSON."""
    read = Parsed(page.decode())
    assert not [tag for tag, _ in read.elements if tag in {"img", "b"}]
    assert page.decode().count("</script") == len(read.scripts)
    assert not re.search("[<>&]", read.scripts[0])
    data = json.loads(read.scripts[0])
    assert HOSTILE in data["joints"]["unit"]["words"]
    assert EXOTIC in data["joints"]["joint"]["words"]
    assert HOSTILE in [row[1] for row in read.tables["table-joints"]]


def test_equal_findings_give_equal_bytes(found: Findings, page: bytes) -> None:
    """A second call gives the same files, though Bokeh counts its models on."""
    commands = tables.report_commands(found.joints, "out put")
    again = fleet_files(plausible(units=30, failed=45), reports=[("robot-006", EXOTIC)], commands=commands)
    assert again["index.html"] == page
    assert again == fleet_files(found, reports=[("robot-006", EXOTIC)], commands=commands)


def test_series_are_told_to_a_thousandth_of_their_range(found: Findings, page: bytes) -> None:
    """Each packed value is that of the findings, to a ten-thousandth of its chart's range, in the session it is of."""
    data = told(page)["series"]
    joint, quantity, counts, low, step = (
        unpacked(data[name]) for name in ("joint", "quantity", "counts", "low", "step")
    )
    sessions, names = unpacked(data["sessions"]), tables.quantities_of(found.series, found.units)
    assert sessions[:8] == [x.timestamp() * 1000 for x in when(8)]
    begin = 0
    for block, (k, q) in enumerate(zip(joint, quantity, strict=True)):
        row, own = found.joints.iloc[k], names.iloc[q]
        part = found.series[
            (found.series["unit"] == row["unit"])
            & (found.series["joint"] == row["joint"])
            & (found.series["parameter"] == own["parameter"])
            & (found.series["direction"] == own["direction"])
        ]
        for name in figures.COLUMNS:
            codes = unpacked(data[name])[begin : begin + counts[k]] if block < 12 else []
            for code, value in zip(codes, part[name], strict=False):
                assert low[block] + code * step[block] == pytest.approx(value, abs=1e-4 * 65534 * step[block])
        begin += counts[k]
    assert begin == len(found.series)


def test_what_is_no_number_or_open_is_told_as_such() -> None:
    """A session without a value has a gap, an open interval ends beyond the chart, and a block of no numbers is all gaps."""
    some = plausible(units=2, joints=1)
    series = some.series.copy()
    series.loc[3, ["value", "lower", "upper", "adjusted"]] = np.nan
    series.loc[4, "upper"] = np.inf
    series.loc[8:15, list(figures.COLUMNS)] = np.nan
    known = tables.quantities_of(series)
    data, most = figures.packed_series(series.drop(index=5), some.changes, some.joints, known)
    values = np.array([unpacked(data[name]) for name in figures.COLUMNS])
    assert most == 2
    rank = int(some.joints.index[some.joints["unit"] == HOSTILE][0])
    first = unpacked(data["joint"]).index(rank) * 8
    assert (values[:4, first + 3] == 65535).all()
    assert values[2, first + 4] == 65534
    assert (values[:, first + 5] == 65535).all()
    assert (values[:, first + 8 : first + 16] == 65535).all()


def test_steps_and_spreads_are_those_of_the_findings(found: Findings, page: bytes) -> None:
    """Of each block the tested step, nan where there is none; of each type and quantity the mean, and the band of 95 %."""
    data = told(page)
    percent = unpacked(data["series"]["steps"]["percent"])
    assert sorted(percent) == pytest.approx(sorted(found.changes["percent"]), rel=1e-6)
    assert sum(unpacked(data["series"]["steps"]["changed"])) == found.changes["changed"].sum()
    for one in data["spreads"]:
        assert one["count"] == 30
        assert (one["low"], one["high"]) == pytest.approx((0.02 * np.exp(-0.196), 0.02 * np.exp(0.196)))


def test_reports_are_commands_until_they_are_there(found: Findings, page: bytes) -> None:
    """Each joint has the command that makes its report in a shell, and a link once the report is said to be there."""
    data = told(page)["joints"]
    at = next(
        k
        for k, x in enumerate(zip(unpacked(data["unit"]), unpacked(data["joint"]), strict=True))
        if x == ("robot-006", EXOTIC)
    )
    links, commands = unpacked(data["link"]), unpacked(data["command"])
    assert [k for k, link in enumerate(links) if link] == [at]
    assert re.fullmatch(r"reports/[a-z0-9-]+-2026-07-20-0800/index\.html", links[at])
    folder = links[at].removesuffix("/index.html")
    assert commands[at] == f"bristle report 'logs/0010 ü.yaml' -o 'out put/{folder}'"
    assert len(set(tables.report_folders(found.joints).values())) == len(found.joints)


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


def test_a_report_is_linked_once_it_is_there(found: Findings, tmp_path: Path) -> None:
    """A page that is written anew links to the reports below it; of the others it has the command for this folder."""
    folders = tables.report_folders(found.joints)
    first = (str(found.joints["unit"][0]), str(found.joints["joint"][0]))
    data = told(write_fleet(found, tmp_path, base="/logs").read_bytes())["joints"]
    assert set(unpacked(data["link"])) == {""}
    assert unpacked(data["command"])[0].startswith("bristle report '/logs/logs/")
    assert unpacked(data["command"])[0].endswith(f"{tmp_path}/reports/{folders[first]}")
    made = tmp_path / "reports" / folders[first]
    made.mkdir(parents=True)
    (made / "index.html").write_text("a report", encoding="utf-8")
    data = told(write_fleet(found, tmp_path).read_bytes())["joints"]
    assert unpacked(data["link"])[:2] == [f"reports/{folders[first]}/index.html", ""]


def test_tables_beside_the_page_are_whole(found: Findings, tmp_path: Path) -> None:
    """Each table of the findings is a CSV file of its columns and rows, in which no text is a formula."""
    assert write_fleet(found, tmp_path / "fleet") == tmp_path / "fleet" / "index.html"
    assert {path.name for path in (tmp_path / "fleet" / "tables").iterdir()} == {
        f"{name}.csv" for name in ("joints", "changes", "units", "types", "quality", "warned", "failures")
    }
    for name, frame in tables.csv_frames(found).items():
        text = (tmp_path / "fleet" / "tables" / f"{name}.csv").read_text(encoding="utf-8")
        rows = list(csv.DictReader(io.StringIO(text)))
        assert len(rows) == len(frame)
        assert list(rows[0]) == list(frame.columns)
        assert [row["joint"] for row in rows] == list(frame["joint"]) if "joint" in frame else True
    assert rows[0]["file"] == "'=cut <off>.csv"
    written = (tmp_path / "fleet" / "tables" / "joints.csv").read_text(encoding="utf-8")
    assert [float(row["percent"]) for row in csv.DictReader(io.StringIO(written))] == list(found.joints["percent"])


def test_nothing_foreign_is_replaced(found: Findings, tmp_path: Path) -> None:
    """A page is written anew in its folder, but not over a file that bristle did not make; the dataset beside it stays."""
    output_folder.claim(tmp_path, output_folder.FLEET)
    for folder in ("results", "tables"):
        (tmp_path / folder).mkdir()
    (tmp_path / "results" / "part-0.parquet").write_bytes(b"data")
    (tmp_path / "tables" / "joints.csv").write_text("mine", encoding="utf-8")
    with pytest.raises(bristle.InputError, match=r"tables/joints\.csv: is there already, and bristle did not make it"):
        write_fleet(found, tmp_path)
    (tmp_path / "tables" / "joints.csv").unlink()
    write_fleet(found, tmp_path)
    write_fleet(plausible(seed=2), tmp_path)
    assert (tmp_path / "results" / "part-0.parquet").read_bytes() == b"data"


def test_what_must_be_said_stands_without_a_script(page: bytes) -> None:
    """Headline, notes with their codes' entries, the SIMULATED badge and the top of each list stand in the HTML."""
    text, read = page.decode(), Parsed(page.decode())
    assert '<strong class="badge">SIMULATED</strong>' in text
    assert "of 60 joints changed, at a false discovery rate of 5 %" in text
    for code in ("warned-since", "clipped", "torque-drifts"):
        assert f'<dt id="warning-{code}">' in text
    assert '<a class="code" href="#warning-warned-since">' in text
    rows = read.tables["table-joints"]
    assert len(rows) == 1 + tables.PRINTED
    assert rows[1][3] == "changed"
    assert rows[1][5] in {"α₀ (+)", "α₀ (−)"}
    assert "The first 20 of 60 rows" in text
    assert read.tables["table-types"][1][7].startswith(("-1.", "-0.9"))
    assert read.tables["table-quality"][0][0] == "Code"
    assert read.tables["table-failures"][1][3] == "<i>file 0</i>: ends in line 812; log it again"


def test_findings_of_nothing_are_a_page() -> None:
    """Without a joint, a value or a warning there is a page that says so."""
    text = fleet_files(empty())["index.html"].decode()
    assert "No joint was tested for a change" in text
    assert "No session has a warning." in text
    assert "None: every session was identified and used." in text


def test_findings_of_a_simulated_fleet_are_a_page() -> None:
    """What `findings` gives of estimates is what the page takes: every joint, every series, the type's coefficients."""
    design = FleetDesign(robots=12, joints=2, sessions=5, worn=0.2, change=0.4, swing=10.0)
    rng = np.random.default_rng(3)
    found = findings(fleet_estimates(design, fleet_truth(design, rng), rng))
    data = told(fleet_files(found)["index.html"])
    assert len(unpacked(data["joints"]["rank"])) == data["charted"] == 24
    assert len(unpacked(data["series"]["value"])) == len(found.series) == 24 * 5 * 8
    assert len(data["spreads"]) == len(found.types) == 16
    assert np.isfinite(unpacked(data["series"]["steps"]["p"])).all()
    assert data["quality"]["codes"] == []
