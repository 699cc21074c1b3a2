"""Style of figures: colours for colour-blind readers, markers and lines for grey print, no mathtext, fixed salt."""

import io
import re
import warnings
from collections import Counter
from collections.abc import Callable
from functools import wraps
from typing import Any, NamedTuple, ParamSpec, TypeVar

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import AutoLocator, FuncFormatter, Locator, MaxNLocator, NullLocator

from bristle.page.wording import shortened

P = ParamSpec("P")
R = TypeVar("R")

_SALT = "bristle"  # also tells that the style is on: nobody else has it
_STYLE: Any = {  # matplotlib types each key singly
    "text.parse_math": False,  # a $ in a joint's name is a $
    "svg.fonttype": "none",  # text stays text: small, searchable, sharp
    "svg.hashsalt": _SALT,
    "font.family": ["DejaVu Sans"],
    "font.size": 10.5,
    "axes.titlesize": 10.5,
    "axes.titley": 1.0,  # found by itself, it takes a tenth of the drawing
    "axes.labelsize": 10.5,
    "legend.fontsize": 9.0,
    "legend.framealpha": 0.85,
    "axes.grid": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
}
ON_LIGHT, ON_DARK = "#010101", "#fefefe"  # text on cells of a map, which keep their colours on a dark page
LINES = ("-", "--", ":")
WIDTH = 5.8  # inches; at this width text lands at about 14 px on a wide screen and 9 px on a phone
DPI = 240
_TICKS = 5  # intervals of a linear axis, at most: more make a figure slower to draw, and no easier to read
_MOST_TICKS = 8
# labels of a logarithmic axis, the closest first
_STEPS_OF_DECADE = ((1.0, 1.5, 2.0, 3.0, 5.0, 7.0), (1.0, 2.0, 5.0), (1.0, 3.0), (1.0,))


class Look(NamedTuple):
    """How one direction is drawn."""

    colour: str
    marker: str
    line: str


# Okabe and Ito's blue and vermilion
DIRECTION = {"+": Look("#0072B2", "o", "-"), "-": Look("#D55E00", "s", "--"), "both": Look("#0072B2", "o", "-")}


def styled(draw: Callable[P, R]) -> Callable[P, R]:
    """Run a drawing function in bristle's style, whatever the caller's rcParams; nested calls do nothing more."""

    @wraps(draw)
    def inside(*args: P.args, **kwargs: P.kwargs) -> R:
        if mpl.rcParams["svg.hashsalt"] == _SALT:  # setting all of matplotlib's keys takes as long as a small figure
            return draw(*args, **kwargs)
        with mpl.rc_context(), warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Glyph .* missing from")  # a name in a script that the font lacks
            mpl.rcdefaults()
            mpl.rcParams.update(_STYLE)
            return draw(*args, **kwargs)

    return inside


def new_figure(height: float, width: float = WIDTH) -> Figure:
    """An empty figure, inches, with fixed margins: a layout engine takes as long as the drawing."""
    figure = Figure(figsize=(width, height))
    figure.subplots_adjust(left=0.95 / width, right=1 - 0.15 / width, bottom=0.55 / height, top=1 - 0.45 / height)
    figure.subplots_adjust(hspace=0.36, wspace=0.36)
    return figure


def title(ax: Axes, name: str, simulated: bool) -> None:
    """The joint's name, and whether its data are simulated: figures travel without their captions."""
    ax.set_title(f"{shortened(name, 40)}{' (SIMULATED data)' if simulated else ''}", loc="left", pad=17)


def panels(height: float, name: str, simulated: bool, count: int = 1, **how: Any) -> tuple[Figure, list[Axes]]:
    """A new figure with panels in a column, titled with the joint's name; `how` as of `Figure.subplots`."""
    figure = new_figure(height)
    axes = list(figure.subplots(count, squeeze=False, **how)[:, 0])
    title(axes[0], name, simulated)
    return figure, axes


