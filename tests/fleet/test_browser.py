"""A fleet's page in a real browser: paging, choosing and charts, the numbers it shows, hostile names, and nothing over the network."""

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from bristle.questions.fleet import figures, tables
from bristle.questions.fleet.findings import Findings
from bristle.questions.fleet.page import fleet_files, write_fleet

from .plausible import EXOTIC, HOSTILE, empty, plausible, when
from .reading import Parsed


@pytest.fixture(scope="module")
def found() -> Findings:
    """A small fleet with hostile names."""
    return plausible(units=30, failed=45)


@pytest.fixture(scope="module")
def page(found: Findings) -> bytes:
    """Its page."""
    commands = tables.report_commands(found.joints, "out put")
    return fleet_files(found, reports=[("robot-006", EXOTIC)], commands=commands)["index.html"]


class Opened:
    """A page that is open, and what went wrong in it."""

    def __init__(self, chromium: Any, file: Path, width: int = 1280, **given: Any) -> None:
        self.context = chromium.new_context(viewport={"width": width, "height": 900}, **given)
        self.page = self.context.new_page()
        self.wrong: list[str] = []
        self.page.on("console", lambda m: self.wrong.append(m.text) if m.type in ("error", "warning") else None)
        self.page.on("pageerror", lambda error: self.wrong.append(str(error)))
        self.page.on(
            "request",
            lambda r: self.wrong.append(r.url) if not r.url.startswith((file.as_uri(), "data:", "blob:")) else None,
        )
        self.page.goto(file.as_uri())

    def ready(self) -> "Opened":
        """The same once its script has begun."""
        self.page.wait_for_selector("html[data-ready]", state="attached")
        return self

    def rows(self, table: str) -> list[list[str]]:
        """The cells of a table as they are read."""
        read = "(id) => [...document.getElementById(id).tBodies[0].rows].map((r) => [...r.cells].map((c) => c.textContent))"
        rows: list[list[str]] = self.page.evaluate(read, table)
        return rows

    def source(self, name: str) -> dict[str, list[float]]:
        """What a chart is drawn from."""
        read = (
            "(name) => Object.fromEntries(Object.entries(fleet.charts.named(name).data).map(([k, x]) => [k, [...x]]))"
        )
        columns: dict[str, list[float]] = self.page.evaluate(read, name)
        return columns


Open = Callable[..., Opened]


