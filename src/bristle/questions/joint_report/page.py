"""The report as one self-contained HTML page with its results, figures and tables beside it."""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape
from matplotlib.figure import Figure

from bristle.errors import InputError
from bristle.identification.known_model import SEED
from bristle.identification.results import Joint
from bristle.page import wording
from bristle.page.output_folder import replace_files, write_bytes, write_text
from bristle.page.spreadsheet import to_csv
from bristle.page.style import inline, render, render_as, styled
from bristle.page.wording import free
from bristle.progress import Progress
from bristle.questions.compensation import page
from bristle.questions.compensation import tables as compensation_tables
from bristle.questions.compensation.study import Study
from bristle.questions.joint_report import (
    dynamic_figures,
    interval_figures,
    presliding_figures,
    results_file,
    sections,
    static_figures,
    tables,
)
from bristle.questions.joint_report.dynamic import FITS
from bristle.questions.joint_report.presliding import METHODS

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["save_figure", "write_part", "write_report", "write_text"]

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
    study: Study | None = None,
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
        study: of the compensated joints, whose sections then follow; None: none.

    Raises:
        InputError: no joint, two joints of one name, the folder is a file, or files in it that bristle did not make are in the way.
        OSError: the folder cannot be written; nothing in it is changed.
    """
    names = [joint.name for joint in joints]
    if not joints or len(set(names)) < len(names):
        raise ValueError(f"a report needs joints of different names; got {', '.join(names) or 'none'}")
    files: dict[str, bytes] = {}
    drawn = _figures(joints, files, progress)
    frames = tables.all_tables(joints)
    files |= {f"tables/{name}.csv": _csv(frame) for name, frame in frames.items()}
    compensation = _compensation(study, files) if study else None
    files["results.json"] = _encoded(results_file.to_json(joints))
    if timings is not None:
        files["timings.json"] = _encoded(json.dumps({k: round(v, 6) for k, v in timings.items()}, indent=1) + "\n")
    context = sections.page(joints, title, seed, drawn) | {"compensation": compensation}
    files["index.html"] = _encoded(_html("index.html", context))
    if progress:
        progress("writing the report", len(_DRAW) * len(joints) + 1, len(_DRAW) * len(joints) + 1)
    replace_files(folder, files)
    return folder / "index.html"


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure as the .svg or .png file that its path names.

    Raises InputError for another suffix, and as `write_text` does.
    """
    kind = path.suffix.lower().lstrip(".")
    if kind not in {"svg", "png"}:
        raise InputError(f"{path}: figures are written as .svg or .png; end the name with one of them")
    write_bytes(path, render_as(figure, kind))


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
            own[kind] = _drawn(figure, f"{slug}-{kind}", label, files)
        for kind, draw in interval_figures.figures(joint).items() if joint else ():
            own[f"uncertainty-{kind}"] = _drawn(
                draw(), f"{slug}-uncertainty-{kind}", f"intervals of {joint.name}, {kind}" if joint else "", files
            )
    return drawn


def write_adaptation(study: Study, folder: Path, title: str) -> Path:
    """Write the compensated joint alone: index.html, figures/ and tables/; returns the path of index.html. Raises as `write_report` does."""
    files: dict[str, bytes] = {}
    context = {"title": title, "simulated": study.subjects[0].simulated, **sections.versions(SEED)}
    context["compensation"] = _compensation(study, files)
    return _page(folder, "adapt.html", context, files)


@styled
def write_part(
    folder: Path,
    template: str,
    context: Mapping[str, Any],
    figures: Mapping[str, tuple[Callable[[], Figure | None], str]],
    frames: Mapping[str, "pd.DataFrame"],
) -> Path:
    """Write a page of its own: index.html from a template, figures/ and tables/; returns the path of index.html. Raises as `write_report` does.

    Args:
        folder: made where it does not exist.
        template: one that extends base.html; beside `context` it gets `figures`, an element of the page by name, without those that are None.
        context: what else it names, `seed` among it, the seed of the random numbers or None.
        figures: by the name of its file, what draws each, and how it is called for a reader who does not see it.
        frames: each table by the name of its file.
    """
    files = {f"tables/{name}.csv": _csv(frame) for name, frame in frames.items()}
    made = ((name, draw(), label) for name, (draw, label) in figures.items())
    drawn = {name: _drawn(figure, name, label, files) for name, figure, label in made if figure is not None}
    return _page(folder, template, {**sections.versions(context["seed"]), **context, "figures": drawn}, files)


