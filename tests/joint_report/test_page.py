import re
import xml.etree.ElementTree as ET
from dataclasses import replace
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
from bristle.questions.joint_report import static_figures
from bristle.questions.joint_report.brief import outcomes
from bristle.questions.joint_report.report import full_text, report
from bristle.questions.joint_report.sentences import known_to

from ..conftest import present
from ..pages import page_text, report_text
from .conftest import HOSTILE, gripper, listed, nothing_seen, only, sections_of, write_report
from .moving import CORRELATED, DIFFER, NOT_SHOWN, UNSEEN, moving

OPEN = Finding("open-cycles", CAUTION, "1 of 1 hysteresis cycles not closed.")


NAMES = (
    "summary", "a", "a-curve", "a--curve", r"\g<0>", r"\1\q", r"$\undefined{", '" onload="alert(1)" x="', "</svg><script>", "url(#x)",
    '<b id="summary">', "{{ 7 * 7 }}",
)  # fmt: skip  # a list
"""Of joints: words that the page uses itself, of each other's figures, and templates of regular expressions, mathtext, HTML, SVG and Jinja."""


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory, slide: Joint) -> Path:
    """The folder of a report of a joint with every stage, a hostile name and file names, and of bare ones with other names."""
    joint = moving(HOSTILE, HOSTILE)
    joint = replace(joint, inputs=tuple(replace(x, file=HOSTILE) for x in joint.inputs))
    folder = tmp_path_factory.mktemp("report")
    write_report([slide, joint, *(replace(slide, name=name) for name in NAMES)], folder, title=HOSTILE)
    return folder