class _DecimalTicks(Locator):
    """Ticks at as many steps of each decade as give at most `_MOST_TICKS`; evenly spaced if fewer than two."""

    def __call__(self) -> Any:
        """The ticks in view."""
        low, high = sorted(self.axis.get_view_interval()) if self.axis else (1.0, 10.0)
        return self.tick_values(low, high)

    def tick_values(self, vmin: float, vmax: float) -> Any:
        """The ticks between two positive values."""
        decades = 10.0 ** np.arange(np.floor(np.log10(vmin)), np.ceil(np.log10(vmax)) + 1)
        for steps in _STEPS_OF_DECADE:
            places = np.outer(decades, steps).ravel()
            places = places[(places >= vmin) & (places <= vmax)]
            if places.size <= _MOST_TICKS:
                break
        if places.size < 2:
            return MaxNLocator(4).tick_values(vmin, vmax)
        return places[:: -(-places.size // _MOST_TICKS)]


def decimal_log(ax: Axes) -> None:
    """A logarithmic x axis with plain decimal labels that leave one another room."""
    ax.set_xscale("log")
    ax.xaxis.set_major_locator(_DecimalTicks())
    ax.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    ax.xaxis.set_minor_locator(NullLocator())


@styled
def render(figure: Figure) -> tuple[bytes, bytes]:
    """A figure as SVG and PNG: the same bytes for the same data."""
    return render_as(figure, "svg"), render_as(figure, "png")


@styled
def render_as(figure: Figure, kind: str) -> bytes:
    """A figure as bytes of one kind, `svg` or `png`."""
    for ax in figure.axes:
        for axis in (ax.xaxis, ax.yaxis):
            if isinstance(axis.get_major_locator(), AutoLocator):
                axis.set_major_locator(MaxNLocator(_TICKS, steps=[1, 2, 2.5, 5, 10]))
    raw, written = io.BytesIO(), io.BytesIO()
    if kind == "svg":  # with fonts that every system has, coordinates to a hundredth of a point, and no metadata
        figure.savefig(raw, format="svg", dpi=DPI, metadata={"Date": None, "Creator": "bristle"})
        text = raw.getvalue().decode("utf-8").replace("'DejaVu Sans'", "'DejaVu Sans', Verdana, sans-serif")
        text = re.sub(r"\s*<metadata>.*?</metadata>", "", text, flags=re.DOTALL)

        def rounded(tag: re.Match[str]) -> str:
            return _PLACES.sub(lambda x: f"{float(x[0]):.2f}".rstrip("0").rstrip("."), tag[0])

        return _TAG.sub(rounded, text).encode("utf-8")
    # In 256 colours, of which a figure hardly has more: half the size in half the time.
    from PIL import Image, PngImagePlugin

    told = PngImagePlugin.PngInfo()
    figure.savefig(raw, format="rgba", dpi=DPI)
    width = int(figure.get_figwidth() * DPI)
    size = (width, len(raw.getbuffer()) // (4 * width))
    image = Image.frombytes("RGBA", size, raw.getvalue()).convert("RGB")
    told.add_text("Software", "bristle")
    few = image.quantize(256, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    few.putpalette([255 if level > 252 else level for level in few.getpalette() or ()])  # white stays white
    few.save(written, "png", compress_level=4, dpi=(DPI, DPI), pnginfo=told)
    return written.getvalue()


_PLACES = re.compile(r"(?<=[\s\"',(])-?\d+\.\d{3,}(?=[\s\"',)])")  # a coordinate with more places than a screen shows
_TAG = re.compile(r"<[^>]*>")  # Matplotlib writes no bare > into an attribute
_NAMED = re.compile(r'\sid="|url\(#|href="#')  # before an id
_ID = re.compile(r'\sid="([^"]*)"')
_SIZED = re.compile(r'^<svg (.*?)width="[^"]*" height="[^"]*"')
# colours that turn with a light or dark page: variables of the style sheet
_VARIABLES = {"#000000": "ink", "#ffffff": "paper", "#dddddd": "line", "#666666": "quiet", "#999999": "mid"}
_INK = re.compile(rf"(fill|stroke): ({'|'.join(_VARIABLES)})")


def inline(svg: bytes, prefix: str, label: str) -> str:
    """An SVG file as an element of an HTML page: no prologue, unique ids, width left to the page.

    `label`, already escaped, names the figure for a screen reader. Backslashes in a label or prefix are kept.
    """
    text = svg.decode("utf-8")
    text = text[text.index("<svg") :]
    text = _TAG.sub(lambda tag: _INK.sub(lambda found: f"{found[1]}: var(--{_VARIABLES[found[2]]})", tag[0]), text)
    text = _TAG.sub(lambda tag: _NAMED.sub(lambda found: f"{found[0]}{prefix}-", tag[0]), text)
    given = Counter[str]()

    def once(found: re.Match[str]) -> str:
        """An id; a repeated one, of the same image drawn twice, with a number."""
        given[found[1]] += 1
        return found[0] if given[found[1]] == 1 else f' id="{found[1]}-{given[found[1]]}"'

    text = _TAG.sub(lambda tag: _ID.sub(once, tag[0]), text)
    return _SIZED.sub(lambda found: f'<svg role="img" aria-label="{label}" {found[1]}', text, count=1)


MOST_POINTS = 600  # points drawn per direction; denser data are thinned evenly, which the caption says


def thinned(n: int, most: int = MOST_POINTS) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Indices of at most `most` of n points, evenly spread."""
    return np.unique(np.linspace(0, n - 1, min(n, most)).astype(np.intp)) if n else np.zeros(0, dtype=np.intp)
