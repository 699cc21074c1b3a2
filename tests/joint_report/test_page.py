import re
import xml.etree.ElementTree as ET
import zipfile
from collections import Counter
from dataclasses import replace
from functools import partial
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from markupsafe import escape
from matplotlib.figure import Figure

from bristle.data.record import Record
from bristle.findings import CRITICAL, Finding
from bristle.identification.results import Joint
from bristle.page.entries import by_code
from bristle.page.page import save_figure, symbol_html
from bristle.page.style import inline, render_as, styled
from bristle.questions.joint_report import figures, static_figures
from bristle.questions.joint_report.console import outcomes
from bristle.questions.joint_report.sentences import known_to
from bristle.questions.joint_report.text import fit_report

from ..conftest import all_drawn
from ..pages import page_text, report_text
from .conftest import HOSTILE, gripper, write_report


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory, slide: Joint) -> Path:
    """The folder of a report of a bare joint and one with a hostile name and file name."""
    joint = gripper(HOSTILE)
    joint = replace(joint, inputs=tuple(replace(x, file=HOSTILE) for x in joint.inputs))
    folder = tmp_path_factory.mktemp("report")
    with all_drawn():
        write_report([slide, joint], folder, title=HOSTILE)
    return folder


class Elements(HTMLParser):
    """Every element with its attributes."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Keep it."""
        self.found.append((tag, dict(attrs)))


@pytest.fixture(scope="module")
def elements(written: Path) -> dict[str, list[tuple[str, dict[str, str | None]]]]:
    """Of each page."""
    found = {}
    for path in written.glob("*.html"):
        parser = Elements()
        parser.feed(page_text(path))
        found[path.name] = parser.found
    return found


@pytest.mark.usefixtures("raster")
def test_two_writes_give_the_same_bytes_and_progress_keeps_its_total(tmp_path: Path, slide: Joint) -> None:
    """A report is a function of its joints: no time, no path, no random id in it. Steps count up to their total."""
    seen: list[tuple[int, int]] = []
    small = replace(slide, segments=gripper().segments)
    trees = []
    for name in ("a", "b"):
        path = write_report([small], tmp_path / name, progress=lambda _, done, total: seen.append((done, total)))
        assert path == tmp_path / name / "index.html"
        trees.append(
            {p.relative_to(tmp_path / name): p.read_bytes() for p in (tmp_path / name).rglob("*") if p.is_file()}
        )
    assert trees[0] == trees[1]
    total = seen[0][1]
    assert total >= 4
    assert seen == 2 * [*((k, total) for k in range(total)), (0, 1)]
    assert not [p for p, data in trees[0].items() if str(tmp_path).encode() in data]


def test_the_report_can_be_mailed(tmp_path: Path, slide: Joint) -> None:
    """report.zip holds every file of the folder but the times, and is the same bytes whenever it is made."""
    archives = []
    for name in ("a", "b"):
        write_report([slide], tmp_path / name, files={"timings.json": b"{}"}, mailed=True)
        archives.append((tmp_path / name / "report.zip").read_bytes())
    assert archives[0] == archives[1]
    folder = tmp_path / "a"
    made = {p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file()}
    with zipfile.ZipFile(folder / "report.zip") as archive:
        held = {name: archive.read(name) for name in archive.namelist()}
    assert set(held) == made - {"report.zip", "timings.json", ".bristle-manifest"}
    assert all((folder / name).read_bytes() == data for name, data in held.items())


def test_nothing_is_fetched(elements: dict[str, list[tuple[str, dict[str, str | None]]]], written: Path) -> None:
    """A page stands alone: no script but ours, no image, no style sheet; links lead to its pages and to files in its folder that are there."""
    for found in elements.values():
        assert not {tag for tag, _ in found} & {"script", "link", "img", "iframe", "object", "image"}
        refs = [v or "" for _, attrs in found for k, v in attrs.items() if k in {"src", "href", "xlink:href"}]
        assert refs
        assert [
            ref for ref in refs if not ref.startswith("#") and not (written / ref.partition("#")[0]).is_file()
        ] == []


def test_ids_are_unique_and_links_land(elements: dict[str, list[tuple[str, dict[str, str | None]]]]) -> None:
    """Inline figures share no id on a page, and every link and every reused shape has a target, on other pages too."""
    ids = {name: [attrs["id"] for _, attrs in found if "id" in attrs] for name, found in elements.items()}
    for name, found in elements.items():
        assert len(ids[name]) == len(set(ids[name]))
        refs = [v or "" for _, attrs in found for k, v in attrs.items() if k in {"href", "xlink:href"}]
        for page_of, _, target in (ref.partition("#") for ref in refs if "#" in ref):
            assert target in ids[page_of or name]


