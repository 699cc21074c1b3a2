from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from bristle.questions.fleet.findings import Findings
from bristle.questions.fleet.report import report

from .hostile import HOSTILE, hostile_fleet


@pytest.fixture(scope="module")
def found() -> Findings:
    """A small fleet with hostile names, of which few joints changed."""
    return hostile_fleet(robots=30)


@pytest.fixture(scope="module")
def folder(found: Findings, tmp_path_factory: pytest.TempPathFactory) -> Path:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("bristle.questions.fleet.report._DRAWN", 2)
        return report(found).write(tmp_path_factory.mktemp("fleet") / "page").parent


class Opened:
    """A page that is open, and what went wrong in it."""

    def __init__(self, chromium: Any, file: Path, width: int, **given: Any) -> None:
        self.context = chromium.new_context(viewport={"width": width, "height": 900}, **given)
        self.page = self.context.new_page()
        self.wrong: list[str] = []
        self.page.on("console", lambda m: self.wrong.append(m.text) if m.type in ("error", "warning") else None)
        self.page.on("pageerror", lambda error: self.wrong.append(str(error)))
        self.page.on(
            "request", lambda r: self.wrong.append(r.url) if not r.url.startswith((file.as_uri(), "data:")) else None
        )
        self.page.goto(file.as_uri())

    def column(self, title: str, k: int) -> list[str]:
        """The cells of a column that are seen, of the table whose title begins so."""
        read = """([title, k]) => [...document.querySelectorAll("table")].find((t) => t.caption.textContent.startsWith(title))
          && [...[...document.querySelectorAll("table")].find((t) => t.caption.textContent.startsWith(title)).tBodies[0].rows]
            .filter((r) => !r.hidden).map((r) => r.cells[k].textContent)"""
        cells: list[str] = self.page.evaluate(read, [title, k])
        return cells


Open = Callable[..., Opened]


@pytest.fixture
def opened(chromium: Any, folder: Path) -> Iterator[Open]:
    """Opens a page; when a test is done nothing may have gone wrong in any."""
    every: list[Opened] = []

    def one(name: str = "index", width: int = 1280, **given: Any) -> Opened:
        every.append(Opened(chromium, folder / f"{name}.html", width, **given))
        return every[-1]

    yield one
    for tab in every:
        assert tab.wrong == []
        tab.context.close()


def test_a_long_table_is_turned_over_sorted_and_filtered(opened: Open) -> None:
    """Next shows the rows that follow, a heading sorts all of them, missing ones last, and a filter keeps those with every word."""
    tab, title = opened(), "Joints, by rank"
    assert tab.column(title, 0) == [str(k) for k in range(1, 51)]
    place = tab.page.locator(".pager [role=status]").first
    assert place.inner_text() == "1 to 50 of 60"
    tab.page.click(".pager button:has-text('Next')")
    assert tab.column(title, 0) == [str(k) for k in range(51, 61)]
    tab.page.click(".pager button:has-text('Next')")
    assert place.inner_text() == "51 to 60 of 60"
    for falling in (False, True):
        tab.page.click("thead button:has-text('Change') >> nth=0")
        sizes = [float(x.split()[0]) for x in tab.column(title, 4)]
        assert len(sizes) == 50
        assert sizes == sorted(sizes, reverse=falling)
    tab.page.click("thead button:has-text('New warnings')")
    assert [bool(x) for x in tab.column(title, 8)] == [True] + 49 * [False]
    tab.page.fill("caption input >> nth=0", "robot-003 j2")
    assert (tab.column(title, 1), tab.column(title, 2)) == (["robot-003"], ["J2"])
    tab.page.fill("caption input >> nth=0", "no such joint")
    assert place.inner_text() == "no row of 60"
    tab.page.click("caption button >> nth=0")  # copies it
    # on a phone, too, a hostile name is read as it is, nothing of it runs, and nothing is wider than the screen
    for name in ("index", "units", "quality"):
        tab = opened(name, width=390)
        assert HOSTILE[:60] in tab.page.inner_text("main")
        assert tab.page.title().startswith("Friction of a fleet")
        assert tab.page.evaluate("document.querySelectorAll('img, main b').length") == 0
        assert tab.page.evaluate("document.documentElement.scrollWidth") <= 390
        unnamed = "[...document.querySelectorAll('main input, main button')].filter((x) => !x.ariaLabel && !x.textContent).length"
        assert tab.page.evaluate(unnamed) == 0
        assert tab.page.evaluate(
            "[...document.querySelectorAll('figure svg')].every((x) => x.getAttribute('aria-label').length > 8)"
        )
    # headline, notes, every row and every figure stand there
    tab = opened(java_script_enabled=False)
    assert "joints changed, at a false discovery rate of 5 %" in tab.page.inner_text("main")
    assert tab.page.locator("table").first.locator("tbody tr:visible").count() == 60
    assert tab.page.locator("figure svg:visible").count() == 2
