"""The committed report of the embedded joints in a real browser: how long it is, what it loads, and whether everybody can read it."""

import csv
import re
from pathlib import Path
from typing import Any

import pytest
from tests.pages import findings

from bristle.page.style import DIRECTION

REPORT = Path(__file__).parent.parent / "reports" / "edro"
PAGES = sorted(path.name for path in REPORT.glob("*.html"))
READ = [name for name in PAGES if name != "explore.html"]
"""Those that are read, and not played with."""
WORDS, SCREENS, BYTES, PRINTED = 6000, 12, 1_500_000, 20
"""Of a page at the most; and of the whole report with everything open:"""
ALL_WORDS = 25_000
COUNTED = "document.body.innerText.split(/\\s+/).filter(Boolean).length"


def opened(browser: Any, name: str, width: int = 1280, scheme: str = "light") -> tuple[Any, list[str]]:
    """A page of the report at a width, and what went wrong in it: requests beyond its file, and errors."""
    page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
    wrong: list[str] = []
    page.on("console", lambda m: wrong.append(m.text) if m.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: wrong.append(str(error)))
    own = (REPORT / name).as_uri()
    page.on("request", lambda r: wrong.append(r.url) if r.url != own and not r.url.startswith("data:") else None)
    page.goto(own)
    return page, wrong


@pytest.mark.parametrize("name", PAGES)
def test_a_page_loads_nothing_and_fits_the_screen(chromium: Any, name: str) -> None:
    """No request, no error; no page is wider than a phone or a desk's screen."""
    for width in (390, 1280):
        page, wrong = opened(chromium, name, width)
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        assert wrong == []
        page.close()


@pytest.mark.parametrize("name", READ)
def test_a_page_is_short(chromium: Any, name: str) -> None:
    """With its details closed a page has few words and screens, its file few bytes, and its print few sheets."""
    page, _ = opened(chromium, name)
    assert page.evaluate(COUNTED) <= WORDS
    assert page.evaluate("document.documentElement.scrollHeight") <= 900 * SCREENS
    assert (REPORT / name).stat().st_size <= BYTES
    assert len(re.findall(rb"/Type\s*/Page\b", page.pdf(format="A4", prefer_css_page_size=True))) <= PRINTED
    page.close()


def test_the_whole_report_is_bounded(chromium: Any) -> None:
    """With everything open all pages together have a bounded number of words."""
    total = 0
    for name in READ:
        page, _ = opened(chromium, name)
        page.evaluate("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
        total += page.evaluate(COUNTED)
        page.close()
    assert total <= ALL_WORDS


@pytest.mark.parametrize("name", READ)
def test_a_caption_begins_with_its_finding(name: str) -> None:
    """The first sentence of each figure's caption has a number, after the figure's own and the note on simulated data."""
    assert [text for text in findings((REPORT / name).read_text(encoding="utf-8")) if not re.search(r"\d", text)] == []


def test_every_figure_has_its_data() -> None:
    """Beside each drawing lie its picture and its data: rows of named series, none called after its kind alone, with numbers in them."""
    figures = sorted((REPORT / "figures").glob("*.svg"))
    assert len(figures) > 40
    for drawing in figures:
        assert drawing.with_suffix(".png").is_file()
        with drawing.with_suffix(".csv").open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        names = {row["series"] for row in rows}
        assert names, drawing
        assert not [name for name in names if re.fullmatch(r"(line|band|segments|bar|map|points) \d+", name)], drawing
        assert any(row["y"] or row["value"] for row in rows), drawing


@pytest.mark.parametrize("name", READ)
def test_figures_and_tables_are_named(chromium: Any, name: str) -> None:
    """Each figure has a caption with its number, which describes its drawing; each table a caption or a region's name; no id stands twice."""
    page, _ = opened(chromium, name)
    figures = page.evaluate(
        "[...document.querySelectorAll('figure')].map((f) => [f.querySelector('figcaption').innerText,"
        " f.querySelector('svg').getAttribute('aria-describedby') === f.querySelector('figcaption').id])"
    )
    assert all(re.match(r"Figure \d+\b", caption) and described for caption, described in figures)
    unnamed = "[...document.querySelectorAll('table')].filter((t) => !t.closest('[aria-label]') && !t.caption).length"
    assert page.evaluate(unnamed) == 0
    ids = page.evaluate("[...document.querySelectorAll('[id]')].map((e) => e.id)")
    assert len(ids) == len(set(ids))
    page.close()


def test_figures_are_numbered_through(chromium: Any) -> None:
    """The figures of all pages count from 1 in the order of the pages, without a gap."""
    page, _ = opened(chromium, "index.html")
    order = page.evaluate("[...document.querySelectorAll('nav.pages a')].map((a) => a.getAttribute('href'))")
    page.close()
    numbers = []
    for name in [x for x in order if x in READ]:
        page, _ = opened(chromium, name)
        numbers += page.evaluate(
            "[...document.querySelectorAll('figcaption .number')].map((a) => parseInt(a.innerText.slice(7)))"
        )
        page.close()
    assert numbers == list(range(1, len(numbers) + 1))


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_and_marks_stand_out(chromium: Any, scheme: str) -> None:
    """On a light page and a dark one text has a contrast of 4.5 at least, and the marks of both directions 3."""
    page, _ = opened(chromium, "index.html", scheme=scheme)
    names = ("paper", "ink", "quiet", "link", "warn", "bad", "good")
    script = "(names) => names.map((n) => getComputedStyle(document.documentElement).getPropertyValue('--' + n).trim())"
    colours = dict(zip(names, page.evaluate(script, names), strict=True))
    page.close()
    for name in names[1:]:
        assert contrast(colours[name], colours["paper"]) >= 4.5, name
    for look in DIRECTION.values():
        assert contrast(look.colour, colours["paper"]) >= 3


def contrast(one: str, other: str) -> float:
    """Of two colours #rrggbb, by WCAG 2."""
    bright, dark = sorted((_luminance(one), _luminance(other)), reverse=True)
    return (bright + 0.05) / (dark + 0.05)


def _luminance(colour: str) -> float:
    parts = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    linear = [x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055) ** 2.4 for x in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def test_the_first_screen_answers(chromium: Any) -> None:
    """Within the first 900 px stand, for each joint: its name, whether to trust it, the values of both directions, and where they come from."""
    page, _ = opened(chromium, "index.html")
    rows = page.evaluate(
        "[...document.querySelectorAll('table.answer tbody')].map((b) => [b.getBoundingClientRect().bottom, b.innerText])"
    )
    assert len(rows) == 4
    for bottom, text in rows:
        assert bottom <= 900
        assert re.search(r"\b(use|do not use)\. ", text)
        assert text.count("±") >= 12
        assert "held-out torque within" in text
        assert "RMS position error" in text
    page.close()
