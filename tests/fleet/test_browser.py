from pathlib import Path
from typing import Any

import pytest

from bristle.questions.fleet.report import report

from ..pages import opened
from .hostile import HOSTILE, hostile_fleet

COLUMN = """(k) => [...[...document.querySelectorAll("table")].find((t) => t.caption.textContent.startsWith("Joints, by rank")).tBodies[0].rows]
  .filter((r) => !r.hidden).map((r) => r.cells[k].textContent)"""
"""The cells of a column that are seen, of the table of joints."""
UNNAMED = (
    "[...document.querySelectorAll('main input, main button')].filter((x) => !x.ariaLabel && !x.textContent).length"
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Pages of a fleet with hostile names, of 60 joints."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("bristle.questions.fleet.report._DRAWN", 2)
        return report(hostile_fleet(robots=30)).write(tmp_path_factory.mktemp("fleet") / "page").parent


def test_a_long_table_is_turned_over_sorted_and_filtered(chromium: Any, folder: Path) -> None:
    """Next shows the rows that follow, a heading sorts all of them, missing ones last, and a filter keeps those with every word."""
    page, wrong = opened(chromium, folder / "index.html")
    assert page.evaluate(COLUMN, 0) == [str(k) for k in range(1, 51)]
    place = page.locator(".pager [role=status]").first
    assert place.inner_text() == "1 to 50 of 60"
    page.click(".pager button:has-text('Next')")
    assert page.evaluate(COLUMN, 0) == [str(k) for k in range(51, 61)]
    assert place.inner_text() == "51 to 60 of 60"
    for falling in (False, True):
        page.click("thead button:has-text('Change') >> nth=0")
        sizes = [float(x.split()[0]) for x in page.evaluate(COLUMN, 4)]
        assert len(sizes) == 50
        assert sizes == sorted(sizes, reverse=falling)
    page.click("thead button:has-text('New warnings')")
    assert [bool(x) for x in page.evaluate(COLUMN, 8)] == [True] + 49 * [False]
    page.fill("caption input >> nth=0", "robot-003 j2")
    assert [page.evaluate(COLUMN, k) for k in (1, 2)] == [["robot-003"], ["J2"]]
    page.fill("caption input >> nth=0", "no such joint")
    assert place.inner_text() == "no row of 60"
    page.click("caption button >> nth=0")  # copies it
    assert wrong == []
    # on a phone, too, a hostile name is read as it is, nothing of it runs, and nothing is wider than the screen
    for name in ("index", "units", "quality"):
        page, wrong = opened(chromium, folder / f"{name}.html", width=390)
        assert HOSTILE[:60] in page.inner_text("main")
        assert page.title().startswith("Friction of a fleet")
        assert page.evaluate("document.querySelectorAll('img, main b').length") == 0
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        assert page.evaluate(UNNAMED) == 0
        assert (
            min(page.evaluate("[99, ...[...document.querySelectorAll('figure svg')].map((x) => x.ariaLabel.length)]"))
            > 8
        )
        assert wrong == []
    # without scripts headline, every row and every figure stand there
    page, wrong = opened(chromium, folder / "index.html", java_script_enabled=False)
    assert "joints changed, at a false discovery rate of 5 %" in page.inner_text("main")
    assert page.locator("table").first.locator("tbody tr:visible").count() == 60
    assert page.locator("figure svg:visible").count() == 2
