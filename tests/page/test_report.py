import csv
import io
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bristle.findings import CAUTION, CRITICAL, NOTE, Finding
from bristle.page.figure_data import csv_of
from bristle.page.page import Drawing
from bristle.page.plain import to_csv
from bristle.page.report import Answer, Answered, Cell, Page, Report, Section, Table
from bristle.page.said import Link, Mark

from ..pages import assert_tables_are_named, page_text

HOSTILE = "</p><script>alert('1')</script> {{ 7 * 7 }} & \x1b[31m\ud800"
FRAME = pd.DataFrame({"parameter": ["alpha_0", HOSTILE[:-1]], "=cmd()": [1.5, None], "text": ["=1+1", "+"]})


def drawing(caption: str = "One line rises by 1.") -> Drawing:
    def draw() -> Figure:
        figure = Figure()
        figure.subplots().plot([0, 1], [0, 1], label="a line")
        return figure

    return Drawing(draw, "line", HOSTILE, caption)


def finding(text: str) -> Section:
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
    # headings, paragraphs, the answer in bold, SIMULATED, seed, codes with their entries; each id once, each figure with its data
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
    # a title alone is a section, a table without rows only a file, a figure that draws nothing none; without sections a page is one too
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


def test_what_stands_on_terminal_and_page(tmp_path: Path) -> None:
    """Sections of one turn come as on the page, a later turn after them; a note has no code."""
    sections = (
        replace(finding("last"), turn=1),
        Section("lines", findings=(Finding("strays", CAUTION, "unsaid"),), lines=("  a line",)),
        Section("text", text="on the page alone"),
        Section("note", findings=(Finding("y", NOTE, "No change."),)),
    )
    report = replace(WHOLE, sections=sections)
    assert report.text().splitlines() == ["  a line", str(Finding("y", NOTE, "No change.")), "last [strays]"]
    # each thing begins with its name as a link and its verdict; a row has a cell a column, with what stands below; text stays text. Beside
    # its rows stands once what holds of them all, a picture too, under a heading; of what is not known there is nothing
    cells = Cell("1.50 ± 0.02", ("[1.46, 1.54]",)), Cell(HOSTILE)
    beside = Cell("3 %", ("held out",)), Cell(), drawing()
    line = (Mark("do not use", good=False), Finding("strays", CAUTION, HOSTILE))
    thing = Answered(Link(HOSTILE, "more.html#x"), line, (("+", cells), ("-", cells)), beside)
    answer = Answer("dir.", (("alpha_0", "N·m"), ("v_s", "")), (thing,), ("error", "rest", "curve"), "How.")
    page = page_text(replace(WHOLE, sections=(Section("", answer=answer),)).write(tmp_path / "out"))
    assert "<script" not in page
    times = {
        '<span class="mark bad">do not use</span>.': 1, '<a href="more.html#x">&lt;/p&gt;': 1, 'href="#warning-strays"': 1,
        '<td data-label="α₀ (N·m)">1.50 ± 0.02<span class="below">[1.46, 1.54]</span></td>': 2, '<th scope="rowgroup" colspan="6">': 1,
        '<td class="whole" rowspan="2" data-label="error">3 %<span class="below">held out</span></td>': 1, "<svg": 1,
        '<td class="whole" rowspan="2"></td>': 1, '<td class="small" rowspan="2">': 1, "<figure": 0,
    }  # fmt: skip  # a table
    assert {part: page.count(part) for part in times} == times
    # a fact follows its name; a finding stands once after all its subjects, and begins with Critical where it is. As text it stands so, too,
    # with its codes, paragraphs, facts and table, without pictures, each cell in a terminal's letters
    twice = tuple(Finding("strays", CRITICAL, "Two.", subject=("static", d)) for d in "+-")
    frame = pd.DataFrame({"parameter": ["alpha_0"], "value": ["1.5 ± 0.1 N·m"], "no": [False], "x": [float("inf")]})
    section = Section(
        "Some", text="One.\n\nTwo.", facts=(("files", ("two", Link("here", "#x"))),), findings=(*twice, Finding("prior", NOTE, "Three.")),
        table=Table("t", "T", frame), figure=drawing(),
    )  # fmt: skip  # a list of values
    pages = [
        page_text(replace(WHOLE, sections=(x,)).write(tmp_path / "out"))
        for x in (section, replace(section, coded=True))
    ]
    for page in pages:
        assert '<dt>files</dt><dd>two <a href="#x">here</a></dd>' in page
        assert page.count("<strong>Critical, static (+), static (−)</strong>: Two.") == 1
    assert ['href="#warning-prior"' in page for page in pages] == [False, True]
    assert list(section.plain()) == [
        "  [[Some]]", "    One.", "    Two.", "    files: two here", "    critical (static +, static -): Two. [strays]",
        "    note: Three. [prior]", "    parameter  value            no  x", "    alpha_0    1.5 +/- 0.1 N*m  no  inf",
    ]  # fmt: skip  # lines
    # what is empty in every row is left out of the page's table, and false is not empty; without rows all columns stay
    frame = pd.DataFrame({"a": [1], "none": [float("nan")], "": [""], "no": [False], "said": [()]})
    assert Table("t", "T", frame).cells.columns == ("a", "no")
    assert Table("t", "T", frame[:0]).cells.columns == ("a", "none", "", "no", "said")


