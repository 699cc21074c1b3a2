"""The explorer's figures as Bokeh models: axes, marks and empty sources, which the page's script finds by name."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from bristle.page.style import DIRECTION

if TYPE_CHECKING:
    from bokeh.models import Plot

# Contrast 3:1 on white and on near black: identified values, true values, and a second kind.
GREY, TRUE, SECOND = "#767676", "#009E73", "#CC79A7"
PLUS, MINUS = DIRECTION["+"].colour, DIRECTION["-"].colour
PAPER: dict[str, float] = {"paper.alpha_0": 0.84, "paper.alpha_2": 1.05}  # adapted factors of the paper's section 5


class Mark(NamedTuple):
    """One renderer: the name of its source, its glyph, the columns it draws, how, and its entry in the legend."""

    source: str
    glyph: str
    columns: Mapping[str, str]
    style: Mapping[str, Any]
    legend: str = ""


class Panel(NamedTuple):
    """One figure: its name, height in px, marks, and what its axes are."""

    name: str
    height: int
    marks: Sequence[Mark]
    x_log: bool = False
    shaded: Sequence[str] = ()  # names of hatched regions, which the script places
    spans: Mapping[str, Literal["width", "height"]] = {}  # straight lines across the figure, by name; never changed
    framed: bool = False  # whether the script sets the ranges
    follows: str = ""  # the figure whose x-axis this one shares
    tips: bool = False  # whether points tell their place when the pointer is over them


_XY = {"x": "x", "y": "y"}
_SIZE = {"x": "speed", "y": "size"}
_NOW, _OLD = {"line_width": 2.5}, {"line_width": 1.5, "line_dash": "dashed", "color": GREY}
_REAL = {"line_width": 1.5, "line_dash": "dotted", "color": TRUE}


def _friction(columns: Mapping[str, str]) -> list[Mark]:
    """The marks of the friction curve: signed over velocity, or magnitudes over speed."""
    prefix = "size_" if columns["y"] == "size" else ""
    bars = {"x0": columns["x"], "x1": columns["x"], "y0": f"{prefix}low", "y1": f"{prefix}high"}
    return [
        Mark("bars+", "segment", bars, {"color": PLUS}),
        Mark("bars-", "segment", bars, {"color": MINUS}),
        Mark("truth", "line", columns, _REAL, "true"),
        Mark("identified", "line", columns, _OLD, "identified"),
        Mark("now+", "line", columns, {**_NOW, "color": PLUS}, "these values (+)"),
        Mark("now-", "line", columns, {**_NOW, "color": MINUS}, "these values (−)"),
        Mark("now+.held", "line", columns, {**_NOW, "color": PLUS, "line_dash": "dashed"}),
        Mark("now-.held", "line", columns, {**_NOW, "color": MINUS, "line_dash": "dashed"}),
        Mark("points+", "scatter", columns, {"size": 7, "color": PLUS}, "fitted (+)"),
        Mark("points-", "scatter", columns, {"size": 7, "color": MINUS, "marker": "square"}, "fitted (−)"),
        Mark("sticking", "scatter", columns, {"size": 8, "line_color": GREY, "fill_color": "white"}, "stick-slip"),
        Mark("held", "scatter", columns, {"size": 8, "line_color": GREY, "fill_color": None, "marker": "diamond"}, "held out"),
        Mark("strays", "scatter", columns, {"size": 15, "line_color": SECOND, "fill_color": None, "line_width": 2}, "stray"),
    ]  # fmt: skip  # a table


_MANY = {"xs": "xs", "ys": "ys"}
_CELL = {name: name for name in ("x", "y", "width", "height")}
_HATCHED = {
    "line_color": None, "fill_color": None, "hatch_pattern": "x", "hatch_alpha": 0.6, "hatch_scale": 8,
}  # fmt: skip  # a list of values
_HERE = {"size": 12, "fill_color": "#ffffff", "line_color": "#000000", "line_width": 2}
PANELS: dict[str, tuple[Panel, ...]] = {
    "friction": (
        Panel("curve", 330, _friction(_XY), shaded=("beyond", "before"), framed=True, tips=True),
        Panel("log", 330, _friction(_SIZE), x_log=True, shaded=("faster", "slower"), framed=True, tips=True),
        Panel("residuals", 190, [
            Mark("residuals+", "scatter", _XY, {"size": 6, "color": PLUS}),
            Mark("residuals-", "scatter", _XY, {"size": 6, "color": MINUS, "marker": "square"}),
        ], spans={"zero": "width"}, framed=True),
    ),
    "presliding": (
        Panel("loading", 330, [
            Mark("loadings", "multi_line", _MANY, {"color": GREY, "line_width": 1}, "measured loadings"),
            Mark("edges", "scatter", _XY, {"size": 5, "line_color": TRUE, "fill_color": None}, "count edges"),
            Mark("loading.identified", "line", _XY, _OLD, "identified"),
            Mark("loading.now", "line", _XY, {**_NOW, "color": PLUS}, "these values"),
        ], spans={"level": "width"}),
        Panel("hysteresis", 330, [
            Mark("loops", "multi_line", _MANY, {"color": GREY, "line_width": 1}, "measured loops"),
            Mark("hysteresis.identified", "line", _XY, _OLD, "identified"),
            Mark("hysteresis.now", "line", _XY, {**_NOW, "color": PLUS}, "these values"),
        ]),
    ),
    "response": (
        Panel("velocity", 150, [Mark("velocity.now", "line", _XY, {"line_width": 1.5, "color": PLUS})]),
        Panel("deflection", 170, [
            Mark("deflection.identified", "line", _XY, _OLD, "identified"),
            Mark("deflection.now", "line", _XY, {"line_width": 1.8, "color": PLUS}, "these values"),
        ], follows="velocity"),
        Panel("torque", 230, [
            Mark("torque.measured", "line", _XY, {"line_width": 1.2, "color": SECOND}, "measured"),
            Mark("torque.identified", "line", _XY, _OLD, "identified"),
            Mark("torque.now", "line", _XY, {"line_width": 1.8, "color": PLUS}, "these values"),
        ], follows="velocity"),
        Panel("error", 170, [Mark("error.now", "line", _XY, {"line_width": 1.5, "color": MINUS})], spans={"no_error": "width"}, follows="velocity"),
    ),
    "compensation": (
        Panel("gains", 260, [
            Mark("theta_1", "line", _XY, {**_NOW, "color": PLUS}, "α₀"),
            Mark("theta_2", "line", _XY, {**_NOW, "color": MINUS, "line_dash": "dashed"}, "α₂"),
        ], spans=dict.fromkeys(PAPER, "width")),
        Panel("loop_error", 280, [
            Mark("loop_error.none", "line", _XY, {"line_width": 1.2, "color": GREY}, "without"),
            Mark("loop_error.fixed", "line", _XY, {"line_width": 1.8, "color": MINUS, "line_dash": "dashed"}, "fixed start model"),
            Mark("loop_error.adaptive", "line", _XY, {"line_width": 1.8, "color": PLUS}, "adaptive"),
        ], spans={"cut": "height"}, follows="gains"),
        Panel("loop_torque", 200, [Mark("loop_torque.now", "line", _XY, {"line_width": 1.5, "color": PLUS})], follows="gains"),
    ),
    "identifiability": (
        Panel("map", 400, [
            Mark("unlikely", "rect", {**_CELL, "fill_color": "colour", "line_color": "colour"}, {}),
            Mark("active", "patches", {**_MANY, "hatch_color": "ink"}, _HATCHED),
            Mark("map.identified", "scatter", _XY, {"size": 13, "marker": "x", "line_color": "#000000", "line_width": 3}, "identified"),
            Mark("map.truth", "scatter", _XY, {"size": 13, "marker": "star", "fill_color": TRUE, "line_color": "#000000"}, "true"),
            Mark("map.now", "scatter", _XY, _HERE, "these values"),
        ], framed=True),
        Panel("profile", 260, [
            Mark("profile.written", "scatter", _XY, {"size": 4, "color": GREY}, "as identified"),
            Mark("profile.now", "line", _XY, {**_NOW, "color": PLUS}, "α₀, α₁, α₂ refitted here"),
            Mark("profile.here", "scatter", _XY, _HERE, "at this vₛ"),
        ], x_log=True, spans={"threshold": "width"}),
    ),
}  # fmt: skip  # a table
"""The figures of each view, from top to bottom."""


def keys() -> dict[str, list[tuple[str, str, str, str]]]:
    """Legend of each figure for the page: source, name, look and colour; Bokeh's own is slow to paint."""
    found: dict[str, list[tuple[str, str, str, str]]] = {}
    seen = set[str]()
    for panel in (panel for panels in PANELS.values() for panel in panels):
        for mark in (mark for mark in panel.marks if mark.legend and mark.source not in seen):
            style, line = mark.style, "line" in mark.glyph
            look = style.get("line_dash", "solid") if line else style.get("marker", "circle")
            hollow = " hollow" if str(style.get("fill_color", GREY)) in ("None", "white", "#ffffff") else ""
            colour = str(style.get("color") or style["line_color"]).replace("#000000", "var(--ink)")
            found.setdefault(panel.name, []).append((mark.source, mark.legend, f"{look}{hollow}", colour))
            seen.add(mark.source)
    return found


