"""Pages: a template with its context, figures and tables becomes index.html and the files beside it."""

import hashlib
import platform
from base64 import b64encode
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache
from importlib import metadata, resources
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd
from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape
from matplotlib.figure import Figure

from bristle import __version__
from bristle.errors import InputError
from bristle.model.laws.registry import own_parameter
from bristle.page import wording
from bristle.page.figure_data import csv_of
from bristle.page.output_folder import write_bytes
from bristle.page.plain import to_csv
from bristle.page.said import Link, entries_linked, flagged, said, told, warned, with_places
from bristle.page.style import inline, render, render_as, styled
from bristle.page.wording import FITS, METHODS, free
from bristle.workers import Share


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure as the .svg or .png file that its path names.

    Raises InputError as `figure_kind` and `write_text` do.
    """
    write_bytes(path, render_as(figure, figure_kind(path)))


def figure_kind(path: Path) -> str:
    """The format, svg or png, of a figure's path. Raises InputError where it names neither."""
    if path.name.lower() in {".svg", ".png"}:
        raise InputError(f"{path}: has no name before its {path.name}; name a file, as figure{path.name.lower()}")
    kind = path.suffix.lower().lstrip(".")
    if kind not in {"svg", "png"}:
        raise InputError(f"{path}: figures are written as .svg or .png; end the name with one of them")
    return kind


class Drawing(NamedTuple):
    """A figure to be drawn."""

    draw: Callable[[], Figure | None]
    """Draws it; None: there is nothing to draw. Picklable where processes share it. What the same call draws is one figure."""
    name: str
    """Of its files in figures/."""
    label: str
    """How it is called for a reader who does not see it."""
    caption: str = ""
    """Of a figure in a section of a `Report`."""
    how: str = ""
    """How to read it, after the caption; a page says it once."""
    data: str = ""
    """The table that its caption links to, by the name of its file."""
    paper: str = ""
    """What the paper calls this figure, as Fig. 4."""
    simulated: bool = False
    """Whether the caption begins with SIMULATED data."""
    done: "Iterator[Rendered] | None" = None
    """Gives it rendered, where others have begun to; see `begun`."""


def tables_of(frames: Mapping[str, pd.DataFrame]) -> dict[str, bytes]:
    """Tables as CSV files, by relative path."""
    return {f"tables/{name}.csv": encoded(to_csv(frame)) for name, frame in frames.items()}


Rendered = tuple[bytes, bytes, bytes] | None
"""A figure as SVG and PNG, and its data as CSV; None: there is nothing to draw."""


def begun(drawing: Drawing, share: Share = map) -> Drawing:
    """A figure that others begin to draw and to render now."""
    return drawing._replace(done=iter(share(_rendered, [drawing.draw])))


def drawn(
    drawings: Iterable[Drawing], files: dict[str, bytes], tell: Callable[[str], None]
) -> dict[Any, tuple[str, Markup]]:
    """Figures rendered into `files`, by relative path; name and SVG of each by what draws it, unless it is empty.

    Each is told by its label; a name that is taken gets a number.
    """
    found: dict[Any, tuple[str, Markup]] = {}
    for drawing in drawings:
        tell(f"drawing {drawing.label}")
        forms = next(drawing.done or begun(drawing).done or iter(()))
        if forms is not None:
            name = free(drawing.name, lambda tried: f"figures/{tried}.svg" in files)
            for kind, form in zip(("svg", "png", "csv"), forms, strict=True):
                files[f"figures/{name}.{kind}"] = form
            svg = inline(forms[0], name, escape(wording.printable(drawing.label)))
            found[drawing.draw] = name, Markup(svg)  # noqa: S704 # matplotlib escaped every text in it, and `escape` the label
    return found


@styled
def _rendered(draw: Callable[[], Figure | None]) -> Rendered:
    figure = draw()
    return None if figure is None else (*render(figure), csv_of(figure))


def html(package: str, template: str, context: Mapping[str, Any]) -> str:
    """A template of a package or of the kit, filled in."""
    return _environment(package).get_template(template).render(context)


