import re
import xml.etree.ElementTree as ET
import zipfile
from collections import Counter
from dataclasses import replace
from functools import partial
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from markupsafe import escape
from matplotlib.figure import Figure

from bristle.data.record import Record
from bristle.findings import CAUTION, CRITICAL, Finding
from bristle.identification.fits import Presliding
from bristle.identification.results import Accuracy, Joint
from bristle.page.page import save_figure, symbol_html
from bristle.page.report import Cell
from bristle.page.said import by_code
from bristle.page.style import inline, render_as, styled
from bristle.page.wording import METHODS
from bristle.questions.joint_report import figures, static_figures
from bristle.questions.joint_report.brief import outcomes
from bristle.questions.joint_report.report import report
from bristle.questions.joint_report.sentences import known_to
from bristle.questions.joint_report.text import fit_report

from ..conftest import all_drawn, present
from ..pages import page_text, report_text
from .conftest import HOSTILE, gripper, listed, nothing_seen, only, sections_of, write_report
from .moving import CORRELATED, DIFFER, NOT_SHOWN, UNSEEN, moving

OPEN = Finding("open-cycles", CAUTION, "1 of 1 hysteresis cycles not closed.")


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory, slide: Joint) -> Path:
    """The folder of a report of a bare joint and one with every stage, a hostile name and file names."""
    joint = moving(HOSTILE, HOSTILE)
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
        self.found.append((tag, dict(attrs)))


@pytest.fixture(scope="module")
def elements(written: Path) -> dict[str, list[tuple[str, dict[str, str | None]]]]:
    found = {}
    for path in written.glob("*.html"):
        parser = Elements()
        parser.feed(page_text(path))
        found[path.name] = parser.found
    return found


@pytest.mark.usefixtures("raster")
def test_two_writes_give_the_same_bytes_and_progress_keeps_its_total(tmp_path: Path) -> None:
    """A report is a function of its joints: no time, no path, no random id in it. Steps count up to their total."""
    # report.zip, to be mailed, holds every file of the folder but the times, with figures of every kind
    seen: list[tuple[int, int]] = []
    trees = []
    for name in ("a", "b"):
        path = write_report(
            [moving(HOSTILE, HOSTILE)], tmp_path / name, lambda _, done, total: seen.append((done, total)),
            files={"timings.json": b"{}"}, mailed=True,
        )  # fmt: skip  # a list of values
        assert path == tmp_path / name / "index.html"
        found = (tmp_path / name).rglob("*")
        trees.append({p.relative_to(tmp_path / name).as_posix(): p.read_bytes() for p in found if p.is_file()})
    assert trees[0] == trees[1]
    total = seen[0][1]
    assert total >= 4
    assert seen == 2 * [*((k, total) for k in range(total)), (0, 1)]
    assert not [p for p, data in trees[0].items() if str(tmp_path).encode() in data]
    with zipfile.ZipFile(tmp_path / "a" / "report.zip") as archive:
        held = {name: archive.read(name) for name in archive.namelist()}
    beside = ("report.zip", "timings.json", ".bristle-manifest")
    assert held == {name: data for name, data in trees[0].items() if name not in beside}