def figures() -> dict[str, list["Plot"]]:
    """The figures of each view, empty."""
    sources: dict[str, Any] = {}
    drawn: dict[str, Any] = {}
    return {view: [_drawn(panel, sources, drawn) for panel in panels] for view, panels in PANELS.items()}


def _drawn(panel: Panel, sources: dict[str, Any], drawn: dict[str, Any]) -> "Plot":
    """One figure; a source may be shared by several."""
    from bokeh.models import BasicTickFormatter, ColumnDataSource, HoverTool
    from bokeh.models.annotations.geometry import BoxAnnotation, Span
    from bokeh.plotting import figure

    shared: dict[str, Any] = {"x_range": drawn[panel.follows].x_range} if panel.follows else {}
    if panel.framed:
        shared = {"x_range": (0.1, 1.0), "y_range": (0.0, 1.0)}
    plot: Any = figure(
        name=panel.name, height=panel.height, sizing_mode="stretch_width", min_width=200, tools="pan,box_zoom,wheel_zoom,reset,save",
        x_axis_type="log" if panel.x_log else "linear", toolbar_location="above", background_fill_alpha=0.0,
        border_fill_alpha=0.0, outline_line_color=None, min_border_left=64, output_backend="canvas", **shared,
    )  # fmt: skip  # a list of values
    plot.toolbar.update(logo=None, active_drag=None)  # a finger on a figure scrolls the page
    drawn[panel.name] = plot
    for name in panel.shaded:
        plot.add_layout(BoxAnnotation(
            name=name, left=0, right=0, fill_color=GREY, fill_alpha=0.06, hatch_pattern="/", hatch_color=GREY,
            hatch_alpha=0.35, hatch_scale=10, line_color=None, visible=False,
        ))  # fmt: skip  # a list of values
    for name, dimension in panel.spans.items():
        dash = "solid" if "zero" in name or "no_" in name else "dashed"
        look: dict[str, Any] = {"line_color": GREY, "line_dash": dash}
        plot.add_layout(Span(name=name, location=PAPER.get(name, 0.0), dimension=dimension, line_width=1, **look))
    told = []
    for mark in panel.marks:
        source = sources.setdefault(mark.source, ColumnDataSource(name=mark.source))
        for column in (*mark.columns.values(), *(("place", "x", "y") if mark.glyph == "scatter" else ())):
            if column not in source.data:
                source.add([], column)
        renderer = getattr(plot, mark.glyph)(source=source, **mark.columns, **mark.style)
        told += [renderer] if mark.glyph == "scatter" else []
    if panel.tips:
        torque = panel.name if panel.name != "log" else "torque"
        tips = [("from", "@place"), ("velocity", "@x{0.0000}"), (torque, "@y{0.000000}")]
        plot.add_tools(HoverTool(renderers=told, tooltips=tips))
    # Upright labels, with room until the page's script sets them; no powers of ten from 1e-6 up.
    for axis in plot.axis:
        axis.update(axis_label_text_font_style="normal", axis_label=" ")
        if isinstance(axis.formatter, BasicTickFormatter):
            axis.formatter.power_limit_low = -6
    drawing: Plot = plot
    return drawing
