"""The report as one self-contained HTML page with its results, figures and tables beside it."""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from markupsafe import Markup
from matplotlib.figure import Figure

from bristle.identification.results import Joint, WrittenExperiment
from bristle.page import wording
from bristle.page.page import Section, element, encoded, tables_of, write_page
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

_DRAW: dict[str, Callable[[Joint], Figure | None]] = {
    "curve": lambda joint: static_figures.curve_figure(joint) if joint.static else None,
    "profile": static_figures.profile_figure,
    "residuals": static_figures.residuals_figure,
    "presliding": presliding_figures.presliding_figure,
    "hysteresis": presliding_figures.hysteresis_figure,
    "tracking": dynamic_figures.course_figure,
    "tracking-velocity": dynamic_figures.velocity_figure,
}


def write_report(
    joints: Sequence[Joint],
    folder: Path,
    *,
    title: str,
    seed: int | None,
    timings: Mapping[str, float] | None = None,
    progress: Progress | None = None,
    appended: Section | None = None,
    experiments: Sequence[WrittenExperiment] = (),
) -> Path:
    """Write index.html, results.json, figures/ and tables/ into a folder; returns the path of index.html.

    The same joints give the same bytes in every file but timings.json. Everything is written before anything is moved to its place; only what
    bristle made there before is replaced.

    Args:
        joints: at least one; names differ.
        folder: made where it does not exist.
        title: of the page.
        seed: of whatever random numbers the results rest on; None where there are none.
        timings: seconds spent, by name, for timings.json; None: no such file.
        progress: called with what is being done, how many steps are done, and how many there are.
        appended: what another question puts on the page, after the joints; None: nothing.
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
        progress("writing the report", len(_DRAW) * len(joints) + 1, len(_DRAW) * len(joints) + 1)
    context = sections.page(joints, title, seed, drawn) | {"appended": appended}
    return write_page(folder, "bristle.questions.joint_report", "index.html", context, files)


@styled
def _figures(
    joints: Sequence[Joint], files: dict[str, bytes], progress: Progress | None
) -> dict[str, dict[str, Markup]]:
    """Draw everything into `files`; returns the inline SVG by joint (`` for none) and figure."""
    slugs = wording.slugs([joint.name for joint in joints])
    drawn: dict[str, dict[str, Markup]] = {"": {}}
    total, done = len(_DRAW) * len(joints) + 1, 0
    for joint, slug in [(None, "fig1"), *zip(joints, slugs, strict=True)]:
        own = drawn.setdefault(joint.name if joint else "", {})
        for kind in _DRAW if joint else ("stribeck",):
            if progress:
                progress(f"drawing {kind} {joint.name if joint else ''}".rstrip(), done, total)
            done += 1
            figure = _DRAW[kind](joint) if joint else static_figures.stribeck_figure()
            if figure is None:
                continue
            label = f"{kind.replace('-', ' over ')} of {joint.name}" if joint else "the steady-state curve"
            own[kind] = element(figure, f"{slug}-{kind}", label, files)
        for kind, draw in interval_figures.figures(joint).items() if joint else ():
            own[f"uncertainty-{kind}"] = element(
                draw(), f"{slug}-uncertainty-{kind}", f"intervals of {joint.name}, {kind}" if joint else "", files
            )
    return drawn