def test_hostile_names_come_out_escaped(written: Path) -> None:
    """Markup in a joint's name, a title or a file name is text everywhere, in the page and in the SVG files, which stay well-formed."""
    text = report_text(written)
    assert "<script" not in text
    assert text.count("&lt;script&gt;") > 5
    for path in (written / "figures").glob("*.svg"):
        assert ET.fromstring(path.read_bytes()).tag.endswith("svg")  # noqa: S314 # our own file


NAMES = (
    "verdict", "summary", "versions", "fig1", "compensation", "method", "joint", "a", "a-curve", "a curve", "a--curve", "a-uncertainty",
    r"\074script\076alert(1)\074/script\076", r"\q", r"\g<0>", r"\1", r"$\undefined{", '" onload="alert(1)" x="', "</svg><script>", "url(#x)",
    ' id="x', '<b id="summary">', "{{ 7 * 7 }}", "&lt;i&gt;", "-->", "]]>",
)  # fmt: skip  # a table
"""Of joints: words that the page uses itself, of each other's figures, and templates of regular expressions, HTML, SVG, mathtext and Jinja."""


@pytest.fixture(scope="module")
def crowded(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Elements]:
    """The page of a report of joints with such names, each with two figures, and its elements."""
    with pytest.MonkeyPatch.context() as patch:
        nothing = dict.fromkeys(figures.DRAW, lambda _: None)
        patch.setattr(figures, "DRAW", {**nothing, "curve": static_figures.curve_figure})
        drawn = "bristle.questions.joint_report.interval_sections.figures"
        patch.setattr(drawn, lambda _: {"curve": partial(static_figures.stribeck_figure)})
        patch.setattr("bristle.page.page.render", lambda figure: (render_as(figure, "svg"), b""))  # a PNG holds no name
        folder = tmp_path_factory.mktemp("crowded")
        write_report([gripper(name) for name in NAMES], folder, title=NAMES[12])
    assert len(list((folder / "figures").glob("*.svg"))) == 1 + 2 * len(NAMES)
    text = page_text(folder / "joints.html")
    found = Elements()
    found.feed(text)
    return text, found


@pytest.mark.slow
def test_no_name_makes_an_element_or_an_attribute(crowded: tuple[str, Elements]) -> None:
    """Elements and attributes of the page are those of plain names; what names a figure for the blind is each joint's name as it is."""
    text, page_elements = crowded
    found = page_elements.found
    assert not {tag for tag, _ in found} & {"script", "b", "link", "img"}
    assert {name for _, attrs in found for name in attrs if name.startswith("on")} == set()
    assert {name for tag, attrs in found if tag == "svg" for name in attrs} == {
        "role",
        "aria-label",
        "aria-describedby",
        "viewbox",
        "xmlns:xlink",
        "xmlns",
        "version",
    }
    labels = [attrs["aria-label"] for tag, attrs in found if tag == "svg"]
    assert [x for x in labels if x and x.startswith("curve of ")] == [f"curve of {name}" for name in NAMES]
    assert ">url(#x)" in text  # shown as it is, with no figure's prefix


@pytest.mark.slow
def test_ids_are_unique_whatever_joints_are_called(crowded: tuple[str, Elements]) -> None:
    """No name gives two elements one id, and every link and reused shape has its target."""
    found = crowded[1].found
    ids = Counter(attrs["id"] for _, attrs in found if "id" in attrs)
    assert [x for x, n in ids.items() if n > 1] == []
    refs = {
        (v or "")[1:]
        for _, attrs in found
        for k, v in attrs.items()
        if k in {"href", "xlink:href"} and (v or "")[:1] == "#"
    }
    refs |= {
        x
        for _, attrs in found
        for k, v in attrs.items()
        if k != "aria-label"
        for x in re.findall(r"url\(#([^)]*)\)", v or "")
    }
    assert refs - set(ids) == set()


def test_an_image_drawn_twice_has_two_ids() -> None:
    """Matplotlib names an image by its content; on the page the second of two equal ones has an id of its own, and no other id changes."""
    figure = Figure()
    for left in (0.0, 0.5):
        figure.add_axes((left, 0.0, 0.5, 1.0)).imshow(np.zeros((2, 2)), aspect="auto")
    text = inline(styled(lambda: render_as(figure, "svg"))(), "p", "label")
    ids = re.findall(r'\sid="([^"]*)"', text)
    images = [name for name in ids if "image" in name]
    assert len(ids) == len(set(ids))
    assert images == [images[0], f"{images[0]}-2"]


def test_a_figure_takes_any_label() -> None:
    """A label is put into the element as it is, and text that looks like a reference stays as it was; ids and references get the prefix."""
    svg = b'<?xml?><svg height="1" width="2" height="3" id="f"><text>url(#a) id="b</text><use href="#f" clip-path="url(#c)"/></svg>'
    assert inline(svg, "p", r"\074 \g<0> \q") == (
        r'<svg role="img" aria-label="\074 \g<0> \q" height="1"  id="p-f"><text>url(#a) id="b</text><use href="#p-f" clip-path="url(#p-c)"/></svg>'
    )