def test_bytes_repeat_and_nothing_else_is_replaced(tmp_path: Path) -> None:
    """Written twice every file is the same, and `html` is the page; a file of the user stays."""
    # `frames` has each file's frame, whole
    assert {name: len(frame) for name, frame in WHOLE.frames.items()} == {"more": 2, "numbers": 2}
    found = []
    for _ in range(2):
        index = WHOLE.write(tmp_path / "out")
        found.append({path.name: path.read_bytes() for path in index.parent.rglob("*") if path.is_file()})
        (index.parent / "mine.txt").write_text("mine", encoding="utf-8")
    assert found[0] == {name: data for name, data in found[1].items() if name != "mine.txt"}
    assert index.read_bytes() == WHOLE.html().encode("utf-8", "backslashreplace")
    # every page links to all in their order and to its own sections; a figure on two pages has one file and two numbers
    curve = drawing()._replace(how="A line.")
    other = drawing()._replace(name="other", how="A line.")
    twice = (Section("one", id="one--joint", figures=(curve,)), Section("two", id="two--joint", figures=(other,)))
    pages = (Page("more.html", "More of it", HOSTILE, twice), Page("raw.html", "Raw", "as it is"))
    files = {"raw.html": b"<p>", "results.json": b"{}"}
    report = replace(WHOLE, sections=(Section("First", figure=curve),), pages=pages, files=files)
    told: list[tuple[int, int]] = []
    report.write(tmp_path / "out", lambda _, done, total: told.append((done, total)), mailed=True)
    first, more = (page_text(tmp_path / "out" / name) for name in ("index.html", "more.html"))
    for page in (first, more):
        links = [page.index(f'<li><a href="{name}"') for name in ("index.html", "more.html", "raw.html")]
        assert links == sorted(links)
    assert first.count('<a href="results.json">') == 1
    assert first.count("Figure 1</a>") == more.count("Figure 2</a>") == more.count("Figure 3</a>") == 1
    assert first.count("A line.") == more.count("A line.") == 1
    assert '<a href="#one--joint">one</a>' in more
    assert '<section id="two--joint">' in more
    assert told == [(0, 2), (1, 2), (0, 1)]
    # report.zip, to be mailed, holds every file of the report but the times
    made = {
        path.relative_to(tmp_path / "out").as_posix(): path.read_bytes() for path in (tmp_path / "out").rglob("*.*")
    }
    with zipfile.ZipFile(tmp_path / "out" / "report.zip") as archive:
        held = {name: archive.read(name) for name in archive.namelist()}
    beside = {"report.zip", "mine.txt", ".bristle-manifest"}
    assert held == {name: data for name, data in made.items() if name not in beside}


Rows = list[tuple[str, str, str, str]]


def series(draw: Callable[[Axes], object]) -> Rows:
    """Series, x, y and value of each row of what a function draws on one panel."""
    figure = Figure()
    ax = figure.subplots()
    draw(ax)
    ax.set_xlabel("time (s)")
    ax.set_ylabel("torque (N·m)")
    head, *rows = csv.reader(io.StringIO(csv_of(figure).decode("utf-8")))
    assert head == ["panel", "series", "x", "y", "value"]
    assert {row[0] for row in rows} <= {"1: torque (N·m) vs time (s)"}
    return [(name, x, y, value) for _, name, x, y, value in rows]


@given(arrays(float, (7, 2), elements=st.floats(-1e9, 1e9, width=32)))
def test_a_line_is_read_back(points: "np.ndarray[tuple[int, int], np.dtype[np.float64]]") -> None:
    """The points of a line, to seven digits, in their order."""
    rows = series(lambda ax: ax.plot(*points.T, label="measured"))
    assert {name for name, *_ in rows} == {"measured"}
    np.testing.assert_allclose([[float(x), float(y)] for _, x, y, _ in rows], points, rtol=1e-6)


