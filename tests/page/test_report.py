"""The kit of reports: sections as page, text and files, whatever they hold or lack."""

from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest
from matplotlib.figure import Figure

from bristle.errors import InputError
from bristle.findings import CAUTION, NOTE, Finding
from bristle.page.page import Drawing
from bristle.page.report import Report, Section, Table

from ..pages import assert_tables_are_named, page_text

HOSTILE = "</p><script>alert('1')</script> {{ 7 * 7 }} & \x1b[31m\ud800"
FRAME = pd.DataFrame({"parameter": ["alpha_0", HOSTILE[:-1]], "=cmd()": [1.5, None], "text": ["=1+1", "+"]})


def drawing(caption: str = "One line rises by 1.") -> Drawing:
    """A figure with one line."""

    def draw() -> Figure:
        """It."""
        figure = Figure()
        figure.subplots().plot([0, 1], [0, 1], label="a line")
        return figure

    return Drawing(draw, "line", HOSTILE, caption)


def finding(text: str) -> Section:
    """A section with a finding that is no note."""
    return Section(text, findings=(Finding("strays", CAUTION, text),))


WHOLE = Report(
    HOSTILE,
    (
        Section("", findings=(Finding("strays", CAUTION, "The answer."),), turn=2),
        Section(HOSTILE, text=f"One.\n\n{HOSTILE}", figure=drawing(HOSTILE), lines=(HOSTILE,)),
        Section("Part", form="part", table=Table("numbers", HOSTILE, FRAME, note="How to read it.")),
        Section("Folded", form="folded", table=Table("numbers", "Some", FRAME, FRAME[:1])),
        finding("Part"),
    ),
    about=HOSTILE,
    simulated="All of it.",
    seed=7,
    tables={"more": FRAME},
)


def test_text_of_any_kind_stays_text(tmp_path: Path) -> None:
    """Nothing in a title, text, label, caption or table becomes HTML, a template, a formula, or reaches the terminal's controls."""
    page = page_text(WHOLE.write(tmp_path / "out"))
    assert "<script" not in page
    assert page.count("&lt;script&gt;") >= 7
    assert page.count("{{ 7 * 7 }}") == page.count("&lt;script&gt;")
    assert not {"\x1b", "\ud800"} & set(WHOLE.text())
    assert "'=cmd()" in (tmp_path / "out" / "tables" / "numbers.csv").read_text(encoding="utf-8")


def test_what_a_section_holds_is_shown_in_its_place(tmp_path: Path) -> None:
    """Headings, paragraphs, the answer in bold, SIMULATED, seed, codes with their entries; each id once, each figure with its data."""
    page = page_text(WHOLE.write(tmp_path / "out"))
    assert_tables_are_named(tmp_path / "out")
    assert (
        page.index("<strong>The answer.") < page.index("<h2>") < page.index("<p>One.</p>") < page.index("<h3>Part</h3>")
    )
    assert "<details" in page.partition("<h3>Part</h3>")[2].partition("<h2>Part</h2>")[0]
    assert '<p class="banner"><strong>SIMULATED data.</strong> All of it.</p>' in page
    assert "<dt>seed</dt><dd>7</dd>" in page
    assert page.count('href="#warning-strays"') == 2
    assert page.count('id="warning-strays"') == 1
    assert [page.count(f'id="{slug}--section"') for slug in ("part", "folded", "part-2")] == [1, 1, 1]
    assert "default-src 'none'" in page
    files = {path.relative_to(tmp_path / "out").as_posix() for path in (tmp_path / "out").rglob("*.*")}
    assert {"tables/numbers.csv", "tables/more.csv", *(f"figures/line.{x}" for x in ("svg", "png", "csv"))} <= files
    assert "a line,1,1," in (tmp_path / "out" / "figures" / "line.csv").read_text(encoding="utf-8")


def test_a_section_needs_nothing_and_no_other(tmp_path: Path) -> None:
    """A title alone is a section, a table without rows only a file, a figure that draws nothing none; without sections a page is one too."""
    nothing = Section(
        "Bare", figure=Drawing(lambda: None, "none", "none", "Nothing."), table=Table("empty", "Empty", FRAME[:0])
    )
    page = page_text(replace(WHOLE, sections=(nothing,), simulated="", seed=None).write(tmp_path / "out"))
    assert "<h2>Bare</h2>" in page
    assert not any(part in page for part in ("<figure", "<table", "SIMULATED", 'class="banner"'))
    assert "none: no random numbers" in page
    assert (tmp_path / "out" / "tables" / "empty.csv").is_file()
    assert not (tmp_path / "out" / "figures").exists()
    assert "<h2>Versions" in replace(WHOLE, sections=()).html()
    for k in range(len(WHOLE.sections)):
        assert replace(WHOLE, sections=WHOLE.sections[:k] + WHOLE.sections[k + 1 :]).html()


def test_the_terminal_has_lines_or_else_findings_by_their_turn() -> None:
    """Sections of one turn come as on the page, a later turn after them; a note has no code."""
    sections = (
        finding("last"),
        Section("lines", findings=(Finding("strays", CAUTION, "unsaid"),), lines=("  a line",)),
        Section("text", text="on the page alone"),
        Section("note", findings=(Finding("y", NOTE, "No change."),)),
    )
    report = replace(WHOLE, sections=(replace(sections[0], turn=1), *sections[1:]))
    assert report.text().splitlines() == ["  a line", str(Finding("y", NOTE, "No change.")), "last [strays]"]


def test_bytes_repeat_and_nothing_else_is_replaced(tmp_path: Path) -> None:
    """Written twice every file is the same, and `html` is the page; a file of the user stays, and a folder that is not ours is refused."""
    found = []
    for _ in range(2):
        index = WHOLE.write(tmp_path / "out")
        found.append({path.name: path.read_bytes() for path in index.parent.rglob("*") if path.is_file()})
        (index.parent / "mine.txt").write_text("mine", encoding="utf-8")
    assert found[0] == {name: data for name, data in found[1].items() if name != "mine.txt"}
    assert index.read_bytes() == WHOLE.html().encode("utf-8", "backslashreplace")
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "index.html").write_text("mine", encoding="utf-8")
    with pytest.raises(InputError, match="bristle did not make it"):
        WHOLE.write(tmp_path / "other")


def test_tables_are_by_name() -> None:
    """`frames` has each file's frame, whole."""
    assert {name: len(frame) for name, frame in WHOLE.frames.items()} == {"more": 2, "numbers": 2}
