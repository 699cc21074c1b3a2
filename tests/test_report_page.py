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
ASKED = {
    "width": "document.documentElement.scrollWidth",
    "height": "document.documentElement.scrollHeight",
    "words": "document.body.innerText.split(/\\s+/).filter(Boolean).length",
    "figures": "[...document.querySelectorAll('figure')].map((f) => [f.querySelector('figcaption').innerText,"
    " f.querySelector('svg').getAttribute('aria-describedby') === f.querySelector('figcaption').id])",
    "unnamed": "[...document.querySelectorAll('table')].filter((t) => !t.closest('[aria-label]') && !t.caption).length",
    "ids": "[...document.querySelectorAll('[id]')].map((e) => e.id)",
    "numbers": "[...document.querySelectorAll('figcaption .number')].map((a) => parseInt(a.innerText.slice(7)))",
    "order": "[...document.querySelectorAll('nav.pages a')].map((a) => a.getAttribute('href'))",
}
"""What each page is asked in the browser."""


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


@pytest.fixture(scope="module")
def seen(chromium: Any) -> dict[str, dict[str, Any]]:
    """What each page answers on a desk's screen, with its width on a phone, its sheets on paper, and its words with everything open."""
    found = {}
    for name in PAGES:
        phone, wrong = opened(chromium, name, 390)
        page, more = opened(chromium, name)
        found[name] = {what: page.evaluate(script) for what, script in ASKED.items()}
        found[name] |= {"phone": phone.evaluate(ASKED["width"]), "wrong": wrong + more}
        if name in READ:
            found[name]["sheets"] = len(
                re.findall(rb"/Type\s*/Page\b", page.pdf(format="A4", prefer_css_page_size=True))
            )
            page.evaluate("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
            found[name]["all"] = page.evaluate(ASKED["words"])
        phone.close()
        page.close()
    return found


def test_a_page_loads_nothing_and_fits_the_screen(seen: dict[str, dict[str, Any]]) -> None:
    """No request, no error; no page is wider than a phone or a desk's screen."""
    assert not [name for name, x in seen.items() if x["wrong"] or x["phone"] > 390 or x["width"] > 1280]


def test_pages_are_short(seen: dict[str, dict[str, Any]]) -> None:
    """With its details closed a page has few words and screens, its file few bytes, its print few sheets; all pages, open, have few words."""
    limits = {"words": WORDS, "height": 900 * SCREENS, "sheets": PRINTED}
    assert not [(name, x, seen[name][x]) for name in READ for x, limit in limits.items() if seen[name][x] > limit]
    assert not [name for name in READ if (REPORT / name).stat().st_size > BYTES]
    assert sum(seen[name]["all"] for name in READ) <= ALL_WORDS


def test_a_caption_begins_with_its_finding() -> None:
    """The first sentence of each figure's caption has a number, after the figure's own and the note on simulated data."""
    texts = [text for name in READ for text in findings((REPORT / name).read_text(encoding="utf-8"))]
    assert [text for text in texts if not re.search(r"\d", text)] == []


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


def test_figures_and_tables_are_named(seen: dict[str, dict[str, Any]]) -> None:
    """Each figure has a caption with its number, which describes its drawing; each table a caption or a region's name; no id stands twice.

    The figures of all pages count from 1 in the order of the pages, without a gap.
    """
    for name in READ:
        figures, ids = seen[name]["figures"], seen[name]["ids"]
        assert all(re.match(r"Figure \d+\b", caption) and described for caption, described in figures), name
        assert seen[name]["unnamed"] == 0, name
        assert len(ids) == len(set(ids)), name
    numbers = [k for name in seen["index.html"]["order"] if name in READ for k in seen[name]["numbers"]]
    assert numbers == list(range(1, len(numbers) + 1)) != []


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
