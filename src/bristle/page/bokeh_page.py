"""What pages drawn by Bokeh share: one file that loads nothing, in which no text of a user meets HTML or Bokeh.

What such a page knows lies in one block of JSON, and its own scripts set it as text. A policy in the page forbids every
connection, and every script but these, by their digests.
"""

import json
from collections.abc import Iterable, Mapping
from math import isfinite
from typing import TYPE_CHECKING, Any, Literal

from markupsafe import Markup

from bristle.page.page import digest

if TYPE_CHECKING:
    from bokeh.models import Plot

TOOLS = "pan,box_zoom,wheel_zoom,reset,save"
GREY = "#767676"
"""3:1 on white and on near black."""


def bokeh_script() -> str:
    """Bokeh's core as text; widgets, tables and mathematics are not needed."""
    from bokeh.resources import Resources

    return "\n".join(Resources(mode="inline", components=["bokeh"], minified=True).js_raw)


def json_block(data: Any) -> Markup:
    """JSON that may stand in a script element: no tag can begin in it, and none of its characters ends a line of JavaScript.

    null stands for what is no finite number.
    """
    text = json.dumps(_finite(data), ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return Markup(text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026"))  # noqa: S704  # no character can end the block


def _finite(part: Any) -> Any:
    """A part of the data in which null stands for what is no finite number."""
    if isinstance(part, dict):
        return {key: _finite(x) for key, x in part.items()}
    if isinstance(part, list | tuple):
        return [_finite(x) for x in part]
    return None if isinstance(part, float) and not isfinite(part) else part


def script_elements(texts: Mapping[str, str]) -> dict[str, Markup]:
    """Scripts of our own by name, each as it stands in its element, and as `policy` knows it."""
    return {name: Markup(f"\n{text.strip()}\n") for name, text in texts.items()}  # noqa: S704  # our own, and Bokeh's


def policy(scripts: Iterable[str], *more: str) -> str:
    """The content security policy: nothing is fetched, and no script runs but these; `more`: other directives, as of workers."""
    allowed = " ".join(map(digest, scripts))
    directives = (
        "default-src 'none'", f"script-src {allowed}", *more, "style-src 'unsafe-inline'", "img-src data: blob:", "font-src data:",
        "base-uri 'none'", "form-action 'none'",
    )  # fmt: skip  # a list of values
    return "; ".join(directives)


def bare_plot(
    name: str, height: int, x_axis_type: Literal["linear", "log", "datetime"] = "linear", **given: Any
) -> Any:
    """A figure as wide as its place, of a height in px, on the ground of the page; without marks."""
    from bokeh.plotting import figure

    plot: Any = figure(
        name=name, height=height, sizing_mode="stretch_width", min_width=200, tools=TOOLS,
        x_axis_type=x_axis_type, toolbar_location="above", background_fill_alpha=0.0,
        border_fill_alpha=0.0, outline_line_color=None, min_border_left=64, output_backend="canvas", **given,
    )  # fmt: skip  # a list of values
    plot.toolbar.logo = None
    plot.toolbar.active_drag = None  # a finger that is drawn over a figure scrolls the page
    return plot


def plain_axes(plot: Any) -> None:
    """Labels upright, and kept a place for until the page's script sets them; no powers of ten from 1e-6 up."""
    from bokeh.models import BasicTickFormatter

    for axis in (*plot.xaxis, *plot.yaxis):
        axis.axis_label_text_font_style = "normal"
        axis.axis_label = " "
        if isinstance(axis.formatter, BasicTickFormatter):
            axis.formatter.power_limit_low = -6


def numbered_document(plots: Mapping[str, "Plot"]) -> tuple[dict[str, Any], dict[str, str]]:
    """The Bokeh document of some figures as JSON, its models numbered from 1, and the id of each figure by its name."""
    from bokeh.document import Document

    document = Document()
    with document.models.freeze():  # else every model is looked through anew at each
        for plot in plots.values():
            document.add_root(plot)
    numbers: dict[str, str] = {}
    written = _numbered(document.to_json(deferred=False), numbers)
    ids = [root["id"] for root in written["roots"]]
    return written, dict(zip(plots, ids, strict=True))


def _numbered(part: Any, numbers: dict[str, str]) -> Any:
    """A part of a document in which each model's id is its number in the order of writing: Bokeh counts on in a process."""
    if isinstance(part, list):
        return [_numbered(x, numbers) for x in part]
    if not isinstance(part, dict):
        return part
    own = part.get("id")
    if isinstance(own, str):
        numbers.setdefault(own, f"p{len(numbers) + 1}")
    return {key: numbers[x] if key == "id" and isinstance(x, str) else _numbered(x, numbers) for key, x in part.items()}