def test_a_page_stands_alone_and_is_whole(
    elements: dict[str, list[tuple[str, dict[str, str | None]]]], written: Path
) -> None:
    """A page stands alone: no script but ours, no image, no style sheet; links lead to its pages and to files in its folder that are there."""
    for found in elements.values():
        assert not {tag for tag, _ in found} & {"script", "link", "img", "iframe", "object", "image"}
        refs = [v or "" for _, attrs in found for k, v in attrs.items() if k in {"src", "href", "xlink:href"}]
        assert refs
        assert [
            ref for ref in refs if not ref.startswith("#") and not (written / ref.partition("#")[0]).is_file()
        ] == []
    # inline figures share no id on a page, and every link and every reused shape has a target, on other pages too
    ids = {name: [attrs["id"] for _, attrs in found if "id" in attrs] for name, found in elements.items()}
    for name, found in elements.items():
        assert len(ids[name]) == len(set(ids[name]))
        refs = [v or "" for _, attrs in found for k, v in attrs.items() if k in {"href", "xlink:href"}]
        for page_of, _, target in (ref.partition("#") for ref in refs if "#" in ref):
            assert target in ids[page_of or name]
    # markup in a joint's name, a title or a file name is text everywhere, in the page and in the SVG files, which stay well-formed
    text = report_text(written)
    assert "<script" not in text
    assert text.count("&lt;script&gt;") > 10
    for path in (written / "figures").glob("*.svg"):
        assert ET.fromstring(path.read_bytes()).tag.endswith("svg")  # noqa: S314 # our own file
    # the pages have each section of the report, and say SIMULATED at the top and in each caption of such a joint. Of slow loading they name
    # the methods, the one to use, the bias, the level and its source, the prior, the outlier, and why slopes differ; of moving runs each
    # fit with its errors and starts, bias that matters and none that does not, hold-outs, verdicts and stages
    sections = {
        "index.html": ("Versions", "Method"),
        "joints.html": ("Parameters of", "Full nonlinear fit", "caution", "What to measure next", "Files and what was done", "segments kept",
                        "Held-out runs", "RMS residual", "Fig. 1", "from 4.75 to 7.75 s", "segment 2 of 2", "parametric bootstrap", str(DIFFER),
                        str(NOT_SHOWN)),
        "presliding.html": (METHODS["printed"], METHODS["edges"], "from encoder transitions; insensitive to where inside a count the joint rests",
                            "-2.4 % where the joint rests", "-51 % on average, with a spread of 28 %", "from the static fit",
                            "of an assumed damping ratio", "median breakaway torque", "is an outlier", "differ because the loop is wide",
                            "loss per cycle (J)", "1 more are in the table"),
        "moving.html": ("Moving runs", "Joint fit", "Relative error 1.25 %", "3 of 4 starts", "Initialised at the other stages",
                        "1701 samples, 2 segments", "-0.02 N·m/rad (-0.3 standard errors)", str(escape(HOSTILE)),
                        "thinned to 400 points"),
    }  # fmt: skip  # words by page
    lacking = []
    for name, words in sections.items():
        page = text if name in {"index.html", "joints.html"} else page_text(written / name)
        lacking += [(name, x) for x in words if x not in page]
    assert lacking == []
    assert "0.0001 N·m/rad" not in page_text(written / "moving.html")
    captions = re.findall(r"<figcaption[^>]*>(.*?)</figcaption>", text, flags=re.DOTALL)
    for name, figures_there in (("presliding.html", 2), ("moving.html", 1)):
        own = re.findall(r"<figcaption[^>]*>(.*?)</figcaption>", page_text(written / name), flags=re.DOTALL)
        assert ["<strong>SIMULATED" in caption for caption in own] == [True] * figures_there
    assert sum("<strong>SIMULATED" in caption for caption in captions) == 7
    assert [x for x in captions if "SIMULATED" not in x and "slide" not in x and "Fig. 1" not in x] == []
    assert text.index("SIMULATED") < text.index('<table class="answer">')
    assert "∞" in text
    # each figure is there as SVG and PNG, each table as CSV, and the results as JSON
    names = {p.relative_to(written).as_posix() for p in written.rglob("*") if p.is_file()}
    svg = {n[:-4] for n in names if n.endswith(".svg")}
    assert svg == {n[:-4] for n in names if n.endswith(".png")}
    assert len(svg) == 1 + 2 + 8
    assert {"results.json", "tables/parameters.csv", "tables/segments.csv", "tables/points.csv"} <= names
    assert b"matplotlib" not in b"".join((written / f"{n}.png").read_bytes()[:200] for n in svg)