@cache
def _environment(package: str) -> Environment:
    """The environment of templates, cached: compiling those of a report takes a tenth of its time."""
    environment = Environment(
        loader=ChoiceLoader([PackageLoader(package), PackageLoader("bristle.page")]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "cell": _cell, "cell_kind": lambda column: _KINDS.get(column, ""), "heading": heading,
        "direction": wording.direction, "symbol": symbol_html, "plain_symbol": wording.symbol,
        "warned": warned, "flagged": flagged, "said": said, "with_places": with_places, "entries": entries_linked,
    }  # fmt: skip  # a table of names
    # The one script of a page, and its hash, by which a browser runs it and no other.
    script = (resources.files("bristle.page") / "templates" / "tables.js").read_text(encoding="utf-8")
    script = f"\n{script.rstrip()}\n"
    environment.globals |= {"script": Markup(script), "script_hash": digest(script)}  # noqa: S704  # a file of ours
    return environment


def digest(script: str) -> str:
    """The name of a script in a content security policy: 'sha256-...'."""
    return f"'sha256-{b64encode(hashlib.sha256(script.encode('utf-8')).digest()).decode('ascii')}'"


def symbol_html(name: str) -> Markup:
    """A parameter's symbol as HTML: alpha_0 -> α with subscript 0."""
    text = symbol = wording.symbol(name)
    for character, plain in zip("₀₁₂₃ₛ", "0123s", strict=True):
        text = text.replace(character, f"_{plain}")
    parts = text.split("_", 1)
    if len(parts) == 1 or parts[0] not in {"α", "σ", "v"}:
        return escape(symbol if own_parameter(name) else name)
    return Markup("<i>{}</i><sub>{}</sub>{}").format(parts[0], parts[1][:1], parts[1][1:])


def heading(column: str) -> str:
    """The heading of a table's column."""
    return _HEADINGS.get(column, column)


_HEADINGS = {
    "standard_error": "standard error", "systematic": "systematic error", "error_percent": "error (%)", "inside": "inside?", "lower": "95 % from",
    "upper": "95 % to", "relative_error_of_fit": "of the fit (%)",
    "difference_in_se": "difference (standard errors)", "grid": "refined grid",
    "full": "full nonlinear fit", "relative_error": "relative error (%)",
    "start": "from row", "stop": "to row", "recommended": "use it?",
    "of": "joint", "kind": "amplitude", "at_4_s": "at 4 s", "at_20_s": "at 20 s",
    "gains_of_1": "unexplained, gains of 1 (%)", "shares": "final ratios",
    "inertia_feed_forward": "inertia feed-forward", "adapted": "unexplained, adapted (%)",
    "stage_value": "its own stage", "tracking_value": "moving runs", "joint_value": "joint fit",
}  # fmt: skip  # a table of words


_KINDS = {  # classes of the style sheet: long text, short text on one line, names of files
    **dict.fromkeys(("warnings", "reasons", "notes", "verdict", "What happened", "What it says"), "t"),
    **dict.fromkeys(
        (
            "parameter", "unit", "direction", "of", "scheme", "law", "controller", "method", "fit", "source", "stage", "stage_value",
            "tracking_value", "joint_value", "model", "directions", "rows", "Since", "Session", "Finding",
            "File of the latest session", "covariance", "profile", "bootstrap", *FITS.values(), *(f"{fit}, 95 %" for fit in FITS.values()),
        ),
        "s",
    ),
    **dict.fromkeys(("file", "File"), "f"),
}  # fmt: skip  # a table of words


_DIGITS = {"difference_in_se": 2, "difference": 2} | dict.fromkeys(("error_percent", "standard_error", "systematic"), 3)


def _cell(value: Any, column: str) -> str | Markup:
    """A value of a table's column in the page."""
    if isinstance(value, tuple | Link):
        return Markup("<br>").join(map(said, value if isinstance(value, tuple) else (value,)))
    return symbol_html(str(value)) if column == "parameter" and value is not None else cell_text(value, column)


def cell_text(value: Any, column: str) -> str:
    """A value of a table's column as text."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None:
        return wording.MISSING
    if isinstance(value, tuple | Link):
        return told(value)
    if isinstance(value, float):
        return wording.number(value, _DIGITS.get(column, 5))
    return _CELLS.get(column, str)(str(value))


_CELLS: dict[str, Callable[[str], str]] = {
    "unit": wording.pretty,
    "warnings": lambda sentences: sentences.replace(".; ", ". "),
    "direction": lambda d: d if d == "shared" else wording.direction(d),
    **dict.fromkeys(("method", "fit", "source"), lambda key: {**METHODS, **FITS}.get(key, key)),
}


def encoded(text: str) -> bytes:
    """Text in UTF-8; lone surrogates as Python escapes them."""
    return text.encode("utf-8", "backslashreplace")


_LIBRARIES = ("casadi", "numpy", "scipy", "pandas", "matplotlib", "pint", "pydantic", "jinja2")


def versions(seed: int | None) -> dict[str, Any]:
    """Versions that made a page."""
    own = [("bristle", __version__), ("Python", platform.python_version())]
    return {"version": __version__, "versions": [*own, *((x, metadata.version(x)) for x in _LIBRARIES)], "seed": seed}
