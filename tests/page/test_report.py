"""The kit of reports: sections as page, text and files, whatever they hold or lack."""

from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest
from matplotlib.figure import Figure

from bristle.errors import InputError
from bristle.findings import CAUTION, CRITICAL, NOTE, Finding
from bristle.page.page import Drawing
from bristle.page.report import Answer, Answered, Cell, Page, Report, Section, Table
from bristle.page.said import Link, Mark, with_places

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
    """Written twice every file is the same, and `html` is the page; a file of the user stays, and a folder that is not ours is refused.

    `frames` has each file's frame, whole.
    """
    assert {name: len(frame) for name, frame in WHOLE.frames.items()} == {"more": 2, "numbers": 2}
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


def test_pages_share_a_menu_and_a_figure_is_drawn_once(tmp_path: Path) -> None:
    """Every page links to all in their order and to its own sections; a figure on two pages has one file and two numbers."""
    curve = drawing()._replace(how="A line.")
    other = drawing()._replace(name="other", how="A line.")
    twice = (Section("one", id="one--joint", figures=(curve,)), Section("two", id="two--joint", figures=(other,)))
    pages = (Page("more.html", "More of it", HOSTILE, twice), Page("raw.html", "Raw", "as it is"))
    report = replace(
        WHOLE,
        sections=(Section("First", figure=curve),),
        pages=pages,
        files={"raw.html": b"<p>", "results.json": b"{}"},
    )
    told: list[tuple[int, int]] = []
    report.write(tmp_path / "out", lambda _, done, total: told.append((done, total)), mailed=True)
    first, more = (page_text(tmp_path / "out" / name) for name in ("index.html", "more.html"))
    for page in (first, more):
        links = [page.index(f'<li><a href="{name}"') for name in ("index.html", "more.html", "raw.html")]
        assert links == sorted(links)
    assert page_text(tmp_path / "out" / "index.html").count('<a href="results.json">') == 1
    assert first.count("Figure 1</a>") == more.count("Figure 2</a>") == more.count("Figure 3</a>") == 1
    assert first.count("A line.") == more.count("A line.") == 1
    assert '<a href="#one--joint">one</a>' in more
    assert '<section id="two--joint">' in more
    assert (tmp_path / "out" / "raw.html").read_bytes() == b"<p>"
    assert {path.name for path in (tmp_path / "out" / "figures").iterdir()} == {
        f"{name}.{kind}" for name in ("line", "other") for kind in ("svg", "png", "csv")
    }
    assert (tmp_path / "out" / "report.zip").is_file()
    assert told == [(0, 2), (1, 2), (0, 1)]


def test_an_answer_has_verdict_values_and_what_stands_beside_them(tmp_path: Path) -> None:
    """Each thing begins with its name as a link and its verdict; a row has a cell a column, with what stands below; text stays text.

    Beside its rows stands once what holds of them all, a picture too, under a heading; of what is not known there is nothing, not its name either.
    """
    cells = Cell("1.50 ± 0.02", ("[1.46, 1.54]",)), Cell(HOSTILE)
    beside = Cell("3 %", ("held out",)), Cell(), drawing()
    found = Finding("strays", CAUTION, HOSTILE)
    thing = Answered(
        Link(HOSTILE, "more.html#x"), (Mark("do not use", good=False), found), (("+", cells), ("-", cells)), beside
    )
    answer = Answer("dir.", (("alpha_0", "N·m"), ("v_s", "")), (thing,), ("error", "rest", "curve"), "How.")
    page = page_text(replace(WHOLE, sections=(Section("", answer=answer),)).write(tmp_path / "out"))
    assert "<script" not in page
    assert '<span class="mark bad">do not use</span>.' in page
    assert '<a href="more.html#x">&lt;/p&gt;' in page
    assert '<td data-label="α₀ (N·m)">1.50 ± 0.02<span class="below">[1.46, 1.54]</span></td>' in page
    assert 'href="#warning-strays"' in page
    assert '<th scope="rowgroup" colspan="6">' in page
    assert (
        page.count('<td class="whole" rowspan="2" data-label="error">3 %<span class="below">held out</span></td>') == 1
    )
    assert page.count('<td class="whole" rowspan="2"></td>') == 1
    assert page.count("<svg") == page.count('<td class="small" rowspan="2">') == 1
    assert "<figure" not in page


def test_facts_and_findings_say_what_they_are_about(tmp_path: Path) -> None:
    """A fact follows its name; a finding stands once after all its subjects, and begins with Critical where it is."""
    found = [
        Finding("strays", CRITICAL, "Two.", subject=("static", "+")),
        Finding("strays", CRITICAL, "Two.", subject=("static", "-")),
        Finding("prior", NOTE, "Three."),
    ]
    assert [where for where, _ in with_places(found)] == ["static (+), static (−)", ""]
    section = Section("Some", facts=(("files", ("two", Link("here", "#x"))),), findings=tuple(found))
    page = page_text(replace(WHOLE, sections=(section,)).write(tmp_path / "out"))
    assert '<dt>files</dt><dd>two <a href="#x">here</a></dd>' in page
    assert page.count("<strong>Critical, static (+), static (−)</strong>: Two.") == 1
    assert 'href="#warning-prior"' not in page
    page = page_text(replace(WHOLE, sections=(replace(section, coded=True),)).write(tmp_path / "out"))
    assert 'href="#warning-prior"' in page


def test_a_column_that_says_nothing_is_not_shown() -> None:
    """What is empty in every row is left out of the page's table, and false is not empty; without rows all columns stay."""
    frame = pd.DataFrame(
        {"a": [1, 2], "none": [None, float("nan")], "": ["", ""], "no": [False, False], "said": [(), ()]}
    )
    assert Table("t", "T", frame).cells.columns == ("a", "no")
    assert Table("t", "T", frame[:0]).cells.columns == ("a", "none", "", "no", "said")