@pytest.mark.parametrize("name", ["v_", "α_", "alpha_", "v_<b>", "<b>", "", "+", r"\074b\076"])
def test_any_parameter_has_a_symbol(name: str) -> None:
    """A parameter's name, from a foreign file too, becomes a symbol without an element of its own."""
    assert "<b>" not in symbol_html(name)


def test_sections_and_simulated_notes(written: Path) -> None:
    """The page has each section of the report, and says SIMULATED at the top and in each caption of such a joint."""
    text = report_text(written)
    for heading in ("Parameters of", "Full nonlinear fit", "caution", "What to measure next", "Files and what was done", "segments kept",
                    "Method", "Versions", "Held-out runs", "RMS residual", "Fig. 1"):  # fmt: skip  # words
        assert heading in text
    captions = re.findall(r"<figcaption[^>]*>(.*?)</figcaption>", text, flags=re.DOTALL)
    assert sum("SIMULATED" in caption for caption in captions) == 3
    assert text.index("SIMULATED") < text.index('<table class="answer">')
    assert "∞" in text


def test_files_beside_the_page(written: Path) -> None:
    """Each figure is there as SVG and PNG, each table as CSV, and the results as JSON."""
    names = {p.relative_to(written).as_posix() for p in written.rglob("*") if p.is_file()}
    svg = {n[:-4] for n in names if n.endswith(".svg")}
    assert svg == {n[:-4] for n in names if n.endswith(".png")}
    assert len(svg) == 1 + 2 + 4
    assert {"results.json", "tables/parameters.csv", "tables/segments.csv", "tables/points.csv"} <= names
    assert b"matplotlib" not in b"".join((written / f"{n}.png").read_bytes()[:200] for n in svg)


def test_two_joints_of_one_name_are_refused(tmp_path: Path, slide: Joint) -> None:
    """Names tell joints apart; nothing is written where they cannot."""
    with pytest.raises(ValueError, match="different names"):
        write_report([slide, slide], tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_save_figure(tmp_path: Path, record: Record) -> None:
    """A figure lands as the kind that its name says; any other kind is refused."""
    figure = static_figures.inspect_figure([record], (), "revolute")
    save_figure(figure, tmp_path / "a.png")
    assert (tmp_path / "a.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    with pytest.raises(ValueError, match=r"\.svg or \.png"):
        save_figure(Figure(), tmp_path / "a.pdf")


def test_a_critical_sentence_stands_once_on_the_terminal(joint: Joint) -> None:
    """What is critical about the one solve of both directions is printed once, below the verdict."""
    warning = Finding("unexplained", CRITICAL, "The relative error is 40 %.")
    static = {d: replace(fit, warnings=(warning,)) for d, fit in joint.static.items()}
    verdict, *lines = list(outcomes([replace(joint, static=static).with_subjects()]))[1:]
    assert verdict.split("  ")[:2] == [joint.name, "do not use"]
    assert lines == [f"{joint.name}: {known_to(joint, '+/-')} {warning.coded}"]


def test_every_warning_on_the_page_links_to_its_entry(slow: Joint, tmp_path: Path) -> None:
    """Behind each warning stands its code, a link to what it means, why it has its severity and what to do; what does not occur has no entry."""
    write_report([slow], tmp_path / "out")
    text = page_text(tmp_path / "out" / "joints.html")
    codes = set(re.findall(r'<a class="code" href="#warning-([a-z0-9-]+)">\1</a>', text))
    assert {x.code for x in slow.all_warnings()} <= codes
    entries = text[text.index("What these warnings mean") :]
    assert set(re.findall(r'<dt id="warning-([a-z0-9-]+)">', entries)) == codes
    for reason in {by_code(x.code).reason for x in slow.all_warnings()}:
        assert str(escape(reason)) in entries


def test_warnings_are_counted_by_severity(slow: Joint, tmp_path: Path) -> None:
    """The heading of a joint's cautions has their number, each counted once; notes are behind a line that counts them."""
    write_report([slow], tmp_path / "out")
    text = page_text(tmp_path / "out" / "joints.html")
    for severity, found in (("caution", r"<h3>(\d+) caution"), ("note", r"<summary>(\d+) note")):
        count = len({str(x) for x in slow.all_warnings() if x.severity == severity})
        assert [int(n) for n in re.findall(found, text)] == [count] * bool(count)


def test_what_is_critical_stands_first_and_nothing_is_said_twice(slide: Joint, joint: Joint) -> None:
    """The first lines of a joint are its critical sentences, each whole once; a long sentence that recurs is shortened."""
    lines = fit_report([slide]).splitlines()
    assert lines[1].startswith("    critical: ")
    long = [line.strip("() ") for line in lines if len(line) > 90]
    assert len(long) == len(set(long))
    assert "critical" not in fit_report([joint])
