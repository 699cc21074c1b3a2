"""The report as HTML pages, each whole by itself, with results, figures and tables beside them."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from matplotlib.figure import Figure

from bristle.identification.results import Joint, WrittenExperiment
from bristle.page import wording
from bristle.page.page import Drawing, Drawn, Page, Rendered, Section, drawn, encoded, rendered, tables_of, write_pages
from bristle.progress import Progress, step, teller
from bristle.questions.joint_report import (
    dynamic_figures,
    interval_figures,
    presliding_figures,
    results_file,
    sections,
    static_figures,
    tables,
)
from bristle.questions.joint_report.interval_tables import rows
from bristle.workers import Share

_DRAW: dict[str, Callable[[Joint], Figure | None]] = {
    "small": static_figures.small_figure,
    "curve": static_figures.curve_figure,
    "profile": static_figures.profile_figure,
    "residuals": static_figures.residuals_figure,
    "presliding": presliding_figures.presliding_figure,
    "hysteresis": presliding_figures.hysteresis_figure,
    "tracking": dynamic_figures.course_figure,
    "tracking-velocity": dynamic_figures.velocity_figure,
    "tracking-load": dynamic_figures.load_figure,
}
_OF_STATIC = ("small", "curve")
"""Those that there are of a static fit alone; others draw nothing where there is nothing to draw."""


class _Page(NamedTuple):
    file: str
    name: str
    purpose: str
    template: str = ""
    wanted: Callable[[Joint], object] = lambda _: True
    """Whether a joint has anything for it."""


_PAGES = (
    _Page("index.html", "Answer", "which values to use", "index.html"),
    _Page("joints.html", "Joints", "per joint the parameters, the curve, the warnings, and what to measure next", "joints.html"),
    _Page(
        "presliding.html", "Presliding", "stiffness, breakaway and hysteresis from slow loading", "presliding_page.html",
        lambda joint: joint.presliding,
    ),
    _Page("moving.html", "Moving runs", "all parameters at once", "moving_page.html", lambda joint: joint.tracking),
    _Page("checks.html", "Cross-checks", "the same numbers by other routes, and other models", "checks.html"),
    _Page("uncertainty.html", "Uncertainty", "each interval three ways", "uncertainty_page.html", rows),
    _Page(
        "compensation.html", "Compensation", "what the model is worth in a loop, and adaptation: the paper's Figs 2 and 5 to 12, Table 2", "",
        lambda _: False,
    ),
    _Page("data.html", "Data", "files, segments and settings", "data.html"),
    _Page("method.html", "Method", "equations, and what the paper leaves open", "method.html"),
)  # fmt: skip  # a table


_EXPLORE = _Page("explore.html", "Explore", "the model in the hand: sliders, loops and responses that follow them")


def write_report(
    joints: Sequence[Joint],
    folder: Path,
    *,
    title: str,
    seed: int | None,
    timings: Mapping[str, float] | None = None,
    progress: Progress | None = None,
    appended: Callable[[], Section] | None = None,
    explored: Callable[[], tuple[str, Sequence[str]] | None] = lambda: None,
    experiments: Sequence[WrittenExperiment] = (),
    mailed: bool = False,
    begun: Mapping[str, Iterator[Rendered]] = MappingProxyType({}),
) -> Path:
    """Write index.html and its pages, results.json, figures/ and tables/ into a folder; returns the path of index.html.

    The same joints give the same bytes in every file but timings.json. Everything is written before anything is moved to its place; only what
    bristle made there before is replaced.

    Args:
        joints: at least one; names differ.
        folder: made where it does not exist.
        title: of the first page.
        seed: of whatever random numbers the results rest on; None where there are none.
        timings: seconds spent, by name, for timings.json; None: no such file.
        progress: called with what is being done, how many steps are done, and how many there are.
        appended: gives the page of another question; None: there is none.
        explored: gives the interactive page, and the names of the joints on it; None: there is none.
        begun: by joint what `begin` gave; figures of others are drawn here.
        mailed: whether all but timings.json is written as report.zip in the folder as well.
        experiments: files that the joints were identified from, as results.json in this folder names them.

    Raises:
        InputError: no joint, two joints of one name, the folder is a file, or files in it that bristle did not make are in the way.
        OSError: the folder cannot be written; nothing in it is changed.
    """
    names = [joint.name for joint in joints]
    if not joints or len(set(names)) < len(names):
        raise ValueError(f"a report needs joints of different names; got {', '.join(names) or 'none'}")
    files: dict[str, bytes] = {}
    figures = _figures(joints, files, begun, progress)
    files |= tables_of(tables.all_tables(joints))
    files["results.json"] = encoded(results_file.to_json(joints, experiments))
    if timings is not None:
        files["timings.json"] = encoded(json.dumps({k: round(v, 6) for k, v in timings.items()}, indent=1) + "\n")
    section = appended() if appended else None
    files |= section.files if section else {}
    step(progress, "writing the report")
    menu = [x for x in _PAGES if any(map(x.wanted, joints)) or (section and x.file == section.file)]
    context = sections.report(joints, title, seed, figures, section)
    played = explored()
    if played is not None:
        files["explore.html"] = encoded(played[0])
        menu.append(_EXPLORE)
    context["explored"] = {name: k for k, name in enumerate(played[1])} if played else {}
    context |= {"pages": {x.file: x.name for x in menu}, "purposes": {x.file: x.purpose for x in menu}}
    return write_pages(folder, _pages(menu, context, section, files), files, mailed=mailed)


def _pages(
    menu: Sequence[_Page], context: Mapping[str, Any], section: Section | None, files: dict[str, bytes]
) -> Iterator[Page]:
    """The pages in the order of the menu; figures of the section are put into the files when it is its turn."""
    for page in menu:
        named = {**context, "here": page.file}
        if section and page.file == section.file:
            figures = drawn(section.drawings, files, section.done)
            yield page.file, section.package, section.template, {**named, **section.context(figures)}
        elif page.template:
            yield page.file, "bristle.questions.joint_report", page.template, named


def begin(joint: Joint, share: Share) -> Iterator[Rendered]:
    """The figures of a joint, drawn by whoever shares the work: `begun` of `write_report`."""
    return rendered(_drawings(joint, "").values(), share)


def _drawings(joint: Joint, slug: str) -> dict[str, Drawing]:
    found = {
        kind: Drawing(partial(draw, joint), f"{slug}-{kind}", f"{kind.replace('-', ' over ')} of {joint.name}")
        for kind, draw in _DRAW.items()
        if joint.static or kind not in _OF_STATIC
    }
    for kind, draw_intervals in interval_figures.figures(joint).items():
        name = f"uncertainty-{kind}"
        found[name] = Drawing(draw_intervals, f"{slug}-{name}", f"intervals of {joint.name}, {kind}")
    return found


_FIG_1 = {"stribeck": Drawing(static_figures.stribeck_figure, "fig1-stribeck", "the steady-state curve")}


def _figures(
    joints: Sequence[Joint],
    files: dict[str, bytes],
    begun: Mapping[str, Iterator[Rendered]],
    progress: Progress | None,
) -> dict[str, dict[str, Drawn]]:
    """Draw everything into `files`; returns the elements of the pages by joint (`` for none) and figure."""
    slugs = wording.slugs([joint.name for joint in joints])
    every = {joint.name: _drawings(joint, slug) for joint, slug in zip(joints, slugs, strict=True)}
    tell = teller(progress, sum(map(len, every.values())) + 1)
    found = {"": drawn(_FIG_1, files, tell=tell)}
    return found | {name: drawn(own, files, begun.get(name), tell) for name, own in every.items()}