class Elements(HTMLParser):
    """Every element with its attributes."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str]]] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, {name: value or "" for name, value in attrs}))


def test_a_page_stands_alone_and_is_whole(written: Path) -> None:
    """A page stands alone: no script but ours, no image, no style sheet; links lead to its pages and to files in its folder that are there."""
    # inline figures share no id on a page, and every link and every reused shape has a target, on other pages too
    pages = {path.name: Elements(page_text(path)).found for path in written.glob("*.html")}
    ids = {name: [attrs["id"] for _, attrs in found if "id" in attrs] for name, found in pages.items()}
    labels = []
    for name, found in pages.items():
        assert not {tag for tag, _ in found} & {"script", "b", "link", "img", "iframe", "object", "image"}
        assert not [key for _, attrs in found for key in attrs if key.startswith("on")]
        assert len(ids[name]) == len(set(ids[name]))
        refs = [v for _, attrs in found for k, v in attrs.items() if k in {"src", "href", "xlink:href"}]
        assert [x for x in refs if x[0] != "#" and not (written / x.partition("#")[0]).is_file()] == []
        assert [x for x in refs if "#" in x and x.partition("#")[2] not in ids[x.partition("#")[0] or name]] == []
        drawings = [attrs for tag, attrs in found if tag == "svg"]
        labels += [attrs["aria-label"] for attrs in drawings]
        assert {key for attrs in drawings for key in attrs} <= {
            "role", "aria-label", "aria-describedby", "viewbox", "xmlns:xlink", "xmlns", "version",
        }  # fmt: skip  # a list of words
    assert {f"curve of {name}" for name in NAMES} <= {*labels}
    # markup in a joint's name, a title or a file name is text everywhere, in the page and in the SVG files, which stay well-formed
    text = report_text(written)
    assert "<script" not in text
    assert text.count("&lt;script&gt;") > 10
    for path in (written / "figures").glob("*.svg"):
        assert ET.fromstring(path.read_bytes()).tag.endswith("svg")  # noqa: S314 # our own file
    # the pages have each section of the report, and say SIMULATED at the top and in each caption of such a joint. Of slow loading they name
    # the methods, the one to use, the bias, the level and its source, the prior and the outlier; of moving runs each fit with its errors
    # and starts, bias that matters and none that does not, hold-outs, verdicts and stages
    sections = {
        "index.html": ("Versions", "Method"),
        "joints.html": ("Parameters of", "Full nonlinear fit", "caution", "Files and what was done", "segments kept", "Held-out runs",
                        "RMS residual", "Correlations above", "Fig. 1", "segment 2 of 2", "parametric bootstrap", str(DIFFER), str(NOT_SHOWN)),
        "presliding.html": (METHODS["printed"], METHODS["edges"], "from encoder transitions; insensitive to where inside a count the joint rests",
                            "from the static fit",
                            "of an assumed damping ratio", "median breakaway torque", "is an outlier", "loss per cycle (J)",
                            "1 more are in the table"),
        "moving.html": ("Moving runs", "Joint fit", "Relative error 1.25 %", "3 of 4 starts", "Initialised at the other stages",
                        "1701 samples, 2 segments", "-0.02 N·m/rad (-0.3 standard errors)", str(escape(HOSTILE)), "thinned to 400 points"),
    }  # fmt: skip  # words by page
    lacking = []
    for name, words in sections.items():
        page = text if name in {"index.html", "joints.html"} else page_text(written / name)
        lacking += [(name, x) for x in words if x not in page]
    assert lacking == []
    assert "0.0001 N·m/rad" not in page_text(written / "moving.html")
    captions = re.findall(r"<figcaption[^>]*>(.*?)</figcaption>", text, flags=re.DOTALL)
    assert sum("<strong>SIMULATED" in caption for caption in captions) == 8
    assert len(captions) == 8 + 3 + len(
        NAMES
    )  # the paper's, and those of bare joints, of which one stands on two pages
    assert text.index("SIMULATED") < text.index('<table class="answer">')
    assert "∞" in text


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
    # a parameter's name, from a foreign file too, becomes a symbol without an element of its own
    names = ("v_", "α_", "alpha_", "v_<b>", "<b>", "", "+", r"\074b\076")
    assert [name for name in names if "<b>" in symbol_html(name)] == []


def test_sections_and_warnings_stand_in_their_place(joint: Joint, tmp_path: Path, slow: Joint) -> None:
    """Without a stage there is no section, figure or table of it, and every link of what is left has its target."""
    nothing: dict[str, Any] = {"static": {}, "crosscheck": {}, "segments": ()}
    alone = {
        "static": joint,
        "moving": replace(moving(), presliding=None, joint_fit=None, consistency=(), **nothing),
        "slow": replace(only(slow, fits={"+": nothing_seen()}), **nothing),
        "none": replace(slow, presliding=Presliding(fits={}, breakaway={}, warnings=(OPEN,))),
    }
    texts = {}
    for name, one in alone.items():
        write_report([one], tmp_path / name)
        texts[name] = report_text(tmp_path / name)
        assert set(re.findall(r'href="#([^"]+)"', texts[name])) <= set(re.findall(r'id="([^"]+)"', texts[name]))
    absent = {
        "static": ("-presliding", "-tracking", "runs alone"), "moving": ("Do the stages agree?", "joint fit, 95 %", "runs alone"),
        "slow": ("Full nonlinear fit", "-curve.svg"), "none": ("Each breakaway",),
    }  # fmt: skip  # a table
    assert [(name, x) for name, words in absent.items() for x in words if x in texts[name]] == []
    assert "No σ₀ can be given; it is at least 12.5 N·m/rad." in texts["slow"]
    assert "no run at constant velocity was given" in texts["slow"]
    assert texts["none"].count(str(OPEN)) == 2
    # what is critical about the one solve of both directions is printed once, below the verdict, and stands first in the full report
    warning = Finding("unexplained", CRITICAL, "The relative error is 40 %.")
    static = {d: replace(fit, warnings=(warning,)) for d, fit in joint.static.items()}
    critical = replace(joint, static=static).with_subjects()
    verdict, *lines = list(outcomes([critical]))[1:]
    assert verdict.split("  ")[:2] == [joint.name, "do not use"]
    assert lines == [f"{joint.name}: {known_to(joint, '+/-')} {warning.coded}"]
    assert full_text([critical]).index("critical (") < full_text([critical]).index("How each fit ended")
    assert "critical" not in full_text([joint])
    # behind each warning stands its code, a link to what it means, why it has its severity and what to do; what does not occur has no
    # entry. The heading of a joint's cautions has their number, each counted once; notes are behind a line that counts them
    write_report([slow], tmp_path / "whole")
    text = page_text(tmp_path / "whole" / "joints.html")
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


def test_all_parameters_stand_first() -> None:
    """The parameters of the joint are all six per direction and the inertia, and the verdict counts them once."""
    shown = sections_of(moving(), "joints.html")
    titles = ("Parameters of gripper rotation", "From static and slow runs alone")
    table, alone = (present(shown[title].table) for title in titles)
    assert (len(table.cells.rows), len(alone.cells.rows)) == (13, 12)
    assert table.cells.columns[:4] == ("direction", "parameter", "value", "95 % interval")
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
    alone = present(report(joints[2:3], title="t", seed=0).sections[0].answer)
    assert alone.whole == ("curve",)
    assert not any(words in alone.note for words in ("Hold-out", "leaves"))