MARKS: list[tuple[Callable[[Axes], object], Rows]] = [
    (lambda ax: ax.plot([1], [2], label="_hidden"), [("hidden", "1", "2", "")]),
    (lambda ax: ax.plot([1], [2]), [("line 1", "1", "2", "")]),
    (lambda ax: ax.axvline(3.0, label="limit"), [("limit", "3", "", "")]),
    (lambda ax: ax.axhline(3.0, label="level"), [("level", "", "3", "")]),
    (lambda ax: ax.scatter([1], [2], label="points"), [("points", "1", "2", "")]),
    (lambda ax: ax.plot([1, 2], [np.nan, 2], label="gap"), [("gap", "1", "", ""), ("gap", "2", "2", "")]),
    (lambda ax: ax.bar([0, 1], [5, 6], tick_label=["wrist", "elbow"], label="rms"), [("rms", "wrist", "5", ""), ("rms", "elbow", "6", "")]),
    (lambda ax: ax.barh([0, 1], [5, 6], tick_label=["wrist", "elbow"], label="rms"), [("rms", "5", "wrist", ""), ("rms", "6", "elbow", "")]),
    (lambda ax: ax.imshow([[1.5, 2.5]], label="map"), [("map", "0", "0", "1.5"), ("map", "1", "0", "2.5")]),
    (lambda ax: ax.pcolormesh([0, 1, 2], [0, 2], [[1.5, 2.5]], label="map"), [("map", "0.5", "1", "1.5"), ("map", "1.5", "1", "2.5")]),
    (lambda ax: ax.vlines([1], 2, 3, label="edges"), [("edges", "1", "2", ""), ("edges", "1", "3", "")]),
    (lambda ax: ax.plot([1], [2], label='=cmd|" /C calc"!A0'), [('\'=cmd|" /C calc"!A0', "1", "2", "")]),
    (lambda ax: ax.text(0, 0, "a word") and ax.legend(handles=[]), []),
]  # fmt: skip  # a table


def test_a_mark_is_a_row_for_each_of_its_places() -> None:
    """Lines, points, bars, maps and limits, under their names; words, legends and frames are no data; no name is a formula."""
    assert [(series(draw), expected) for draw, expected in MARKS if series(draw) != expected] == []


def test_the_data_of_bars_maps_and_tables() -> None:
    """The ends of a bar stand under the label that the whole was given."""
    rows = series(lambda ax: ax.errorbar([1.0], [2.0], [0.5], capsize=2, label="points"))
    assert {name for name, *_ in rows} == {"points"}
    assert {y for _, _, y, _ in rows} >= {"1.5", "2", "2.5"}
    # two lines of one name would otherwise be joined by whoever draws them anew
    rows = series(lambda ax: [ax.plot([k, k + 1], [k, k], label="run") for k in (0, 5)])
    assert rows[2] == ("run", "", "", "")
    # the numbers of a map stand once, not as its scale too
    figure = Figure()
    ax = figure.subplots()
    figure.colorbar(ax.imshow([[1.0, 2.0]]), ax=ax)
    rows = list(csv.reader(io.StringIO(csv_of(figure).decode())))[1:]
    assert [row[0] for row in rows] == ["1: ", "1: "]
    # numbers, among texts too, what is missing, and truth values are written as pandas writes them
    # a text with line ends of any kind stays one cell; of two columns of one name both are written
    frame = pd.DataFrame({"x": [-1.5, float("nan"), float("-inf")], "y": [-2, "=1", None], "z": [True, False, True]})
    assert cells(frame)[1:] == [["-1.5", "-2", "True"], ["", "'=1", "False"], ["-inf", "", "True"]]
    assert cells(pd.DataFrame({"x": ["a\r=1", "a\r\n=1"]})) == [["x"], ["a\n=1"], ["a\n=1"]]
    frame = pd.DataFrame([["=a", -1.0], ["b", 2.0]], columns=["x", "x"])
    assert cells(frame) == [["x", "x"], ["'=a", "-1.0"], ["b", "2.0"]]
    # no other file of the package calls a writer of CSV, so that none forgets the formulas
    writers = (".to_csv(", "csv.writer", "savetxt")
    lines = [(p.name, line) for p in SOURCE.rglob("*.py") for line in p.read_text(encoding="utf-8").splitlines()]
    code = [(name, line) for name, line in lines if not line.strip().startswith(">>>")]  # examples are a user's
    found = {name for name, line in code if any(x in line for x in writers)}
    assert sorted(found) == ["plain.py"]


SOURCE = Path(__file__).parents[2] / "src" / "bristle"
FORMULAS = [
    '=HYPERLINK("http://x")', "+1+cmd|' /C calc'!A0", "-2+3", "@SUM(1)", "\t=1", "\r=1", "\n=1", "--", "+-", "=", "-x",
]  # fmt: skip  # a list of values
PLAIN = ["+", "-", "-1.5", "+2", "-1e-5", "-.5", "wrist", "a=b", "'=1", "a\n=1", "", "α₀ (−)"]


def cells(frame: pd.DataFrame) -> list[list[str]]:
    return list(csv.reader(io.StringIO(to_csv(frame), newline="")))


@pytest.mark.parametrize("dtype", [object, "str", "category"])
def test_no_text_is_a_formula(dtype: str) -> None:
    """A text, header included, that a spreadsheet would run gets an apostrophe; directions, numbers and other texts stay as they are."""
    frame = pd.DataFrame({"=1": pd.Series(FORMULAS + PLAIN, dtype=dtype)})
    assert cells(frame)[1:] == [["'" + x.replace("\r", "\n")] for x in FORMULAS] + [[x] for x in PLAIN]
    assert cells(frame)[0] == ["'=1"]