@pytest.fixture(scope="module")
def file(page: bytes, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page as a file."""
    path: Path = tmp_path_factory.mktemp("fleet") / "index.html"
    path.write_bytes(page)
    return path


@pytest.fixture
def opened(chromium: Any, file: Path) -> Iterator[Open]:
    """Opens the page; when a test is done nothing may have gone wrong in any."""
    every: list[Opened] = []

    def one(**given: Any) -> Opened:
        every.append(Opened(chromium, file, **given))
        return every[-1]

    yield one
    for tab in every:
        assert tab.wrong == []
        tab.context.close()


def test_the_script_writes_as_bristle_does(opened: Open, page: bytes) -> None:
    """The first page of each list reads the same with the script and without it."""
    tab, still = opened().ready(), Parsed(page.decode()).tables
    for name in ("joints", "units", "types", "quality", "failures"):
        live, printed = tab.rows(f"table-{name}"), still[f"table-{name}"][1:]
        report = 9 if name == "joints" else None  # a command, or a button that copies it
        assert len(live) == len(printed[:20])
        for now, then in zip(live, printed, strict=False):
            assert [x for k, x in enumerate(now) if k != report] == [x for k, x in enumerate(then) if k != report]


def test_tables_are_paged_sorted_and_filtered(opened: Open) -> None:
    """Next shows the rows that follow, a heading sorts all of them, and a filter keeps those with every word."""
    tab = opened().ready()
    assert [row[0] for row in tab.rows("table-joints")] == [str(k) for k in range(1, 21)]
    tab.page.click("#pager-joints button:has-text('Next')")
    assert [row[0] for row in tab.rows("table-joints")] == [str(k) for k in range(21, 41)]
    assert tab.page.inner_text("#pager-joints [role=status]") == "21 to 40 of 60"
    tab.page.click("#table-joints thead button:has-text('Change')")
    sizes = [float(row[4].split()[0]) for row in tab.rows("table-joints")]
    assert sizes == sorted(sizes)
    tab.page.click("#table-joints thead button:has-text('Change')")
    sizes = [float(row[4].split()[0]) for row in tab.rows("table-joints")]
    assert sizes == sorted(sizes, reverse=True)
    tab.page.fill("#pager-joints input", "robot-003 j2")
    assert [row[1:3] for row in tab.rows("table-joints")] == [["robot-003", "J2"]]
    tab.page.fill("#pager-joints input", "")
    tab.page.select_option("#pager-joints select", "with new warnings")
    assert [row[8] for row in tab.rows("table-joints")] == ["clipped, torque-drifts"]


def test_a_row_draws_its_joint(opened: Open, found: Findings) -> None:
    """Choosing a row by click or key draws that joint's clearest parameter, with limits, levels and the step; the select draws others."""
    tab = opened().ready()
    row = found.joints.iloc[2]
    tab.page.focus("#table-joints tbody tr:nth-child(3) button.choose")
    tab.page.keyboard.press("Enter")
    assert row["unit"] in tab.page.inner_text("#joint-title")
    part = found.series[
        (found.series["unit"] == row["unit"])
        & (found.series["joint"] == row["joint"])
        & (found.series["parameter"] == row["parameter"])
        & (found.series["direction"] == row["direction"])
    ]
    points = tab.source("points")
    assert points["value"] == pytest.approx(list(part["value"]), rel=1e-4)
    assert points["x"] == [x.timestamp() * 1000 for x in when(8)]
    assert tab.source("limits")["y2"] == pytest.approx(list(part["limit_high"]), rel=1e-4)
    assert tab.source("before")["y"] == pytest.approx([tab.source("before")["y"][0]] * 2)
    step = tab.page.evaluate("(({ visible, location }) => [visible, location])(fleet.charts.named('step'))")
    assert step == [True, (points["x"][3] + points["x"][4]) / 2]
    label = tab.page.evaluate("fleet.charts.named('time').left[0].axis_label")
    assert re.fullmatch(r"Coulomb friction α₀ \([+−]\) \(N·m\)", label)
    assert len(tab.rows("table-steps")) == 4
    tab.page.select_option("#joint-quantity", index=3)
    assert "viscous friction α₂" in tab.page.evaluate("fleet.charts.named('time').left[0].axis_label")
    assert tab.source("points")["value"] != points["value"]
    tab.page.click("#table-joints tbody tr:nth-child(5) td:nth-child(4)")
    assert found.joints.iloc[4]["unit"] in tab.page.inner_text("#joint-title")


def test_a_warning_that_begins_with_the_step_is_no_wear(opened: Open) -> None:
    """The joint with new warnings says that they point at its log, and each code leads to its entry."""
    tab = opened().ready()
    tab.page.select_option("#pager-joints select", "with new warnings")
    tab.page.click("#table-joints tbody button.choose")
    said = tab.page.inner_text("#joint-warned")
    assert "clipped, torque-drifts. They point at the log" in said
    assert "not at wear" in said
    tab.page.click("#joint-warned a >> nth=0")
    assert tab.page.is_visible("#warning-clipped")


def test_units_are_drawn_by_value(opened: Open, found: Findings) -> None:
    """The chart of a type has each of its units once, ordered by value, those outside marked, and says whose a value is."""
    tab = opened().ready()
    tab.page.select_option("#unit-type", "J2")
    tab.page.select_option("#unit-quantity", label="Coulomb friction α₀ (+)")
    rows = found.units[
        (found.units["type"] == "J2") & (found.units["parameter"] == "alpha_0") & (found.units["direction"] == "+")
    ]
    within, outside = tab.source("within"), tab.source("outside")
    assert len(outside["x"]) == rows["outside"].sum() > 0
    drawn = sorted(zip([*within["x"], *outside["x"]], [*within["value"], *outside["value"]], strict=True))
    assert [x for x, _ in drawn] == list(range(1, 31))
    assert [y for _, y in drawn] == pytest.approx(sorted(rows["value"]), rel=1e-6)
    tab.page.fill("#pager-units input", "robot-009 j2 α₂ (+)")
    tab.page.click("#table-units tbody button.choose")
    assert tab.page.inner_text("#unit-said").startswith("robot-009, joint J2: α₂ (+)")
    assert len(tab.source("here")["x"]) == 1
    said = tab.page.inner_text("#units-said")
    assert said.startswith("Type J2, α₂ (+): 0 of 30 units outside; mean 0.02 N·m·s/rad, spread between units 10 %.")


def test_quality_over_time_leaves_notes_out(opened: Open) -> None:
    """The chart has cautions, critical warnings and failed sessions, each with a look of its own, and no notes."""
    tab = opened().ready()
    key = tab.page.inner_text("#quality-key")
    assert all(code in key for code in ("clipped", "torque-drifts", "failed"))
    assert "too-short" not in key
    assert len(tab.source("quality0")["y"]) == len(tab.source(f"quality{figures.CODES}")["y"]) > 5
    assert tab.source("quality2") == {"x": [], "y": []}


def test_hostile_names_run_nothing(opened: Open) -> None:
    """On a phone, too, a hostile name is read as it is, nothing of it runs, and nothing is wider than the screen."""
    tab = opened(width=390).ready()
    tab.page.fill("#pager-joints input", "onerror")
    assert {row[1] for row in tab.rows("table-joints")} == {HOSTILE}
    tab.page.click("#table-joints tbody button.choose")
    assert HOSTILE in tab.page.inner_text("#joint-title")
    assert tab.page.title() == "Friction of a fleet"
    assert tab.page.evaluate("document.querySelectorAll('img, main b').length") == 0
    assert tab.page.evaluate("document.documentElement.scrollWidth") <= 390


def test_every_control_has_a_name(opened: Open) -> None:
    """Each input, select and button has words for a reader who does not see it, and charts say what they show."""
    tab = opened().ready()
    unnamed = """[...document.querySelectorAll("main input, main select, main button")]
      .filter((x) => !(x.labels && x.labels.length) && !x.ariaLabel && !x.textContent).length"""
    assert tab.page.evaluate(unnamed) == 0
    for name in ("time", "units", "quality"):
        assert len(tab.page.get_attribute(f"#figure-{name}", "aria-label")) > 20


def test_without_javascript_the_essentials_are_read(opened: Open) -> None:
    """Headline, notes and the top of each list stand there; controls and charts do not."""
    tab = opened(java_script_enabled=False)
    text = tab.page.inner_text("main")
    assert "joints changed, at a false discovery rate of 5 %" in text
    assert "Without JavaScript this page has the top of each list" in text
    assert "The first 20 of 60 rows" in text
    assert tab.page.locator("main select:visible, main input:visible, .chart:visible").count() == 0


def test_findings_of_nothing_open(chromium: Any, tmp_path: Path) -> None:
    """A page of no joints opens without an error."""
    write_fleet(empty(), tmp_path)
    tab = Opened(chromium, tmp_path / "index.html").ready()
    assert tab.rows("table-joints") == []
    assert tab.wrong == []
    tab.context.close()
