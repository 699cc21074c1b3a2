"""The report as HTML pages, each whole by itself, with results, figures and tables beside them."""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from matplotlib.figure import Figure

from bristle.identification.results import Joint, WrittenExperiment
from bristle.page import wording
from bristle.page.page import Drawn, Section, element, encoded, tables_of, write_pages
from bristle.page.style import styled
from bristle.progress import Progress
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

_DRAW: dict[str, Callable[[Joint], Figure | None]] = {
    "small": lambda joint: static_figures.small_figure(joint) if joint.static else None,
    "curve": lambda joint: static_figures.curve_figure(joint) if joint.static else None,
    "profile": static_figures.profile_figure,
    "residuals": static_figures.residuals_figure,
    "presliding": presliding_figures.presliding_figure,
    "hysteresis": presliding_figures.hysteresis_figure,
    "tracking": dynamic_figures.course_figure,
    "tracking-velocity": dynamic_figures.velocity_figure,
}


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
    appended: Section | None = None,
    explored: tuple[str, Sequence[str]] | None = None,
    experiments: Sequence[WrittenExperiment] = (),
    mailed: bool = False,
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
        appended: the page of another question; None: there is none.
        explored: the interactive page, and the names of the joints on it; None: there is none.
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
    drawn = _figures(joints, files, progress)
    files |= tables_of(tables.all_tables(joints))
    files |= appended.files if appended else {}
    files["results.json"] = encoded(results_file.to_json(joints, experiments))
    if timings is not None:
        files["timings.json"] = encoded(json.dumps({k: round(v, 6) for k, v in timings.items()}, indent=1) + "\n")
    if progress:
        progress("writing the report", len(_DRAW) * len(joints), len(_DRAW) * len(joints))
    menu = [x for x in _PAGES if any(map(x.wanted, joints)) or (appended and x.file == appended.file)]
    context = sections.report(joints, title, seed, drawn, appended)
    if explored is not None:
        files["explore.html"] = encoded(explored[0])
        menu.append(_EXPLORE)
    context["explored"] = {name: k for k, name in enumerate(explored[1])} if explored else {}
    context |= {"pages": {x.file: x.name for x in menu}, "purposes": {x.file: x.purpose for x in menu}}
    pages = {
        x.file: ("bristle.questions.joint_report", x.template, context | {"here": x.file}) for x in menu if x.template
    }
    if appended:
        pages[appended.file] = (
            appended.package,
            appended.template,
            {**context, **appended.draw(files), "here": appended.file},
        )
    return write_pages(folder, pages, files, mailed=mailed)


@styled
def _figures(
    joints: Sequence[Joint], files: dict[str, bytes], progress: Progress | None
) -> dict[str, dict[str, Drawn]]:
    """Draw everything into `files`; returns the inline SVG by joint (`` for none) and figure."""
    slugs = wording.slugs([joint.name for joint in joints])
    drawn: dict[str, dict[str, Drawn]] = {
        "": {"stribeck": element(static_figures.stribeck_figure(), "fig1-stribeck", "the steady-state curve", files)}
    }
    total, done = len(_DRAW) * len(joints), 0
    for joint, slug in zip(joints, slugs, strict=True):
        own = drawn.setdefault(joint.name, {})
        for kind, draw in _DRAW.items():
            if progress:
                progress(f"drawing {kind} {joint.name}", done, total)
            done += 1
            figure = draw(joint)
            if figure is not None:
                own[kind] = element(figure, f"{slug}-{kind}", f"{kind.replace('-', ' over ')} of {joint.name}", files)
        for kind, draw_intervals in interval_figures.figures(joint).items():
            name = f"uncertainty-{kind}"
            own[name] = element(draw_intervals(), f"{slug}-{name}", f"intervals of {joint.name}, {kind}", files)
    return drawn