NAMES = (
    "verdict", "summary", "versions", "fig1", "compensation", "method", "joint", "a", "a-curve", "a curve", "a--curve", "a-uncertainty",
    r"\074script\076alert(1)\074/script\076", r"\q", r"\g<0>", r"\1", r"$\undefined{", '" onload="alert(1)" x="', "</svg><script>", "url(#x)",
    ' id="x', '<b id="summary">', "{{ 7 * 7 }}", "&lt;i&gt;", "-->", "]]>",
)  # fmt: skip  # a table
"""Of joints: words that the page uses itself, of each other's figures, and templates of regular expressions, HTML, SVG, mathtext and Jinja."""


@pytest.mark.slow
def test_no_name_makes_an_element_or_an_attribute(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Elements and attributes of the page are those of plain names; what names a figure for the blind is each joint's name as it is."""
    # no name gives two elements one id, and every link and reused shape has its target
    nothing = dict.fromkeys(figures.DRAW, lambda _: None)
    monkeypatch.setattr(figures, "DRAW", {**nothing, "curve": static_figures.curve_figure})
    drawn = "bristle.questions.joint_report.interval_sections.figures"
    monkeypatch.setattr(drawn, lambda _: {"curve": partial(static_figures.stribeck_figure)})
    write_report([gripper(name) for name in NAMES], tmp_path, title=NAMES[12])
    assert len(list((tmp_path / "figures").glob("*.svg"))) == 1 + 2 * len(NAMES)
    text = page_text(tmp_path / "joints.html")
    page = Elements()
    page.feed(text)
    attributes = [(name, value or "") for _, attrs in page.found for name, value in attrs.items()]
    assert not {tag for tag, _ in page.found} & {"script", "b", "link", "img"}
    assert not [name for name, _ in attributes if name.startswith("on")]
    drawings = [attrs for tag, attrs in page.found if tag == "svg"]
    assert {name for attrs in drawings for name in attrs} == {
        "role", "aria-label", "aria-describedby", "viewbox", "xmlns:xlink", "xmlns", "version",
    }  # fmt: skip  # a list of words
    labels = [attrs["aria-label"] or "" for attrs in drawings]
    assert [x for x in labels if x.startswith("curve of ")] == [f"curve of {name}" for name in NAMES]
    assert ">url(#x)" in text  # shown as it is, with no figure's prefix
    ids = Counter(value for name, value in attributes if name == "id")
    assert [x for x, n in ids.items() if n > 1] == []
    links = {value[1:] for name, value in attributes if name in {"href", "xlink:href"} and value[:1] == "#"}
    reused = {x for name, value in attributes if name != "aria-label" for x in re.findall(r"url\(#([^)]*)\)", value)}
    assert (links | reused) - set(ids) == set()


def test_an_image_drawn_twice_has_two_ids(tmp_path: Path, slide: Joint, record: Record) -> None:
    """Matplotlib names an image by its content; on the page the second of two equal ones has an id of its own, and no other id changes."""
    figure = Figure()
    for left in (0.0, 0.5):
        figure.add_axes((left, 0.0, 0.5, 1.0)).imshow(np.zeros((2, 2)), aspect="auto")
    text = inline(styled(lambda: render_as(figure, "svg"))(), "p", "label")
    ids = re.findall(r'\sid="([^"]*)"', text)
    images = [name for name in ids if "image" in name]
    assert len(ids) == len(set(ids))
    assert images == [images[0], f"{images[0]}-2"]
    # a label is put into the element as it is, and text that looks like a reference stays as it was; ids and references get the prefix
    svg = b'<?xml?><svg height="1" width="2" height="3" id="f"><text>url(#a) id="b</text><use href="#f" clip-path="url(#c)"/></svg>'
    assert inline(svg, "p", r"\074 \g<0> \q") == (
        r'<svg role="img" aria-label="\074 \g<0> \q" height="1"  id="p-f"><text>url(#a) id="b</text><use href="#p-f" clip-path="url(#p-c)"/></svg>'
    )
    # names tell joints apart; nothing is written where they cannot
    with pytest.raises(ValueError, match="different names"):
        write_report([slide, slide], tmp_path / "out")
    assert not (tmp_path / "out").exists()
    # a figure lands as the kind that its name says; any other kind is refused
    figure = static_figures.inspect_figure([record], (), "revolute")
    save_figure(figure, tmp_path / "a.png")
    assert (tmp_path / "a.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    with pytest.raises(ValueError, match=r"\.svg or \.png"):
        save_figure(Figure(), tmp_path / "a.pdf")


@pytest.mark.parametrize("name", ["v_", "α_", "alpha_", "v_<b>", "<b>", "", "+", r"\074b\076"])
def test_any_parameter_has_a_symbol(name: str) -> None:
    """A parameter's name, from a foreign file too, becomes a symbol without an element of its own."""
    assert "<b>" not in symbol_html(name)


def test_sections_and_warnings_stand_in_their_place(joint: Joint, tmp_path: Path, slow: Joint, slide: Joint) -> None:
    """Without slow loading and moving runs there is no section of them, no link to one, no figure, and no table of fits without them."""
    write_report([joint], tmp_path)
    text = report_text(tmp_path)
    assert "-presliding" not in text
    assert not re.search(r"rotation-{1,2}tracking", text)
    assert {p.name for p in (tmp_path / "figures").glob("*.svg")} == {
        "paper-fig1-stribeck.svg", "gripper-rotation-curve.svg", "gripper-rotation-profile.svg", "gripper-rotation-residuals.svg",
        "gripper-rotation-small.svg",
    }  # fmt: skip  # a list of names
    assert "From static and slow runs alone" not in sections_of(joint, "joints.html")
    # without any other stage the page has its section, no empty one, no comparison and no column of a joint fit; its links land
    nothing: dict[str, Any] = {"static": {}, "crosscheck": {}, "segments": ()}
    alone = {
        "moving": replace(moving(), presliding=None, joint_fit=None, consistency=(), **nothing),
        "slow": replace(only(slow, fits={"+": nothing_seen()}), **nothing),
        "none": replace(slow, presliding=Presliding(fits={}, breakaway={}, warnings=(OPEN,))),
    }
    texts = {}
    for name, one in alone.items():
        write_report([one], tmp_path / name)
        texts[name] = report_text(tmp_path / name)
        assert set(re.findall(r'href="#([^"]+)"', texts[name])) <= set(re.findall(r'id="([^"]+)"', texts[name]))
    for words in ("Do the stages agree?", "joint fit, 95 %", "alone</summary>"):
        assert words not in texts["moving"]
    assert "No σ₀ can be given; it is at least 12.5 N·m/rad." in texts["slow"]
    assert "no run at constant velocity was given" in texts["slow"]
    assert "Full nonlinear fit" not in texts["slow"]
    assert not list((tmp_path / "slow" / "figures").glob("*-curve.svg"))
    assert texts["none"].count(str(OPEN)) == 2
    assert "Each breakaway" not in texts["none"]
    # what is critical about the one solve of both directions is printed once, below the verdict
    warning = Finding("unexplained", CRITICAL, "The relative error is 40 %.")
    static = {d: replace(fit, warnings=(warning,)) for d, fit in joint.static.items()}
    verdict, *lines = list(outcomes([replace(joint, static=static).with_subjects()]))[1:]
    assert verdict.split("  ")[:2] == [joint.name, "do not use"]
    assert lines == [f"{joint.name}: {known_to(joint, '+/-')} {warning.coded}"]
    # behind each warning stands its code, a link to what it means, why it has its severity and what to do; what does not occur has no
    # entry. The heading of a joint's cautions has their number, each counted once; notes are behind a line that counts them
    write_report([slow], tmp_path)
    text = page_text(tmp_path / "joints.html")
    codes = set(re.findall(r'<a class="code" href="#warning-([a-z0-9-]+)">\1</a>', text))
    assert {x.code for x in slow.all_warnings()} <= codes
    entries = text[text.index("What these warnings mean") :]
    assert set(re.findall(r'<dt id="warning-([a-z0-9-]+)">', entries)) == codes
    for reason in {by_code(x.code).reason for x in slow.all_warnings()}:
        assert str(escape(reason)) in entries
    for severity, found in (("caution", r"<h3>(\d+) caution"), ("note", r"<summary>(\d+) note")):
        count = len({str(x) for x in slow.all_warnings() if x.severity == severity})
        assert [int(n) for n in re.findall(found, text)] == [count] * bool(count)
    # warnings of a fit, of a parameter, of runs as a whole, and stages that differ stand in the list with what they are about
    found = listed(moving().with_subjects())
    places = {
        "few-counts": "presliding (+)", "outlier": "presliding", "prior": "presliding (+) sigma_1, presliding (−) sigma_1",
        str(CORRELATED): "moving runs", str(UNSEEN): "moving runs alpha_1-", str(DIFFER): "static stage and moving runs alpha_0-",
    }  # fmt: skip  # a table
    assert places.items() <= found.items()
    assert "presliding (+) sigma_0 printed" in found["whole-count"]
    # the first lines of a joint are its critical sentences, each whole once; a long sentence that recurs is shortened
    lines = fit_report([slide]).splitlines()
    assert lines[1].startswith("    critical: ")
    long = [line.strip("() ") for line in lines if len(line) > 90]
    assert len(long) == len(set(long))
    assert "critical" not in fit_report([joint])


def test_all_parameters_stand_first() -> None:
    """The parameters of the joint are all six per direction and the inertia, and the verdict counts them once."""
    shown = sections_of(moving(), "joints.html")
    table, alone = shown["Parameters of gripper rotation"].table, shown["From static and slow runs alone"].table
    assert table is not None
    assert alone is not None
    assert (len(table.cells.rows), len(alone.cells.rows)) == (13, 12)
    assert table.cells.columns[:3] == ("direction", "parameter", "source")
    assert dict(shown["How each fit ended"].facts)["truth"] == "12 of 12 true values lie inside their 95 % intervals."
    # the hold-out error, and what is left of friction, a quarter of the torque here, in held-out or else in fitted runs; once each. Nothing
    # where they are not known, as the latter where averages at constant velocity are fitted, and no column that has nothing
    accuracy = Accuracy(slowest=0.02, fastest=0.8, band=1.0, statistical=1.0, apart=0.0, share=0.25)
    averaged = replace(gripper("averaged"), accuracy=accuracy)
    held = replace(averaged, name="held", static={d: replace(fit, segments=()) for d, fit in averaged.static.items()})
    fitted = {d: replace(fit, hold_out=(), relative_error=0.5) for d, fit in held.static.items()}
    joints = [
        held, replace(held, name="fitted", static=fitted), replace(held, name="unknown", static=fitted, accuracy=None), averaged,
    ]  # fmt: skip  # a list
    of_friction = [(), ("of friction", "in held-out runs"), ("of friction", "in fitted runs")]
    answer = present(report(joints, title="t", seed=0).sections[0].answer)
    assert answer.whole == ("hold-out error", "compensation leaves", "curve")
    assert [x.whole[:2] for x in answer.things] == [
        (Cell("1.2 %"), Cell("5 %", of_friction[1])), (Cell(), Cell("2 %", of_friction[2])), (Cell(), Cell()), (Cell("1.2 %"), Cell()),
    ]  # fmt: skip  # a table
    lines = [" ".join(map(str, x.line)) for x in answer.things]
    assert [("held-out" in line, "within 0.5 %" in line, "of friction" in line) for line in lines] == [
        (False, False, False), (False, True, False), (False, False, False), (False, False, False),
    ]  # fmt: skip  # a table
    alone = present(report(joints[2:3], title="t", seed=0).sections[0].answer)
    assert alone.whole == ("curve",)
    assert not any(words in alone.note for words in ("Hold-out", "leaves"))
