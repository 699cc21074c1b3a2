"""The report of the embedded joints in a real browser: how long it is, what it loads, and whether everybody can read it."""

import csv
import re
from pathlib import Path
from typing import Any

from tests.pages import findings

from bristle.page.style import DIRECTION

EXPLORER = "explore.html"  # the page that is not read, but played with
WORDS, SCREENS, BYTES, PRINTED = 6000, 12, 1_500_000, 20
"""Of a page at the most; and of the whole report with everything open:"""
ALL_WORDS = 25_000


MEASURED = """() => {
  const every = (selector, of) => [...document.querySelectorAll(selector)].map(of), ids = every("[id]", (e) => e.id);
  return {
    words: document.body.innerText.split(/\\s+/).filter(Boolean).length,
    height: document.documentElement.scrollHeight,
    unnumbered: every("figcaption", (c) => c.innerText).filter((text) => !/^Figure \\d+\\b/.test(text)),
    undescribed: every("figure", (f) => f).filter(
      (f) => f.querySelector("svg").getAttribute("aria-describedby") !== f.querySelector("figcaption").id).length,
    unnamed: every("table", (t) => t).filter((t) => !t.closest("[aria-label]") && !t.caption).length,
    twice: ids.filter((id, k) => ids.indexOf(id) !== k),
  };
}"""
"""What is seen of a page with its details closed."""
OPENED = """() => {
  document.querySelectorAll("details").forEach((d) => { d.open = true; });
  return document.body.innerText.split(/\\s+/).filter(Boolean).length;
}"""
"""Its words with everything open."""


def opened(browser: Any, report: Path, name: str, width: int = 1280, scheme: str = "light") -> tuple[Any, list[str]]:
    """A page of the report at a width, and what went wrong in it: requests beyond its file, and errors."""
    page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
    wrong: list[str] = []
    page.on("console", lambda m: wrong.append(m.text) if m.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: wrong.append(str(error)))
    own = (report / name).as_uri()
    page.on("request", lambda r: wrong.append(r.url) if r.url != own and not r.url.startswith("data:") else None)
    page.goto(own)
    return page, wrong


def test_every_page_is_short_and_named_and_loads_nothing(chromium: Any, edro_report: Path) -> None:
    """No request, no error; no page is wider than a phone or a desk's screen, and with details closed none is long, its print neither."""
    # each figure has a caption with its number, which describes its drawing; each table a caption or a region's name; no
    # id stands twice. With everything open all pages together have a bounded number of words
    failed, total = list[tuple[str, object]](), 0
    for name in sorted(path.name for path in edro_report.glob("*.html")):
        for width in (1280, 390):
            page, wrong = opened(chromium, edro_report, name, width)
            wide = page.evaluate("document.documentElement.scrollWidth")
            failed += [(name, x) for x in wrong] + [(name, (width, wide))] * (wide > width)
            if width == 1280 and name != EXPLORER:
                seen = page.evaluate(MEASURED)
                limits = {"words": WORDS, "height": 900 * SCREENS, "unnamed": 0, "undescribed": 0}
                failed += [(name, (key, seen[key])) for key, most in limits.items() if seen[key] > most]
                failed += [(name, (key, seen[key])) for key in ("unnumbered", "twice") if seen[key]]
                sheets = len(re.findall(rb"/Type\s*/Page\b", page.pdf(format="A4", prefer_css_page_size=True)))
                size = (edro_report / name).stat().st_size
                failed += [(name, (sheets, size))] * (sheets > PRINTED or size > BYTES)
                total += page.evaluate(OPENED)
            page.close()
    assert failed == []
    assert total <= ALL_WORDS


def test_a_caption_begins_with_its_finding(edro_report: Path) -> None:
    """The first sentence of each figure's caption has a number, after the figure's own and the note on simulated data."""
    pages = [path for path in edro_report.glob("*.html") if path.name != EXPLORER]
    said = [text for path in pages for text in findings(path.read_text(encoding="utf-8"))]
    assert [text for text in said if not re.search(r"\d", text)] == []
    # beside each drawing lie its picture and its data: rows of named series, none called after its kind alone, with numbers in them
    figures = sorted((edro_report / "figures").glob("*.svg"))
    assert len(figures) > 40
    failed = []
    for drawing in figures:
        with drawing.with_suffix(".csv").open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        unnamed = [x for x in rows if re.fullmatch(r"(line|band|segments|bar|map|points) \d+", x["series"])]
        whole = drawing.with_suffix(".png").is_file() and any(x["y"] or x["value"] for x in rows)
        failed += [drawing] * (bool(unnamed) or not whole)
    assert failed == []


def test_a_page_can_be_read_and_used(chromium: Any, edro_report: Path) -> None:
    """On a light page and a dark one text has a contrast of 4.5 at least, and the marks of both directions 3."""
    names = ("paper", "ink", "quiet", "link", "warn", "bad", "good")
    script = "(names) => names.map((n) => getComputedStyle(document.documentElement).getPropertyValue('--' + n).trim())"
    papers = set()
    for scheme in ("light", "dark"):
        page, _ = opened(chromium, edro_report, "index.html", scheme=scheme)
        paper, *inks = page.evaluate(script, names)
        page.close()
        papers.add(paper)
        assert [name for name, ink in zip(names[1:], inks, strict=True) if contrast(ink, paper) < 4.5] == []
        assert all(contrast(look.colour, paper) >= 3 for look in DIRECTION.values())
    assert len(papers) == 2
    # within the first 900 px stand, for each joint: its name, whether to trust it, the values of both directions, and where they come from.
    # So do the hold-out error, what compensation leaves of friction, and the curve with its scales
    page, _ = opened(chromium, edro_report, "index.html")
    rows = page.evaluate(
        "[...document.querySelectorAll('table.answer tbody')].map((b) => [b.getBoundingClientRect().bottom, b.innerText])"
    )
    assert len(rows) == 4
    asked = (
        r"\b(use|do not use)\. ", r"(±.*){12}", r"\t[\d.]+ %\t[\d.]+ %\s+of friction\s+in held-out runs",
        r" N·m\s+[\d.]+ rad/s|rad/s\s+[\d.]+ N·m", "RMS position error",
    )  # fmt: skip  # a list
    assert [(x, text) for _, text in rows for x in asked if not re.search(x, text, re.DOTALL)] == []
    assert max(bottom for bottom, _ in rows) <= 900
    page.close()
    # a click on a heading sorts a long table, a word filters it, and its rows can be copied
    page, wrong = opened(chromium, edro_report, "joints.html")
    head = "table.long thead button >> nth=2"
    column = "[...document.querySelector('table.long').tBodies[0].rows].filter((r) => !r.hidden).map((r) => parseFloat(r.cells[2].innerText))"
    page.click(head)
    values = page.evaluate(column)
    assert values == sorted(values)
    page.click(head)
    assert page.evaluate(column) == values[::-1]
    page.fill("table.long caption input >> nth=0", "inertia")
    assert len(page.evaluate(column)) == 1
    page.click("caption button >> nth=0")
    assert wrong == []
    page.close()


def contrast(one: str, other: str) -> float:
    """Of two colours #rrggbb, by WCAG 2."""
    bright, dark = sorted((_luminance(one), _luminance(other)), reverse=True)
    return (bright + 0.05) / (dark + 0.05)


def _luminance(colour: str) -> float:
    parts = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    linear = [x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055) ** 2.4 for x in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