def _page(folder: Path, template: str, context: Mapping[str, Any], files: dict[str, bytes]) -> Path:
    files["index.html"] = _encoded(_html(template, context))
    replace_files(folder, files)
    return folder / "index.html"


@styled
def _compensation(study: Study, files: dict[str, bytes]) -> dict[str, Any]:
    """Figures and tables of the compensated joint, added to the files, and what its template names."""
    drawn: dict[str, Markup] = {}
    for kind, draw in page.draw(study).items():
        figure = draw(study)
        if figure is not None:
            drawn[kind] = _drawn(
                figure, f"compensation-{kind}", f"{kind} of {study.subjects[0].name}, compensated", files
            )
    files |= {f"tables/{name}.csv": _csv(frame) for name, frame in compensation_tables.all_tables(study).items()}
    return page.section(study) | {"figures": drawn}


def _drawn(figure: Figure, name: str, label: str, files: dict[str, bytes]) -> Markup:
    """A figure rendered into `files`, and as an element of the page; `label` names it for a reader who does not see it.

    Where joints are called so that another figure has the name already, it gets a number.
    """
    name = free(name, lambda tried: f"figures/{tried}.svg" in files)
    files[f"figures/{name}.svg"], files[f"figures/{name}.png"] = render(figure)
    return Markup(inline(files[f"figures/{name}.svg"], name, escape(wording.printable(label))))  # noqa: S704 # matplotlib escaped every text in it, and `escape` the label


def _html(template: str, context: Mapping[str, Any]) -> str:
    environment = Environment(
        loader=PackageLoader("bristle.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"cell": _cell, "heading": _heading, "direction": wording.direction, "symbol": symbol_html}
    return environment.get_template(template).render(context)


def symbol_html(name: str) -> Markup:
    """A parameter's symbol as HTML: alpha_0 -> α with subscript 0."""
    text = wording.symbol(name)
    for character, plain in zip("₀₁₂ₛ", "012s", strict=True):
        text = text.replace(character, f"_{plain}")
    parts = text.split("_", 1)
    if len(parts) == 1 or parts[0] not in {"α", "σ", "v"}:
        return escape(name)
    return Markup("<i>{}</i><sub>{}</sub>{}").format(parts[0], parts[1][:1], parts[1][1:])


_HEADINGS = {
    "standard_error": "standard error", "error_percent": "error (%)", "inside": "inside?", "lower": "95 % from",
    "upper": "95 % to", "plain_grid": "plain grid", "without_stick_slip": "without stick-slip", "huber": "Huber",
    "without_standard_error": "its standard error", "difference_in_se": "difference (standard errors)", "grid": "refined grid",
    "full": "full nonlinear fit", "relative_error": "relative error (%)", "relative_error_of_fit": "on its own data (%)",
    "start": "from row", "stop": "to row", "from_median_percent": "from the median (%)", "recommended": "use it?",
    "of": "joint", "at_4_s": "at 4 s", "at_20_s": "at 20 s", "gains_of_1": "gains of 1 (%)", "begun": "begun at",
    "inertia_feed_forward": "inertia feed-forward", "adapted": "adapted (%)",
    "stage_value": "its own stage", "tracking_value": "moving runs", "joint_value": "joint fit",
}  # fmt: skip  # a table of words


def _heading(column: str) -> str:
    return _HEADINGS.get(column, column)


_DIGITS = {"difference_in_se": 2, "difference": 2, "error_percent": 3, "standard_error": 3, "from_median_percent": 3}


def _cell(value: Any, column: str) -> str | Markup:
    """How one value of a table's column stands in the page."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None:
        return wording.MISSING
    if isinstance(value, float):
        return wording.number(value, _DIGITS.get(column, 5))
    if column == "parameter":
        return symbol_html(str(value))
    return _CELLS.get(column, str)(str(value))


def _named(key: str) -> str:
    """A method or a fit by its name; any other word as it is."""
    return {**METHODS, **FITS}.get(key, key)


_CELLS: dict[str, Callable[[str], str]] = {
    "unit": wording.pretty,
    "direction": lambda d: d if d == "shared" else wording.direction(d),
    **dict.fromkeys(("method", "fit", "source"), _named),
}


def _csv(frame: "pd.DataFrame") -> bytes:
    return _encoded(to_csv(frame))


def _encoded(text: str) -> bytes:
    return text.encode("utf-8", "backslashreplace")
