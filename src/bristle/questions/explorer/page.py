"""The explorer's page: one HTML file with Bokeh, the physics and the data of the joints, which loads nothing.

Texts of users are in one block of JSON and are set as text. A policy in the page forbids connections, and scripts other
than the page's, by their digests. Cost maps are computed by a worker made of the text of some of these scripts.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from markupsafe import Markup
from pydantic_core import to_json

from bristle import __version__
from bristle.identification.results import Joint
from bristle.model.parameters import fields_of, least_of
from bristle.page.output_folder import write_bytes
from bristle.page.page import digest, encoded, html
from bristle.page.wording import PARAMETERS, symbol
from bristle.questions.explorer.data import explored
from bristle.questions.explorer.engine import script
from bristle.questions.explorer.figures import PANELS, PAPER, figures, keys
from bristle.simulation.joint_loop import JointLoop

_HERE = Path(__file__).parent
_SCRIPTS = ("costs", "app", "friction", "presliding", "response", "compensation", "identifiability", "values", "start")
_VIEWS = {"friction": "Friction curve", "presliding": "Presliding", "response": "Time response"}
_VIEWS |= {name: name.capitalize() for name in ("compensation", "identifiability", "values")}


@dataclass(frozen=True, slots=True, kw_only=True)
class Explorer:
    """The page of some joints."""

    joints: tuple[str, ...]
    """Their names."""
    html: str
    """The whole page."""

    def write(self, path: Path | str) -> Path:
        """Write the page as one file. Raises InputError where it cannot be written, or another file is there."""
        write_bytes(Path(path), encoded(self.html))
        return Path(path)

    def __repr__(self) -> str:
        return f"Explorer({', '.join(map(repr, self.joints))}: {len(self.html)} characters)"


def explorer(joints: Sequence[Joint], loops: Mapping[str, JointLoop | str]) -> Explorer:
    """The page of some joints; arguments and errors as of `data.explored`. Equal arguments give equal bytes."""
    from bokeh.resources import Resources

    known = explored(joints, loops)
    document, roots = _drawing()
    laws = tuple(dict.fromkeys((*(x.law for x in joints), *(p.law for x in joints for p in x.truth.values()))))
    words = dict(PARAMETERS)  # of each parameter with a slider
    for law in laws:
        words |= {own.name: f"{law.peak.title} peak" for own in law.peak.own}
        words |= {term.coefficient.name: f"of {term.title}" for term in law.terms}
    symbols = {name: symbol(name) for law in laws for name in fields_of(law)}
    settings = {"parameters": [*words], "symbols": symbols, "paper": PAPER}
    data = {"known": known, "settings": settings, "document": document, "roots": roots}
    # Scripts by name: Bokeh's core, without widgets, tables and mathematics, then our own.
    texts = {
        "bokeh": "\n".join(Resources(mode="inline", components=["bokeh"], minified=True).js_raw),
        "bristle": script([loop for loop in loops.values() if isinstance(loop, JointLoop)], laws),
        **{name: (_HERE / f"{name}.js").read_text(encoding="utf-8") for name in _SCRIPTS},
    }
    scripts = {name: Markup(f"\n{text.strip()}\n") for name, text in texts.items()}  # noqa: S704
    policy = (
        "default-src 'none'", f"script-src {' '.join(map(digest, scripts.values()))}", "worker-src blob:", "style-src 'unsafe-inline'",
        "img-src data: blob:", "font-src data:", "base-uri 'none'", "form-action 'none'",
    )  # fmt: skip  # a list of values
    # JSON without characters of tags; null for numbers that are not finite.
    block = to_json(data, inf_nan_mode="null").decode()
    block = block.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
    named = {
        "data": Markup(block), "scripts": scripts, "policy": "; ".join(policy), "views": _VIEWS,  # noqa: S704  # no character can end the block
        "panels": {view: [panel.name for panel in panels] for view, panels in PANELS.items()}, "parameters": words,
        "signed": [name for name in words if least_of(name) < 0], "keys": keys(), "version": __version__,
    }  # fmt: skip  # a list of values
    page = html("bristle.questions.explorer", "explore.html", named)
    return Explorer(joints=tuple(joint["name"] for joint in known["joints"]), html=page)


@cache
def _drawing() -> tuple[dict[str, Any], dict[str, str]]:
    """The empty figures as Bokeh's JSON, and the id of each by name; cached, as they take most of a page's time."""
    from bokeh.document import Document

    plots = [plot for view in figures().values() for plot in view]
    document, numbers = Document(), dict[str, str]()
    with document.models.freeze():  # no search of all models at each
        for plot in plots:
            document.add_root(plot)

    def numbered(part: Any) -> Any:
        """A part with ids of models numbered from 1, because Bokeh counts on in a process."""
        if isinstance(part, list):
            return [numbered(x) for x in part]
        if not isinstance(part, dict):
            return part
        own = part.get("id")
        if isinstance(own, str):
            numbers.setdefault(own, f"p{len(numbers) + 1}")
        return {key: numbers[x] if key == "id" and isinstance(x, str) else numbered(x) for key, x in part.items()}

    written = numbered(document.to_json(deferred=False))
    return written, {str(plot.name): root["id"] for plot, root in zip(plots, written["roots"], strict=True)}
